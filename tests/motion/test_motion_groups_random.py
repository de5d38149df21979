"""Random commands of groups and axes at random times: no jolts, every handle ends, the scan lives, and all axes stop in the end.

``AXISBUS_GROUP_SEEDS=0:500`` tries other seeds than the usual few.
"""

from __future__ import annotations

import os
import random

import pytest

from axisbus.errors import AxisbusError
from axisbus.motion.states import AxisState
from kit.cell import Cell, Stage

FIRST, LAST = map(int, os.environ.get("AXISBUS_GROUP_SEEDS", "0:12").split(":"))
LIMIT = 1000.0  # deg/s²
JOLT = 1.2 * LIMIT
STEPS = 40
PAUSES = (0.0, 0.01, 0.02, 0.05, 0.1, 0.3, 0.7, 1.5)

# The commands of a group and of an axis, with their frequency.
OF_A_GROUP = [
    *["line"] * 6,
    *["direct"] * 3,
    *["enable"] * 3,
    "reset",
    "release",
    "halt",
    "halt",
    "stop",
    "disable",
]
OF_AN_AXIS = ["halt", "stop", "disable", "enable", "enable", "release", "reset", "move", "turn", "jog"]
# Commands that jolt by their nature, and faults.
HARD = ["quick_stop", "coast", "fault", "break"]
PROFILED = frozenset({"direct", "move", "turn", "jog"})


class Breaks:
    """A trajectory that goes and then raises."""

    duration = 5.0

    def __init__(self, start: float) -> None:
        self._start = start

    def position(self, t: float) -> float:
        if t > 0.3:
            raise LookupError("no such position")
        return self._start + 100.0 * t * t


class Chaos:
    """One cell, one seed: random commands, and the invariants."""

    def __init__(self, cell: Cell, seed: int, hard: bool) -> None:
        self.random = random.Random(seed)
        self.cell = cell
        self.hard = HARD if hard else []
        self.groups = [cell.machine.group(*names) for names in ("xyz", "xy", "z")]
        self.handles: list = []
        self.told: list[str] = []

    def prepare(self) -> None:
        """Set up drives that are slow in different ways; usually they are enabled."""
        pick = self.random
        for name in "xyz":
            self.cell.device(name).dials.sdo_delay = pick.choice([0.0, 0.0, 0.05, 0.3])
            self.cell.drive(name).dials.mode_delay = pick.choice([0.0, 0.0, 0.1, 0.2])
            self.cell.drive(name).dials.transition_delay = {2: pick.choice([0.0, 0.1, 0.3])}
        if pick.random() < 0.8:
            self.cell.enabled()

    def step(self) -> None:
        """Ask for something, let some time pass, and look."""
        if self.random.random() < 0.25:
            self._revive()
        name = self.random.choice("xyz")
        what = self.random.choice([*OF_A_GROUP, *OF_AN_AXIS, *self.hard])
        if what in PROFILED and self._any_on_a_path():
            return  # the reaction of a drive to a profile mode after a cyclic one belongs to another scenario
        of_axis = what not in OF_A_GROUP or self.random.random() < 0.3
        since = {axis: self.cell.moment(axis) for axis in "xyz"}
        self.told.append(f"{self.cell.now:.2f} {what} {name if of_axis else ''}")
        try:
            handle = self._of_axis(what, name) if of_axis and what not in ("line", "direct") else None
            handle = handle or self._of_group(what)
        except AxisbusError:
            handle = None
        if handle is not None:
            self.handles.append(handle)
        self.cell.run(self.random.choice(PAUSES))
        assert not self.cell.machine._core.scan.ended, self.told
        if not self.hard:
            for axis, moment in since.items():
                assert self.cell.hardest_change(axis, moment - 0.02) <= JOLT, (axis, self.told)

    def end(self) -> None:
        """Stop all; nothing may be left."""
        self.groups[0].stop()
        self.cell.run(6.0)
        assert not [handle for handle in self.handles if handle.exception() is None and not handle.done], (
            self.told
        )
        assert not [group for group in self.cell.machine._core.scan.groups.values() if group._active], (
            self.told
        )
        for axis in "xyz":
            assert self.cell.speed(axis) == 0.0, self.told
            assert self.hard or self.cell[axis].error is None, self.told

    def _revive(self) -> None:
        """Axes at standstill that are off or locked take commands again."""
        for name in "xyz":
            if self.cell[name].state in (AxisState.DISABLED, AxisState.STOPPING, AxisState.ERRORSTOP):
                axis = self.cell[name]
                self.handles += [axis.release(), axis.reset(), axis.enable()]
                self.cell.run(0.1)

    def _any_on_a_path(self) -> bool:
        cores = [self.cell.core(name) for name in "xyz"]
        return any(
            core.state is AxisState.SYNCHRONIZED_MOTION
            or (core.image.mode == 8 and not core.image.standstill)
            for core in cores
        )

    def _of_group(self, what: str):
        group = self.random.choice(self.groups)
        ends = [self.random.uniform(-300.0, 300.0) for _ in group]
        if what == "line":
            speed, ramp = self.random.choice([50.0, 200.0, 400.0]), self.random.choice([200.0, 800.0])
            return group.move_linear(ends, velocity=speed, acceleration=ramp)
        return group.move_direct(ends) if what == "direct" else getattr(group, what)()

    def _of_axis(self, what: str, name: str):
        axis = self.cell[name]
        if what == "fault":
            return self.cell.drive(name).fault(0x2310) or axis.halt()
        if what == "break":
            return axis.follow(Breaks(axis.position))
        if what in ("move", "turn", "jog"):
            verb = {"move": axis.move_absolute, "turn": axis.move_velocity, "jog": axis.jog}[what]
            return verb(self.random.uniform(-100.0, 100.0))
        return axis.disable(coast=True) if what == "coast" else getattr(axis, what)()


@pytest.mark.parametrize("hard", [False, True], ids=["gentle", "hard"])
@pytest.mark.parametrize("seed", range(FIRST, LAST))
def test_random_commands_of_groups_and_axes_at_random_times(tmp_path, seed, hard):
    with Stage(tmp_path) as stage:
        chaos = Chaos(stage.simulated("xyz", axis=f"max_acceleration = {LIMIT}"), seed, hard)
        chaos.prepare()
        for _ in range(STEPS):
            chaos.step()
        chaos.end()
