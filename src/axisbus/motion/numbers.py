"""What counts as a number in a call: anything real and finite that a float can hold, and no yes or no."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Real
from typing import Any

from axisbus.wording import counted

_LONGEST = 40  # characters of a value in a message


def number(value: object) -> float | None:
    """Return a finite number as a float; None for anything else."""
    if type(value) is float:  # what a trajectory gives in every cycle
        return value if math.isfinite(value) else None
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        found = float(value)
    except Exception:  # noqa: BLE001  # too large, or a type of the program's own that cannot say
        return None
    return found if math.isfinite(found) else None


def flag(value: object) -> bool | None:
    """Return a yes or no, also of numpy; None for anything else."""
    if isinstance(value, bool):
        return value
    try:
        return bool(value) if value in (0, 1) else None
    except Exception:  # noqa: BLE001  # such as a whole array
        return None


def items(value: object) -> tuple[Any, ...] | None:
    """Return what a sequence is made of, also one of numpy; None for anything else: a text, a table, a single value."""
    if isinstance(value, (str, bytes, Mapping)):
        return None
    try:
        len(value)  # type: ignore[arg-type]  # else it may have no end
        return tuple(value)  # type: ignore[arg-type]
    except Exception:  # noqa: BLE001  # such as a number, or a type of the program's own
        return None


def told(value: object) -> str:
    """Return a value as Python shows it, in a line that can be read."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001  # an integer of thousands of digits, or a type of the program's own
        return f"a {type(value).__name__}"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}... ({counted(len(text), 'character')})"
