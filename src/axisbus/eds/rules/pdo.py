"""Rules for the contents of each default mapping of a PDO (CiA 301 7.5.2.36, 7.5.2.38)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.pdo import MAX_BITS, MappedObject
from axisbus.cia402.axes import first_axis
from axisbus.eds.io.text import Section
from axisbus.eds.model import RPDO_ACCESS, TPDO_ACCESS, Object, Severity, Variable
from axisbus.eds.rules import drive, standard
from axisbus.eds.rules.context import Hit, RuleContext, finds, number_of, start_value
from axisbus.wording import counted

# -- The default mappings of a file's PDOs, entry by entry -----------------------------------------------------------------

MAX_ENTRIES = 64
MULTIPLEXED = (0xFE, 0xFF)  # sub-index 0 of an MPDO, whose entries have another meaning (CiA 301 7.5.2.36)
NETWORK_VARIABLES = range(0xA000, 0xB000)  # made by the tool that configures the network (CiA 302-4)
DATA_TYPES = range(0x0001, 0x0020)


@dataclass(frozen=True, slots=True)
class MappingEntry:
    """One entry of a mapping: the mapped object, the entry of 16xxh or 1Axxh that maps it, and whether sub-index 0 counts it."""

    receive: bool
    holder: Variable
    mapped: MappedObject
    active: bool = True

    @property
    def name(self) -> str:
        """The section of the entry, for messages."""
        return f"{self.holder.index:04X}sub{self.holder.subindex:X}"


def maps(context: RuleContext) -> Iterator[tuple[bool, Object]]:
    """Yield each mapping parameter, with whether it belongs to an RPDO.

    A mapping that a DCF configures comes twice: as configured, and with the device's defaults.
    """
    for first, receive in ((o.RPDO_MAPPING, True), (o.TPDO_MAPPING, False)):
        for entry in _objects(context, first):
            yield receive, entry
            if any(sub.parameter_value is not None for sub in entry.subs.values()):
                subs = {key: replace(sub, parameter_value=None) for key, sub in entry.subs.items()}
                yield receive, replace(entry, subs=subs)


def communications(context: RuleContext) -> Iterator[tuple[bool, Object]]:
    """Yield each communication parameter, with whether it belongs to an RPDO."""
    for first, receive in ((o.RPDO_COMMUNICATION, True), (o.TPDO_COMMUNICATION, False)):
        for entry in _objects(context, first):
            yield receive, entry


def _objects(context: RuleContext, first: int) -> Iterator[Object]:
    yield from context.blocks.get(first // o.PDOS_OF_A_KIND, ())


def used(context: RuleContext, entry: Object) -> list[Variable]:
    """Return the entries of a mapping that its sub-index 0 counts; all that are not 0 if it gives no number."""
    count = number_of(entry.subs[0]) if 0 in entry.subs else None
    if count in MULTIPLEXED:
        return []
    there = [sub for subindex, sub in entry.subs.items() if 1 <= subindex <= MAX_ENTRIES]
    if count is None and 0 in entry.subs and not understood(context, entry.subs[0]):
        return []  # V001 and similar rules report it
    if count is None:
        return [sub for sub in there if number_of(sub)]
    return [sub for sub in there if sub.subindex <= count]


def unused(entry: Object) -> list[Variable]:
    """Return the entries of a mapping that its sub-index 0 does not count, if it is a number."""
    count = number_of(entry.subs[0]) if 0 in entry.subs else None
    if count is None or count in MULTIPLEXED:
        return []
    return [sub for subindex, sub in entry.subs.items() if count < subindex <= MAX_ENTRIES]


def slots(context: RuleContext) -> Iterator[MappingEntry]:
    """Yield each mapped object in use of each mapping."""
    for receive, entry in maps(context):
        yield from slots_of(context, receive, entry)


def all_slots(context: RuleContext) -> Iterator[MappingEntry]:
    """Yield each mapped object of each mapping, including entries that sub-index 0 does not count."""
    yield from slots(context)
    for receive, entry in maps(context):
        yield from filled(unused(entry), receive, active=False)


def slots_of(context: RuleContext, receive: bool, entry: Object) -> list[MappingEntry]:
    """Return the mapped objects in use of one mapping."""
    return list(filled(used(context, entry), receive))


def filled(holders: Iterable[Variable], receive: bool, active: bool = True) -> Iterator[MappingEntry]:
    for holder in holders:
        value = start_value(holder)
        if value is not None and value.value and not value.plus_node_id:
            mapped = MappedObject.from_entry(value.value & 0xFFFF_FFFF)
            yield MappingEntry(receive, holder, mapped, active)


def understood(context: RuleContext, entry: Variable) -> bool:
    """Whether the value after power-up is valid, or there is none; else the reader has reported it."""
    section = context.section_of(entry.index, entry.subindex)
    return section is None or not section.entries.get("defaultvalue") or entry.default is not None


# -- The rules -------------------------------------------------------------------------------------------------------------


@finds("P001")
def no_mapping(context: RuleContext) -> Iterator[Hit]:
    """P001."""
    for _, entry in communications(context):
        partner = entry.index + o.PDOS_OF_A_KIND
        if partner not in context.eds and not context.modular:
            text = f"[{entry.index:04X}] has no mapping parameter [{partner:04X}]"
            yield context.at(context.heads.get(entry.index), "", text, entry.index)


@finds("P007")
def no_communication(context: RuleContext) -> Iterator[Hit]:
    """P007."""
    for _, entry in maps(context):
        partner = entry.index - o.PDOS_OF_A_KIND
        if partner not in context.eds and not context.modular:
            text = f"[{entry.index:04X}] has no communication parameter [{partner:04X}]"
            yield context.at(context.heads.get(entry.index), "", text, entry.index)


@finds("P002")
def no_target(context: RuleContext) -> Iterator[Hit]:
    """P002."""
    for slot in all_slots(context):
        index, subindex, _ = slot.mapped
        if index in DATA_TYPES or context.modular or index in NETWORK_VARIABLES:
            continue
        if context.eds.get(index, subindex) is None and not _misshapen(context, index, subindex):
            yield _on(context, slot, f"maps {index:04X}:{subindex:02X}, which the file does not describe")
    yield from _formulas(context)


def _formulas(context: RuleContext) -> Iterator[Hit]:
    """Yield a hit for each mapping entry that is a formula."""
    for _, entry in maps(context):
        for holder in used(context, entry):
            value = start_value(holder)
            if value is not None and value.plus_node_id:
                name = f"{holder.index:04X}sub{holder.subindex:X}"
                yield context.at_value(holder, f"[{name}] depends on the node ID, and maps no object")


@finds("P017")
def repeated(context: RuleContext) -> Iterator[Hit]:
    """P017."""
    for receive, entry in maps(context):
        seen: dict[tuple[int, int], MappingEntry] = {}
        for slot in slots_of(context, receive, entry):
            target = slot.mapped.index, slot.mapped.subindex
            first = seen.setdefault(target, slot)
            if first is not slot and slot.mapped.index not in DATA_TYPES:
                yield _on(
                    context, slot, f"maps {target[0]:04X}:{target[1]:02X} again, as [{first.name}] does"
                )


def _misshapen(context: RuleContext, index: int, subindex: int) -> bool:
    """Whether the entry has a section that is hidden by a wrong ObjectType (O008, O011)."""
    entry, head = context.eds.objects.get(index), context.heads.get(index)
    if entry is None or head is None:
        return False
    if entry.is_record:
        return subindex == 0 and not entry.subs and "datatype" in head.entries
    return subindex in context.subs.get(index, {})


@finds("P003")
def wrong_size(context: RuleContext) -> Iterator[Hit]:
    """P003."""
    for slot in all_slots(context):
        target = _target(context, slot)
        bits = _bits(slot.mapped) if target is None else target.bits
        if bits is None or bits == slot.mapped.bits or _right_by_standard(context, target, slot.mapped):
            continue
        kind = f" ({target.data_type.name})" if target is not None else ""
        whole = f"{slot.mapped.index:04X}:{slot.mapped.subindex:02X}, which has {bits}{kind}"
        text = f"maps {counted(slot.mapped.bits, 'bit')} of {whole}"
        yield _on(context, slot, text)


def _bits(mapped: MappedObject) -> int | None:
    """Return the size of a dummy entry in bits, None if the entry is no dummy."""
    return DataType(mapped.index).bits if mapped.is_dummy else None


def _right_by_standard(context: RuleContext, target: Variable | None, mapped: MappedObject) -> bool:
    """Whether the mapping matches the standard: then the object's type is wrong, and C003 or M002 reports it."""
    if target is None:
        return False
    row = drive.row(context, target.index, target.subindex)
    return row is not None and any(kind.bits == mapped.bits for kind in row.data_types)


@finds("P004")
def not_mappable(context: RuleContext) -> Iterator[Hit]:
    """P004."""
    at_fault: dict[Section, list[MappingEntry]] = {}  # sections of objects
    for slot in all_slots(context):
        target = _target(context, slot)
        if target is None or target.pdo_mapping:
            continue
        section = context.section_of(target.index, target.subindex)
        missing = section is not None and "pdomapping" not in section.entries
        if section is not None and slot.active and (missing or is_cyclic(context, target)):
            at_fault.setdefault(section, []).append(slot)
        else:
            yield _on(context, slot, f"maps {_name(target)}, whose PDOMapping is 0")
    for section, mapping in at_fault.items():
        yield _at_object(context, section, mapping)


def _at_object(context: RuleContext, section: Section, mapping: list[MappingEntry]) -> Hit:
    given = section.entries.get("pdomapping")
    says = "no PDOMapping, which means 0" if given is None else f"PDOMapping={given}"
    more = f", and {counted(len(mapping) - 1, 'more entry', 'more entries')}" if len(mapping) > 1 else ""
    index, subindex, _ = mapping[0].mapped
    text = f"[{section.name}] has {says}, but it is mapped by [{mapping[0].name}]{more}"
    return context.at(section, "" if given is None else "pdomapping", text, index, subindex)


def is_cyclic(context: RuleContext, target: Variable) -> bool:
    """Whether the object is mappable in every drive: then its PDOMapping is wrong, not the mapping."""
    known = drive.row(context, target.index, target.subindex) is not None
    return known and target.subindex == 0 and first_axis(target.index) in standard.CYCLIC


@finds("P005")
def wrong_direction(context: RuleContext) -> Iterator[Hit]:
    """P005."""
    for slot in all_slots(context):
        target = _target(context, slot)
        allowed = RPDO_ACCESS if slot.receive else TPDO_ACCESS
        if target is None or target.access in allowed or _access_is_the_fault(context, target, allowed):
            continue
        kind = "an RPDO writes" if slot.receive else "a TPDO reads"
        yield _on(context, slot, f"maps {_name(target)}, which is {target.access}; {kind} it")


def _access_is_the_fault(context: RuleContext, target: Variable, allowed: frozenset[str]) -> bool:
    """Whether the standard allows this direction: then the object's access is wrong, and C004 or M004 reports it."""
    row = drive.row(context, target.index, target.subindex)
    return (
        row is not None and bool(row.access & allowed) and not standard.access_fits(target.access, row.access)
    )


@finds("P006")
def too_long(context: RuleContext) -> Iterator[Hit]:
    """P006."""
    for receive, entry in maps(context):
        every = slots_of(context, receive, entry)
        if sum(_right_bits(context, slot) for slot in every) <= MAX_BITS:
            continue  # not too long with the right sizes; P003 reports wrong sizes
        total, whole = 0, sum(slot.mapped.bits for slot in every)
        for slot in every:
            before, total = total, total + slot.mapped.bits
            if before <= MAX_BITS < total:
                text = f"crosses {MAX_BITS} bits; the mapping [{entry.index:04X}] has {whole}"
                yield _on(context, slot, text)


def _right_bits(context: RuleContext, slot: MappingEntry) -> int:
    """Return the bits of an entry: by its target's type if P003 reports the entry, else as mapped."""
    target = _target(context, slot)
    bits = slot.mapped.bits if target is None or target.bits is None else target.bits
    return slot.mapped.bits if _right_by_standard(context, target, slot.mapped) else bits


@finds("P008")
def count_beyond(context: RuleContext) -> Iterator[Hit]:
    """P008."""
    for _, entry in maps(context):
        count = entry.subs.get(0)
        number = number_of(count) if count is not None else None
        if count is None or number is None or number in MULTIPLEXED or context.modular:
            continue
        highest = max((sub for sub in entry.subs if 1 <= sub <= MAX_ENTRIES), default=0)
        if number > highest:
            mapped = counted(number, "object is mapped", "objects are mapped")
            text = (
                f"[{entry.index:04X}sub0] says that {mapped}, but has {counted(highest, 'entry', 'entries')}"
            )
            yield context.at_value(count, text)


@finds("P015")
def empty_entries(context: RuleContext) -> Iterator[Hit]:
    """P015."""
    for _, entry in maps(context):
        empty = [holder for holder in used(context, entry) if number_of(holder) == 0]
        if empty:
            holder = empty[0]
            more = f", and {len(empty) - 1} more of them" if len(empty) > 1 else ""
            text = f"[{holder.index:04X}sub{holder.subindex:X}] maps nothing, but sub-index 0 counts it{more}"
            yield context.at_value(holder, text)


@finds("P016")
def carries_nothing(context: RuleContext) -> Iterator[Hit]:
    """P016."""
    for receive, entry in maps(context):
        count = entry.subs.get(0)
        waiting = list(filled(unused(entry), receive))
        if count is None or number_of(count) != 0 or not waiting:
            continue
        what = counted(len(waiting), "entry is", "entries are")
        text = f"[{entry.index:04X}sub0] is 0: the PDO carries nothing, though {what} filled"
        severity = None if _is_on(context, entry.index) else Severity.NOTE
        yield context.at_value(count, text, severity)


def _is_on(context: RuleContext, mapping: int) -> bool:
    """Whether the PDO of a mapping is enabled after power-up."""
    identifier = context.number(mapping - o.PDOS_OF_A_KIND, 1)
    return identifier is not None and not identifier & cob.INVALID


@finds("P010")
def dummies(context: RuleContext) -> Iterator[Hit]:
    """P010."""
    for slot in all_slots(context):
        index = slot.mapped.index
        if index in DATA_TYPES and index not in context.eds.dummies:
            yield _on(context, slot, f"maps the dummy {index:04X}, which [DummyUsage] does not allow")


def _target(context: RuleContext, slot: MappingEntry) -> Variable | None:
    return (
        None if slot.mapped.index in DATA_TYPES else context.eds.get(slot.mapped.index, slot.mapped.subindex)
    )


def _name(target: Variable) -> str:
    return f"{target.index:04X}:{target.subindex:02X} ({target.name})"


def _on(context: RuleContext, slot: MappingEntry, message: str) -> Hit:
    text = f"[{slot.name}] {message}" if slot.active else f"[{slot.name}], not active, {message}"
    return context.at_value(slot.holder, text, None if slot.active else Severity.NOTE)
