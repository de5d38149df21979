"""Whether an axis goes where it is led: the way between what was asked of it by now and where it is, watched while it moves.

Theory of operation
-------------------
In the position modes what leads the axis is 6062h, and in csp the target that was sent; in profile velocity it is the ramped
command, integrated (``RampedWay``). A drive may lag: by its filters, by a scan or two, by an inhibit time. So the error may be
``standstill_window`` and the way of 0.25 s at the highest speed that was commanded in the last 0.5 s (or ``following_error``).
More than that, in two samples in a row, is a jam, a limit of the drive, a slipping coupling or a drive that does not listen.

Two values are compared as of one time: 6062h with the position of its own sample time (``AxisImage.lead``), however seldom it
comes. Two samples of a 6062h that comes seldom tell only its mean speed between them; it may have ended faster by what its ramp
adds in half of that time. Where 6062h is not compared (it is missing, not believed, or ``following_error = "off"``), the drive's
own watch counts in pp: bit 13 of the statusword, which it sets by 6065h and 6066h.
"""

from __future__ import annotations

import math

from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import FollowingError
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.modes import FOLLOWED
from axisbus.motion.moves.activity import Activity
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop_deceleration import CommandedMotion

_M = ModeOfOperation
_TARGET_SEEN = 2.0  # scan periods from a target of csp to the position that it leads to, beyond the cycle in which it is compared
_SPEED_TIME = 0.5  # seconds that a commanded speed counts for the lag that it excuses
_TWICE = 2  # samples in a row
_SELDOM = 2.5  # scan periods between two demands: then the speed between them was not even
_PP = int(_M.PROFILE_POSITION)

_REMEDY = (
    "look whether the axis is blocked, overloaded or badly tuned, or its drive limits torque or velocity (6072h, 607Fh, 6080h); "
    "keep clear: what is held may leap when it comes free"
)


class RecentPeak:
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


class FollowingErrorMonitor:
    """Watches one axis; holds where it was led last, the highest speed of that, and how often in a row it was too far off.

    ``_mode`` is the position mode in which its activity leads it; None where that is another mode. ``led_at``: when it was led so.
    """

    __slots__ = (
        "_activity",
        "_bit_was_clear",
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
        self.forget()

    def forget(self, activity: Activity | None = None) -> None:
        """Watch ``activity`` from its beginning (None: nothing)."""
        self._activity = activity
        self._mode = None if activity is None or activity.mode not in FOLLOWED else activity.mode
        self._peak = RecentPeak()
        self._led: int | None = None
        self.led_at = -math.inf
        self._stamp = -math.inf
        self._misses = 0
        self._since = math.inf
        self._bit_was_clear = False  # of bit 13, since the activity began

    def error(self, image: AxisImage, activity: Activity | None) -> FollowingError | None:
        """Return why the axis must be stopped: it is too far from where ``activity`` leads it; None when all is well."""
        if activity is not self._activity:
            self.forget(activity)
        if activity is None or image.position is None:
            return None
        way, speed, stamp = activity.behind, activity.led_speed, image.position_stamp
        if way is None:
            if self._mode is None or image.mode != self._mode:
                self._misses = 0
                return None
            way, stamp = self._led_off(image)
            if way is None:
                self._misses = 0
                return self._by_drive(image) if image.mode == _PP else None
            speed = self._speed(image, activity)
        top = self._peak.note(speed, image.now)
        if -self._window <= way <= self._window:
            self._misses, self._since = 0, math.inf
            return None
        allowed = self._allowed(top, image, activity)
        if abs(way) <= allowed:
            self._misses, self._since = 0, math.inf
            return None
        if stamp == self._stamp:
            return None
        self._stamp = stamp
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

    def _led_off(self, image: AxisImage) -> tuple[float | None, float]:
        """Return how far the axis is from where it is led, and when that was sampled."""
        target, position = image.led.target, image.position
        lead = image.demand_lead if self._parameters.compares_demand else None
        if target is not None and position is not None:
            off = target - position
            if lead is None or abs(off) >= abs(lead):
                return off, image.position_stamp
        return lead, image.lead_stamp

    def _allowed(self, top: float, image: AxisImage, activity: Activity) -> float:
        parameters, by_position = self._parameters, activity.behind is None
        allowed = parameters.lag_allowed(top, by_position=by_position)
        if image.led.target is None or not by_position or not parameters.has_lag_window:
            return allowed
        # A target takes effect with the next SYNC and is reached with the SYNC after it, and that is read one cycle later.
        return allowed + _TARGET_SEEN * top * parameters.scan_period

    def _speed(self, image: AxisImage, activity: Activity) -> float:
        led, when = image.led.target, image.now
        if led is None:
            led, when = image.demand, image.demand_stamp
        if led is None or when <= self.led_at:
            return 0.0
        before, stamp = self._led, self.led_at
        self._led, self.led_at = led, when
        if before is None:
            return 0.0
        passed = when - stamp
        mean = abs(led - before) / passed
        if passed <= _SELDOM * self._parameters.scan_period or led == before:
            return mean
        return self._at_end(mean, min(passed, _SPEED_TIME), activity.course)

    @staticmethod
    def _at_end(mean: float, passed: float, course: CommandedMotion | None) -> float:
        """Return the highest speed at the end of a time that ``passed`` with this ``mean``."""
        if course is None or course.up is None:
            return mean
        fastest = mean + 0.5 * course.up * passed
        return fastest if course.speed is None else max(mean, min(fastest, abs(course.speed)))

    def _by_drive(self, image: AxisImage) -> FollowingError | None:
        """Return what the drive's own watch says (6065h, 6066h), where it has one and has said so in this motion only."""
        parameters, word = self._parameters, image.statusword
        if parameters.drive_following_error is None or word is None:
            return None
        if not word & sw.FOLLOWING_ERROR:
            self._bit_was_clear, self._since = True, math.inf
            return None
        self._since = min(self._since, image.now)  # some drives set it before 6066h has passed
        if not self._bit_was_clear or image.now < self._since + parameters.drive_following_time:
            return None
        name, units = parameters.name, parameters.units.position
        window = abs(units.to_units(parameters.drive_following_error))
        return FollowingError(
            f"{name}: its drive reports a following error",
            axis=name,
            observed=f"bit 13 of the statusword (0x{word:04X}) was set in this motion: for {parameters.drive_following_time:g} s "
            f"(6066h) the axis was more than {window:g} {units.unit} (6065h) from where its drive leads it",
            remedy=_REMEDY,
        )

    def _failed(self, image: AxisImage, way: float, allowed: float) -> FollowingError:
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
            remedy=f"{_REMEDY}; following_error in [axes.{name}] sets the lag allowed"
            + (', and demand = "ignore" there leaves a wrong 6062h out' if image.led.target is None else ""),
        )
