"""How a motion of ours is braked in its own mode, as set-points: pure functions of what is seen and of time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.drives.gim6010.modbus.motion.look import StatusRead

STANDS = 0.05  # turns/s of the rotor: slower is standing
LONGEST_STEP = 0.1  # s of a ramp that one round may make up for
_ARRIVED = 0.05  # turns of the rotor
_AHEAD = 0.02  # s from a look until the module has the set-point


def ramped(value: float, target: float, rate: float, dt: float) -> float:
    """Return ``value`` brought nearer to ``target`` by at most ``rate`` (1/s) in ``dt`` s."""
    step = rate * max(0.0, dt)
    return target if abs(target - value) <= step else value + math.copysign(step, target - value)


def trapezoid_time(distance: float, velocity: float, acceleration: float, deceleration: float) -> float:
    """Return the s that a move takes from rest to rest; all positive but the distance."""
    ramps = velocity / acceleration + velocity / deceleration
    on_ramps = 0.5 * velocity * ramps
    if abs(distance) >= on_ramps:
        return ramps + (abs(distance) - on_ramps) / velocity
    peak = math.sqrt(2.0 * abs(distance) / (1.0 / acceleration + 1.0 / deceleration))
    return peak / acceleration + peak / deceleration


class HaltInputs(NamedTuple):
    """What a set-point is made of: a look, the time now and since the last step (s), and the set-point before (None: none yet)."""

    seen: StatusRead
    now: float
    dt: float
    before: float | None


@dataclass(frozen=True, slots=True)
class TrapezoidHalt:
    """A trapezoid is led to the place at which it can stop; ``deceleration`` (turns/s²) is what the module was given.

    ``target`` is where it was to go: one that stands there is left alone.
    """

    deceleration: float
    target: float
    register = "position_setpoint"
    last = None  # its one set-point is the last

    def setpoint(self, moment: HaltInputs) -> float | None:
        """Return the target, once: None where it was given, the place is not known, or it does not move."""
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
        """Return the s that it may take from a velocity (turns/s)."""
        return 1.0 + 2.0 * abs(velocity) / self.deceleration


@dataclass(frozen=True, slots=True)
class RampHalt:
    """A velocity goes down in steps from the one that was commanded last; ``deceleration`` in turns/s²."""

    deceleration: float
    commanded: float
    register = "velocity_setpoint"
    last = 0.0

    def setpoint(self, moment: HaltInputs) -> float | None:
        """Return the next velocity; None where it is 0 already."""
        last = self.commanded if moment.before is None else moment.before
        return (
            None
            if moment.before == 0.0
            else ramped(last, 0.0, self.deceleration, min(moment.dt, LONGEST_STEP))
        )

    def longest(self, velocity: float) -> float:
        """Return the s that it may take from a velocity (turns/s)."""
        return 1.0 + 2.0 * max(abs(self.commanded), abs(velocity)) / self.deceleration


Halting = TrapezoidHalt | RampHalt
