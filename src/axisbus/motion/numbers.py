"""Validation of numbers in calls: a number is any real, finite value that a float can hold, except a bool."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Real
from typing import Any

from axisbus.wording import counted

_LONGEST = 40  # characters of a value in a message


def number(value: object) -> float | None:
    """Return a finite number as a float; None for anything else."""
    if type(value) is float:  # the usual type: a trajectory returns one in every cycle
        return value if math.isfinite(value) else None
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        found = float(value)
    except Exception:  # noqa: BLE001  # too large, or a user-defined type without a conversion
        return None
    return found if math.isfinite(found) else None


def flag(value: object) -> bool | None:
    """Return a boolean, also from numpy and for 0 and 1; None for anything else."""
    if isinstance(value, bool):
        return value
    try:
        return bool(value) if value in (0, 1) else None
    except Exception:  # noqa: BLE001  # for example a whole array
        return None


def items(value: object) -> tuple[Any, ...] | None:
    """Return the elements of a sequence, also from numpy; None for anything else: a text, a mapping, a single value."""
    if isinstance(value, (str, bytes, Mapping)):
        return None
    try:
        len(value)  # type: ignore[arg-type]  # otherwise it may be endless
        return tuple(value)  # type: ignore[arg-type]
    except Exception:  # noqa: BLE001  # for example a number, or a user-defined type
        return None


def short_repr(value: object) -> str:
    """Return the repr of a value, shortened to one readable line."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001  # an integer of thousands of digits, or a user-defined type
        return f"a {type(value).__name__}"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}... ({counted(len(text), 'character')})"
