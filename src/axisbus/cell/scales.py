"""Convert the scales of a cell file to the units that motion uses."""

from __future__ import annotations

from fractions import Fraction

from axisbus.cell.model import INCREMENTS, AxisConfig
from axisbus.motion.parameters import Units
from axisbus.units import Scale

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
