"""Whether a motor that this program has driven has come to rest since its power went off: off is not yet stopped."""

from __future__ import annotations

from axisbus.cia402 import objects
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.standstill import StandstillCheck


class CoastDown:
    """Holds whether the motor may still be turning without power; one that has been seen to stand may then be turned by hand."""

    __slots__ = ("_driven", "_parameters", "_standing")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._driven = False
        self._standing: StandstillCheck | None = None

    @property
    def under_way(self) -> bool:
        """Whether the power is off and nobody has seen the motor stand since."""
        return self._standing is not None

    def why_not(self, image: AxisImage) -> str:
        """Say what is missing for it to count as standing."""
        return "" if self._standing is None else self._standing.why_not(image)

    def look(self, image: AxisImage, touched: bool) -> None:
        """Take this cycle's values; ``touched``: this program has commanded the drive."""
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
        """A drive with neither position nor velocity says nothing of a motor without power; bit 10 speaks of commands."""
        return self._parameters.has(objects.POSITION_ACTUAL) or image.velocity is not None
