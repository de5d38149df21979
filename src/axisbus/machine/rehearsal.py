"""The axes of a cell as its files alone describe them: a command is refused as the call itself would be, and nothing is sent.

Theory of operation
-------------------
The axes are those of ``motion``, with their own checks; only what would take their commands is replaced. It knows no drive: an axis
stands where it was last ``seen``, else at 0, and is homed once it was told to home. What only the drive can tell (its state, where
homing by a switch ends) is judged by the machine itself, later.
"""

from __future__ import annotations

from typing import cast

from axisbus.cell.model import CellConfig
from axisbus.cell.parameters import axis_parameters
from axisbus.cia402 import homing
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import State
from axisbus.core.runtime import load_dictionaries
from axisbus.core.scan import Scan
from axisbus.errors import LimitError, StateError
from axisbus.machine.axis import Axis
from axisbus.motion import commands as c
from axisbus.motion.axis import accept_motion as motion
from axisbus.motion.handle import NOBODY, Handle, Status
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState

_AT_REST = Snapshot(
    0.0, AxisState.STANDSTILL, State.OPERATION_ENABLED, None, None, 0, 0.0, None, None, None, None, 0, False, True, None
)  # fmt: skip
_ANYWHERE = None
_Place = int | None  # user increments; None where an axis may be anywhere


class Rehearsal:
    """The axes of a cell without its drives; holds state: which axes were told to home, and where they are seen."""

    def __init__(self, cell: CellConfig) -> None:
        """Read the EDS files of the cell, in which ``checked`` finds no error.

        Raises:
            EdsError: one is missing or cannot be read.
        """
        files = load_dictionaries(cell)
        self.cell = cell
        self._parameters = {
            name: axis_parameters(cell, name, files[axis.node]) for name, axis in cell.axes.items()
        }
        self._stage = _Stage(cell, self._parameters)

    def __getitem__(self, name: str) -> Axis:
        """Return an axis, whose commands raise what speaks against them and are done at once otherwise.

        Raises:
            StateError: the cell has no such axis.
        """
        if name not in self._parameters:
            raise StateError(
                f"the cell has no axis {name!r}", observed=f"it has {', '.join(self._parameters) or 'none'}"
            )
        return Axis(self._parameters[name], cast(Scan, self._stage), NOBODY)

    def see(self, name: str, snapshot: Snapshot) -> None:
        """Take over where an axis really is."""
        self._stage.see(name, snapshot)


class _Stage:
    """What takes the commands in place of a scan, and only judges them."""

    dead = silent = leaving_because = failure = None
    ended = False

    def __init__(self, cell: CellConfig, parameters: dict[str, AxisParameters]) -> None:
        self._cell = cell
        self._parameters = parameters
        self.snapshots = dict.fromkeys(parameters, _AT_REST)
        self._places: dict[str, _Place] = dict.fromkeys(parameters, _ANYWHERE)

    def see(self, name: str, snapshot: Snapshot) -> None:
        """Take over where an axis is; one whose position is not known may be anywhere."""
        known = snapshot.position is not None
        self.snapshots[name] = snapshot if known else snapshot._replace(position=0)
        self._places[name] = None if snapshot.position is None else snapshot.position - snapshot.origin

    def submit(self, name: str, command: c.Command, handle: Handle) -> Handle:
        """Judge a command.

        Raises:
            StateError, LimitError: the drive lacks an object for it, or it would end beyond the position limits.
        """
        if isinstance(command, c.Home):
            self._home(name, command, handle)
        elif isinstance(command, c.Move):
            self._move(name, command, handle)
        handle.finish(Status.DONE)
        return handle

    def _home(self, name: str, command: c.Home, handle: Handle) -> None:
        method = command.job.method
        motion.require_objects(self._parameters[name], ModeOfOperation.HOMING, handle, method)
        at_home = method in homing.IN_PLACE and not self._cell.axes[name].homing.offset
        self._places[name] = 0 if at_home else _ANYWHERE
        self.snapshots[name] = self.snapshots[name]._replace(homed=True)

    def _move(self, name: str, command: c.Move, handle: Handle) -> None:
        parameters = self._parameters[name]
        motion.require_watch(parameters, command.profile, handle)
        motion.require_objects(parameters, ModeOfOperation.PROFILE_POSITION, handle)
        bounded = self.snapshots[name].homed or not parameters.homing.required
        if command.reference is c.Reference.ABSOLUTE or not bounded:
            return
        place = self._places[name]
        if place is not None:
            motion.require_within_limits(parameters, place + command.value, handle)
        else:
            _require_room(parameters, command.value, handle)


def _require_room(parameters: AxisParameters, distance: int, handle: Handle) -> None:
    """Raise LimitError where a way is longer than the limits are apart: it ends beyond them from wherever it starts."""
    limits, scale = parameters.limits.position, parameters.units.position
    way = abs(scale.to_units(distance))
    if limits is not None and way > limits[1] - limits[0]:
        raise LimitError(
            f"{handle.name}: would end beyond the position limits, from wherever it starts",
            observed=f"{limits[0]:g} and {limits[1]:g} {scale.unit} are less than {way:g} {scale.unit} apart",
            remedy=f"move less far, or change position_limits in [axes.{parameters.name}] of cell.toml",
        )
