"""Accept a move that continues the running motion without a stop between them (blending)."""

from __future__ import annotations

from dataclasses import replace

from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import StateError
from axisbus.motion import commands as c
from axisbus.motion.axis import accept_motion
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.blending.blended_profile import Leg
from axisbus.motion.blending.csp_blending import BlendedCommand, BlendedMoves
from axisbus.motion.blending.jerk_limited import JerkLimitedBlendedMoves
from axisbus.motion.blending.mode import BufferMode, began_from_rest, needs_longer_mean
from axisbus.motion.blending.pp_blending import BlendedTarget
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.group.path_builder import window
from axisbus.motion.group.start_barrier import OPEN, StartBarrier
from axisbus.motion.jerk.jerk_limited_move import JerkLimitedMove
from axisbus.motion.moves.csp_move import CspMove
from axisbus.motion.moves.position import PositionMove
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.states import AxisState
from axisbus.motion.stop_deceleration import CommandedMotion
from axisbus.units import modulo_target
from axisbus.wording import counted

_CSP = ModeOfOperation.CYCLIC_SYNC_POSITION
MOST = 100  # commands that share one motion


def blend(core: AxisCore, command: c.BufferedMove, ticket: CommandStatus, gate: StartBarrier) -> str | None:
    """Blend ``command`` with the running motion, or begin it if none runs; otherwise return the reason why it must wait.

    The reason is for the handle of ``command``.

    Raises:
        StateError: the axis takes no motion now, or the move or the running command can never be blended.
        LimitError: the move would end beyond the position limits.
    """
    accept_motion.require_motion(core, ticket)
    _require_no_halt(core, ticket)
    accept_motion.require_watch(core.parameters, command.move.profile, ticket)
    _require_ramps(core, command, ticket)
    if core.queue:
        return ""  # whether it can be blended is decided when the command before it has begun
    if core.running.ticket is None:
        _begin(core, command, ticket, gate)
        return None
    if isinstance(core.activity, CspMove):
        _make_joinable(core, core.activity, core.running.ticket)
        if isinstance(core.activity, CspMove):
            return began_from_rest(
                "the move before it reverses, has an override, or has a superimposed distance"
            )
    if isinstance(core.activity, BlendedMoves):
        return _join(core, core.activity, command, ticket)
    is_soft = command.move.profile.softness is not None
    if isinstance(core.activity, PositionMove) and not core.activity.is_soft and not is_soft:
        return _blend_in_pp(core, core.activity, command, ticket)
    raise _cannot_blend(core, ticket)


def _begin(core: AxisCore, command: c.BufferedMove, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Begin from standstill in csp, so that the next move may blend; if this is not possible, begin a move without blending."""
    if core.state is not AxisState.STANDSTILL or not _takes_csp(core, ticket):
        accept_motion.move(core, command.move, ticket, gate)
        return
    end = core.last_target if core.last_target is not None else core.image.reference
    target = accept_motion.target_of(core, _on_modulo_axis(core, command, end), ticket)
    part, profile = _part(core, command, target, ticket), command.move.profile
    if profile.softness is None:
        moves = BlendedMoves(part, core.path_parameters, gate)
    else:
        moves = JerkLimitedBlendedMoves(part, core.path_parameters, gate, _cycles(core, profile, ticket))
    core.begin(moves, ticket, AxisState.DISCRETE_MOTION)
    core.aim(target)


def _make_joinable(core: AxisCore, move: CspMove, ticket: CommandStatus) -> None:
    """Make a move that began from the speed of its axis joinable by other moves, if it goes straight to its end."""
    if not ticket.number:
        return
    if isinstance(move, JerkLimitedMove):
        _make_jerk_limited_joinable(core, move, ticket)
        return
    progress = move.progress()
    if progress is None:
        return
    leg = _leg(core, move.profile, move.target, BufferMode.BUFFERED)
    moves = BlendedMoves(
        BlendedCommand(leg, move.target, ticket, move.profile.timeout), core.path_parameters, OPEN
    )
    moves.adopt_move(progress, move)
    core.running.activity = moves


def _make_jerk_limited_joinable(core: AxisCore, move: JerkLimitedMove, ticket: CommandStatus) -> None:
    """Do the same for a move with limited jerk; a move that has not moved the axis yet begins again, as the first of several."""
    motion, ramp = move.unfiltered_motion(), move.ramp
    if motion is None and not move.waits:
        return
    leg = _leg(core, move.profile, move.target, BufferMode.BUFFERED)._replace(up=ramp, down=ramp)
    part = BlendedCommand(leg, move.target, ticket, move.profile.timeout)
    moves = JerkLimitedBlendedMoves(part, core.path_parameters, OPEN, move.window)
    if motion is None:
        move.cancel(core.order)
    else:
        moves.adopt_jerk_limited_move(motion, move)
    core.running.activity = moves


def _cycles(core: AxisCore, profile: MoveProfile, ticket: CommandStatus) -> int:
    """Return the averaging length in cycles by which a move keeps its jerk limit; 1 if it has no limit."""
    assert profile.up
    assert profile.down
    hardest = max(profile.up, profile.down) / abs(core.parameters.units.position.factor)
    return window(hardest, profile.softness, core.parameters.scan_period, ticket.name)


def _join(core: AxisCore, moves: BlendedMoves, command: c.BufferedMove, ticket: CommandStatus) -> str | None:
    _require_few(moves.commands, ticket)
    needed = _cycles(core, command.move.profile, ticket)
    why = moves.why_not or ("" if needed <= moves.window else needs_longer_mean())
    if why:
        return began_from_rest(why)
    shift = core.parameters.units.position.to_increments(moves.shifted)
    move = _on_modulo_axis(core, command, moves.target)
    target = accept_motion.target_of(core, move, ticket, moves.target, shift)
    ticket.note = ""
    moves.join(_part(core, command, target, ticket))
    core.running.pass_on(ticket)
    core.aim(target + shift)
    return None


def _blend_in_pp(
    core: AxisCore, move: PositionMove, command: c.BufferedMove, ticket: CommandStatus
) -> str | None:
    """Let a move that the drive plans continue to another end, if that end lies in its direction."""
    _require_few(move.commands, ticket)
    before, position = core.running.ticket, core.image.position
    assert before is not None
    target = accept_motion.target_of(core, _on_modulo_axis(core, command, move.target), ticket, move.target)
    if not before.number:
        return began_from_rest("the motion before it belongs to a group")
    if position is None:
        return began_from_rest(
            "the actual position (6064h) is unknown, so the passing of the end cannot be detected"
        )
    if abs(move.target - position) <= core.parameters.position_tolerance:
        return began_from_rest("it came after the end of the previous command")
    if (move.target - position) * (target - move.target) <= 0:
        return began_from_rest("the motion reverses there, or the move has no length")
    commanded, profile = move.commanded or CommandedMotion(), command.move.profile
    speed, down = (
        max(filter(None, each), default=None)
        for each in ((commanded.speed, profile.speed), (commanded.down, profile.down))
    )
    if accept_motion.halt_passes_limit(core, speed, down, target):
        return began_from_rest("a halt, which brakes less than the moves, could end beyond a position limit")
    ticket.note = ""
    move.join(BlendedTarget(target, command.move.profile, command.mode, ticket), before, core.image)
    core.running.pass_on(ticket)
    core.aim(target)
    return None


def _on_modulo_axis(core: AxisCore, command: c.BufferedMove, end: int | None) -> c.Move:
    """Return the move; for an absolute target on a modulo axis it counts from ``end``, the future position (increments)."""
    move, modulo, units = command.move, core.parameters.units.modulo, core.parameters.units.position
    if modulo is None or end is None or move.reference is not c.TargetReference.ABSOLUTE:
        return move
    here, position = (units.to_units(value) for value in (end - core.image.origin, move.value))
    return replace(move, value=units.to_increments(modulo_target(here, position, modulo, command.direction)))


def _require_few(commands: int, ticket: CommandStatus) -> None:
    if commands >= MOST:
        raise StateError(
            f"{ticket.name}: too many commands are blended into this motion already",
            observed=f"{counted(commands, 'command')} share the motion of the axis",
            remedy="wait for some of their handles before you give more commands",
        )


def _part(core: AxisCore, command: c.BufferedMove, target: int, ticket: CommandStatus) -> BlendedCommand:
    profile = command.move.profile
    return BlendedCommand(_leg(core, profile, target, command.mode), target, ticket, profile.timeout)


def _leg(core: AxisCore, profile: MoveProfile, target: int, mode: BufferMode) -> Leg:
    units = core.parameters.units.position
    unit = abs(units.factor)
    assert profile.speed
    assert profile.up
    assert profile.down
    end = units.to_units(target - core.image.origin)
    return Leg(end, profile.speed / unit, profile.up / unit, profile.down / unit, mode)


def _takes_csp(core: AxisCore, ticket: CommandStatus) -> bool:
    if _CSP not in core.parameters.modes:
        return False
    try:
        accept_motion.require_cyclic(core, ticket, _CSP)
    except StateError:
        return False
    return True


def _require_no_halt(core: AxisCore, ticket: CommandStatus) -> None:
    if core.stop_sequence is not None:
        raise StateError(f"{ticket.name}: the axis is being halted", remedy="wait until it is at standstill")


def _require_ramps(core: AxisCore, command: c.BufferedMove, ticket: CommandStatus) -> None:
    """Raise StateError if the speed and ramps of the move are not known."""
    profile, name = command.move.profile, core.parameters.name
    if not (profile.speed and profile.up and profile.down):
        raise StateError(
            f"{ticket.name}: the point at which it must slow down for another move cannot be computed",
            observed="the unit of its velocity or of its acceleration is not known",
            remedy=f'set velocity_scale in [axes.{name}] of cell.toml, or let it begin at standstill: buffer="buffered"',
        )


def _cannot_blend(core: AxisCore, ticket: CommandStatus) -> StateError:
    running = core.running.ticket
    seen = "" if running is None else f"{running.name} is under way"
    return StateError(
        f"{ticket.name}: the present motion of {core.parameters.name} cannot be blended with a move",
        observed=f"{seen}; only a move to a position can be blended, with a jerk limit only one in csp",
        remedy='let it begin at standstill, with buffer="buffered", or wait for the motion before it; with a jerk limit, let the '
        "first move begin with a blending mode, too: then the master streams it in csp",
    )
