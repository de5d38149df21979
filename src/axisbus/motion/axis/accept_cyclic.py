"""Accept commands in csv or cst: check the drive's objects and synchronous PDOs, and continue from a running cyclic command."""

from __future__ import annotations

from typing import Any

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import PowerState
from axisbus.motion import commands as c
from axisbus.motion.axis.accept_motion import (
    leaving_switch,
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
from axisbus.motion.cyclic.user_controller import TorqueAnswered, VelocityAnswered
from axisbus.motion.cyclic.velocity import CyclicVelocityMove
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.activity import Leading
from axisbus.motion.states import AxisState
from axisbus.motion.stop.stop_sequence import StopLevel
from axisbus.motion.stop_deceleration import CommandedMotion

_M = ModeOfOperation


def velocity(core: AxisCore, command: c.CyclicVelocity, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Command a velocity in cyclic synchronous velocity mode; a running velocity command changes to it."""
    down = abs(command.deceleration * core.parameters.units.per_velocity)
    _lead(core, CyclicVelocityMove, command, ticket, gate, down)


def torque(core: AxisCore, command: c.CyclicTorque, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Command a torque in cyclic synchronous torque mode; a running torque command changes to it."""
    require_no_push_out(core, command.torque, ticket)
    _lead(core, CyclicTorqueMove, command, ticket, gate)


def control(core: AxisCore, command: c.ControllerCommand, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Begin the user's own control loop in one of the two modes."""
    if isinstance(command.by, c.CyclicVelocity):
        down = abs(command.by.deceleration * core.parameters.units.per_velocity)
        _begin(core, VelocityAnswered, command, ticket, gate, down)
    else:
        require_no_push_out(core, None, ticket)
        _begin(core, TorqueAnswered, command, ticket, gate)


def answer(core: AxisCore, command: c.ControllerOutput, ticket: CommandStatus, _: StartBarrier) -> None:
    """Take the output of a user's control loop; if the loop has ended, discard it, because the loop's ticket has the reason."""
    running = core.activity
    if isinstance(running, VelocityAnswered | TorqueAnswered) and running.take(command):
        core.finish(ticket)
    else:
        ticket.finish(Status.ABORTED)


def _lead(
    core: AxisCore,
    led: type[CyclicVelocityMove] | type[CyclicTorqueMove],
    command: Any,
    ticket: CommandStatus,
    gate: StartBarrier,
    down: float | None = None,
) -> None:
    """``command`` is a command of the type ``led``; ``down``: see ``require_braking``."""
    running: Any = core.activity
    if type(running) is not led:
        _begin(core, led, command, ticket, gate, down)
        return
    _require(core, led.mode, ticket)
    require_braking(core, down, ticket)
    running.aim(command)
    core.go_on(ticket)


def _begin(
    core: AxisCore,
    led: Any,
    command: Any,
    ticket: CommandStatus,
    gate: StartBarrier,
    down: float | None = None,
) -> None:
    """Begin ``led``, from standstill or from a cyclic command in the same mode."""
    _require(core, led.mode, ticket)
    before = _led(core)
    ramp: Any = before if isinstance(before, led.ramp) else None
    require_rest(core, ticket, ramp)
    require_braking(core, down, ticket)
    core.begin(led(command, core.parameters, gate, ramp), ticket, AxisState.CONTINUOUS_MOTION)
    core.aim(None)


def _require(core: AxisCore, mode: ModeOfOperation, ticket: CommandStatus) -> None:
    require_motion(core, ticket)
    require_objects(core.parameters, mode, ticket)
    require_cyclic(core, ticket, mode)
    if mode is _M.CYCLIC_SYNC_TORQUE:
        require_stop(core, mode, CommandedMotion(by_torque=True), ticket)


def _led(core: AxisCore) -> Leading | None:
    """Return the command that streams set-points in the drive's present mode; of a stop, only its first step (halt) counts."""
    if leaving_switch(core) is not None or core.image.state is not PowerState.OPERATION_ENABLED:
        return None
    ladder = core.ladder
    if ladder is not None:
        leading = ladder.follow if ladder.rung is StopLevel.HALT else None
    else:
        leading = None if core.activity is None else core.activity.leading
    return leading if leading is not None and core.image.mode == leading.mode else None
