"""What a virtual axis may say in a cell file: what is the axis's own, and nothing that a node or a drive would have to do."""

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
# Of an encoder's: it is where its input says, and nothing leads it.
KEYS_OF_ENCODER = frozenset({VIRTUAL, ENCODER, "unit", "scale", "modulo"})

# Increments per unit, where the file gives none. That is no guess about a drive: it is only how finely the core counts. It must be
# finer than what follows it, and coarse enough for 607Ah and 60FFh, which hold 2³¹ increments to either side: ten thousand leave
# 214 748 units for a move, and as many per second; a million 2147 of those of which one is large.
_FINE = Fraction(10_000)
_FINEST = Fraction(1_000_000)
_LARGE_UNITS = frozenset({"m", "dm", "ft", "rev", "turn", "turns", "rad", "l"})


class ForbiddenKey(NamedTuple):
    """A key or table that a virtual axis cannot have: where it stands, below the axis's own table, and what to do."""

    path: tuple[str, ...]
    remedy: str


def is_virtual(table: Mapping[str, Any]) -> bool:
    """Whether the table of an axis is that of one without a drive."""
    return table.get(VIRTUAL) is True or ENCODER in table


def keys_of(table: Mapping[str, Any]) -> tuple[frozenset[str], Mapping[str, frozenset[str]]]:
    """Return the keys that the table of an axis without a drive may have, and those of its tables."""
    return (KEYS_OF_ENCODER, {}) if ENCODER in table else (KEYS, TABLES)


def resolution(unit: object) -> Fraction:
    """Return the increments per unit of a virtual axis without ``scale``."""
    if unit == INCREMENTS:
        return Fraction(1)
    return _FINEST if unit in _LARGE_UNITS else _FINE


def quick_deceleration(axis: AxisConfig) -> float | None:
    """Return what the quick stop of a virtual axis brakes with, in unit/s²; None where the file gives nothing to do it with."""
    given = axis.defaults
    return axis.stop.deceleration or given.deceleration or given.acceleration or axis.max_acceleration


def foreign(table: Mapping[str, Any]) -> Iterator[ForbiddenKey]:
    """Yield what stands in the table of a virtual axis and belongs to a drive."""
    keys, tables = keys_of(table)
    for key in table:
        if key in schema.AXIS and key not in keys:
            yield ForbiddenKey((key,), f"leave {key} out")
        elif key in schema.AXIS_TABLES and key not in tables:
            yield ForbiddenKey((key,), _LEAVE_TABLE.get(key, "leave it out: nothing leads an encoder"))
    for name, own in tables.items():
        given, known = table.get(name), schema.AXIS_TABLES[name] or {}
        for key in given if isinstance(given, dict) else ():
            if key in known and key not in own:
                yield ForbiddenKey((name, key), f"leave {key} out")


def without(table: Mapping[str, Any], found: Iterator[ForbiddenKey] | list[ForbiddenKey]) -> dict[str, Any]:
    """Return the table of an axis without what was ``found`` in it."""
    left = dict(table)
    for path, _ in found:
        if len(path) == 1:
            del left[path[0]]
        else:
            left[path[0]] = {key: value for key, value in left[path[0]].items() if key != path[1]}
    return left


_LEAVE_TABLE = {
    "homing": "leave it out: a virtual axis begins at 0, and axis.set_position(...) says where it is",
    "objects": "leave it out: there is nothing to write them into",
    "feed_forward": "leave it out: there is no drive to be told anything",
}
