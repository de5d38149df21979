"""Limits while an axis moves freely: position limits ahead of a velocity or torque move, and the velocity limit under torque."""

from __future__ import annotations

from axisbus.errors import LimitError
from axisbus.motion.image import Image
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.profile import braking_distance
from axisbus.motion.states import AxisState

_OVERSPEED = 1.1  # measured velocity is noisy
_REACTION = 4.0  # scan periods from the velocity that was seen to where a halt begins to brake the axis


class Guard:
    """Sees danger in time to brake; holds the last position and speed, to know the velocity in position increments."""

    __slots__ = ("_before", "_last", "_parameters", "_stamp")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._last: int | None = None
        self._before: float | None = None  # the velocity between the two positions before
        self._stamp = 0.0

    def danger(
        self, image: Image, state: AxisState, *, bounded: bool = True, ramp: float | None = None
    ) -> LimitError | None:
        """Return why the axis must be stopped now, None when all is well.

        ``bounded``: whether the position limits hold. ``ramp``: what a halt brakes with, in position increments per s², where the
        running command says it.
        """
        if state is not AxisState.CONTINUOUS_MOTION or image.position is None:
            self._last = self._before = None
            return None
        velocity = self._velocity(image)
        if velocity is None:
            return None
        return self._too_fast(velocity) or (self._too_far(image, velocity, ramp) if bounded else None)

    def _velocity(self, image: Image) -> float | None:
        """Increments per second: the slower of the last two differences of position.

        A frame that is taken from the adapter late makes one difference too slow and the next one too fast. Of a busy computer's
        jitter only the second would look like danger.
        """
        last, stamp = self._last, self._stamp
        if image.position_stamp == stamp and last is not None:
            return None
        self._last, self._stamp = image.position, image.position_stamp
        if last is None or image.position is None:
            return None
        before, now = self._before, (image.position - last) / (image.position_stamp - stamp)
        self._before = now
        return None if before is None else min(before, now, key=abs)

    def _too_fast(self, velocity: float) -> LimitError | None:
        limit, units = self._parameters.limits.velocity, self._parameters.units.position
        speed = abs(units.to_units(velocity))
        rounding = abs(units.to_units(2)) / self._parameters.scan_period
        if limit is None or speed <= limit * _OVERSPEED + rounding:
            return None
        return LimitError(
            f"{self._parameters.name}: faster than max_velocity",
            observed=f"{speed:g} {units.unit}/s; allowed are {limit:g}",
            remedy=f"lower the torque or velocity, or raise max_velocity in [axes.{self._parameters.name}] of cell.toml; "
            "the axis was stopped",
        )

    def _too_far(self, image: Image, velocity: float, ramp: float | None) -> LimitError | None:
        limits, units = self._parameters.limits.position, self._parameters.units.position
        if limits is None or not velocity or image.position is None:
            return None
        ahead = image.position + self._brake_way(velocity, ramp)
        where = units.to_units(ahead - image.origin)
        now = units.to_units(image.position - image.origin)
        outward = units.to_units(velocity)
        if not ((where > limits[1] and outward > 0) or (where < limits[0] and outward < 0)):
            return None
        return LimitError(
            f"{self._parameters.name}: about to leave its position limits",
            observed=f"at {now:g} {units.unit}, moving at {outward:g} {units.unit}/s, would stop at {where:g}; allowed are "
            f"{limits[0]:g} to {limits[1]:g}",
            remedy="move back into the limits; the axis was stopped",
        )

    def _brake_way(self, velocity: float, ramp: float | None) -> float:
        """Increments until rest: what passes before a halt acts, then the ramp of the command, else that of the defaults."""
        reaction = _REACTION * self._parameters.scan_period * velocity
        ramp = ramp or self._default_ramp
        if not ramp:
            return reaction
        way = braking_distance(velocity, ramp)
        return reaction + (way if velocity > 0 else -way)

    @property
    def _default_ramp(self) -> float | None:
        defaults, units = self._parameters.defaults, self._parameters.units.position
        deceleration = defaults.deceleration or defaults.acceleration
        return None if deceleration is None else abs(deceleration * units.factor)
