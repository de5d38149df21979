"""The pure parts of the bus at their edges: ages, deadlines, requests, feeds, images of RPDOs."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from axisbus.bus.node.node import FEED, EmcyFeed
from axisbus.bus.pdo import freshness, sdo_exchange
from axisbus.bus.pdo.choose import lay_out, slots
from axisbus.bus.pdo.mapping import DevicePdos, axis_objects
from axisbus.bus.pdo.plan import PdoChange, PdoRequirements, PlannedPdo, Policy, make_plan
from axisbus.bus.pdo.read import Indices
from axisbus.bus.pdo.rpdo import RpdoImage, arrange
from axisbus.bus.pdo.sdo_exchange import Poller, SdoOutputs, is_stop
from axisbus.bus.pdo.tpdo_inputs import Requests, TpdoSlot
from axisbus.bus.pdo.tpdo_timeout import Deadline, Deadlines, Reception
from axisbus.cia402.port import Sample, ValueTransport
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import StateError
from kit.bus.pdo_configurations import CIA402, objects, rpdo, tpdo
from kit.manual_clock import HandClock

INPUTS = ("statusword", "mode", "position", "velocity", "torque", "demand")
OUTPUTS = ("controlword", "mode", "target_position", "target_velocity", "target_torque")


def plan_of(*pdos: tuple, inputs: tuple[str, ...] = INPUTS, outputs: tuple[str, ...] = OUTPUTS):
    """A plan over a drive's TPDOs as they are: mapping, transmission type, event timer in ms."""
    sent = tuple(
        tpdo(number, text, kind, event=timer[0] if timer else None)
        for number, (text, kind, *timer) in enumerate(pdos, 1)
    )
    policy = Policy(remap=False, communication=False)
    return make_plan(5, DevicePdos((), sent), objects(), PdoRequirements(inputs, outputs), policy)


# How old a value may be.


@pytest.mark.parametrize(
    ("pdo", "period", "age"),
    [
        (("6041/16", 1), 0.004, 0.1),  # five SYNCs, and never less than a tenth of a second
        (("6041/16", 1), 0.05, 0.25),
        (("6041/16", 4), 0.05, 1.0),
        (("6041/16", 240), 0.01, 12.0),
        (("6041/16", 0), 0.05, math.inf),
        (("6041/16", 0, 100), 0.05, math.inf),
        (("6041/16", 255), 0.05, math.inf),
        (("6041/16", 255, 0), 0.05, math.inf),
        (("6041/16", 255, 100), 0.05, 0.11),  # three event times, which are made 20 ms, and a margin
        (("6041/16", 254, 20), 0.05, 0.11),
    ],
)
def test_the_maximum_age_of_a_tpdo_follows_from_its_transmission(pdo, period, age):
    [planned] = [one for one in plan_of(pdo, inputs=("statusword",)).active if not one.receive]
    assert freshness.pdo_age(planned, period) == pytest.approx(age)


def test_values_without_a_pdo_are_polled_and_may_be_three_polls_old():
    plan = plan_of(("6041/16 6064/32", 1))
    assert {name for name, source in plan.inputs.items() if source is ValueTransport.SDO} == {
        "mode",
        "velocity",
        "torque",
        "demand",
    }
    assert freshness.polls(plan) == {"mode": 0.25, "velocity": 0.25, "torque": 0.25, "demand": 0.25}
    assert freshness.max_ages(plan, 0.05) == pytest.approx(
        {"statusword": 0.25, "position": 0.25, "mode": 0.8, "velocity": 0.8, "torque": 0.8, "demand": 0.8}
    )


def test_a_statusword_or_position_sent_on_change_is_also_polled_and_other_values_are_not():
    plan = plan_of(("6041/16 6064/32", 255), ("6061/8 606C/32", 255))
    assert {name: plan.inputs[name] for name in ("statusword", "mode")} == dict.fromkeys(
        ("statusword", "mode"), ValueTransport.EVENT_PDO
    )
    assert freshness.polls(plan) == {"statusword": 0.1, "position": 0.1, "torque": 0.25, "demand": 0.25}
    assert freshness.max_ages(plan, 0.05) == pytest.approx(
        {
            "statusword": 0.35,
            "position": 0.35,
            "mode": math.inf,
            "velocity": math.inf,
            "torque": 0.8,
            "demand": 0.8,
        }
    )
    timed = plan_of(("6041/16 6064/32", 255, 100))
    assert "statusword" not in freshness.polls(timed)
    assert freshness.max_ages(timed, 0.05)["statusword"] == pytest.approx(0.11)


# Deadlines.


def test_a_tpdo_is_missing_after_its_age_and_reported_once_and_so_is_its_return():
    one = Deadline(5, "TPDO1", 0x185, 0.5)
    told = [
        one.step(now, stamp, True, 0.0)
        for now, stamp in [
            (0.0, -math.inf),
            (0.25, 0.25),
            (0.75, 0.25),
            (1.0, 0.25),
            (1.25, 0.25),
            (1.5, 1.4375),
            (1.75, 1.4375),
        ]
    ]
    assert [event is not None for event in told] == [False, False, False, True, False, True, False]
    missing, returned = told[3], told[5]
    assert (missing.what, missing.age, missing.deadline, missing.stamp, missing.never) == (
        Reception.MISSING,
        0.75,
        0.5,
        1.0,
        False,
    )
    assert (returned.what, returned.age, returned.stamp) == (Reception.RETURNED, 1.1875, 1.5)
    assert (
        str(missing)
        == "node 5: TPDO1 (185h) no longer comes: the last one is 750 ms old, expected within 500 ms"
    )
    assert str(returned) == "node 5: TPDO1 (185h) comes again after 1188 ms"


def test_a_tpdo_never_received_is_reported_so_and_is_awaited_from_operational_on():
    one = Deadline(5, "TPDO1", 0x185, 0.5)
    assert one.step(0.0, -math.inf, False, 0.0) is None
    assert one.step(5.0, -math.inf, False, 0.0) is None
    for now in (6.0, 6.25, 6.5):
        assert one.step(now, -math.inf, True, 0.0) is None
    event = one.step(6.75, -math.inf, True, 0.0)
    assert event.never
    assert event.age == 0.75
    assert str(event).endswith(
        "has not come since the node became operational 750 ms ago, expected within 500 ms"
    )
    assert one.step(7.0, -math.inf, False, 0.0) is None  # a node that is not operational owes nothing
    assert one.step(8.0, -math.inf, True, 0.0) is None
    assert one.step(8.75, -math.inf, True, 0.0).never


def test_the_time_that_we_were_late_ourselves_is_not_the_drives_silence():
    one = Deadline(5, "TPDO1", 0x185, 0.5)
    one.step(0.0, -math.inf, True, 0.0)
    one.step(0.25, 0.25, True, 0.0)
    assert one.step(1.0, 0.25, True, 0.25) is None
    assert one.step(1.25, 0.25, True, 0.25) is None
    assert one.step(1.5, 0.25, True, 0.0) is not None
    one.step(2.0, 2.0, True, 0.0)
    assert one.step(2.75, 2.0, True, 0.0) is not None  # the excuse was for the last time


def test_being_late_by_more_than_two_periods_is_an_excuse():
    def told(times: list[float]) -> list[float]:
        deadlines = Deadlines([Deadline(5, "TPDO1", 0x185, 0.5)], 0.125)
        return [now for now in times if deadlines.step(now, [-math.inf], True)]

    assert told([0.0, 0.25, 0.5, 0.75]) == [0.75]
    assert told([0.0, 0.75, 1.0, 1.25]) == [1.25]  # 0.5 s of it are ours
    assert told([0.0, 1.0, 1.25]) == []  # 0.75 s of it are ours
    assert told([0.0, 1.0, 1.25, 1.5]) == [1.5]


# Remote frames, feeds.


def test_a_tpdo_on_request_is_requested_in_its_period_without_catching_up():
    slots_ = [
        SimpleNamespace(request=0.5, cob_id=0x185, size=2),
        SimpleNamespace(request=0.0, cob_id=0x285, size=8),
    ]
    asked = Requests(slots_)
    assert bool(asked)
    assert [now for now in (0.0, 0.25, 0.5, 0.75, 3.0, 3.25, 3.5) if asked.due(now)] == [0.0, 0.5, 3.0, 3.5]
    assert Requests(slots_).due(0.0) == [(0x185, 2)]
    assert not Requests(slots_[1:])
    drifting = Requests(slots_)
    # one that was late does not move the others
    assert [now for now in (0.0, 0.625, 0.875, 1.0, 1.5) if drifting.due(now)] == [0.0, 0.625, 1.0, 1.5]


def test_an_unread_feed_keeps_the_newest_64_and_counts_the_others():
    feed = EmcyFeed()
    assert feed.take() == ()
    for number in range(FEED):
        feed.put(number)
    assert feed.lost == 0
    feed.put(64)
    feed.put(65)
    assert (FEED, feed.lost) == (64, 2)
    assert feed.take() == tuple(range(2, 66))
    assert feed.take() == ()


# Polling.


class Worker:
    def __init__(self) -> None:
        self.clock = HandClock()
        self.jobs = []
        self.began = 0.0  # when the job that has ended was

    def submit(self, job) -> None:
        self.jobs.append(job)


def test_a_value_is_polled_in_its_period_and_not_again_before_its_answer():
    worker = Worker()
    poller = Poller(worker, {"mode": 0.25, "torque": 0.5}, lambda index: index + 0x800)
    poller.poll(10.0)
    assert [(job.index, job.subindex, job.value) for job in worker.jobs] == [
        (0x6861, 0, None),
        (0x6877, 0, None),
    ]
    mode, torque = worker.jobs
    poller.poll(10.25)
    assert len(worker.jobs) == 2
    worker.began = 10.125
    mode.done(8, None)
    poller.poll(10.25)
    assert len(worker.jobs) == 3
    samples = {}
    poller.read_into(samples)
    assert samples == {"mode": Sample(8, 10.125)}  # it was sampled after its request, however late the answer
    samples.clear()
    poller.read_into(samples)
    assert samples == {}
    torque.done(None, 0x06020000)
    worker.jobs[2].done(None, None)
    poller.read_into(samples)
    assert samples == {}
    poller.poll(10.49)
    assert len(worker.jobs) == 3
    poller.poll(10.5)
    assert len(worker.jobs) == 5


def test_an_answer_that_a_newer_pdo_has_overtaken_does_not_count():
    worker = Worker()
    poller = Poller(worker, {"mode": 0.25}, lambda index: index)
    samples = {"mode": Sample(1, -5.0)}
    poller.poll(0.0)
    worker.jobs[0].done(2, None)
    poller.read_into(samples)
    assert samples["mode"].value == 2  # the PDO was of before the poll
    poller.poll(1.0)
    samples["mode"] = Sample(3, worker.clock.now() + 1000.0)  # it was received during the poll
    worker.jobs[1].done(2, None)
    poller.read_into(samples)
    assert samples["mode"].value == 3


# Images.


NAMES = {
    0x6040: "controlword",
    0x6060: "mode",
    0x607A: "target_position",
    0x60FF: "target_velocity",
    0x6071: "target_torque",
}


def images(*texts: str) -> list[RpdoImage]:
    made = []
    for number, text in enumerate(texts, 1):
        pdo = rpdo(number, text, 1)
        names = tuple(NAMES.get(mapped.index) for mapped in pdo.mapping)
        signed = tuple(CIA402.get(mapped.index, (0, False))[1] for mapped in pdo.mapping)
        made.append(RpdoImage(PlannedPdo(True, pdo, pdo, PdoChange.KEEP, names, signed)))
    return made


def test_a_pdo_is_requested_only_if_planned():
    pdo = tpdo(1, "6041/16", 255)
    planned = PlannedPdo(False, pdo, pdo, PdoChange.KEEP, ("statusword",), (False,))
    assert not Requests([TpdoSlot(planned)])
    assert Requests([TpdoSlot(replace(planned, request=0.5))])


def put(image: RpdoImage, **values: int) -> RpdoImage:
    image.take(values)
    return image


def test_a_frame_with_a_value_that_is_not_known_is_not_sent():
    [image] = images("6040/16 6060/8 6081/32")
    assert [str(mapped.index) for mapped, _ in image.unknown] == [str(0x6060), str(0x6081)]
    put(image, mode=1)
    with pytest.raises(StateError, match="not all of its values are known") as caught:
        image.frame(0x0F)
    assert caught.value.observed == "without a value: 6081:00/32"
    image.put(0x6081, 0, 7)
    assert image.unknown == []
    assert image.frame(0x0F)[1].hex() == "0f000107000000"
    with pytest.raises(StateError, match="known") as caught:
        image.frame(None)
    assert "6040h" in caught.value.observed


@pytest.mark.parametrize(
    ("text", "index", "given", "kept"),
    [
        ("607A/32", 0x607A, -1, -1),
        ("607A/32", 0x607A, 2**31, -(2**31)),
        ("607A/32", 0x607A, 2**31 - 1, 2**31 - 1),
        ("607A/32", 0x607A, 2**32 + 5, 5),
        ("6081/32", 0x6081, 2**32 - 1, 2**32 - 1),
        ("6060/8", 0x6060, 0x80, -128),
        ("6060/8", 0x6060, 0x7F, 127),
    ],
)
def test_a_value_is_cut_to_the_bits_that_are_mapped(text, index, given, kept):
    [image] = images(f"6040/16 {text}")
    assert image.put(index, 0, given)
    assert image.value(index, 0) == kept
    assert not image.put(index, 1, 0)
    assert not image.put(0x2000, 0, 0)
    assert image.value(0x2000, 0) is None
    assert image.value(index, 1) is None


def test_only_a_value_that_is_another_one_changes_an_image():
    [image] = images("607A/32 6071/16")
    assert image.take({"target_position": 5})
    assert not image.take({"target_position": 5})
    assert image.take({"target_position": 5, "target_torque": 1})
    assert not image.take({"controlword": 1, "target_velocity": 3})
    assert not image.holds_controlword
    assert images("6040/16 607A/32")[0].holds_controlword


def frames(*texts: str, before: dict, given: dict, word: int | None, previous: int | None) -> list[str]:
    """Return the frames of a cycle as ``RPDO:word``."""
    made = images(*texts)
    for image in made:
        image.take(before)
    numbers = {image.cob_id: number for number, image in enumerate(made, 1)}
    at = {
        image.cob_id: image.names.index("controlword") if image.holds_controlword else None for image in made
    }
    return [
        f"{numbers[cob_id]}" + ("" if at[cob_id] is None else f":{int.from_bytes(data[:2], 'little'):X}")
        for cob_id, data in arrange(made, given, word, previous)
    ]


ALL = {"target_position": 0, "target_velocity": 0, "target_torque": 0, "mode": 1}


@pytest.mark.parametrize(
    ("texts", "given", "word", "previous", "expected"),
    [
        # the target alone goes before the word
        (("6040/16", "607A/32"), {"target_position": 5}, 0x1F, 0x0F, ["2", "1:1F"]),
        (("6040/16 607A/32",), {"target_position": 5}, 0x1F, 0x0F, ["1:1F"]),
        (("6040/16 607A/32",), {"target_position": 0}, 0x1F, 0x0F, ["1:1F"]),
        # nothing given: the first one that holds the word
        (("6040/16 607A/32", "6040/16 60FF/32"), {}, 0x06, None, ["1:6"]),
        (("607A/32",), {}, 0x06, None, []),
        # two with the word: the old one until every value is there
        (
            ("6040/16 607A/32", "6040/16 60FF/32"),
            {"target_position": 5, "target_velocity": 6},
            0x1F,
            0x0F,
            ["1:F", "2:1F", "1:1F"],
        ),
        (
            ("6040/16 607A/32", "6040/16 60FF/32"),
            {"target_position": 5, "target_velocity": 6},
            0x1F,
            None,
            ["1:1F", "2:1F"],
        ),
        (
            ("6040/16 607A/32", "6040/16 60FF/32"),
            {"target_position": 5, "target_velocity": 6},
            0x0F,
            0x0F,
            ["1:F", "2:F"],
        ),
        # one of them unchanged: it comes after the other
        (
            ("6040/16 607A/32", "6040/16 60FF/32"),
            {"target_position": 0, "target_velocity": 6},
            0x1F,
            0x0F,
            ["2:1F", "1:1F"],
        ),
        # without a word nothing that holds it is sent
        (("6040/16 607A/32", "60FF/32"), {"target_position": 5, "target_velocity": 6}, None, 0x0F, ["2"]),
        (("607A/32", "60FF/32"), {"target_velocity": 6}, None, None, ["2"]),
    ],
)
def test_a_new_controlword_is_sent_no_earlier_than_its_values(texts, given, word, previous, expected):
    assert frames(*texts, before=ALL, given=given, word=word, previous=previous) == expected


def test_a_frame_is_decoded_once_and_a_short_one_not_at_all():
    plan = plan_of(("6041/16 6064/32", 1))
    short = []
    slot = TpdoSlot(next(pdo for pdo in plan.active if not pdo.receive), lambda *frame: short.append(frame))
    assert (slot.size, slot.stamp) == (6, -math.inf)
    samples = {}
    slot.read_into(samples, 0.0)
    assert samples == {}
    slot.on_frame(bytes(5), 1.0)
    assert (short, slot.stamp) == ([(bytes(5), 1.0)], -math.inf)
    slot.on_frame(bytes.fromhex("3702 FEFFFFFF"), 2.0)
    slot.read_into(samples, 1.5)
    assert samples == {"statusword": Sample(0x0237, 1.5), "position": Sample(-2, 1.5)}
    samples.clear()
    slot.read_into(samples, 1.5)
    assert samples == {}
    samples["position"] = Sample(9, 3.5)
    slot.on_frame(bytes.fromhex("3702 05000000 FF"), 3.0)
    slot.read_into(samples, 2.5)
    assert samples == {"statusword": Sample(0x0237, 2.5), "position": Sample(9, 3.5)}
    assert (len(short), slot.frames) == (1, 3)


# Which PDOs are an axis's.


@pytest.mark.parametrize(
    ("numbers", "axis", "expected"),
    [
        ((1, 2, 3, 4, 5, 8), 1, (1, 2, 3, 4)),
        ((1, 2, 3, 4, 5, 8), 2, (5, 8)),
        ((4, 2, 1), 1, (1, 2, 4)),
        ((1, 64, 65, 66, 68, 69), 2, (65, 66, 68)),
        ((1, 5, 65), 2, (65,)),
        ((1, 129), 3, (129,)),
        ((9, 12, 13), 3, (9, 12)),
        ((1,), 2, ()),
    ],
)
def test_an_axis_has_its_block_of_64_or_else_its_four(numbers, axis, expected):
    found = slots([tpdo(number, "6041/16", 1) for number in numbers], axis)
    assert tuple(pdo.number for pdo in found) == expected


def test_a_layout_lists_its_objects_including_those_placed_next_to_another_group():
    entries = dict(zip("abcd", objects().values(), strict=False))
    layout = (("a", "c"), ("b",), ("d",))  # 16 and 32 bits, 8, and 32 that find no room
    (pdo,), carried = lay_out([rpdo(1, "")], entries, layout)
    assert pdo[1] == tuple(entries[name].mapped for name in "acb")
    assert carried == {"a", "b", "c"}


@pytest.mark.parametrize(
    ("receive", "number", "communication", "mapping"),
    [
        (True, 1, 0x1400, 0x1600),
        (True, 512, 0x15FF, 0x17FF),
        (False, 1, 0x1800, 0x1A00),
        (False, 4, 0x1803, 0x1A03),
    ],
)
def test_the_indices_of_the_parameters_of_a_pdo(receive, number, communication, mapping):
    assert Indices.of(receive, number) == Indices(communication, mapping)


# Mappable objects, and values sent by SDO.


def test_without_an_eds_every_axis_has_the_standard_s_objects():
    first, third = (axis_objects(Dictionary(None), DevicePdos((), ()), axis) for axis in (1, 3))
    own = {index: entry for index, (_, _, _, _) in CIA402.items() if (entry := first.get(index)) is not None}
    assert sorted(own) == sorted(CIA402) == sorted(first)
    for index, (bits, signed, receive, transmit) in CIA402.items():
        for offset, found in ((0, first), (0x1000, third)):
            entry = found[index + offset]
            assert (entry.bits, entry.signed, entry.receive, entry.transmit) == (
                bits,
                signed,
                receive,
                transmit,
            ), hex(index)


def test_an_object_that_a_drive_maps_exists_without_its_file():
    device = DevicePdos((rpdo(1, "6040/16 607A/32", 1),), ())
    found = axis_objects(Dictionary(Eds("x", {}, {})), device, 1)
    assert sorted(found) == [0x6040, 0x607A]
    assert (found[0x607A].bits, found[0x607A].signed, found[0x607A].receive, found[0x607A].transmit) == (
        32,
        True,
        False,
        False,
    )


@pytest.mark.parametrize(
    ("word", "stops"),
    [
        (0x00, True),
        (0x02, True),
        (0x04, True),
        (0x06, False),
        (0x07, False),
        (0x0F, False),
        (0x0B, True),
        (0x10F, False),
        (0x80, False),  # a fault reset
    ],
)
def test_controlwords_that_end_operation_enabled(word, stops):
    assert is_stop(word) is stops


class Queue(Worker):
    def __init__(self) -> None:
        super().__init__()
        self.first = []

    def urgent(self, job) -> None:
        self.first.append(job)


def by_sdo(*names: str) -> tuple[Queue, SdoOutputs]:
    worker = Queue()
    return worker, SdoOutputs(
        worker,
        dict.fromkeys(names, ValueTransport.SDO) | {"target_torque": ValueTransport.SYNC_PDO},
        lambda index: index + 0x800,
    )


def test_only_a_value_that_is_new_is_written_by_sdo():
    worker, outputs = by_sdo("mode", "target_position")
    assert outputs.take({"mode": 1, "target_torque": 5, "target_position": 0}, 0x0F) == 0x0F
    assert [(job.index, job.value) for job in worker.jobs] == [(0x6860, 1), (0x687A, 0)]
    assert outputs.pending
    outputs.take({"mode": 1}, None)
    assert len(worker.jobs) == 2
    for job in worker.jobs:
        job.done(None, None)
    assert not outputs.pending
    outputs.take({"mode": 1, "target_position": 7}, None)
    assert [job.value for job in worker.jobs] == [1, 0, 7]


@pytest.mark.parametrize(
    ("words", "times"),
    [
        ((0x0F, 0x0F, 0x10F, 0x1F), 1),  # it stays enabled
        ((0x0F, 0x07, 0x07, 0x0F), 2),
        ((0x00, 0x00, 0x06, 0x07, 0x0F), 2),
        ((0x0F, 0x02, 0x02, 0x06, 0x07, 0x0F), 3),
    ],
)
def test_all_values_are_written_again_before_the_drive_is_enabled_again(words, times):
    """Another master may have written them meanwhile."""
    worker, outputs = by_sdo("mode", "target_velocity")
    for word in words:
        outputs.take({"mode": 1, "target_velocity": 0}, word)
    assert [job.value for job in worker.jobs] == [1, 0] * times


def test_a_value_that_was_refused_is_tried_again_after_a_while():
    worker, outputs = by_sdo("mode")
    clock = worker.clock
    clock.time = 5.0
    outputs.take({"mode": 1}, None)
    worker.jobs[0].done(None, 0x06090030)
    clock.time += sdo_exchange.RETRY - 0.125
    outputs.take({"mode": 1}, None)
    assert len(worker.jobs) == 1
    outputs.take({"mode": 2}, None)
    assert len(worker.jobs) == 2
    worker.jobs[1].done(None, 0x06090030)
    clock.time += sdo_exchange.RETRY
    outputs.take({"mode": 2}, None)
    assert len(worker.jobs) == 3
    outputs.take({"mode": 3}, None)
    worker.jobs[2].done(None, 0x06090030)  # the older one: the newer is pending
    outputs.take({"mode": 3}, None)
    assert [job.value for job in worker.jobs] == [1, 2, 2, 3]


def test_a_controlword_by_sdo_is_sent_after_the_targets_and_a_stop_before_everything():
    worker, outputs = by_sdo("controlword", "target_position")
    assert not outputs.commanded
    assert outputs.take({"target_position": 5}, None) is None
    assert not outputs.commanded
    assert outputs.take({}, 0x0F) is None
    assert outputs.commanded
    outputs.take({}, 0x0F)
    assert [(job.index, job.value) for job in worker.jobs] == [(0x687A, 5), (0x6840, 0x0F)]
    outputs.take({}, 0x02)
    outputs.take({}, 0x02)
    assert [job.value for job in worker.first] == [0x02]
    worker.first[0].done(None, 0x05040000)
    outputs.take({}, 0x02)  # one that failed is tried again at once
    assert [job.value for job in worker.first] == [0x02, 0x02]
    worker.jobs[1].done(None, None)
    outputs.take({}, 0x0F)
    worker.jobs[2].done(None, 0x05040000)
    outputs.take({}, 0x0F)
    assert len(worker.jobs) == 3  # and another one is not


def test_if_no_communication_parameter_may_change_no_mapping_changes():
    device = DevicePdos((), (tpdo(1, "6041/16", 1), tpdo(2, "6064/32", 255)))
    for remap in (True, False):
        plan = make_plan(
            5, device, objects(), PdoRequirements(INPUTS, ()), Policy(remap=remap, communication=False)
        )
        assert {pdo.change for pdo in plan.pdos} == {PdoChange.KEEP}
        assert not plan.remapped
        assert [name for name, source in plan.inputs.items() if source is ValueTransport.SDO] == [
            "mode",
            "velocity",
            "torque",
            "demand",
        ]
