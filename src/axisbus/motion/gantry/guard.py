"""Axes that belong to a pair are not moved one by one, and what stops one of them stops both."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from axisbus.errors import StateError
from axisbus.motion import commands as c
from axisbus.motion.gantry.parameters import GantryParameters
from axisbus.motion.group.commands import ForEach

_STOPS = (c.Halt, c.Stop, c.QuickStop, c.Disable)
# They move and energise nothing.
_HARMLESS = (c.Reset, c.Release, c.SetOverride, c.Probe, c.ProbeAbort, c.Answer, c.HaltSuperimposed)


class Pairs:
    """The pairs of a cell, by name."""

    def __init__(self, pairs: Mapping[str, GantryParameters]) -> None:
        self.by_name = dict(pairs)
        self.mates = dict[str, str]()
        self._of = dict[str, GantryParameters]()
        for pair in pairs.values():
            for axis, mate in (pair.axes, pair.axes[::-1]):
                self.mates[axis], self._of[axis] = mate, pair

    def __bool__(self) -> bool:
        return bool(self.by_name)

    def refusal(self, target: object, command: object, axes: Iterable[str], name: str) -> StateError | None:
        """Return why ``command`` (which ``name`` tells people) cannot be taken; None where it can.

        ``target``: the axis or group that it was given to; ``axes``: those that it concerns.
        """
        if isinstance(target, str) and target in self.by_name:
            return None
        pair = next(
            (self._of[axis] for axis in axes if axis in self._of and self._moves(command, axis)), None
        )
        if pair is None:
            return None
        return StateError(
            f"{name}: {pair.first} and {pair.second} carry one beam, and are moved together alone",
            observed=f"they are [gantries.{pair.name}] of cell.toml",
            remedy=f'move the pair: machine.gantry("{pair.name}"); one of them alone, slowly and watched, by its square(...)',
        )

    def left_out(
        self, command: object, axes: Collection[str], there: Collection[str]
    ) -> dict[str, c.Command]:
        """Return what the mates of ``axes`` are told as well, where ``command`` stops one axis of a pair and not the other.

        ``there``: the axes that there are; an optional node may be missing.
        """
        found: dict[str, c.Command] = {}
        for axis in axes:
            mate, own = self.mates.get(axis, ""), _own(command, axis)
            if mate in there and mate not in axes and isinstance(own, _STOPS):
                found[mate] = own
        return found

    def _moves(self, command: object, axis: str) -> bool:
        return not isinstance(_own(command, axis), (*_STOPS, *_HARMLESS))


def _own(command: object, axis: str) -> object:
    """Return what an axis is told by a command, which may be one for a whole group."""
    return command.commands.get(axis) if isinstance(command, ForEach) else command
