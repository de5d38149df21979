"""The keys that a virtual axis may have in a cell file: those that need neither a node nor a drive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any, NamedTuple

from axisbus.cell import schema
from axisbus.cell.model import AxisConfig
from axisbus.units import INCREMENTS

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
