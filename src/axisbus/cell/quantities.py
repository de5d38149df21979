"""The dimensions of an axis's objects (position, velocity, acceleration, torque), and their conversion to the axis's units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from fractions import Fraction
from typing import NamedTuple

from axisbus.cell.model import INCREMENTS, AxisConfig, CellConfig
from axisbus.cia402 import objects as o
from axisbus.cia402.axes import axis_of, first_axis
from axisbus.errors import ArgumentError
from axisbus.motion.parameters import Units
from axisbus.units import Scale


class Dimension(Enum):
    """The dimension of an object of CiA 402."""

    POSITION = "position"
    VELOCITY = "velocity"
    ACCELERATION = "acceleration"
    TORQUE = "torque"


# First-axis index -> dimension; every sub-index but 0 of the arrays (CiA 402-2, tables of each mode).
DIMENSIONS: Mapping[int, Dimension] = {
    **dict.fromkeys(
        (
            *(o.POSITION_DEMAND, o.POSITION_ACTUAL, o.FOLLOWING_ERROR_WINDOW, o.POSITION_WINDOW),
            *(o.TARGET_POSITION, o.POSITION_RANGE_LIMIT, o.HOME_OFFSET, o.SOFTWARE_POSITION_LIMIT),
            *(o.POSITION_OFFSET, o.FOLLOWING_ERROR_ACTUAL),
        ),
        Dimension.POSITION,
    ),
    **dict.fromkeys(
        (
            *(o.VELOCITY_DEMAND, o.VELOCITY_ACTUAL, o.VELOCITY_WINDOW, o.VELOCITY_THRESHOLD),
            *(o.MAX_PROFILE_VELOCITY, o.PROFILE_VELOCITY, o.END_VELOCITY, o.HOMING_SPEEDS),
            *(o.VELOCITY_OFFSET, o.TARGET_VELOCITY),
        ),
        Dimension.VELOCITY,
    ),
    **dict.fromkeys(
        (
            *(o.PROFILE_ACCELERATION, o.PROFILE_DECELERATION, o.QUICK_STOP_DECELERATION),
            *(o.HOMING_ACCELERATION, o.MAX_ACCELERATION, o.MAX_DECELERATION),
        ),
        Dimension.ACCELERATION,
    ),
    **dict.fromkeys(
        (o.TARGET_TORQUE, o.MAX_TORQUE, o.TORQUE_DEMAND, o.TORQUE_ACTUAL, o.TORQUE_OFFSET), Dimension.TORQUE
    ),
}
_ARRAYS = frozenset({o.POSITION_RANGE_LIMIT, o.SOFTWARE_POSITION_LIMIT, o.HOMING_SPEEDS})
_PER_MILLE = 1000  # torque objects count thousandths of the rated torque (CiA 402-2, 6071h and others)
# Magnitudes have no direction: inverting an axis does not change their sign.
_MAGNITUDES = frozenset(
    {
        *(o.FOLLOWING_ERROR_WINDOW, o.POSITION_WINDOW, o.VELOCITY_WINDOW, o.VELOCITY_THRESHOLD),
        *(o.MAX_PROFILE_VELOCITY, o.PROFILE_VELOCITY, o.END_VELOCITY, o.HOMING_SPEEDS, o.MAX_TORQUE),
    }
)


class UnitConversion(NamedTuple):
    """The conversion of an object's integer to a unit: ``value / factor``."""

    factor: float
    unit: str

    def to_unit(self, value: float) -> float:
        """Return the value in the unit."""
        return value / self.factor

    def to_increments(self, value: float) -> int:
        """Return the nearest integer for the object."""
        return round(value * self.factor)


class Quantities:
    """The units of a cell's objects, by node, index and sub-index; frozen after construction."""

    def __init__(self, cell: CellConfig | None = None) -> None:
        self._axes: dict[tuple[int, int], tuple[AxisConfig, Units]] = {}
        for axis in cell.driven.values() if cell is not None else ():
            self._axes[axis.node, axis.drive_axis] = axis, units_of(axis)

    def of(self, node_id: int, index: int, subindex: int = 0) -> UnitConversion | None:
        """Return the conversion of an object to the axis's unit; None if the object has no known unit."""
        first = first_axis(index)
        dimension = DIMENSIONS.get(first)
        found = self._axes.get((node_id, axis_of(index)))
        if dimension is None or found is None or (first in _ARRAYS) is (subindex == 0):
            return None
        quantity = _quantity(dimension, *found)
        if quantity is not None and first in _MAGNITUDES:
            return quantity._replace(factor=abs(quantity.factor))
        return quantity


def _quantity(dimension: Dimension, axis: AxisConfig, units: Units) -> UnitConversion | None:
    if dimension is Dimension.TORQUE:
        if not units.rated_torque:
            return None
        return UnitConversion(_PER_MILLE / units.rated_torque, "N·m")
    if axis.unit == INCREMENTS:
        return None
    scale = getattr(units, dimension.value)
    return UnitConversion(scale.factor, scale.unit)


def parse_quantity(text: str, quantity: UnitConversion | None) -> int | None:
    """Return the increments of a value with its unit, such as ``90 deg``; None if the text has no unit.

    Raises:
        ArgumentError: the unit is not the object's.
    """
    number, unit = _split(text.strip())
    if number is None or not unit:
        return None
    if not math.isfinite(number):
        raise ArgumentError(f"{text!r} is not a finite number")
    if quantity is None or unit.casefold() not in _spellings(quantity.unit):
        known = (
            f"the object is in {quantity.unit}" if quantity is not None else "no unit is known for the object"
        )
        raise ArgumentError(
            f"{text!r} has a unit that cannot be used here",
            observed=known,
            remedy="give increments, without a unit",
        )
    return quantity.to_increments(number)


def _spellings(unit: str) -> frozenset[str]:
    plain = unit.casefold()
    return frozenset({plain, plain.replace("²", "2"), plain.replace("²", "^2"), plain.replace("·", "")})


def _split(text: str) -> tuple[float | None, str]:
    """Split after the longest number at the beginning of the text; a hexadecimal number has no unit."""
    if text.lower().startswith(("0x", "-0x")):
        return None, ""
    for end in range(len(text), 0, -1):
        try:
            return float(text[:end]), text[end:].strip()
        except ValueError:
            continue
    return None, ""


# -- Convert the scales of a cell file to the units that motion uses ---------------------------------------------------


MASTER, DRIVE = "master", "drive"


def units_of(axis: AxisConfig) -> Units:
    """Return the units of an axis.

    Velocity and acceleration scales default to the position's; for an axis in increments, to 1. With ``invert = "master"`` the
    position and velocity scales and the rated torque are negative, which inverts every signed value in both directions; magnitudes
    (accelerations, slopes) have no direction.
    """
    sign = -1 if axis.invert == MASTER else 1
    position = axis.scale or Fraction(1)
    derived = Fraction(1) if axis.unit == INCREMENTS and not axis.virtual else position
    return Units(
        position=Scale.of(sign * position, axis.unit),
        velocity=Scale.of(sign * (axis.velocity_scale or derived), f"{axis.unit}/s"),
        acceleration=Scale.of(axis.acceleration_scale or derived, f"{axis.unit}/s²"),
        ratio_known=axis.unit != INCREMENTS or axis.velocity_scale is not None or axis.virtual,
        rated_torque=None if axis.rated_torque is None else sign * axis.rated_torque,
        modulo=axis.modulo,
    )
