"""In which SYNC each axis of a group sets off, by the simulated drives' own record: as often as one likes, out of rest."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from axisbus import Group
from axisbus.machine.handle import Handle
from kit.cell import Cell, Stage

PERIOD = 0.01  # seconds
_REACH = (20.0, 60.0)  # degrees that an axis goes: so far that it is an increment away after one cycle
_AXIS = "max_acceleration = 20000.0"
_FAR = 0.005  # degrees: half an increment
_SLOW = (0.0, 0.0, 0.05, 0.2)  # seconds that a drive takes to change its mode


class Starts(NamedTuple):
    """How many starts there were, how many with a change of mode, and how many SYNCs apart the farthest two axes set off."""

    count: int
    changed: int
    apart: int


def starts(seed: int, count: int, folder: Path) -> Starts:
    """Return the result of so many starts of three axes, in motions planned by their drives or by the master."""
    chance = random.Random(seed)
    with Stage(folder) as stage:
        cell = stage.simulated("xyz", axis=_AXIS).enabled()
        group = cell.machine.group("x", "y", "z")
        found = [_start(cell, group, chance) for _ in range(count)]
    return Starts(count, sum(changed for changed, _ in found), max(apart for _, apart in found))


def _start(cell: Cell, group: Group, chance: random.Random) -> tuple[bool, int]:
    """Return whether a drive had to change its mode, and how many SYNCs the axes set off apart."""
    names = [axis.name for axis in group]
    modes = [cell.drive(name).mode_display for name in names]
    for name in names:
        cell.drive(name).dials.mode_delay = chance.choice(_SLOW)
    goal = [_away(axis.position, chance) for axis in group]
    before = {name: cell.moment(name) for name in names}
    handle = chance.choice(_WAYS)(group, goal)
    cell.end_of(handle)
    cell.run(0.1)
    return modes != [cell.drive(name).mode_display for name in names], _apart(cell, before)


def _away(place: float, chance: random.Random) -> float:
    far = chance.uniform(*_REACH)
    return place - far if place > 0.0 else place + far


def _direct(group: Group, goal: list[float]) -> Handle:
    return group.move_direct(goal)


def _linear(group: Group, goal: list[float]) -> Handle:
    return group.move_linear(goal, velocity=300.0, acceleration=8000.0)


def _path(group: Group, goal: list[float]) -> Handle:
    corner = [(axis.position + end) / 2 for axis, end in zip(group, goal, strict=True)]
    return group.move_path([corner, goal], velocity=300.0, acceleration=8000.0, blend=1.0)


_WAYS: tuple[Callable[[Group, list[float]], Handle], ...] = (_direct, _linear, _path)


def _apart(cell: Cell, before: dict[str, float]) -> int:
    """SYNCs from the first axis that moves away from its position to the last one."""
    times = [_set_off(cell, name, moment) for name, moment in before.items()]
    return round((max(times) - min(times)) / PERIOD)


def _set_off(cell: Cell, name: str, moment: float) -> float:
    samples = cell.record(name).since(moment)
    return next(one.time for one in samples if abs(one.demand - samples[0].demand) > _FAR)
