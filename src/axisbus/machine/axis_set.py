"""Commands that groups and gantry pairs share: power, stops and override of all axes, each with one handle."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from axisbus.machine.axis import Axis
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.handle import Handle
from axisbus.machine.request import override_of
from axisbus.motion import commands as c
from axisbus.motion.group.commands import ForEach, GroupCommand, GroupSetOverride
from axisbus.session import Target


class AxisSet:
    """Axes that receive the same command together; no command blocks."""

    def __init__(
        self, name: str, axes: Mapping[str, Axis], commanding: CommandDispatcher, key: Target | None = None
    ) -> None:
        """``key``: the core's key of the set, if it is not its name."""
        self._name = name
        self._key = name if key is None else key
        self._axes = dict(axes)
        self._commanding = commanding
        self._override = 1.0

    def __repr__(self) -> str:
        known = self._commanding.session.dead is None
        states = (
            f"{name} {axis.snapshot.state.value if known else 'unknown'}" for name, axis in self._axes.items()
        )
        return f"<{type(self).__name__} {self.name}: {', '.join(states)}>"

    def __iter__(self) -> Iterator[Axis]:
        return iter(self._axes.values())

    @property
    def name(self) -> str:
        """Its name in the cell file; for axes that a program has combined, their names."""
        return self._name

    def disable(self) -> Handle:
        """Halt all axes, then switch their power stages off."""
        return self._all("disable()", c.Disable)

    def reset(self) -> Handle:
        """Reset all axes (MC_Reset, MC_GroupReset), each after its active stop has ended; never enables."""
        return self._all("reset()", c.ResetCommand)

    def halt(self) -> Handle:
        """Brake all axes to Standstill (MC_Halt, MC_GroupHalt), along their present path; ``resume`` continues it."""
        return self._all("halt()", c.Halt)

    def stop(self) -> Handle:
        """Brake all axes along their present path, and lock them until ``release()`` (MC_Stop, MC_GroupStop)."""
        return self._all("stop()", c.Stop)

    def release(self) -> Handle:
        """End the lock of ``stop()``."""
        return self._all("release()", c.Release)

    def quick_stop(self) -> Handle:
        """Make every drive perform its quick stop, each with its own ramp (605Ah, 6085h)."""
        return self._all("quick_stop()", c.QuickStop)

    @property
    def override(self) -> float:
        """The last factor that this program has set with ``set_override``; 1 before that."""
        return self._override

    def set_override(self, factor: float) -> Handle:
        """Multiply the velocity of lines and paths by ``factor``: 0 (the axes hold) to 1.5 (MC_GroupSetOverride).

        It may be called at any time, also in motion: the axes stay on their path, and change their velocity along it with the
        path's acceleration. The factor applies until it is set again. It lifts no limit of an axis, and scales no halt, no stop and
        no profile move. The overrides of the axes and of the cell multiply it: the path has the lowest factor of its axes times
        this one.

        Raises:
            ArgumentError: not a number from 0 to 1.5.
        """
        found = override_of(f"{self.name}.set_override", factor)
        self._override = found
        return self._submit(f"set_override({found:g})", GroupSetOverride(found))

    def _all(self, name: str, make: Callable[[], c.Command], together: bool = False) -> Handle:
        return self._submit(name, ForEach({axis: make() for axis in self._axes}, together))

    def _submit(self, name: str, command: GroupCommand) -> Handle:
        return self._commanding.submit(self._key, command, f"{self.name}.{name}")
