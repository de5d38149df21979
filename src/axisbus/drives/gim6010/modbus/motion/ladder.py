"""The stop sequence of a module on Modbus, a pure state machine of readings and time: the step, the next request, the outcome.

Theory of operation
-------------------
The steps go from soft to hard, and the sequence never returns to a softer one. HALT brakes in the mode of the motion. BRAKE is
velocity control with a velocity of 0, on the module's own ramp. IDLE switches the power off. ESTOP writes the emergency stop
register. HALT and BRAKE end when standstill is seen, and also if the motor no longer becomes slower, or the module does not answer.
IDLE and ESTOP end when idle is seen. Each request is repeated until it is read back. Standstill can be seen in closed loop only,
because positions are not valid in idle: if a module had to be switched off before standstill was seen, its standstill is reported
as unknown. A motor that has not begun to move yet is not at standstill either: a halt is over only when its last set-point is read
back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import NamedTuple

from axisbus.drives.gim6010.can_simple.states import IDLE, state_words
from axisbus.drives.gim6010.modbus.module import StatusRead

# -- The set-points that brake a motion in its own mode ----------------------------------------------------------------


STANDS = 0.05  # turns/s of the rotor: a lower speed counts as standstill
LONGEST_STEP = 0.1  # s of a ramp that one late round may catch up
_ARRIVED = 0.05  # turns of the rotor
_AHEAD = 0.02  # s from a reading until the module has the set-point


def ramped(value: float, target: float, rate: float, dt: float) -> float:
    """Return ``value`` brought nearer to ``target`` by at most ``rate`` (1/s) in ``dt`` s."""
    step = rate * max(0.0, dt)
    return target if abs(target - value) <= step else value + math.copysign(step, target - value)


def trapezoid_time(distance: float, velocity: float, acceleration: float, deceleration: float) -> float:
    """Return the duration in s of a move from rest to rest; all arguments except the distance are positive."""
    ramps = velocity / acceleration + velocity / deceleration
    on_ramps = 0.5 * velocity * ramps
    if abs(distance) >= on_ramps:
        return ramps + (abs(distance) - on_ramps) / velocity
    peak = math.sqrt(2.0 * abs(distance) / (1.0 / acceleration + 1.0 / deceleration))
    return peak / acceleration + peak / deceleration


class HaltInputs(NamedTuple):
    """The inputs for a set-point: a reading, the time and the time since the last step (s), the previous set-point or None."""

    seen: StatusRead
    now: float
    dt: float
    before: float | None


@dataclass(frozen=True, slots=True)
class TrapezoidHalt:
    """Shortens a trapezoid to the position at which the motor can stop; ``deceleration`` (turns/s²) is that of the move.

    ``target`` is the end of the move: a motor at standstill there gets no set-point.
    """

    deceleration: float
    target: float
    register = "position_setpoint"
    last = None  # its one set-point is the last

    def setpoint(self, moment: HaltInputs) -> float | None:
        """Return the target once; None if it was already returned, the position is unknown, or the motor does not move."""
        place, velocity = moment.seen.position, moment.seen.velocity
        if moment.before is not None or place is None or velocity is None:
            return None
        if abs(velocity) <= STANDS and abs(place - self.target) <= _ARRIVED:
            return None
        ahead = max(0.0, moment.now - moment.seen.at) + _AHEAD
        braked = place + velocity * ahead + velocity * abs(velocity) / (2.0 * self.deceleration)
        beyond = (braked - self.target) * velocity > 0.0 and (self.target - place) * velocity >= 0.0
        return self.target if beyond else braked

    def longest(self, velocity: float) -> float:
        """Return the time limit in s for braking from a velocity (turns/s)."""
        return 1.0 + 2.0 * abs(velocity) / self.deceleration


@dataclass(frozen=True, slots=True)
class RampHalt:
    """Ramps the velocity down in steps, from the last commanded one; ``deceleration`` in turns/s²."""

    deceleration: float
    commanded: float
    register = "velocity_setpoint"
    last = 0.0

    def setpoint(self, moment: HaltInputs) -> float | None:
        """Return the next velocity; None if it is already 0."""
        last = self.commanded if moment.before is None else moment.before
        return (
            None
            if moment.before == 0.0
            else ramped(last, 0.0, self.deceleration, min(moment.dt, LONGEST_STEP))
        )

    def longest(self, velocity: float) -> float:
        """Return the time limit in s for braking from a velocity (turns/s)."""
        return 1.0 + 2.0 * max(abs(self.commanded), abs(velocity)) / self.deceleration


Halting = TrapezoidHalt | RampHalt


# -- The stop sequence -------------------------------------------------------------------------------------------------


_UNMOVED = 0.02  # turns of the rotor, over
_STILL = 0.15  # s
_STUCK = 1.0  # s within which the lowest speed so far must fall by STANDS
_LONGEST = 30.0  # s of BRAKE, however slow the module's ramp is
_POWER = 1.5  # s of IDLE, and of ESTOP
_AGAIN = 0.1  # s until a request that was not read back is sent again


class ModbusStopStep(IntEnum):
    """A step of the stop sequence."""

    HALT = 0
    BRAKE = 1
    IDLE = 2
    ESTOP = 3


class Send(Enum):
    """The request to send now; SETPOINT comes with a value."""

    NOTHING = "nothing"
    SETPOINT = "a set-point of the motion"
    BRAKE = "velocity control, velocity 0"
    IDLE = "idle"
    ESTOP = "emergency stop"


@dataclass(frozen=True, slots=True)
class StopOutcome:
    """The outcome of a stop; ``ok``: the requested end was seen. ``text`` is for the user, ``rung`` is the last step."""

    ok: bool
    text: str
    rung: ModbusStopStep
    is_off: bool = False  # idle was seen


class ModbusStopSequence:
    """One run of the stop sequence; holds the present step, the readings in it, and at the end the outcome."""

    def __init__(self, halting: Halting | None, *, hold: bool = False, was_closed: bool = True) -> None:
        """``halting`` brakes a motion of this program in its own mode; None begins with BRAKE.

        ``hold``: the sequence ends with standstill in closed loop. ``was_closed``: whether closed loop was seen before.
        """
        self.halting = halting
        self._hold = hold
        self._was_closed = was_closed
        self.rung = ModbusStopStep.BRAKE if halting is None else ModbusStopStep.HALT
        self.outcome: StopOutcome | None = None
        self.value: float | None = None  # the set-point to send, or the last one sent
        self._new = True  # the step has not begun yet
        self._since = self._sent = self._slower = 0.0
        self._slowest: float | None = None
        self._fastest = 0.0
        self._places: list[tuple[float, float]] = []
        self._stood = False
        self._last: float | None = None

    def escalate(self) -> None:
        """Go to the next step at once, because the user has sent another signal."""
        if self.rung < ModbusStopStep.ESTOP:
            self._go(ModbusStopStep(self.rung + 1))

    def step(self, now: float, seen: StatusRead | None, held: bool) -> Send:
        """Return the request to send at ``now`` (s); ``seen``: last reading (None: no answer), ``held``: last request read back."""
        self._begin(now)
        dt, self._last = now - (now if self._last is None else self._last), now
        if seen is not None:
            self._note(seen, now)
        if self.rung <= ModbusStopStep.BRAKE:
            self._brakes(now, seen, held)
        else:
            self._switches_off(now, seen)
        if self.outcome is not None:
            return Send.NOTHING
        return self._send(now, dt, seen, held and not self._begin(now))

    def _begin(self, now: float) -> bool:
        """Begin the step if it is new; return whether it was."""
        if not self._new:
            return False
        self._new = False
        self._since = self._slower = now
        self._sent = -math.inf  # the first request of a step is sent at once
        self._slowest = None
        return True

    def _go(self, rung: ModbusStopStep) -> None:
        self.rung, self._new = rung, True

    # Readings.

    def _note(self, seen: StatusRead, now: float) -> None:
        self._was_closed |= seen.is_closed
        if seen.position is None or seen.velocity is None:
            self._places.clear()
            return
        speed = abs(seen.velocity)
        self._fastest = max(self._fastest, speed)
        if speed <= STANDS or self._slowest is None or speed < self._slowest - STANDS:
            self._slowest, self._slower = speed, now
        if speed > STANDS:
            self._places.clear()
        self._places = [each for each in self._places if seen.at - each[0] < 2.0 * _STILL]
        self._places.append((seen.at, seen.position))

    @property
    def _stands(self) -> bool:
        """Whether the position was constant over the window, within this step."""
        places = [(at, place) for at, place in self._places if at >= self._since]
        if len(places) < 2 or places[-1][0] - places[0][0] < _STILL:
            return False
        return max(place for _, place in places) - min(place for _, place in places) <= _UNMOVED

    def _brakes(self, now: float, seen: StatusRead | None, held: bool) -> None:
        if seen is not None and seen.state == IDLE:
            self._end("it went to idle without a command")
        elif seen is not None and not seen.is_closed:
            self._go(ModbusStopStep.IDLE)  # a calibration, or an unknown state: set-points have no effect
        elif self._stands and self._is_over(held):
            self._stood = True
            if self._hold:
                self._finish(True, "it is at standstill, and is held in closed loop")
            else:
                self._go(ModbusStopStep.IDLE)
        elif self._is_late(now):
            self._go(ModbusStopStep(self.rung + 1))

    def _is_over(self, held: bool) -> bool:
        """Whether no earlier command can move it any more, as far as this follows from the set-points."""
        if self.rung is ModbusStopStep.HALT and self.halting is not None:
            return self.halting.last in (None, self.value) and (held or self.value is None)
        return held or not self._hold

    def _is_late(self, now: float) -> bool:
        if now - self._slower > _STUCK:
            return True
        longest = _LONGEST
        if self.halting is not None and self.rung is ModbusStopStep.HALT and self.value is not None:
            longest = self.halting.longest(self._fastest)
        return now - self._since > longest

    def _switches_off(self, now: float, seen: StatusRead | None) -> None:
        if seen is not None and seen.state == IDLE and seen.at >= self._since:
            self._end("it is in idle")
        elif now - self._since <= _POWER:
            return
        elif self.rung is ModbusStopStep.IDLE:
            self._go(ModbusStopStep.ESTOP)
        else:
            heard = "it is not heard" if seen is None else f"it is in {state_words(seen.state)}"
            self._finish(
                False, f"NOT CONFIRMED as stopped: {heard} after velocity 0, idle and emergency stop"
            )

    def _end(self, why: str) -> None:
        latched = (
            "; emergency stop latches until its errors are cleared"
            if self.rung is ModbusStopStep.ESTOP
            else ""
        )
        if self._stood:
            self._finish(True, f"it stood, and is in idle, without power{latched}", is_off=True)
        elif not self._was_closed:
            self._finish(
                True, f"it is in idle, without power, and was not seen in closed loop{latched}", is_off=True
            )
        else:
            unknown = "whether it is at standstill is NOT known: in idle it does not report its position"
            self._finish(False, f"{why}, without power; {unknown}{latched}", is_off=True)

    def _finish(self, ok: bool, text: str, *, is_off: bool = False) -> None:
        self.outcome = StopOutcome(ok, text, self.rung, is_off)

    # Requests.

    def _send(self, now: float, dt: float, seen: StatusRead | None, held: bool) -> Send:
        if self.rung is ModbusStopStep.HALT:
            return self._setpoint(now, dt, seen, held)
        if (self.rung is ModbusStopStep.BRAKE and held) or now - self._sent < _AGAIN:
            return Send.NOTHING
        self._sent = now
        return (Send.NOTHING, Send.BRAKE, Send.IDLE, Send.ESTOP)[self.rung]

    def _setpoint(self, now: float, dt: float, seen: StatusRead | None, held: bool) -> Send:
        found = None
        if seen is not None and self.halting is not None:
            found = self.halting.setpoint(HaltInputs(seen, now, dt, self.value))
        if found is not None:
            self.value = found
        elif held or self.value is None or seen is None:
            return Send.NOTHING
        return Send.SETPOINT
