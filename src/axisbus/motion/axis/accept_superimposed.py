"""Accept a superimposed distance (MC_MoveSuperimposed), and its halt."""

from __future__ import annotations

from axisbus.errors import Replaced, StateError
from axisbus.motion import commands as c
from axisbus.motion.axis.accept_motion import require_motion
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.cyclic.ramps import VelocityRamp
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.follow import Follow
from axisbus.motion.states import AxisState
from axisbus.motion.superimposed import Addition


def move(core: AxisCore, command: c.MoveSuperimposed, ticket: CommandStatus, _: StartBarrier) -> None:
    """Begin MC_MoveSuperimposed."""
    require_motion(core, ticket)
    path = core.activity
    if core.stop_sequence is not None:
        raise StateError(
            f"{ticket.name}: {core.parameters.name} is being halted",
            remedy="wait until it is at standstill, then move_relative",
        )
    if not isinstance(path, Follow) or path.commanding_path is not path:
        raise _no_streamed_path(core, ticket)
    _end_before(core, f"was replaced by {ticket.name}")
    addition = Addition(command, core.parameters.scan_period)
    path.superimpose(addition)
    core.running.superimpose(addition, ticket)


def halt(core: AxisCore, command: c.HaltSuperimposed, ticket: CommandStatus, _: StartBarrier) -> None:
    """Execute MC_HaltSuperimposed; without a superimposed distance it succeeds at once."""
    addition = core.running.addition
    if addition is None:
        core.finish(ticket)
        return
    _end_before(core, f"was halted by {ticket.name}")
    addition.halt(deceleration=command.deceleration)
    core.running.superimpose(addition, ticket)


def _end_before(core: AxisCore, how: str) -> None:
    addition, ticket = core.running.addition, core.running.take_addition()
    if ticket is None or addition is None:
        return
    unit = core.parameters.units.position.unit
    seen = f"{addition.value:g} of {addition.distance:g} {unit} had been superimposed"
    core.finish(ticket, Replaced(f"{ticket.name} {how}", observed=seen))


def _no_streamed_path(core: AxisCore, ticket: CommandStatus) -> StateError:
    """Return why no distance can be superimposed on the axis's state or motion, with the remedy."""
    name = core.parameters.name
    if core.state is AxisState.STANDSTILL:
        observed, remedy = f"{name} stands", "use move_relative"
    elif isinstance(core.active_source, VelocityRamp):
        observed, remedy = "it follows velocity set-points, not a path", "command another velocity instead"
    else:
        observed = (
            "the drive generates the profile of the present motion (or the master has not taken over yet)"
        )
        remedy = "use move_additive; or move it in csp: on a line of a group of one, by a trajectory, a gear or a cam"
    return StateError(
        f"{ticket.name}: {name} does not follow a path that the master streams",
        observed=observed,
        remedy=remedy,
    )
