"""The skew of a beam in every cycle, and its permitted bound.

Theory of operation
-------------------
Skew is the position of the second axis minus that of the first, minus the offset of the pair. This holds if both positions are
confirmed: homed, set, or from an absolute encoder (``homing.required = false``). Without confirmed positions, each drive counts
from its position at power-on, and the skew of the beam is unknown. Then the difference at the first cycle with both positions
counts as square, and only later changes are skew. A node that restarts counts from a new position, so this procedure restarts as
well.
"""

from __future__ import annotations

from axisbus.cia402.state import ENERGISED
from axisbus.errors import SkewError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.gantry.parameters import GantryParameters
from axisbus.motion.states import AxisState

_REMEDY = (
    "find the cause on one side (a closed brake, a collision, a coupling that slips, an encoder that lost counts) before "
    "anything moves; then {name}.disable(), {name}.reset(), {name}.enable(skew=...) with a skew limit that is wide enough, "
    "and {name}.square(velocity=...), slowly"
)

_FRESH = 3.5  # cycles: an older position is reported as outdated


def actual_position_of(core: AxisCore) -> float | None:
    """Return the actual position of an axis in its unit; None if it is unknown."""
    position = core.image.position
    return None if position is None else core.parameters.units.position.to_units(position - core.image.origin)


def demand_position_of(core: AxisCore) -> float | None:
    """Return the demand position (6062h) of an axis in its unit if it is known, otherwise the actual position."""
    image = core.image
    position = image.position if image.demand is None else image.demand
    return None if position is None else core.parameters.units.position.to_units(position - image.origin)


class SkewMonitor:
    """Computes the skew in each cycle; holds the present ``bound`` and the ``skew`` (None: unknown)."""

    def __init__(self, parameters: GantryParameters, first: AxisCore, second: AxisCore) -> None:
        self.bound = parameters.max_skew
        self.skew: float | None = None
        self._parameters = parameters
        self._first, self._second = first, second
        # the difference when both were first seen, if the positions are not confirmed
        self._reference_difference: float | None = None

    @property
    def confirmed(self) -> bool:
        """Whether both positions are confirmed, so that their difference is the true skew."""
        return all(core.homed or not core.parameters.homing.required for core in (self._first, self._second))

    @property
    def is_widened(self) -> bool:
        """Whether more than ``max_skew`` is permitted now."""
        return self.bound > self._parameters.max_skew

    def restore_bound(self) -> None:
        """Restore ``max_skew`` as the bound."""
        self.bound = self._parameters.max_skew

    @property
    def square(self) -> float:
        """Position of the second axis minus that of the first if the beam is square."""
        return (
            self._parameters.offset
            if self.confirmed or self._reference_difference is None
            else self._reference_difference
        )

    def update(self) -> None:
        """Compute the skew from the positions of the previous cycle; once per cycle, before the axes."""
        first, second = self._first, self._second
        a, b = actual_position_of(first), actual_position_of(second)
        if a is None or b is None or not (first.image.operational and second.image.operational):
            self._reference_difference = self.skew = None
            return
        if self.confirmed:
            self._reference_difference = None
        elif self._reference_difference is None:
            self._reference_difference = b - a - (self.skew or 0.0)  # keep the skew that was known before
        self.skew = b - a - self.square

    @property
    def energised(self) -> bool:
        """Whether this program drives the motor of either axis."""
        return any(core.touched and core.image.state in ENERGISED for core in (self._first, self._second))

    def present_error(self) -> SkewError | None:
        """Return the error for an energised beam in this cycle; None if there is none, or if the beam is not energised."""
        if not self.energised or not self.failing():
            return None
        if self.skew is not None and abs(self.skew) <= self.bound:
            return None
        return self.error(f"{self._parameters.name}: both axes were stopped")

    def failing(self) -> list[AxisCore]:
        """Return the axes that a skew error must stop; an axis that is being stopped because the other has failed is left out."""
        both = (self._first, self._second)
        healthy = [core for core in both if core.state is not AxisState.ERRORSTOP]
        return [core for core in healthy if len(healthy) == len(both) or core.stop_sequence is None]

    def error(self, what: str) -> SkewError:
        """Return the error: the beam is out of square, or its skew is unknown. ``what``: what happened because of it."""
        name = self._parameters.name
        if self.skew is None:
            return SkewError(
                f"{what}, because the skew of the beam is unknown",
                observed=self.positions_text,
                remedy=f"find out why a position is unknown: both must arrive in each cycle; then {name}.reset()",
            )
        return SkewError(
            f"{what}, because the beam is {abs(self.skew):.6g} {self.unit} out of square; {self.bound:.6g} are allowed",
            observed=self.positions_text,
            remedy=_REMEDY.format(name=name),
        )

    @property
    def unit(self) -> str:
        """The unit of both axes."""
        return self._first.parameters.units.position.unit

    @property
    def positions_text(self) -> str:
        """The positions of both axes as text."""
        texts = []
        for core in (self._first, self._second):
            position = actual_position_of(core)
            age = core.image.now - core.image.position_stamp
            known = "unknown" if position is None else f"{position:.6g} {self.unit}"
            if position is not None and age > _FRESH * core.parameters.scan_period:
                known += f" as of {age * 1000:.0f} ms ago"
            texts.append(f"{core.parameters.name} at {known}")
        apart = f"the second {self.square:.6g} {self.unit} farther is square"
        return f"{', '.join(texts)}; {apart}" + (
            "" if self.confirmed else ", as at the first cycle: not homed"
        )
