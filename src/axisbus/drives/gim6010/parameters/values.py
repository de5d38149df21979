"""Values of parameters as text and as JSON, and their equality for a module."""

from __future__ import annotations

import math
import struct

from axisbus.errors import ArgumentError

Value = int | float | bool

_BOOLEANS = {"true": True, "1": True, "on": True, "false": False, "0": False, "off": False}
_WILD = {"nan", "inf", "-inf"}


def parse(name: str, kind: str, text: str) -> Value:
    """Convert a text to the value of a parameter or register; ``kind`` is its type (``bool``, ``float``, ``float32``, or integer).

    Raises:
        ArgumentError: the text is not such a value.
    """
    found: Value | None
    try:
        if kind == "bool":
            found = _BOOLEANS.get(text.lower())
        elif kind in ("float", "float32"):
            found = float(text)
        else:
            found = int(text, 0)
    except ValueError:
        found = None
    if found is None or (isinstance(found, float) and not math.isfinite(found)):
        raise ArgumentError(f"{name}: {text!r} is not a value of type {kind} that can be written")
    return found


def show(value: Value) -> str:
    """Return a value as text; a float with seven significant digits, the precision of 32 bits."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.7g}" if isinstance(value, float) else str(value)


def same(one: Value, other: Value) -> bool:
    """Return whether two values are equal for a module, whose floats have 32 bits; NaN equals NaN."""
    if isinstance(one, float) or isinstance(other, float):
        return _single(one) == _single(other)
    return one == other


def _single(value: Value) -> object:
    try:
        (found,) = struct.unpack("<f", struct.pack("<f", value))
    except (OverflowError, struct.error):  # beyond a 32-bit float
        return value
    return "nan" if math.isnan(found) else found


def plain(value: Value) -> Value | str:
    """Return a value for JSON: NaN and infinities, which JSON does not support, as text."""
    return value if not isinstance(value, float) or math.isfinite(value) else str(value)


def of_plain(path: str, value: object, source: str) -> Value:
    """Return a value from JSON. Raises ArgumentError: it is not a parameter's value."""
    if isinstance(value, bool | int | float):
        return value
    if isinstance(value, str) and value in _WILD:
        return float(value)
    raise ArgumentError(f"{source}: {path} has {value!r}, which is not a value of a parameter")
