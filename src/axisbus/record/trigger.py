"""What lets a capture begin: a condition on the values of an axis, in its units, or a fault of any axis.

``x.velocity > 100``, ``|x.following_error| > 0.5``, ``x.state = ErrorStop``, ``x.mode = csp``, ``fault``. It is what becomes true
that counts: what is so from the beginning must have been otherwise in between.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

from axisbus.errors import ArgumentError
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState
from axisbus.record.columns import COLUMNS, NAMES, AxisForm
from axisbus.record.packed import sample_of

Values = Mapping[str, Mapping[str, Any]]  # by axis and column, in units; None is unknown
Condition = Callable[[Values], bool]
_OPERATORS: Mapping[str, Callable[[Any, Any], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
    "!=": operator.ne,
    "==": operator.eq,
    "=": operator.eq,
}
_TEXT = re.compile(
    r"(?P<bar>\|?)\s*(?P<axis>[^\s.|]+)\.(?P<column>\w+)\s*\|?\s*(?P<sign>[<>]=?|!=|==?)\s*(?P<value>.+)"
)
_FAULT = "fault"
_ORDERED = frozenset({">", "<", ">=", "<="})
_EXAMPLES = "write it as 'x.velocity > 100', '|x.following_error| > 0.5', 'x.state = ErrorStop', or 'fault'"


class Trigger:
    """Looks at each cycle; holds whether its condition was true in the one before."""

    def __init__(self, when: str | Condition, forms: Mapping[str, AxisForm]) -> None:
        """``when``: as above, or a function of the values of all axes; ``forms``: of the axes that there are.

        Raises:
            ArgumentError: the text says no condition, or one of an axis or a value that is not recorded.
        """
        self._forms = forms
        self._condition = _fault if when == _FAULT else when if callable(when) else _parsed(when, forms)
        self._before = True

    def fires(self, snapshots: Mapping[str, Snapshot]) -> bool:
        """Return whether the condition has become true in this cycle; raises what a user's function raises."""
        values = {
            name: dict(zip(NAMES, form.values(sample_of(snapshots[name])), strict=True))
            for name, form in self._forms.items()
        }
        now = bool(self._condition(values))
        fires, self._before = now and not self._before, now
        return fires


def _fault(values: Values) -> bool:
    return any(axis["state"] == AxisState.ERRORSTOP.value for axis in values.values())


def _parsed(text: str, forms: Mapping[str, AxisForm]) -> Condition:
    found = _TEXT.fullmatch(text.strip())
    if found is None:
        raise ArgumentError(f"{text!r} is no condition", remedy=_EXAMPLES)
    axis, column, sign = found["axis"], found["column"], found["sign"]
    if axis not in forms:
        raise ArgumentError(
            f"{text!r}: no axis {axis!r} is recorded", observed=f"there are {', '.join(forms)}"
        )
    kind = next((each.type for each in COLUMNS if each.name == column), None)
    if kind is None:
        raise ArgumentError(
            f"{text!r}: there is no value {column!r}", observed=f"there are {', '.join(NAMES)}"
        )
    wanted = _wanted(text, found["value"].strip(), kind, sign)
    holds, size = _OPERATORS[sign], abs if found["bar"] else _same

    def condition(values: Values) -> bool:
        value = values[axis][column]
        return value is not None and holds(size(value), wanted)

    return condition


def _wanted(text: str, value: str, kind: str, sign: str) -> Any:
    """Return the value that is compared with.

    Raises:
        ArgumentError: it is none of its kind.
    """
    if kind == "string" and sign not in _ORDERED:
        return value.strip("'\"")
    if kind == "boolean" and value.lower() in ("true", "false") and sign not in _ORDERED:
        return value.lower() == "true"
    try:
        return int(value, 0) if kind == "integer" else float(value)
    except ValueError:
        raise ArgumentError(
            f"{text!r} is no condition: {value!r} cannot be compared so", remedy=_EXAMPLES
        ) from None


def _same(value: Any) -> Any:
    return value
