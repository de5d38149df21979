"""One axis over CAN: frames become samples with their age, outputs become frames, and the rest travels by SDO."""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable, Iterator

import can
import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo import freshness
from axisbus.bus.pdo.mapping import DevicePdos
from axisbus.bus.pdo.plan import PdoRequirements, Policy, make_plan
from axisbus.bus.port import CanPort
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.nmt import NmtState
from axisbus.cia402.port import Outputs, Sample, SdoReply, SdoRequest, ValueTransport
from axisbus.errors import BootError
from kit.bus.fake_bus import FakeBus, Slave, eventually
from kit.bus.pdo_configurations import EMPTY, GENERIC, NO_TORQUE, objects, rpdo, tpdo

NODE = 5
PERIOD = 0.004
WHOLE = DevicePdos(
    (rpdo(1, "6040/16 6060/8 607A/32", 1), rpdo(2, "60FF/32 6071/16", 1)),
    (tpdo(1, "6041/16 6061/8 6064/32", 1), tpdo(2, "606C/32 6077/16", 1)),
)
ONE_RPDO = DevicePdos((rpdo(1, "6040/16 607A/32", 1),), (tpdo(1, "6041/16", 1),))


@pytest.fixture
def slave(fake: FakeBus) -> Slave:
    slave = Slave(
        NODE,
        {
            (0x6040, 0): b"\0\0",
            (0x6060, 0): b"\x01",
            (0x607A, 0): struct.pack("<i", -111),
            (0x60FF, 0): struct.pack("<i", 0),
            (0x6071, 0): b"\0\0",
            (0x6041, 0): b"\x31\x02",
            (0x6061, 0): b"\x01",
            (0x6062, 0): struct.pack("<i", -110),
            (0x6064, 0): struct.pack("<i", -112),
            (0x606C, 0): struct.pack("<i", -3),
            (0x6077, 0): struct.pack("<h", -4),
            (0x6081, 0): struct.pack("<I", 900),
        },
    )
    slave.nmt_state = 5
    fake.peers.append(slave)
    return slave


@pytest.fixture
def node(channel: Channel, slave: Slave) -> Iterator[CanopenNode]:
    with CanopenNode(channel, NODE) as node:
        yield node


Maker = Callable[..., CanPort]


@pytest.fixture
def make(node: CanopenNode) -> Iterator[Maker]:
    ports: list[CanPort] = []

    def build(
        device: DevicePdos, wanted: PdoRequirements | None = None, axis: int = 1, **policy: object
    ) -> CanPort:
        rules = Policy(**{"remap": False, **policy})  # type: ignore[arg-type]
        plan = make_plan(NODE, device, objects(0x6062, axis=axis), wanted, rules, axis)
        port = CanPort(node, plan, scan_period=PERIOD)
        port.prime()
        ports.append(port)
        return port

    yield build
    for port in ports:
        port.close()


def arrived(node: CanopenNode, fake: FakeBus, can_id: int, data: bytes | str) -> None:
    """Have a frame arrive, and wait until the receive thread has passed it on."""
    before = node.channel.counters.received
    fake.inject(can_id, data)
    eventually(lambda: node.channel.counters.received > before)
    node.channel.check()


def values(port: CanPort) -> tuple[int | None, ...]:
    seen = port.read(time.monotonic())
    samples = (seen.statusword, seen.mode, seen.position, seen.velocity, seen.torque, seen.demand)
    return tuple(None if sample is None else sample.value for sample in samples)


# -- inputs


def test_priming_reads_the_values_that_no_frame_has_carried(make: Maker) -> None:
    port = make(WHOLE)
    assert values(port) == (0x0231, 1, -112, -3, -4, None)


def test_a_frame_becomes_samples_with_its_stamp(make: Maker, node: CanopenNode, fake: FakeBus) -> None:
    port = make(WHOLE)
    before = time.monotonic()
    arrived(node, fake, 0x185, struct.pack("<Hbi", 0x0637, -1, -5000))
    seen = port.read(time.monotonic())
    assert (seen.statusword, seen.mode, seen.position) == (
        Sample(0x0637, seen.statusword.stamp),  # type: ignore[union-attr]
        Sample(-1, seen.statusword.stamp),  # type: ignore[union-attr]
        Sample(-5000, seen.statusword.stamp),  # type: ignore[union-attr]
    )
    assert before <= seen.statusword.stamp <= time.monotonic()  # type: ignore[union-attr]
    assert values(port) == (0x0637, -1, -5000, -3, -4, None)


def test_the_newest_of_several_frames_counts(make: Maker, node: CanopenNode, fake: FakeBus) -> None:
    port = make(WHOLE)
    for number in range(5):
        arrived(node, fake, 0x285, struct.pack("<ih", number, -number))
    assert values(port)[3:5] == (4, -4)


def test_a_short_frame_is_counted_and_a_long_one_cut(make: Maker, node: CanopenNode, fake: FakeBus) -> None:
    port = make(WHOLE)
    arrived(node, fake, 0x285, struct.pack("<ih", 7, 8))
    arrived(node, fake, 0x285, b"\xff\xff\xff")
    assert values(port)[3:5] == (7, 8)
    assert [(drop.fault, drop.count) for drop in node.channel.drops.found] == [(DropReason.SHORT_PDO, 1)]
    arrived(node, fake, 0x285, struct.pack("<ihH", 9, 10, 0xFFFF))
    assert values(port)[3:5] == (9, 10)


def test_bits_and_dummies_in_a_tpdo_are_stepped_over(make: Maker, node: CanopenNode, fake: FakeBus) -> None:
    port = make(DevicePdos((), (tpdo(1, "2000/4 6041/16 0005/4 6064/32", 1),)))
    raw = 0xF | 0x0637 << 4 | 0x9 << 20 | (-2 & 0xFFFFFFFF) << 24
    arrived(node, fake, 0x185, raw.to_bytes(7, "little"))
    assert values(port)[0] == 0x0637
    assert values(port)[2] == -2


def test_emergencies_and_the_nmt_state_are_in_the_inputs(
    make: Maker, node: CanopenNode, fake: FakeBus
) -> None:
    port = make(WHOLE)
    assert port.read(0.0).nmt == -1
    arrived(node, fake, 0x085, "11 86 20")
    arrived(node, fake, 0x705, "05")
    seen = port.read(time.monotonic())
    assert [emcy.code for emcy in seen.emcy] == [0x8611]
    assert (seen.operational, seen.nmt) == (True, 5)
    assert port.read(time.monotonic()).emcy == ()
    arrived(node, fake, 0x705, "7F")
    seen = port.read(time.monotonic())
    assert (seen.operational, seen.nmt) == (False, 127)


def test_an_overdue_heartbeat_is_not_operational(make: Maker, node: CanopenNode, fake: FakeBus) -> None:
    port = make(WHOLE)
    node.nmt.watch(0.3)
    arrived(node, fake, 0x705, "05")
    assert port.read(time.monotonic()).operational or time.monotonic() - node.nmt.stamp > 0.3  # type: ignore[operator]
    assert not port.read(time.monotonic() + 0.4).operational


def rebooted(make: Maker, node: CanopenNode, fake: FakeBus, *then: str) -> CanPort:
    """A port whose node has been commanded, and has then sent a boot-up message and these heartbeats."""
    port = make(WHOLE)
    port.write(Outputs(controlword=0x0F, target_position=1))
    port.take_frames()
    for state in ("00", *then):
        arrived(node, fake, 0x705, state)
    return port


def test_after_a_boot_up_message_only_newer_values_are_reported_and_the_node_is_not_operational(
    make: Maker, node: CanopenNode, fake: FakeBus
) -> None:
    port = rebooted(make, node, fake, "05")
    assert values(port) == (None,) * 6
    arrived(node, fake, 0x185, struct.pack("<Hbi", 0x0237, 1, 7))
    seen = port.read(time.monotonic())
    assert (seen.operational, seen.restarted) == (False, True)
    assert (seen.statusword.value, seen.position.value, seen.velocity) == (0x0237, 7, None)


def test_after_a_boot_up_message_a_node_gets_nothing_but_a_stop(
    make: Maker, node: CanopenNode, fake: FakeBus
) -> None:
    """Its mapping may be lost: a frame that enables, configures or moves it would be misread. A stop is sent on every path."""
    port = rebooted(make, node, fake, "05")
    for word in (0x06, 0x07, 0x0F, 0x010F, 0x80):
        port.write(
            Outputs(controlword=word, target_position=2, mode=1, sdo=(SdoRequest(word, 0x6081, 0, 1),))
        )
        assert port.take_frames() == []
        assert port.read(time.monotonic()).sdo == (SdoReply(word, None, 0x0504_0000),)
    for word in (0x0002, 0x0102, 0x0000):
        port.write(Outputs(controlword=word, target_position=2))
        assert port.take_frames() == [(0x205, struct.pack("<Hbi", word, 1, 1))]  # with the target that it had
    port.write(Outputs(nmt_stop=True))
    assert port.take_frames() == [(0, b"\x02\x05")]


def test_after_a_boot_up_message_the_stop_is_sent_by_sdo_and_the_drive_can_be_observed(
    make: Maker, node: CanopenNode, fake: FakeBus, slave: Slave
) -> None:
    port = rebooted(make, node, fake)
    port.write(
        Outputs(
            sdo=(SdoRequest(1, 0x6040, 0, 2), SdoRequest(2, 0x6041, 0, None), SdoRequest(3, 0x6040, 0, 15))
        )
    )
    replies = {3: SdoReply(3, None, 0x0504_0000)}

    def come() -> bool:
        replies.update({reply.id: reply for reply in port.read(time.monotonic()).sdo})
        return len(replies) == 3

    eventually(come)
    assert slave.objects[0x6040, 0] == b"\x02\x00"
    assert (replies[1].abort, replies[2].value) == (None, 0x0231)
    assert replies[3] == SdoReply(3, None, 0x0504_0000)


def test_a_stop_by_sdo_waits_for_no_other_transfer(make: Maker, node: CanopenNode, slave: Slave) -> None:
    port = make(WHOLE)
    slave.hold = True  # it answers nothing
    port.write(Outputs(sdo=tuple(SdoRequest(number, 0x6081, 0, None) for number in range(50))))
    eventually(lambda: node.worker._running is not None)
    port.write(Outputs(sdo=(SdoRequest(99, 0x6040, 0, 2),)))
    eventually(lambda: (0x6040, 0, b"\x02\x00") in slave.writes)


@pytest.mark.parametrize(
    ("words", "after", "told"),
    [
        ((0x0237, 0x0237), 0.0, True),
        ((0x0237,), 0.0, False),  # it may have been sent before the boot-up
        ((0x0250, 0x0231), 0.0, False),  # a drive that has restarted
        ((0x0237, 0x0237), 2.0, False),  # another master may have enabled it
    ],
)
def test_an_energised_drive_just_after_a_boot_up_message_is_a_second_device_under_its_node_id(
    make: Maker, node: CanopenNode, fake: FakeBus, words: tuple[int, ...], after: float, told: bool
) -> None:
    port = rebooted(make, node, fake)
    node.nmt.bootup_stamp -= after
    for word in words:
        arrived(node, fake, 0x185, struct.pack("<Hbi", word, 1, 7))
        seen = port.read(time.monotonic())
    assert bool(seen.duplicate) is told
    assert ("0x0237" in seen.duplicate) is told


# -- polling


# -- a bus-off, reported by the state of the driver ----


def short_bus_off(port: CanPort, node: CanopenNode, fake: FakeBus) -> None:
    """A bus-off between two looks: shorter than a cycle, and reported all the same."""
    fake.says = can.BusState.ERROR
    eventually(lambda: node.channel.off)
    fake.says = can.BusState.ACTIVE
    eventually(lambda: node.channel.off is None)
    seen = port.read(time.monotonic())
    assert (seen.operational, seen.bus) == (False, node.channel.last_bus_off)
    assert port.read(time.monotonic()).bus is None  # once


def serves(port: CanPort) -> tuple[bool, list[tuple[int, bytes]]]:
    """Whether the node counts as operational, and the frames that a controlword becomes."""
    operational = port.read(time.monotonic()).operational
    port.write(Outputs(controlword=6))
    return operational, port.take_frames()


def test_a_node_that_is_still_operational_after_a_bus_off_serves_again(
    make: Maker, node: CanopenNode, fake: FakeBus
) -> None:
    arrived(node, fake, 0x705, "05")
    port = make(WHOLE)
    assert serves(port)[0]
    short_bus_off(port, node, fake)
    assert not serves(port)[0]  # no message of it was received
    arrived(node, fake, 0x705, "05")
    operational, frames = serves(port)
    assert (operational, [can_id for can_id, _ in frames]) == (True, [0x205])


@pytest.mark.parametrize("short", [False, True], ids=["several RPDOs", "one RPDO"])
def test_a_node_that_may_have_restarted_unnoticed_gets_only_a_stop_whatever_its_later_state(
    make: Maker, node: CanopenNode, fake: FakeBus, slave: Slave, short: bool
) -> None:
    arrived(node, fake, 0x705, "05")
    port = (
        make(ONE_RPDO, PdoRequirements(("statusword",), ("controlword", "target_position")))
        if short
        else make(WHOLE)
    )
    assert (port._only_image is not None) is short
    assert serves(port)[1]
    short_bus_off(port, node, fake)
    arrived(node, fake, 0x705, "7F")
    assert serves(port) == (False, [])
    arrived(node, fake, 0x705, "05")
    assert serves(port) == (False, [])
    port.write(
        Outputs(controlword=2, sdo=(SdoRequest(1, 0x6040, 0, 2),))
    )  # but its quick stop, by RPDO and by SDO
    assert [can_id for can_id, _ in port.take_frames()] == [0x205]
    eventually(lambda: slave.objects[0x6040, 0] == b"\x02\x00")


def test_a_node_that_is_only_assumed_to_be_operational_is_also_treated_as_possibly_restarted(
    make: Maker, node: CanopenNode, fake: FakeBus
) -> None:
    node.nmt.assume(NmtState.OPERATIONAL)
    port = make(WHOLE)
    assert serves(port)[0]
    short_bus_off(port, node, fake)
    node.nmt.assume(NmtState.OPERATIONAL)
    assert serves(port) == (False, [])


def test_the_first_request_to_stop_the_node_is_sent_once(make: Maker) -> None:
    port = make(WHOLE)
    port.write(Outputs(nmt_stop=True))
    assert port.take_frames() == [(0, b"\x02\x05")]
    port.write(Outputs(nmt_stop=True))
    assert port.take_frames() == []


def test_an_output_that_was_not_sent_is_sent_later_if_it_is_still_requested(make: Maker) -> None:
    port = make(WHOLE)
    port.write(Outputs(nmt_stop=True))
    port.drop_frames()
    assert port.take_frames() == []
    port.write(Outputs(nmt_stop=True))
    assert port.take_frames() == [(0, b"\x02\x05")]


def test_nothing_received_before_the_adapter_was_opened_again_counts(
    make: Maker, node: CanopenNode, fake: FakeBus
) -> None:
    """The drive was stopped by SDO meanwhile; its last TPDO may still show it enabled."""
    port = make(WHOLE)
    arrived(node, fake, 0x185, "27 02 01 00 00 00 00")
    assert port.read(time.monotonic()).statusword.value == 0x0227
    port.begin_again()
    assert port.read(time.monotonic()).statusword is None
    arrived(node, fake, 0x185, "40 02 01 00 00 00 00")
    assert port.read(time.monotonic()).statusword.value == 0x0240


EVENT_DRIVEN = DevicePdos(
    (rpdo(1, "6060/8 607A/32 6040/16"), rpdo(2, "60FF/32 6071/16")), (tpdo(1, "6041/16 6061/8 6064/32"),)
)
WISH = Outputs(controlword=0x0F, mode=1, target_position=7)


def rpdos(port: CanPort, outputs: Outputs = WISH) -> list[int]:
    """The COB-IDs of the RPDOs that go out in a cycle."""
    port.read(time.monotonic())
    port.write(outputs)
    return [can_id for can_id, _ in port.take_frames()]


def test_an_event_driven_rpdo_is_sent_when_it_changes(make: Maker, node: CanopenNode, fake: FakeBus) -> None:
    arrived(node, fake, 0x705, "05")
    port = make(EVENT_DRIVEN, sync=False)
    assert rpdos(port) == [0x205]
    assert rpdos(port) == []
    assert rpdos(port, WISH._replace(target_position=8)) == [0x205]
    assert rpdos(port, WISH._replace(target_position=8, target_velocity=1)) == [0x305]


def test_an_event_driven_rpdo_that_was_dropped_is_sent_later_without_a_change(
    make: Maker, node: CanopenNode, fake: FakeBus
) -> None:
    arrived(node, fake, 0x705, "05")
    port = make(EVENT_DRIVEN, sync=False)
    port.read(time.monotonic())
    port.write(WISH)
    port.drop_frames()
    assert rpdos(port) == [0x205]


def test_a_node_that_is_operational_again_gets_its_rpdos_again(
    make: Maker, node: CanopenNode, fake: FakeBus
) -> None:
    """In any other state it takes none, so earlier frames do not count."""
    arrived(node, fake, 0x705, "7F")
    port = make(EVENT_DRIVEN, sync=False)
    assert rpdos(port) == [0x205]
    arrived(node, fake, 0x705, "05")
    assert rpdos(port) == [0x205]
    assert rpdos(port) == []


def test_the_quick_stop_of_a_silent_cycle_has_the_values_that_were_sent_last(make: Maker) -> None:
    port = make(EVENT_DRIVEN, sync=False)
    assert rpdos(port) == [0x205]
    assert rpdos(port) == []
    by_pdo, _ = port.stop_frames()
    assert by_pdo == ((0x205, struct.pack("<biH", 1, 7, 0x02)),)


def test_a_controlword_that_travels_by_sdo_is_stopped_by_sdo(make: Maker) -> None:
    port = make(EMPTY)
    assert port.stop_frames() == ((), ())
    port.write(Outputs(controlword=0x06))
    assert port.stop_frames() == ((), ((0x605, bytes.fromhex("2B 40 60 00 02 00 00 00")),))


def test_the_quick_stop_has_no_value_that_was_never_sent(make: Maker) -> None:
    """A controlword is missing: the target waits in the image, and nothing goes out."""
    port = make(EVENT_DRIVEN, sync=False)
    assert rpdos(port) == [0x205]
    port.write(Outputs(target_position=9))
    assert port.take_frames() == []
    by_pdo, _ = port.stop_frames()
    assert by_pdo == ((0x205, struct.pack("<biH", 1, 7, 0x02)),)


# -- polled values


def test_without_a_pdo_values_are_polled(make: Maker, slave: Slave) -> None:
    port = make(DevicePdos((), (tpdo(1, "6041/16", 1),)))
    assert port.capabilities.inputs["position"] is ValueTransport.SDO
    slave.objects[0x6064, 0] = struct.pack("<i", 4321)
    now = time.monotonic()
    port.read(now)
    eventually(lambda: port.read(now).position.value == 4321)  # type: ignore[union-attr]


def test_polls_keep_their_period(make: Maker, node: CanopenNode, fake: FakeBus) -> None:
    port = make(
        DevicePdos((), (tpdo(1, "6041/16 6061/8", 1),)),
        PdoRequirements(("statusword", "mode", "position"), ()),
    )
    asked = [bytes.fromhex("40 64 60 00 00 00 00 00")]
    fake.sent.clear()
    for now in (1000.0, 1000.01, 1000.09):
        port.read(now)
        eventually(lambda: node.worker.idle)
    assert fake.frames(0x605) == asked
    port.read(1000.11)
    eventually(lambda: node.worker.idle)
    assert fake.frames(0x605) == asked * 2


def test_a_silent_event_tpdo_is_watched_by_polling(make: Maker) -> None:
    """67 % of drives send the statusword only on change: silence alone means nothing."""
    device = DevicePdos((rpdo(1, "6040/16"),), (tpdo(1, "6041/16 6064/32"),))
    ages = make(device, sync=False).capabilities.max_age
    assert ages["statusword"] == ages["position"] == pytest.approx(3 * 0.1 + 0.05)


def test_an_axis_at_standstill_with_a_silent_tpdo_has_fresh_positions(make: Maker, slave: Slave) -> None:
    """Otherwise its standstill could not be seen."""
    port = make(DevicePdos((), (tpdo(1, "6041/16 6064/32"),)), sync=False)
    first = port.read(time.monotonic()).position
    assert first is not None
    eventually(lambda: port.read(time.monotonic()).position.stamp > first.stamp)  # type: ignore[union-attr]


def test_a_polled_value_does_not_replace_a_newer_frame(
    make: Maker, node: CanopenNode, slave: Slave, fake: FakeBus
) -> None:
    """The answer waited in the drive while a TPDO with a newer value overtook it."""
    port = make(DevicePdos((), (tpdo(1, "6041/16"),)), PdoRequirements(("statusword",), ()), sync=False)
    slave.hold = True
    port.read(time.monotonic())
    eventually(lambda: slave.held)
    arrived(node, fake, 0x185, "37 06")
    for can_id, data in slave.release():  # says 0231h
        fake.inject(can_id, data)
    eventually(lambda: node.worker.idle)
    assert values(port)[0] == 0x0637


@pytest.mark.parametrize(
    ("device", "sync", "ages"),
    [
        (WHOLE, True, {"statusword": 0.1, "position": 0.1, "velocity": 0.1}),
        (
            DevicePdos((), (tpdo(1, "6041/16 6061/8 6064/32", event=20),)),
            False,
            {"statusword": 3 * 0.020 + 0.05, "position": 3 * 0.020 + 0.05, "velocity": 3 * 0.25 + 0.05},
        ),
        (
            DevicePdos((), (tpdo(1, "6041/16 6061/8 6064/32"),)),
            False,
            {"statusword": 3 * 0.1 + 0.05, "position": 3 * 0.1 + 0.05, "mode": math.inf, "torque": 0.8},
        ),
        (
            DevicePdos((), (tpdo(1, "6041/16"), tpdo(2, "6041/16 6064/32", event=20))),
            False,
            {"statusword": 3 * 0.020 + 0.05, "position": 3 * 0.020 + 0.05},
        ),
    ],
)
def test_the_maximum_age_fits_the_source(device: DevicePdos, sync: bool, ages: dict[str, float]) -> None:
    plan = make_plan(NODE, device, objects(), policy=Policy(sync=sync, remap=False))
    found = freshness.max_ages(plan, PERIOD)
    assert {name: found[name] for name in ages} == pytest.approx(ages)


def test_a_slow_scan_has_older_values() -> None:
    plan = make_plan(NODE, WHOLE, objects(), policy=Policy(remap=False))
    assert freshness.max_ages(plan, 0.02)["statusword"] == pytest.approx(0.1)


# -- outputs


def test_an_rpdo_starts_with_the_values_of_the_drive(make: Maker) -> None:
    """canopen would send target position 0 with the first controlword."""
    port = make(WHOLE)
    port.write(Outputs(controlword=0x06))
    assert port.take_frames() == [(0x205, struct.pack("<Hbi", 0x06, 1, -111))]


def test_unreadable_targets_start_with_the_actual_values(make: Maker, slave: Slave) -> None:
    for index in (0x607A, 0x6060, 0x60FF, 0x6071):
        del slave.objects[index, 0]
    port = make(WHOLE)
    port.write(Outputs(controlword=0x06, target_torque=0))
    assert port.take_frames() == [
        (0x305, struct.pack("<ih", 0, 0)),
        (0x205, struct.pack("<Hbi", 0x06, 1, -112)),
    ]


def test_a_strangers_object_that_cannot_be_read_is_a_boot_error(make: Maker, slave: Slave) -> None:
    with pytest.raises(BootError, match="RPDO1 contains 60FEh:00") as caught:
        make(DevicePdos((rpdo(1, "6040/16 60FE/32", 1),), ()))
    assert caught.value.index == 0x60FE


def test_frames_are_given_out_once(make: Maker) -> None:
    port = make(WHOLE)
    port.write(Outputs(controlword=0x0F, mode=8, target_position=77))
    assert port.take_frames() == [(0x205, struct.pack("<Hbi", 0x0F, 8, 77))]
    assert port.take_frames() == []


def test_no_controlword_sends_nothing_that_holds_it(make: Maker) -> None:
    port = make(WHOLE)
    port.write(Outputs(target_position=5))
    assert port.take_frames() == []
    port.write(Outputs(target_position=5, target_velocity=6))
    assert port.take_frames() == [(0x305, struct.pack("<ih", 6, 0))]


def test_nmt_stop_is_sent_once(make: Maker) -> None:
    port = make(WHOLE)
    for _ in range(3):
        port.write(Outputs(nmt_stop=True))
    assert port.take_frames() == []
    port.write(Outputs())
    port.write(Outputs(nmt_stop=True))
    assert port.take_frames() == [(0x000, b"\x02\x05")]


def test_sdo_requests_are_answered_in_the_inputs(make: Maker, slave: Slave) -> None:
    port = make(WHOLE)
    slave.abort_on[0x6081, 0] = 0x0609_0031
    port.write(Outputs(sdo=(SdoRequest(1, 0x6064, 0, None), SdoRequest(2, 0x6081, 0, 5))))
    replies: list[SdoReply] = []
    eventually(lambda: replies.extend(port.read(time.monotonic()).sdo) or len(replies) == 2)
    assert replies == [SdoReply(1, -112, None), SdoReply(2, None, 0x0609_0031)]


def test_a_cancelled_request_is_not_answered(
    make: Maker, slave: Slave, node: CanopenNode, fake: FakeBus
) -> None:
    port = make(WHOLE)
    slave.hold = True
    port.write(Outputs(sdo=(SdoRequest(1, 0x6064, 0, None), SdoRequest(2, 0x6081, 0, 5))))
    eventually(lambda: slave.held)
    port.write(Outputs(cancel=(2,)))
    for can_id, data in slave.release():
        fake.inject(can_id, data)
    eventually(lambda: node.worker.idle)
    assert port.read(time.monotonic()).sdo == (SdoReply(1, -112, None),)
    assert slave.writes == []


def test_an_sdo_write_to_a_mapped_object_is_not_undone_by_the_next_rpdo(
    make: Maker, slave: Slave, node: CanopenNode
) -> None:
    """Many drives map the profile velocity beside the target position."""
    device = DevicePdos((rpdo(1, "6040/16 6060/8", 1), rpdo(2, "607A/32 6081/32", 1)), ())
    port = make(device, PdoRequirements((), ("controlword", "mode", "target_position")))
    port.write(Outputs(target_position=1))
    assert port.take_frames() == [(0x305, struct.pack("<iI", 1, 900))]
    port.write(Outputs(target_position=2, sdo=(SdoRequest(1, 0x6081, 0, 1234),)))
    assert port.take_frames() == [(0x305, struct.pack("<iI", 2, 1234))]
    eventually(lambda: node.worker.idle)
    slave.abort_on[0x6081, 0] = 0x0609_0031
    port.write(Outputs(sdo=(SdoRequest(2, 0x6081, 0, 99999),)))
    eventually(lambda: any(reply.id == 2 for reply in port.read(time.monotonic()).sdo))
    port.write(Outputs(target_position=3))
    assert port.take_frames() == [(0x305, struct.pack("<iI", 3, 1234))]  # refused: the old value is back


# -- outputs without an RPDO


FIXED = DevicePdos((rpdo(1, "6040/16", 1),), (tpdo(1, "6041/16 6064/32", 1),))
PP = PdoRequirements(("statusword", "position"), ("controlword", "mode", "target_position"))


def test_a_value_without_rpdo_is_written_when_it_changes(
    make: Maker, slave: Slave, node: CanopenNode
) -> None:
    port = make(FIXED, PP)
    for _ in range(3):
        port.write(Outputs(mode=1, target_position=5))
        eventually(lambda: node.worker.idle)
    assert slave.writes == [(0x6060, 0, b"\x01"), (0x607A, 0, struct.pack("<i", 5))]


def test_a_motion_waits_for_its_target_that_travels_by_sdo(
    make: Maker, slave: Slave, node: CanopenNode, fake: FakeBus
) -> None:
    """The edge in the RPDO would be much faster than the target by SDO."""
    port = make(FIXED, PP)
    port.write(Outputs(controlword=0x0F))
    assert port.take_frames() == [(0x205, b"\x0f\x00")]
    slave.hold = True
    port.write(Outputs(controlword=0x1F, target_position=5))
    assert port.take_frames() == [(0x205, b"\x0f\x00")]
    for can_id, data in slave.release():
        fake.inject(can_id, data)
    eventually(lambda: node.worker.idle)
    port.write(Outputs(controlword=0x1F, target_position=5))
    assert port.take_frames() == [(0x205, b"\x1f\x00")]


def test_under_halt_the_edge_waits_for_the_target_and_the_halt_itself_does_not(
    make: Maker, slave: Slave, node: CanopenNode, fake: FakeBus
) -> None:
    """Else the drive takes its old target for the new one, and goes there when the halt ends."""
    port = make(FIXED, PP)
    port.write(Outputs(controlword=0x0F))
    port.take_frames()
    slave.hold = True
    port.write(Outputs(controlword=0x011F, target_position=5))
    assert port.take_frames() == [(0x205, b"\x0f\x01")]
    for can_id, data in slave.release():
        fake.inject(can_id, data)
    eventually(lambda: node.worker.idle)
    port.write(Outputs(controlword=0x011F, target_position=5))
    assert port.take_frames() == [(0x205, b"\x1f\x01")]
    slave.hold = True
    port.write(Outputs(controlword=0x011F, target_position=6))
    assert port.take_frames() == [(0x205, b"\x1f\x01")]  # no edge
    node.worker.close()


@pytest.mark.parametrize("word", [0x0002, 0x0000, 0x0006, 0x0007, 0x010F])
def test_a_stop_never_waits_for_a_target(make: Maker, slave: Slave, node: CanopenNode, word: int) -> None:
    port = make(FIXED, PP)
    port.write(Outputs(controlword=0x0F))
    port.take_frames()
    slave.hold = True
    port.write(Outputs(controlword=word, target_position=5))
    assert port.take_frames() == [(0x205, word.to_bytes(2, "little"))]
    node.worker.close()


def test_a_refused_value_is_tried_again_but_not_in_every_cycle(
    make: Maker, slave: Slave, node: CanopenNode
) -> None:
    port = make(FIXED, PP)
    slave.abort_on[0x6060, 0] = 0x0609_0030
    for _ in range(20):
        port.write(Outputs(mode=9))
        eventually(lambda: node.worker.idle)
    assert 1 <= len(slave.writes) < 20
    del slave.abort_on[0x6060, 0]

    def written() -> bool:
        port.write(Outputs(mode=9))
        return slave.objects[0x6060, 0] == b"\x09"

    eventually(written)


NO_PDO = DevicePdos((), (tpdo(1, "6041/16 6064/32", 1),))


def test_a_controlword_without_rpdo_is_sent_after_its_target(
    make: Maker, slave: Slave, node: CanopenNode
) -> None:
    port = make(NO_PDO, PP)
    port.write(Outputs(controlword=0x1F, target_position=5))
    assert port.take_frames() == []
    eventually(lambda: node.worker.idle)
    assert [write[0] for write in slave.writes] == [0x607A, 0x6040]
    port.write(Outputs(controlword=0x1F, target_position=5))
    eventually(lambda: node.worker.idle)
    assert len(slave.writes) == 2  # nothing changed


def test_a_quick_stop_without_rpdo_is_sent_before_everything(
    make: Maker, slave: Slave, node: CanopenNode
) -> None:
    port = make(NO_PDO, PP)
    node.sdo.timeout = 60.0
    slave.hold = True
    port.write(Outputs(controlword=0x1F, target_position=5, sdo=(SdoRequest(1, 0x6081, 0, 5),)))
    eventually(lambda: slave.held)
    slave.release()
    port.write(Outputs(controlword=0x02, target_position=5))
    eventually(lambda: slave.objects[0x6040, 0] == b"\x02\x00")
    assert (0x6081, 0, b"\x05\0\0\0") not in slave.writes[1:]
    eventually(lambda: node.worker.idle)


def test_a_refused_controlword_does_not_delay_the_stop(make: Maker, slave: Slave, node: CanopenNode) -> None:
    port = make(NO_PDO, PP)
    slave.abort_on[0x6040, 0] = 0x0800_0022
    port.write(Outputs(controlword=0x0F))
    eventually(lambda: node.worker.idle)
    slave.writes.clear()
    port.write(Outputs(controlword=0x02))  # another word: at once
    eventually(lambda: len(slave.writes) == 1)
    eventually(lambda: node.worker.idle)
    port.write(Outputs(controlword=0x02))  # and a stop that failed: at once too
    eventually(lambda: len(slave.writes) == 2)
    eventually(lambda: node.worker.idle)


# -- the second axis


def test_the_second_axis_has_its_own_objects(make: Maker, slave: Slave, node: CanopenNode) -> None:
    slave.objects.update({(0x6881, 0): bytes(4), (0x6841, 0): b"\x40\x02", (0x2000, 0): b"\x09"})
    device = DevicePdos((rpdo(5, "6840/16", 1, cob_id=0x27F),), (tpdo(5, "6841/16", 1, cob_id=0x47F),))
    port = make(device, PdoRequirements(("statusword",), ("controlword",)), axis=2)
    assert values(port)[0] == 0x0240
    port.write(Outputs(controlword=0x06, sdo=(SdoRequest(1, 0x6081, 0, 5), SdoRequest(2, 0x2000, 0, None))))
    assert port.take_frames() == [(0x27F, b"\x06\x00")]
    replies: list[SdoReply] = []
    eventually(lambda: replies.extend(port.read(time.monotonic()).sdo) or len(replies) == 2)
    assert slave.objects[0x6881, 0] == b"\x05\0\0\0"
    assert replies[1] == SdoReply(2, 9, None)  # a maker's object has no axis offset
    assert port.stop_frames() == (
        ((0x27F, b"\x02\x00"),),
        ((0x605, bytes.fromhex("2B 40 68 00 02 00 00 00")),),
    )


def test_the_capabilities_of_the_port_are_reported(make: Maker) -> None:
    told = make(GENERIC, NO_TORQUE).capabilities
    assert set(told.inputs.values()) == {ValueTransport.SYNC_PDO}
    assert told.outputs == dict.fromkeys(NO_TORQUE.outputs, ValueTransport.SYNC_PDO)
    assert make(EMPTY).capabilities.outputs["controlword"] is ValueTransport.SDO


def test_a_closed_port_receives_nothing(make: Maker, node: CanopenNode, fake: FakeBus) -> None:
    port = make(WHOLE)
    port.close()
    arrived(node, fake, 0x185, struct.pack("<Hbi", 0x0637, 1, 1))
    assert values(port)[0] == 0x0231
