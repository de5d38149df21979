"""An ideal drive in software: it acts at once, follows exactly, and has no load.

Theory of operation
-------------------
A cycle is ``advance`` with the outputs of the previous cycle, and then ``take`` for the present outputs. The motion is defined by a
*wish*, made of state, mode, halt and targets. When the wish changes, a new profile begins at the present position and velocity, so
that nothing jumps. Only cyclic synchronous position has no profile: there the axis is at its target one cycle later.

- Halt brakes with 6084h. A quick stop brakes with the quick-stop deceleration, and so does every command that switches the power
  off in motion: if a master axis stopped from one cycle to the next, all axes that follow it would jerk.
- After the quick stop the drive leaves *quick stop active* automatically (605Ah as its default, 2).
- A target of a cyclic mode counts only during that mode: a new mode, enabling and halt discard it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.cell.virtual import SETTINGS
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
    """Come to rest."""

    down: float


class _Go(NamedTuple):
    """Move to a position (unwrapped increments) and rest there."""

    target: int
    ramps: RampLimits


class _Turn(NamedTuple):
    """Keep moving at a velocity."""

    velocity: int
    ramps: RampLimits


class _Follow(NamedTuple):
    """Be at the target of each cycle."""


_FOLLOW = _Follow()
_Wish = _Rest | _Go | _Turn | _Follow


class VirtualDrive:
    """Holds state, mode, position and velocity of a virtual axis, and its last outputs; all in increments and seconds."""

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

    # -- inputs for the core ---------------------------------------------------------------------------------------------

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
        """Bit 12, with its meaning in the present mode."""
        if self.mode == _PP:
            return self._acknowledged
        if self.mode == _PV:
            return not self._way.velocity
        return self.mode == _CSP and not self._halted

    def value(self, index: int) -> int | None:
        """Return an object that motion reads by SDO; None if it does not exist."""
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
            self._whole, self._part = self._wish.target, 0.0  # exactly, without the rounding errors
            return
        whole = math.floor(self._part)
        self._whole, self._part = self._whole + whole, self._part - whole

    def take(self, outputs: Outputs) -> None:
        """Take the outputs of this cycle: first mode and targets, so that they are set when the controlword acts."""
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
        """Take the outputs if they contain nothing new, or only the next target of a path; return whether this is so."""
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
        """Discard all earlier targets."""
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

    # -- motion -----------------------------------------------------------------------------------------------------------

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
        """Begin a new profile if ``wish`` differs from the previous one."""
        if wish == self._wish and type(wish) is type(self._wish):
            return
        self._wish, velocity = wish, self._way.velocity
        if isinstance(wish, _Go):
            self._way = to_distance(velocity, wish.target - self._whole - self._part, wish.ramps)
        elif isinstance(wish, _Turn):
            self._way = to_velocity(velocity, wish.velocity, wish.ramps)
        elif isinstance(wish, _Rest):
            self._way = to_rest(velocity, wish.down)
