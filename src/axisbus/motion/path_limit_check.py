"""Whether a path asks no more of its axis, from one cycle to the next, than the axis may make."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from axisbus.motion.moves.lookahead import Path
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.trajectory import Trajectory

_COMPUTED = 1e-6  # what numbers that were computed from times may be off, as a share
_ULPS = 8.0  # and positions, in units of their last place
_tuple = tuple.__new__  # makes a named tuple of what is known to fit, without the call of its own ``__new__``


@runtime_checkable
class Ramped(Protocol):
    """A trajectory that tells in advance how hard it speeds up and brakes."""

    @property
    def top_acceleration(self) -> float:
        """The highest acceleration in unit/s²."""


class PathSample(NamedTuple):
    """Where a path was in the cycle before, and how fast it came there; unit and unit/s."""

    position: float
    velocity: float = 0.0


class LimitExceeded(NamedTuple):
    """What a step asks too much of, and what was seen."""

    what: str
    seen: str


@dataclass(frozen=True, slots=True)
class PathLimitCheck:
    """What a path may ask for, in ``unit``/s and ``unit``/s² (None: nothing is known); ``key``: where the acceleration comes from.

    ``period`` is that of the scan, in s; ``increment`` the smallest step of the axis: what a path itself has been rounded to is no
    jolt that its drive could see.
    """

    unit: str
    velocity: float | None
    acceleration: float | None
    key: str
    period: float
    increment: float

    def next(self, before: PathSample, position: float) -> PathSample:
        """Return the step to ``position``."""
        return _tuple(PathSample, (position, (position - before.position) / self.period))

    def excess(self, before: PathSample, after: PathSample, hardest: float = 0.0) -> LimitExceeded | None:
        """Return what is too much about a step; ``hardest`` (unit/s²) is allowed in any case."""
        velocity, rate = after.velocity, (after.velocity - before.velocity) / self.period
        slow = self.velocity is None or -self.velocity <= velocity <= self.velocity
        if slow and (self.acceleration is None or -self.acceleration <= rate <= self.acceleration):
            return None  # most steps: what arithmetic may be off does not matter
        speed, rate = abs(velocity), abs(rate)
        off = _ULPS * math.ulp(max(abs(before.position), abs(after.position))) / self.period
        if self.velocity is not None and speed > self.velocity * (1.0 + _COMPUTED) + off:
            return LimitExceeded(
                "faster than max_velocity", f"{speed:g} {self.unit}/s, allowed are {self.velocity:g}"
            )
        if self.acceleration is None:
            return None
        allowed = max(self.acceleration, hardest) * (1.0 + _COMPUTED)
        if rate <= allowed + (off + self.increment / self.period) / self.period:
            return None
        return LimitExceeded(
            f"harder than {self.key}",
            f"from {round(before.velocity, 6) + 0.0:g} to {after.velocity:g} {self.unit}/s within {self.period * 1000:g} ms "
            f"are {rate:g} {self.unit}/s², allowed are {self.acceleration:g}",
        )


def pace_of(parameters: AxisParameters, trajectory: Trajectory) -> PathLimitCheck:
    """Return what ``trajectory`` may ask for.

    Without ``max_velocity`` a jump of position could not be told from a motion. There the acceleration decides: the limit, that
    which the trajectory itself names, or the default.
    """
    limits = parameters.limits
    acceleration, key = limits.acceleration, "max_acceleration"
    if acceleration is None and limits.velocity is None:
        if isinstance(trajectory, Ramped):
            acceleration, key = trajectory.top_acceleration, "its own acceleration"
        else:
            acceleration = parameters.defaults.acceleration
            key = "the default acceleration (max_velocity and max_acceleration are not set)"
    units = parameters.units.position
    return PathLimitCheck(
        units.unit, limits.velocity, acceleration, key, parameters.scan_period, abs(units.to_units(1))
    )


def brakes_smoothly(path: Path, t: float, period: float, speed: float, deceleration: float) -> bool:
    """Whether a path can be slowed down from ``t`` on by ``deceleration`` without a jump; ``speed`` is the signed one there."""
    if not speed:
        return True
    allowed = max(0.0, abs(speed) - deceleration * period) * period
    here = path(t)
    natural = abs(path(t + period) - here)
    share = min(1.0, allowed / natural) if natural else 0.0
    step = math.copysign(1.0, speed) * (path(t + share * period) - here)
    return abs(step - allowed) <= 0.5 * deceleration * period * period
