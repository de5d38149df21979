"""Decide the end of a command that ends at rest: it is done when the axis is seen at standstill, not when the drive reports it."""

from __future__ import annotations

from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import MotionTimeout
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import Activity
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.standstill import StandstillCheck

# Seconds after which a reported end no longer counts: an axis that overshoots passes its target twice.
_PASSED = 0.5


class ArrivalCheck:
    """Holds the standstill check of the running command, and the deadline for standstill after the command's own end."""

    __slots__ = ("_deadline", "_parameters", "_reported", "_since", "_standstill_check", "_time")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._standstill_check: StandstillCheck | None = None
        self._since = 0.0
        self._reported = 0.0  # when the end was last reported
        self._deadline: float | None = None
        self._time = 0.0  # seconds from the end to that deadline

    def begin(self, activity: Activity, now: float) -> None:
        """Begin with a new command; values received before do not count."""
        self._standstill_check = self._deadline = None
        if activity.ends_at_rest:
            self._since = now
            homing = activity.mode is ModeOfOperation.HOMING
            self._standstill_check = StandstillCheck(self._parameters, now, homing=homing)

    def complete(self, activity: Activity, done: bool, image: AxisImage) -> bool:
        """Return whether a command that is ``done`` by its own rule has ended.

        Raises:
            MotionTimeout: the axis does not come to rest.
        """
        check = self._standstill_check
        if check is None:
            return done
        if activity.rests_from > self._since:  # in every cycle of a motion that has not reached its end yet
            self._since = activity.rests_from
            check.begin(self._since)
        at_standstill = check.seen(image)
        if done:
            self._reported = image.now
        elif image.now - self._reported > _PASSED:
            self._deadline = None
        if not done or at_standstill:
            return done
        if self._deadline is None:
            self._time = self._parameters.timing.progress + activity.settling
            self._deadline = image.now + self._time
        if image.now > self._deadline:
            raise self._late(check.why_not(image))
        return False

    def _late(self, why: str) -> MotionTimeout:
        name, time = self._parameters.name, self._time
        return MotionTimeout(
            f"{name}: the axis does not come to standstill",
            axis=name,
            observed=f"the drive reported the end of the motion {time:.3g} s ago, but standstill of the axis was not observed "
            f"since: {why}",
            remedy="check whether it oscillates (tuning), is driven by its load, or is blocked; standstill_velocity and "
            f"standstill_window in [axes.{name}] define standstill",
        )
