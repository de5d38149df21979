"""How PDOs travel: every transmission type, SYNC with a counter, remote frames only when asked for, deadlines."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest

from axisbus.bus.cycle import CanCycle
from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.configure import configure, set_pdo
from axisbus.bus.pdo.freshness import pdo_age
from axisbus.bus.pdo.mapping import DevicePdos
from axisbus.bus.pdo.plan import PdoPlan, PdoRequirements, Policy, make_plan
from axisbus.bus.pdo.plantext import describe
from axisbus.bus.pdo.tpdo_timeout import Deadline, Deadlines, PdoEvent, Reception
from axisbus.bus.port import CanPort
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301.pdo import MappedObject, PdoCodec
from axisbus.cia402.port import Outputs, ValueTransport
from axisbus.errors import BootError
from kit.bus.fake_bus import FakeBus, Slave, eventually, pdo_objects
from kit.bus.pdo_configurations import objects, rpdo, tpdo
from kit.manual_clock import HandClock

NODE = 5
NO_RTR = 1 << 30
OFF = 1 << 31
SCAN = 0.040
WANTED = PdoRequirements(("statusword",), ("controlword",))


# -- transmission types


def plan_of(kind: int, request: float | None = None, event: int | None = 0) -> PdoPlan:
    device = DevicePdos((rpdo(1, "6040/16", kind),), (tpdo(1, "6041/16", kind, event=event, inhibit=0),))
    policy = Policy(
        fixed=frozenset({(True, 1), (False, 1)}),
        timed=frozenset({1}),
        requests={} if request is None else {1: request},
    )
    return make_plan(NODE, device, objects(), WANTED, policy)


SYNC, EVENT, SDO = ValueTransport.SYNC_PDO, ValueTransport.EVENT_PDO, ValueTransport.SDO
# type, remote frames every s, event timer in ms: how 6041h comes, how 6040h goes, seconds after which the TPDO counts as missing
TYPES = [
    (0, None, 0, EVENT, SYNC, math.inf),  # at SYNC, but only when it has changed
    (1, None, 0, SYNC, SYNC, 0.2),  # five periods
    (2, None, 0, SYNC, SYNC, 0.4),
    (10, None, 0, SYNC, SYNC, 2.0),
    (240, None, 0, SYNC, SYNC, 48.0),
    (252, 0.1, 0, EVENT, None, 0.35),  # three requests and 50 ms
    (252, None, 0, SDO, None, None),
    (253, 0.1, 0, EVENT, None, 0.35),
    (253, None, 0, SDO, None, None),
    (254, None, 0, EVENT, EVENT, math.inf),
    (254, None, 100, EVENT, EVENT, 0.35),  # three event times and 50 ms
    (255, None, 0, EVENT, EVENT, math.inf),
    (255, None, 20, EVENT, EVENT, 0.11),
]


@pytest.mark.parametrize(("kind", "request_every", "event", "comes", "goes", "age"), TYPES)
def test_a_transmission_type_that_the_user_has_set_is_kept(
    kind: int,
    request_every: float | None,
    event: int,
    comes: ValueTransport,
    goes: ValueTransport | None,
    age: float | None,
) -> None:
    plan = plan_of(kind, request_every, event)
    assert plan.inputs["statusword"] is comes
    if goes is not None:
        assert plan.outputs["controlword"] is goes
    sent = [pdo for pdo in plan.active if not pdo.receive]
    assert [pdo.target.transmission_type for pdo in sent] == ([] if age is None else [kind])
    assert [pdo_age(pdo, SCAN) for pdo in sent] == ([] if age is None else [pytest.approx(age)])


@pytest.mark.parametrize("kind", [0, 4, 241, 252, 253, 254, 255])
def test_without_the_users_word_motions_values_travel_with_every_sync(kind: int) -> None:
    device = DevicePdos((rpdo(1, "6040/16", 1),), (tpdo(1, "6041/16", kind, event=0, inhibit=0),))
    plan = make_plan(NODE, device, objects(), WANTED, Policy())
    assert [pdo.target.transmission_type for pdo in plan.active] == [1, 1]


def test_the_plan_names_requested_pdos_and_their_sync_start() -> None:
    assert "TPDO1 185h requested every 100 ms (type 253)" in describe(plan_of(253, 0.1))
    device = DevicePdos((rpdo(1, "6040/16", 1),), (replace(tpdo(1, "6041/16", 4), sync_start=3),))
    plan = make_plan(NODE, device, objects(), WANTED, Policy(fixed=frozenset({(False, 1)})))
    assert "TPDO1 185h with SYNC (type 4, from SYNC counter 3 on)" in describe(plan)


def test_a_tpdo_that_the_user_has_set_is_not_switched_off_as_redundant() -> None:
    device = DevicePdos((rpdo(1, "6040/16", 1),), (tpdo(1, "6041/16", 1), tpdo(2, "6041/16", 254)))
    assert len(make_plan(NODE, device, objects(), WANTED, Policy()).pdos) == 3  # TPDO2 switched off
    kept = make_plan(NODE, device, objects(), WANTED, Policy(fixed=frozenset({(False, 2)})))
    assert [pdo.name for pdo in kept.pdos] == ["RPDO1", "TPDO1"]


# -- parameters by SDO


@pytest.fixture
def slave(fake: FakeBus) -> Slave:
    slave = Slave(
        NODE,
        {
            **pdo_objects(0x1400, 0x1600, 0x205, 1, [0x60400010]),
            **pdo_objects(0x1800, 0x1A00, NO_RTR | 0x185, 1, [0x60410010], inhibit=0, event=0),
            **pdo_objects(0x180B, 0x1A0B, OFF | NO_RTR | 0x1F0, 255, [], inhibit=0, event=0),
            (0x6041, 0): b"\x31\x02",
            (0x6040, 0): b"\0\0",
        },
    )
    slave.objects[0x1800, 6] = b"\0"
    slave.nmt_state = 5
    fake.peers.append(slave)
    return slave


@pytest.fixture
def sdo(channel: Channel, slave: Slave) -> SdoClient:
    return SdoClient(channel, NODE)


def numbers(slave: Slave, index: int) -> list[tuple[int, int]]:
    return [(sub, int.from_bytes(data, "little")) for at, sub, data in slave.writes if at == index]


def test_a_sync_start_value_is_written_while_the_pdo_is_off(sdo: SdoClient, slave: Slave) -> None:
    pdo = set_pdo(sdo, False, 1, transmission_type=4, sync_start=3)
    assert numbers(slave, 0x1800) == [(1, OFF | NO_RTR | 0x185), (2, 4), (6, 3), (1, NO_RTR | 0x185)]
    assert (pdo.transmission_type, pdo.sync_start) == (4, 3)


def test_a_pdo_is_restored_if_the_drive_refuses_the_start_value(sdo: SdoClient, slave: Slave) -> None:
    slave.abort_on[0x1800, 6] = 0x0609_0030
    with pytest.raises(BootError, match="TPDO1 does not accept the SYNC start value 3"):
        set_pdo(sdo, False, 1, transmission_type=4, sync_start=3)
    assert slave.number(0x1800, 1) == NO_RTR | 0x185
    assert slave.number(0x1800, 2) == 1


def test_remote_frames_are_allowed_only_when_they_are_required(sdo: SdoClient, slave: Slave) -> None:
    set_pdo(sdo, False, 1, transmission_type=253)
    assert slave.number(0x1800, 1) == NO_RTR | 0x185  # as the drive had it
    set_pdo(sdo, False, 1, rtr=True)
    assert slave.number(0x1800, 1) == 0x185
    slave.writes.clear()
    set_pdo(sdo, False, 1, rtr=True)
    assert slave.writes == []


def test_a_drive_without_remote_frames_is_reported(sdo: SdoClient, slave: Slave) -> None:
    """Bit 30 cannot be cleared where the device does not answer remote frames (CiA 301 7.5.2.37)."""
    before = slave._write

    def write(index: int, subindex: int, value: bytes) -> int:
        if (index, subindex) == (0x1800, 1) and not value[3] & 0xC0:
            return 0x0609_0030
        return before(index, subindex, value)

    slave._write = write  # type: ignore[method-assign]
    with pytest.raises(BootError, match="TPDO1 cannot be requested by remote frames"):
        set_pdo(sdo, False, 1, transmission_type=253, rtr=True)


def test_a_twelfth_tpdo_that_the_user_has_set_carries_its_value(sdo: SdoClient, slave: Slave) -> None:
    slave.objects.update(pdo_objects(0x1800, 0x1A00, OFF | NO_RTR | 0x185, 1, [], inhibit=0, event=0))
    set_pdo(sdo, False, 12, mapping=(MappedObject(0x6041, 0, 16),), transmission_type=1)
    policy = Policy(remap=False, fixed=frozenset({(False, 12)}))
    assert (
        configure(sdo, WANTED, policy).inputs["statusword"] is ValueTransport.SDO
    )  # no file, so its limits are not checked
    plan = configure(sdo, WANTED, policy, also=[(False, 12)])
    assert plan.inputs["statusword"] is ValueTransport.SYNC_PDO
    assert [pdo.target.cob_id for pdo in plan.active if not pdo.receive] == [0x1F0]


# -- on the wire


@pytest.fixture
def node(channel: Channel, slave: Slave) -> Iterator[CanopenNode]:
    with CanopenNode(channel, NODE) as node:
        yield node


@pytest.fixture
def port(node: CanopenNode, fake: FakeBus) -> Iterator[CanPort]:
    """An axis whose statusword is asked for every 0.1 s."""
    port = CanPort(node, plan_of(253, 0.1), scan_period=SCAN)
    port.prime()
    fake.sent.clear()
    yield port
    port.close()


def operational(node: CanopenNode, fake: FakeBus) -> None:
    fake.inject(0x705, "05")
    eventually(lambda: node.nmt.state == 5)


def test_a_tpdo_is_requested_at_its_period_with_its_length(
    channel: Channel, node: CanopenNode, fake: FakeBus, port: CanPort
) -> None:
    clock = channel.clock = HandClock(100.0)
    cycle = CanCycle(channel, [port])
    cycle.commit()
    assert fake.remote == []  # the node is not operational: it would not answer
    operational(node, fake)
    for _ in range(21):  # 0.2 s
        cycle.commit()
        clock.time += 0.01
    assert fake.remote == [0x185] * 3
    assert port.take_requests(clock.time + 1.0) == [(0x185, 2)]


def test_without_rtr_no_remote_frame_is_sent(channel: Channel, node: CanopenNode, fake: FakeBus) -> None:
    port = CanPort(node, plan_of(1), scan_period=SCAN)
    port.prime()
    operational(node, fake)
    cycle = CanCycle(channel, [port])
    for _ in range(5):
        port.write(Outputs(controlword=6))
        cycle.commit()
        cycle.sync()
    port.close()
    assert fake.remote == []


def test_the_sync_counter_goes_from_1_to_its_overflow_value_and_begins_again(
    channel: Channel, fake: FakeBus
) -> None:
    cycle = CanCycle(channel, [], sync_cob_id=0x90, sync_counter=3)
    for _ in range(7):
        cycle.sync()
    assert fake.frames(0x90) == [bytes((count,)) for count in (1, 2, 3, 1, 2, 3, 1)]


def test_the_sync_of_a_quick_stop_continues_counting(
    channel: Channel, node: CanopenNode, fake: FakeBus
) -> None:
    port = CanPort(node, plan_of(1), scan_period=SCAN)
    port.prime()
    cycle = CanCycle(channel, [port], sync_counter=240)
    port.write(Outputs(controlword=0x0F))
    cycle.commit()
    cycle.sync()
    fake.sent.clear()
    cycle.quick_stop_all()
    port.close()
    assert fake.sent[:2] == [(0x205, b"\x02\0"), (0x080, b"\x02")]


def test_sync_without_a_counter_has_no_data(channel: Channel, fake: FakeBus) -> None:
    cycle = CanCycle(channel, [])
    cycle.sync()
    cycle.sync()
    assert fake.sent == [(0x080, b""), (0x080, b"")]


# -- reception deadlines


def looks(
    *frames: float, until: float, age: float = 0.05, skip: tuple[float, float] = (9.0, 9.0)
) -> list[PdoEvent]:
    """Look every 10 ms from 0 on; ``frames`` are the times of reception; ``skip`` is a time without looks."""
    deadlines = Deadlines([Deadline(NODE, "TPDO1", 0x185, age)], 0.01)
    events = []
    for number in range(round(until * 100) + 1):
        now = number / 100
        if skip[0] < now < skip[1]:
            continue
        stamp = max((frame for frame in frames if frame <= now), default=-math.inf)
        events += deadlines.step(now, [stamp], True)
    return events


def test_a_tpdo_that_is_missing_is_one_event_with_its_age() -> None:
    (event,) = looks(0.005, 0.015, 0.025, until=1.0)
    assert (event.what, event.pdo, event.cob_id, event.never) == (Reception.MISSING, "TPDO1", 0x185, False)
    assert event.age == pytest.approx(0.055, abs=0.011)
    assert event.stamp == pytest.approx(0.08, abs=0.011)
    assert (
        str(event) == "node 5: TPDO1 (185h) no longer comes: the last one is 55 ms old, expected within 50 ms"
    )


def test_the_return_of_a_pdo_is_an_event_too_and_reports_how_long_it_was_missing() -> None:
    missing, returned = looks(0.005, 0.505, 0.545, until=0.58)
    assert missing.what is Reception.MISSING
    assert returned.what is Reception.RETURNED
    assert returned.age == pytest.approx(0.5)
    assert "comes again after 500 ms" in str(returned)


def test_a_tpdo_never_received_is_reported_as_such() -> None:
    (event,) = looks(until=0.2)
    assert event.never
    assert "has not come since the node became operational" in str(event)


def test_a_tpdo_that_is_silent_by_its_type_is_never_missing() -> None:
    assert looks(0.005, until=100.0, age=math.inf) == []


def test_our_own_lateness_is_not_the_drives_silence() -> None:
    """For 0.5 s there was no look and no SYNC; the frame after the next SYNC is in time."""
    frames = [number / 100 + 0.005 for number in range(10)]
    assert looks(*frames, 0.615, 0.625, 0.635, until=0.66, skip=(0.1, 0.6)) == []


def test_a_node_that_leaves_operational_is_not_asked_for_its_pdos() -> None:
    deadlines = Deadlines([Deadline(NODE, "TPDO1", 0x185, 0.05)], 0.01)
    assert deadlines.step(0.0, [-0.01], True) == []
    for number in range(1, 100):
        assert deadlines.step(number / 100, [-0.01], False) == []
    assert deadlines.step(1.0, [-0.01], True) == []  # it has its time again
    assert [deadlines.step(1.0 + number / 100, [-0.01], True) for number in range(1, 5)] == [[]] * 4


def test_the_port_reports_and_the_value_becomes_unknown(node: CanopenNode, fake: FakeBus) -> None:
    """The stale value itself is still given with its old stamp: it is the stamp that says that it is not fresh."""
    port = CanPort(node, plan_of(1), scan_period=SCAN)
    operational(node, fake)
    fake.inject(0x185, "37 02")
    eventually(lambda: port._slots[0].stamp > 0)
    stamp = port._slots[0].stamp
    for number in range(12):
        seen = port.read(stamp + number * SCAN)
    port.close()
    (event,) = node.pdo_events
    assert event.pdo == "TPDO1"
    assert event.age == pytest.approx(0.22, abs=0.021)  # more than five periods, seen at the look after that
    assert seen.statusword is not None
    assert seen.statusword.stamp == stamp
    assert seen.now - stamp > port.capabilities.max_age["statusword"]


# -- bits and dummies

# entries as object, sub-index, bits; signed; values; the frame, worked out by hand
FRAMES = [
    ([(0x6041, 0, 16), (0x6061, 0, 8)], [False, True], [0x1237, -3], "37 12 fd"),
    ([(0x0005, 0, 8), (0x6040, 0, 16)], [False, False], [0, 0x000F], "00 0f 00"),  # a dummy of 8 bits first
    ([(0x0006, 0, 16), (0x6040, 0, 16)], [False, False], [0, 0x000F], "00 00 0f 00"),
    ([(0x0007, 0, 32), (0x6040, 0, 16)], [False, False], [0, 0x000F], "00 00 00 00 0f 00"),
    (
        [(0x0001, 0, 1)] * 7 + [(0x2000, 1, 1)],
        [False] * 8,
        [0] * 7 + [1],
        "80",
    ),  # seven BOOLEAN dummies, then one bit
    (
        [(0x2000, 1, 4), (0x6064, 0, 32)],
        [False, True],
        [0xA, -2],
        "ea ff ff ff 0f",
    ),  # a value across byte borders
    ([(0x2000, 1, 1), (0x2000, 2, 3), (0x6061, 0, 8)], [False, True, True], [1, -1, -128], "0f 08"),
    ([(0x2000, 0, 24), (0x6077, 0, 16)], [True, True], [-1, -2], "ff ff ff fe ff"),  # INTEGER24
    ([(0x2000, 0, 64)], [True], [-2], "fe ff ff ff ff ff ff ff"),
]


@pytest.mark.parametrize(("entries", "signed", "values", "frame"), FRAMES)
def test_values_lie_in_the_frame_to_the_bit(
    entries: list[tuple[int, int, int]], signed: list[bool], values: list[int], frame: str
) -> None:
    codec = PdoCodec([MappedObject(*entry) for entry in entries], signed)
    assert codec.pack(values) == bytes.fromhex(frame)
    assert codec.unpack(bytes.fromhex(frame)) == tuple(values)
