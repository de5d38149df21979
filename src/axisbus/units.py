"""Conversion between drive increments and engineering units, by factors computed once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from axisbus.errors import ArgumentError, LimitError

INT32_SPAN = 1 << 32
INT32_HALF = 1 << 31
INT32_LEAST = -INT32_HALF
# Tolerances of a whole number that was computed from units.
_ABSOLUTE, _RELATIVE = 1e-9, 1e-12

# The units that an axis may have. Units of an angle, as turns per unit:
TURNS: Mapping[str, Fraction] = {
    "deg": Fraction(1, 360),
    "degree": Fraction(1, 360),
    "degrees": Fraction(1, 360),
    "°": Fraction(1, 360),
    "mdeg": Fraction(1, 360_000),
    "arcmin": Fraction(1, 21_600),
    "arcsec": Fraction(1, 1_296_000),
    "rad": Fraction(7074029, 44447689),  # 1/(2 pi), to 14 digits
    "mrad": Fraction(7074029, 44447689000),
    "rev": Fraction(1),
    "turn": Fraction(1),
    "turns": Fraction(1),
}
# Units of length, which mean nothing to the drive; and units of a machine's own parts.
LENGTHS = (
    "m",
    "dm",
    "cm",
    "mm",
    "um",
    "\u00b5m",
    "\u03bcm",
    "nm",
    "in",
    "inch",
    "mil",
    "ft",
)  # both letters mu
OTHERS = ("%", "l", "ml", "teeth", "steps")
INCREMENTS = "increments"  # without engineering units
AXIS_UNITS = (INCREMENTS, *TURNS, *LENGTHS, *OTHERS)


@dataclass(frozen=True, slots=True)
class Scale:
    """Increments per unit, as an exact ratio and as the float that the cycle uses.

    ``factor`` may be negative: the master then reverses the direction (see ``invert`` in cell.toml).
    """

    exact: Fraction
    factor: float
    unit: str

    @classmethod
    def of(cls, increments_per_unit: int | float | str | Fraction, unit: str) -> Scale:
        """Make a scale from increments per unit; a text may be a ratio such as ``"131072/360"``.

        Raises:
            ArgumentError: the number is zero, not finite, or no number.
        """
        try:
            exact = Fraction(increments_per_unit)
        except (ValueError, TypeError, OverflowError, ZeroDivisionError):
            raise ArgumentError(
                f"{increments_per_unit!r} is not a scale",
                remedy='give increments per unit as a number, or as a ratio such as "131072/360"',
            ) from None
        if exact == 0:
            raise ArgumentError("a scale of 0 increments per unit", remedy="give the increments of one unit")
        return cls(exact, float(exact), unit)

    def to_increments(self, value: float) -> int:
        """Convert ``value`` in units to increments, rounded to the nearest (halves to even).

        Raises:
            ArgumentError: the value is NaN or infinite.
            LimitError: it is out of the countable range.
        """
        try:
            return round(value * self.factor)
        except (ValueError, OverflowError) as error:  # NaN, or infinite
            raise self._uncountable(value) from error

    def _uncountable(self, value: float) -> ArgumentError | LimitError:
        if not math.isfinite(value):
            return ArgumentError(f"{value} {self.unit} is not a finite number")
        return LimitError(
            f"{value:g} {self.unit} cannot be converted to increments",
            observed=f"one {self.unit} is {self.factor:g} increments",
            remedy="give a smaller value, or check the scale",
        )

    def to_units(self, increments: float) -> float:
        """Convert increments to units."""
        return increments / self.factor


def whole_below(increments: float) -> int:
    """Return the highest whole number of increments that is not above the value; rounding errors are compensated."""
    return math.floor(increments + _ABSOLUTE + _RELATIVE * abs(increments))


def whole_above(increments: float) -> int:
    """Return the lowest whole number of increments that is not below the value; rounding errors are compensated."""
    return -whole_below(-increments)


def toward_zero(increments: float) -> int:
    """Return the whole increments of a signed value, rounded towards 0."""
    return whole_below(increments) if increments >= 0 else whole_above(increments)


def unwrap(previous: int, raw: int) -> int:
    """Continue a position count across the wrap of its INTEGER32.

    ``previous`` is the unwrapped position before, ``raw`` the value just received (−2³¹ … 2³¹−1). The result is the count
    congruent to ``raw`` modulo 2³² that lies nearest to ``previous``.
    """
    step = raw - previous
    if INT32_LEAST <= step < INT32_HALF:
        return raw  # no wrap
    return previous + (step + INT32_HALF) % INT32_SPAN - INT32_HALF


def wrap(position: int) -> int:
    """Convert an unwrapped position to INTEGER32, as the drive counts it."""
    return (position + INT32_HALF) % INT32_SPAN - INT32_HALF


def modulo_target(current: float, target: float, span: float, direction: int = 0) -> float:
    """Return the position congruent to ``target`` modulo ``span`` at which a move from ``current`` should end.

    ``direction`` 0 takes the shortest path, 1 the positive, -1 the negative. All values in the same unit; ``span`` > 0.
    """
    forward = (target - current) % span
    if direction > 0:
        return current + forward
    backward = forward - span if forward else 0.0
    if direction < 0:
        return current + backward
    return current + (forward if forward <= -backward or not backward else backward)
