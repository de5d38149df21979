"""Monitor the speed computed from positions, against the commanded speed and ``max_velocity``, in every mode that moves an axis.

Theory of operation
-------------------
If the master sends a velocity in a unit that the drive does not use (revolutions per minute instead of increments per second), the
drive obeys: it reports no error, and reaches its target. Only the positions show the mistake. So the speed computed from positions
is compared in each cycle with ``max_velocity`` (``MARGIN``) and with the commanded speed (``MARGIN_OF_COMMAND``).

Both the median of the last three speeds and the mean of the last six must be too high, in ``_SAMPLES`` consecutive positions. So
encoder noise, a late frame, or a position that homing sets to a new value does not count as speed.

An axis that was faster before may still be fast while it brakes to the new command, and may continue at its old speed until the new
command is in effect. So the excused speed decreases only with the measured speed.
"""

from __future__ import annotations

from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import LimitError
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import Activity
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.velocity_estimator import VelocityEstimator

MARGIN = 1.25  # of max_velocity: a drive's control overshoots
MARGIN_OF_COMMAND = 2.0  # of the commanded speed
_SAMPLES = 3
_NOISE = 3.0  # increments of error of a position
_GRACE = 0.25  # seconds until a sent command acts
_FALLING = 1.1  # of the measured speed, while an axis brakes to a lower one


class SpeedWatch:
    """Monitors one axis; holds the excused speed (increments per s), and the number of consecutive samples above it."""

    __slots__ = ("_activity", "_begins", "_excused", "_limit", "_misses", "_parameters", "_since", "_stamp")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        limit = parameters.limits.velocity
        self._limit = None if limit is None else limit * abs(parameters.units.position.factor)
        self._activity: Activity | None = None
        self._begins = False  # whether the next motion may begin at the present speed
        self._excused = 0.0
        self._misses = 0
        self._stamp = self._since = 0.0

    def error(
        self, image: AxisImage, activity: Activity | None, track: VelocityEstimator
    ) -> LimitError | None:
        """Return why an axis that ``activity`` moves must be stopped; None: no error. ``track``: the track of its positions."""
        # In the cyclic modes the master generates the targets, and ``FollowingErrorMonitor`` monitors the lag behind them.
        if activity is None or activity.set_point_source is not None:
            self._activity, self._excused, self._misses, self._begins = None, 0.0, 0, True
            return None
        if image.position is None or not track.is_known:
            return None
        seen = abs(track.mean)
        asked = self._asked(image, activity, seen)
        limit = self._limit if self._is_comparable(activity) else None
        allowed = min(
            (
                value * margin
                for value, margin in ((asked, MARGIN_OF_COMMAND), (limit, MARGIN))
                if value is not None
            ),
            default=None,
        )
        noise = _NOISE / track.spacing
        if allowed is None or seen <= allowed + noise or abs(track.motion[0]) <= allowed + noise:
            self._misses = 0
            return None
        if image.position_stamp != self._stamp:
            self._stamp = image.position_stamp
            self._misses += 1
        if self._misses < _SAMPLES:
            return None
        return self._too_fast(seen, asked, limit)

    def _is_comparable(self, activity: Activity) -> bool:
        """Whether ``max_velocity`` is known in position increments: from the units, or because the master generates positions."""
        return self._parameters.units.ratio_known or activity.mode is ModeOfOperation.CYCLIC_SYNC_POSITION

    def _asked(self, image: AxisImage, activity: Activity, seen: float) -> float | None:
        """Return the speed that the axis may have because of its commands; None if it is not known."""
        commanded = activity.commanded
        if commanded is None or commanded.speed is None or commanded.by_torque:
            self._activity, self._excused = None, seen
            return None
        asked = abs(commanded.speed)
        if self._begins:  # it may follow a faster motion
            self._begins, self._excused = False, seen
        if activity is not self._activity or not activity.in_effect:
            self._activity, self._since = activity, image.now
        elif image.now > self._since + _GRACE:
            self._excused = min(self._excused, seen * _FALLING)
        self._excused = max(self._excused, asked)
        return self._excused

    def _too_fast(self, seen: float, asked: float | None, limit: float | None) -> LimitError:
        name, units = self._parameters.name, self._parameters.units.position
        per = abs(units.factor)
        over_limit = limit is not None and seen > limit * MARGIN
        most = [] if asked is None else [f"commanded was at most {asked / per:g}"]
        if limit is not None:
            most.append(f"max_velocity is {limit / per:g}")
        return LimitError(
            f"{name}: faster than {'max_velocity' if over_limit else 'commanded'}",
            observed=f"{seen / per:g} {units.unit}/s by its positions; {', '.join(most)}",
            remedy="the drive's unit of velocity probably differs from cell.toml, such as revolutions per minute: "
            f"compare 60A9h or the drive's manual with velocity_scale (and acceleration_scale) in [axes.{name}], and "
            "scale with a measured distance; the axis was stopped",
        )
