"""Decide when a move of the drive may take over from set-points that the master streams: it must be able to stop in time.

Theory of operation
-------------------
While the mode changes, and until the drive has its set-point, it brakes with its own ramp (6084h). The move has just written this
ramp, and it may be weaker than the deceleration of the path. So before the mode is requested, the position of rest with this ramp
must be within the permitted range of the path. Otherwise the path continues and brakes until this is the case.

The drive is up to two set-points behind the master, and moves evenly between two set-points. So its velocity is the mean of a
period, and the last set-points count as well as the newest one. A path that does not brake continues for some cycles until the
drive takes the mode.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from axisbus.motion.axis.image import AxisImage
from axisbus.motion.cyclic.ramps import VelocityRamp
from axisbus.motion.moves.follow import Follow
from axisbus.motion.position_limits import PositionRange, rest_beyond

_BEHIND = 3  # set-points, the newest of which the drive does not have yet
_AHEAD = 3.0  # scan periods until the drive takes the mode


class PathExit:
    """Whether the drive could brake within the limits if it left ``path`` now; holds the last set-points."""

    def __init__(self, path: Follow, down: float, soft: float, period: float, increment: float) -> None:
        """``down``: deceleration in unit/s², above 0. ``soft``: seconds by which a jerk limit delays it; ``period`` in seconds.

        ``increment``: one increment in units, for rounding.
        """
        self._path = path
        self._down = down
        self._soft = soft
        self._period = period
        self._increment = increment
        self._steps: deque[tuple[float, float]] = deque(maxlen=_BEHIND)

    def __call__(self, _image: AxisImage) -> bool:
        """Evaluate this cycle; must be called in every cycle."""
        if self._path.at_rest:
            return True
        self._steps.append(self._path.last_step)
        low, high = self._path.permitted_range
        permitted_range = PositionRange(low - self._increment, high + self._increment)
        return all(self._fits(permitted_range, *step) for step in (*self._steps, self._ahead()))

    def _ahead(self) -> tuple[float, float]:
        """Return the position and velocity at which the drive takes the mode if the path goes on as it does."""
        (_, before), (at, velocity) = self._steps[max(-2, -len(self._steps))], self._steps[-1]
        time, acceleration = _AHEAD * self._period, (velocity - before) / self._period
        later = velocity + acceleration * time
        if velocity * later <= 0.0:
            return at, velocity
        return at + 0.5 * (velocity + later) * time, later

    def _fits(self, permitted_range: PositionRange, at: float, velocity: float) -> bool:
        return rest_beyond(permitted_range, at + velocity * self._soft, velocity, self._down) is None


def velocity_exit(
    ramp: VelocityRamp, overrun: Callable[[AxisImage], float | None]
) -> Callable[[AxisImage], bool]:
    """Return the same for an axis in csv; ``overrun``: where it would come to rest, if beyond its limits (``LimitMonitor``)."""

    def may_leave(image: AxisImage) -> bool:
        return ramp.at_rest or overrun(image) is None

    return may_leave
