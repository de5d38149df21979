"""Check that the numbers of an axis fit the drive: its objects, after scaling, and its own limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from axisbus.cell import scale_proposal
from axisbus.cell.axis_description import Drive
from axisbus.cell.model import AxisConfig, SourceLocation
from axisbus.cell.quantities import units_of
from axisbus.check.context import Check, CheckContext, Problems, own_title
from axisbus.cia402 import objects
from axisbus.units import Scale
from axisbus.wording import counted


@dataclass(frozen=True, slots=True)
class CheckedQuantity:
    """One number of an axis, with the object that it is written into."""

    key: str
    at: SourceLocation
    value: float
    unit: str
    scale: Scale
    index: int
    subindex: int = 0
    zero_allowed: bool = False  # 0 increments are a valid value

    @property
    def what(self) -> str:
        return f"{self.key} = {self.value:.10g} in [{self.at.name}]"

    @property
    def increments(self) -> int:
        return self.scale.to_increments(self.value)


def quantities(axis: AxisConfig) -> Iterator[CheckedQuantity]:
    """The numbers of an axis that boot or a command writes into objects."""
    units, given = units_of(axis), axis.homing
    position, speed, ramp = units.position, units.velocity, units.acceleration
    candidates: tuple[tuple[str, SourceLocation, float | None, str, Scale, int, int, bool], ...] = (
        ("velocity", axis.defaults.at, axis.defaults.velocity, "/s", speed, objects.PROFILE_VELOCITY, 0, False),
        ("max_velocity", axis.at, axis.max_velocity, "/s", speed, objects.PROFILE_VELOCITY, 0, False),
        ("max_velocity", axis.at, axis.max_velocity, "/s", speed, objects.TARGET_VELOCITY, 0, False),
        ("acceleration", axis.defaults.at, axis.defaults.acceleration, "/s²", ramp, objects.PROFILE_ACCELERATION, 0, False),
        ("deceleration", axis.defaults.at, axis.defaults.deceleration, "/s²", ramp, objects.PROFILE_DECELERATION, 0, False),
        ("max_acceleration", axis.at, axis.max_acceleration, "/s²", ramp, objects.PROFILE_ACCELERATION, 0, False),
        ("deceleration", axis.stop.at, axis.stop.deceleration, "/s²", ramp, objects.QUICK_STOP_DECELERATION, 0, False),
        ("speed_switch", given.at, given.speed_switch, "/s", speed, objects.HOMING_SPEEDS, 1, False),
        ("speed_zero", given.at, given.speed_zero, "/s", speed, objects.HOMING_SPEEDS, 2, False),
        ("acceleration", given.at, given.acceleration, "/s²", ramp, objects.HOMING_ACCELERATION, 0, False),
        ("offset", given.at, given.offset, "", position, objects.HOME_OFFSET, 0, True),
        ("position_window", axis.at, axis.position_window, "", position, objects.POSITION_WINDOW, 0, False),
    )  # fmt: skip
    for key, at, value, unit, scale, index, subindex, zero in candidates:
        if value is not None:
            yield CheckedQuantity(key, at, value, axis.unit + unit, scale, index, subindex, zero)
    for value in axis.position_limits or ():
        yield CheckedQuantity(
            "position_limits", axis.at, value, axis.unit, position, objects.TARGET_POSITION, 0, True
        )


_SCALES = ("scale", "velocity_scale", "acceleration_scale")


def overflow(case: CheckContext) -> Problems:
    """Check that each number fits its object after scaling: the type, then the limits of the EDS, and that it is not 0."""
    for drive in case.drives:
        if not drive.axis.at.sound(*_SCALES):
            continue
        for quantity in quantities(drive.axis):
            yield from _fits(case, drive, quantity)


def _fits(case: CheckContext, drive: Drive, quantity: CheckedQuantity) -> Problems:
    entry = drive.entry(quantity.index, quantity.subindex)
    if (
        drive.variable(quantity.index, quantity.subindex) is None
        or entry.data_type is None
        or not entry.data_type.integer
    ):
        return
    raw = quantity.increments if quantity.index in _SIGNED else abs(quantity.increments)
    # A maximum is not written: only commands near it fail.
    report = case.warning if quantity.key.startswith("max_") else case.error
    line, name = quantity.at.of(quantity.key), f"axis {drive.axis.name}: {quantity.what}"
    low, high = entry.data_type.range
    if not low <= raw <= high:
        yield report(
            line,
            f"{name} does not fit {entry}",
            f"it is {counted(raw, 'increment')}; {entry.data_type.name} holds {low} to {high}",
            "give a smaller value, or check the scale",
        )
    elif not (entry.low is None or entry.low <= raw) or not (entry.high is None or raw <= entry.high):
        yield report(
            line,
            f"{name} is outside the drive's own limits of {entry}",
            f"it is {counted(raw, 'increment')}; {drive.eds.source} allows "
            f"{'any' if entry.low is None else entry.low} to {'any' if entry.high is None else entry.high}",
            "give a value within them, or check the scale",
        )
    elif not raw and not quantity.zero_allowed:
        yield case.warning(
            line,
            f"{name} is less than one increment of {entry}",
            f"{quantity.value:g} {quantity.unit} x {abs(quantity.scale.factor):g} = "
            f"{quantity.value * abs(quantity.scale.factor):g}; the drive gets 1",
            "give a larger value, or check the scale",
        )


_SIGNED = frozenset({objects.TARGET_POSITION, objects.TARGET_VELOCITY, objects.HOME_OFFSET})


def drive_limits(case: CheckContext) -> Problems:
    """Warn if the drive's own limits (607Dh, 607Fh, 60C5h, 60C6h) are narrower than the values of the cell file."""
    for drive in case.drives:
        if drive.axis.at.sound(*_SCALES):
            yield from _software_limits(case, drive)
            yield from _maxima(case, drive)


def _software_limits(case: CheckContext, drive: Drive) -> Problems:
    """Check 607Dh; it is inactive if both limits are 0, or the lower one is not below the upper one."""
    axis, scale = drive.axis, units_of(drive.axis).position
    low = drive.number(objects.SOFTWARE_POSITION_LIMIT, 1)
    high = drive.number(objects.SOFTWARE_POSITION_LIMIT, 2)
    if axis.position_limits is None or low is None or high is None or low >= high:
        return
    cell_range = sorted(scale.to_increments(value) for value in axis.position_limits)
    if low > cell_range[0] or high < cell_range[1]:
        drive_range = sorted((scale.to_units(low), scale.to_units(high)))
        yield case.warning(
            axis.at.of("position_limits"),
            f"axis {axis.name}: the drive's own position limits are narrower than position_limits",
            f"607Dh is {low} to {counted(high, 'increment')}, {drive_range[0]:g} to {drive_range[1]:g} {axis.unit}",
            "moves beyond them end with an internal limit (statusword bit 11): narrow position_limits, or write "
            f'"607D:01" and "607D:02" in [{axis.at.name}.objects]',
        )


_MAXIMA = (
    ("velocity", "velocity", objects.MAX_PROFILE_VELOCITY, "/s"),
    ("acceleration", "acceleration", objects.MAX_ACCELERATION, "/s²"),
    ("deceleration", "acceleration", objects.MAX_DECELERATION, "/s²"),
)


def _maxima(case: CheckContext, drive: Drive) -> Problems:
    axis, units = drive.axis, units_of(drive.axis)
    for key, kind, index, unit in _MAXIMA:
        value: float | None = getattr(axis.defaults, key)
        limit = drive.number(index)
        scale: Scale = getattr(units, kind)
        if value is None or not limit or value * abs(scale.factor) <= limit:
            continue
        yield case.warning(
            axis.defaults.at.of(key),
            f"axis {axis.name}: the default {key} is beyond the drive's own limit",
            f"{own_title(drive, index)} is {limit} after boot, {limit / abs(scale.factor):g} {axis.unit}{unit}",
            f'lower {key}, or write "{index:04X}" in [{axis.at.name}.objects]',
        )


CHECKS: tuple[Check, ...] = (overflow, drive_limits)


# -- Check that the scales of an axis fit the drive's objects for encoder, gear and units ------------------------------


def disagreement(case: CheckContext) -> Problems:
    """Check each scale against 608Fh and 6091h of the EDS, as ``boot`` does with the drive's values.

    A 608Fh of 1 increment per turn is no information and is skipped.
    """
    for drive in case.drives:
        axis = drive.axis
        if axis.scale is None or not axis.at.sound("unit", "scale"):
            continue
        values = {(index, sub): drive.number(index, sub) for index, sub in scale_proposal.OBJECTS}
        if values[objects.ENCODER_RESOLUTION, 1] == values[objects.ENCODER_RESOLUTION, 2]:
            continue
        found = scale_proposal.compare(units_of(axis).position, values)
        if found.agrees is False:
            yield case.warning(
                axis.at.of("scale"),
                f"the scale of axis {axis.name} differs from the objects of its drive",
                f"{found.configured}; {found.proposed}, by {own_title(drive, objects.ENCODER_RESOLUTION)} and "
                f"{own_title(drive, objects.GEAR_RATIO)}",
                "correct scale (or unit), or the objects; axisbus boot compares it with the drive's own values",
            )


def other_units(case: CheckContext) -> Problems:
    """Check velocity and acceleration scales against the drive's units; an error if the conflict is certain."""
    for drive in case.drives:
        axis = drive.axis
        if not axis.at.sound("unit", "scale", "velocity_scale", "acceleration_scale"):
            continue
        values = {(index, sub): drive.number(index, sub) for index, sub in scale_proposal.OBJECTS}
        for found in scale_proposal.contradictions(axis, values):
            report = case.error if found.is_certain else case.warning
            at = axis.at.of(found.key) if axis.at.gives(found.key) else axis.at.of("unit")
            yield report(at, found.message, found.observed, found.remedy)


SCALE_CHECKS: tuple[Check, ...] = (disagreement, other_units)
