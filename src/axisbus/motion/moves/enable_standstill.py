"""Check standstill around an enable: the axis must be at standstill before the power is switched on, and after it."""

from __future__ import annotations

import math

from axisbus.cia402 import objects
from axisbus.cia402.state import ENERGISED
from axisbus.errors import MotionTimeout, StateError
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.standstill import StandstillCheck
from axisbus.motion.stop.standstill_monitor import StandstillMonitor


class EnableRest:
    """Holds the standstill checks before and after the power is switched on, and the deadline of each."""

    __slots__ = ("_after", "_before", "_deadline", "_done", "_moving", "_parameters", "_watch")

    def __init__(self, parameters: AxisParameters, moving: bool) -> None:
        """``moving``: an axis that moves is enabled in motion, on purpose."""
        self._parameters = parameters
        self._moving = moving
        self._before: StandstillCheck | None = None
        self._after: StandstillCheck | None = None
        self._watch = StandstillMonitor(parameters)
        self._deadline = math.inf
        self._done = moving or not parameters.has(objects.POSITION_ACTUAL)

    def before(self, image: AxisImage) -> bool:
        """Return whether the power must wait, because the axis was not yet seen at standstill.

        Raises:
            StateError: the axis continues to move.
        """
        if self._done or image.state in ENERGISED:
            return False
        if self._before is None:
            self._before = StandstillCheck(self._parameters, image.now)
            self._deadline = image.now + self._parameters.timing.transition
        self._done = self._before.seen(image)
        if not self._done and image.now > self._deadline:
            raise self._refused(self._before.why_not(image))
        return not self._done

    def after(self, image: AxisImage, *, found: bool) -> bool:
        """Return whether the axis is at standstill with its power on; ``found``: it was found enabled, and may have been moving.

        Raises:
            UncommandedMotion: it was at rest and begins to move.
            MotionTimeout: it does not come to rest.
        """
        if self._after is None:
            self._after = StandstillCheck(self._parameters, image.now)
            self._deadline = image.now + self._parameters.timing.transition
        stands = self._after.seen(image)
        unrest = None if found or self._moving else self._watch.error(image)
        if unrest is not None:
            raise unrest
        if not stands and image.now > self._deadline:
            raise self._restless(self._after.why_not(image))
        return stands

    def _refused(self, why: str) -> StateError:
        name, time = self._parameters.name, self._parameters.timing.transition
        return StateError(
            f"{name}: the axis was not enabled, because it moves",
            observed=f"without power it did not come to standstill within {time:g} s: {why}",
            remedy="wait until it is at standstill, or find the cause of the motion (it coasts, or its load sinks); "
            f"axis.enable(allow_moving=True) catches it in motion; standstill_velocity in [axes.{name}] defines "
            "standstill",
        )

    def _restless(self, why: str) -> MotionTimeout:
        name = self._parameters.name
        return MotionTimeout(
            f"{name}: the axis is enabled, but not at standstill",
            axis=name,
            observed=f"{self._parameters.timing.transition:g} s after it was enabled: {why}",
            remedy="check whether its load is too heavy, its tuning oscillates, or another master commands it; if its 6062h "
            f"is not a demand in the units of 6064h, a wide standstill_window in [axes.{name}] disables the "
            "comparison; the axis was stopped",
        )
