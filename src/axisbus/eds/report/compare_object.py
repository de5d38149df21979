"""The differences of one object that exists in both EDS files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import NamedTuple

from axisbus.cia301 import objects as cia301
from axisbus.cia402 import objects as cia402
from axisbus.cia402.axes import first_axis
from axisbus.eds.io.values import Default
from axisbus.eds.model import Number, Object, Variable
from axisbus.eds.report import consequences, wording
from axisbus.eds.report.consequences import DifferenceGroup, EdsDifference

Meaning = Callable[[Variable, Variable, int | None], str]

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
    meaning: Meaning


def _silent(a: Variable, b: Variable, node_id: int | None) -> str:  # noqa: ARG001  the shape of every ``meaning``
    return ""


def _mappable(entry: Variable) -> str:
    return "mappable" if entry.pdo_mapping else "not mappable"


def _property(
    title: str,
    field: str,
    meaning: Meaning = _silent,
    group: DifferenceGroup = DifferenceGroup.TYPES,
    text: Callable[[Variable], str] | None = None,
) -> _Fact:
    """Return the fact of a property, which is written as it is compared unless ``text`` writes it."""
    key = attrgetter(field)
    return _Fact(
        group, title, lambda entry, _: key(entry), lambda entry, _: str((text or key)(entry)), meaning
    )


def _value(title: str, field: str, meaning: Meaning, group: DifferenceGroup) -> _Fact:
    """Return the fact of a value, which may depend on the node-ID."""

    def key(entry: Variable, node_id: int | None) -> object:
        return _resolved(getattr(entry, field), node_id)

    def text(entry: Variable, node_id: int | None) -> str:
        return wording.value(getattr(entry, field), entry, node_id)

    return _Fact(group, title, key, text, meaning)


_FACTS = (
    _property("DataType", "data_type", consequences.data_type, text=wording.type_name),
    _property("AccessType", "access", consequences.access),
    _property("PDOMapping", "pdo_mapping", consequences.mappable, text=_mappable),
    _property("ObjFlags", "object_flags"),
    _value("LowLimit", "low", consequences.low_limit, DifferenceGroup.LIMITS),
    _value("HighLimit", "high", consequences.high_limit, DifferenceGroup.LIMITS),
    _property("ParameterName", "name", group=DifferenceGroup.NAMES),
    _property("Denotation", "denotation", group=DifferenceGroup.NAMES),
)
_VALUES = (
    _value("DefaultValue", "default", consequences.default, DifferenceGroup.DEFAULTS),
    _value("ParameterValue", "parameter_value", consequences.default, DifferenceGroup.DEFAULTS),
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
        counterpart = other.subs.get(subindex)
        if counterpart is not None:
            facts = _FACTS if (one.index, subindex) in mapped else (*_FACTS, *_VALUES)
            yield from _entry(one, sub, counterpart, node_id, facts)


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
