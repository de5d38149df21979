"""An ideal drive in arithmetic: it obeys at once, follows exactly, and knows no load.

Theory of operation
-------------------
A cycle is ``advance`` for what was asked for in the cycle before, and then ``take`` for what is asked for now. What leads the axis
is a *wish*, made of state, mode, halt and targets; where it changes, a new way is laid from the present position and velocity, so
that nothing jumps. Only cyclic synchronous position has no way: there the axis is at its target one cycle later.

- Halt brakes with 6084h. A quick stop brakes with the quick-stop deceleration, and so does whatever takes the power away in motion:
  a master that stood from one cycle to the next would be a jolt for all that follow it.
- After the quick stop it leaves *quick stop active* by itself (605Ah as its default, 2).
- A target of a cyclic mode counts only as long as the mode is there: a new mode, enabling and halt forget it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.cell.virtual.parameters import SETTINGS
from axisbus.cia402 import controlword as cw
from axisbus.cia402 import objects
from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Outputs
from axisbus.cia402.state import PowerState
from axisbus.core.virtual.ramp import RampLimits, RampProfile, to_distance, to_rest, to_velocity
from axisbus.core.virtual.stage import STATUSWORDS, after
from axisbus.units import unwrap, wrap

_PP, _PV = ModeOfOperation.PROFILE_POSITION, ModeOfOperation.PROFILE_VELOCITY
_CSP = ModeOfOperation.CYCLIC_SYNC_POSITION
_ENABLED, _QUICK_STOP = PowerState.OPERATION_ENABLED, PowerState.QUICK_STOP_ACTIVE


class _Rest(NamedTuple):
    """To come to rest."""

    down: float


class _Go(NamedTuple):
    """To go to a position (unwrapped increments) and rest there."""

    target: int
    ramps: RampLimits


class _Turn(NamedTuple):
    """To go on at a velocity."""

    velocity: int
    ramps: RampLimits


class _Follow(NamedTuple):
    """To be where each cycle's target says."""


_FOLLOW = _Follow()
_Wish = _Rest | _Go | _Turn | _Follow


class VirtualDrive:
    """Holds state, mode, position and velocity of a virtual axis, and what it was asked for last; all in increments and seconds."""

    def __init__(self, slow: float, quick: float) -> None:
        """``slow`` and ``quick`` (increments per s², above 0) brake a halt, until 6084h is written, and a quick stop."""
        self.state = PowerState.SWITCH_ON_DISABLED
        self.mode = int(ModeOfOperation.NONE)
        self.settings = dict.fromkeys(SETTINGS, max(1, round(slow)))
        self._quick = quick
        self._whole, self._part = 0, 0.0  # of the position
        self._word = 0
        self._acknowledged = False
        self._target: int | None = None  # of cyclic synchronous position
        self._shown_target = 0  # 607Ah
        self._target_velocity = 0
        self._goal: _Go | None = None
        self._wish: _Wish = _Rest(quick)
        self._way = RampProfile(0.0)

    # -- what it shows -------------------------------------------------------------------------------------------------

    @property
    def position(self) -> int:
        """Actual position, as a drive counts it (INTEGER32)."""
        return wrap(self._place)

    @property
    def velocity(self) -> int:
        """Actual velocity."""
        return round(self._way.velocity)

    @property
    def statusword(self) -> int:
        """6041h, with the bits of the mode."""
        word = STATUSWORDS[self.state]
        if self.state is not _ENABLED:
            return word
        if self.mode != _CSP and self._way.over:
            word |= sw.TARGET_REACHED
        return word | (sw.BIT_12 if self._says_yes() else 0)

    def _says_yes(self) -> bool:
        """Bit 12, as the mode reads it."""
        if self.mode == _PP:
            return self._acknowledged
        if self.mode == _PV:
            return not self._way.velocity
        return self.mode == _CSP and not self._halted

    def value(self, index: int) -> int | None:
        """Return an object that motion asks for by SDO; None where there is no such object."""
        shown = {
            objects.STATUSWORD: self.statusword,
            objects.MODES_OF_OPERATION_DISPLAY: self.mode,
            objects.POSITION_ACTUAL: self.position,
            objects.POSITION_DEMAND: self.position,
            objects.VELOCITY_ACTUAL: self.velocity,
            objects.TARGET_POSITION: self._shown_target,
            objects.TARGET_VELOCITY: self._target_velocity,
        }
        return {**shown, **self.settings}.get(index)

    @property
    def _place(self) -> int:
        """Actual position, unwrapped."""
        return self._whole + round(self._part)

    # -- a cycle ---------------------------------------------------------------------------------------------------------

    def advance(self, dt: float) -> None:
        """Let ``dt`` seconds pass."""
        if isinstance(self._wish, _Follow):
            assert self._target is not None
            self._way = RampProfile((self._target - self._whole - self._part) / dt)
            self._whole, self._part = self._target, 0.0
        else:
            self._go_on(dt)
        if self.state is _QUICK_STOP and self._way.over:
            self._enter_state(PowerState.SWITCH_ON_DISABLED)

    def _go_on(self, dt: float) -> None:
        self._part += self._way.advance(dt)
        if isinstance(self._wish, _Go) and self._way.over:
            self._whole, self._part = self._wish.target, 0.0  # exactly, whatever the arithmetic has rounded
            return
        whole = math.floor(self._part)
        self._whole, self._part = self._whole + whole, self._part - whole

    def take(self, outputs: Outputs) -> None:
        """Take what is asked for in this cycle: first mode and targets, so that the controlword finds them."""
        if self._goes_on(outputs):
            return
        if outputs.mode is not None and outputs.mode != self.mode:
            self.mode = outputs.mode
            self._forget()
        if outputs.target_velocity is not None:
            self._target_velocity = outputs.target_velocity
        if outputs.target_position is not None:
            self._shown_target = outputs.target_position
        if outputs.controlword is not None:
            self._obey(outputs.controlword)
        if outputs.nmt_stop:
            self._enter_state(PowerState.SWITCH_ON_DISABLED)
        if outputs.target_position is not None:
            self._target = None if self._halted else unwrap(self._place, outputs.target_position)
        self._lay(self._wanted())

    def _goes_on(self, outputs: Outputs) -> bool:
        """Take a cycle that asks for nothing new, or for the next target of a path; return whether it is one."""
        word, mode, target, velocity, _, _, _, nmt_stop, _, _, _ = outputs
        if (
            self.state is not _ENABLED
            or word != self._word
            or mode is not None
            or velocity is not None
            or nmt_stop
        ):
            return False
        if target is not None:
            if self._wish is not _FOLLOW:
                return False
            self._shown_target, self._target = target, unwrap(self._place, target)
        return True

    def _obey(self, word: int) -> None:
        before, self._word = self._word, word
        self._enter_state(after(self.state, word))
        if self._halted:
            self._target = None
        edge = word & ~before & cw.NEW_SET_POINT
        if self.mode != _PP or self.state is not _ENABLED:
            return
        if edge:
            self._goal = _Go(unwrap(self._place, self._shown_target), self._ramps)
        self._acknowledged = bool(word & cw.NEW_SET_POINT) and (bool(edge) or self._acknowledged)

    def _enter_state(self, state: PowerState) -> None:
        if state is not self.state:
            self.state = state
            self._forget()

    def _forget(self) -> None:
        """Nothing of what was asked for before acts any more."""
        self._target, self._goal, self._acknowledged = None, None, False

    @property
    def _halted(self) -> bool:
        return bool(self._word & cw.HALT)

    @property
    def _ramps(self) -> RampLimits:
        speed, up, down = (
            float(self.settings[index])
            for index in (
                objects.PROFILE_VELOCITY,
                objects.PROFILE_ACCELERATION,
                objects.PROFILE_DECELERATION,
            )
        )
        return RampLimits(speed, up, down)

    # -- what leads it -----------------------------------------------------------------------------------------------------

    def _wanted(self) -> _Wish:
        ramps = self._ramps
        if self.state is not _ENABLED:
            return _Rest(self._quick)
        if not self._halted:
            if self.mode == _PV:
                return _Turn(self._target_velocity, ramps)
            if self.mode == _PP and self._goal is not None:
                return self._goal
            if self.mode == _CSP and self._target is not None:
                return _FOLLOW
        return _Rest(ramps.down)

    def _lay(self, wish: _Wish) -> None:
        """Lay a new way where ``wish`` is another one than before."""
        if wish == self._wish and type(wish) is type(self._wish):
            return
        self._wish, velocity = wish, self._way.velocity
        if isinstance(wish, _Go):
            self._way = to_distance(velocity, wish.target - self._whole - self._part, wish.ramps)
        elif isinstance(wish, _Turn):
            self._way = to_velocity(velocity, wish.velocity, wish.ramps)
        elif isinstance(wish, _Rest):
            self._way = to_rest(velocity, wish.down)
