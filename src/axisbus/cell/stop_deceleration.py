"""The decelerations of an axis, from its option codes, quick-stop deceleration, own limits, and read-only ramps."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.cell.axis_description import Drive
from axisbus.cia402 import objects, options
from axisbus.cia402.options import Ramp
from axisbus.motion.parameters import Units
from axisbus.motion.stop_deceleration import Braking

Read = Callable[[int], int | None]


def braking_of(units: Units, read: Read) -> Braking:
    """Return the ramps of halt and quick stop; ``read`` returns the value of an object of the axis, None if it is unknown."""
    most_up, most_down = read(objects.MAX_ACCELERATION), read(objects.MAX_DECELERATION)
    return Braking(
        _ramp(options.HALT_RAMPS, read(objects.HALT_OPTION)),
        _ramp(options.QUICK_STOP_RAMPS, read(objects.QUICK_STOP_OPTION)),
        _increments(units, read(objects.QUICK_STOP_DECELERATION)),
        _increments(units, most_up),
        _increments(units, most_down or most_up),
    )


def fixed_ramps(drive: Drive, read: Read) -> tuple[tuple[int, int | None], ...]:
    """Return the profile ramps (6083h, 6084h) that are read-only in the EDS, each with the drive's value."""
    found = []
    for index in (objects.PROFILE_ACCELERATION, objects.PROFILE_DECELERATION):
        variable = drive.variable(index)
        if variable is not None and not variable.writable:
            found.append((index, read(index)))
    return tuple(found)


def _ramp(table: dict[int, Ramp], value: int | None) -> Ramp:
    return Ramp.UNKNOWN if value is None else table.get(value, Ramp.UNKNOWN)


def _increments(units: Units, raw: int | None) -> float | None:
    """Return an acceleration of the drive in position increments per s²; None if it is 0 or unknown."""
    if not raw or not units.ratio_known:
        return None
    return abs(units.acceleration.to_units(raw) * units.position.factor)
