"""Drives that take an RPDO entry by entry: a move arrives with every mapping, because no edge of bit 4 precedes its target.

CiA 301 leaves the order open. The fault setting ``rpdos_in_order`` of the simulated drive selects the worst one: entries in the
order of the mapping, RPDOs by number, and the set-point is latched when bit 4 rises. The oracle is the target of the drive at
that moment, and the final position of its motor.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from unittest.mock import patch

import pytest

from axisbus.bus.pdo import setpoint_edge_order
from axisbus.eds.builtin import resolve
from axisbus.errors import MotionTimeout
from kit.cell import GENERIC, SCALE, Cell, Stage
from kit.setpoints import edges

PP = 1
WORD, MODE, TARGET, SPEED = "6040", "6060", "607A", "60FF"
TARGETS = [12.0, -7.0]
# Slow enough that a busy computer's own delays are not taken for a silence of the drive.
SLOW = {"period": "40ms", "heartbeat": "400ms"}

# RPDO number -> its mapping; the drive has four, and an empty map switches one off. None: the layout of the master.
MAPPINGS: dict[str, dict[int, list[str]] | None] = {
    "the master's own": None,
    "the controlword last": {1: [MODE, TARGET, WORD], 2: [SPEED], 3: [], 4: []},
    "the controlword first": {1: [WORD, MODE, TARGET], 2: [SPEED], 3: [], 4: []},
    "the controlword in the middle, before the target": {1: [MODE, WORD, TARGET], 2: [SPEED], 3: [], 4: []},
    "the controlword in the middle, behind the target": {1: [TARGET, WORD, MODE], 2: [SPEED], 3: [], 4: []},
    "the controlword alone, before the target": {1: [WORD], 2: [MODE, TARGET], 3: [SPEED], 4: []},
    "the controlword alone, behind the target": {1: [MODE, TARGET], 2: [SPEED], 3: [], 4: [WORD]},
    "the target alone": {1: [WORD, MODE], 2: [TARGET], 3: [SPEED], 4: []},
    "a controlword in each, in front": {1: [WORD], 2: [WORD, MODE], 3: [WORD, TARGET], 4: [WORD, SPEED]},
    "a controlword in each, behind": {1: [WORD], 2: [MODE, WORD], 3: [TARGET, WORD], 4: [SPEED, WORD]},
    "the controlword by SDO": {1: [MODE, TARGET], 2: [SPEED], 3: [], 4: []},
    "the target by SDO": {1: [WORD, MODE], 2: [SPEED], 3: [], 4: []},
}
# Whether an edge that goes with its target would find the old one on such a drive.
UNSAFE = [
    "the controlword first",
    "the controlword in the middle, before the target",
    "the controlword alone, before the target",
    "the target alone",
    "a controlword in each, in front",
]
TRAVELS = {
    "with SYNC": ("", ""),
    "on arrival": ("sync = false", ""),
    "the controlword's on arrival": ("", WORD),
    "the target's on arrival": ("", TARGET),
}
APART = [
    "the controlword alone, before the target",
    "the controlword alone, behind the target",
    "the target alone",
]
CASES = [
    (name, travels)
    for travels, (_, on_arrival) in TRAVELS.items()
    for name in (APART if on_arrival else MAPPINGS)
]


def tables(mapping: dict[int, list[str]] | None, on_arrival: str) -> str:
    """The PDO tables of a cell file; RPDOs with the object ``on_arrival`` are of type 255."""
    text = ""
    for number, keys in (mapping or {}).items():
        text += f"[nodes.1.pdo.rpdo{number}]\nmap = {keys}\n"
        if on_arrival:
            text += f"transmission = {255 if on_arrival in keys else 1}\n"
    return text


def unmapped(stage: Stage) -> str:
    """The generic drive as one whose maker maps nothing: the master lays its RPDOs out."""
    text = resolve(GENERIC, stage.folder).read_text("utf-8")
    text, count = re.subn(r"(\[160[0-3]sub0\][^\[]*?DefaultValue=)\d+", r"\g<1>0", text)
    assert count == 4
    (stage.folder / "unmapped.eds").write_text(text, "utf-8")
    return "unmapped.eds"


def opened(stage: Stage, name: str, travels: str) -> Cell:
    bus, on_arrival = TRAVELS[travels]
    eds = GENERIC if MAPPINGS[name] is not None else unmapped(stage)
    cell = stage.real("x", bus=bus, eds=eds, more=tables(MAPPINGS[name], on_arrival), **SLOW)
    cell.device().dials.rpdos_in_order = True
    cell.x.enable().wait(10)
    return cell


@pytest.mark.parametrize(("name", "travels"), CASES)
def test_moves_arrive_with_every_mapping(scenario: Stage, name: str, travels: str) -> None:
    cell = opened(scenario, name, travels)
    seen = edges(cell)
    for target in TARGETS:
        cell.x.move_absolute(target, velocity=300.0, acceleration=3000.0).wait(10)
        assert abs(cell.where() - target) < 0.5
    assert seen == TARGETS


def test_the_master_maps_the_controlword_last(scenario: Stage) -> None:
    device = opened(scenario, "the master's own", "with SYNC").device()
    count = device.read(0x1600, 0)
    mapped = [device.read(0x1600, number) >> 16 for number in range(1, count + 1)]
    assert mapped == [0x6060, 0x607A, 0x6040]


@pytest.fixture
def edge_with_target() -> Iterator[None]:
    """The remedy taken out: the edge goes with its target, whatever the mapping."""
    with patch.object(setpoint_edge_order, "after_target", lambda _: False):
        yield


@pytest.mark.parametrize("name", UNSAFE)
def test_without_the_wait_the_drive_takes_the_old_target(
    scenario: Stage, name: str, edge_with_target: None
) -> None:
    """The counter-check of the scenarios above: the same drive, and an edge in the same cycle as its target."""
    cell = opened(scenario, name, "with SYNC")
    seen = edges(cell)
    move = cell.x.move_absolute(TARGETS[0], velocity=300.0, acceleration=3000.0, timeout=2.0)
    with pytest.raises(MotionTimeout, match="has not arrived"):
        move.wait(10)
    assert seen == [pytest.approx(0.0, abs=0.5)]


def test_a_replaced_move_never_takes_the_older_target(scenario: Stage) -> None:
    cell = opened(scenario, "the controlword first", "with SYNC")
    seen = edges(cell)
    cell.x.move_absolute(200.0, velocity=50.0)
    cell.run(0.3)
    cell.x.move_absolute(-5.0, velocity=300.0, acceleration=3000.0).wait(10)
    assert abs(cell.where() + 5.0) < 0.5
    assert seen == [200.0, -5.0]


def test_the_edge_is_sent_exactly_one_sync_after_the_target(scenario: Stage) -> None:
    """Not later: a set-point costs one period, and only if the mapping needs it."""
    cell = opened(scenario, "the controlword first", "with SYNC")
    device, taken = cell.device(), []
    lock = threading.Lock()
    sync, drive = device.sync, cell.drive()

    def counted() -> None:
        with lock:
            taken.append((drive.target_position, bool(drive.controlword & 0x10)))
        sync()

    device.sync = counted
    cell.x.move_absolute(8.0, velocity=300.0, acceleration=3000.0).wait(10)
    at_sync = taken[: [edge for _, edge in taken].index(True) + 1]
    new = [target == round(8.0 * SCALE) for target, _ in at_sync]
    assert new.index(True) == len(at_sync) - 2
