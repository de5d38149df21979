"""Detect whether a motor that this master has driven has come to rest after its power went off."""

from __future__ import annotations

from axisbus.cia402 import objects
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.errors import DriveError
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.standstill import StandstillCheck


class CoastDown:
    """Holds whether the motor may still turn without power.

    Once standstill was seen, later motion without power does not count: the motor may then be turned by hand.
    """

    __slots__ = ("_driven", "_parameters", "_standstill_check")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._driven = False
        self._standstill_check: StandstillCheck | None = None

    @property
    def under_way(self) -> bool:
        """Whether the power is off and standstill has not been seen since."""
        return self._standstill_check is not None

    def why_not(self, image: AxisImage) -> str:
        """Return the missing condition for standstill as a text; empty if the motor is not coasting."""
        return "" if self._standstill_check is None else self._standstill_check.why_not(image)

    def look(self, image: AxisImage, touched: bool) -> None:
        """Evaluate this cycle's values. ``touched``: this master has commanded the drive."""
        if image.state in ENERGISED:
            self._driven, self._standstill_check = self._driven or touched, None
        elif self._driven and image.state is not PowerState.UNKNOWN:
            self._check_coast_down(image)

    def _check_coast_down(self, image: AxisImage) -> None:
        if self._standstill_check is None:
            self._standstill_check = StandstillCheck(self._parameters, image.now)
        if self._standstill_check.seen(image) or not self._can_detect_motion(image):
            self._driven, self._standstill_check = False, None

    def _can_detect_motion(self, image: AxisImage) -> bool:
        """Whether motion without power can be detected: the drive has a position or a velocity. Bit 10 refers only to commands."""
        return self._parameters.has(objects.POSITION_ACTUAL) or image.velocity is not None


# ----------------------------------------------------------------------------------------------------------------------
# Monitor the fault reaction of a drive (605Eh): the drive must stop its motor, and the axis must be seen at standstill.


_FAULTS = frozenset({PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE})


class FaultReaction:
    """Monitors an axis in fault; holds the time until which the motor may move, and whether the error was already reported."""

    __slots__ = ("_deadline", "_parameters", "_reported")

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._deadline: float | None = None
        self._reported = False

    def error(self, image: AxisImage, coast_down: CoastDown, driven: bool) -> DriveError | None:
        """Return, once, the error that the axis does not come to rest. ``driven``: this master has commanded the axis."""
        if image.state not in _FAULTS:
            self._deadline, self._reported = None, False
            return None
        rests = image.state is PowerState.FAULT and not coast_down.under_way
        if rests or self._reported or not driven:
            return None
        if self._deadline is None:
            times = self._parameters.stop_times
            self._deadline = image.now + times.quick_stop + times.disable
        if image.now <= self._deadline:
            return None
        self._reported = True
        return self._moves(image, coast_down)

    def _moves(self, image: AxisImage, coast_down: CoastDown) -> DriveError:
        name, times = self._parameters.name, self._parameters.stop_times
        seen = f"{times.quick_stop + times.disable:g} s after its fault the drive is in state {image.state.value!r}"
        if coast_down.under_way:
            seen += f": its power is off, {coast_down.why_not(image)}"
        else:
            seen += ", which brakes the motor and has not ended"
        return DriveError(
            f"{name}: the stop of the axis could not be confirmed",
            axis=name,
            observed=seen,
            remedy="TREAT THE AXIS AS MOVING: use the emergency stop; then find the cause of its motion (its load, its "
            "fault reaction 605Eh)",
        )
