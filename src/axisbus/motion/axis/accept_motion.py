"""Accept motion commands: check the axis's state, limits and feedback, and begin the activity that executes the command."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from axisbus.cia402 import modes, objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import INPUT_OBJECTS, OUTPUT_OBJECTS, ValueTransport
from axisbus.errors import Interrupted, LimitError, StateError
from axisbus.motion import commands as c
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.coupling.slave_axis import Coupled, Disengaged
from axisbus.motion.cyclic.ramps import VelocityRamp
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.jerk.drive_profile_type import JerkProfileWritten
from axisbus.motion.jerk.jerk_limited_move import JerkLimitedMove
from axisbus.motion.jerk.velocity import JerkLimitedVelocity
from axisbus.motion.moves.activity import SetPointSource, object_text, require_position, shown_modes
from axisbus.motion.moves.continuous_motion import Jog, TorqueMove, VelocityMove
from axisbus.motion.moves.csp_move import CspMove
from axisbus.motion.moves.follow import Follow
from axisbus.motion.moves.homing import HomingRun
from axisbus.motion.moves.mode_exit import PathExit, velocity_exit
from axisbus.motion.moves.mode_switch import ModeSwitch, SourceStep
from axisbus.motion.moves.position import PositionMove
from axisbus.motion.moves.prepare import Prepare, RampTransfers, expected, profile_writes, slow_ramp_writes
from axisbus.motion.moves.profile import MoveProfile, braking_distance
from axisbus.motion.parameters import NOISE, AxisParameters
from axisbus.motion.position_limits import allowed_end, count_range
from axisbus.motion.setpoint_update import overridden
from axisbus.motion.states import MOVING, REFUSAL, TAKES_MOTION, AxisState
from axisbus.motion.stop.diagnosis import not_to_be_reset
from axisbus.motion.stop.limits import stop_of, unknown_braking
from axisbus.motion.stop.velocity_following import VelocityRampTracker
from axisbus.motion.stop_deceleration import CommandedMotion
from axisbus.units import INT32_HALF, whole_above, whole_below

_M = ModeOfOperation


class _Needs(NamedTuple):
    """The values without which a cyclic mode does not begin, besides the statusword."""

    inputs: tuple[str, ...]
    output: str


_CYCLIC = {
    _M.CYCLIC_SYNC_POSITION: _Needs(("position",), "target_position"),
    _M.CYCLIC_SYNC_VELOCITY: _Needs(("velocity",), "target_velocity"),
    _M.CYCLIC_SYNC_TORQUE: _Needs(("torque",), "target_torque"),
}


def move(core: AxisCore, command: c.Move, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Begin MC_MoveAbsolute, MC_MoveRelative or MC_MoveAdditive."""
    require_motion(core, ticket)
    require_watch(core.parameters, command.profile, ticket)
    target = target_of(core, command, ticket)
    profile = command.profile
    set_point_source = path_of(core)
    if profile.softness is not None and profile.jerk is None:
        _move_jerk_limited(core, target, profile, ticket, gate)
        return
    if (
        set_point_source is not None
        and profile.jerk is None
        and profile.speed
        and profile.up
        and profile.down
    ):
        _begin_csp_move(core, CspMove(target, profile, core.path_parameters, gate, set_point_source), ticket)
        core.aim(target)
        return
    require_objects(core.parameters, _M.PROFILE_POSITION, ticket)
    profile = no_harder_than_halt(core, expected(profile, core.parameters), target)
    require_braking(core, profile.down, ticket, _soft(core, profile))
    factor = core.override.factor
    given = overridden(profile, factor, core.parameters)
    prepare = _prepare(
        core,
        _M.PROFILE_POSITION,
        profile_writes(given, core.parameters, _M.PROFILE_POSITION),
        gate,
        profile.jerk,
        _exit_for(core, profile.down, _soft(core, profile)),
    )
    core.begin(
        PositionMove(target, profile, core.parameters, prepare, core.running.in_flight, factor),
        ticket,
        AxisState.DISCRETE_MOTION,
    )
    core.aim(target)


def no_harder_than_halt(core: AxisCore, profile: MoveProfile, target: int) -> MoveProfile:
    """Return the profile with at most the deceleration of a halt, if a halt could otherwise end beyond the position limits."""
    if not halt_passes_limit(core, profile.speed, profile.down, target):
        return profile
    parameters = core.parameters
    halt = parameters.braking.deceleration(parameters.braking.halt, profile.down)
    assert halt
    weaker = max(1, int(halt / abs(parameters.units.position.factor / parameters.units.acceleration.factor)))
    if parameters.has(objects.PROFILE_DECELERATION):
        return expected(profile._replace(deceleration=weaker), parameters)
    return expected(profile._replace(acceleration=weaker, deceleration=weaker), parameters)


def halt_passes_limit(core: AxisCore, speed: float | None, down: float | None, target: int) -> bool:
    """Whether a halt of a move to ``target`` may end beyond the position limits; ``speed`` and ``down`` in position increments.

    A drive brakes to its target with 6084h, and in a halt with the ramp of 605Dh. If that ramp is weaker, an axis that is halted
    while it brakes passes its target.
    """
    parameters, position = core.parameters, core.image.position
    edges, braking = parameters.position_edges, parameters.braking
    halt = braking.deceleration(braking.halt, down)
    if edges is None or position is None or not core.bounded or not (halt and down and speed):
        return False
    beyond = braking_distance(speed, halt) - braking_distance(speed, down)
    low, high = edges
    end = target - core.image.origin
    return beyond > 0 and (end + beyond > high if target > position else end - beyond < low)


def _move_jerk_limited(
    core: AxisCore, target: int, profile: MoveProfile, ticket: CommandStatus, gate: StartBarrier
) -> None:
    """Begin a jerk-limited move whose set-points the master streams, because its drive cannot limit the jerk."""
    soft = core.activity if isinstance(core.activity, JerkLimitedMove) else None
    before = path_of(core) or (soft if soft is not None and soft.has_begun else None)
    require_csp_jerk_limit(core, profile, ticket, before)
    move = JerkLimitedMove(target, profile, core.path_parameters, gate, ticket.name, before)
    if before is not None:
        _begin_csp_move(core, move, ticket)
    else:
        core.begin(move, ticket, AxisState.DISCRETE_MOTION)
    core.aim(target)


def require_csp_jerk_limit(
    core: AxisCore, profile: MoveProfile, ticket: CommandStatus, before: Follow | None
) -> None:
    """Raise StateError if the master cannot command the axis in csp with limited jerk.

    ``before``: the path that already commands the axis. A jerk-limited command that waits for its mode, and has not moved the axis
    yet, is replaced as at standstill.
    """
    parameters = core.parameters
    lacking = f"{parameters.name}'s drive has no profile jerk (60A4h with 6086h), so the master must stream the move in csp"
    if _M.CYCLIC_SYNC_POSITION not in parameters.modes or profile.speed is None or not profile.ramp:
        raise StateError(
            f"{ticket.name}: its jerk cannot be limited",
            observed=f"{lacking}; "
            + (
                "the unit of its velocity is not known"
                if profile.speed is None
                else "it does not have that mode"
            ),
            remedy=f"move without jerk (leave it out of the command, and out of [axes.{parameters.name}.defaults])",
        )
    try:
        require_cyclic(core, ticket, _M.CYCLIC_SYNC_POSITION)
        if not (isinstance(core.activity, JerkLimitedMove | JerkLimitedVelocity) and core.activity.waits):
            require_rest(core, ticket, before)
    except StateError as error:
        error.observed = "; ".join(text for text in (error.observed, lacking) if text)
        raise


def _begin_csp_move(core: AxisCore, csp_move: CspMove, ticket: CommandStatus) -> None:
    """Begin a move from the velocity at which a trajectory moves the axis."""
    if core.bounded:
        csp_move.require_stop_within_limits(core.image.origin)
    core.begin(csp_move, ticket, AxisState.DISCRETE_MOTION)


def require_watch(parameters: AxisParameters, profile: MoveProfile, ticket: CommandStatus) -> None:
    """Raise StateError if a move has no deadline: without 6064h neither its distance nor its progress is known."""
    if profile.timeout is None and not parameters.has(objects.POSITION_ACTUAL):
        raise StateError(
            f"{ticket.name}: its time limit cannot be computed",
            observed="the drive has no position actual value (6064h), so neither distance nor progress is known",
            remedy="give timeout = ... (seconds) in the call",
        )


def target_of(
    core: AxisCore, command: c.Move, ticket: CommandStatus, end: int | None = None, shift: int = 0
) -> int:
    """Return the absolute target in unwrapped drive increments; the master always sends absolute targets.

    ``end``: the end of the previous motion, from which relative targets count; ``shift``: a superimposed distance on both.
    """
    origin = core.image.origin
    if command.reference is c.TargetReference.ABSOLUTE:
        if shift and core.bounded:
            require_within_limits(core.parameters, command.value + shift, ticket)
        return _within_reach(core, command.value + origin, ticket)
    base, noise = end, 0.0
    if base is None:
        base, noise = require_position(core.image, core.parameters.name, "a relative move"), NOISE
        if command.reference is c.TargetReference.ADDITIVE and core.last_target is not None:
            base, noise = core.last_target, 0.0
    target = base + command.value
    if core.bounded:
        start = base + shift - origin
        asked = start + command.value
        # An axis that moves back from beyond a limit could pass the limit, and would have to leave it again for such an end.
        begins = None if end is None and core.state in MOVING else start
        target += require_within_limits(core.parameters, asked, ticket, begins, noise) - asked
    return _within_reach(core, target, ticket)


def _within_reach(core: AxisCore, target: int, ticket: CommandStatus) -> int:
    """Return ``target`` after checking that it is within half of the drive's INTEGER32 count, and needs no wrap."""
    position, units = core.image.position, core.parameters.units.position
    if position is not None:
        require_count(core.parameters, position, target, core.image.origin, ticket)
    if position is not None and abs(target - position) >= INT32_HALF:
        raise LimitError(
            f"{ticket.name}: farther than half the drive's position range (INTEGER32)",
            observed=f"the distance is {abs(units.to_units(target - position)):g} {units.unit}; below "
            f"{abs(units.to_units(INT32_HALF)):g} the direction is unambiguous",
            remedy="use several moves, or set modulo in cell.toml for an endless axis",
        )
    return target


def require_count(
    parameters: AxisParameters, position: int, target: int, origin: int, ticket: CommandStatus
) -> None:
    """Raise LimitError if the drive's count at ``position`` ends before ``target`` (both unwrapped): 607Ah holds no more."""
    if parameters.units.modulo is not None or parameters.virtual or count_range(position).has(target):
        return
    units = parameters.units.position
    low, high = sorted(units.to_units(end - origin) for end in count_range(position))
    raise LimitError(
        f"{ticket.name}: would end beyond the drive's position range (607Ah, INTEGER32)",
        observed=f"at {units.to_units(target - origin):.10g} {units.unit}; the range of the drive is {low:.10g} to {high:.10g}",
        remedy=f"command a shorter move, or home {parameters.name} nearer to its working range; for an endless axis set modulo in "
        f"[axes.{parameters.name}] of cell.toml",
    )


def require_within_limits(
    parameters: AxisParameters,
    position: int,
    ticket: CommandStatus,
    start: int | None = None,
    noise: float = 0.0,
) -> int:
    """Return ``position`` (user increments) as the end of a motion: see ``position_limits.allowed_end``.

    ``start``: the start position of the motion, None: within the limits; ``noise``: its possible error in increments.

    Raises:
        LimitError: ``position`` is beyond the axis's limits.
    """
    limits, units, exact = parameters.limits.position, parameters.units.position, parameters.position_edges
    if limits is None or exact is None:
        return position
    edges = whole_above(exact[0]), whole_below(exact[1])
    end = allowed_end(edges, edges[0] if start is None else start, position, noise)
    if end is not None:
        return int(end)
    raise LimitError(
        f"{ticket.name}: would end beyond the position limits",
        observed=f"at {units.to_units(position):g} {units.unit}; the allowed range is {limits[0]:g} to {limits[1]:g}",
        remedy=f"command a shorter move, or change position_limits in [axes.{parameters.name}] of cell.toml",
    )


def move_velocity(core: AxisCore, command: c.MoveVelocity, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Begin MC_MoveVelocity or MC_Jog, or renew a running jog."""
    if isinstance(core.activity, Jog) and core.activity.renew(command, core.image):
        core.finish(ticket)
        return
    if command.continue_only:
        raise Interrupted(
            f"{ticket.name}: the jog has ended already, so it cannot be continued", remedy="begin another one"
        )
    require_motion(core, ticket)
    require_objects(core.parameters, _M.PROFILE_VELOCITY, ticket)
    profile = command.profile
    writes = profile_writes(profile, core.parameters, _M.PROFILE_VELOCITY)
    prepare = _prepare(core, _M.PROFILE_VELOCITY, writes, gate, profile.jerk)
    profile = expected(profile, core.parameters)
    commanded = CommandedMotion(down=profile.down)
    require_braking(
        core, _weaker(profile.down, stop_of(core.parameters, commanded)[1]), ticket, _soft(core, profile)
    )
    require_stop(core, _M.PROFILE_VELOCITY, commanded, ticket)
    velocity_move = VelocityMove(
        profile, core.parameters, prepare, _commanded_motion(core), _ramp_tracker(core)
    )
    activity = velocity_move if command.life is None else Jog(velocity_move, command, core.image)
    core.begin(activity, ticket, AxisState.CONTINUOUS_MOTION)
    core.aim(None)


def _weaker(command: float | None, stop: float | None) -> float | None:
    """Return the lower deceleration: the monitor of the limits uses that of a stop, from the first cycle of the command on."""
    return command if command is None or stop is None else min(command, stop)


def _commanded_motion(core: AxisCore) -> CommandedMotion | None:
    return None if core.activity is None else core.activity.commanded


def _ramp_tracker(core: AxisCore) -> VelocityRampTracker | None:
    return None if core.activity is None else core.activity.ramp_tracker


def _soft(core: AxisCore, profile: MoveProfile) -> float:
    """Return the seconds by which a jerk limit prolongs the change from the acceleration of the axis to that of the command."""
    before = _commanded_motion(core)
    if before is not None and before.up is not None and profile.up is not None:
        profile = profile._replace(up=max(profile.up, before.up))
    return profile.soft_seconds(abs(core.parameters.units.position.factor))


def require_braking(core: AxisCore, down: float | None, ticket: CommandStatus, soft: float = 0.0) -> None:
    """Raise LimitError if the axis would leave its position limits because the command brings a weaker deceleration.

    ``down``: the deceleration of the command, in position increments per s²; None if it is not known. ``soft``: seconds by which
    the drive's jerk limit may prolong its ramps. A drive that already brakes may begin its ramp again with the command, from no
    deceleration.
    """
    before = _commanded_motion(core)
    if down is None or not core.bounded or core.state not in MOVING:
        return
    if not soft and before is not None and before.down is not None and down >= before.down:
        return
    stop = core.supervision.guard.overrun(core.image, down, before, soft)
    if stop is None:
        return
    units, limits = core.parameters.units.position, core.parameters.limits.position
    assert limits is not None
    raise LimitError(
        f"{ticket.name}: the axis could not stop within the position limits with that deceleration",
        observed=f"at its present speed it would stop at {stop:g} {units.unit}; "
        f"the allowed range is {limits[0]:g} to {limits[1]:g}",
        remedy="give a higher deceleration, wait until the axis is slower, or halt it first; the previous command continues",
    )


def require_stop(
    core: AxisCore, mode: ModeOfOperation, commanded: CommandedMotion, ticket: CommandStatus
) -> None:
    """Raise StateError if position limits apply, and the deceleration of a stop in the ``commanded`` motion is not known."""
    parameters = core.parameters
    if (
        not core.bounded
        or parameters.limits.position is None
        or stop_of(parameters, commanded)[1] is not None
    ):
        return
    why, remedy = unknown_braking(parameters, commanded)
    raise StateError(
        f"{ticket.name}: {parameters.name} could not be stopped within its position limits in {modes.short(mode)}",
        observed=why,
        remedy=remedy,
    )


def require_no_push_out(core: AxisCore, torque: int | None, ticket: CommandStatus) -> None:
    """Raise LimitError if the axis is beyond its position limits, and ``torque`` (None: any) would move it farther out.

    A torque is stopped only after it has moved the axis. Repeated, it would move the axis farther out each time.
    """
    if not core.bounded or not core.supervision.guard.is_pushed_out(core.image, torque):
        return
    units, limits, position = (
        core.parameters.units.position,
        core.parameters.limits.position,
        core.image.position,
    )
    assert limits is not None
    assert position is not None
    at = units.to_units(position - core.image.origin)
    raise LimitError(
        f"{ticket.name}: {core.parameters.name} is beyond its position limits, and a torque has moved it there",
        observed=f"at {at:g} {units.unit}; the allowed range is {limits[0]:g} to {limits[1]:g}",
        remedy="move it back by a move, a velocity or a jog, or by a torque in the other direction",
    )


def torque(core: AxisCore, command: c.TorqueControl, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Begin MC_TorqueControl."""
    require_motion(core, ticket)
    require_objects(core.parameters, _M.PROFILE_TORQUE, ticket)
    parameters = core.parameters
    writes: list[tuple[int, int, int | None]] = []
    if command.slope is not None and parameters.has(objects.TORQUE_SLOPE):
        writes.append((objects.TORQUE_SLOPE, 0, command.slope))
    writes += slow_ramp_writes(parameters, by_torque=True)
    commanded = CommandedMotion(by_torque=True)
    require_stop(core, _M.PROFILE_TORQUE, commanded, ticket)
    require_no_push_out(core, command.torque, ticket)
    down = stop_of(parameters, commanded)[1]
    require_braking(core, down, ticket)
    prepare = _prepare(core, _M.PROFILE_TORQUE, writes, gate, may_leave=_exit_for(core, down))
    activity = TorqueMove(command.torque, command.timeout, parameters, prepare, command.slope)
    core.begin(activity, ticket, AxisState.CONTINUOUS_MOTION)
    core.aim(None)


def home(core: AxisCore, command: c.Home, ticket: CommandStatus, _: StartBarrier) -> None:
    """Begin MC_Home."""
    require_motion(core, ticket)
    require_rest(core, ticket)
    require_objects(core.parameters, _M.HOMING, ticket, command.job.method)
    core.begin(HomingRun(command.job, core.parameters), ticket, AxisState.HOMING)


def set_position(core: AxisCore, command: c.SetPosition, ticket: CommandStatus, _: StartBarrier) -> None:
    """Execute MC_SetPosition; at standstill it takes effect at once, otherwise as soon as the axis is seen at standstill."""
    if core.state in MOVING or core.state is AxisState.STOPPING:
        raise StateError(f"{ticket.name}: the axis moves", remedy="set the position at standstill")
    require_position(core.image, core.parameters.name, "setting the position")
    require_own_zero(core.parameters, ticket)
    core.at_rest(ticket, partial(_call_position, core, command.position))


def require_own_zero(parameters: AxisParameters, ticket: CommandStatus) -> None:
    """Raise StateError if the drive limits the position itself: its limits would be at other places than those of the master."""
    if parameters.limits_in_drive:
        raise StateError(
            f"{ticket.name}: limits_in_drive does not allow another position",
            observed="the position limits in the drive (607Dh) are relative to its own zero, and would stay where they are",
            remedy=f"home {parameters.name}, with offset in [axes.{parameters.name}.homing]; or delete limits_in_drive in "
            f"[axes.{parameters.name}]",
        )


def require_within_drive(core: AxisCore, ticket: CommandStatus) -> None:
    """Raise StateError if the axis is beyond the limits of its drive, which would move it there in one cycle of csp."""
    parameters, position, edges = core.parameters, core.image.position, core.parameters.position_edges
    if not parameters.limits_in_drive or position is None or edges is None:
        return
    window = max(NOISE, parameters.position_tolerance)
    if edges[0] - window <= position <= edges[1] + window:
        return
    units = parameters.units.position
    raise StateError(
        f"{ticket.name}: in csp the drive would leap to its own position limit (607Dh, by limits_in_drive)",
        observed=f"its count is at {units.to_units(position):g} {units.unit}, its limits are "
        f"{' and '.join(f'{edge:g}' for edge in parameters.limits.position or ())}",
        remedy=f"home {parameters.name}, or move it back with move_absolute, jog or move_velocity",
    )


def _call_position(core: AxisCore, position: int) -> None:
    here = require_position(core.image, core.parameters.name, "setting the position")
    core.confirm_position(here - position)


def follow(core: AxisCore, command: c.FollowTrajectory, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Begin a trajectory in cyclic synchronous position mode."""
    begin_follow(core, Follow(command.trajectory, core.parameters, gate), ticket)


def begin_follow(core: AxisCore, follow: Follow, ticket: CommandStatus) -> None:
    """Begin a trajectory; cyclic modes require standstill, and values in synchronous PDOs.

    Raises:
        StateError: the axis is not at standstill, or its values are not in synchronous PDOs.
    """
    require_motion(core, ticket)
    require_cyclic(core, ticket, _M.CYCLIC_SYNC_POSITION)
    require_rest(core, ticket)
    core.begin(follow, ticket, AxisState.SYNCHRONIZED_MOTION)


def path_of(core: AxisCore) -> Follow | None:
    """Return the path that commands the axis, and that another path may continue in its cyclic mode; None if there is none."""
    path = core.active_path if pending_switch_of(core) is None else None
    return None if path is None else path.commanding_path


def begin_coupled(core: AxisCore, coupled: Coupled, ticket: CommandStatus) -> None:
    """Couple a slave, from standstill or from a path that already commands the axis.

    Raises:
        StateError: the axis is in another motion, its values are not in synchronous PDOs, or its master's future position is
            unknown.
        LimitError: the axis is not at its required position, or has no path left to reach it.
    """
    require_motion(core, ticket)
    require_cyclic(core, ticket, _M.CYCLIC_SYNC_POSITION)
    require_rest(core, ticket, path_of(core))
    coupled.require_start(core)
    core.begin(coupled, ticket, AxisState.SYNCHRONIZED_MOTION)
    core.aim(None)


def uncouple(core: AxisCore, _: c.GearOut, ticket: CommandStatus, __: StartBarrier) -> None:
    """Begin MC_GearOut or MC_CamOut."""
    core.begin(Disengaged(_coupled(core, ticket), core.parameters), ticket, AxisState.CONTINUOUS_MOTION)


def phase_by(core: AxisCore, command: c.PhaseBy, ticket: CommandStatus, _: StartBarrier) -> None:
    """Begin MC_PhasingRelative."""
    _coupled(core, ticket).phase_by(command, ticket.name)
    core.continue_with(ticket)


def _coupled(core: AxisCore, ticket: CommandStatus) -> Coupled:
    """Return the running coupling of the axis to a master axis; raise StateError if there is none."""
    require_motion(core, ticket)
    activity = core.activity
    if not isinstance(activity, Coupled) or not activity.is_coupled:
        raise StateError(
            f"{ticket.name}: {core.parameters.name} is not coupled to a master axis",
            remedy="couple it to a master first, by a gear or a cam",
        )
    return activity


def require_cyclic(core: AxisCore, ticket: CommandStatus, mode: ModeOfOperation) -> None:
    """Raise StateError unless the axis has the mode, and its values are in synchronous PDOs (DESIGN: freshness)."""
    require_mode(core.parameters, mode, ticket)
    if mode is _M.CYCLIC_SYNC_POSITION:
        require_within_drive(core, ticket)
    how, needs = core.capabilities, _CYCLIC[mode]
    sources = {"statusword": how.inputs.get("statusword", ValueTransport.NONE)}
    sources |= {name: how.inputs.get(name, ValueTransport.NONE) for name in needs.inputs}
    if mode is not _M.CYCLIC_SYNC_POSITION and core.parameters.has(objects.POSITION_ACTUAL):
        # Without a position, limits cannot be monitored and a jam cannot be detected.
        sources["position"] = how.inputs.get("position", ValueTransport.NONE)
    sources[needs.output] = how.outputs.get(needs.output, ValueTransport.NONE)
    wrong = [
        f"{name} is transmitted by {source.value}"
        for name, source in sources.items()
        if source is not ValueTransport.SYNC_PDO
    ]
    if wrong:
        named = [f"{({**INPUT_OBJECTS, **OUTPUT_OBJECTS})[name]:04X}h" for name in sources]
        raise StateError(
            f"{ticket.name}: a cyclic mode needs {', '.join(named[:-1])} and {named[-1]} in synchronous PDOs",
            observed="; ".join(wrong),
            remedy="set sync = true in [bus], and let axisbus map the PDOs (remap) or map them in the drive",
        )


def _prepare(
    core: AxisCore,
    mode: ModeOfOperation,
    writes: list[tuple[int, int, int | None]],
    gate: StartBarrier,
    jerk: int | None = None,
    may_leave: Callable[[AxisImage], bool] | None = None,
) -> Prepare:
    set_point_source, before = core.active_source, pending_switch_of(core)
    step_source = (
        None if set_point_source is None or before is not None else _step_of_source(core, set_point_source)
    )
    ramps = RampTransfers(writes, core.parameters)
    transfers = JerkProfileWritten(ramps, jerk, core.profile_type, core.parameters)
    return Prepare(
        ModeSwitch(mode, core.parameters, step_source),
        transfers,
        ramps,
        gate,
        set_point_source,
        before,
        may_leave,
    )


def _exit_for(core: AxisCore, down: float | None, soft: float = 0.0) -> Callable[[AxisImage], bool] | None:
    """Return whether the axis may leave the set-points of the master for a command that brakes with ``down``; None: at any time.

    ``down`` in position increments per s²; ``soft``: seconds by which a limited jerk prolongs that ramp.
    """
    set_point_source = core.active_source
    if set_point_source is None or not down:
        return None
    if isinstance(set_point_source, VelocityRamp):
        before, guard = _commanded_motion(core), core.supervision.guard
        # Until it leaves, it brakes as before.
        weaker = _weaker(down, None if before is None else before.down) or down
        return (
            velocity_exit(set_point_source, partial(guard.overrun, down=weaker, soft=soft))
            if core.bounded
            else None
        )
    increment = 1.0 / abs(core.parameters.units.position.factor)
    return PathExit(set_point_source, down * increment, 0.5 * soft, core.parameters.scan_period, increment)


def _step_of_source(core: AxisCore, set_point_source: Follow | VelocityRamp) -> SourceStep:
    """Return the function that commands the axis until it has left a cyclic mode.

    If the drive is in a velocity mode before the master sees this, it must find its speed in the target velocity.
    """
    if isinstance(set_point_source, VelocityRamp):
        return partial(_hold_velocity, set_point_source)
    units = core.parameters.units

    def step_source(image: AxisImage, order: CycleOutputs) -> None:
        set_point_source.step(image, order)
        order.target_velocity = units.velocity.to_increments(set_point_source.last_step.velocity)

    return step_source


def _hold_velocity(set_point_source: VelocityRamp, image: AxisImage, order: CycleOutputs) -> None:
    set_point_source.hold()
    set_point_source.step(image, order)


def pending_switch_of(core: AxisCore) -> ModeSwitch | None:
    """Return the running change of mode that will end the trajectory of the axis; the next command must complete this change."""
    if core.stop_sequence is not None:
        return core.stop_sequence.pending_mode_switch
    return None if core.activity is None else core.activity.pending_mode_switch


def require_motion(core: AxisCore, ticket: CommandStatus) -> None:
    """Raise StateError unless the axis takes a motion command now."""
    if core.state not in TAKES_MOTION:
        raise refusal(core, ticket, core.state)
    require_no_stop(core, ticket)
    if not core.powered:
        raise StateError(
            f"{ticket.name}: {core.parameters.name} was found enabled, not by this program",
            observed=f"drive state {core.image.state.value!r}, mode "
            f"{'unknown' if core.image.mode is None else modes.short(ModeOfOperation(core.image.mode))}",
            remedy="take it over with axis.enable(), or switch it off with axis.disable()",
        )


def require_rest(core: AxisCore, ticket: CommandStatus, continued: SetPointSource | None = None) -> None:
    """Raise StateError unless the axis is at standstill, or ``continued`` is a command that the new command can continue."""
    if core.state is not AxisState.STANDSTILL and continued is None:
        raise StateError(f"{ticket.name}: the axis moves", remedy="halt it first: axis.halt()")


def require_objects(
    parameters: AxisParameters, mode: ModeOfOperation, ticket: CommandStatus, method: int | None = None
) -> None:
    """Raise StateError if the drive lacks an object that ``mode`` requires; ``method``: the homing method (6098h)."""
    missing = [index for index in modes.needed(mode, method) if not parameters.has(index)]
    if missing:
        raise StateError(
            f"{ticket.name}: {parameters.name} cannot run {modes.short(mode)} ({mode.text})",
            observed=f"its EDS lacks {', '.join(object_text(index) for index in missing)}",
            remedy="use another command; if the drive has these objects, name the drive's own EDS in cell.toml, "
            "and do not list them in ignored_objects",
        )
    require_mode(parameters, mode, ticket)


def require_mode(parameters: AxisParameters, mode: ModeOfOperation, ticket: CommandStatus) -> None:
    """Raise StateError if the axis must not use the mode: the cell file omits it, or 6502h does not claim it."""
    if mode in parameters.modes:
        return
    raise StateError(
        f"{ticket.name}: {parameters.name} does not have {modes.short(mode)} ({mode.text})",
        observed=f"its modes are {shown_modes(parameters)}",
        remedy=f"use another command; if the drive does have it, name it in modes = [...] of [axes.{parameters.name}]",
    )


def require_no_stop(core: AxisCore, ticket: CommandStatus) -> None:
    """Raise StateError if a stop runs that only standstill ends; a halt that has not become harder may be interrupted."""
    if not core.stopping.interruptible:
        raise StateError(
            f"{ticket.name}: {core.parameters.name} is being stopped",
            observed=core.stopping.explained,
            remedy="wait until it is at standstill",
        )


def refusal(core: AxisCore, ticket: CommandStatus, state: AxisState) -> StateError:
    """Return why a command is not possible in ``state``, and what to do first."""
    what, todo = REFUSAL[state]
    # A reset is of use only if its node is operational.
    if state is AxisState.ERRORSTOP and not core.image.operational:
        todo = not_to_be_reset(ticket.name, core.parameters.node, core.image, stopping=False).remedy
    why = f": {core.error.message}" if core.error is not None else ""
    observed = core.stopping.power_note if state is AxisState.DISABLED else ""
    return StateError(f"{ticket.name}: {core.parameters.name} {what}{why}", observed=observed, remedy=todo)
