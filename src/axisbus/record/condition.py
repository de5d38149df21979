"""Parse conditions on values of axes: ``x.velocity > 100``, ``|x.torque| > 0.5``, ``x.state = fault``."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from axisbus.errors import ArgumentError

Values = Mapping[str, Mapping[str, Any]]  # by axis and name, in units; None is unknown
Condition = Callable[[Values], bool]
Kinds = Mapping[str, str]  # the JSON type of each value that an axis has
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
    r"(?P<bar>\|?)\s*(?P<axis>[^\s.|]+)\.(?P<name>\w+)\s*\|?\s*(?P<sign>[<>]=?|!=|==?)\s*(?P<value>.+)"
)
_ORDERED = frozenset({">", "<", ">=", "<="})
_EXAMPLES = "write it as 'x.velocity > 100', '|x.torque| > 0.5', or 'x.state = fault'"


def condition(text: str, axes: Iterable[str], kinds: Kinds, examples: str = _EXAMPLES) -> Condition:
    """Return the condition in ``text``; an unknown value meets no condition. ``examples``: the remedy for an invalid text.

    Raises:
        ArgumentError: the text is not a condition, or names an unknown axis or value.
    """
    found = _TEXT.fullmatch(text.strip())
    if found is None:
        raise ArgumentError(f"{text!r} is not a condition", remedy=examples)
    axis, name = found["axis"], found["name"]
    if axis not in (there := list(axes)):
        raise ArgumentError(f"{text!r}: there is no axis {axis!r}", observed=f"there are {', '.join(there)}")
    if name not in kinds:
        raise ArgumentError(f"{text!r}: there is no value {name!r}", observed=f"there are {', '.join(kinds)}")
    holds = comparison(text, found, kinds[name], examples)

    def met(values: Values) -> bool:
        value = values[axis][name]
        return value is not None and holds(value)

    return met


def comparison(text: str, found: re.Match[str], kind: str, examples: str) -> Callable[[Any], bool]:
    """Return a test for values of this JSON type, by the ``bar``, ``sign`` and ``value`` of ``found``.

    Raises:
        ArgumentError: the comparison value has another type.
    """
    sign = found["sign"]
    wanted = _wanted(text, found["value"].strip(), kind, sign, examples)
    holds, size = _OPERATORS[sign], abs if found["bar"] else _same
    return lambda value: holds(size(value), wanted)


def _wanted(text: str, value: str, kind: str, sign: str, examples: str) -> Any:
    """Return the comparison value.

    Raises:
        ArgumentError: it has another type.
    """
    if kind == "string" and sign not in _ORDERED:
        return value.strip("'\"")
    if kind == "boolean" and value.lower() in ("true", "false") and sign not in _ORDERED:
        return value.lower() == "true"
    try:
        return int(value, 0) if kind == "integer" else float(value)
    except ValueError:
        raise ArgumentError(
            f"{text!r} is not a condition: {value!r} cannot be compared in this manner", remedy=examples
        ) from None


def _same(value: Any) -> Any:
    return value
