"""Convert a virtual axis of a cell file to the parameters that motion needs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any, NamedTuple

from axisbus.cell import schema
from axisbus.cell.model import AxisConfig, CellConfig
from axisbus.cell.parameters import defaults, standstill_speed, stop_times
from axisbus.cell.quantities import units_of
from axisbus.cia402 import objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.options import Ramp
from axisbus.motion.parameters import AxisLimits, AxisParameters, HomingParameters
from axisbus.motion.stop_deceleration import Braking
from axisbus.units import INCREMENTS, INT32_HALF

# The objects that a drive would have for it: the settings of a move, and its commands and actual values.
SETTINGS = frozenset({objects.PROFILE_VELOCITY, objects.PROFILE_ACCELERATION, objects.PROFILE_DECELERATION})
OBJECTS = SETTINGS | {
    objects.CONTROLWORD,
    objects.STATUSWORD,
    objects.MODES_OF_OPERATION,
    objects.MODES_OF_OPERATION_DISPLAY,
    objects.POSITION_DEMAND,
    objects.POSITION_ACTUAL,
    objects.VELOCITY_ACTUAL,
    objects.TARGET_POSITION,
    objects.TARGET_VELOCITY,
}
OBJECTS_OF_ENCODER = frozenset({objects.STATUSWORD, objects.POSITION_ACTUAL})
MODES = frozenset(
    {
        ModeOfOperation.PROFILE_POSITION,
        ModeOfOperation.PROFILE_VELOCITY,
        ModeOfOperation.CYCLIC_SYNC_POSITION,
    }
)


def virtual_parameters(cell: CellConfig, name: str) -> AxisParameters:
    """Return the parameters of the virtual axis ``name``; raises nothing for a cell that ``reader.load`` returned."""
    axis = cell.axes[name]
    units = units_of(axis)
    quick = (quick_deceleration(axis) or 1.0) * abs(units.position.factor)
    return AxisParameters(
        name=name,
        units=units,
        limits=AxisLimits(axis.position_limits, axis.max_velocity, axis.max_acceleration),
        defaults=defaults(axis),
        homing=HomingParameters(required=False),
        stop_times=stop_times(axis),
        objects=OBJECTS,
        modes=MODES,
        braking=Braking(Ramp.SLOW, Ramp.QUICK, quick),
        following_error=INT32_HALF,  # no monitoring: its lag is only the scan's own lateness, which is reported elsewhere
        standstill_speed=standstill_speed(axis, units),
        scan_period=cell.bus.scan_period,
        virtual=True,
    )


def encoder_parameters(cell: CellConfig, name: str) -> AxisParameters:
    """Return the parameters of an axis whose position comes from an input: no command moves it, and it has no modes."""
    axis = cell.axes[name]
    source = cell.io.get(axis.encoder or "")
    return AxisParameters(
        name=name,
        node=0 if source is None else source.node,
        units=units_of(axis),
        homing=HomingParameters(required=False),
        objects=OBJECTS_OF_ENCODER,
        modes=frozenset(),
        scan_period=cell.bus.scan_period,
        virtual=True,
        encoder=axis.encoder or "",
    )


def all_virtual(cell: CellConfig) -> dict[str, AxisParameters]:
    """Return the parameters of each axis without a drive, by name."""
    made = {
        name: (encoder_parameters if axis.encoder is not None else virtual_parameters)
        for name, axis in cell.axes.items()
        if axis.virtual
    }
    return {name: make(cell, name) for name, make in made.items()}


# -- The keys that a virtual axis may have in a cell file: those that need neither a node nor a drive ------------------


VIRTUAL, ENCODER = "virtual", "encoder"
# The keys of a virtual axis, and those of its tables.
KEYS = frozenset(
    {
        *(VIRTUAL, "unit", "scale", "modulo"),
        *("position_limits", "max_velocity", "max_acceleration"),
    }
)
TABLES: Mapping[str, frozenset[str]] = {
    "defaults": frozenset({"velocity", "acceleration", "deceleration", "jerk"}),
    "stop": frozenset({"deceleration", "halt_time", "quick_stop_time", "disable_time"}),
}
# The keys of an encoder axis: its position comes from an input, and no command moves it.
KEYS_OF_ENCODER = frozenset({VIRTUAL, ENCODER, "unit", "scale", "modulo"})


# Increments per unit, if the file gives none. They are no guess about a drive, but only the resolution of the core. It must
# be finer than that of the axes that follow it, and coarse enough for 607Ah and 60FFh, which hold 2³¹ increments in each direction.
# Ten thousand allow 214 748 units for a move, and as many per second; a million, for large units, allow 2147.
_FINE = Fraction(10_000)
_FINEST = Fraction(1_000_000)
_LARGE_UNITS = frozenset({"m", "dm", "ft", "rev", "turn", "turns", "rad", "l"})


class ForbiddenKey(NamedTuple):
    """A key or table that a virtual axis cannot have: its path, below the axis's own table, and the remedy."""

    path: tuple[str, ...]
    remedy: str


def is_virtual(table: Mapping[str, Any]) -> bool:
    """Whether the table of an axis describes an axis without a drive."""
    return table.get(VIRTUAL) is True or ENCODER in table


def keys_of(table: Mapping[str, Any]) -> tuple[frozenset[str], Mapping[str, frozenset[str]]]:
    """Return the allowed keys in the table of an axis without a drive, and those in its sub-tables."""
    return (KEYS_OF_ENCODER, {}) if ENCODER in table else (KEYS, TABLES)


def resolution(unit: object) -> Fraction:
    """Return the increments per unit of a virtual axis without ``scale``."""
    if unit == INCREMENTS:
        return Fraction(1)
    return _FINEST if unit in _LARGE_UNITS else _FINE


def quick_deceleration(axis: AxisConfig) -> float | None:
    """Return the quick-stop deceleration of a virtual axis, in unit/s²; None if the file gives no value for it."""
    given = axis.defaults
    return axis.stop.deceleration or given.deceleration or given.acceleration or axis.max_acceleration


def foreign(table: Mapping[str, Any]) -> Iterator[ForbiddenKey]:
    """Yield the keys and tables of a virtual axis that need a drive."""
    keys, tables = keys_of(table)
    for key in table:
        if key in schema.AXIS and key not in keys:
            yield ForbiddenKey((key,), f"leave {key} out")
        elif key in schema.AXIS_TABLES and key not in tables:
            yield ForbiddenKey((key,), _LEAVE_TABLE.get(key, "leave it out: an encoder cannot be commanded"))
    for name, own in tables.items():
        given, known = table.get(name), schema.AXIS_TABLES[name] or {}
        for key in given if isinstance(given, dict) else ():
            if key in known and key not in own:
                yield ForbiddenKey((name, key), f"leave {key} out")


def without(table: Mapping[str, Any], found: Iterator[ForbiddenKey] | list[ForbiddenKey]) -> dict[str, Any]:
    """Return the table of an axis without the keys in ``found``."""
    left = dict(table)
    for path, _ in found:
        if len(path) == 1:
            del left[path[0]]
        else:
            left[path[0]] = {key: value for key, value in left[path[0]].items() if key != path[1]}
    return left


_LEAVE_TABLE = {
    "homing": "leave it out: a virtual axis begins at 0, and axis.set_position(...) sets its position",
    "objects": "leave it out: there is no drive to write them into",
    "feed_forward": "leave it out: there is no drive that could use it",
}
