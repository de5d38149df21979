"""A group of axes as its user sees it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from axisbus.errors import ArgumentError, LimitError
from axisbus.machine.axis import Axis
from axisbus.machine.commanding import Commanding
from axisbus.machine.handle import Handle
from axisbus.machine.request import shown
from axisbus.motion import commands as c
from axisbus.motion.group.commands import ForEach, GroupCommand, MoveLinear
from axisbus.motion.numbers import number, told
from axisbus.session import Target
from axisbus.wording import counted


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
        return self._submit(name, MoveLinear(ends, speed, ramp))

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
