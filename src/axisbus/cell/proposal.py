"""What a drive's objects suggest as scale, put beside what cell.toml says; it is a proposal, never taken."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from axisbus.cia402 import objects as o
from axisbus.units import TURNS, Scale

_TOLERANCE = 1e-3

OBJECTS = (
    (o.ENCODER_RESOLUTION, 1),
    (o.ENCODER_RESOLUTION, 2),
    (o.GEAR_RATIO, 1),
    (o.GEAR_RATIO, 2),
    (o.FEED_CONSTANT, 1),
    (o.FEED_CONSTANT, 2),
)

Values = Mapping[tuple[int, int], int | None]


@dataclass(frozen=True, slots=True)
class ScaleReport:
    """The configured scale (or rated torque) beside what the drive's objects suggest; ``agrees`` None: nothing is suggested."""

    configured: str
    proposed: str
    agrees: bool | None


def compare(scale: Scale, values: Values) -> ScaleReport:
    """Compare a configured position scale with what 608Fh, 6091h and 6092h suggest.

    Which side of the gear 6064h counts cannot be seen from the objects, so each side is a candidate.
    """
    configured = f"{abs(scale.factor):g} increments per {scale.unit}"
    found = candidates(scale.unit, values)
    if not found:
        return ScaleReport(configured, _nothing(scale.unit, values), None)
    for side, proposed in found:
        if abs(abs(scale.factor) - float(proposed)) <= _TOLERANCE * float(proposed):
            return ScaleReport(configured, f"agrees with the drive's objects ({side})", agrees=True)
    texts = ", ".join(f"{float(proposed):g} ({side})" for side, proposed in found)
    return ScaleReport(configured, f"the drive's objects suggest {texts}", agrees=False)


def candidates(unit: str, values: Values) -> list[tuple[str, Fraction]]:
    """Return the position scales that 608Fh and 6091h suggest, in increments per unit, each with the side that it counts at."""
    part = TURNS.get(unit.lower())
    motor = _ratio(values, o.ENCODER_RESOLUTION)
    if part is None or motor is None:
        return []
    gear = _ratio(values, o.GEAR_RATIO)
    found = [("at the motor", motor * part)]
    if gear is not None and gear != 1:
        found.insert(0, ("at the gear's output", motor * gear * part))
    return found


def _nothing(unit: str, values: Values) -> str:
    motor = _ratio(values, o.ENCODER_RESOLUTION)
    if motor is None:
        return "the drive's objects suggest nothing (608Fh is missing or 0): check it by a small move"
    return f"608Fh says {float(motor):g} increments per motor turn; how many {unit} that is, only the machine knows"


def _ratio(values: Values, index: int) -> Fraction | None:
    above, below = values.get((index, 1)), values.get((index, 2))
    return None if not above or not below else Fraction(above, below)
