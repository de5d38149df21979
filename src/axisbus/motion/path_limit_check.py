"""Check of a path, from one cycle to the next, against the velocity and acceleration that its axis permits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from axisbus.motion.parameters import AxisParameters
from axisbus.motion.position_limits import Path
from axisbus.motion.trajectory import Trajectory

_COMPUTED = 1e-6  # relative tolerance for the rounding of numbers computed from times
_ULPS = 8.0  # tolerance for positions, in units of their last place
_tuple = tuple.__new__  # creates a named tuple from valid values, without the call of its own ``__new__``


@runtime_checkable
class Ramped(Protocol):
    """A trajectory that knows its highest acceleration in advance."""

    @property
    def top_acceleration(self) -> float:
        """The highest acceleration in unit/s²."""


class PathSample(NamedTuple):
    """Position of a path in one cycle, and its velocity up to there; unit and unit/s."""

    position: float
    velocity: float = 0.0


class LimitExceeded(NamedTuple):
    """The limit that a step exceeds, and the observed value, as texts."""

    what: str
    seen: str


@dataclass(frozen=True, slots=True)
class PathLimitCheck:
    """Limits of a path in ``unit``/s and ``unit``/s² (None: unknown); ``key``: the setting that the acceleration comes from.

    ``period``: scan period in s. ``increment``: the smallest step of the axis; a change by the rounding of the path to increments
    does not count as a jolt, because the drive could not detect it.
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
        """Return the limit that a step exceeds, or None; accelerations up to ``hardest`` (unit/s²) are permitted in any case."""
        velocity, rate = after.velocity, (after.velocity - before.velocity) / self.period
        slow = self.velocity is None or -self.velocity <= velocity <= self.velocity
        if slow and (self.acceleration is None or -self.acceleration <= rate <= self.acceleration):
            return None  # most steps: rounding does not matter
        speed, rate = abs(velocity), abs(rate)
        off = _ULPS * math.ulp(max(abs(before.position), abs(after.position))) / self.period
        if self.velocity is not None and speed > self.velocity * (1.0 + _COMPUTED) + off:
            return LimitExceeded(
                "faster than max_velocity", f"{speed:g} {self.unit}/s, the limit is {self.velocity:g}"
            )
        if self.acceleration is None:
            return None
        allowed = max(self.acceleration, hardest) * (1.0 + _COMPUTED)
        if rate <= allowed + (off + self.increment / self.period) / self.period:
            return None
        return LimitExceeded(
            f"harder than {self.key}",
            f"from {round(before.velocity, 6) + 0.0:g} to {after.velocity:g} {self.unit}/s within {self.period * 1000:g} ms "
            f"is {rate:g} {self.unit}/s², the limit is {self.acceleration:g}",
        )


def limit_check_of(parameters: AxisParameters, trajectory: Trajectory) -> PathLimitCheck:
    """Return the limits of ``trajectory``.

    Without ``max_velocity``, a jump of position could not be distinguished from a motion. Then the acceleration decides: the limit,
    otherwise that of the trajectory itself, otherwise the default.
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
    """Return whether a path can brake from ``t`` on by ``deceleration`` without a jump; ``speed``: signed speed at ``t``."""
    if not speed:
        return True
    allowed = max(0.0, abs(speed) - deceleration * period) * period
    here = path(t)
    natural = abs(path(t + period) - here)
    share = min(1.0, allowed / natural) if natural else 0.0
    step = math.copysign(1.0, speed) * (path(t + share * period) - here)
    return abs(step - allowed) <= 0.5 * deceleration * period * period
