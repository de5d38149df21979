"""The set-points that brake a motion in its own mode: pure functions of readings and time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.drives.gim6010.modbus.motion.look import StatusRead

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
