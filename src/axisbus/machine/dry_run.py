"""The axes of a cell without its drives: a command is refused as the real call would be, and nothing is sent.

Theory of operation
-------------------
The axes are the ordinary ``Axis`` objects with their own checks; only the session that takes their commands is replaced. The dry
run knows no drive. An axis is at the position where it was last ``seen``. Before that, its position reads 0, and a relative move
is checked as from an unknown position. An axis is homed after a home command. Facts that only the drive has (its state, the end
position of homing to a switch) are checked later by the machine.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from axisbus.cell.gantry import gantry_of
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import parameters_of
from axisbus.cell.parameters import axis_parameters
from axisbus.cell.virtual import all_virtual
from axisbus.cia402 import homing
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Capabilities
from axisbus.cia402.state import PowerState
from axisbus.core.files import load_dictionaries
from axisbus.errors import LimitError
from axisbus.machine.axis import Axis
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.gantry import Gantry
from axisbus.machine.handle import NOBODY
from axisbus.motion import commands as c
from axisbus.motion.axis import accept_motion
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.gantry import commands as g
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState
from axisbus.session import AnyCommand, AxisFacts, CommandEvent, LatenessReport, Observer, Target

_AT_REST = Snapshot(
    0.0, AxisState.STANDSTILL, PowerState.OPERATION_ENABLED, None, None, 0, 0.0, None, None, None, None, 0, False, True, None
)  # fmt: skip
_UNKNOWN = Capabilities({}, {}, remappable=False, max_age={})
_ANYWHERE = None
_Position = int | None  # user increments; None if an axis may be anywhere


class DryRun:
    """The axes of a cell without its drives. State: which axes got a home command, and their last seen positions."""

    def __init__(self, cell: CellConfig, known: Mapping[str, AxisParameters] | None = None) -> None:
        """``known``: the parameters of each axis, with values read from its drive; without it, those of the EDS files of ``cell``.

        Raises:
            EdsError: a file is missing or cannot be read.
        """
        self.cell = cell
        self._parameters = _of_files(cell) if known is None else dict(known)
        self._stage = _Stage(cell, self._parameters)
        self._commanding = CommandDispatcher(self._stage)

    def __getitem__(self, name: str) -> Axis:
        """Return an axis. Its commands raise the errors that the checks find; otherwise they are done at once.

        Raises:
            StateError: the cell has no such axis.
        """
        if name not in self._parameters:
            raise self.cell.no_axis(name)
        return Axis(self._parameters[name], self._commanding)

    def gantry(self, name: str) -> Gantry:
        """Return a gantry pair, with the same behaviour.

        Raises:
            StateError: the cell has no such axes.
        """
        pair = gantry_of(self.cell.gantries[name])
        return Gantry(pair, self[pair.first], self[pair.second], self._commanding)

    def see(self, name: str, snapshot: Snapshot) -> None:
        """Use the actual state of an axis from now on."""
        self._stage.see(name, snapshot)


def _of_files(cell: CellConfig) -> dict[str, AxisParameters]:
    files = load_dictionaries(cell)
    driven = {
        name: axis_parameters(cell, name, files[axis.node])
        if axis.node in files
        else parameters_of(cell, name)
        for name, axis in cell.driven.items()
    }
    return driven | all_virtual(cell)


class _Stage:
    """An ``AxisSession`` without a core: it only checks commands."""

    dead = silent = leaving_because = None
    ended = failed = False
    waiter = NOBODY

    def __init__(self, cell: CellConfig, parameters: dict[str, AxisParameters]) -> None:
        self._cell = cell
        self._parameters = parameters
        self.snapshots = dict.fromkeys(parameters, _AT_REST)
        self.axes = {name: AxisFacts(known, _UNKNOWN) for name, known in parameters.items()}
        self.lateness = LatenessReport()
        self._on_event: Callable[[CommandEvent], None] | None = None
        self._positions: dict[str, _Position] = dict.fromkeys(parameters, _ANYWHERE)

    def see(self, name: str, snapshot: Snapshot) -> None:
        """Use the actual state of an axis. If its position is unknown, the axis may be anywhere."""
        known = snapshot.position is not None
        self.snapshots[name] = snapshot if known else snapshot._replace(position=0)
        self._positions[name] = None if snapshot.position is None else snapshot.position - snapshot.origin

    def submit(self, number: int, target: Target, command: AnyCommand, name: str) -> int:
        """Check a command.

        Raises:
            StateError, LimitError: the drive lacks an object for it, or it would end beyond the position limits.
        """
        ticket = CommandStatus(name)
        if isinstance(command, c.Home):
            self._home(str(target), command, ticket)
        elif isinstance(command, c.Move):
            self._move(str(target), command, ticket)
        elif isinstance(command, g.GantryHome):
            self._home_both(command)
        elif isinstance(command, g.GantryMove) and command.reference is not c.TargetReference.ABSOLUTE:
            for axis in command.axes:
                distance = self._parameters[axis].units.position.to_increments(command.value)
                self._require_end(axis, distance, ticket)
        if self._on_event is not None:
            self._on_event(CommandEvent(number, Status.DONE, None, ""))
        return number

    def listen(self, on_event: Callable[[CommandEvent], None]) -> None:
        """Call ``on_event`` at the end of every command."""
        self._on_event = on_event

    def add_group(self, key: Target, members: Sequence[str]) -> None:
        """Do nothing: the commands of a group are checked axis by axis."""

    def hold_to_run(self, seconds: float | None, continuous: float | None = None) -> None:
        """As ``AxisSession.hold_to_run``, without effect: nothing moves here."""

    def request_halt(self, reason: str, number: int) -> None:
        """Do nothing: nothing moves."""

    def request_stop(self, reason: str, quick: bool = False) -> None:
        """Do nothing: nothing moves."""

    def observe(self, observer: Observer) -> None:
        """Do nothing: there are no cycles."""

    def forget(self, observer: Observer) -> None:
        """Do nothing: there are no cycles."""

    def _home(self, name: str, command: c.Home, ticket: CommandStatus) -> None:
        method = command.job.method
        accept_motion.require_objects(self._parameters[name], ModeOfOperation.HOMING, ticket, method)
        at_home = method in homing.IN_PLACE and not self._cell.axes[name].homing.offset
        self._positions[name] = 0 if at_home else _ANYWHERE
        self.snapshots[name] = self.snapshots[name]._replace(homed=True)

    def _home_both(self, command: g.GantryHome) -> None:
        for name in command.axes:
            self._positions[name] = _ANYWHERE
            self.snapshots[name] = self.snapshots[name]._replace(homed=True)

    def _move(self, name: str, command: c.Move, ticket: CommandStatus) -> None:
        parameters = self._parameters[name]
        accept_motion.require_watch(parameters, command.profile, ticket)
        accept_motion.require_objects(parameters, ModeOfOperation.PROFILE_POSITION, ticket)
        if command.reference is not c.TargetReference.ABSOLUTE:
            self._require_end(name, command.value, ticket)

    def _require_end(self, name: str, distance: int, ticket: CommandStatus) -> None:
        """Raise LimitError if a move by this number of increments would end beyond the position limits of an axis."""
        parameters, position = self._parameters[name], self._positions[name]
        if parameters.homing.required and not self.snapshots[name].homed:
            return
        if position is not None:
            accept_motion.require_within_limits(parameters, position + distance, ticket)
        else:
            _require_fits(parameters, distance, ticket)


def _require_fits(parameters: AxisParameters, distance: int, ticket: CommandStatus) -> None:
    """Raise LimitError if a move is longer than the distance between the limits: it ends beyond them from any start."""
    limits, scale = parameters.limits.position, parameters.units.position
    length = abs(scale.to_units(distance))
    if limits is not None and length > limits[1] - limits[0]:
        raise LimitError(
            f"{ticket.name}: would end beyond the position limits from every start position",
            observed=f"{limits[0]:g} and {limits[1]:g} {scale.unit} are less than {length:g} {scale.unit} apart",
            remedy=f"command a shorter move, or change position_limits in [axes.{parameters.name}] of cell.toml",
        )
