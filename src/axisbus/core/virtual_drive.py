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
from collections.abc import Sequence
from typing import NamedTuple

from axisbus.cell.virtual import SETTINGS
from axisbus.cia402 import controlword as cw
from axisbus.cia402 import objects
from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Outputs
from axisbus.cia402.state import STATUSWORD_PATTERNS, PowerState
from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed, Start
from axisbus.units import unwrap, wrap

_PP, _PV = ModeOfOperation.PROFILE_POSITION, ModeOfOperation.PROFILE_VELOCITY
_CSP = ModeOfOperation.CYCLIC_SYNC_POSITION
_ENABLED, _QUICK_STOP = PowerState.OPERATION_ENABLED, PowerState.QUICK_STOP_ACTIVE


# -- Profiles with constant accelerations: from the present velocity to a position, to another velocity, or to rest ----


class RampSegment(NamedTuple):
    """A time in seconds with a constant acceleration (per s², signed); ``end`` is the exact velocity (per s) at its end."""

    seconds: float
    acceleration: float
    end: float


class RampLimits(NamedTuple):
    """Highest speed (per s) and ramps (per s²) of a profile; all above 0."""

    speed: float
    up: float
    down: float


class RampProfile:
    """Successive pieces; holds the remaining ones. After the last one the velocity stays constant."""

    __slots__ = ("_segments", "_time_left", "velocity")

    def __init__(self, velocity: float, segments: Sequence[RampSegment] = ()) -> None:
        """``velocity``: the present one, in increments per s."""
        self.velocity = velocity
        self._segments = list(segments)
        self._time_left = self._segments[0].seconds if self._segments else math.inf
        self.advance(0.0)  # skips pieces without duration

    @property
    def over(self) -> bool:
        """Whether the last piece has ended."""
        return not self._segments

    def advance(self, dt: float) -> float:
        """Advance ``dt`` seconds; return the distance in increments."""
        travelled = 0.0
        while self._segments and dt >= self._time_left:
            segment = self._segments.pop(0)
            travelled += _distance(self.velocity, segment.acceleration, self._time_left)
            dt -= self._time_left
            self.velocity = segment.end
            self._time_left = self._segments[0].seconds if self._segments else math.inf
        acceleration = self._segments[0].acceleration if self._segments else 0.0
        travelled += _distance(self.velocity, acceleration, dt)
        self.velocity += acceleration * dt
        self._time_left -= dt
        return travelled


def to_rest(velocity: float, down: float) -> RampProfile:
    """Return the profile to rest with a deceleration ``down`` above 0."""
    return RampProfile(velocity, [_change(velocity, 0.0, down)])


def to_velocity(velocity: float, target: float, ramps: RampLimits) -> RampProfile:
    """Return the profile to a velocity: it slows down with ``down``, also before a reversal, and speeds up with ``up``."""
    between = target if velocity * target > 0.0 else 0.0  # a reversal comes to rest first
    slower = between if abs(between) < abs(velocity) else velocity
    return RampProfile(velocity, [_change(velocity, slower, ramps.down), _change(slower, target, ramps.up)])


def to_distance(velocity: float, distance: float, ramps: RampLimits) -> RampProfile:
    """Return the profile that ends at rest after ``distance``: directly if braking suffices, otherwise with a reversal."""
    planned = ProfileFromSpeed(Start(0.0, velocity), distance, *ramps).pieces
    ends = [*(speed for _, _, speed, _ in planned[1:]), 0.0]
    return RampProfile(
        velocity,
        [RampSegment(time, rate, end) for (time, _, _, rate), end in zip(planned, ends, strict=True)],
    )


def _change(velocity: float, end: float, rate: float) -> RampSegment:
    return RampSegment(abs(end - velocity) / rate, math.copysign(rate, end - velocity), end)


def _distance(velocity: float, acceleration: float, seconds: float) -> float:
    return seconds * (velocity + 0.5 * acceleration * seconds)


# -- drive -------------------------------------------------------------------------------------------------------------


class _Stop(NamedTuple):
    """Come to rest."""

    down: float


class _MoveTo(NamedTuple):
    """Move to a position (unwrapped increments) and rest there."""

    target: int
    ramps: RampLimits


class _MoveVelocity(NamedTuple):
    """Keep moving at a velocity."""

    velocity: int
    ramps: RampLimits


class _FollowTargets(NamedTuple):
    """Be at the target of each cycle."""


_FOLLOW_TARGETS = _FollowTargets()
_Action = _Stop | _MoveTo | _MoveVelocity | _FollowTargets


class VirtualDrive:
    """Holds state, mode, position and velocity of a virtual axis, and its last outputs; all in increments and seconds."""

    def __init__(self, slow: float, quick: float) -> None:
        """``slow`` and ``quick`` (increments per s², above 0) brake a halt, until 6084h is written, and a quick stop."""
        self.state = PowerState.SWITCH_ON_DISABLED
        self.mode = int(ModeOfOperation.NONE)
        self.settings = dict.fromkeys(SETTINGS, max(1, round(slow)))
        self._quick = quick
        self._whole, self._fraction = 0, 0.0  # of the position
        self._word = 0
        self._acknowledged = False
        self._target: int | None = None  # of cyclic synchronous position
        self._shown_target = 0  # 607Ah
        self._target_velocity = 0
        self._goal: _MoveTo | None = None
        self._action: _Action = _Stop(quick)
        self._profile = RampProfile(0.0)

    # -- inputs for the core ---------------------------------------------------------------------------------------------

    @property
    def position(self) -> int:
        """Actual position, as a drive counts it (INTEGER32)."""
        return wrap(self._unwrapped)

    @property
    def velocity(self) -> int:
        """Actual velocity."""
        return round(self._profile.velocity)

    @property
    def statusword(self) -> int:
        """6041h, with the bits of the mode."""
        word = STATUSWORDS[self.state]
        if self.state is not _ENABLED:
            return word
        if self.mode != _CSP and self._profile.over:
            word |= sw.TARGET_REACHED
        return word | (sw.BIT_12 if self._bit_12() else 0)

    def _bit_12(self) -> bool:
        """Bit 12, with its meaning in the present mode."""
        if self.mode == _PP:
            return self._acknowledged
        if self.mode == _PV:
            return not self._profile.velocity
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
    def _unwrapped(self) -> int:
        """Actual position, unwrapped."""
        return self._whole + round(self._fraction)

    # -- a cycle ---------------------------------------------------------------------------------------------------------

    def advance(self, dt: float) -> None:
        """Let ``dt`` seconds pass."""
        if isinstance(self._action, _FollowTargets):
            assert self._target is not None
            self._profile = RampProfile((self._target - self._whole - self._fraction) / dt)
            self._whole, self._fraction = self._target, 0.0
        else:
            self._advance_profile(dt)
        if self.state is _QUICK_STOP and self._profile.over:
            self._enter_state(PowerState.SWITCH_ON_DISABLED)

    def _advance_profile(self, dt: float) -> None:
        self._fraction += self._profile.advance(dt)
        if isinstance(self._action, _MoveTo) and self._profile.over:
            self._whole, self._fraction = self._action.target, 0.0  # exactly, without the rounding errors
            return
        whole = math.floor(self._fraction)
        self._whole, self._fraction = self._whole + whole, self._fraction - whole

    def take(self, outputs: Outputs) -> None:
        """Take the outputs of this cycle: first mode and targets, so that they are set when the controlword acts."""
        if self._takes_next_target(outputs):
            return
        if outputs.mode is not None and outputs.mode != self.mode:
            self.mode = outputs.mode
            self._forget()
        if outputs.target_velocity is not None:
            self._target_velocity = outputs.target_velocity
        if outputs.target_position is not None:
            self._shown_target = outputs.target_position
        if outputs.controlword is not None:
            self._execute_controlword(outputs.controlword)
        if outputs.nmt_stop:
            self._enter_state(PowerState.SWITCH_ON_DISABLED)
        if outputs.target_position is not None:
            self._target = None if self._halted else unwrap(self._unwrapped, outputs.target_position)
        self._plan(self._wanted_action())

    def _takes_next_target(self, outputs: Outputs) -> bool:
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
            if self._action is not _FOLLOW_TARGETS:
                return False
            self._shown_target, self._target = target, unwrap(self._unwrapped, target)
        return True

    def _execute_controlword(self, word: int) -> None:
        before, self._word = self._word, word
        self._enter_state(after(self.state, word))
        if self._halted:
            self._target = None
        edge = word & ~before & cw.NEW_SET_POINT
        if self.mode != _PP or self.state is not _ENABLED:
            return
        if edge:
            self._goal = _MoveTo(unwrap(self._unwrapped, self._shown_target), self._ramps)
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

    def _wanted_action(self) -> _Action:
        ramps = self._ramps
        if self.state is not _ENABLED:
            return _Stop(self._quick)
        if not self._halted:
            if self.mode == _PV:
                return _MoveVelocity(self._target_velocity, ramps)
            if self.mode == _PP and self._goal is not None:
                return self._goal
            if self.mode == _CSP and self._target is not None:
                return _FOLLOW_TARGETS
        return _Stop(ramps.down)

    def _plan(self, action: _Action) -> None:
        """Begin a new profile if ``action`` differs from the previous one."""
        if action == self._action and type(action) is type(self._action):
            return
        self._action, velocity = action, self._profile.velocity
        if isinstance(action, _MoveTo):
            self._profile = to_distance(velocity, action.target - self._whole - self._fraction, action.ramps)
        elif isinstance(action, _MoveVelocity):
            self._profile = to_velocity(velocity, action.velocity, action.ramps)
        elif isinstance(action, _Stop):
            self._profile = to_rest(velocity, action.down)


# -- The power stage of an axis without one: the state machine of CiA 402, without delays and without faults -----------


_S = PowerState
# Voltage is always present, and only the core controls the axis.
_ALWAYS = sw.VOLTAGE_ENABLED | sw.REMOTE
STATUSWORDS = {state: value | _ALWAYS for _, value, state in STATUSWORD_PATTERNS}
# Results of a quick stop (CiA 402-2 transitions 7, 10, 11); in other states it changes nothing.
_STAGE_QUICK_STOP = {
    _S.READY_TO_SWITCH_ON: _S.SWITCH_ON_DISABLED,
    _S.SWITCHED_ON: _S.SWITCH_ON_DISABLED,
    _S.OPERATION_ENABLED: _S.QUICK_STOP_ACTIVE,
}
# Results of bits 0 and 3, one transition at a time (2, 3, 4, 5, 6, 8, 16).
_SHUTDOWN, _SWITCH_ON, _ENABLE = 0, cw.SWITCH_ON, cw.SWITCH_ON | cw.ENABLE_OPERATION
_NEXT = {
    (_S.SWITCH_ON_DISABLED, _SHUTDOWN): _S.READY_TO_SWITCH_ON,
    (_S.READY_TO_SWITCH_ON, _SWITCH_ON): _S.SWITCHED_ON,
    (_S.READY_TO_SWITCH_ON, _ENABLE): _S.SWITCHED_ON,
    (_S.SWITCHED_ON, _SHUTDOWN): _S.READY_TO_SWITCH_ON,
    (_S.SWITCHED_ON, _ENABLE): _S.OPERATION_ENABLED,
    (_S.OPERATION_ENABLED, _SHUTDOWN): _S.READY_TO_SWITCH_ON,
    (_S.OPERATION_ENABLED, _SWITCH_ON): _S.SWITCHED_ON,
    (_S.QUICK_STOP_ACTIVE, _ENABLE): _S.OPERATION_ENABLED,
}


def after(state: PowerState, controlword: int) -> PowerState:
    """Return the state after a controlword in ``state``."""
    if not controlword & cw.ENABLE_VOLTAGE:
        return _S.SWITCH_ON_DISABLED
    if not controlword & cw.QUICK_STOP:
        return _STAGE_QUICK_STOP.get(state, state)
    wanted = controlword & _ENABLE if controlword & cw.SWITCH_ON else _SHUTDOWN
    return _NEXT.get((state, wanted), state)
