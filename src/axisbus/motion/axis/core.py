"""One axis as a pure step function: commands and inputs in, outputs out (PLCopen's axis over CiA 402).

Theory of operation
-------------------
In each cycle ``step`` does four things, in this order:

1. ``AxisImage`` decodes the inputs; values that are too old are unknown.
2. ``Supervision`` looks for unexpected events: node lost, fault, power stage dropped, statusword missing, limits in danger.
   Each of them ends in ``fail``: state ErrorStop, stop sequence, and the command's ticket ends with the reason.
3. The running activity is stepped, or the stop sequence if there is one (also when the activity has just failed). Without either
   the last targets remain valid.
4. ``CycleOutputs`` turns the requests into ``Outputs``.

In an *uneventful* cycle after an uneventful one (``_is_uneventful``), only the monitoring of motion and standstill is done from
step 2, because only these values change from cycle to cycle. The other checks would repeat the result of the previous cycle. If the
axis then only continues along its trajectory, one function does the whole cycle (``fast_path``).

Nothing is sent to a drive before a command requests something (``CycleOutputs.goal`` is None until then): a drive found enabled
stays unchanged. If a drive that this master has enabled leaves *operation enabled*, the planner never enables it again, whatever
the state of the axis (``_prevent_reenable``). This requires a new command.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from dataclasses import replace

from axisbus.cia402 import controlword as cw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Capabilities, Inputs, Outputs, ValueTransport
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.errors import (
    AxisbusError,
    Interrupted,
    MotionTimeout,
    Replaced,
    SecondMasterError,
    StateError,
    Stopped,
    UncommandedMotion,
)
from axisbus.motion.axis.active_command import ActiveCommand
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.fast_path import FastPath, fast_path_of
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.axis.loss import Loss
from axisbus.motion.axis.queue import Queue
from axisbus.motion.command_status import CommandStatus, broken
from axisbus.motion.cyclic.ramps import VelocityRamp
from axisbus.motion.feed_forward import feed_forward_of, offsets_of
from axisbus.motion.jerk.drive_profile_type import ProfileType
from axisbus.motion.modes import WITHOUT_TARGET_POSITION
from axisbus.motion.moves.activity import Activity
from axisbus.motion.moves.arrival import ArrivalCheck
from axisbus.motion.moves.enable import EnableActivity
from axisbus.motion.moves.follow import Follow
from axisbus.motion.moves.position import PositionMove
from axisbus.motion.override import Override
from axisbus.motion.parameters import AxisParameters, HoldsLoad
from axisbus.motion.probing.probes import Probes
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState
from axisbus.motion.stop.active_stop import REMEDIES, StopKind, Stopping, power_note, stop_error
from axisbus.motion.stop.coast_down import CoastDown, FaultReaction
from axisbus.motion.stop.diagnosis import DriveHistory, FaultDiagnosis, chained, enrich, join_remedies
from axisbus.motion.stop.standstill import StandstillWaiters
from axisbus.motion.stop.stop_sequence import AfterStop, StopLevel, StopSequence
from axisbus.motion.stop.supervision import POWERED, StopDemand, Supervision, duplicate_error
from axisbus.motion.superimposed import Addition

_ENABLED, _UNKNOWN = PowerState.OPERATION_ENABLED, PowerState.UNKNOWN
_ERRORSTOP, _SYNCHRONIZED = AxisState.ERRORSTOP, AxisState.SYNCHRONIZED_MOTION
_FAULTS = frozenset({PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE})
_LOCKING = frozenset({StopKind.STOP, StopKind.QUICK_STOP})
_LASTING = _LOCKING | {StopKind.SHUTDOWN}  # an earlier reset request does not end these
_HELD = frozenset(
    {StopLevel.HALT, StopLevel.QUICK_STOP}
)  # in which a drive holds an axis that was at standstill when it was stopped
_NOW = 0.1  # seconds: a position not older than this counts as present
_MAY_BE_ENERGISED = ENERGISED | {_UNKNOWN}
_tuple = tuple.__new__  # makes a named tuple of values known to fit, without the call of its own ``__new__``


class AxisCore:
    """State and behaviour of one axis; every public attribute is read-only to others.

    ``state`` is PLCopen's; ``error`` is the reason for ErrorStop. ``touched``: this master has commanded the drive, so the shutdown
    stops it. ``powered``: an enable by this master has succeeded, and the power has not been removed since. ``node_boots``: the
    node is being booted, so the axis cannot be reset.
    """

    def __init__(self, parameters: AxisParameters, capabilities: Capabilities) -> None:
        self.parameters = parameters
        self.capabilities = capabilities
        window = parameters.timing.standstill_time
        self.image = AxisImage(
            capabilities,
            parameters.scan_period,
            parameters.standstill_tolerance,
            window,
            parameters.demand,
            parameters.pull_window,
            parameters.braking.deceleration(parameters.braking.quick_stop, parameters.slow_ramp),
        )
        if parameters.limits.velocity is not None and parameters.units.ratio_known:
            self.image.fastest = parameters.limits.velocity * abs(parameters.units.position.factor)
        self.order = CycleOutputs()
        self.override = Override()
        self.profile_type = ProfileType()
        self.history = DriveHistory()
        self.supervision = Supervision(parameters, capabilities)
        self.stopping = Stopping(parameters)
        self.coast_down = CoastDown(parameters)
        self.state = AxisState.DISABLED
        self.error: AxisbusError | None = None
        self.homed = False
        self._needs_homing = parameters.homing.required
        self.powered = False
        self.touched = False
        self.node_boots = False
        self.tripped: AxisbusError | None = None  # set for one cycle: the fault policy reads it
        self.running = ActiveCommand()
        self.queue = Queue()
        self.forward = feed_forward_of(parameters)
        self.probes = Probes(parameters, self.running)
        self.last_target: int | None = None
        self.halted = False
        self._broken: AxisbusError | None = None  # the reason for a failure between two cycles
        self._fault_diagnosis: FaultDiagnosis | None = None
        self._arrival = ArrivalCheck(parameters)
        self._fault_reaction = FaultReaction(parameters)
        self.standstill_waiters = StandstillWaiters(parameters)
        # of the last confirmed position, also after a restart of the node
        self._confirmed_origin: int | None = None
        self._has_restarted = False  # since its node was operational
        self._sends_target_by_sync = capabilities.outputs.get("target_position") is ValueTransport.SYNC_PDO
        self._stop_confirmed = False
        self._was_uneventful = False  # in the previous cycle
        self._fast_path: FastPath | None = None  # while it only continues along a trajectory

    def begin_again(
        self, parameters: AxisParameters, capabilities: Capabilities, error: AxisbusError, *, absolute: bool
    ) -> None:
        """Begin as a new object, in ErrorStop with ``error``: the node was booted again. Nothing of before remains.

        ``absolute``: the drive has kept its count of positions, so a confirmed position remains confirmed. Groups, pairs and
        couplings refer to this object, so it is not replaced. Commands end with ``error``; ``take_out`` has ended those of before,
        but a stop or a disable is accepted during the boot-up.
        """
        self._end_because(error)
        confirmed = self._confirmed_origin if absolute else None
        self.__init__(parameters, capabilities)  # type: ignore[misc]
        self.state, self.error = AxisState.ERRORSTOP, error
        if confirmed is not None:
            self.confirm_position(confirmed)

    def require_rest_for_boot(self) -> None:
        """Raise StateError if the node must not be booted now: the axis is commanded, being stopped, or enabled."""
        name, node, state = self.parameters.name, self.parameters.node, self.image.state
        if self.stop_sequence is not None:
            observed, remedy = f"{name} is being stopped", "wait until its stop has ended"
        elif self.activity is not None or self.queue:
            observed, remedy = (
                f"{self._command_name} runs",
                "wait for its end, or stop it, and disable the axis",
            )
        elif self.image.duplicate:
            error = duplicate_error(name, node, self.image.duplicate)
            observed, remedy = f"{error.message} ({error.observed})", error.remedy
        elif state in ENERGISED:
            observed, remedy = (
                f"the drive of {name} is in state {state.value!r}",
                "disable the axis first: axis.disable()",
            )
        else:
            return
        raise StateError(f"node {node} cannot be booted now", observed=observed, remedy=remedy)

    def take_out(self, error: AxisbusError) -> None:
        """Go to ErrorStop with ``error`` before the node is booted: nothing is requested from the drive, no loss is reported.

        No other axis is stopped for this, because the axis is at rest without power.
        """
        self._end_because(error)
        self.state, self.error, self.powered = AxisState.ERRORSTOP, error, False
        self.node_boots = True
        self.supervision.lost = True
        self.order.goal = None

    def take_back(self, error: AxisbusError) -> None:
        """Note ``error``, with which the boot-up of the node has failed; the drive is requested to be without power as before."""
        self.error, self.node_boots = error, False
        if self.touched and self.order.goal is None:
            self.order.goal = PowerState.SWITCH_ON_DISABLED

    @property
    def activity(self) -> Activity | None:
        """The activity that moves the axis or changes its state; None if there is none."""
        return self.running.activity

    @property
    def stop_sequence(self) -> StopSequence | None:
        """The running stop sequence, if any."""
        return self.stopping.stop_sequence

    @property
    def active_path(self) -> Follow | None:
        """The trajectory that the axis follows, or along which a halt that may be interrupted brakes."""
        return follow if isinstance(follow := self.active_source, Follow) else None

    @property
    def active_source(self) -> Follow | VelocityRamp | None:
        """The same, or the ramp of csv: it must command the axis until another mode has taken over."""
        running = None if self.activity is None else self.activity.set_point_source
        follow = running if self.stop_sequence is None else self.stop_sequence.follow
        return follow if isinstance(follow, (Follow, VelocityRamp)) and not follow.at_rest else None

    @property
    def rests(self) -> bool:
        """Whether the drive needs no further stop: it was never commanded, is not powered, or is known to have been stopped."""
        return not self.touched or self.image.state not in _MAY_BE_ENERGISED or self._stop_confirmed

    @property
    def stop_confirmed(self) -> bool:
        """Whether the last stop sequence has seen the axis stopped, and nothing has set it in motion since."""
        return self._stop_confirmed

    @property
    def may_be_switched_on(self) -> bool:
        """Whether an enable runs, or a word sent earlier may still switch the drive on after it was seen off."""
        if not self.touched or self.image.state in _FAULTS:
            return False
        return isinstance(self.activity, EnableActivity) or self.image.flight.may_enable(self.image.now)

    @property
    def disobeyed(self) -> bool:
        """Whether its drive still powers the motor in a state other than the requested one; *quick stop active* does not count."""
        state, goal = self.image.state, self.order.goal
        drives = state in ENERGISED and state is not PowerState.QUICK_STOP_ACTIVE
        return self.touched and drives and goal is not None and goal is not state

    @property
    def bounded(self) -> bool:
        """Whether the position limits apply: if homing is required, they apply only after it."""
        return self.homed or not self._needs_homing

    @property
    def path_parameters(self) -> AxisParameters:
        """The parameters for a path of the axis: without position limits as long as they do not apply, in the drive neither."""
        parameters = self.parameters
        if self.bounded or parameters.limits_in_drive:
            return parameters
        return replace(parameters, limits=replace(parameters.limits, position=None))

    # -- one cycle ---------------------------------------------------------------------------------------------------

    def step(self, inputs: Inputs) -> Outputs:
        """Do one cycle's work and return the outputs for the drive."""
        if self._fast_path is not None:
            outputs = self._fast_path.step(inputs)
            if outputs is not None:
                return outputs
        image, order = self.image, self.order
        image.update(inputs)
        uneventful = self._is_uneventful(image)
        if uneventful and self._was_uneventful:
            self._watch_motion(image)
        else:
            self._supervise_all(image, order)
        self._was_uneventful = uneventful
        if self.probes.requests:
            self.probes.step(image, order)
        order.halt = self.halted
        stopping, activity = self.stopping, self.running.activity
        if stopping.stop_sequence is None and activity is not None:
            self._step_activity(activity, image, order)
        elif stopping.stop_sequence is None:
            self.running.finish_handshake(image, order)
        # In the same cycle, because a cycle without a target causes a jolt in a cyclic mode.
        if stopping.stop_sequence is not None:
            self._step_stop_sequence(stopping.stop_sequence, image, order)
        self.halted = order.halt
        if order.target_position is None:
            if image.mode in WITHOUT_TARGET_POSITION:
                self._preload_target_position(image, order)
        elif self.state is _SYNCHRONIZED:
            self.last_target = order.target_position
        is_edge = bool(order.bits & cw.NEW_SET_POINT)
        if (
            is_edge or order.target_velocity or order.target_torque
        ):  # a target in csp pulls as long as the axis has not reached it
            self.stopping.motion_requested_at = image.now
        image.reference_tracker.note(
            image.now, image.mode, image.shown_demand, order.target_position, is_edge
        )
        if image.override == 0.0 or order.halt:
            image.reference_tracker.postpone_set_point(image.now)
        if self.forward is not None:
            order.velocity_offset, order.torque_offset = offsets_of(self, self.forward)
        outputs = order.outputs(image.state)
        if outputs.controlword != image.flight.word or outputs.mode is not None:
            image.flight.note(outputs, image.now)
        # Now, not at the start: requests that a command cancels between two cycles are sent with the next one.
        order.clear()
        self._fast_path = fast_path_of(self) if uneventful and self.state is _SYNCHRONIZED else None
        return outputs

    def may_use_fast_path(self) -> bool:
        """Whether a cycle after an uneventful one may be uneventful, as far as others may change the axis between two cycles."""
        return (
            self.powered
            and self.touched
            and not self.halted
            and self.order.goal is _ENABLED
            and self.tripped is None
            and self._broken is None
            and self._fault_diagnosis is None
            and not self.probes.requests
        )

    def _is_uneventful(self, image: AxisImage) -> bool:
        """Whether the drive is enabled, fresh and requested to stay enabled, and the axis only executes a motion or rests."""
        return (
            image.state is _ENABLED
            and image.operational
            and self.powered
            and self.touched
            and self.order.goal is _ENABLED
            and self.state in POWERED
            and self.stopping.stop_sequence is None
            and image.gap <= self.supervision.longest_gap
            and not (
                image.lost_count or image.emcy or self.standstill_waiters.waiting or self.stopping.has_resets
            )
            and self.tripped is None
            and self._broken is None
            and self._fault_diagnosis is None
        )

    def _watch_motion(self, image: AxisImage) -> None:
        """Do the part of ``_supervise_all`` that an uneventful cycle after an uneventful one requires.

        The other checks would repeat their last result: ``history`` and ``coast_down`` the same state, ``_supervise`` an unchanged
        node and drive, ``_prevent_reenable`` a drive in its requested state. No fault is being diagnosed, and no command waits for
        standstill.
        """
        supervision = self.supervision
        supervision.guard.look(image)
        bounded = self.homed or not self._needs_homing
        finding = supervision.motion(image, self.state, self.running.activity, bounded)
        if finding is not None:
            self._act_on(finding)

    def _supervise_all(self, image: AxisImage, order: CycleOutputs) -> None:
        self.tripped, self._broken = self._broken, None
        if image.loss is not None:
            self.forget(image.loss)
            image.loss = None
        self.history.note(image)
        self.coast_down.look(image, self.touched)
        self._supervise(image)
        # Otherwise the drive is in its requested state.
        if image.state is not _ENABLED or order.goal is not _ENABLED:
            self._prevent_reenable(image)
        if self._fault_diagnosis is not None:
            self._step_fault_diagnosis(self._fault_diagnosis, image, order)
        if self.standstill_waiters.waiting and self.active_source is None:
            self.standstill_waiters.step(image, self.finish)
        if self.stopping.has_resets and self.stop_sequence is None:
            self.stopping.begin_resets()

    def _preload_target_position(self, image: AxisImage, order: CycleOutputs) -> None:
        """Set 607Ah to the actual position: a drive that falls from a velocity or torque into a position mode moves to 607Ah."""
        if self._sends_target_by_sync and self.touched and image.state is _ENABLED:
            order.target_position = image.position

    def snapshot(self) -> Snapshot:
        """Return the values of this axis for other threads."""
        image = self.image
        values = (
            image.now,
            self.state,
            image.state,
            image.statusword,
            image.mode,
            image.position,
            image.position_stamp,
            image.shown_demand,
            image.velocity,
            image.torque,
            self.last_target,
            image.origin,
            self.homed,
            image.operational,
            self.error,
            self.override.own,
            self.override.cell,
            self.probes.latched,
            image.demand is not None,
        )
        return _tuple(Snapshot, values)

    def _end_because(self, error: AxisbusError) -> None:
        self.abandon(lambda name: StateError(f"{name} was ended: {error.message}"))

    def abandon(self, ended: Callable[[str], AxisbusError]) -> None:
        """End every ticket, with the error that ``ended`` creates for its name: the scan has ended."""
        tickets = self.stopping.drop() + self.stopping.drop_resets()
        tickets += self.standstill_waiters.drop()
        tickets += self.probes.drop()
        if self._fault_diagnosis is not None:
            tickets += self._fault_diagnosis.tickets
        tickets += [each for each in (self.running.ticket, self.running.addition_ticket) if each is not None]
        self.queue.drop(self._command_name, None)
        for ticket in tickets:
            self.finish(ticket, ended(ticket.name))

    # -- unexpected events -------------------------------------------------------------------------------------------

    def _supervise(self, image: AxisImage) -> None:
        supervision, stop_sequence = self.supervision, self.stopping.stop_sequence
        if not image.operational and (image.restarted or supervision.has_restarted(image)):
            self.homed = False
            if not self._has_restarted:
                self.forget(Loss.COUNT)
            self._has_restarted = True
            image.restart()
        elif image.operational:
            self._has_restarted = False
        if image.lost_count:
            self.forget_position()
        finding = supervision.node(image)
        if finding is None and image.state in _FAULTS:
            if self._fault_diagnosis is None and self.state is not _ERRORSTOP:
                self._fault(image)
            self._watch_fault_reaction(image)
            return
        halts_at_rest = (
            stop_sequence is not None and stop_sequence.level in _HELD and self.state is AxisState.STANDSTILL
        )
        if not self.powered or (stop_sequence is not None and not halts_at_rest):
            supervision.at_work()
        if finding is None and self.powered and stop_sequence is None:
            finding = supervision.power(image, self.state, self.running.activity, bounded=self.bounded)
        elif finding is None and stop_sequence is not None:
            # The stop may have begun after the power was to be removed.
            finding = supervision.coasting(image, stop_sequence.level, bounded=self.bounded)
            # An axis that was at standstill but moves does not wait for the halt's time. Without power its rest starts again above.
            if finding is None and halts_at_rest:
                finding = supervision.unrest(image, None)
        elif finding is None and self.touched and self.state is AxisState.DISABLED:
            taken = supervision.energised(image, at_work=self.activity is not None)
            if taken is not None:  # ``order.goal`` takes it out of operation again, as gently as any disable
                self._trip(taken)
        if finding is not None:
            self._act_on(finding)
        elif not self.touched and self.error is None:
            self._adopt_shown_state(image)

    def _watch_fault_reaction(self, image: AxisImage) -> None:
        """React to a drive in fault that does not stop its motor: remove its power; the node's stop is the last step."""
        error = self._fault_reaction.error(image, self.coast_down, self.touched)
        if error is None:
            return
        self._trip(error)
        if image.state is PowerState.FAULT_REACTION_ACTIVE and self.stop_sequence is None:
            self._stop(StopKind.ERROR, AfterStop.HOLD, StopLevel.DISABLE_VOLTAGE, error.message)

    def _adopt_shown_state(self, image: AxisImage) -> None:
        """Set the axis's state to the state that the drive shows, for a drive that this master has not commanded yet."""
        if image.state is _UNKNOWN:
            return
        if image.state not in ENERGISED:
            self.state = AxisState.DISABLED
        else:
            self.state = AxisState.STANDSTILL if image.standstill else AxisState.CONTINUOUS_MOTION

    def _prevent_reenable(self, image: AxisImage) -> None:
        """Do not request again a state that the drive has left on its own; only a running enable may do so."""
        if image.state is not _ENABLED:
            # A set-point that the drive had taken, or begun to take, is void.
            self.running.set_point = image.reference_tracker.taken = None
        goal = self.order.goal
        if image.state is goal or goal not in ENERGISED or isinstance(self.activity, EnableActivity):
            return
        if image.state not in _MAY_BE_ENERGISED:
            self.order.goal = PowerState.SWITCH_ON_DISABLED
            self.powered = False
        elif image.state is PowerState.QUICK_STOP_ACTIVE:
            self.order.goal = image.state

    # -- failure -----------------------------------------------------------------------------------------------------

    def fail(self, error: AxisbusError, level: StopLevel = StopLevel.HALT, *, along: bool = True) -> None:
        """Go to ErrorStop because of ``error``, and stop the axis from ``level`` on; ``along``: a halt may brake along its path."""
        self._trip(error)
        enrich(error, self.image, self.history)
        activity = self.activity if along else None
        self.end_command(error)
        if self.touched and self.image.state in _MAY_BE_ENERGISED:
            self._stop(StopKind.ERROR, AfterStop.HOLD, level, error.message, ended_activity=activity)
            return
        self.powered = False
        if self.order.goal is not None:
            self.order.goal = PowerState.SWITCH_ON_DISABLED

    def break_off(self, error: AxisbusError) -> None:
        """Fail for a reason that was found between two cycles and that ends the running motion; stop as hard as necessary."""
        self._activity_failed(error)
        self._broken = self.tripped

    def stop_for_second_master(self, error: SecondMasterError) -> None:
        """Stop the drive because another master commands it (found between two cycles), if this master has ever commanded it.

        If the drive has power that this master has not asked for, the other master has enabled it again: the drive must take no
        RPDO from any master. So its node leaves operational, unless a load may hang on the motor.
        """
        if not self.touched:
            return
        if self.stop_sequence is not None and self.state is _ERRORSTOP:
            if self.stop_sequence.level >= StopLevel.QUICK_STOP:
                return
            level = StopLevel.QUICK_STOP
        elif self.state is not _ERRORSTOP or self.powered:
            level = StopLevel.QUICK_STOP
        elif self.image.state is _ENABLED:
            level = StopLevel.NMT_STOP if self.parameters.holds_load is HoldsLoad.NO else StopLevel.QUICK_STOP
        else:
            return
        self.fail(error, level, along=False)
        self._broken = self.tripped

    @property
    def _command_name(self) -> str:
        """The name of the running motion, for the user."""
        ran = self.running.ticket
        return ran.name if ran is not None else f"{self.parameters.name}'s motion"

    def _trip(self, error: AxisbusError) -> None:
        """Go to ErrorStop. A later error is added to the first reason, and its remedy comes first."""
        if self.error is None or self.state is not AxisState.ERRORSTOP:
            self.error = error
        elif error.message not in f"{self.error.message}{self.error.observed}":
            self.error.observed = chained(self.error.observed, f"{error.message} ({error.observed})")
            self.error.remedy = join_remedies(error.remedy, self.error.remedy)
        self.state = AxisState.ERRORSTOP
        self.tripped = error
        self._end_resets(error)

    def _end_resets(self, error: AxisbusError) -> None:
        """End the waiting resets: they were requested before ``error``."""
        for ticket in self.stopping.drop_resets():
            self.finish(ticket, error)

    def _fault(self, image: AxisImage) -> None:
        """React to a fault of the drive: request nothing more, diagnose the fault, then report it."""
        diagnosis = FaultDiagnosis(self.parameters, image.now)
        doing, ticket, addition = (
            self._command_name,
            self.running.drop(self.order),
            self.running.take_addition(),
        )
        self._drop_waiting(doing, None)
        if addition is not None:
            diagnosis.tickets.append(addition)
        if ticket is not None:
            diagnosis.doing = f" during {ticket.name}" if ticket.busy else ""
            diagnosis.tickets.append(ticket)
        diagnosis.tickets += self.stopping.drop_resets()
        self._fault_diagnosis = diagnosis
        # It came from an earlier stop sequence: the drive itself brakes now, or coasts.
        self._stop_confirmed = False
        self._trip(diagnosis.fault_error(image, self.history))
        diagnosis.tickets += self.stopping.drop()
        self.powered = False
        if self.touched:
            self.order.goal = PowerState.SWITCH_ON_DISABLED

    def _step_fault_diagnosis(self, diagnosis: FaultDiagnosis, image: AxisImage, order: CycleOutputs) -> None:
        if not diagnosis.step(image, order):
            return
        error = diagnosis.fault_error(image, self.history)
        self._fault_diagnosis = None
        if self.state is AxisState.ERRORSTOP:
            self.error = error
        for ticket in diagnosis.tickets:
            self.finish(ticket, error)

    # -- commands and their ends -------------------------------------------------------------------------------------

    def begin(self, activity: Activity, ticket: CommandStatus, state: AxisState | None = None) -> None:
        """Begin ``activity``; the running command, or the halt, ends as replaced."""
        self.end_command(Replaced(f"{self._command_name} was replaced by {ticket.name}"))
        if self.stop_sequence is not None:
            self._end_stop(Replaced(f"{self.stopping.name} was replaced by {ticket.name}"))
        self.touched = True
        self._stop_confirmed = False
        self.stopping.power_note = ""
        if activity.mode is ModeOfOperation.HOMING:
            self.forget_position()  # until it is done
            why = f"was ended by {ticket.name}, after which the drive counts its positions from the new home"
            self.probes.end_all(Replaced, why, self.order, "give it again when the axis is homed")
        self.running.begin(activity, ticket)
        self._arrival.begin(activity, self.image.now)
        if state is not None:
            self.state = state

    def continue_with(self, ticket: CommandStatus) -> None:
        """Continue the running activity for another command, which it has already received; the previous one ends as replaced."""
        doing, before = self._command_name, self.running.ticket
        error = Replaced(f"{doing} was replaced by {ticket.name}")
        self.running.ticket = ticket
        ticket.begin()
        if before is not None:
            self.finish(before, error)
        self._drop_waiting(doing, error)

    def aim(self, target: int | None) -> None:
        """Record the target of the motion that has begun, in increments of the drive; None: it has no target position."""
        self.last_target = target

    def set_override(self, own: float | None = None, cell: float | None = None) -> None:
        """Set another override: of the axis, or of its cell. The running command applies it in its next cycle."""
        if own is not None:
            self.override.set_own(own)
        if cell is not None:
            self.override.set_cell(cell)
        self.image.override = self.override.factor
        if self.activity is not None:
            self.activity.override(self.image)
        self._fast_path = None  # the next cycle needs the whole step

    def coast(self, coast: Activity, ticket: CommandStatus) -> None:
        """Let ``coast`` remove the power: from now on this master does not power the motor."""
        self.powered = False
        self.begin(coast, ticket)
        if self.state is not AxisState.ERRORSTOP:
            self.state = AxisState.DISABLED

    def unlock(self) -> None:
        """End the lock of a stop, if the drive is in *operation enabled*."""
        if self.image.state is _ENABLED:
            self.state = AxisState.STANDSTILL

    def confirm_position(self, origin: int) -> None:
        """Count positions from ``origin`` (increments of the drive): the position is confirmed."""
        self.image.origin = origin
        self.last_target = None  # it had the old origin
        self.homed = True
        self._confirmed_origin = origin

    def forget(self, loss: Loss) -> None:
        """Discard the values that ``loss`` makes void; this is the only list of them, and a test checks all attributes of an axis.

        A command that ends leaves nothing else behind: an activity holds its own state, which ends with it.
        """
        image, reference_tracker = self.image, self.image.reference_tracker
        self.running.set_point = None
        reference_tracker.drop_set_point()
        if loss >= Loss.POWER:
            reference_tracker.forget(image.now)
            self.last_target = None
            self.stopping.motion_requested_at = -math.inf
            self.supervision.forget()
        if loss >= Loss.COUNT:
            image.recount()
            self.supervision.guard.forget()

    def forget_position(self) -> None:
        """Mark the position as not confirmed, until it has been determined again."""
        self.homed = False
        self._confirmed_origin = None

    def join(self, ticket: CommandStatus) -> None:
        """Let ``ticket`` end with the running command: the same command was requested again."""
        self.running.join(ticket)

    def end_command(self, error: AxisbusError | None) -> None:
        """End the running command, and the commands that wait for its end; an unfinished set-point handshake remains."""
        doing = self._command_name
        ticket, addition = self.running.drop(self.order), self.running.take_addition()
        if ticket is not None:
            self.finish(ticket, error)
        if addition is not None:
            self.finish(addition, copy(error))
        self._drop_waiting(doing, error)

    def _drop_waiting(self, before: str, error: AxisbusError | None) -> None:
        """End the commands that wait for the end of ``before``, which has not ended successfully."""
        if self.queue and self.queue.drop(before, error):
            self.running.ended = True

    def at_rest(self, ticket: CommandStatus, then: Callable[[], None]) -> None:
        """Call ``then`` at standstill: now, if the axis is seen at standstill and not on a path, else as soon as this is so."""
        image = self.image
        at_standstill = image.standstill and image.now - image.position_stamp <= _NOW
        if at_standstill and not self.coast_down.under_way and self.active_source is None:
            then()
            self.finish(ticket)
        else:
            self.standstill_waiters.add(ticket, then)

    def finish(self, ticket: CommandStatus, error: AxisbusError | None = None) -> None:
        """End a ticket, successfully (no error) or with the reason."""
        self.running.finish(ticket, error)

    def _step_activity(self, activity: Activity, image: AxisImage, order: CycleOutputs) -> None:
        if self.running.set_point is not None and not isinstance(activity, PositionMove):
            self.running.set_point = None  # bit 4 has another meaning in another mode
        try:
            done = activity.step(image, order)
            seen_later = (
                image.position is not None and image.position_stamp <= image.now == activity.rests_from
            )
            if done or not seen_later:
                done = self._arrival.complete(activity, done, image)
            # Otherwise the axis still moves: the check for standstill starts again after this cycle, with the values received then.
        except Exception as error:  # noqa: BLE001  # any exception ends this command and stops this axis
            self._activity_failed(broken(error, self._command_name))
            return
        if self.running.addition is not None and self.running.addition.over:
            self._addition_ended(self.running.addition)
        if done and self.running.ticket is not None and self.running.ticket.busy:
            self._completed(activity)
            self.queue.next()

    def _addition_ended(self, addition: Addition) -> None:
        """End a superimposed distance: the path continues, displaced by it."""
        ticket = self.running.take_addition()
        if self.state is not _SYNCHRONIZED and self.last_target is not None:
            self.last_target += self.parameters.units.position.to_increments(addition.value)
        if ticket is not None:
            self.finish(ticket, addition.error)

    def _completed(self, activity: Activity) -> None:
        """Set the state that follows an activity that has ended successfully."""
        ticket, self.running.ticket = self.running.ticket, None
        if ticket is not None:
            self.finish(ticket)
        if activity.keeps_moving:
            return  # until another command follows
        self.running.activity = None
        if activity.clears_error:
            self.supervision.lost = False  # a node that is still lost, or lost again, is reported again
        if activity.mode is ModeOfOperation.HOMING:
            self._homed()
        if self.state is AxisState.ERRORSTOP and not activity.clears_error:
            self.powered = False
        else:
            self._settle()

    def _settle(self) -> None:
        """Set the state that the power stage shows, after a command that has ended successfully."""
        image = self.image
        self.error = None
        in_quick_stop = image.state is PowerState.QUICK_STOP_ACTIVE
        self.powered = (
            image.state is PowerState.OPERATION_ENABLED and self.order.goal is image.state
        ) or in_quick_stop
        if in_quick_stop:
            self.state = AxisState.STOPPING
        else:
            self.state = AxisState.STANDSTILL if self.powered else AxisState.DISABLED

    def clear_error(self) -> None:
        """Leave ErrorStop, if the drive itself is not in fault; this moves nothing."""
        if self.state is AxisState.ERRORSTOP:
            self.supervision.lost = False
            self._settle()

    def _homed(self) -> None:
        self.confirm_position(origin=0)
        self.image.rebase()
        self.forget(Loss.COUNT)

    def _act_on(self, finding: StopDemand) -> None:
        if finding.halts:
            self._end_in_halt(finding.error)
        else:
            self.fail(finding.error, finding.level, along=finding.along)

    def _end_in_halt(self, error: AxisbusError) -> None:
        """Halt the axis because its command ends by its own rule, as a jog does, or could not begin."""
        activity = self.activity
        self.end_command(error)
        self._stop(StopKind.HALT, AfterStop.HOLD, StopLevel.HALT, error.message, ended_activity=activity)

    def _activity_failed(self, error: AxisbusError) -> None:
        activity = self.activity
        if isinstance(error, Interrupted) or (activity is not None and activity.refused):
            self._end_in_halt(error)
            return
        resetting = self.activity is not None and self.activity.clears_error
        along = isinstance(self.activity, Follow) and self.activity.brakes_along
        # The trajectory still commands the axis: the axis is only late.
        if along or isinstance(error, MotionTimeout):
            self.fail(error, StopLevel.HALT)
            return
        uncontrolled = self._runs_on_targets or isinstance(error, UncommandedMotion)
        self.fail(error, StopLevel.QUICK_STOP if uncontrolled else StopLevel.HALT)
        if resetting:
            # The failure itself has been reported; that it persists is no reason to stop other axes again.
            self.tripped = None

    @property
    def _runs_on_targets(self) -> bool:
        """Whether the axis moves from target to target: without a next target it jolts, and only a quick stop is a ramp."""
        if isinstance(self.activity, Follow):
            return not self.activity.at_rest
        return self.image.mode == Follow.mode and not self.image.standstill

    # -- stopping ----------------------------------------------------------------------------------------------------

    def stop_because(
        self, kind: StopKind, then: AfterStop, level: StopLevel, reason: str, ticket: CommandStatus | None
    ) -> None:
        """Stop the axis: the running command ends with ``reason``; the axis brakes along the path of its trajectory."""
        activity = self.activity
        self.end_command(Stopped(reason, remedy=REMEDIES.get(kind, "")))
        if kind in _LASTING:
            self._end_resets(Stopped(reason))
        self._stop(kind, then, level, reason, ticket, activity)
        if kind in _LOCKING and self.state is not AxisState.ERRORSTOP:
            self.state = AxisState.STOPPING

    def _stop(
        self,
        kind: StopKind,
        then: AfterStop,
        level: StopLevel,
        reason: str,
        ticket: CommandStatus | None = None,
        ended_activity: Activity | None = None,
    ) -> None:
        """``ended_activity``: the command that has just ended; the axis brakes along the trajectory of this command."""
        if kind is not StopKind.HALT and self.active_path is not None:
            self.active_path.brake_hard()
        self.stopping.ask(kind, then, level, reason, ticket, ended_activity)
        self.touched = True

    def _step_stop_sequence(self, stop_sequence: StopSequence, image: AxisImage, order: CycleOutputs) -> None:
        if stop_sequence.level is StopLevel.HALT:
            self.running.finish_handshake(image, order)
        ended = stop_sequence.step(image, order, self.coast_down)
        if self.state is AxisState.STANDSTILL and stop_sequence.seen not in _MAY_BE_ENERGISED:
            self.state = AxisState.DISABLED  # it may turn without power, so the stop waits for it
        elif self.state is AxisState.STANDSTILL and stop_sequence.statusword_missing:
            self.state = AxisState.STOPPING  # its standstill can no longer be seen
        if ended:
            self._stopped(stop_sequence, image)

    def _stopped(self, stop_sequence: StopSequence, image: AxisImage) -> None:
        seen = (
            stop_sequence.seen if image.state is PowerState.UNKNOWN else image.state
        )  # by SDO, if no PDO brings the state
        self.powered = stop_sequence.confirmed and seen in ENERGISED
        self._stop_confirmed = stop_sequence.confirmed
        self.last_target = image.reference if self.powered else None  # without power it may be turned by hand
        error = stop_error(stop_sequence, self.parameters.name)
        if error is not None:
            self._trip(error)
            enrich(error, image, self.history)
        elif self.state is not AxisState.ERRORSTOP:
            self.state = self._state_after_stop(seen)
            self.stopping.power_note = power_note(self.stopping)
        self._end_stop(error)

    def _state_after_stop(self, seen: PowerState) -> AxisState:
        """Return the axis state after a stop that has ``seen`` its drive in this state, by PDO or by SDO."""
        if seen not in ENERGISED:
            return AxisState.DISABLED
        locked = self.stopping.locks or seen is PowerState.QUICK_STOP_ACTIVE
        return AxisState.STOPPING if locked else AxisState.STANDSTILL

    def _end_stop(self, error: AxisbusError | None) -> None:
        note = (
            ""
            if self.stop_sequence is None
            else self.stop_sequence.weaker_evidence or self.stopping.power_note
        )
        for ticket in self.stopping.drop():
            ticket.note = note
            self.finish(ticket, error)
