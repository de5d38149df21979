"""A group of axes as its user sees it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from axisbus.errors import ArgumentError, LimitError, StaleError, StateError
from axisbus.machine.axis import Axis
from axisbus.machine.commanding import Commanding
from axisbus.machine.handle import Handle
from axisbus.machine.request import shown
from axisbus.motion import commands as c
from axisbus.motion.group.commands import ForEach, GroupCommand, MoveLinear
from axisbus.motion.group.path import nearest_on_line
from axisbus.motion.numbers import number, told
from axisbus.motion.ticket import Status
from axisbus.session import Target
from axisbus.wording import counted


class _Line(NamedTuple):
    """A straight line of this program's: where it began, what was asked for, and what became of it."""

    starts: Mapping[str, float]
    command: MoveLinear
    handle: Handle


class Group:
    """Axes that are enabled, halted, stopped and started in one SYNC; each command returns one ``Handle`` for all.

    "In one SYNC" holds for drives whose RPDOs are synchronous; ``axisbus boot`` says which are.
    """

    def __init__(
        self, name: str, axes: Mapping[str, Axis], commanding: Commanding, key: Target | None = None
    ) -> None:
        """``key``: by what the core knows it, where that is not its name."""
        self.name = name
        self._key = name if key is None else key
        self._axes = dict(axes)
        self._commanding = commanding
        self._line: _Line | None = None  # the last one

    def __repr__(self) -> str:
        known = self._commanding.session.dead is None
        states = (
            f"{name} {axis.snapshot.state.value if known else 'unknown'}" for name, axis in self._axes.items()
        )
        return f"<Group {self.name}: {', '.join(states)}>"

    def __iter__(self) -> Iterator[Axis]:
        return iter(self._axes.values())

    def enable(self) -> Handle:
        """Switch all power stages on, once all axes stand; the last transition is taken by all together."""
        return self._all("enable()", c.Enable, together=True)

    def disable(self) -> Handle:
        """Halt and switch off all."""
        return self._all("disable()", c.Disable)

    def reset(self) -> Handle:
        """Reset all."""
        return self._all("reset()", c.Reset)

    def halt(self) -> Handle:
        """Brake all to Standstill; on a straight line they stay on it."""
        return self._all("halt()", c.Halt)

    def stop(self) -> Handle:
        """Brake all and lock them until ``release()``."""
        return self._all("stop()", c.Stop)

    def release(self) -> Handle:
        """End the lock of ``stop()``."""
        return self._all("release()", c.Release)

    def quick_stop(self) -> Handle:
        """Let every drive do its quick stop."""
        return self._all("quick_stop()", c.QuickStop)

    def move_linear(
        self, positions: Sequence[float], *, velocity: float, acceleration: float | None = None
    ) -> Handle:
        """Move all on a straight line to ``positions`` (in the group's order of axes) in cyclic synchronous position mode.

        ``velocity`` (unit/s) and ``acceleration`` (unit/s², by default the smallest of the defaults) are those of the path: the
        Euclidean length over all axes. Axes that would be asked for more than their own limits slow all down.

        Raises:
            LimitError: an end lies beyond an axis's position limits.
            ArgumentError: a value is missing, not finite or not positive.
        """
        name = f"move_linear({_list(positions)}, velocity={shown(velocity)})"
        ends = self._ends(name, positions)
        speed = self._positive(name, "velocity", velocity)
        ramp = self._positive(
            name,
            "acceleration",
            self._smallest_acceleration(name) if acceleration is None else acceleration,
        )
        return self._lead(name, MoveLinear(ends, speed, ramp), None)

    def resume(self) -> Handle:
        """Go on along the last straight line of this program, which was broken off, to its end (MC_GroupContinue).

        With its velocity and acceleration, from where the axes stand: after a halt, a stop that was released, or an error that was
        reset. Every axis must still be on the line, within ``position_window`` (a tenth of ``standstill_window`` where that is not
        known): nothing goes on with what was moved meanwhile, or has left the line by a stop of the drive's own.

        Raises:
            StateError: there was no line, it is under way or at its end, or an axis has left it.
            StaleError: an axis's position is not known.
        """
        line = self._line
        name = "resume()"
        if line is None:
            raise StateError(
                f"{self.name}.{name}: there is no line to go on with",
                remedy="begin one: group.move_linear(positions, velocity=...)",
            )
        if line.handle.busy or line.handle.status is Status.DONE:
            is_now = "is under way" if line.handle.busy else "has come to its end"
            raise StateError(
                f"{self.name}.{name}: {line.handle.name} {is_now}, so there is nothing to go on with"
            )
        self._require_on(line, name)
        return self._lead(name, line.command, line.starts)

    def move_direct(self, positions: Sequence[float], *, velocity: float | None = None) -> Handle:
        """Move each axis to its position by its own profile (profile position mode); all start in the same cycle.

        ``velocity`` (unit/s) replaces each axis's default. Raises as ``Axis.move_absolute``.
        """
        name = f"move_direct({_list(positions)})"
        self._ends(name, positions)
        moves = {
            axis.name: axis.absolute_command(name, value, velocity)
            for axis, value in zip(self._axes.values(), positions, strict=True)
        }
        return self._submit(name, ForEach(moves, together=True))

    def _all(self, name: str, make: Callable[[], c.Command], together: bool = False) -> Handle:
        return self._submit(name, ForEach({axis: make() for axis in self._axes}, together))

    def _lead(self, name: str, command: MoveLinear, starts: Mapping[str, float] | None) -> Handle:
        """Begin a line, and keep it in mind; ``starts``: where it began once, where it is gone on with."""
        try:
            begun = self._places() if starts is None else starts
        except StaleError:  # it will be refused
            return self._submit(name, command)
        handle = self._submit(name, command)
        self._line = _Line(begun, command, handle)
        return handle

    def _places(self) -> dict[str, float]:
        return {name: axis.unwrapped for name, axis in self._axes.items()}

    def _require_on(self, line: _Line, name: str) -> None:
        here = self._places()
        nearest = nearest_on_line(line.starts, line.command.ends, here)
        away = {axis: abs(here[axis] - nearest[axis]) for axis in nearest}
        worst = max(away, key=lambda axis: away[axis] / self._axes[axis].place_window)
        allowed, unit = self._axes[worst].place_window, self._axes[worst].unit
        if away[worst] > allowed:
            places = ", ".join(f"{place:.6g}" for place in nearest.values())
            raise StateError(
                f"{self.name}.{name}: {worst} is no longer on the line",
                observed=f"it is {away[worst]:.6g} {unit} away from it, of which {allowed:.6g} {unit} are allowed",
                remedy=f"go back to it first: group.move_direct(({places},)); or begin a new one: group.move_linear(...)",
            )

    def _submit(self, name: str, command: GroupCommand) -> Handle:
        return self._commanding.submit(self._key, command, f"{self.name}.{name}")

    def _ends(self, name: str, positions: Sequence[float]) -> dict[str, float]:
        if len(positions) != len(self._axes):
            raise ArgumentError(
                f"{self.name}.{name}: {counted(len(positions), 'position')} for {counted(len(self._axes), 'axis', 'axes')}",
                remedy=f"give one for each of {', '.join(self._axes)}, in this order",
            )
        return {
            axis.name: axis.absolute_position(name, value)
            for axis, value in zip(self._axes.values(), positions, strict=True)
        }

    def _smallest_acceleration(self, name: str) -> float:
        known = [axis.default_acceleration for axis in self._axes.values()]
        if any(value is None for value in known):
            missing = [axis.name for axis in self._axes.values() if axis.default_acceleration is None]
            raise ArgumentError(
                f"{self.name}.{name}: acceleration is missing",
                observed=f"the call does not give it, and {missing[0]} has no default",
                remedy=f"give acceleration = ... in the call, or acceleration in [axes.{missing[0]}.defaults]",
            )
        return min(value for value in known if value is not None)

    def _positive(self, name: str, what: str, value: float) -> float:
        magnitude = number(value)
        if magnitude is None or magnitude <= 0:
            raise LimitError(
                f"{self.name}.{name}: {what} {told(value)} must be a finite number above 0",
                remedy=f"give the {what} of the path, a magnitude in the axes' unit",
            )
        return magnitude


def _list(values: Sequence[float]) -> str:
    return ", ".join(shown(value) for value in values)
