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


def one_is_missing(head: Section, there: int) -> bool:
    """Whether SubNumber counts one sub-index more than the ``there`` that have a section."""
    return values.plain(head.entries.get("subnumber", "")) == there + 1


def missing_subindex(entry: Object, head: Section, there: int) -> int | None:
    """Return the sub-index whose section is missing; None unless SubNumber and sub-index 0 leave only one possibility.

    ``there`` is the number of sub-indices that have a section.
    """
    if not one_is_missing(head, there):
        return None
    if 0 not in entry.subs:
        return 0
    highest = min(count_of(entry) or 0, MAX_ENTRIES)  # the file may contain any number
    absent = [sub for sub in range(1, highest + 1) if sub not in entry.subs]
    return absent[0] if len(absent) == 1 else None


# -- The rules -------------------------------------------------------------------------------------------------------------

_ERROR_FIELD = 0x1003
_PDOS_SUPPORTED = (
    0x1004  # of DS 301 V3: all its sub-indices are UNSIGNED32, even 0, the number of synchronous PDOs
)
_OWN_COUNT = (_ERROR_FIELD, _PDOS_SUPPORTED)  # their sub-index 0 is not the highest sub-index
# Keys that belong to the sub-indices of an object, not to the object.
_ON_DATA = ("DefaultValue", "ParameterValue", "LowLimit", "HighLimit", "PDOMapping")
_OF_TYPE = ("DataType", "AccessType")


@finds("O007")
def sub_number(sheet: RuleContext) -> Iterator[Hit]:
    """O007."""
    for entry, head in sheet.records:
        given = head.entries.get("subnumber", "")
        there = len(_own_subs(sheet, entry))
        number = values.plain(given)
        if not given or is_compact(head) or number == there:
            continue
        if missing_subindex(entry, head, there) == 0:
            continue  # it counts sub-index 0; O008 reports that as missing
        text = f"[{head.name}] says SubNumber={short(given)}, but has {counted(there, 'sub-index', 'sub-indices')}"
        yield sheet.at(head, "subnumber", f"{text}{_gap(sheet, entry)}", entry.index)


def _gap(sheet: RuleContext, entry: Object) -> str:
    """Return a text with the missing sub-index, if SubNumber and sub-index 0 leave only one possibility."""
    absent = missing_subindex(entry, sheet.heads[entry.index], len(_own_subs(sheet, entry)))
    known = absent is not None and not is_pdo_communication(entry.index)
    return f"; sub-index {absent:X} seems to be missing" if known else ""


@finds("O024")
def no_sub_number(sheet: RuleContext) -> Iterator[Hit]:
    """O024."""
    for entry, head in _plain_records(sheet):
        if not head.entries.get("subnumber"):
            yield sheet.at(head, "", f"[{head.name}] has sub-indices, but no SubNumber", entry.index)


@finds("O008")
def no_sub_zero(sheet: RuleContext) -> Iterator[Hit]:
    """O008."""
    for entry, head in sheet.records:
        if 0 not in entry.subs and not sheet.modular:
            what = "no sub-index 0" if entry.subs else "no sub-indices"
            key = "objecttype" if _seems_a_var(entry, head) else ""
            yield sheet.at(
                head, key, f"[{head.name}] is {an(entry.object_type)}, but has {what}", entry.index
            )


def _seems_a_var(entry: Object, head: Section) -> bool:
    """Whether only the ObjectType is not that of a single value; then O008 reports it, and other rules of records are skipped."""
    return not entry.subs and "datatype" in head.entries and "subnumber" not in head.entries


@finds("O009")
def type_of_sub_zero(sheet: RuleContext) -> Iterator[Hit]:
    """O009."""
    for entry, _ in sheet.records:
        count = entry.subs.get(0)
        section = sheet.subs.get(entry.index, {}).get(0)
        if count is None or section is None or count.data_type is type_of_count(entry.index):
            continue
        if section.entries.get("datatype"):  # O002 reports a missing type
            wanted = type_of_count(entry.index).name
            text = f"[{section.name}] is {count.data_type.name}, a sub-index 0 is {wanted}"
            yield sheet.at(section, "datatype", text, entry.index, 0)


def type_of_count(index: int) -> DataType:
    """Return the data type of an object's sub-index 0."""
    return DataType.UNSIGNED32 if index == _PDOS_SUPPORTED else DataType.UNSIGNED8


@finds("O010")
def highest_sub_index(sheet: RuleContext) -> Iterator[Hit]:
    """O010."""
    for entry, _ in sheet.records:
        section = sheet.subs.get(entry.index, {}).get(0)
        count = count_of(entry)
        if section is None or count is None or _counts_itself(sheet, entry):
            continue
        highest = max(sub for sub in entry.subs if sub != STRUCTURE)
        own = len(_own_subs(sheet, entry))
        missing = count > highest and one_is_missing(sheet.heads[entry.index], own)  # O007 says so
        if count != highest and not missing:
            in_use = entry.subs[0].writable and count < highest
            text = f"[{section.name}] says {count}, but the highest sub-index is {highest}"
            severity = Severity.NOTE if in_use else None
            yield sheet.at(section, "defaultvalue", text, entry.index, 0, severity)


def _counts_itself(sheet: RuleContext, entry: Object) -> bool:
    """Whether sub-index 0 is the number of sub-indices in use, not the highest sub-index."""
    return entry.index in _OWN_COUNT or is_pdo_mapping(entry.index) or sheet.modular


@finds("O025")
def no_highest(sheet: RuleContext) -> Iterator[Hit]:
    """O025."""
    for entry, _ in sheet.records:
        section = sheet.subs.get(entry.index, {}).get(0)
        if section is not None and not section.entries.get("defaultvalue") and entry.index not in _OWN_COUNT:
            yield sheet.at(section, "defaultvalue", f"[{section.name}] has no DefaultValue", entry.index, 0)


@finds("O014")
def shared_sub_names(sheet: RuleContext) -> Iterator[Hit]:
    """O014."""
    for entry, _ in sheet.records:
        seen: dict[str, int] = {}
        for subindex in sheet.subs.get(entry.index, {}):
            name = entry.subs[subindex].name.lower()
            first = seen.setdefault(name, subindex)
            if first != subindex and name:
                section = sheet.subs[entry.index][subindex]
                text = f"[{section.name}] has the name of sub-index {first:X}: {short(entry.subs[subindex].name)!r}"
                yield sheet.at(section, "parametername", text, entry.index, subindex)
                break


@finds("O022")
def type_keys_on_record(sheet: RuleContext) -> Iterator[Hit]:
    """O022."""
    for entry, head in _plain_records(sheet):
        named = [name for name in _OF_TYPE if text_of(head, name)]
        if named:
            verb = "belongs" if len(named) == 1 else "belong"
            text = (
                f"[{head.name}] is {an(entry.object_type)}: {' and '.join(named)} {verb} to its sub-indices"
            )
            yield sheet.at(head, named[0], text, entry.index)


@finds("O023")
def data_keys_on_record(sheet: RuleContext) -> Iterator[Hit]:
    """O023."""
    for entry, head in _plain_records(sheet):
        for name in _ON_DATA:
            given = text_of(head, name)
            if given and not (name == "PDOMapping" and given == "0"):
                text = f"[{head.name}] is {an(entry.object_type)}: {name} belongs to its sub-indices"
                yield sheet.at(head, name, text, entry.index)


@finds("O026")
def different_types(sheet: RuleContext) -> Iterator[Hit]:
    """O026."""
    for entry, _ in sheet.records:
        if entry.object_type is not ObjectType.ARRAY:
            continue
        kinds: Counter[DataType] = Counter()
        first: dict[DataType, Variable] = {}
        for sub, many in compact.alike(entry.subs):
            if sub.subindex not in (0, STRUCTURE) and sub.data_type:
                kinds[sub.data_type] += many
                first.setdefault(sub.data_type, sub)
        if len(kinds) < 2:
            continue
        usual = kinds.most_common(1)[0][0]
        odd = min((sub for kind, sub in first.items() if kind is not usual), key=lambda sub: sub.subindex)
        section = sheet.section_of(entry.index, odd.subindex)
        if section is not None:
            text = f"[{section.name}] is {odd.data_type.name}, other elements of the ARRAY are {usual.name}"
            yield sheet.at(section, "datatype", text, entry.index, odd.subindex)


@finds("O030")
def type_of_sub(sheet: RuleContext) -> Iterator[Hit]:
    """O030."""
    for entry, _ in sheet.records:
        for subindex, section in sheet.subs.get(entry.index, {}).items():
            given = values.plain(section.entries.get("objecttype", ""))
            if given in (ObjectType.ARRAY, ObjectType.RECORD, ObjectType.DEFSTRUCT):
                text = f"[{section.name}] is a sub-index, and cannot be {an(ObjectType(given))}"
                yield sheet.at(section, "objecttype", text, entry.index, subindex)


def _plain_records(sheet: RuleContext) -> Iterator[tuple[Object, Section]]:
    for entry, head in sheet.records:
        if not is_compact(head) and not _seems_a_var(entry, head):
            yield entry, head


def _own_subs(sheet: RuleContext, entry: Object) -> list[int]:
    return [subindex for subindex in sheet.subs.get(entry.index, {}) if subindex != STRUCTURE]
