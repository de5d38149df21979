"""Monitor the following error: the distance between the commanded and the actual position while the axis moves.

Theory of operation
-------------------
In the position modes the commanded position is 6062h; in csp it is the target that was sent. In profile velocity mode it is the
ramped velocity command, integrated (``VelocityRampTracker``). A drive may lag: because of its filters, by one or two scan periods,
or by an inhibit time. So the allowed error is ``standstill_window`` plus the distance covered in 0.25 s at the highest commanded
speed of the last 0.5 s to 1 s. ``following_error``, or the drive's own window (6065h) in the position modes, replaces this
distance. A larger error in two consecutive samples means a jam, a limit of the drive, a slipping coupling, or a drive that ignores
its commands.

Both values of a comparison belong to the same time: 6062h is compared with the position at its own sample time
(``AxisImage.lead``), however rarely 6062h arrives. Two samples of such a rare 6062h give only the mean speed between them. The
speed at the end may be higher, by the speed that the ramp adds in half of that time. If 6062h is not compared (it is missing, not
trusted, or ``following_error = "off"``), the drive's own monitoring counts in pp: bit 13 of the statusword, which the drive sets
according to 6065h and 6066h.
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
# Scan periods from a csp target to the position that it causes, beyond the cycle of the comparison.
_TARGET_SEEN = 2.0
_SPEED_TIME = 0.5  # seconds for which a commanded speed justifies a lag
_TWICE = 2  # consecutive samples
_SELDOM = 2.5  # scan periods between two demands: beyond this, the speed between them was not constant
_PP = int(_M.PROFILE_POSITION)

_REMEDY = (
    "check whether the axis is blocked, overloaded or badly tuned, or its drive limits torque or velocity (6072h, 607Fh, "
    "6080h), or counts velocities in a unit of its own (velocity_scale); keep clear: a blocked axis may jump when it comes free"
)


class RecentPeak:
    """The highest value of the last half to whole second; holds two buckets."""

    __slots__ = ("_before", "_now", "_until")

    def __init__(self) -> None:
        self._before = self._now = 0.0
        self._until = -math.inf

    def note(self, value: float, now: float) -> float:
        """Add a value; return the highest."""
        if now >= self._until:
            late = now >= self._until + _SPEED_TIME
            self._before, self._now, self._until = (0.0 if late else self._now), 0.0, now + _SPEED_TIME
        if value > self._now:
            self._now = value
        return self._now if self._now > self._before else self._before


class FollowingErrorMonitor:
    """Monitors one axis.

    Holds the last commanded position, its highest speed, and the number of consecutive samples beyond the allowed error. ``_mode``:
    the position mode in which the activity commands the axis; None in other modes. ``commanded_at``: the time of the last commanded
    position.
    """

    __slots__ = (
        "_activity",
        "_bit_was_clear",
        "_commanded_position",
        "_misses",
        "_mode",
        "_parameters",
        "_peak",
        "_since",
        "_stamp",
        "_window",
        "commanded_at",
    )

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._window = parameters.pull_window  # within this window no further computation is needed
        self.forget()

    def forget(self, activity: Activity | None = None) -> None:
        """Monitor ``activity`` from its beginning (None: monitor nothing)."""
        self._activity = activity
        self._mode = None if activity is None or activity.mode not in FOLLOWED else activity.mode
        self._peak = RecentPeak()
        self._commanded_position: int | None = None
        self.commanded_at = -math.inf
        self._stamp = -math.inf
        self._misses = 0
        self._since = math.inf
        self._bit_was_clear = False  # bit 13 was clear at some time since the activity began

    def error(self, image: AxisImage, activity: Activity | None) -> FollowingError | None:
        """Return why the axis must be stopped: it is too far from the position commanded by ``activity``. None: no error."""
        if activity is not self._activity:
            # A motion that begins in another one still has the lag of the speed before it.
            peak = self._peak
            self.forget(activity)
            self._peak = peak
        if activity is None or image.position is None:
            return None
        distance, speed, stamp = activity.behind, activity.commanded_speed, image.position_stamp
        if distance is None:
            if self._mode is None or image.mode != self._mode:
                self._misses = 0
                return None
            distance, stamp = self._distance_to_commanded(image)
            if distance is None:
                self._misses = 0
                return self._by_drive(image) if image.mode == _PP else None
            speed = self._speed(image, activity)
        top = self._peak.note(speed, image.now)
        if -self._window <= distance <= self._window:
            self._misses, self._since = 0, math.inf
            return None
        allowed = self._allowed(top, image, activity)
        if abs(distance) <= allowed:
            self._misses, self._since = 0, math.inf
            return None
        if stamp == self._stamp:
            return None
        self._stamp = stamp
        self._misses += 1
        self._since = min(self._since, image.now)
        if self._misses < _TWICE or image.now < self._since + self._parameters.drive_following_time:
            return None
        return self._failed(image, distance, allowed)

    def is_used_to(self, activity: Activity) -> bool:
        """Whether ``activity`` is monitored in a position mode of the drive, by the commanded position alone."""
        return activity is self._activity and self._mode is not None and activity.behind is None

    def close(self, commanded_position: int, now: float) -> None:
        """Record, as ``error`` does, that the axis is within its window of ``commanded_position``, the last target."""
        before, stamp = self._commanded_position, self.commanded_at
        self._commanded_position, self.commanded_at = commanded_position, now
        self._peak.note(0.0 if before is None else abs(commanded_position - before) / (now - stamp), now)
        self._misses, self._since = 0, math.inf

    def _distance_to_commanded(self, image: AxisImage) -> tuple[float | None, float]:
        """Return the distance of the axis from its commanded position, and the time of the sample."""
        target, position = image.reference_tracker.target, image.position
        lead = image.demand_lead if self._parameters.compares_demand else None
        if target is not None and position is not None:
            off = target - position
            if lead is None or abs(off) >= abs(lead):
                return off, image.position_stamp
        return lead, image.lead_stamp

    def _allowed(self, top: float, image: AxisImage, activity: Activity) -> float:
        parameters, by_position = self._parameters, activity.behind is None
        allowed = parameters.lag_allowed(top, by_position=by_position)
        if image.reference_tracker.target is None or not by_position or not parameters.has_lag_window:
            return allowed
        # A target takes effect with the next SYNC and is reached with the SYNC after it. The position is read one cycle later.
        return allowed + _TARGET_SEEN * top * parameters.scan_period

    def _speed(self, image: AxisImage, activity: Activity) -> float:
        commanded_position, when = image.reference_tracker.target, image.now
        if commanded_position is None:
            commanded_position, when = image.demand, image.demand_stamp
        if commanded_position is None or when <= self.commanded_at:
            return 0.0
        before, stamp = self._commanded_position, self.commanded_at
        self._commanded_position, self.commanded_at = commanded_position, when
        if before is None:
            return 0.0
        passed = when - stamp
        mean = abs(commanded_position - before) / passed
        if passed <= _SELDOM * self._parameters.scan_period or commanded_position == before:
            return mean
        return self._at_end(mean, min(passed, _SPEED_TIME), activity.commanded)

    @staticmethod
    def _at_end(mean: float, passed: float, commanded: CommandedMotion | None) -> float:
        """Return the highest possible speed at the end of an interval of ``passed`` seconds with this ``mean``."""
        if commanded is None or commanded.up is None:
            return mean
        fastest = mean + 0.5 * commanded.up * passed
        return fastest if commanded.speed is None else max(mean, min(fastest, abs(commanded.speed)))

    def _by_drive(self, image: AxisImage) -> FollowingError | None:
        """Return the error of the drive's own monitoring (6065h, 6066h), if its bit 13 was clear before in this motion."""
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
            observed=f"bit 13 of the statusword (0x{word:04X}) was set in this motion: for "
            f"{parameters.drive_following_time:g} s (6066h) the axis was more than {window:g} {units.unit} (6065h) "
            "from the demand of its drive",
            remedy=_REMEDY,
        )

    def _failed(self, image: AxisImage, distance: float, allowed: float) -> FollowingError:
        name, units = self._parameters.name, self._parameters.units.position
        assert image.position is not None
        where = units.to_units(image.position - image.origin)
        off = abs(units.to_units(distance))
        hints = [] if image.statusword is None else sw.hints(image.statusword, image.mode)
        seen = f"at {where:g} {units.unit} it is {off:g} {units.unit} from its expected position; "
        seen += f"{abs(units.to_units(allowed)):g} are allowed"
        return FollowingError(
            f"{name}: the axis does not follow its set-points",
            axis=name,
            observed="; ".join([seen, *hints]),
            remedy=f"{_REMEDY}; following_error in [axes.{name}] sets the allowed lag"
            + (
                ', and demand = "ignore" there excludes a wrong 6062h'
                if image.reference_tracker.target is None
                else ""
            ),
        )
