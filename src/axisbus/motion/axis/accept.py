"""Accept commands: check that the axis's state allows the command, and begin its activity; one function per command."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import partial
from typing import Any

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.errors import AxisbusError, DriveFault, StateError, Stopped
from axisbus.motion import commands as c
from axisbus.motion.axis import (
    accept_blending,
    accept_cyclic,
    accept_jerk_limited,
    accept_motion,
    accept_superimposed,
)
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.group.start_barrier import OPEN, StartBarrier
from axisbus.motion.jerk.velocity import JerkLimitedVelocity
from axisbus.motion.modes import FOLLOWS_TARGETS, RESTING_MODES, RETAINED_MODES
from axisbus.motion.moves.activity import Activity
from axisbus.motion.moves.adopt_enabled_drive import DriveAdoption
from axisbus.motion.moves.coast_and_reset import Coast, ResetActivity
from axisbus.motion.moves.enable import EnableActivity
from axisbus.motion.override import require_factor
from axisbus.motion.parameters import HoldsLoad
from axisbus.motion.states import MOVING, AxisState
from axisbus.motion.stop.active_stop import StopKind
from axisbus.motion.stop.diagnosis import (
    boot_and_reset,
    first_observation,
    nmt_text,
    not_to_be_reset,
    when_back,
)
from axisbus.motion.stop.policy import GroupFault
from axisbus.motion.stop.stop_sequence import AfterStop, StopLevel


def accept(core: AxisCore, command: c.Command, ticket: CommandStatus, gate: StartBarrier = OPEN) -> None:
    """Begin ``command`` on ``core``; if the axis's state forbids the command, end the ticket with the reason.

    ``gate``: the start barrier at which the axes of a group wait for each other.
    """
    try:
        _ACCEPT[type(command)](core, command, ticket, gate)
    except AxisbusError as error:
        core.finish(ticket, error)


# -- power -----------------------------------------------------------------------------------------------------------


def require(core: AxisCore, command: c.Command, ticket: CommandStatus) -> None:
    """Raise AxisbusError if ``core`` would refuse a command that several axes must begin together; then no axis begins it."""
    if isinstance(command, c.EnableCommand):
        _require_enable(core, ticket)
    elif isinstance(command, c.Move):
        accept_motion.require_motion(core, ticket)
        accept_motion.require_watch(core.parameters, command.profile, ticket)
        accept_motion.target_of(core, command, ticket)


def _require_enable(core: AxisCore, ticket: CommandStatus) -> None:
    if core.parameters.encoder:
        raise StateError(
            f"{ticket.name}: {core.parameters.name} is an encoder and has no drive",
            observed=f"its position is the input [io.{core.parameters.encoder}]",
            remedy="let another axis follow it: gear_in or cam_in",
        )
    if core.state is AxisState.ERRORSTOP or core.image.state is PowerState.FAULT:
        raise accept_motion.refusal(core, ticket, AxisState.ERRORSTOP)
    accept_motion.require_no_stop(core, ticket)
    if _is_enabled(core):
        return
    if core.stop_sequence is not None:
        raise StateError(f"{ticket.name}: the axis is being stopped", remedy="wait until it is at standstill")
    if _runs(core, EnableActivity):
        return
    if _runs(core, Coast) and core.image.state is PowerState.OPERATION_ENABLED:
        raise StateError(  # an enable now would hold the axis from one cycle to the next, whatever its speed
            f"{ticket.name}: its power is being switched off",
            remedy="wait until it is off: axis.disable(coast=True).wait()",
        )
    if not core.image.operational:
        raise StateError(
            f"{ticket.name}: node {core.parameters.node} is not operational",
            observed=nmt_text(core.image),
            remedy=f"check its supply and cable; {when_back(core.parameters.node)}",
        )


def _is_enabled(core: AxisCore) -> bool:
    """Whether this master has enabled the axis. A quick stop that may already be on its way to the drive removes the power."""
    keeps_power = core.stop_sequence is None or core.stop_sequence.level is StopLevel.HALT
    return core.powered and keeps_power and core.image.state is PowerState.OPERATION_ENABLED


def _enable(core: AxisCore, command: c.EnableCommand, ticket: CommandStatus, gate: StartBarrier) -> None:
    _require_enable(core, ticket)
    if _is_enabled(core):
        core.finish(ticket)  # already enabled; an axis locked in Stopping stays there
        return
    if _runs(core, EnableActivity):
        core.join(ticket)
        return
    takeover = _takeover(core)
    core.begin(
        EnableActivity(core.parameters, _resting_modes(core), gate, takeover, moving=command.moving), ticket
    )


def _runs(core: AxisCore, activity: type[Activity]) -> bool:
    """Whether the same command runs already: it continues, and both tickets end together."""
    return isinstance(core.activity, activity) and core.running.ticket is not None


def _resting_modes(core: AxisCore) -> list[ModeOfOperation]:
    """Return the resting modes that the drive has. A drive found energised keeps its mode, if the mode holds the axis."""
    image = core.image
    if image.state in ENERGISED and image.mode in RETAINED_MODES:
        found = ModeOfOperation(image.mode)
        return [found, *(mode for mode in RESTING_MODES if mode in core.parameters.modes and mode != found)]
    return [mode for mode in RESTING_MODES if mode in core.parameters.modes]


def _takeover(core: AxisCore) -> DriveAdoption | None:
    """Return the checks for adopting a drive that is found enabled in a mode that follows targets; None for other modes."""
    mode = core.image.mode
    return DriveAdoption(ModeOfOperation(mode), core.parameters) if mode in FOLLOWS_TARGETS else None


def _disable(core: AxisCore, command: c.Disable, ticket: CommandStatus, _: StartBarrier) -> None:
    if command.coast:
        _coast(core, ticket)
        return
    if (
        core.state is AxisState.ERRORSTOP
        and core.image.state is PowerState.FAULT
        and not core.coast_down.under_way
    ):
        core.finish(ticket)  # a drive in fault is off already, and its motor is at standstill
        return
    core.stop_because(
        StopKind.DISABLE, AfterStop.DISABLE, StopLevel.HALT, f"{ticket.name} was asked for", ticket
    )


def _coast(core: AxisCore, ticket: CommandStatus) -> None:
    if core.parameters.holds_load is not HoldsLoad.NO and not core.image.standstill:
        raise StateError(
            f"{ticket.name}: the axis holds a load and is not at standstill",
            remedy="halt it first: axis.halt()",
        )
    if _runs(core, Coast):
        core.join(ticket)
        return
    path, switch = core.active_source, accept_motion.pending_switch_of(core)
    core.coast(Coast(core.parameters, path, switch), ticket)


def _reset(core: AxisCore, command: c.ResetCommand, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Reset at once, or after the end of the running stop."""
    image = core.image
    stopping = core.stop_sequence is not None
    if core.node_boots and core.error is not None:
        raise copy(core.error)
    if core.state is AxisState.ERRORSTOP and not image.operational:
        raise not_to_be_reset(ticket.name, core.parameters.node, image, stopping=stopping)
    if stopping:
        core.stopping.add_reset(ticket, partial(accept, core, command, ticket, gate))
        return
    if _runs(core, ResetActivity):
        core.join(ticket)
        return
    if image.state in (PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE):
        fault = first_observation(core.error) if isinstance(core.error, DriveFault) else ""
        core.begin(ResetActivity(core.parameters, fault), ticket)
        return
    if core.state is AxisState.ERRORSTOP and image.state is PowerState.UNKNOWN:
        raise StateError(
            f"{ticket.name}: the state of the drive is unknown",
            observed="no fresh statusword (6041h)",
            remedy=(
                "see why it is in ErrorStop (axis.error), and check that the drive sends the TPDO that contains 6041h; "
                f"then {boot_and_reset(core.parameters.node)}"
            ),
        )
    if core.state is AxisState.ERRORSTOP and core.disobeyed:
        raise StateError(
            f"{ticket.name}: the drive does not obey the stop",
            observed=f"it still drives its motor, in state {image.state.value!r}",
            remedy="TREAT THE AXIS AS MOVING: use the emergency stop; then see why it is in ErrorStop (axis.error)",
        )
    core.clear_error()
    core.finish(ticket)


# -- stopping --------------------------------------------------------------------------------------------------------


def _halt(core: AxisCore, _: c.Halt, ticket: CommandStatus, __: StartBarrier) -> None:
    if core.state is not AxisState.STOPPING:
        if isinstance(core.activity, JerkLimitedVelocity):
            core.activity.brake_softly()
        _stop_if_powered(core, ticket, StopKind.HALT, StopLevel.HALT)
    elif core.stop_sequence is not None:
        core.stopping.join(ticket)
    elif core.image.standstill:  # locked
        core.finish(ticket)
    else:
        # The drive holds it in quick stop active and still brakes; this happens after a stop that was not confirmed.
        _stop_if_powered(core, ticket, StopKind.STOP, StopLevel.HALT)


def _stop(core: AxisCore, _: c.Stop, ticket: CommandStatus, __: StartBarrier) -> None:
    _stop_if_powered(core, ticket, StopKind.STOP, StopLevel.HALT)


def _quick_stop(core: AxisCore, _: c.QuickStop, ticket: CommandStatus, __: StartBarrier) -> None:
    _stop_if_powered(core, ticket, StopKind.QUICK_STOP, StopLevel.QUICK_STOP)


def _stop_if_powered(core: AxisCore, ticket: CommandStatus, kind: StopKind, level: StopLevel) -> None:
    """Stop the axis. If its motor is not powered, and no word sent may still switch it on, succeed without a stop.

    A drive in an unknown state may be moving, so it is stopped. An axis that has lost its power in motion is monitored until it is
    at standstill. An axis that is being enabled is monitored until it is seen off after the last word sent to it.
    """
    off = core.image.state not in ENERGISED and core.image.state is not PowerState.UNKNOWN
    if off and not core.coast_down.under_way and not core.may_be_switched_on:
        core.finish(ticket)
        return
    core.stop_because(kind, AfterStop.HOLD, level, f"{ticket.name} was asked for", ticket)


def _release(core: AxisCore, _: c.Release, ticket: CommandStatus, __: StartBarrier) -> None:
    if core.state is not AxisState.STOPPING:
        core.finish(ticket)
        return
    if core.stop_sequence is not None:
        raise StateError(
            f"{ticket.name}: the axis is not at standstill yet", remedy="wait for the stop first"
        )
    if core.image.state is PowerState.QUICK_STOP_ACTIVE:
        raise StateError(
            f"{ticket.name}: the drive is held in quick stop active",
            remedy="enable it again (axis.enable()) or disable it (axis.disable())",
        )
    core.unlock()
    core.finish(ticket)


def _shutdown(core: AxisCore, command: c.Shutdown, ticket: CommandStatus, _: StartBarrier) -> None:
    core.probes.end_all(Stopped, f"was ended: {command.reason}", core.order)
    if not core.touched:
        core.finish(ticket)  # never commanded by this master: leave it unchanged
        return
    holds = core.parameters.holds_load is HoldsLoad.TORQUE
    level = StopLevel.QUICK_STOP if command.quick else StopLevel.HALT
    core.stop_because(
        StopKind.SHUTDOWN,
        AfterStop.HOLD if holds else AfterStop.DISABLE,
        level,
        f"stopped: {command.reason}",
        ticket,
    )


def _policy_stop(core: AxisCore, command: c.PolicyStop, ticket: CommandStatus, __: StartBarrier) -> None:
    if command.how is GroupFault.EACH and core.active_path is not None:
        core.active_path.brake_alone()
    level = StopLevel.QUICK_STOP if command.how is GroupFault.QUICK else StopLevel.HALT
    _stop_if_moving(core, StopKind.POLICY, command.reason, ticket, level)


def _hand_over(core: AxisCore, command: c.HandOver, ticket: CommandStatus, __: StartBarrier) -> None:
    core.probes.end_all(Stopped, f"was ended: {command.reason}", core.order)
    _stop_if_moving(core, StopKind.HALT, command.reason, ticket)


def _stop_if_moving(
    core: AxisCore, kind: StopKind, reason: str, ticket: CommandStatus, level: StopLevel = StopLevel.HALT
) -> None:
    is_moving = core.touched and core.state in MOVING
    if is_moving or isinstance(core.activity, EnableActivity):
        core.stop_because(kind, AfterStop.HOLD, level, reason, ticket)
    else:
        core.finish(ticket)


def _set_override(core: AxisCore, command: c.SetOverride, ticket: CommandStatus, __: StartBarrier) -> None:
    require_override(core, command.factor, ticket)
    core.set_override(own=command.factor)
    core.finish(ticket)


def _set_torque_offset(
    core: AxisCore, command: c.SetTorqueOffset, ticket: CommandStatus, __: StartBarrier
) -> None:
    if core.forward is None:
        raise StateError(
            f"{ticket.name}: {core.parameters.name} has no torque feed-forward",
            remedy=f"write torque_offset = 0.0 into [axes.{core.parameters.name}.feed_forward] of cell.toml, and open it again",
        )
    core.forward.aim(command.torque)
    core.finish(ticket)


def require_override(core: AxisCore, factor: float, ticket: CommandStatus) -> None:
    """Check that ``factor`` is a valid override, and that the acceleration for the change of speed is known.

    Raises:
        LimitError: the factor is not from 0 to 1.5.
        StateError: no acceleration is known.
    """
    require_factor(factor, ticket.name)
    name = core.parameters.name
    if core.parameters.encoder:
        return  # no command moves an encoder
    if factor != 1.0 and not core.parameters.path_deceleration:
        raise StateError(
            f"{ticket.name}: no acceleration is given for the change of speed of {name}",
            remedy=f"set acceleration in [axes.{name}.defaults] of cell.toml",
        )


# -- touch probe -----------------------------------------------------------------------------------------------------


def _probe(core: AxisCore, command: c.Probe, ticket: CommandStatus, _: StartBarrier) -> None:
    if core.state is AxisState.HOMING:
        raise StateError(
            f"{ticket.name}: the axis is being homed, and its drive will then count its positions from the new home",
            remedy="wait until it is homed",
        )
    core.probes.begin(command, ticket, core.image, core.order)


def _probe_abort(core: AxisCore, command: c.ProbeAbort, ticket: CommandStatus, _: StartBarrier) -> None:
    core.probes.abort(command, ticket, core.image, core.order)


# -- buffered and blended commands -----------------------------------------------------------------------------------


def _buffered(core: AxisCore, command: c.Buffered, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Queue a motion behind the running command; if no command runs, begin the motion."""
    accept_motion.require_motion(core, ticket)
    if core.stop_sequence is not None:
        raise StateError(f"{ticket.name}: the axis is being halted", remedy="wait until it is at standstill")
    if core.running.ticket is None:
        _ACCEPT[type(command.command)](core, command.command, ticket, gate)
    else:
        core.queue.add(ticket, partial(accept, core, command.command, ticket, gate))


def _blend(core: AxisCore, command: c.BufferedMove, ticket: CommandStatus, gate: StartBarrier) -> None:
    """Blend a move with the running command; if this is not possible, queue it and write the reason into its ticket."""
    why = accept_blending.blend(core, command, ticket, gate)
    if why is not None:
        ticket.note = why
        core.queue.add(ticket, partial(accept, core, command, ticket, gate), joins=True)


_ACCEPT: dict[type, Callable[[AxisCore, Any, CommandStatus, StartBarrier], None]] = {
    c.EnableCommand: _enable,
    c.Disable: _disable,
    c.ResetCommand: _reset,
    c.Halt: _halt,
    c.Stop: _stop,
    c.Release: _release,
    c.QuickStop: _quick_stop,
    c.Move: accept_motion.move,
    c.MoveVelocity: accept_jerk_limited.move_velocity,
    c.TorqueControl: accept_motion.torque,
    c.CyclicVelocity: accept_cyclic.velocity,
    c.CyclicTorque: accept_cyclic.torque,
    c.ControllerCommand: accept_cyclic.control,
    c.ControllerOutput: accept_cyclic.controller_output,
    c.Home: accept_motion.home,
    c.SetPosition: accept_motion.set_position,
    c.FollowTrajectory: accept_motion.follow,
    c.Buffered: _buffered,
    c.BufferedMove: _blend,
    c.GearOut: accept_motion.uncouple,
    c.Probe: _probe,
    c.ProbeAbort: _probe_abort,
    c.SetOverride: _set_override,
    c.SetTorqueOffset: _set_torque_offset,
    c.PhaseBy: accept_motion.phase_by,
    c.MoveSuperimposed: accept_superimposed.move,
    c.HaltSuperimposed: accept_superimposed.halt,
    c.Shutdown: _shutdown,
    c.PolicyStop: _policy_stop,
    c.HandOver: _hand_over,
}
