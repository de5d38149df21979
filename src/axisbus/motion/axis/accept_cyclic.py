"""Accept commands in csv or cst: check the drive's objects and synchronous PDOs, and continue from a running cyclic command."""

from __future__ import annotations

from typing import Any

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import PowerState
from axisbus.motion import commands as c
from axisbus.motion.axis.accept_motion import (
    pending_switch_of,
    require_braking,
    require_cyclic,
    require_motion,
    require_no_push_out,
    require_objects,
    require_rest,
    require_stop,
)
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.cyclic.torque import CyclicTorqueMove
from axisbus.motion.cyclic.user_controller import ControlledTorqueMove, ControlledVelocityMove
from axisbus.motion.cyclic.velocity import CyclicVelocityMove
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.activity import SetPointSource
from axisbus.motion.states import AxisState
from axisbus.motion.stop.stop_sequence import StopLevel
from axisbus.motion.stop_deceleration import CommandedMotion

_M = ModeOfOperation


def velocity(core: AxisCore, command: c.CyclicVelocity, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Command a velocity in cyclic synchronous velocity mode; a running velocity command changes to it."""
    down = abs(command.deceleration * core.parameters.units.per_velocity)
    _begin_or_change(core, CyclicVelocityMove, command, ticket, gate, down)


def torque(core: AxisCore, command: c.CyclicTorque, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Command a torque in cyclic synchronous torque mode; a running torque command changes to it."""
    require_no_push_out(core, command.torque, ticket)
    _begin_or_change(core, CyclicTorqueMove, command, ticket, gate)


def control(core: AxisCore, command: c.ControllerCommand, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Begin the user's own control loop in one of the two modes."""
    if isinstance(command.by, c.CyclicVelocity):
        down = abs(command.by.deceleration * core.parameters.units.per_velocity)
        _begin(core, ControlledVelocityMove, command, ticket, gate, down)
    else:
        require_no_push_out(core, None, ticket)
        _begin(core, ControlledTorqueMove, command, ticket, gate)


def controller_output(
    core: AxisCore, command: c.ControllerOutput, ticket: CommandStatus, _: StartBarrier
) -> None:
    """Take the output of a user's control loop; if the loop has ended, discard it, because the loop's ticket has the reason."""
    running = core.activity
    if isinstance(running, ControlledVelocityMove | ControlledTorqueMove) and running.take(command):
        core.finish(ticket)
    else:
        ticket.finish(Status.ABORTED)


def _begin_or_change(
    core: AxisCore,
    move_type: type[CyclicVelocityMove] | type[CyclicTorqueMove],
    command: Any,
    ticket: CommandStatus,
    gate: StartBarrier,
    down: float | None = None,
) -> None:
    """``command`` is a command of the type ``move_type``; ``down``: see ``require_braking``."""
    running: Any = core.activity
    if type(running) is not move_type:
        _begin(core, move_type, command, ticket, gate, down)
        return
    _require(core, move_type.mode, ticket)
    require_braking(core, down, ticket)
    running.aim(command)
    core.continue_with(ticket)


def _begin(
    core: AxisCore,
    move_type: Any,
    command: Any,
    ticket: CommandStatus,
    gate: StartBarrier,
    down: float | None = None,
) -> None:
    """Begin ``move_type``, from standstill or from a cyclic command in the same mode."""
    _require(core, move_type.mode, ticket)
    before = _active_source(core)
    ramp: Any = before if isinstance(before, move_type.ramp) else None
    require_rest(core, ticket, ramp)
    require_braking(core, down, ticket)
    core.begin(move_type(command, core.parameters, gate, ramp), ticket, AxisState.CONTINUOUS_MOTION)
    core.aim(None)


def _require(core: AxisCore, mode: ModeOfOperation, ticket: CommandStatus) -> None:
    require_motion(core, ticket)
    require_objects(core.parameters, mode, ticket)
    require_cyclic(core, ticket, mode)
    if mode is _M.CYCLIC_SYNC_TORQUE:
        require_stop(core, mode, CommandedMotion(by_torque=True), ticket)


def _active_source(core: AxisCore) -> SetPointSource | None:
    """Return the command that streams set-points in the drive's present mode; of a stop, only its first step (halt) counts."""
    if pending_switch_of(core) is not None or core.image.state is not PowerState.OPERATION_ENABLED:
        return None
    stop_sequence = core.stop_sequence
    if stop_sequence is not None:
        set_point_source = stop_sequence.follow if stop_sequence.level is StopLevel.HALT else None
    else:
        set_point_source = None if core.activity is None else core.activity.set_point_source
    return (
        set_point_source
        if set_point_source is not None and core.image.mode == set_point_source.mode
        else None
    )
