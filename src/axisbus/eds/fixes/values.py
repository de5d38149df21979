"""Fixes of values: the same value in the notation of DS 306 4.3."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping

from axisbus.cia301.datatypes import DataType
from axisbus.eds.fixes.base import Fix, FixContext, FixFunction, each, short
from axisbus.eds.io import edit, text, values
from axisbus.eds.io.new_file import written
from axisbus.eds.model import DUMMIES, EdsFinding, Number

_H_SUFFIX = re.compile(r"(?:0[xX])?([0-9][0-9A-Fa-f]*)[hH]")
_LETTER_O = re.compile(r"[oO][xX]([0-9A-Fa-f]+)")
_C_SUFFIX = re.compile(r"(0[xX][0-9A-Fa-f]+|[0-9]+)[uUlL]{1,3}")
_TERM = re.compile(r"0[xX][0-9A-Fa-f]+|[0-9]+", re.ASCII)
_TEXT_TYPES = (DataType.VISIBLE_STRING, DataType.UNICODE_STRING)


_NewText = Callable[[str, DataType], str]  # empty: this value needs the user's judgement


def _formula(given: str, _: DataType) -> str:
    """Write a formula as ``$NODEID+number``; the number keeps its spelling."""
    number = values.integer(given).value
    if number is None or not number.plus_node_id:
        return ""
    terms = [term for part in given.split("+") if _TERM.fullmatch(term := part.strip())]
    if len(terms) != 1:
        return written(number, DataType.UNSIGNED32)
    return f"$NODEID+{terms[0]}"


def _decimal(given: str, data_type: DataType) -> str:
    value = values.parse(given, data_type).value if data_type.integer else values.integer(given).value
    return str(value.value) if isinstance(value, Number) and not value.plus_node_id else ""


def _unquoted(given: str, _: DataType) -> str:
    return given[1:-1]


def _plain_octets(given: str, _: DataType) -> str:
    return given[2:] if given[:2].lower() == "0x" else ""


def _digits(given: str, _: DataType) -> str:
    """Convert a number of another language to DS 306: 1Fh, 0x1FUL, 16#1F, and O for 0 in Ox1F."""
    if iec := values.iec_number(given):
        return iec
    if found := _H_SUFFIX.fullmatch(given) or _LETTER_O.fullmatch(given):
        return f"0x{found[1]}"
    found = _C_SUFFIX.fullmatch(given)
    return found[1] if found else ""


_NEW_TEXTS: Mapping[str, _NewText] = {
    "V001": _digits,
    "V006": _formula,
    "V010": _decimal,
    "V011": _decimal,
    "V013": _unquoted,
    "V015": _decimal,
    "V017": _plain_octets,
    "V020": _formula,
    "V021": _decimal,
}


def _fixed_value(rule: str, context: FixContext, finding: EdsFinding) -> Fix | None:
    """Rewrite one value; a value that would be read differently afterwards is not changed."""
    section = context.section_at(finding.line)
    key, given = text.entry_of(context.document.lines[finding.line - 1])
    data_type = context.type_at(finding)
    new = _NEW_TEXTS[rule](given, data_type)
    if (
        not new
        or new != new.strip()
        or section.line_numbers.get(key) != finding.line
        or not _same(rule, given, new, data_type)
    ):
        return None
    change = edit.set_value(context.document, section, key, new)
    return Fix(rule, finding.line, f"[{section.name}] {short(given)} -> {short(new)}", (change,))


def _same(rule: str, given: str, new: str, data_type: DataType) -> bool:
    read = values.parse if data_type.integer or data_type in _READ_BY_TYPE else _as_integer
    before, after = read(given, data_type), read(new, data_type)
    commented = data_type not in _TEXT_TYPES and values.has_comment(given)
    if commented or after.value is None or any(problem.rule == rule for problem in after.problems):
        return False
    return rule == "V001" or before.value == after.value


def _as_integer(given: str, _: DataType) -> values.Parsed[values.Default]:
    number, problems = values.integer(given)
    return values.Parsed(number, problems)


_READ_BY_TYPE = frozenset(
    (*_TEXT_TYPES, DataType.REAL32, DataType.REAL64, DataType.OCTET_STRING, DataType.DOMAIN)
)


def _of(rule: str) -> FixFunction:
    return each(rule, lambda context, finding: _fixed_value(rule, context, finding))


FIXES: Mapping[str, FixFunction] = {rule: _of(rule) for rule in _NEW_TEXTS}


# ----------------------------------------------------------------------------------------------------------------------
# Fixes of [DummyUsage]: keys of four digits, and an entry for each data type that can fill space in a PDO (DS 306 4.6.2).


_SHORT = re.compile(r"dummy([0-9a-f]{1,3})")


def _short_keys(context: FixContext) -> Iterator[Fix]:
    """Fix D016, if the complete key does not exist in another spelling."""
    section = context.document.sections.get("dummyusage")
    if section is None:
        return
    taken = set(section.entries)
    for key, line in section.line_numbers.items():
        found = _SHORT.fullmatch(key)
        if found is None or (name := f"Dummy{int(found[1], 16):04X}").lower() in taken:
            continue
        taken.add(name.lower())
        change = edit.rename_key(context.document, line, name)
        yield Fix("D016", line, f"[{section.name}] {key.capitalize()} -> {name}", (change,))


def _left_out(context: FixContext) -> Iterator[Fix]:
    """Fix D019: a missing entry means 0."""
    section = context.document.sections.get("dummyusage")
    if section is None or any(values.plain(text) is None for text in section.entries.values()):
        return  # D016: an unknown entry
    absent = {
        name: "0" for number in DUMMIES if (name := f"Dummy{number:04X}").lower() not in section.entries
    }
    if absent:
        changes = tuple(edit.set_values(context.document, section, absent))
        yield Fix("D019", section.line, f"[{section.name}] {', '.join(absent)} added as 0", changes)


NAMES: Mapping[str, FixFunction] = {"D016": _short_keys}
DUMMY_USAGE_FIXES: Mapping[str, FixFunction] = {"D019": _left_out}
