"""One axis as a pure step function: commands and inputs in, outputs out (PLCopen's axis over CiA 402).

Theory of operation
-------------------
In each cycle ``step`` does four things, in this order:

1. ``AxisImage`` decodes the inputs; what is too old is unknown.
2. ``Supervision`` looks for what nobody asked for: node lost, fault, power stage dropped, statusword gone, limits in danger.
   Each ends in ``fail``: state ErrorStop, stop ladder, the command's ticket ends with the reason.
3. The running activity is stepped, or the stop ladder if there is one (also when the activity has just failed); without either
   the last targets hold.
4. ``CycleOutputs`` turns the wishes into ``Outputs``.

In a *calm* cycle after a calm one (``_is_calm``) only the watches over motion and rest are done of 2.: they alone look at what
changes from cycle to cycle. The others would find what they found in the cycle before, and note nothing new. Where an axis then
goes on along its trajectory and nothing else is going on, all of the cycle is done by one function (``cruise``).

Nothing is sent to a drive before a command asks for something (``CycleOutputs.goal`` is None until then): a drive found enabled is
left as it is. Once enabled by us, a drive that leaves *operation enabled* is never enabled again by the planner, whatever state the
axis is in (``_let_go``): that takes a new command.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy

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
    Stopped,
    UncommandedMotion,
)
from axisbus.motion.axis.active_command import ActiveCommand
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.fast_path import FastPath, cruise_of
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.axis.loss import Loss
from axisbus.motion.axis.queue import Queue
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.cyclic.ramps import VelocityRamp
from axisbus.motion.feed_forward.activation import forward_of, offsets_of
from axisbus.motion.jerk.drive_profile_type import ProfileType
from axisbus.motion.modes import WITHOUT_TARGET_POSITION
from axisbus.motion.moves.activity import Activity
from axisbus.motion.moves.arrival import ArrivalCheck
from axisbus.motion.moves.enable import EnableActivity
from axisbus.motion.moves.follow import Follow
from axisbus.motion.moves.position import PositionMove
from axisbus.motion.override.factor import Override
from axisbus.motion.parameters import AxisParameters, HoldsLoad
from axisbus.motion.probing.probes import Probes
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState
from axisbus.motion.stop.active_stop import REMEDIES, StopKind, Stopping, stop_error
from axisbus.motion.stop.coast_down import CoastDown
from axisbus.motion.stop.diagnosis import DriveHistory, FaultDiagnosis, chained, enrich, join_remedies
from axisbus.motion.stop.fault_reaction import FaultReaction
from axisbus.motion.stop.standstill_wait import StandstillWaiters
from axisbus.motion.stop.stop_sequence import AfterStop, StopLevel, StopSequence
from axisbus.motion.stop.supervision import POWERED, StopDemand, Supervision
from axisbus.motion.superimposed.addition import Addition
from axisbus.motion.user_code_errors import broken

_ENABLED, _UNKNOWN = PowerState.OPERATION_ENABLED, PowerState.UNKNOWN
_ERRORSTOP, _SYNCHRONIZED = AxisState.ERRORSTOP, AxisState.SYNCHRONIZED_MOTION
_FAULTS = frozenset({PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE})
_LOCKING = frozenset({StopKind.STOP, StopKind.QUICK_STOP})
_LASTING = _LOCKING | {StopKind.SHUTDOWN}  # a reset that was asked for before does not end these
_HELD = frozenset(
    {StopLevel.HALT, StopLevel.QUICK_STOP}
)  # on which a drive holds an axis that stood when it was stopped
_NOW = 0.1  # seconds: a position not older than that is of now
_MAY_BE_ENERGISED = ENERGISED | {_UNKNOWN}
_tuple = tuple.__new__  # makes a named tuple of what is known to fit, without the call of its own ``__new__``


class AxisCore:
    """State and behaviour of one axis; every public attribute is read-only to others.

    ``state`` is PLCopen's; ``error`` says why it is ErrorStop. ``touched``: this program has commanded the drive, so the way out
    stops it. ``powered``: an enable of ours has succeeded and power has not been taken away since.
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
        self.run_down = CoastDown(parameters)
        self.state = AxisState.DISABLED
        self.error: AxisbusError | None = None
        self.homed = False
        self._needs_homing = parameters.homing.required
        self.powered = False
        self.touched = False
        self.tripped: AxisbusError | None = None  # set for one cycle: the fault policy reads it
        self.running = ActiveCommand()
        self.queue = Queue()
        self.forward = forward_of(parameters)
        self.probes = Probes(parameters, self.running)
        self.last_target: int | None = None
        self.halted = False
        self._broken: AxisbusError | None = None  # what has tripped it between two cycles
        self._story: FaultDiagnosis | None = None
        self._arrival = ArrivalCheck(parameters)
        self._aftermath = FaultReaction(parameters)
        self.rest_waits = StandstillWaiters(parameters)
        self._has_restarted = False  # since its node was operational
        self._keeps_target = capabilities.outputs.get("target_position") is ValueTransport.SYNC_PDO
        self._stopped_for_sure = False
        self._was_calm = False  # in the cycle before
        self._cruise: FastPath | None = (
            None  # as long as it goes on along a trajectory, with nothing else to be done
        )

    @property
    def activity(self) -> Activity | None:
        """What moves the axis, or brings it into another state; None when nothing does."""
        return self.running.activity

    @property
    def ladder(self) -> StopSequence | None:
        """The stop ladder that runs, if any."""
        return self.stopping.ladder

    @property
    def leading_path(self) -> Follow | None:
        """The trajectory that the axis is on: followed, or being braked along by a halt that may be interrupted."""
        return follow if isinstance(follow := self.led_along, Follow) else None

    @property
    def led_along(self) -> Follow | VelocityRamp | None:
        """The same, or the ramp of csv: what must lead the axis on until another mode has taken over."""
        running = None if self.activity is None else self.activity.leading
        follow = running if self.ladder is None else self.ladder.follow
        return follow if isinstance(follow, (Follow, VelocityRamp)) and not follow.at_rest else None

    @property
    def rests(self) -> bool:
        """Whether the drive may be left alone: it never was commanded, is not driven, or is known to have been stopped."""
        return not self.touched or self.image.state not in _MAY_BE_ENERGISED or self._stopped_for_sure

    @property
    def stopped_for_sure(self) -> bool:
        """Whether the last stop ladder has seen the axis stopped, and nothing has set it going since."""
        return self._stopped_for_sure

    @property
    def may_be_switched_on(self) -> bool:
        """Whether an enable is under way, or a word that was sent may still switch the drive on after it was seen off."""
        if not self.touched or self.image.state in _FAULTS:
            return False
        return isinstance(self.activity, EnableActivity) or self.image.flight.may_enable(self.image.now)

    @property
    def disobeyed(self) -> bool:
        """Whether its drive drives the motor still, in another state than it was asked for; *quick stop active* holds it."""
        state, goal = self.image.state, self.order.goal
        drives = state in ENERGISED and state is not PowerState.QUICK_STOP_ACTIVE
        return self.touched and drives and goal is not None and goal is not state

    @property
    def bounded(self) -> bool:
        """Whether the position limits hold: where homing is required they promise nothing before it."""
        return self.homed or not self._needs_homing

    # -- one cycle ---------------------------------------------------------------------------------------------------

    def step(self, inputs: Inputs) -> Outputs:
        """Do one cycle's work and return what the drive is to get."""
        if self._cruise is not None:
            outputs = self._cruise.step(inputs)
            if outputs is not None:
                return outputs
        image, order = self.image, self.order
        image.update(inputs)
        calm = self._is_calm(image)
        if calm and self._was_calm:
            self._watch_motion(image)
        else:
            self._look_at_all(image, order)
        self._was_calm = calm
        if self.probes.requests:
            self.probes.step(image, order)
        order.halt = self.halted
        stopping, activity = self.stopping, self.running.activity
        if stopping.ladder is None and activity is not None:
            self._step_activity(activity, image, order)
        elif stopping.ladder is None:
            self.running.finish_handshake(image, order)
        if stopping.ladder is not None:  # in the same cycle: in a cyclic mode one without a target is a jolt
            self._step_ladder(stopping.ladder, image, order)
        self.halted = order.halt
        if order.target_position is None:
            if image.mode in WITHOUT_TARGET_POSITION:
                self._leave_no_old_target(image, order)
        elif self.state is _SYNCHRONIZED:
            self.last_target = order.target_position
        is_edge = bool(order.bits & cw.NEW_SET_POINT)
        if (
            is_edge or order.target_velocity or order.target_torque
        ):  # a target in csp pulls as long as the axis is not there
            self.stopping.set_going_at = image.now
        image.led.note(image.now, image.mode, image.shown_demand, order.target_position, is_edge)
        if image.override == 0.0:
            image.led.hold_back(image.now)
        if self.forward is not None:
            order.velocity_offset, order.torque_offset = offsets_of(self, self.forward)
        outputs = order.outputs(image.state)
        if outputs.controlword != image.flight.word or outputs.mode is not None:
            image.flight.note(outputs, image.now)
        order.clear()  # now, not at the start: what a command takes back between two cycles goes out with the next
        self._cruise = cruise_of(self) if calm and self.state is _SYNCHRONIZED else None
        return outputs

    def may_cruise(self) -> bool:
        """Whether the axis, calm in the cycle before, is still so as far as others may change it between two cycles."""
        return (
            self.powered
            and self.touched
            and not self.halted
            and self.order.goal is _ENABLED
            and self.tripped is None
            and self._broken is None
            and self._story is None
            and not self.probes.requests
        )

    def _is_calm(self, image: AxisImage) -> bool:
        """Whether the drive is enabled, heard and asked to stay so, and nothing but a command's motion or a rest is going on."""
        return (
            image.state is _ENABLED
            and image.operational
            and self.powered
            and self.touched
            and self.order.goal is _ENABLED
            and self.state in POWERED
            and self.stopping.ladder is None
            and image.gap <= self.supervision.longest_gap
            and not (image.lost_count or image.emcy or self.rest_waits.waiting or self.stopping.has_resets)
            and self.tripped is None
            and self._broken is None
            and self._story is None
        )

    def _watch_motion(self, image: AxisImage) -> None:
        """What is left of ``_look_at_all`` in a cycle that is calm as the one before was.

        The others would find what they found then: ``history`` and ``run_down`` the same state, ``_supervise`` a node and a drive
        in which nothing has changed, ``_let_go`` a drive that is where it was asked to be; no story is told, and nobody waits.
        """
        supervision = self.supervision
        supervision.guard.look(image)
        bounded = self.homed or not self._needs_homing
        finding = supervision.motion(image, self.state, self.running.activity, bounded)
        if finding is not None:
            self._act_on(finding)

    def _look_at_all(self, image: AxisImage, order: CycleOutputs) -> None:
        self.tripped, self._broken = self._broken, None
        if image.loss is not None:
            self.forget(image.loss)
            image.loss = None
        self.history.note(image)
        self.run_down.look(image, self.touched)
        self._supervise(image)
        if image.state is not _ENABLED or order.goal is not _ENABLED:  # else it is where it was asked to be
            self._let_go(image)
        if self._story is not None:
            self._step_story(self._story, image, order)
        if self.rest_waits.waiting and self.led_along is None:
            self.rest_waits.step(image, self.finish)
        if self.stopping.has_resets and self.ladder is None:
            self.stopping.begin_resets()

    def _leave_no_old_target(self, image: AxisImage, order: CycleOutputs) -> None:
        """A drive that falls from a velocity or torque mode into a position mode goes to its 607Ah: that is where it is now."""
        if self._keeps_target and self.touched and image.state is _ENABLED:
            order.target_position = image.position

    def snapshot(self) -> Snapshot:
        """Return what other threads may see of this axis."""
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

    def abandon(self, ended: Callable[[str], AxisbusError]) -> None:
        """End every ticket, with the error that ``ended`` makes for its name: the scan has ended."""
        tickets = self.stopping.drop() + self.stopping.drop_resets()
        tickets += self.rest_waits.drop()
        tickets += self.probes.drop()
        if self._story is not None:
            tickets += self._story.tickets
        tickets += [each for each in (self.running.ticket, self.running.addition_ticket) if each is not None]
        self.queue.drop(self._doing, None)
        for ticket in tickets:
            self.finish(ticket, ended(ticket.name))

    # -- what nobody asked for ---------------------------------------------------------------------------------------

    def _supervise(self, image: AxisImage) -> None:
        supervision, ladder = self.supervision, self.stopping.ladder
        if not image.operational and (image.restarted or supervision.has_restarted(image)):
            self.homed = False
            if not self._has_restarted:
                self.forget(Loss.COUNT)
            self._has_restarted = True
            image.restart()
        elif image.operational:
            self._has_restarted = False
        if image.lost_count:
            self.homed = False
        finding = supervision.node(image)
        if finding is None and image.state in _FAULTS:
            if self._story is None and self.state is not _ERRORSTOP:
                self._fault(image)
            self._look_after_fault(image)
            return
        halts_at_rest = ladder is not None and ladder.rung in _HELD and self.state is AxisState.STANDSTILL
        if not self.powered or (ladder is not None and not halts_at_rest):
            supervision.at_work()
        if finding is None and self.powered and ladder is None:
            finding = supervision.power(image, self.state, self.running.activity, bounded=self.bounded)
        elif finding is None and ladder is not None:  # which may have been begun after its power was to go
            finding = supervision.coasting(image, ladder.rung, bounded=self.bounded)
            # One that stood, and moves nevertheless, is not left to the halt's time; without power its rest begins anew above.
            if finding is None and halts_at_rest:
                finding = supervision.unrest(image, None)
        elif finding is None and self.touched and self.state is AxisState.DISABLED:
            taken = supervision.energised(image, at_work=self.activity is not None)
            if (
                taken is not None
            ):  # it is taken out of operation again as gently as any disable: by ``order.goal``
                self._trip(taken)
        if finding is not None:
            self._act_on(finding)
        elif not self.touched and self.error is None:
            self._show_found(image)

    def _look_after_fault(self, image: AxisImage) -> None:
        """A drive in fault stops its motor by itself; where it does not, what is left is its power and its node."""
        error = self._aftermath.error(image, self.run_down, self.touched)
        if error is None:
            return
        self._trip(error)
        if image.state is PowerState.FAULT_REACTION_ACTIVE and self.ladder is None:
            self._stop(StopKind.ERROR, AfterStop.HOLD, StopLevel.DISABLE_VOLTAGE, error.message)

    def _show_found(self, image: AxisImage) -> None:
        """A drive that nobody has commanded yet: its axis is in the state that the drive shows."""
        if image.state is _UNKNOWN:
            return
        if image.state not in ENERGISED:
            self.state = AxisState.DISABLED
        else:
            self.state = AxisState.STANDSTILL if image.standstill else AxisState.CONTINUOUS_MOTION

    def _let_go(self, image: AxisImage) -> None:
        """Do not ask again for a state that the drive has left by itself; only an enable under way may."""
        if image.state is not _ENABLED:
            self.running.set_point = image.led.taken = None  # what the drive had taken, or begun to, is void
        goal = self.order.goal
        if image.state is goal or goal not in ENERGISED or isinstance(self.activity, EnableActivity):
            return
        if image.state not in _MAY_BE_ENERGISED:
            self.order.goal = PowerState.SWITCH_ON_DISABLED
            self.powered = False
        elif image.state is PowerState.QUICK_STOP_ACTIVE:
            self.order.goal = image.state

    # -- failure -----------------------------------------------------------------------------------------------------

    def fail(self, error: AxisbusError, rung: StopLevel = StopLevel.HALT, *, along: bool = True) -> None:
        """Go to ErrorStop because of ``error``, and stop the axis from ``rung`` on; ``along`` the path that leads it."""
        self._trip(error)
        enrich(error, self.image, self.history)
        activity = self.activity if along else None
        self.end_command(error)
        if self.touched and self.image.state in _MAY_BE_ENERGISED:
            self._stop(StopKind.ERROR, AfterStop.HOLD, rung, error.message, led_by=activity)
            return
        self.powered = False
        if self.order.goal is not None:
            self.order.goal = PowerState.SWITCH_ON_DISABLED

    def break_off(self, error: AxisbusError) -> None:
        """What moves the axis cannot go on, for a reason that was found between two cycles: fail, and stop as hard as it takes."""
        self._activity_failed(error)
        self._broken = self.tripped

    def intruded(self, error: SecondMasterError) -> None:
        """Another master commands the drive, found between two cycles: stop it, if this program has ever commanded it.

        A drive that the other one enables again after it had been stopped takes no RPDO of anybody any more: its node leaves
        operational, unless a load may hang on the motor.
        """
        if not self.touched:
            return
        if self.state is not _ERRORSTOP or (
            self.ladder is not None and self.ladder.rung < StopLevel.QUICK_STOP
        ):
            rung = StopLevel.QUICK_STOP
        elif self.ladder is None and self.image.state is _ENABLED:
            rung = StopLevel.NMT_STOP if self.parameters.holds_load is HoldsLoad.NO else StopLevel.QUICK_STOP
        else:
            return
        self.fail(error, rung, along=False)
        self._broken = self.tripped

    @property
    def _doing(self) -> str:
        """What moves the axis, for a person."""
        ran = self.running.ticket
        return ran.name if ran is not None else f"{self.parameters.name}'s motion"

    def _trip(self, error: AxisbusError) -> None:
        """Be in ErrorStop; what comes later is added to the first reason, and its remedy goes first."""
        if self.error is None or self.state is not AxisState.ERRORSTOP:
            self.error = error
        elif error.message not in f"{self.error.message}{self.error.observed}":
            self.error.observed = chained(self.error.observed, f"{error.message} ({error.observed})")
            self.error.remedy = join_remedies(error.remedy, self.error.remedy)
        self.state = AxisState.ERRORSTOP
        self.tripped = error
        self._end_resets(error)

    def _end_resets(self, error: AxisbusError) -> None:
        """End the resets that wait: they were asked for before ``error``."""
        for ticket in self.stopping.drop_resets():
            self.finish(ticket, error)

    def _fault(self, image: AxisImage) -> None:
        """The drive reports a fault: stop asking for anything, find out why, then tell."""
        story = FaultDiagnosis(self.parameters, image.now)
        doing, ticket, addition = self._doing, self.running.drop(self.order), self.running.take_addition()
        self._drop_waiting(doing, None)
        if addition is not None:
            story.tickets.append(addition)
        if ticket is not None:
            story.doing = f" during {ticket.name}" if ticket.busy else ""
            story.tickets.append(ticket)
        story.tickets += self.stopping.drop_resets()
        self._story = story
        self._stopped_for_sure = False  # an earlier ladder's: the drive itself brakes now, or coasts
        self._trip(story.tell(image, self.history))
        story.tickets += self.stopping.drop()
        self.powered = False
        if self.touched:
            self.order.goal = PowerState.SWITCH_ON_DISABLED

    def _step_story(self, story: FaultDiagnosis, image: AxisImage, order: CycleOutputs) -> None:
        if not story.step(image, order):
            return
        error = story.tell(image, self.history)
        self._story = None
        if self.state is AxisState.ERRORSTOP:
            self.error = error
        for ticket in story.tickets:
            self.finish(ticket, error)

    # -- commands and their ends -------------------------------------------------------------------------------------

    def begin(self, activity: Activity, ticket: CommandStatus, state: AxisState | None = None) -> None:
        """Let ``activity`` take over; the running command, or the halt, ends as replaced."""
        self.end_command(Replaced(f"{self._doing} was replaced by {ticket.name}"))
        if self.ladder is not None:
            self._end_stop(Replaced(f"{self.stopping.name} was replaced by {ticket.name}"))
        self.touched = True
        self._stopped_for_sure = False
        if activity.mode is ModeOfOperation.HOMING:
            self.homed = False  # until it is done
            why = f"was ended by {ticket.name}, with which the drive counts its positions anew"
            self.probes.end_all(Replaced, why, self.order, "ask for it again when the axis is homed")
        self.running.begin(activity, ticket)
        self._arrival.begin(activity, self.image.now)
        if state is not None:
            self.state = state

    def go_on(self, ticket: CommandStatus) -> None:
        """Let what runs go on for another command, which it has been given; the one before ends as replaced."""
        doing, before = self._doing, self.running.ticket
        error = Replaced(f"{doing} was replaced by {ticket.name}")
        self.running.ticket = ticket
        ticket.begin()
        if before is not None:
            self.finish(before, error)
        self._drop_waiting(doing, error)

    def aim(self, target: int | None) -> None:
        """Note where the motion that has begun leads, in increments of the drive; None: to no position."""
        self.last_target = target

    def set_override(self, own: float | None = None, cell: float | None = None) -> None:
        """Multiply velocities by another factor: of the axis, or of its cell; what is under way takes it up in its next cycle."""
        if own is not None:
            self.override.set_own(own)
        if cell is not None:
            self.override.set_cell(cell)
        self.image.override = self.override.factor
        if self.activity is not None:
            self.activity.override(self.image)
        self._cruise = None  # what goes on now needs the whole step

    def coast(self, coast: Activity, ticket: CommandStatus) -> None:
        """Let ``coast`` take the power away: from now on nothing of ours drives the motor."""
        self.powered = False
        self.begin(coast, ticket)
        if self.state is not AxisState.ERRORSTOP:
            self.state = AxisState.DISABLED

    def unlock(self) -> None:
        """End the lock of a stop, where the drive is in operation."""
        if self.image.state is _ENABLED:
            self.state = AxisState.STANDSTILL

    def confirm_position(self, origin: int) -> None:
        """Count positions from ``origin`` (increments of the drive) on: they are confirmed ones."""
        self.image.origin = origin
        self.last_target = None  # it was one in the old count
        self.homed = True

    def forget(self, loss: Loss) -> None:
        """Forget what is void by ``loss``; this is the one list of it, and a test walks all attributes of an axis by it.

        A command that ends leaves nothing else behind: an activity holds its own state, and goes with it.
        """
        image, led = self.image, self.image.led
        self.running.set_point = None
        led.drop_set_point()
        if loss >= Loss.POWER:
            led.forget(image.now)
            self.last_target = None
            self.stopping.set_going_at = -math.inf
            self.supervision.forget()
        if loss >= Loss.COUNT:
            image.recount()
            self.supervision.guard.forget()

    def forget_position(self) -> None:
        """Where the axis is is to be found out anew: until then its position is not a confirmed one."""
        self.homed = False

    def join(self, ticket: CommandStatus) -> None:
        """Let ``ticket`` end as the running command does: the same has been asked for again."""
        self.running.join(ticket)

    def end_command(self, error: AxisbusError | None) -> None:
        """End the running command, and what waits for its end, keeping a set-point handshake that is under way."""
        doing = self._doing
        ticket, addition = self.running.drop(self.order), self.running.take_addition()
        if ticket is not None:
            self.finish(ticket, error)
        if addition is not None:
            self.finish(addition, copy(error))
        self._drop_waiting(doing, error)

    def _drop_waiting(self, before: str, error: AxisbusError | None) -> None:
        """End what waits for the end of ``before``, which has not ended well."""
        if self.queue and self.queue.drop(before, error):
            self.running.ended = True

    def at_rest(self, ticket: CommandStatus, then: Callable[[], None]) -> None:
        """Let something be done at rest: now, where the axis is seen to stand and no path leads it, else as soon as that is so."""
        image = self.image
        stands = image.standstill and image.now - image.position_stamp <= _NOW
        if stands and not self.run_down.under_way and self.led_along is None:
            then()
            self.finish(ticket)
        else:
            self.rest_waits.add(ticket, then)

    def finish(self, ticket: CommandStatus, error: AxisbusError | None = None) -> None:
        """End a ticket, well (no error) or with the reason."""
        self.running.finish(ticket, error)

    def _step_activity(self, activity: Activity, image: AxisImage, order: CycleOutputs) -> None:
        if self.running.set_point is not None and not isinstance(activity, PositionMove):
            self.running.set_point = None  # another mode gives bit 4 another meaning
        try:
            done = activity.step(image, order)
            seen_later = (
                image.position is not None and image.position_stamp <= image.now == activity.rests_from
            )
            if done or not seen_later:
                done = self._arrival.complete(activity, done, image)
            # Else it is on its way: the look for its rest begins anew after this cycle, with what is then received.
        except Exception as error:  # noqa: BLE001  # whatever it is, it ends this command and stops this axis
            self._activity_failed(broken(error, self._doing))
            return
        if self.running.addition is not None and self.running.addition.over:
            self._addition_ended(self.running.addition)
        if done and self.running.ticket is not None and self.running.ticket.busy:
            self._completed(activity)
            self.queue.next()

    def _addition_ended(self, addition: Addition) -> None:
        """What was laid over the path goes no farther; the path goes on, displaced."""
        ticket = self.running.take_addition()
        if self.state is not _SYNCHRONIZED and self.last_target is not None:
            self.last_target += self.parameters.units.position.to_increments(addition.value)
        if ticket is not None:
            self.finish(ticket, addition.error)

    def _completed(self, activity: Activity) -> None:
        """The activity has ended well: set the state that follows it."""
        ticket, self.running.ticket = self.running.ticket, None
        if ticket is not None:
            self.finish(ticket)
        if activity.goes_on:
            return  # until something else is wanted
        self.running.activity = None
        if activity.clears_error:
            self.supervision.lost = False  # a node that is lost still, or once more, is told again
        if activity.mode is ModeOfOperation.HOMING:
            self._homed()
        if self.state is AxisState.ERRORSTOP and not activity.clears_error:
            self.powered = False
        else:
            self._settle()

    def _settle(self) -> None:
        """Take the state that the power stage shows, after a command that has ended well."""
        image = self.image
        self.error = None
        held = image.state is PowerState.QUICK_STOP_ACTIVE
        self.powered = (
            image.state is PowerState.OPERATION_ENABLED and self.order.goal is image.state
        ) or held
        if held:
            self.state = AxisState.STOPPING
        else:
            self.state = AxisState.STANDSTILL if self.powered else AxisState.DISABLED

    def clear_error(self) -> None:
        """Leave ErrorStop, where the drive itself is in no fault; nothing moves by this."""
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
            self.fail(finding.error, finding.rung, along=finding.along)

    def _end_in_halt(self, error: AxisbusError) -> None:
        """The command ends by its own rule, as a jog does, or could not begin: the axis halts."""
        activity = self.activity
        self.end_command(error)
        self._stop(StopKind.HALT, AfterStop.HOLD, StopLevel.HALT, error.message, led_by=activity)

    def _activity_failed(self, error: AxisbusError) -> None:
        activity = self.activity
        if isinstance(error, Interrupted) or (activity is not None and activity.refused):
            self._end_in_halt(error)
            return
        resetting = self.activity is not None and self.activity.clears_error
        along = isinstance(self.activity, Follow) and self.activity.brakes_along
        if along or isinstance(error, MotionTimeout):  # what leads it still leads it: it is only late
            self.fail(error, StopLevel.HALT)
            return
        astray = self._runs_on_targets or isinstance(error, UncommandedMotion)
        self.fail(error, StopLevel.QUICK_STOP if astray else StopLevel.HALT)
        if resetting:
            self.tripped = (
                None  # the failure itself has been told; that it stays is no reason to stop others again
            )

    @property
    def _runs_on_targets(self) -> bool:
        """Whether the axis moves from target to target: without a next one it is jolted, and only a quick stop is a ramp."""
        if isinstance(self.activity, Follow):
            return not self.activity.at_rest
        return self.image.mode == Follow.mode and not self.image.standstill

    # -- stopping ----------------------------------------------------------------------------------------------------

    def stop_because(
        self, kind: StopKind, then: AfterStop, rung: StopLevel, reason: str, ticket: CommandStatus | None
    ) -> None:
        """Stop the axis: the running command ends with ``reason``; a trajectory is braked along its path."""
        activity = self.activity
        self.end_command(Stopped(reason, remedy=REMEDIES.get(kind, "")))
        if kind in _LASTING:
            self._end_resets(Stopped(reason))
        self._stop(kind, then, rung, reason, ticket, activity)
        if kind in _LOCKING and self.state is not AxisState.ERRORSTOP:
            self.state = AxisState.STOPPING

    def _stop(
        self,
        kind: StopKind,
        then: AfterStop,
        rung: StopLevel,
        reason: str,
        ticket: CommandStatus | None = None,
        led_by: Activity | None = None,
    ) -> None:
        """``led_by``: the command that has just ended; along the trajectory on which it had the axis it is braked."""
        if kind is not StopKind.HALT and self.leading_path is not None:
            self.leading_path.brake_hard()
        self.stopping.ask(kind, then, rung, reason, ticket, led_by)
        self.touched = True

    def _step_ladder(self, ladder: StopSequence, image: AxisImage, order: CycleOutputs) -> None:
        if ladder.rung is StopLevel.HALT:
            self.running.finish_handshake(image, order)
        ended = ladder.step(image, order, self.run_down)
        if self.state is AxisState.STANDSTILL and ladder.seen not in _MAY_BE_ENERGISED:
            self.state = AxisState.DISABLED  # it may turn without power, and is waited for
        elif self.state is AxisState.STANDSTILL and ladder.blind:
            self.state = AxisState.STOPPING  # nobody sees any more that it stands
        if ended:
            self._stopped(ladder, image)

    def _stopped(self, ladder: StopSequence, image: AxisImage) -> None:
        seen = (
            ladder.seen if image.state is PowerState.UNKNOWN else image.state
        )  # by SDO, where PDOs tell nothing
        self.powered = ladder.confirmed and seen in ENERGISED
        self._stopped_for_sure = ladder.confirmed
        self.last_target = image.reference if self.powered else None  # without power it may be turned by hand
        error = stop_error(ladder, self.parameters.name)
        if error is not None:
            self._trip(error)
            enrich(error, image, self.history)
        elif self.state is not AxisState.ERRORSTOP:
            self.state = self._state_after_stop(seen)
        self._end_stop(error)

    def _state_after_stop(self, seen: PowerState) -> AxisState:
        """Return what the axis is in after a stop that has ``seen`` its drive so, by PDO or by SDO."""
        if seen not in ENERGISED:
            return AxisState.DISABLED
        locked = self.stopping.locks or seen is PowerState.QUICK_STOP_ACTIVE
        return AxisState.STOPPING if locked else AxisState.STANDSTILL

    def _end_stop(self, error: AxisbusError | None) -> None:
        note = "" if self.ladder is None else self.ladder.witness
        for ticket in self.stopping.drop():
            ticket.note = note
            self.finish(ticket, error)
