"""Taking a command: whether the axis's state allows it, and the activity that carries it out; one function per command."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from axisbus.cia402 import modes, objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Source
from axisbus.cia402.state import ENERGISED, State
from axisbus.errors import AxisbusError, LimitError, StateError, Stopped
from axisbus.motion import commands as c
from axisbus.motion.activity import ModeSwitch, Transfers, require_position
from axisbus.motion.core import AxisCore, StopKind
from axisbus.motion.follow import Follow
from axisbus.motion.gate import OPEN, Gate
from axisbus.motion.handle import Handle
from axisbus.motion.homing import HomingRun
from axisbus.motion.jog import Jog
from axisbus.motion.ladder import Rung, Then
from axisbus.motion.moves import (
    OPTIONAL_PROFILE,
    PositionMove,
    Prepare,
    TorqueMove,
    VelocityMove,
    profile_writes,
)
from axisbus.motion.parameters import HoldsLoad
from axisbus.motion.power import RESTING_MODES, Coast, Enable, Reset
from axisbus.motion.profile import Profile
from axisbus.motion.states import MOVING, REFUSAL, TAKES_MOTION, AxisState

_M = ModeOfOperation


def accept(core: AxisCore, command: c.Command, handle: Handle, gate: Gate = OPEN) -> None:
    """Let ``command`` take effect on ``core``; what the state forbids ends the handle with the reason.

    ``gate``: where the axes of a group wait for each other before they start.
    """
    try:
        _ACCEPT[type(command)](core, command, handle, gate)
    except AxisbusError as error:
        core.finish(handle, error)


# -- power -----------------------------------------------------------------------------------------------------------


def _enable(core: AxisCore, _: c.Enable, handle: Handle, gate: Gate) -> None:
    if core.powered and core.state in TAKES_MOTION | {AxisState.HOMING}:
        core.finish(handle)
        return
    if core.state is AxisState.ERRORSTOP or core.image.state is State.FAULT:
        raise _refusal(core, handle, AxisState.ERRORSTOP)
    if core.ladder is not None:
        raise StateError(f"{handle.name}: the axis is being stopped", remedy="wait until it stands")
    if not core.image.operational:
        raise StateError(
            f"{handle.name}: node {core.parameters.node} is not operational",
            observed=f"NMT state {core.image.nmt}",
            remedy="boot it: axisbus boot cell.toml",
        )
    core.begin(Enable(core.parameters, _resting_modes(core), gate), handle)


def _resting_modes(core: AxisCore) -> list[ModeOfOperation]:
    """A drive found enabled keeps its mode; else the first resting mode that it has."""
    image = core.image
    if image.state in ENERGISED and image.mode in RESTING_MODES:
        return [ModeOfOperation(image.mode)]
    return [mode for mode in RESTING_MODES if mode in core.parameters.modes]


def _disable(core: AxisCore, command: c.Disable, handle: Handle, _: Gate) -> None:
    if command.coast:
        _coast(core, handle)
        return
    if core.state is AxisState.ERRORSTOP and core.image.state is State.FAULT:
        core.finish(handle)  # a drive in fault is off already
        return
    core.stop_because(StopKind.DISABLE, Then.DISABLE, Rung.HALT, f"{handle.name} was asked for", handle)


def _coast(core: AxisCore, handle: Handle) -> None:
    if core.parameters.holds_load is not HoldsLoad.NO and not core.image.standstill:
        raise StateError(
            f"{handle.name}: the axis holds a load and does not stand",
            remedy="halt it first: axis.halt()",
        )
    core.begin(Coast(core.parameters), handle)


def _reset(core: AxisCore, _: c.Reset, handle: Handle, __: Gate) -> None:
    if core.ladder is not None:
        raise StateError(f"{handle.name}: the axis is still being stopped", remedy="wait until it stands")
    if core.image.state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
        core.begin(Reset(core.parameters), handle)
        return
    core.clear_error()
    core.finish(handle)


# -- stopping --------------------------------------------------------------------------------------------------------


def _halt(core: AxisCore, _: c.Halt, handle: Handle, __: Gate) -> None:
    _stop_if_powered(core, handle, StopKind.HALT, Rung.HALT)


def _stop(core: AxisCore, _: c.Stop, handle: Handle, __: Gate) -> None:
    if core.powered and core.state is not AxisState.ERRORSTOP:
        core.state = AxisState.STOPPING
    _stop_if_powered(core, handle, StopKind.STOP, Rung.HALT)


def _quick_stop(core: AxisCore, _: c.QuickStop, handle: Handle, __: Gate) -> None:
    if core.powered and core.state is not AxisState.ERRORSTOP:
        core.state = AxisState.STOPPING
    _stop_if_powered(core, handle, StopKind.QUICK_STOP, Rung.QUICK_STOP)


def _stop_if_powered(core: AxisCore, handle: Handle, kind: StopKind, rung: Rung) -> None:
    """Outside operation enabled there is nothing to stop, and that is success; an enable under way is taken back."""
    reason = f"{handle.name} was asked for"
    if core.image.state in ENERGISED or (core.image.state is State.UNKNOWN and core.touched):
        core.stop_because(kind, Then.HOLD, rung, reason, handle)
        return
    if isinstance(core.activity, Enable):
        core.end_command(Stopped(reason))
        core.order.goal = State.SWITCH_ON_DISABLED
    core.finish(handle)


def _release(core: AxisCore, _: c.Release, handle: Handle, __: Gate) -> None:
    if core.state is not AxisState.STOPPING:
        core.finish(handle)
        return
    if core.ladder is not None:
        raise StateError(f"{handle.name}: the axis does not stand yet", remedy="wait for the stop first")
    if core.image.state is State.OPERATION_ENABLED:
        core.state = AxisState.STANDSTILL
    elif core.image.state is State.QUICK_STOP_ACTIVE:
        raise StateError(
            f"{handle.name}: the drive is held in quick stop active",
            remedy="enable it again (axis.enable()) or disable it (axis.disable())",
        )
    core.finish(handle)


def _shutdown(core: AxisCore, command: c.Shutdown, handle: Handle, _: Gate) -> None:
    if not core.touched:
        core.finish(handle)  # never commanded by us: left as it was found
        return
    holds = core.parameters.holds_load is HoldsLoad.TORQUE
    rung = Rung.QUICK_STOP if command.quick else Rung.HALT
    core.stop_because(
        StopKind.SHUTDOWN, Then.HOLD if holds else Then.DISABLE, rung, f"stopped: {command.reason}", handle
    )


def _policy_stop(core: AxisCore, command: c.PolicyStop, handle: Handle, __: Gate) -> None:
    if core.state in MOVING or isinstance(core.activity, Enable):
        core.stop_because(StopKind.POLICY, Then.HOLD, Rung.HALT, command.reason, handle)
    else:
        core.finish(handle)


# -- motion ----------------------------------------------------------------------------------------------------------


def _move(core: AxisCore, command: c.Move, handle: Handle, gate: Gate) -> None:
    _require_motion(core, handle)
    _require_watch(core, command.profile, handle)
    target = _target(core, command, handle)
    profile = command.profile
    prepare = _prepare(
        core, _M.PROFILE_POSITION, profile_writes(profile, core.parameters, _M.PROFILE_POSITION), gate
    )
    before = core.activity.in_flight if isinstance(core.activity, PositionMove) else core.set_point
    core.begin(
        PositionMove(target, profile, core.parameters, prepare, before), handle, AxisState.DISCRETE_MOTION
    )
    core.set_point = None
    core.last_target = target


def _require_watch(core: AxisCore, profile: Profile, handle: Handle) -> None:
    """Every move needs a deadline; without 6064h neither distance nor progress is known."""
    if profile.timeout is None and not core.parameters.has(objects.POSITION_ACTUAL):
        raise StateError(
            f"{handle.name}: nothing tells how long it may take",
            observed="the drive has no position actual value (6064h), so neither distance nor progress can be seen",
            remedy="give timeout = ... (seconds) in the call",
        )


def _target(core: AxisCore, command: c.Move, handle: Handle) -> int:
    """Return the absolute target in unwrapped drive increments; the master always sends absolute ones."""
    origin = core.image.origin
    if command.reference is c.Reference.ABSOLUTE:
        return command.value + origin
    actual = require_position(core.image, core.parameters.name, "a relative move")
    base = actual
    if command.reference is c.Reference.ADDITIVE and core.last_target is not None:
        base = core.last_target
    _check_limits(core, base + command.value - origin, handle)
    return base + command.value


def _check_limits(core: AxisCore, position: int, handle: Handle) -> None:
    limits, units = core.parameters.limits.position, core.parameters.units.position
    value = units.to_units(position)
    if limits is not None and not limits[0] <= value <= limits[1]:
        raise LimitError(
            f"{handle.name}: would end beyond the position limits",
            observed=f"at {value:g} {units.unit}; allowed are {limits[0]:g} to {limits[1]:g}",
            remedy="move less far, or change position_limits in cell.toml",
        )


def _move_velocity(core: AxisCore, command: c.MoveVelocity, handle: Handle, gate: Gate) -> None:
    if (
        command.life is not None
        and isinstance(core.activity, Jog)
        and core.activity.renew(command, core.image)
    ):
        core.finish(handle)
        return
    _require_motion(core, handle)
    profile = command.profile
    prepare = _prepare(
        core, _M.PROFILE_VELOCITY, profile_writes(profile, core.parameters, _M.PROFILE_VELOCITY), gate
    )
    move = VelocityMove(profile, core.parameters, prepare)
    if command.life is None:
        core.begin(move, handle, AxisState.CONTINUOUS_MOTION)
    else:
        core.begin(Jog(move, command, core.image), handle, AxisState.CONTINUOUS_MOTION)


def _torque(core: AxisCore, command: c.TorqueControl, handle: Handle, gate: Gate) -> None:
    _require_motion(core, handle)
    parameters = core.parameters
    writes: list[tuple[int, int, int | None]] = []
    if command.slope is not None and parameters.has(objects.TORQUE_SLOPE):
        writes.append((objects.TORQUE_SLOPE, 0, command.slope))
    prepare = _prepare(core, _M.PROFILE_TORQUE, writes, gate)
    move = TorqueMove(command.torque, command.timeout, parameters, prepare)
    core.begin(move, handle, AxisState.CONTINUOUS_MOTION)


def _home(core: AxisCore, command: c.Home, handle: Handle, _: Gate) -> None:
    _require_motion(core, handle)
    if core.state is not AxisState.STANDSTILL:
        raise StateError(f"{handle.name}: the axis moves", remedy="halt it first: axis.halt()")
    core.homed = False
    core.begin(HomingRun(command.job, core.parameters), handle, AxisState.HOMING)


def _set_position(core: AxisCore, command: c.SetPosition, handle: Handle, _: Gate) -> None:
    if core.state in MOVING or core.state is AxisState.STOPPING:
        raise StateError(f"{handle.name}: the axis moves", remedy="set the position at standstill")
    actual = require_position(core.image, core.parameters.name, "setting the position")
    core.image.origin = actual - command.position
    core.last_target = None
    core.homed = True
    core.finish(handle)


def _follow(core: AxisCore, command: c.FollowTrajectory, handle: Handle, gate: Gate) -> None:
    begin_follow(core, Follow(command.trajectory, core.parameters, gate), handle)


def begin_follow(core: AxisCore, follow: Follow, handle: Handle) -> None:
    """Let a trajectory begin; cyclic modes need standstill and values that travel with SYNC.

    Raises:
        StateError: the axis is not at standstill, or its values do not travel with SYNC.
    """
    _require_motion(core, handle)
    require_cyclic(core, handle)
    if core.state is not AxisState.STANDSTILL:
        raise StateError(f"{handle.name}: the axis moves", remedy="halt it first: axis.halt()")
    core.begin(follow, handle, AxisState.SYNCHRONIZED_MOTION)


def require_cyclic(core: AxisCore, handle: Handle) -> None:
    """Raise StateError unless statusword, position and target travel in synchronous PDOs (DESIGN: freshness)."""
    how = core.capabilities
    wanted = {
        "statusword": how.inputs.get("statusword", Source.NONE),
        "position": how.inputs.get("position", Source.NONE),
        "target_position": how.outputs.get("target_position", Source.NONE),
    }
    wrong = [
        f"{name} travels by {source.value}"
        for name, source in wanted.items()
        if source is not Source.SYNC_PDO
    ]
    if wrong:
        raise StateError(
            f"{handle.name}: a cyclic mode needs 6041h, 6064h and 607Ah in synchronous PDOs",
            observed="; ".join(wrong),
            remedy="set sync = true in [bus], and let axisbus map the PDOs (remap) or map them in the drive",
        )


# -- helpers ---------------------------------------------------------------------------------------------------------


def _prepare(
    core: AxisCore, mode: ModeOfOperation, writes: list[tuple[int, int, int | None]], gate: Gate
) -> Prepare:
    return Prepare(
        ModeSwitch(mode, core.parameters), Transfers(writes, core.parameters, OPTIONAL_PROFILE), gate
    )


def _require_motion(core: AxisCore, handle: Handle) -> None:
    if core.state not in TAKES_MOTION:
        raise _refusal(core, handle, core.state)
    if not core.powered:
        raise StateError(
            f"{handle.name}: {core.parameters.name} was found enabled, not by this program",
            observed=f"drive state {core.image.state.value!r}, mode "
            f"{'unknown' if core.image.mode is None else modes.short(ModeOfOperation(core.image.mode))}",
            remedy="take it over with axis.enable(), or switch it off with axis.disable()",
        )


def _refusal(core: AxisCore, handle: Handle, state: AxisState) -> StateError:
    what, todo = REFUSAL[state]
    why = f": {core.error.message}" if core.error is not None else ""
    return StateError(f"{handle.name}: {core.parameters.name} {what}{why}", remedy=todo)


_ACCEPT: dict[type, Callable[[AxisCore, Any, Handle, Gate], None]] = {
    c.Enable: _enable,
    c.Disable: _disable,
    c.Reset: _reset,
    c.Halt: _halt,
    c.Stop: _stop,
    c.Release: _release,
    c.QuickStop: _quick_stop,
    c.Move: _move,
    c.MoveVelocity: _move_velocity,
    c.TorqueControl: _torque,
    c.Home: _home,
    c.SetPosition: _set_position,
    c.FollowTrajectory: _follow,
    c.Shutdown: _shutdown,
    c.PolicyStop: _policy_stop,
}
