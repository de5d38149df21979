"""Interlock of gantry pairs: axes of a pair do not move individually, and a stop of one axis stops both."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from axisbus.errors import StateError
from axisbus.motion import commands as c
from axisbus.motion.gantry.parameters import GantryParameters
from axisbus.motion.group.commands import ForEach, GroupContinue, MoveLinear, MovePath

_STOPS = (c.Halt, c.HandOver, c.Stop, c.QuickStop, c.Disable)
# Commands that neither move nor energise anything.
_HARMLESS = (
    c.ResetCommand,
    c.Release,
    c.SetOverride,
    c.Probe,
    c.ProbeAbort,
    c.ControllerOutput,
    c.HaltSuperimposed,
)

_PATH_COMMANDS = (MoveLinear, MovePath, GroupContinue)
_NEAR = 1e-6  # units
_SAMPLES = 64  # positions of a path that are checked, in addition to its segment boundaries


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
        """Return why ``command`` is rejected; None if it is permitted. ``name``: the command's name in the message.

        ``target``: the axis or group that the command was given to; ``axes``: the axes that it concerns.
        """
        if isinstance(target, str) and target in self.by_name:
            return None
        moved = (self._of[axis] for axis in axes if axis in self._of and self._moves(command, axis))
        pair = next((pair for pair in moved if not moves_together(command, pair)), None)
        if pair is None:
            return None
        return StateError(
            f"{name}: {pair.first} and {pair.second} carry one beam and may only move together",
            observed=f"they are [gantries.{pair.name}] of cell.toml, square when {pair.second} is {pair.offset:g} farther",
            remedy=f"move the pair in a program (gantry {pair.name} of the machine); one of them alone, slowly, by its square",
        )

    def pairs_moved(self, target: object, command: object, axes: Iterable[str]) -> list[str]:
        """Return the names of the pairs that a path of a group other than the pair's own moves together with other axes."""
        if target in self.by_name:
            return []
        return list(
            {self._of[axis].name for axis in axes if axis in self._of and isinstance(command, _PATH_COMMANDS)}
        )

    def partner_stops(
        self, command: object, axes: Collection[str], there: Collection[str]
    ) -> dict[str, c.Command]:
        """Return the stop commands for the other axis of each pair, if ``command`` stops only one axis of the pair.

        ``there``: the axes that are present; an optional node may be missing.
        """
        found: dict[str, c.Command] = {}
        for axis in axes:
            mate, own = self.mates.get(axis, ""), _own(command, axis)
            if mate in there and mate not in axes and isinstance(own, _STOPS):
                found[mate] = own
        return found

    def _moves(self, command: object, axis: str) -> bool:
        return not isinstance(_own(command, axis), (*_STOPS, *_HARMLESS))


def moves_together(command: object, pair: GantryParameters) -> bool:
    """Return whether a path of a group moves both axes of a pair as one: never far from square, and square at its end."""
    if not isinstance(command, _PATH_COMMANDS) or not set(pair.axes) <= set(command.axes):
        return False
    if isinstance(command, MoveLinear):
        return abs(command.ends[pair.second] - command.ends[pair.first] - pair.offset) <= _NEAR
    if isinstance(command, GroupContinue):
        return True  # it was checked when it began
    path, (first, second) = command.path, (command.axes.index(axis) for axis in pair.axes)
    samples = [path.at(path.length * number / _SAMPLES) for number in range(_SAMPLES + 1)]
    samples += [path.at(start) for start in path.starts]
    off = [abs(coordinates[second] - coordinates[first] - pair.offset) for coordinates in samples]
    return off[_SAMPLES] <= _NEAR and max(off) <= 0.5 * pair.max_skew


def _own(command: object, axis: str) -> object:
    """Return the command for one axis from a command that may be one for a whole group."""
    return command.commands.get(axis) if isinstance(command, ForEach) else command
