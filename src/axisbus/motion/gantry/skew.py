"""How far a beam is out of square, cycle by cycle, and how far it may be.

Theory of operation
-------------------
Skew is how much farther the second axis is than the first, less the offset of the pair. That is so where both places are
confirmed ones: homed, set, or of an absolute encoder (``homing.required = false``). Before that each drive counts from wherever it
was switched on, and nobody knows how the beam stands: then what both showed when they were first seen together counts as square,
and only what changes since is skew. A node that restarts counts anew, so that begins anew as well.
"""

from __future__ import annotations

from axisbus.cia402.state import ENERGISED
from axisbus.errors import SkewError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.gantry.parameters import GantryParameters
from axisbus.motion.states import AxisState

_REMEDY = (
    "check what holds one side (a closed brake, a part in the way, a coupling that slips, an encoder that lost counts) before "
    "anything moves; then {name}.disable(), {name}.reset(), {name}.enable(skew=...) with a bound that is wide enough, and "
    "{name}.square(velocity=...), slowly"
)

_FRESH = 3.5  # cycles: what is older was not told in time


def place_of(core: AxisCore) -> float | None:
    """Return where an axis is, in its unit; None where that is not known."""
    position = core.image.position
    return None if position is None else core.parameters.units.position.to_units(position - core.image.origin)


def led_place_of(core: AxisCore) -> float | None:
    """Return where an axis is led to (6062h), else where it is."""
    image = core.image
    place = image.position if image.demand is None else image.demand
    return None if place is None else core.parameters.units.position.to_units(place - image.origin)


class SkewMonitor:
    """Looks at both axes in each cycle; holds the ``bound`` that counts now, and the ``skew`` (None: it is not known)."""

    def __init__(self, parameters: GantryParameters, first: AxisCore, second: AxisCore) -> None:
        self.bound = parameters.max_skew
        self.skew: float | None = None
        self._parameters = parameters
        self._first, self._second = first, second
        self._taken: float | None = (
            None  # what both showed when they were first seen, where nothing is confirmed
        )

    @property
    def confirmed(self) -> bool:
        """Whether the places of both are such that their difference says how the beam stands."""
        return all(core.homed or not core.parameters.homing.required for core in (self._first, self._second))

    @property
    def wide(self) -> bool:
        """Whether more than ``max_skew`` is allowed now."""
        return self.bound > self._parameters.max_skew

    def narrow(self) -> None:
        """Allow ``max_skew`` and no more."""
        self.bound = self._parameters.max_skew

    @property
    def square(self) -> float:
        """How much farther the second axis is than the first where the beam is square."""
        return self._parameters.offset if self.confirmed or self._taken is None else self._taken

    def look(self) -> None:
        """Once per cycle, before the axes: see how the beam stood in the cycle before."""
        first, second = self._first, self._second
        a, b = place_of(first), place_of(second)
        if a is None or b is None or not (first.image.operational and second.image.operational):
            self._taken = self.skew = None
            return
        if self.confirmed:
            self._taken = None
        elif self._taken is None:
            self._taken = b - a - (self.skew or 0.0)  # what was known before is not forgotten
        self.skew = b - a - self.square

    @property
    def energised(self) -> bool:
        """Whether the motor of either axis is driven, by this program."""
        return any(core.touched and core.image.state in ENERGISED for core in (self._first, self._second))

    def finding(self) -> SkewError | None:
        """Return what is wrong in this cycle with a beam that is driven; None where nothing is, or it is not driven."""
        if not self.energised or not self.failing():
            return None
        if self.skew is not None and abs(self.skew) <= self.bound:
            return None
        return self.error(f"{self._parameters.name}: both axes were stopped")

    def failing(self) -> list[AxisCore]:
        """Return the axes that a finding concerns: an axis that is being stopped because the other has failed is left to that."""
        both = (self._first, self._second)
        fine = [core for core in both if core.state is not AxisState.ERRORSTOP]
        return [core for core in fine if len(fine) == len(both) or core.ladder is None]

    def error(self, what: str) -> SkewError:
        """Return that the beam is out of square, or that nobody knows; ``what`` became of it."""
        name = self._parameters.name
        if self.skew is None:
            return SkewError(
                f"{what}, because nobody knows how far the beam is out of square",
                observed=self.places,
                remedy=f"see why a position is unknown: both must come in each cycle; then {name}.reset()",
            )
        return SkewError(
            f"{what}, because the beam is {abs(self.skew):.6g} {self.unit} out of square; {self.bound:.6g} are allowed",
            observed=self.places,
            remedy=_REMEDY.format(name=name),
        )

    @property
    def unit(self) -> str:
        """That of both axes."""
        return self._first.parameters.units.position.unit

    @property
    def places(self) -> str:
        """Where both are, in words."""
        texts = []
        for core in (self._first, self._second):
            place = place_of(core)
            age = core.image.now - core.image.position_stamp
            known = "unknown" if place is None else f"{place:.6g} {self.unit}"
            if place is not None and age > _FRESH * core.parameters.scan_period:
                known += f" as of {age * 1000:.0f} ms ago"
            texts.append(f"{core.parameters.name} at {known}")
        apart = f"the second {self.square:.6g} {self.unit} farther is square"
        return f"{', '.join(texts)}; {apart}" + (
            "" if self.confirmed else ", as they stood when first seen: not homed"
        )
