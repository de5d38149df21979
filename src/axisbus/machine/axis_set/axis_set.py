"""What groups and pairs of axes share: power, stops and override of all, each with one handle."""

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
    """Axes that are told the same, by one command; none of them blocks."""

    def __init__(
        self, name: str, axes: Mapping[str, Axis], commanding: CommandDispatcher, key: Target | None = None
    ) -> None:
        """``key``: by what the core knows it, where that is not its name."""
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
        """Its name in the cell file; of axes that a program has put together, theirs."""
        return self._name

    def disable(self) -> Handle:
        """Halt, then switch off all."""
        return self._all("disable()", c.Disable)

    def reset(self) -> Handle:
        """Reset all (MC_Reset, MC_GroupReset), each after the stop that it is in; never enables."""
        return self._all("reset()", c.ResetCommand)

    def halt(self) -> Handle:
        """Brake all to Standstill (MC_Halt, MC_GroupHalt), along the way that they are on; ``resume`` goes on."""
        return self._all("halt()", c.Halt)

    def stop(self) -> Handle:
        """Brake all, along the way that they are on, and lock them until ``release()`` (MC_Stop, MC_GroupStop)."""
        return self._all("stop()", c.Stop)

    def release(self) -> Handle:
        """End the lock of ``stop()``."""
        return self._all("release()", c.Release)

    def quick_stop(self) -> Handle:
        """Let every drive do its quick stop, each by its own ramp (605Ah, 6085h)."""
        return self._all("quick_stop()", c.QuickStop)

    @property
    def override(self) -> float:
        """The factor that this program has set last with ``set_override``; 1 before that."""
        return self._override

    def set_override(self, factor: float) -> Handle:
        """Go along lines and paths at ``factor`` times their velocity: 0 (they hold) to 1.5 (MC_GroupSetOverride).

        At any time, also in motion: the axes stay on their way, and change their speed along it by its acceleration. It stays so
        for what follows, until it is set again. It lifts no limit of an axis, and scales no halt, no stop and no profile move.
        Those of its axes, and of the cell, multiply it: the way goes at the lowest of its axes' factors times this one.

        Raises:
            ArgumentError: it is no number from 0 to 1.5.
        """
        found = override_of(f"{self.name}.set_override", factor)
        self._override = found
        return self._submit(f"set_override({found:g})", GroupSetOverride(found))

    def _all(self, name: str, make: Callable[[], c.Command], together: bool = False) -> Handle:
        return self._submit(name, ForEach({axis: make() for axis in self._axes}, together))

    def _submit(self, name: str, command: GroupCommand) -> Handle:
        return self._commanding.submit(self._key, command, f"{self.name}.{name}")
