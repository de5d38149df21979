"""The short look at regular TPDOs: in every life of a port it gives the same inputs as a whole look in each cycle."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.mapping import DevicePdos
from axisbus.bus.pdo.plan import PdoRequirements, Policy, make_plan
from axisbus.bus.port import CanPort
from axisbus.bus.sdo.worker import SdoJob
from axisbus.cia301.nmt import NmtState
from axisbus.cia402.port import INPUT_OBJECTS, Sample
from axisbus.errors import BusOff
from kit.bus.fake_bus import FakeBus
from kit.bus.pdo_configurations import objects, tpdo

NODE, PERIOD, CYCLES = 5, 0.004, 800
# The mappings of a drive's TPDOs, and their transmission types: 255 is sent on change, or by an event timer.
DRIVES = (
    (("6041/16 6061/8 6064/32", 1),),
    (("6041/16 6061/8 6064/32", 1), ("606C/32 6077/16", 3)),
    (("6041/16", 1), ("6061/8", 255), ("6064/32", 1)),
    (("6041/16 6064/32", 1), ("6041/16 6061/8", 1)),  # one value in two
    (("6041/16 6064/32", 255),),
)
CODES = {16: "H", 8: "b", 32: "i"}


@pytest.fixture
def node(channel: Channel, fake: FakeBus) -> Iterator[CanopenNode]:
    with CanopenNode(channel, NODE) as node:
        yield node


def port_on(node: CanopenNode, drive: tuple[tuple[str, int], ...], primed: dict[str, Sample]) -> CanPort:
    pdos = tuple(
        tpdo(n + 1, mapping, kind, cob_id=0x180 + 0x100 * n + NODE) for n, (mapping, kind) in enumerate(drive)
    )
    names = tuple(name for name, index in INPUT_OBJECTS.items() if f"{index:04X}/" in str(drive))
    plan = make_plan(
        NODE,
        DevicePdos((), pdos),
        objects(),
        PdoRequirements(names, ()),
        Policy(remap=False, communication=False),
    )
    port = CanPort(node, plan, scan_period=PERIOD)
    port._poller = None
    port._tpdo_inputs.samples.update(primed)
    return port


def packed(dice: random.Random, mapping: str) -> bytes:
    sizes = [int(entry.split("/")[1]) for entry in mapping.split()]
    whole = b"".join(struct.pack("<" + CODES[size], dice.randrange(100)) for size in sizes)
    return whole if dice.random() < 0.97 else whole[:-1]


def events(node: CanopenNode, port: CanPort, now: float) -> tuple[object, list[object]]:
    """The inputs of a port, and the events of its TPDOs."""
    before = len(node.pdo_events)
    inputs = port.read(now)
    told = [str(event) for event in list(node.pdo_events)[before:]]
    return inputs, told


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("seed", range(6))
def test_the_short_look_gives_the_samples_of_the_whole_one(node: CanopenNode, drive, seed: int) -> None:
    dice = random.Random(f"{seed} {drive}")
    primed = {"demand": Sample(7, 0.5), "position": Sample(3, dice.choice((0.5, 1.01)))}
    short, whole = port_on(node, drive, primed), port_on(node, drive, primed)
    now, silent, short_looks, node.nmt.state = 1.0, set(), 0, NmtState.OPERATIONAL
    for cycle in range(CYCLES):
        now += PERIOD * dice.choice((1, 1, 1, 1, 1, 1.2, 0.9, 2.01, 8) if dice.random() < 0.2 else (1,))
        trouble(dice, node, now)
        if dice.random() < 0.02:
            silent = {n for n in range(len(drive)) if dice.random() < 0.4}
        for n, (mapping, kind) in enumerate(drive):
            if n in silent or (kind == 3 and cycle % 3) or (kind == 255 and dice.random() < 0.7):
                continue
            data, stamp = packed(dice, mapping), now - dice.choice((0.001, 0.0, 0.0035, 0.02, -0.0001))
            for port in (short, whole):
                port._slots[n].on_frame(data, stamp)
        whole._tpdo_inputs.steady = False
        steady = short._tpdo_inputs.steady
        found = events(node, short, now)
        assert found == events(node, whole, now), cycle
        short_looks += steady and short._tpdo_inputs._unrecorded
        if dice.random() < 0.01:
            # now and then the whole look has to find everything as it would be
            short._tpdo_inputs.steady = False
    if drive in DRIVES[:2]:
        assert short_looks > 20
    if drive == DRIVES[3]:
        assert not short_looks
    short.close()
    whole.close()


def trouble(dice: random.Random, node: CanopenNode, now: float) -> None:
    """Cause a random disturbance of a node and its bus between two cycles."""
    what, nmt, channel = dice.random(), node.nmt, node.channel
    if what < 0.004:
        nmt.state = dice.choice((NmtState.PRE_OPERATIONAL, NmtState.STOPPED))
    elif what < 0.04:
        nmt.state = NmtState.OPERATIONAL
    elif what < 0.044:
        nmt.deadline = now - 0.001
    elif what < 0.06:
        nmt.deadline = now + 10.0
    elif what < 0.063:
        channel.off = channel.last_bus_off = BusOff("the bus is off")
        channel.bus_off_count += 1
    elif what < 0.08:
        channel.off = None
    elif what < 0.09:
        node.emcy._on_frame(bytes.fromhex("1042090000000000"), now)


def short_bus_off(node: CanopenNode) -> None:
    """A bus-off that has ended before the next look."""
    node.channel.last_bus_off = BusOff("off")
    node.channel.bus_off_count += 1


@pytest.mark.parametrize(
    ("change", "back"),
    [
        (lambda node: setattr(node.nmt, "state", NmtState.STOPPED), True),
        (lambda node: setattr(node.nmt, "deadline", 0.0), True),
        (lambda node: setattr(node.channel, "off", BusOff("off")), False),
        (short_bus_off, True),
        (lambda node: setattr(node.nmt, "bootups", 1), False),
    ],
)
def test_any_event_of_the_node_or_the_bus_ends_the_fast_path_at_once(
    node: CanopenNode, change, back: bool
) -> None:
    port = port_on(node, DRIVES[0], {})
    node.nmt.state, now = NmtState.OPERATIONAL, 1.0

    def look() -> bool:
        port._slots[0].on_frame(struct.pack("<Hbi", 0x1637, 8, 5), now - 0.001)
        return port.read(now).operational

    for _ in range(3):
        now += PERIOD
        assert look()
    assert port._tpdo_inputs._unrecorded
    change(node)
    now += PERIOD
    assert not look()
    node.nmt.state, node.nmt.deadline = NmtState.OPERATIONAL, 1e9
    now += PERIOD
    assert look() is back
    port.close()


def test_a_short_look_ends_if_frames_fall_behind_sync_and_their_values_have_its_time(
    node: CanopenNode, monkeypatch
) -> None:
    """From cycle 20 on each frame comes six SYNCs after the one that it answers; none is lost."""
    asked: list[SdoJob] = []
    monkeypatch.setattr(node.worker, "submit", asked.append)
    port, syncs, late = port_on(node, DRIVES[0], {}), node.channel.syncs, 6
    (slot,) = port._slots
    node.nmt.state = NmtState.OPERATIONAL
    node.sdo.trips.note(0.0, 0.002)
    sent, found, answers = [], [], 0
    for cycle in range(60):
        now = 10.0 + PERIOD * cycle
        syncs.note(now)
        sent.append(now)
        answered = cycle if cycle < 20 else cycle - late
        if cycle < 20 or answered >= 20:
            slot.on_frame(struct.pack("<Hbi", 0x27, 8, answered), now + 0.001)
        if len(asked) > answers and cycle == 35:  # the answer is as late as the frames
            answers = len(asked)
            node.sdo.trips.note(now - late * PERIOD, now + 0.0005)
        steady = port._tpdo_inputs.steady
        inputs = port.read(now + 0.002)
        if inputs.position is not None:
            found.append((steady, inputs.position, inputs.lag))
    assert [position.value for _, position, _ in found[-20:]] == list(range(60 - late - 20, 60 - late))
    assert all(position.stamp == sent[position.value] + 0.001 for _, position, _ in found[:20])
    assert all(steady for steady, _, _ in found[3:20])
    assert {position.stamp for _, position, _ in found[-20:]} == set(sent[60 - late - 20 : 60 - late])
    assert {round(lag, 6) for _, _, lag in found[-20:]} == {late * PERIOD + 0.001}
    assert ([(job.index, job.value) for job in asked], answers) == ([(0x1001, None)], 1)


def test_a_lost_frame_does_not_count_as_late_once_the_node_has_answered(
    node: CanopenNode, monkeypatch
) -> None:
    asked: list[SdoJob] = []
    monkeypatch.setattr(node.worker, "submit", asked.append)
    port, syncs = port_on(node, DRIVES[0], {}), node.channel.syncs
    (slot,) = port._slots
    node.nmt.state = NmtState.OPERATIONAL
    stamps = []
    for cycle in range(60):
        now = 10.0 + PERIOD * cycle
        syncs.note(now)
        if cycle not in range(20, 26):
            slot.on_frame(struct.pack("<Hbi", 0x27, 8, cycle), now + 0.001)
        if asked:
            node.sdo.trips.note(now - 0.0005, now)
            asked.pop().done(0, None)
        stamps.append(port.read(now + 0.002).position.stamp - now)
    assert stamps[-30:] == pytest.approx([0.001] * 30)
