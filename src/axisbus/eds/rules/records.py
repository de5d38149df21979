"""Rules for objects with sub-indices: their number, names and types (DS 306 4.6.3.2, CiA 301 7.4.4)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from axisbus.cia301.datatypes import DataType
from axisbus.cia301.objects import is_pdo_communication, is_pdo_mapping
from axisbus.eds.io import compact, values
from axisbus.eds.io.compact import MAX_ENTRIES
from axisbus.eds.io.text import Section
from axisbus.eds.model import Number, Object, ObjectType, Severity, Variable
from axisbus.eds.rules.context import Hit, RuleContext, an, finds, short, text_of
from axisbus.wording import counted

# -- Determine which sub-index of an object is probably missing, from the object's own counts ------------------------------

STRUCTURE = 0xFF  # sub-index FFh holds the object's own type and size (CiA 301 7.4.4), and is not counted


def is_compact(head: Section) -> bool:
    """Whether an object uses CompactSubObj, even if its number is not valid."""
    given = head.entries.get("compactsubobj", "")
    return bool(given) and values.plain(given) != 0


def count_of(entry: Object) -> int | None:
    """Return the default of sub-index 0, None if it is no number."""
    count = entry.subs.get(0)
    return count.default.value if count is not None and isinstance(count.default, Number) else None


def one_is_missing(head: Section, present: int) -> bool:
    """Whether SubNumber counts one sub-index more than the ``present`` that have a section."""
    return values.plain(head.entries.get("subnumber", "")) == present + 1


def missing_subindex(entry: Object, head: Section, present: int) -> int | None:
    """Return the sub-index whose section is missing; None unless SubNumber and sub-index 0 leave only one possibility.

    ``present`` is the number of sub-indices that have a section.
    """
    if not one_is_missing(head, present):
        return None
    if 0 not in entry.subs:
        return 0
    highest = min(count_of(entry) or 0, MAX_ENTRIES)  # the file may contain any number
    absent = [sub for sub in range(1, highest + 1) if sub not in entry.subs]
    return absent[0] if len(absent) == 1 else None


# -- The rules -------------------------------------------------------------------------------------------------------------

_ERROR_FIELD = 0x1003
# of DS 301 V3: all its sub-indices are UNSIGNED32, even 0, the number of synchronous PDOs
_PDOS_SUPPORTED = 0x1004
_COUNT_OF_ITS_OWN = (_ERROR_FIELD, _PDOS_SUPPORTED)  # their sub-index 0 is not the highest sub-index
# Keys that belong to the sub-indices of an object, not to the object.
_ON_DATA = ("DefaultValue", "ParameterValue", "LowLimit", "HighLimit", "PDOMapping")
_OF_TYPE = ("DataType", "AccessType")


@finds("O007")
def sub_number(context: RuleContext) -> Iterator[Hit]:
    """O007."""
    for entry, head in context.records:
        given = head.entries.get("subnumber", "")
        present = len(_described_subs(context, entry))
        number = values.plain(given)
        if not given or is_compact(head) or number == present:
            continue
        if missing_subindex(entry, head, present) == 0:
            continue  # it counts sub-index 0; O008 reports that as missing
        text = f"[{head.name}] says SubNumber={short(given)}, but has {counted(present, 'sub-index', 'sub-indices')}"
        yield context.at(head, "subnumber", f"{text}{_gap(context, entry)}", entry.index)


def _gap(context: RuleContext, entry: Object) -> str:
    """Return a text with the missing sub-index, if SubNumber and sub-index 0 leave only one possibility."""
    absent = missing_subindex(entry, context.heads[entry.index], len(_described_subs(context, entry)))
    known = absent is not None and not is_pdo_communication(entry.index)
    return f"; sub-index {absent:X} seems to be missing" if known else ""


@finds("O024")
def no_sub_number(context: RuleContext) -> Iterator[Hit]:
    """O024."""
    for entry, head in _plain_records(context):
        if not head.entries.get("subnumber"):
            yield context.at(head, "", f"[{head.name}] has sub-indices, but no SubNumber", entry.index)


@finds("O008")
def no_sub_zero(context: RuleContext) -> Iterator[Hit]:
    """O008."""
    for entry, head in context.records:
        if 0 not in entry.subs and not context.modular:
            what = "no sub-index 0" if entry.subs else "no sub-indices"
            key = "objecttype" if _is_probably_var(entry, head) else ""
            yield context.at(
                head, key, f"[{head.name}] is {an(entry.object_type)}, but has {what}", entry.index
            )


def _is_probably_var(entry: Object, head: Section) -> bool:
    """Whether only the ObjectType is not that of a single value; then O008 reports it, and other rules of records are skipped."""
    return not entry.subs and "datatype" in head.entries and "subnumber" not in head.entries


@finds("O009")
def type_of_sub_zero(context: RuleContext) -> Iterator[Hit]:
    """O009."""
    for entry, _ in context.records:
        count = entry.subs.get(0)
        section = context.subs.get(entry.index, {}).get(0)
        if count is None or section is None or count.data_type is type_of_count(entry.index):
            continue
        if section.entries.get("datatype"):  # O002 reports a missing type
            wanted = type_of_count(entry.index).name
            text = f"[{section.name}] is {count.data_type.name}, a sub-index 0 is {wanted}"
            yield context.at(section, "datatype", text, entry.index, 0)


def type_of_count(index: int) -> DataType:
    """Return the data type of an object's sub-index 0."""
    return DataType.UNSIGNED32 if index == _PDOS_SUPPORTED else DataType.UNSIGNED8


@finds("O010")
def highest_sub_index(context: RuleContext) -> Iterator[Hit]:
    """O010."""
    for entry, _ in context.records:
        section = context.subs.get(entry.index, {}).get(0)
        count = count_of(entry)
        if section is None or count is None or _counts_itself(context, entry):
            continue
        highest = max(sub for sub in entry.subs if sub != STRUCTURE)
        described = len(_described_subs(context, entry))
        missing = count > highest and one_is_missing(context.heads[entry.index], described)  # O007 says so
        if count != highest and not missing:
            in_use = entry.subs[0].writable and count < highest
            text = f"[{section.name}] says {count}, but the highest sub-index is {highest}"
            severity = Severity.NOTE if in_use else None
            yield context.at(section, "defaultvalue", text, entry.index, 0, severity)


def _counts_itself(context: RuleContext, entry: Object) -> bool:
    """Whether sub-index 0 is the number of sub-indices in use, not the highest sub-index."""
    return entry.index in _COUNT_OF_ITS_OWN or is_pdo_mapping(entry.index) or context.modular


@finds("O025")
def no_highest(context: RuleContext) -> Iterator[Hit]:
    """O025."""
    for entry, _ in context.records:
        section = context.subs.get(entry.index, {}).get(0)
        if (
            section is not None
            and not section.entries.get("defaultvalue")
            and entry.index not in _COUNT_OF_ITS_OWN
        ):
            yield context.at(section, "defaultvalue", f"[{section.name}] has no DefaultValue", entry.index, 0)


@finds("O014")
def shared_sub_names(context: RuleContext) -> Iterator[Hit]:
    """O014."""
    for entry, _ in context.records:
        seen: dict[str, int] = {}
        for subindex in context.subs.get(entry.index, {}):
            name = entry.subs[subindex].name.lower()
            first = seen.setdefault(name, subindex)
            if first != subindex and name:
                section = context.subs[entry.index][subindex]
                text = f"[{section.name}] has the name of sub-index {first:X}: {short(entry.subs[subindex].name)!r}"
                yield context.at(section, "parametername", text, entry.index, subindex)
                break


@finds("O022")
def type_keys_on_record(context: RuleContext) -> Iterator[Hit]:
    """O022."""
    for entry, head in _plain_records(context):
        named = [name for name in _OF_TYPE if text_of(head, name)]
        if named:
            verb = "belongs" if len(named) == 1 else "belong"
            text = (
                f"[{head.name}] is {an(entry.object_type)}: {' and '.join(named)} {verb} to its sub-indices"
            )
            yield context.at(head, named[0], text, entry.index)


@finds("O023")
def data_keys_on_record(context: RuleContext) -> Iterator[Hit]:
    """O023."""
    for entry, head in _plain_records(context):
        for name in _ON_DATA:
            given = text_of(head, name)
            if given and not (name == "PDOMapping" and given == "0"):
                text = f"[{head.name}] is {an(entry.object_type)}: {name} belongs to its sub-indices"
                yield context.at(head, name, text, entry.index)


@finds("O026")
def different_types(context: RuleContext) -> Iterator[Hit]:
    """O026."""
    for entry, _ in context.records:
        if entry.object_type is not ObjectType.ARRAY:
            continue
        kinds: Counter[DataType] = Counter()
        first: dict[DataType, Variable] = {}
        for sub, many in compact.grouped(entry.subs):
            if sub.subindex not in (0, STRUCTURE) and sub.data_type:
                kinds[sub.data_type] += many
                first.setdefault(sub.data_type, sub)
        if len(kinds) < 2:
            continue
        usual = kinds.most_common(1)[0][0]
        different = min(
            (sub for kind, sub in first.items() if kind is not usual), key=lambda sub: sub.subindex
        )
        section = context.section_of(entry.index, different.subindex)
        if section is not None:
            text = f"[{section.name}] is {different.data_type.name}, other elements of the ARRAY are {usual.name}"
            yield context.at(section, "datatype", text, entry.index, different.subindex)


@finds("O030")
def type_of_sub(context: RuleContext) -> Iterator[Hit]:
    """O030."""
    for entry, _ in context.records:
        for subindex, section in context.subs.get(entry.index, {}).items():
            given = values.plain(section.entries.get("objecttype", ""))
            if given in (ObjectType.ARRAY, ObjectType.RECORD, ObjectType.DEFSTRUCT):
                text = f"[{section.name}] is a sub-index, and cannot be {an(ObjectType(given))}"
                yield context.at(section, "objecttype", text, entry.index, subindex)


def _plain_records(context: RuleContext) -> Iterator[tuple[Object, Section]]:
    for entry, head in context.records:
        if not is_compact(head) and not _is_probably_var(entry, head):
            yield entry, head


def _described_subs(context: RuleContext, entry: Object) -> list[int]:
    return [subindex for subindex in context.subs.get(entry.index, {}) if subindex != STRUCTURE]
