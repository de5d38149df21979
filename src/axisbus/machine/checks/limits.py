"""Whether the numbers of an axis agree with each other, with the drive's own limits, and with what its objects hold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from axisbus.cia301.datatypes import DataType
from axisbus.cia402 import homing, objects
from axisbus.machine.cell import AxisConfig, Place
from axisbus.machine.checks.case import Case, Check, Found, own_title
from axisbus.machine.drive import Drive
from axisbus.machine.scales import units_of
from axisbus.units import Scale


@dataclass(frozen=True, slots=True)
class Quantity:
    """One number of an axis, with the object that it is written into."""

    key: str
    at: Place
    value: float
    unit: str
    scale: Scale
    index: int
    subindex: int = 0
    zero_allowed: bool = False  # 0 increments mean what is written

    @property
    def what(self) -> str:
        return f"{self.key} = {self.value:.10g} in [{self.at.name}]"

    @property
    def increments(self) -> int:
        return self.scale.to_increments(self.value)


def _speeds(axis: AxisConfig) -> Iterator[tuple[str, Place, float]]:
    """The speeds that must not pass ``max_velocity``."""
    for key, at, value in (
        ("velocity", axis.defaults.at, axis.defaults.velocity),
        ("speed_switch", axis.homing.at, axis.homing.speed_switch),
        ("speed_zero", axis.homing.at, axis.homing.speed_zero),
        ("standstill_velocity", axis.at, axis.standstill_velocity),
    ):
        if value is not None:
            yield key, at, value


def _ramps(axis: AxisConfig) -> Iterator[tuple[str, Place, float]]:
    """The accelerations that must not pass ``max_acceleration``; that of a quick stop may."""
    for key, at, value in (
        ("acceleration", axis.defaults.at, axis.defaults.acceleration),
        ("deceleration", axis.defaults.at, axis.defaults.deceleration),
        ("acceleration", axis.homing.at, axis.homing.acceleration),
    ):
        if value is not None:
            yield key, at, value


def beyond_maximum(case: Case) -> Found:
    """Check defaults and homing speeds against the axis's own maxima."""
    for axis in case.cell.axes.values():
        for maximum, limit, unit, values in (
            ("max_velocity", axis.max_velocity, "/s", _speeds(axis)),
            ("max_acceleration", axis.max_acceleration, "/s²", _ramps(axis)),
        ):
            for key, at, value in values:
                if limit is not None and value > limit:
                    yield case.error(
                        at.of(key),
                        f"axis {axis.name}: {key} in [{at.name}] is beyond {maximum}",
                        f"{value:g} {axis.unit}{unit} against {limit:g} at line {axis.at.of(maximum)}",
                        f"lower {key}, or raise {maximum}",
                    )


def modulo_with_limits(case: Case) -> Found:
    """Check that an endless axis has no position limits."""
    for axis in case.cell.axes.values():
        if axis.modulo is not None and axis.position_limits is not None:
            yield case.error(
                axis.at.of("modulo"),
                f"axis {axis.name}: an endless axis (modulo) has no position limits",
                f"position_limits is at line {axis.at.of('position_limits')}",
                "delete one of them",
            )


def invert(case: Case) -> Found:
    """Check that the direction is turned once."""
    for drive in case.drives:
        axis, polarity = drive.axis, drive.number(objects.POLARITY)
        if axis.invert == "master" and polarity:
            yield case.error(
                axis.at.of("invert"),
                f"axis {axis.name}: the direction is turned twice",
                f'invert = "master", and {own_title(drive, objects.POLARITY)} is {polarity:02X}h after boot',
                f'write invert = "drive", or set 607E to 0 in [{axis.at.name}.objects]',
            )
        if axis.invert == "drive" and axis.rated_torque is not None:
            yield case.note(
                axis.at.of("invert"),
                f"axis {axis.name}: whether the drive turns torque as well is not certain",
                "607Eh turns position and velocity",
                "try torque_control with a small torque first",
            )


def torque(case: Case) -> Found:
    """Check that values in N·m can be converted, and fit."""
    for axis in case.cell.axes.values():
        rated = axis.rated_torque
        for key, at, value in (
            ("max_torque", axis.at, axis.max_torque),
            ("torque_slope", axis.defaults.at, axis.defaults.torque_slope),
        ):
            if value is None or not axis.at.sound("rated_torque"):
                continue
            if rated is None:
                yield case.error(
                    at.of(key),
                    f"axis {axis.name}: {key} in [{at.name}] needs rated_torque",
                    "drives count torque in 0.1 % of their rated torque",
                    f"add rated_torque in N·m to [axes.{axis.name}] (the drive's 6076h holds it in mN·m), or delete {key}",
                )
            elif round(value / rated * 1000) > _TORQUE_TYPES[key].range[1]:
                yield case.error(
                    at.of(key),
                    f"axis {axis.name}: {key} in [{at.name}] is beyond what the drive's object holds",
                    f"{value:g} is {value / rated * 1000:g} in 0.1 % of rated_torque; "
                    f"{_TORQUE_TYPES[key].name} ends at {_TORQUE_TYPES[key].range[1]}",
                    f"lower {key}, or check rated_torque",
                )


_TORQUE_TYPES = {"max_torque": DataType.INTEGER16, "torque_slope": DataType.UNSIGNED32}


def homing_speeds(case: Case) -> Found:
    """Check what a homing method needs, and name reserved methods."""
    for axis in case.cell.axes.values():
        given = axis.homing
        if given.method is None:
            continue
        line, at = given.at.of("method"), given.at
        if homing.describe(given.method) == "reserved":
            yield case.warning(
                line,
                f"axis {axis.name}: homing method {given.method} is reserved in CiA 402",
                "6098h: 1 to 14, 17 to 30, 33 to 35 and 37 are defined, negative ones are the maker's",
                "choose a defined one that the drive has",
            )
        for key in ("speed_switch", "speed_zero"):
            if given.method not in homing.IN_PLACE and getattr(given, key) is None and at.sound(key):
                yield case.error(
                    line,
                    f"axis {axis.name}: homing method {given.method} moves, and {key} is missing",
                    f"it looks for: {homing.describe(given.method)}",
                    f"add {key} = ... ({axis.unit}/s) to [{at.name}]",
                )
        if given.speed_switch is not None and (given.speed_zero or 0) > given.speed_switch:
            yield case.warning(
                at.of("speed_zero"),
                f"axis {axis.name}: speed_zero is faster than speed_switch",
                f"{given.speed_zero:g} against {given.speed_switch:g} {axis.unit}/s",
                "the search for the zero is the slow one: exchange them",
            )


# -- against the drive -----------------------------------------------------------------------------------------------


def quantities(axis: AxisConfig) -> Iterator[Quantity]:
    """The numbers of an axis that are written into objects as they are or by a command."""
    units, given = units_of(axis), axis.homing
    position, speed, ramp = units.position, units.velocity, units.acceleration
    candidates: tuple[tuple[str, Place, float | None, str, Scale, int, int, bool], ...] = (
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
            yield Quantity(key, at, value, axis.unit + unit, scale, index, subindex, zero)
    for value in axis.position_limits or ():
        yield Quantity(
            "position_limits", axis.at, value, axis.unit, position, objects.TARGET_POSITION, 0, True
        )


_SCALES = ("scale", "velocity_scale", "acceleration_scale")


def overflow(case: Case) -> Found:
    """Check that each number fits its object after scaling: the type, then the EDS's own limits; and that it is not 0."""
    for drive in case.drives:
        if not drive.axis.at.sound(*_SCALES):
            continue
        for quantity in quantities(drive.axis):
            yield from _fits(case, drive, quantity)


def _fits(case: Case, drive: Drive, quantity: Quantity) -> Found:
    entry = drive.entry(quantity.index, quantity.subindex)
    if (
        drive.variable(quantity.index, quantity.subindex) is None
        or entry.data_type is None
        or not entry.data_type.integer
    ):
        return
    raw = quantity.increments if quantity.index in _SIGNED else abs(quantity.increments)
    # A maximum is no value to be written: only commands near it fail.
    report = case.warning if quantity.key.startswith("max_") else case.error
    line, name = quantity.at.of(quantity.key), f"axis {drive.axis.name}: {quantity.what}"
    low, high = entry.data_type.range
    if not low <= raw <= high:
        yield report(
            line,
            f"{name} does not fit {entry}",
            f"it is {raw} increments; {entry.data_type.name} holds {low} to {high}",
            "give a smaller value, or check the scale",
        )
    elif not (entry.low is None or entry.low <= raw) or not (entry.high is None or raw <= entry.high):
        yield report(
            line,
            f"{name} lies outside the drive's own limits of {entry}",
            f"it is {raw} increments; {drive.eds.source} allows "
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


def drive_limits(case: Case) -> Found:
    """Warn where the drive's own limits (607Dh, 607Fh, 60C5h, 60C6h) are narrower than what the cell asks for."""
    for drive in case.drives:
        if drive.axis.at.sound(*_SCALES):
            yield from _software_limits(case, drive)
            yield from _maxima(case, drive)


def _software_limits(case: Case, drive: Drive) -> Found:
    """607Dh: both 0, or the lower not below the upper, means none."""
    axis, scale = drive.axis, units_of(drive.axis).position
    low = drive.number(objects.SOFTWARE_POSITION_LIMIT, 1)
    high = drive.number(objects.SOFTWARE_POSITION_LIMIT, 2)
    if axis.position_limits is None or low is None or high is None or low >= high:
        return
    ours = sorted(scale.to_increments(value) for value in axis.position_limits)
    if low > ours[0] or high < ours[1]:
        theirs = sorted((scale.to_units(low), scale.to_units(high)))
        yield case.warning(
            axis.at.of("position_limits"),
            f"axis {axis.name}: the drive's own position limits are narrower than position_limits",
            f"607Dh is {low} to {high} increments, {theirs[0]:g} to {theirs[1]:g} {axis.unit}",
            "moves beyond them end with an internal limit (statusword bit 11): narrow position_limits, or write "
            f'"607D:01" and "607D:02" in [{axis.at.name}.objects]',
        )


_MAXIMA = (
    ("velocity", "velocity", objects.MAX_PROFILE_VELOCITY, "/s"),
    ("acceleration", "acceleration", objects.MAX_ACCELERATION, "/s²"),
    ("deceleration", "acceleration", objects.MAX_DECELERATION, "/s²"),
)


def _maxima(case: Case, drive: Drive) -> Found:
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


CHECKS: tuple[Check, ...] = (
    beyond_maximum,
    modulo_with_limits,
    invert,
    torque,
    homing_speeds,
    overflow,
    drive_limits,
)
