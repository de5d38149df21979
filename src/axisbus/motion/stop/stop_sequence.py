"""The stop sequence: halt in the mode, quick stop, disable voltage, NMT stop; each step with a deadline.

Theory of operation
-------------------
If standstill is seen during a step (see ``StandstillCheck``: since the step began, and with nothing that pulls), the sequence ends.
If that was requested, the power stage is switched off first. A missed deadline can only lead to a harder step, and a repeated
request gives no more time. A drive that no longer drives its motor (any state but *operation enabled*, *quick stop active*, *fault
reaction active*) has stopped as far as a master can make it stop. A motor that this master has driven counts as stopped once it is
seen at standstill (``CoastDown``).

Without a fresh statusword the sequence begins at *quick stop*: that word (0x0002) is safe in every state, whereas the word of
*halt* contains *enable operation*. The word is then also sent by SDO, and its effect is read back by SDO (``SdoPath``).

An axis that holds a load is never disabled before it is at standstill. If only the motor holds the load, the axis is not disabled
even then, unless that was requested. For such axes the sequence ends at *quick stop*.
"""

from __future__ import annotations

import math
from enum import Enum, IntEnum

from axisbus.cia402 import controlword as cw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.errors import AxisbusError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.modes import HOLDING_MODES, TORQUE_MODES
from axisbus.motion.moves.activity import SetPointSource, preload
from axisbus.motion.moves.mode_switch import ModeSwitch
from axisbus.motion.parameters import AxisParameters, HoldsLoad
from axisbus.motion.stop.coast_down import CoastDown
from axisbus.motion.stop.hold_setpoint import HoldSetPoint, is_target_unknown, needs_relief, pushes
from axisbus.motion.stop.sdo_path import SdoPath
from axisbus.motion.stop.standstill import StandstillCheck
from axisbus.motion.stop_deceleration import CommandedMotion


class StopLevel(IntEnum):
    """How hard the axis is being stopped."""

    HALT = 0
    QUICK_STOP = 1
    DISABLE_VOLTAGE = 2
    NMT_STOP = 3

    @property
    def text(self) -> str:
        """The name of the step, for the user."""
        return self.name.lower().replace("_", " ").replace("nmt", "NMT")


class AfterStop(Enum):
    """The action after standstill: stay energised and hold, or switch off the power stage."""

    HOLD = "hold"
    DISABLE = "disable"


_UNSEEN_PULL = "it was at standstill before it was halted, and without 6062h it is not known whether its drive still pulls it"
_UNSEEN_PUSH = (
    "it pushes with all its rated torque (6077h), and 6062h does not give the position that it pushes to"
)
_NOT_RELIEVED = (
    "it accepts no new target while it is halted, and without 6062h it is not known whether its drive pulls it "
    "to the old one"
)
_CSV = ModeOfOperation.CYCLIC_SYNC_VELOCITY
_STARTS = 0.3  # seconds after which a drive has begun to move, unless something holds it
_FEEDBACK = 3.0  # scan periods from a command to the position that shows its effect
_MAY_DRIVE = ENERGISED | {PowerState.UNKNOWN}
_NMT_STOP_TIME = 0.1
# The key in [axes.NAME.stop] that gives the time of each step.
_TIMES = {
    StopLevel.HALT: "halt_time",
    StopLevel.QUICK_STOP: "quick_stop_time",
    StopLevel.DISABLE_VOLTAGE: "disable_time",
}


class StopSequence:
    """The stop of one axis; holds the step, its deadline, and whether the power stage is being switched off."""

    def __init__(
        self,
        parameters: AxisParameters,
        then: AfterStop,
        *,
        start: StopLevel = StopLevel.HALT,
        follow: SetPointSource | None = None,
        pending_mode_switch: ModeSwitch | None = None,
        commanded: CommandedMotion | None = None,
        resisted_since: float = math.inf,
        motion_requested_at: float = -math.inf,
    ) -> None:
        """``follow``: the trajectory that is being followed, if any; the axis brakes along its path.

        ``pending_mode_switch``: a requested change from the mode of that trajectory to another one. The drive may have accepted the
        change already, and a return to the old mode for one cycle would cause a jolt. So the change is completed, along the path.
        ``commanded``, ``resisted_since``: see ``Activity``. ``motion_requested_at``: when motion was last requested from the drive,
        in seconds of the scan's clock.
        """
        self._parameters = parameters
        self._then = then
        self._follow = follow
        self._pending_mode_switch = pending_mode_switch
        self._commanded = commanded
        self._resisted_since = resisted_since
        self._motion_requested_at = motion_requested_at
        self._last_target: int | None = None  # of the trajectory along which the axis brakes
        self._deadline: float | None = None
        # Since the present step began; for the first one, since the first call of step().
        self._standstill_check: StandstillCheck
        self._relief: HoldSetPoint | None = None
        self._disabling = False
        self._holds = False  # the axis had power when the stop began, and was to keep it
        self._was_off = False  # or is being switched off: the master does not want any later enable
        self._rest_by: float | None = None  # until when a motor without power may turn
        self._by_sdo = SdoPath(parameters)
        self._at_standstill = False
        # It was at standstill in the middle of a motion when the stop began, and no value shows whether it is pulled.
        self._blocked_unseen = False
        self.level = start
        self.path: list[StopLevel] = [start]
        self.seen = PowerState.UNKNOWN  # by PDO, else by SDO
        self.confirmed = False
        # The times of cell.toml that have passed: the stop became harder than requested.
        self.late: list[str] = []
        # When the time of the halt passed, the axis was still braking along its path.
        self.on_its_path = False
        self.statusword_missing = False  # the statusword was missing when a halt was requested
        self.power_left_on = False  # the power was left on because of the load
        self.missing_condition = ""  # the missing condition for standstill when a time passed
        self.coasting_text = ""  # the same, for a motor without power
        self.blocked = False  # something held the axis while its drive pulled (or may have)
        # the weaker evidence than its position by which the axis was seen at standstill
        self.weaker_evidence = ""

    @property
    def follow(self) -> SetPointSource | None:
        """The trajectory along which the axis brakes, if any."""
        return self._follow

    @property
    def pending_mode_switch(self) -> ModeSwitch | None:
        """The requested change of mode that is to end that trajectory, if any."""
        return self._pending_mode_switch

    @property
    def escalated(self) -> bool:
        """Whether the stop became harder than requested, or (because of the load) not as hard as it should have."""
        return bool(self.late) or self.statusword_missing or self.power_left_on or self.blocked

    @property
    def removes_power(self) -> bool:
        """Whether the power stage is to be switched off at the end."""
        return self._then is AfterStop.DISABLE

    @property
    def removed_power(self) -> bool:
        """Whether the axis had power, was to keep it, and is seen without it."""
        return self._holds and not self.removes_power and self.seen not in _MAY_DRIVE

    def harden(self, then: AfterStop, level: StopLevel) -> None:
        """Combine with another requested stop: use the harder one of both, and give no more time to a running step."""
        if then is AfterStop.DISABLE:
            self._then = then
        if level > self.level and not self._disabling:
            self._change_level(level)

    def step(self, image: AxisImage, order: CycleOutputs, coast_down: CoastDown) -> bool:
        """Return True when the axis has stopped, or nothing more can be done; ``confirmed`` distinguishes the two.

        ``coast_down``: whether the motor may still turn without power.
        """
        if self._deadline is None:
            self._was_off = order.goal is PowerState.SWITCH_ON_DISABLED
            self._holds = order.goal in ENERGISED
            self._blocked_unseen = len(self.path) == 1 and self._is_blocked_unseen(image)
            self._begin_level(image)
        self._at_standstill = self._standstill_check.seen(image)
        ended = self._step(image, order, coast_down)
        if self._pending_mode_switch is not None and self.level is not StopLevel.HALT:
            self._pending_mode_switch.cancel(order)  # a later change of mode would be unexpected
            self._pending_mode_switch = None
        if ended:
            self.weaker_evidence = self._standstill_check.weaker_evidence if self.seen in ENERGISED else ""
            if not self.confirmed and image.position is not None and self.seen in _MAY_DRIVE:
                self.missing_condition = self._standstill_check.why_not(image)
            self._by_sdo.cancel(order)
            self._end_relief(order)
        return ended

    def _is_blocked_unseen(self, image: AxisImage) -> bool:
        if image.flight.awaits_mode(image.mode, image.now - self._parameters.timing.mode):
            return False  # it has stopped for another mode, which the drive may have taken without having shown it yet
        if image.now > self._resisted_since + self._time_to_be_seen() and image.pull is None:
            return True
        if not image.standstill or not is_target_unknown(image, self._parameters):
            return False
        rested = image.still.rested_since  # a motion that reverses stands for a moment at its turning point
        if image.mode == ModeOfOperation.HOMING:
            return image.now > max(image.reference_tracker.homing_since, rested) + _STARTS
        return image.now > max(image.reference_tracker.set_point_at, rested) + self._time_to_be_seen()

    def _time_to_be_seen(self) -> float:
        """Return the seconds within which the position shows a commanded motion, if nothing holds the axis.

        A slow motion, and the beginning of a gentle one, look like a standstill for a while.
        """
        parameters, commanded = self._parameters, self._commanded or CommandedMotion()
        time = _STARTS + _FEEDBACK * parameters.scan_period + commanded.soft
        if commanded.up:
            time += parameters.unseen_speed / commanded.up
        if commanded.speed is not None:  # until it has gone twice as far as noise may
            time += (
                4.0 * parameters.standstill_tolerance / abs(commanded.speed) if commanded.speed else math.inf
            )
        return time

    def _begin_level(self, image: AxisImage) -> None:
        self._deadline = image.now + self._time(self.level)
        since = image.now
        if (
            image.standstill and since < self._motion_requested_at + _STARTS
        ):  # feedback may be late, and the motion not seen yet
            latest = self._deadline - 2 * self._parameters.timing.standstill_time
            since = max(since, min(self._motion_requested_at + _STARTS, latest))
        self._standstill_check = StandstillCheck(self._parameters, since)

    def _step(self, image: AxisImage, order: CycleOutputs, coast_down: CoastDown) -> bool:
        self._by_sdo.look(image, order)
        self.seen = self._by_sdo.state or image.state
        if self.seen not in ENERGISED and self.seen is not PowerState.UNKNOWN:
            return self._unpowered(image, order, coast_down)
        if image.state is PowerState.UNKNOWN and self.level is StopLevel.HALT:
            self.statusword_missing = True
            self._change_level(StopLevel.QUICK_STOP, image)
        if self._disabling:
            return self._take_down(image, order)
        return _STEPS[self.level](self, image, order)

    def _unpowered(self, image: AxisImage, order: CycleOutputs, coast_down: CoastDown) -> bool:
        self._was_off = True
        order.goal = PowerState.SWITCH_ON_DISABLED
        if coast_down.under_way or (image.state is PowerState.UNKNOWN and self._by_sdo.may_turn):
            self.coasting_text = (
                "its power is off, "
                f"{coast_down.why_not(image) or 'and standstill of its position (6064h) was not observed'}"
            )
            self.confirmed = False  # it may have been at standstill, and fall now
            if self._rest_by is None:
                self._rest_by = image.now + self._parameters.stop_times.disable
            return image.now > self._rest_by
        self.confirmed = True
        self.coasting_text = ""
        if self.seen is PowerState.FAULT:
            return True
        if self._then is AfterStop.HOLD:
            down = not image.flight.may_enable(image.now)
        else:
            down = self.seen is PowerState.SWITCH_ON_DISABLED and image.flight.word_answered(image.now)
        # A word that has not taken effect yet may cause the drive to leave this state.
        return down or self._expired(image)

    def _halt(self, image: AxisImage, order: CycleOutputs) -> bool:
        if (
            image.state is PowerState.QUICK_STOP_ACTIVE
        ):  # the drive brakes already, by its own decision or an earlier command
            self._change_level(StopLevel.QUICK_STOP, image)
            return self._quick_stop(image, order)
        if image.state is PowerState.OPERATION_ENABLED:
            # A word that keeps it enabled could enable a drive again that is just leaving the state.
            if self._was_off:
                return self._disable(image, order)
            order.goal = PowerState.OPERATION_ENABLED
            if not self._halt_in_mode(image, order):
                self._end_relief(order)  # it has moved, and the relief is for another position
            elif self._relieved(image, order):
                return self._confirm_standstill(image, order)
        return self._next_if_late(image, StopLevel.QUICK_STOP)

    def _halt_in_mode(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Request a halt in the manner of the mode; return whether the axis is at standstill."""
        if self._pending_mode_switch is not None and not self._has_left(
            self._pending_mode_switch, image, order
        ):
            return False
        if self._follow is not None and _is_in_mode_of(image, self._follow):
            at_standstill = self._brake_along(self._follow, image, order)
            if at_standstill is not None:
                return at_standstill
        if image.mode in TORQUE_MODES and self._parameters.holds_load is not HoldsLoad.NO:
            self._hold_load(image, order)
            return False
        if image.mode in TORQUE_MODES and self._parameters.halts_torque_by_mode:
            order.mode = (
                ModeOfOperation.PROFILE_VELOCITY
            )  # brakes on 6084h; a torque of 0 would let the motor coast
            preload(order, image.reference)
            return False
        order.halt = True
        order.target_velocity = 0
        order.target_torque = 0
        return self._at_standstill

    def _relieved(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether nothing remains of an interrupted move that may pull; a drive that stays powered gets a new target for this.

        An axis that was at standstill in the middle of its move, before it was halted, was held by something: it is safe only
        without power.
        """
        if self._then is AfterStop.DISABLE:
            return True  # the missing power removes any pull
        if self._blocked_unseen or pushes(image, self._parameters):
            self.blocked, self.missing_condition = (
                True,
                _UNSEEN_PULL if self._blocked_unseen else _UNSEEN_PUSH,
            )
            self._change_level(StopLevel.QUICK_STOP, image)
            return False
        if self._relief is None:
            if not needs_relief(image, self._parameters) or image.position is None:
                return True
            self._relief = HoldSetPoint(image.position, self._parameters)
        if self._relief.step(image, order):
            self._end_relief(order)
            self._standstill_check = StandstillCheck(
                self._parameters, image.now
            )  # once more: the axis may have moved because of this
        return False

    def _end_relief(self, order: CycleOutputs) -> None:
        if self._relief is not None:
            self._relief.cancel(order)
            self._relief = None

    def _brake_along(self, follow: SetPointSource, image: AxisImage, order: CycleOutputs) -> bool | None:
        """Brake along the path; return whether the axis is at standstill, None if this is not possible (any more)."""
        try:
            if not follow.begin_braking():
                return None
            follow.step(image, order)
        except AxisbusError:
            # The position is unknown, or a limit is in the path: only the drive's own halt remains.
            self._follow = None
            return None
        if not follow.at_rest or order.target_position != self._last_target:
            # The axis has not followed this target yet, so that its position proves nothing.
            self._last_target = order.target_position
            self._standstill_check.begin(image.now)
            return False
        return self._at_standstill

    def _has_left(self, pending_mode_switch: ModeSwitch, image: AxisImage, order: CycleOutputs) -> bool:
        """Continue along the path, braking, until the drive has the requested mode. Return True once it has, or never will."""
        try:
            if self._follow is not None:
                self._follow.begin_braking()
            if not pending_mode_switch.step(image, order):
                return False
            self._follow = None
        except AxisbusError:
            # The drive rejects the mode, or the path ends: brake along the path, else use the drive's own halt.
            pending_mode_switch.cancel(order)
        self._pending_mode_switch = None
        return True

    def _hold_load(self, image: AxisImage, order: CycleOutputs) -> None:
        """Change to a mode that holds the position: a torque of 0 would drop the load."""
        modes = [mode for mode in HOLDING_MODES if mode in self._parameters.modes] or list(HOLDING_MODES)
        order.mode = modes[0]
        preload(order, image.reference)
        order.target_torque = None

    def _confirm_standstill(self, image: AxisImage, order: CycleOutputs) -> bool:
        self.confirmed = True
        if self._then is AfterStop.HOLD:
            return True
        return self._disable(image, order)

    def _disable(self, image: AxisImage, order: CycleOutputs) -> bool:
        self._disabling = True
        self._deadline = image.now + self._parameters.stop_times.disable
        return self._take_down(image, order)

    def _take_down(self, image: AxisImage, order: CycleOutputs) -> bool:
        order.goal = PowerState.SWITCH_ON_DISABLED
        if image.state is PowerState.UNKNOWN:  # only a word that is safe in every state may be sent
            self._change_level(StopLevel.DISABLE_VOLTAGE, image)
            return False
        return self._next_if_late(image, StopLevel.DISABLE_VOLTAGE)

    def _quick_stop(self, image: AxisImage, order: CycleOutputs) -> bool:
        order.word = order.stopping(cw.PowerCommand.QUICK_STOP, image.state)
        order.goal = PowerState.QUICK_STOP_ACTIVE
        order.target_velocity = 0
        if self._parameters.holds_load is HoldsLoad.NO:
            # Otherwise a drive that does not receive the word would let its load fall.
            order.target_torque = 0
        self._by_sdo.send(order.word, image, order)
        if self.seen is PowerState.QUICK_STOP_ACTIVE and (self._at_standstill or self._by_sdo.at_standstill):
            return not self._about_to_leave(image) and self._confirm_standstill(image, order)
        if not self._must_hold(image):
            return self._next_if_late(image, StopLevel.DISABLE_VOLTAGE)
        if not self._expired(image):
            return False
        self.power_left_on = True
        self.confirmed = self._at_standstill
        return True

    def _about_to_leave(self, image: AxisImage) -> bool:
        """Whether the drive will take transition 12 automatically (605Ah 0 to 4, once its brake holds): part of the stop."""
        if self._parameters.quick_stop_holds or self._then is AfterStop.DISABLE:
            return False
        return not self._expired(image)

    def _must_hold(self, image: AxisImage) -> bool:
        """Whether power off would let the load fall: always if only the motor holds it; with a brake, only during motion."""
        holds = self._parameters.holds_load
        return holds is HoldsLoad.TORQUE or (holds is HoldsLoad.BRAKE and not image.standstill)

    def _disable_voltage(self, image: AxisImage, order: CycleOutputs) -> bool:
        order.word = order.stopping(cw.PowerCommand.DISABLE_VOLTAGE, image.state)
        order.goal = PowerState.SWITCH_ON_DISABLED
        self._by_sdo.send(order.word, image, order)
        return self._next_if_late(image, StopLevel.NMT_STOP)

    def _nmt_stop(self, image: AxisImage, order: CycleOutputs) -> bool:
        order.word = order.stopping(cw.PowerCommand.DISABLE_VOLTAGE, image.state)
        order.nmt_stop = True
        return self._expired(image)

    def _next_if_late(self, image: AxisImage, level: StopLevel) -> bool:
        if self._expired(image):
            key = "disable_time" if self._disabling else _TIMES[self.level]
            self.late += [] if key in self.late else [key]
            self.on_its_path |= (
                self.level is StopLevel.HALT and self._follow is not None and not self._follow.at_rest
            )
            if not self._disabling and level <= StopLevel.DISABLE_VOLTAGE:
                self.missing_condition = (
                    self._standstill_check.why_not(image) if self._relief is None else _NOT_RELIEVED
                )
                self.blocked = self.blocked or self._standstill_check.is_blocked(image)
            self._change_level(level, image)
        return False

    def _expired(self, image: AxisImage) -> bool:
        assert self._deadline is not None  # each step begins its deadline first
        return image.now > self._deadline

    def _change_level(self, level: StopLevel, image: AxisImage | None = None) -> None:
        self.level = level
        self.path.append(level)
        self._disabling = False
        self._relief = None
        self._deadline = None
        if image is not None:
            self._begin_level(image)

    def _time(self, level: StopLevel) -> float:
        times = self._parameters.stop_times
        return {
            StopLevel.HALT: times.halt,
            StopLevel.QUICK_STOP: times.quick_stop,
            StopLevel.DISABLE_VOLTAGE: times.disable,
            StopLevel.NMT_STOP: _NMT_STOP_TIME,
        }[level]


def _is_in_mode_of(image: AxisImage, follow: SetPointSource) -> bool:
    """Whether the drive is in the mode of the trajectory; in csv, an unknown mode counts as this mode.

    Otherwise a sudden velocity target of 0 would jolt the drive.
    """
    return image.mode == follow.mode or (image.mode is None and follow.mode is _CSV)


_STEPS = {
    StopLevel.HALT: StopSequence._halt,
    StopLevel.QUICK_STOP: StopSequence._quick_stop,
    StopLevel.DISABLE_VOLTAGE: StopSequence._disable_voltage,
    StopLevel.NMT_STOP: StopSequence._nmt_stop,
}
