"""The differences of one object that exists in both EDS files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from axisbus.cia301 import objects as cia301
from axisbus.cia402 import objects as cia402
from axisbus.cia402.axes import first_axis
from axisbus.eds.model import Number, Object, Variable
from axisbus.eds.report import consequences, wording
from axisbus.eds.report.consequences import DifferenceGroup, EdsDifference

Default = Number | float | str | bytes | None

# Objects whose values identify the device.
_IDENTITY = frozenset(
    (
        *(cia301.DEVICE_TYPE, cia301.DEVICE_NAME, cia301.HARDWARE_VERSION, cia301.SOFTWARE_VERSION),
        *(cia301.IDENTITY, cia402.SUPPORTED_DRIVE_MODES),
    )
)


class _Fact(NamedTuple):
    """One property of an entry: the key for comparing it, its text, and the consequence of a change for a master."""

    group: DifferenceGroup
    title: str
    key: Callable[[Variable, int | None], object]
    text: Callable[[Variable, int | None], str]
    meaning: Callable[[Variable, Variable, int | None], str]


def _silent(a: Variable, b: Variable, node_id: int | None) -> str:  # noqa: ARG001  the shape of every ``meaning``
    return ""


_FACTS = (
    _Fact(
        DifferenceGroup.TYPES,
        "DataType",
        lambda entry, _: entry.data_type,
        lambda entry, _: wording.type_name(entry),
        consequences.data_type,
    ),
    _Fact(
        DifferenceGroup.TYPES,
        "AccessType",
        lambda entry, _: entry.access,
        lambda entry, _: entry.access,
        consequences.access,
    ),
    _Fact(
        DifferenceGroup.TYPES,
        "PDOMapping",
        lambda entry, _: entry.pdo_mapping,
        lambda entry, _: "mappable" if entry.pdo_mapping else "not mappable",
        consequences.mappable,
    ),
    _Fact(
        DifferenceGroup.TYPES,
        "ObjFlags",
        lambda entry, _: entry.object_flags,
        lambda entry, _: str(entry.object_flags),
        _silent,
    ),
    _Fact(
        DifferenceGroup.LIMITS,
        "LowLimit",
        lambda entry, node_id: _resolved(entry.low, node_id),
        lambda entry, node_id: wording.value(entry.low, entry, node_id),
        consequences.low_limit,
    ),
    _Fact(
        DifferenceGroup.LIMITS,
        "HighLimit",
        lambda entry, node_id: _resolved(entry.high, node_id),
        lambda entry, node_id: wording.value(entry.high, entry, node_id),
        consequences.high_limit,
    ),
    _Fact(
        DifferenceGroup.NAMES,
        "ParameterName",
        lambda entry, _: entry.name,
        lambda entry, _: entry.name,
        _silent,
    ),
    _Fact(
        DifferenceGroup.NAMES,
        "Denotation",
        lambda entry, _: entry.denotation,
        lambda entry, _: entry.denotation,
        _silent,
    ),
)
_VALUES = (
    _Fact(
        DifferenceGroup.DEFAULTS,
        "DefaultValue",
        lambda entry, node_id: _resolved(entry.default, node_id),
        lambda entry, node_id: wording.value(entry.default, entry, node_id),
        consequences.default,
    ),
    _Fact(
        DifferenceGroup.DEFAULTS,
        "ParameterValue",
        lambda entry, node_id: _resolved(entry.parameter_value, node_id),
        lambda entry, node_id: wording.value(entry.parameter_value, entry, node_id),
        consequences.default,
    ),
)


def object_differences(
    one: Object, other: Object, node_id: int | None, mapped: frozenset[tuple[int, int]]
) -> Iterator[EdsDifference]:
    """Yield the differences of an object in both files; values of the entries in ``mapped`` are compared elsewhere."""
    lines = (one.line, other.line)
    if one.object_type != other.object_type:
        types = (one.object_type.name, other.object_type.name)
        meaning = "" if one.is_record == other.is_record else "its values are under other sub-indices"
        yield EdsDifference(
            DifferenceGroup.TYPES, f"{one.name}: ObjectType", *types, one.index, None, meaning, *lines
        )
    if one.is_record != other.is_record:
        return  # sub-index 0 is a value in one file and a count in the other: nothing to compare
    if one.is_record and other.is_record and one.name != other.name:
        yield EdsDifference(
            DifferenceGroup.NAMES, "ParameterName", one.name, other.name, one.index, None, "", *lines
        )
    for subindex, sub in one.subs.items():
        beside = other.subs.get(subindex)
        if beside is not None:
            facts = _FACTS if (one.index, subindex) in mapped else (*_FACTS, *_VALUES)
            yield from _entry(one, sub, beside, node_id, facts)


def _entry(
    owner: Object, a: Variable, b: Variable, node_id: int | None, facts: tuple[_Fact, ...]
) -> Iterator[EdsDifference]:
    for fact in facts:
        if fact.key(a, node_id) == fact.key(b, node_id):
            continue
        group = _group(fact.group, a)
        title = (
            fact.title if group is DifferenceGroup.NAMES else f"{wording.full_name(owner, a)}: {fact.title}"
        )
        yield EdsDifference(
            group,
            title,
            fact.text(a, node_id),
            fact.text(b, node_id),
            a.index,
            a.subindex if owner.is_record else None,
            fact.meaning(a, b, node_id),
            a.line,
            b.line,
        )


def _group(group: DifferenceGroup, entry: Variable) -> DifferenceGroup:
    """Return the group of a difference: values of identity objects and PDO parameters have groups of their own."""
    if group is not DifferenceGroup.DEFAULTS:
        return group
    if first_axis(entry.index) in _IDENTITY:
        return DifferenceGroup.IDENTITY
    return DifferenceGroup.PDO if cia301.is_pdo_parameter(entry.index) else group


def _resolved(given: Default, node_id: int | None) -> object:
    """Return the key for comparing a value: its number, or the formula if no node-ID resolves it."""
    if not isinstance(given, Number):
        return given
    if given.plus_node_id and node_id is None:
        return given
    return given.resolve(node_id)
