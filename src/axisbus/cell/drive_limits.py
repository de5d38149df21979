"""The limits that ``limits_in_drive`` writes into a drive, where they also apply without a master.

Limits are rounded inwards, so that the drive allows no more than the master does. The maximum motor speed (6080h, in whole
revolutions per minute) is rounded up: it is a coarse limit in addition to 607Fh, and must not slow down an axis at its limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

from axisbus.cell import scale_proposal
from axisbus.cell.model import AxisConfig
from axisbus.cell.quantities import units_of
from axisbus.cell.writes import CellWrite, initial
from axisbus.cia402 import objects as o
from axisbus.cia402.axes import own_index
from axisbus.eds.dictionary import Dictionary
from axisbus.motion.parameters import Units
from axisbus.units import toward_zero, whole_above, whole_below

KEY = "limits_in_drive"


class Limit(NamedTuple):
    """One limit of the cell file (``key``) and its object in the drive; ``value`` None: not expressible in the drive's unit."""

    key: str
    number: int
    subindex: int
    value: int | None


def wanted(axis: AxisConfig, dictionary: Dictionary, writes: Sequence[CellWrite] = ()) -> Iterator[Limit]:
    """Yield the limits that the drive should hold; ``writes``: the other writes of the cell file to the drive."""
    if not axis.limits_in_drive:
        return
    units = units_of(axis)
    if axis.position_limits is not None:
        low, high = sorted(edge * units.position.factor for edge in axis.position_limits)
        yield Limit("position_limits", o.SOFTWARE_POSITION_LIMIT, 1, whole_above(low))
        yield Limit("position_limits", o.SOFTWARE_POSITION_LIMIT, 2, whole_below(high))
    if axis.max_velocity is not None:
        fastest = whole_below(axis.max_velocity * abs(units.velocity.factor))
        yield Limit("max_velocity", o.MAX_PROFILE_VELOCITY, 0, fastest or None)
        yield Limit("max_velocity", o.MAX_MOTOR_SPEED, 0, _motor_speed(axis, units, dictionary, writes))
    if axis.max_torque is not None:
        most = None if not axis.rated_torque else toward_zero(axis.max_torque / axis.rated_torque * 1000)
        yield Limit("max_torque", o.MAX_TORQUE, 0, most or None)


def limit_writes(
    axis: AxisConfig, dictionary: Dictionary, writes: Sequence[CellWrite] = ()
) -> list[CellWrite]:
    """Return the writes of ``limits_in_drive``: limits for which the drive has objects, and that no other entry writes."""
    given = {write.address for write in writes}
    return [
        CellWrite(
            index, limit.subindex, limit.value, axis.at.of(KEY), f"{limit.key} by {KEY} in [{axis.at.name}]"
        )
        for limit in wanted(axis, dictionary, writes)
        if limit.value is not None
        and (index := own_index(limit.number, axis.drive_axis), limit.subindex) not in given
        and dictionary.has(index, limit.subindex) is not False
    ]


def left_out(axis: AxisConfig, dictionary: Dictionary, writes: Sequence[CellWrite] = ()) -> Iterator[Limit]:
    """Yield the limits that cannot be written into the drive."""
    addresses = {write.address for write in writes}
    for limit in wanted(axis, dictionary, writes):
        if (own_index(limit.number, axis.drive_axis), limit.subindex) not in addresses:
            yield limit


def _motor_speed(
    axis: AxisConfig, units: Units, dictionary: Dictionary, writes: Sequence[CellWrite]
) -> int | None:
    """Return 6080h in revolutions per minute; None unless 608Fh and the scale agree on the increments of a revolution."""
    written = {write.address: write.value for write in writes}

    def value(index: int, subindex: int) -> int | None:
        address = own_index(index, axis.drive_axis), subindex
        found = written.get(address, initial(dictionary, axis.node, *address))
        return found if isinstance(found, int) else None

    values = {address: value(*address) for address in scale_proposal.OBJECTS}
    increments, turns = values[o.ENCODER_RESOLUTION, 1], values[o.ENCODER_RESOLUTION, 2]
    if not increments or not turns or not scale_proposal.compare(units.position, values).agrees:
        return None
    per_minute = Fraction(axis.max_velocity or 0) * abs(units.position.exact) * 60 * turns / increments
    return math.ceil(per_minute)
