"""Accept a velocity command with limited jerk: the drive limits the jerk if it can, otherwise the master does."""

from __future__ import annotations

from axisbus.motion import commands as c
from axisbus.motion.axis import accept_motion
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.group.path_builder import window
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.jerk.velocity import JerkLimitedVelocity
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.states import AxisState


def move_velocity(core: AxisCore, command: c.MoveVelocity, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Begin MC_MoveVelocity or MC_Jog."""
    profile = command.profile
    if profile.softness is None or profile.jerk is not None:
        accept_motion.move_velocity(core, command, ticket, gate)
    else:
        _begin_csp_velocity(core, profile, ticket, gate)


def _begin_csp_velocity(
    core: AxisCore, profile: MoveProfile, ticket: CommandStatus, gate: StartBarrier
) -> None:
    """Begin a velocity command whose set-points the master streams, because its drive cannot limit the jerk.

    Raises:
        StateError: the axis is in another motion, or cannot be commanded in csp.
        LimitError: it could not stop within its position limits, or the jerk is so small that it takes seconds.
    """
    accept_motion.require_motion(core, ticket)
    before, parameters = accept_motion.path_of(core), core.parameters
    accept_motion.require_csp_jerk_limit(core, profile, ticket, before)
    assert profile.up
    assert profile.down
    hardest = max(profile.up, profile.down) / abs(parameters.units.position.factor)
    window(hardest, profile.softness, parameters.scan_period, ticket.name)
    velocity = JerkLimitedVelocity(profile, parameters, gate, before, bounded=core.bounded)
    velocity.require_stop_within_limits()
    core.begin(velocity, ticket, AxisState.CONTINUOUS_MOTION)
    core.aim(None)
