"""The stop ladder: halt in the mode, quick stop, disable voltage, NMT stop; each rung with a deadline.

Theory of operation
-------------------
Standstill (see ``StandstillCheck``: seen since the rung began, and nothing that pulls) on any rung ends the ladder, with the power
stage taken down first where that was asked for. A deadline only leads further down, and asking again gives no more time. A drive
that no longer drives its motor (any state but *operation enabled*, *quick stop active*, *fault reaction active*) has stopped as far
as a master can make it stop; one that this program had driven counts as stopped when it is seen to stand (``CoastDown``).

Without a fresh statusword the ladder begins at *quick stop*: that word (0x0002) is safe in every state, whereas the word of *halt*
contains *enable operation*. It then goes by SDO too, and what it did is read back by SDO (``SdoPath``).

An axis that holds a load is never disabled before it stands, and one whose load hangs on the motor alone not even then, unless that
was asked for: for them the ladder ends at *quick stop*.
"""

from __future__ import annotations

import math
from enum import Enum, IntEnum

from axisbus.cia402 import controlword as cw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.errors import AxisbusError
from axisbus.motion.active_trajectory import Leading
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.modes import HOLDING_MODES, TORQUE_MODES
from axisbus.motion.moves.activity import ModeSwitch, preload
from axisbus.motion.parameters import AxisParameters, HoldsLoad
from axisbus.motion.stop.coast_down import CoastDown
from axisbus.motion.stop.hold_setpoint import HoldSetPoint, is_blind, needs_relief, pushes
from axisbus.motion.stop.sdo_path import SdoPath
from axisbus.motion.stop.standstill import StandstillCheck


class StopLevel(IntEnum):
    """How hard the axis is being stopped."""

    HALT = 0
    QUICK_STOP = 1
    DISABLE_VOLTAGE = 2
    NMT_STOP = 3

    @property
    def text(self) -> str:
        """The rung's name for a person."""
        return self.name.lower().replace("_", " ").replace("nmt", "NMT")


class AfterStop(Enum):
    """What follows standstill: stay energised and hold, or take the power stage down."""

    HOLD = "hold"
    DISABLE = "disable"


_UNSEEN_PULL = "it stood before it was halted, and without 6062h nobody sees whether its drive pulls it on"
_UNSEEN_PUSH = "it pushes with all its rated torque (6077h), and 6062h does not say where to"
_NOT_RELIEVED = "it takes no new target while it is halted, and without 6062h nobody sees whether its drive pulls it to the old one"
_CSV = ModeOfOperation.CYCLIC_SYNC_VELOCITY
_STARTS = 0.3  # seconds after which a drive has begun to move, unless something holds it
_MAY_DRIVE = ENERGISED | {PowerState.UNKNOWN}
_NMT_STOP_TIME = 0.1
# The entry of [axes.NAME.stop] that gives each rung its time.
_TIMES = {
    StopLevel.HALT: "halt_time",
    StopLevel.QUICK_STOP: "quick_stop_time",
    StopLevel.DISABLE_VOLTAGE: "disable_time",
}


class StopSequence:
    """One axis on its way to a stop; holds the rung, its deadline, and whether the power stage is being taken down."""

    def __init__(
        self,
        parameters: AxisParameters,
        then: AfterStop,
        *,
        start: StopLevel = StopLevel.HALT,
        follow: Leading | None = None,
        leaving: ModeSwitch | None = None,
        resisted_since: float = math.inf,
        set_going_at: float = -math.inf,
    ) -> None:
        """``follow``: the trajectory that is being followed, if any; it is braked along its path.

        ``leaving``: a change out of its mode that the drive has been asked for. The drive may have taken it already, and to be
        called back for a cycle would be a jolt: it is seen through, along the path. ``resisted_since``: see ``Activity``.
        ``set_going_at``: when its drive was last asked for motion, in seconds of the scan's clock.
        """
        self._parameters = parameters
        self._then = then
        self._follow = follow
        self._leaving = leaving
        self._resisted_since = resisted_since
        self._set_going_at = set_going_at
        self._deadline: float | None = None
        self._standing: StandstillCheck  # since the present rung began, the first one with the first step
        self._relief: HoldSetPoint | None = None
        self._disabling = False
        self._was_off = False  # or is being led there: whatever enables it now is no wish of ours
        self._rest_by: float | None = None  # until when a motor without power may turn
        self._by_sdo = SdoPath(parameters)
        self._stands_now = False
        self._blind_hold = False  # it stood in the middle of a motion when the stop began, and nobody sees whether it is pulled
        self.rung = start
        self.path: list[StopLevel] = [start]
        self.seen = PowerState.UNKNOWN  # by PDO, else by SDO
        self.confirmed = False
        self.late: list[str] = []  # the times of cell.toml that have passed: further down than was asked for
        self.on_its_path = False  # when the time of the halt passed it was still being braked along its path
        self.blind = False  # the statusword was gone when a halt was asked for
        self.spared = False  # the power was left on because of the load
        self.unseen = ""  # what was missing for standstill when a time passed
        self.running_down = ""  # the same, of a motor without power
        self.held = False  # something held the axis while its drive pulled (or may have)
        self.witness = ""  # by what less than its position the axis was seen to stand

    @property
    def follow(self) -> Leading | None:
        """The trajectory that is being braked along, if any."""
        return self._follow

    @property
    def leaving(self) -> ModeSwitch | None:
        """The change of mode that is to end that trajectory, if one has been asked for."""
        return self._leaving

    @property
    def descended(self) -> bool:
        """Whether it came further down than was asked for, or (for the load's sake) not as far as it should have."""
        return bool(self.late) or self.blind or self.spared or self.held

    @property
    def takes_power(self) -> bool:
        """Whether the power stage is to be taken down at the end."""
        return self._then is AfterStop.DISABLE

    def harden(self, then: AfterStop, rung: StopLevel) -> None:
        """Another stop is asked for: take what is harder of both, and give no more time to what runs already."""
        if then is AfterStop.DISABLE:
            self._then = then
        if rung > self.rung and not self._disabling:
            self._go(rung)

    def step(self, image: AxisImage, order: CycleOutputs, run_down: CoastDown) -> bool:
        """Return True when the axis has stopped, or nothing more can be done; ``confirmed`` tells which.

        ``run_down``: whether the motor may still turn without power.
        """
        if self._deadline is None:
            self._was_off = order.goal is PowerState.SWITCH_ON_DISABLED
            self._blind_hold = len(self.path) == 1 and self._is_held_unseen(image)
            self._begin_rung(image)
        self._stands_now = self._standing.seen(image)
        ended = self._step(image, order, run_down)
        if self._leaving is not None and self.rung is not StopLevel.HALT:
            self._leaving.cancel(order)  # later nobody would expect it
            self._leaving = None
        if ended:
            self.witness = self._standing.witness if self.seen in ENERGISED else ""
            if not self.confirmed and image.position is not None and self.seen in _MAY_DRIVE:
                self.unseen = self._standing.why_not(image)
            self._by_sdo.cancel(order)
            self._end_relief(order)
        return ended

    def _is_held_unseen(self, image: AxisImage) -> bool:
        if image.now > self._resisted_since + _STARTS and image.pull is None:
            return True
        led = image.led
        began = led.searching_since if image.mode == ModeOfOperation.HOMING else led.set_point_at
        return image.standstill and image.now > began + _STARTS and is_blind(image, self._parameters)

    def _begin_rung(self, image: AxisImage) -> None:
        self._deadline = image.now + self._time(self.rung)
        since = image.now
        if (
            image.standstill and since < self._set_going_at + _STARTS
        ):  # feedback may be late, and the motion not seen yet
            latest = self._deadline - 2 * self._parameters.timing.standstill_time
            since = max(since, min(self._set_going_at + _STARTS, latest))
        self._standing = StandstillCheck(self._parameters, since)

    def _step(self, image: AxisImage, order: CycleOutputs, run_down: CoastDown) -> bool:
        self._by_sdo.look(image, order)
        self.seen = self._by_sdo.state or image.state
        if self.seen not in ENERGISED and self.seen is not PowerState.UNKNOWN:
            return self._unpowered(image, order, run_down)
        if image.state is PowerState.UNKNOWN and self.rung is StopLevel.HALT:
            self.blind = True
            self._go(StopLevel.QUICK_STOP, image)
        if self._disabling:
            return self._take_down(image, order)
        return _STEPS[self.rung](self, image, order)

    def _unpowered(self, image: AxisImage, order: CycleOutputs, run_down: CoastDown) -> bool:
        self._was_off = True
        order.goal = PowerState.SWITCH_ON_DISABLED
        if run_down.under_way or (image.state is PowerState.UNKNOWN and self._by_sdo.may_turn):
            self.running_down = f"its power is off, {run_down.why_not(image) or 'and its position (6064h) was not seen to stand'}"
            self.confirmed = False  # it may have stood, and fall now
            if self._rest_by is None:
                self._rest_by = image.now + self._parameters.stop_times.disable
            return image.now > self._rest_by
        self.confirmed = True
        self.running_down = ""
        if self.seen is PowerState.FAULT:
            return True
        if self._then is AfterStop.HOLD:
            down = not image.flight.may_enable(image.now)
        else:
            down = self.seen is PowerState.SWITCH_ON_DISABLED and image.flight.word_answered(image.now)
        return down or self._expired(image)  # a word that is still on its way may lead the drive out of it

    def _halt(self, image: AxisImage, order: CycleOutputs) -> bool:
        if (
            image.state is PowerState.QUICK_STOP_ACTIVE
        ):  # the drive is at it already, by its own decision or an earlier command
            self._go(StopLevel.QUICK_STOP, image)
            return self._quick_stop(image, order)
        if image.state is PowerState.OPERATION_ENABLED:
            if self._was_off:  # a word that holds it there would enable it anew where it is just leaving
                return self._disable(image, order)
            order.goal = PowerState.OPERATION_ENABLED
            if not self._halt_in_mode(image, order):
                self._end_relief(order)  # it moved on, and would not be where it was to be held
            elif self._relieved(image, order):
                return self._stands(image, order)
        return self._next_if_late(image, StopLevel.QUICK_STOP)

    def _halt_in_mode(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Ask for a halt the way the mode wants it; return whether the axis stands."""
        if self._leaving is not None and not self._has_left(self._leaving, image, order):
            return False
        if self._follow is not None and _is_led(image, self._follow):
            stands = self._brake_along(self._follow, image, order)
            if stands is not None:
                return stands
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
        return self._stands_now

    def _relieved(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether nothing is left of an interrupted move that may pull; a drive that stays powered is given a new target for it.

        An axis that stood in the middle of its move, before it was halted, was held by something: only without power is it safe.
        """
        if self._then is AfterStop.DISABLE:
            return True  # that takes away whatever pulls
        if self._blind_hold or pushes(image, self._parameters):
            self.held, self.unseen = True, _UNSEEN_PULL if self._blind_hold else _UNSEEN_PUSH
            self._go(StopLevel.QUICK_STOP, image)
            return False
        if self._relief is None:
            if not needs_relief(image, self._parameters) or image.position is None:
                return True
            self._relief = HoldSetPoint(image.position, self._parameters)
        if self._relief.step(image, order):
            self._end_relief(order)
            self._standing = StandstillCheck(
                self._parameters, image.now
            )  # once more: it may have moved by this
        return False

    def _end_relief(self, order: CycleOutputs) -> None:
        if self._relief is not None:
            self._relief.cancel(order)
            self._relief = None

    def _brake_along(self, follow: Leading, image: AxisImage, order: CycleOutputs) -> bool | None:
        """Brake along the path; return whether the axis stands, None where that is not possible (any more)."""
        try:
            if not follow.begin_braking():
                return None
            follow.step(image, order)
        except AxisbusError:  # a position that is gone, a limit in the way: the drive's own halt is left
            self._follow = None
            return None
        return follow.at_rest and self._stands_now

    def _has_left(self, leaving: ModeSwitch, image: AxisImage, order: CycleOutputs) -> bool:
        """Go on along the path, braking, until the drive is in the mode that it was asked for; True once it is, or will not be."""
        try:
            if self._follow is not None:
                self._follow.begin_braking()
            if not leaving.step(image, order):
                return False
            self._follow = None
        except AxisbusError:  # it does not take the mode, or the path breaks off: then along the path, else the drive's own halt
            leaving.cancel(order)
        self._leaving = None
        return True

    def _hold_load(self, image: AxisImage, order: CycleOutputs) -> None:
        """A torque of 0 would drop the load: a mode that holds takes over."""
        modes = [mode for mode in HOLDING_MODES if mode in self._parameters.modes] or list(HOLDING_MODES)
        order.mode = modes[0]
        preload(order, image.reference)
        order.target_torque = None

    def _stands(self, image: AxisImage, order: CycleOutputs) -> bool:
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
        if image.state is PowerState.UNKNOWN:  # only a word that is safe in every state goes to it
            self._go(StopLevel.DISABLE_VOLTAGE, image)
            return False
        return self._next_if_late(image, StopLevel.DISABLE_VOLTAGE)

    def _quick_stop(self, image: AxisImage, order: CycleOutputs) -> bool:
        order.word = order.stopping(cw.PowerCommand.QUICK_STOP, image.state)
        order.goal = PowerState.QUICK_STOP_ACTIVE
        order.target_velocity = 0
        if self._parameters.holds_load is HoldsLoad.NO:
            order.target_torque = 0  # a drive that does not hear the word would let its load fall
        self._by_sdo.send(order.word, image, order)
        if self.seen is PowerState.QUICK_STOP_ACTIVE and (self._stands_now or self._by_sdo.stands):
            return not self._about_to_leave(image) and self._stands(image, order)
        if not self._must_hold(image):
            return self._next_if_late(image, StopLevel.DISABLE_VOLTAGE)
        if not self._expired(image):
            return False
        self.spared = True
        self.confirmed = self._stands_now
        return True

    def _about_to_leave(self, image: AxisImage) -> bool:
        """Whether the drive will take transition 12 by itself (605Ah 0 to 4, once its brake holds): that belongs to the stop."""
        if self._parameters.quick_stop_holds or self._then is AfterStop.DISABLE:
            return False
        return not self._expired(image)

    def _must_hold(self, image: AxisImage) -> bool:
        """Whether cutting the power would let the load fall: what only the motor holds always, a brake while it moves."""
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

    def _next_if_late(self, image: AxisImage, rung: StopLevel) -> bool:
        if self._expired(image):
            key = "disable_time" if self._disabling else _TIMES[self.rung]
            self.late += [] if key in self.late else [key]
            self.on_its_path |= (
                self.rung is StopLevel.HALT and self._follow is not None and not self._follow.at_rest
            )
            if not self._disabling and rung <= StopLevel.DISABLE_VOLTAGE:
                self.unseen = self._standing.why_not(image) if self._relief is None else _NOT_RELIEVED
                self.held = self.held or self._standing.is_held(image)
            self._go(rung, image)
        return False

    def _expired(self, image: AxisImage) -> bool:
        assert self._deadline is not None  # each step begins its rung first
        return image.now > self._deadline

    def _go(self, rung: StopLevel, image: AxisImage | None = None) -> None:
        self.rung = rung
        self.path.append(rung)
        self._disabling = False
        self._relief = None
        self._deadline = None
        if image is not None:
            self._begin_rung(image)

    def _time(self, rung: StopLevel) -> float:
        times = self._parameters.stop_times
        return {
            StopLevel.HALT: times.halt,
            StopLevel.QUICK_STOP: times.quick_stop,
            StopLevel.DISABLE_VOLTAGE: times.disable,
            StopLevel.NMT_STOP: _NMT_STOP_TIME,
        }[rung]


def _is_led(image: AxisImage, follow: Leading) -> bool:
    """Whether the drive is in the mode in which it is led; where that is not known just now, 0 at once would jolt it in csv."""
    return image.mode == follow.mode or (image.mode is None and follow.mode is _CSV)


_STEPS = {
    StopLevel.HALT: StopSequence._halt,
    StopLevel.QUICK_STOP: StopSequence._quick_stop,
    StopLevel.DISABLE_VOLTAGE: StopSequence._disable_voltage,
    StopLevel.NMT_STOP: StopSequence._nmt_stop,
}
