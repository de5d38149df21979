"""Give an object of an EDS a value: find the object, and check the value."""

from __future__ import annotations

import re

from axisbus.cia301.datatypes import DataType
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.io import values
from axisbus.eds.io.new_file import written
from axisbus.eds.io.values import Default, Limit
from axisbus.eds.model import Eds, Number, Variable
from axisbus.errors import ArgumentError, LimitError

# Problems of a text whose meaning is clear: the value is written in its correct form.
_CLEAR = frozenset(("V006", "V020"))
_TWOS_COMPLEMENT = "V010"  # clear in hexadecimal, but 200 for an INTEGER8 is a mistake
_SUB = re.compile(r"(?i)(?<=[0-9a-fh])sub(?=[0-9a-f]{1,2}h?$)")
_OCTETS = frozenset((DataType.OCTET_STRING, DataType.DOMAIN))


def entry(eds: Eds, address: str) -> Variable:
    """Return the one entry that ``address`` names.

    ``address`` is a name (``"Profile velocity"``, ``"Object.Sub-index name"``), or an index in hexadecimal digits with an optional
    sub-index: ``6081``, ``0x6081``, ``6099h:01``, ``1018sub1``.

    Raises:
        ArgumentError: the file has no such entry, or several of this name.
    """
    named = _named(eds, address)
    if len(named) > 1:
        existing = ", ".join(_where(each) for each in named)
        raise ArgumentError(
            f"{address!r} is the name of several objects",
            observed=f"these: {existing}",
            remedy="give the index",
        )
    if named:
        return named[0]
    found = Dictionary(eds).resolve(_SUB.sub(":", address.strip()))
    return at(eds, found.index, found.subindex)


def at(eds: Eds, index: int, subindex: int) -> Variable:
    """Return the entry at an index and sub-index.

    Raises:
        ArgumentError: the file has no such entry.
    """
    variable = eds.get(index, subindex)
    if variable is not None:
        return variable
    entry = eds.objects.get(index)
    existing = "" if entry is None else ", ".join(f"{sub:02X}" for sub in list(entry.subs)[:12])
    raise ArgumentError(
        f"{eds.source} has no object {index:04X}h:{subindex:02X}",
        observed=f"{index:04X}h has the sub-indices {existing}" if existing else "",
        remedy="list the objects: axisbus eds show",
    )


def _named(eds: Eds, name: str) -> list[Variable]:
    lowered = name.strip().lower()
    found = []
    for entry in eds:
        if not lowered.startswith(entry.name.lower()):
            continue
        for sub in entry.subs.values():
            full = f"{entry.name}.{sub.name}" if entry.is_record else entry.name
            if full.lower() == lowered:
                found.append(sub)
    return found


def text_for(variable: Variable, given: str, node_id: int | None = None) -> str:
    """Return ``given`` as an EDS writes it for this entry, if the entry can have that value.

    Numbers are decimal, hexadecimal (``0x``) or formulas (``$NODEID+0x200``); octets are pairs of hexadecimal digits. If the limits
    or the value depend on the node-ID, they are compared for ``node_id`` (1 to 127).

    Raises:
        ArgumentError: the entry cannot be written, or the text is no value of its type.
        LimitError: the value does not fit the type, or is outside LowLimit and HighLimit.
    """
    check_writable(variable)
    value, problems = values.parse(given.strip(), variable.data_type)
    clear = _CLEAR | {_TWOS_COMPLEMENT} if "0x" in given.lower() else _CLEAR
    refused = [problem for problem in problems if problem.rule not in clear]
    if value is None or refused:
        raise _refused(variable, given, refused[0] if refused else values.ValueProblem("V001", "it is empty"))
    check_limits(variable, value, node_id)
    is_plain_formula = given.strip() == "$NODEID"  # some readers require a number after it
    return written(value, variable.data_type) if problems or is_plain_formula else given.strip()


def check_writable(variable: Variable) -> None:
    """Raise ArgumentError unless SDO may write the entry."""
    if not variable.writable:
        raise ArgumentError(
            f"{_where(variable)} cannot be written", observed=f"its access is {variable.access}",
            remedy="leave it out; the values of a record are set by sub-index, such as 6099:01",
        )  # fmt: skip


def check_limits(variable: Variable, value: Default, node_id: int | None) -> None:
    """Raise LimitError if a value is outside LowLimit and HighLimit of its entry, for a node-ID (1 to 127) or without one."""
    number = _plain(value, node_id)
    low, high = _plain(variable.low, node_id), _plain(variable.high, node_id)
    beyond = number is not None and (
        (low is not None and number < low) or (high is not None and number > high)
    )
    if isinstance(value, Number) and variable.data_type.integer and not beyond:
        bottom, top = variable.data_type.range
        beyond = not bottom <= value.resolve(node_id) <= top
        low, high = (bottom, top) if beyond else (low, high)
    if beyond:
        raise LimitError(
            f"{_where(variable)}: {number} is outside its limits",
            observed=_allowed(low, high),
            remedy="give a value within the limits, or correct the limits in the file",
        )


def _allowed(low: float | None, high: float | None) -> str:
    if low is None:
        return f"the highest allowed value is {high}"
    return f"the lowest allowed value is {low}" if high is None else f"the allowed range is {low} to {high}"


def _plain(value: Default | Limit, node_id: int | None) -> float | None:
    if isinstance(value, Number):
        return value.resolve(node_id)
    return value if isinstance(value, (int, float)) else None


def _refused(variable: Variable, given: str, problem: values.ValueProblem) -> ArgumentError:
    kind = LimitError if problem.rule in ("V005", "V009", _TWOS_COMPLEMENT) else ArgumentError
    type_name = variable.data_type.name
    octets = variable.data_type in _OCTETS
    return kind(
        f"{_where(variable)} cannot be {given[:60]!r}",
        observed=problem.text if type_name in problem.text else f"{problem.text}; the type is {type_name}",
        remedy="give pairs of hexadecimal digits, such as 01FF"
        if octets
        else "give a value of this type, such as 10 or 0x0A",
    )


def _where(variable: Variable) -> str:
    return f"{variable.index:04X}h:{variable.subindex:02X} ({variable.name})"
