"""Whether an axis goes where it is led: the way between what was asked of it by now and where it is, watched while it moves.

Theory of operation
-------------------
In the position modes what leads the axis is 6062h, and in csp the target that was sent; in profile velocity it is the ramped
command, integrated (``RampedWay``). A drive may lag: by its filters, by a scan or two, by an inhibit time. So the error may be
``standstill_window`` and the way of 0.25 s at the highest speed that was commanded in the last 0.5 s (or ``following_error``).
More than that, in two samples in a row, is a jam, a limit of the drive, a slipping coupling or a drive that does not listen.
"""

from __future__ import annotations

import math

from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import FollowingError
from axisbus.motion.axis.image import Image
from axisbus.motion.modes import FOLLOWED
from axisbus.motion.moves.activity import Activity
from axisbus.motion.parameters import AxisParameters

_M = ModeOfOperation
_SPEED_TIME = 0.5  # seconds that a commanded speed counts for the lag that it excuses
_TWICE = 2  # samples in a row


class Peak:
    """The highest value of the last half to whole second; holds two buckets."""

    __slots__ = ("_before", "_now", "_until")

    def __init__(self) -> None:
        self._before = self._now = 0.0
        self._until = -math.inf

    def note(self, value: float, now: float) -> float:
        """Take a value; return the highest."""
        if now >= self._until:
            late = now >= self._until + _SPEED_TIME
            self._before, self._now, self._until = (0.0 if late else self._now), 0.0, now + _SPEED_TIME
        if value > self._now:
            self._now = value
        return self._now if self._now > self._before else self._before


class Following:
    """Watches one axis; holds where it was led last, the highest speed of that, and how often in a row it was too far off.

    ``_mode`` is the position mode in which its activity leads it; None where that is another mode. ``led_at``: when it was led so.
    """

    __slots__ = (
        "_activity",
        "_led",
        "_misses",
        "_mode",
        "_parameters",
        "_peak",
        "_since",
        "_stamp",
        "_window",
        "led_at",
    )

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._window = parameters.pull_window  # within it there is nothing to be computed
        self._forget(None)

    def _forget(self, activity: Activity | None) -> None:
        self._activity = activity
        self._mode = None if activity is None or activity.mode not in FOLLOWED else activity.mode
        self._peak = Peak()
        self._led: int | None = None
        self.led_at = -math.inf
        self._stamp = -math.inf
        self._misses = 0
        self._since = math.inf

    def error(self, image: Image, activity: Activity | None) -> FollowingError | None:
        """Return why the axis must be stopped: it is too far from where ``activity`` leads it; None when all is well."""
        if activity is not self._activity:
            self._forget(activity)
        if activity is None or image.position is None:
            return None
        way, speed = activity.behind, activity.led_speed
        if way is None:
            if self._mode is None or image.mode != self._mode:
                self._misses = 0
                return None
            way = image.led.pull(image.demand, image.position, image.state, image.mode)
            speed = self._speed(image)
        if way is None:
            self._misses = 0
            return None
        top = self._peak.note(speed, image.now)
        if -self._window <= way <= self._window:
            self._misses, self._since = 0, math.inf
            return None
        allowed = self._parameters.lag_allowed(top, by_position=activity.behind is None)
        if abs(way) <= allowed + top * self._skew(image):
            self._misses, self._since = 0, math.inf
            return None
        if image.position_stamp == self._stamp:
            return None
        self._stamp = image.position_stamp
        self._misses += 1
        self._since = min(self._since, image.now)
        if self._misses < _TWICE or image.now < self._since + self._parameters.drive_following_time:
            return None
        return self._failed(image, way, allowed)

    def is_used_to(self, activity: Activity) -> bool:
        """Whether ``activity`` is watched, in a position mode of the drive, and by no more than how far the drive is led."""
        return activity is self._activity and self._mode is not None and activity.behind is None

    def close(self, led: int, now: float) -> None:
        """Note as ``error`` does that the axis is within its window of ``led``, the target before that of the cycle at ``now``."""
        before, stamp = self._led, self.led_at
        self._led, self.led_at = led, now
        self._peak.note(0.0 if before is None else abs(led - before) / (now - stamp), now)
        self._misses, self._since = 0, math.inf

    @staticmethod
    def _skew(image: Image) -> float:
        """Seconds between the two values that are compared: one that is polled is of another moment."""
        if image.led.target is not None or image.demand is None:
            return 0.0
        return abs(image.position_stamp - image.demand_stamp)

    def _speed(self, image: Image) -> float:
        led, when = image.led.target, image.now
        if led is None:
            led, when = image.demand, image.demand_stamp
        if led is None or when <= self.led_at:
            return 0.0
        before, stamp = self._led, self.led_at
        self._led, self.led_at = led, when
        return 0.0 if before is None else abs(led - before) / (when - stamp)

    def _failed(self, image: Image, way: float, allowed: float) -> FollowingError:
        name, units = self._parameters.name, self._parameters.units.position
        assert image.position is not None
        where = units.to_units(image.position - image.origin)
        off = abs(units.to_units(way))
        hints = [] if image.statusword is None else sw.hints(image.statusword, image.mode)
        seen = f"at {where:g} {units.unit} it is {off:g} {units.unit} from where it should be by now; "
        seen += f"{abs(units.to_units(allowed)):g} are allowed"
        return FollowingError(
            f"{name}: does not follow what is asked of it",
            axis=name,
            observed="; ".join([seen, *hints]),
            remedy="look whether the axis is blocked, overloaded or badly tuned, or its drive limits torque or velocity (6072h, "
            "607Fh, 6080h); keep clear: what is held may leap when it comes free; following_error in "
            f"[axes.{name}] sets the lag allowed",
        )
