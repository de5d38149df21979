"""Detect whether a motor that this master has driven has come to rest after its power went off."""

from __future__ import annotations

from axisbus.cia402 import objects
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.standstill import StandstillCheck


class CoastDown:
    """Holds whether the motor may still turn without power.

    Once standstill was seen, later motion without power does not count: the motor may then be turned by hand.
    """

    __slots__ = ("_driven", "_parameters", "_standing")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._driven = False
        self._standing: StandstillCheck | None = None

    @property
    def under_way(self) -> bool:
        """Whether the power is off and standstill has not been seen since."""
        return self._standing is not None

    def why_not(self, image: AxisImage) -> str:
        """Return the missing condition for standstill as a text; empty if the motor is not coasting."""
        return "" if self._standing is None else self._standing.why_not(image)

    def look(self, image: AxisImage, touched: bool) -> None:
        """Evaluate this cycle's values. ``touched``: this master has commanded the drive."""
        if image.state in ENERGISED:
            self._driven, self._standing = self._driven or touched, None
        elif self._driven and image.state is not PowerState.UNKNOWN:
            self._run_down(image)

    def _run_down(self, image: AxisImage) -> None:
        if self._standing is None:
            self._standing = StandstillCheck(self._parameters, image.now)
        if self._standing.seen(image) or not self._can_tell(image):
            self._driven, self._standing = False, None

    def _can_tell(self, image: AxisImage) -> bool:
        """Whether motion without power can be detected: the drive has a position or a velocity. Bit 10 refers only to commands."""
        return self._parameters.has(objects.POSITION_ACTUAL) or image.velocity is not None
