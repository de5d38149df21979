"""Rules over PDOs: their parameters, and what each default mapping holds (CiA 301 7.5.2.35 to 7.5.2.38)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.pdo import MAX_BITS, MappedObject
from axisbus.eds.model import Number, Object, Variable
from axisbus.eds.rules import standard
from axisbus.eds.rules.sheet import Hit, Looks, Sheet, number_of, start_key, start_value

PDOS_OF_A_KIND = 0x200
MAX_ENTRIES = 64
_MULTIPLEXED = (0xFE, 0xFF)  # sub-index 0 of an MPDO, whose entries mean something else (CiA 301 7.5.2.36)
_NETWORK_VARIABLES = range(0xA000, 0xB000)  # made by the tool that configures the network (CiA 302-4)
_DATA_TYPES = range(0x0001, 0x0020)

_PARAMETERS = {
    1: DataType.UNSIGNED32,
    2: DataType.UNSIGNED8,
    3: DataType.UNSIGNED16,
    4: DataType.UNSIGNED8,
    5: DataType.UNSIGNED16,
    6: DataType.UNSIGNED8,
}
_NEEDED = {1: "the COB-ID", 2: "the transmission type"}
_RESERVED_TYPES = {
    True: range(241, 254),
    False: range(241, 252),
}  # by direction: receive, transmit (tables 69, 72)
_TO_RPDO = frozenset(("rw", "wo", "rww"))
_TO_TPDO = frozenset(("ro", "rw", "rwr", "const"))


@dataclass(frozen=True, slots=True)
class Slot:
    """One entry of a mapping that is in use: what it maps, and the entry of 16xxh or 1Axxh that says so."""

    receive: bool
    holder: Variable
    mapped: MappedObject

    @property
    def name(self) -> str:
        """The section of the entry, as a person writes it."""
        return f"{self.holder.index:04X}sub{self.holder.subindex:X}"


def maps(sheet: Sheet) -> Iterator[tuple[bool, Object]]:
    """Yield every mapping parameter, with whether it is of an RPDO.

    One that a DCF configures comes twice: as it is configured, and as the device has it by default.
    """
    for first, receive in ((o.RPDO_MAPPING, True), (o.TPDO_MAPPING, False)):
        for entry in _objects(sheet, first):
            yield receive, entry
            if any(sub.parameter_value is not None for sub in entry.subs.values()):
                subs = {key: replace(sub, parameter_value=None) for key, sub in entry.subs.items()}
                yield receive, replace(entry, subs=subs)


def communications(sheet: Sheet) -> Iterator[tuple[bool, Object]]:
    """Yield every communication parameter, with whether it is of an RPDO."""
    for first, receive in ((o.RPDO_COMMUNICATION, True), (o.TPDO_COMMUNICATION, False)):
        for entry in _objects(sheet, first):
            yield receive, entry


def _objects(sheet: Sheet, first: int) -> Iterator[Object]:
    for index, entry in sheet.eds.objects.items():
        if first <= index < first + PDOS_OF_A_KIND:
            yield entry


def used(sheet: Sheet, entry: Object) -> list[Variable]:
    """Return the entries of a mapping that its sub-index 0 puts in use; all that are not 0 where it gives no number."""
    count = number_of(entry.subs[0]) if 0 in entry.subs else None
    if count in _MULTIPLEXED:
        return []
    there = [sub for subindex, sub in entry.subs.items() if 1 <= subindex <= MAX_ENTRIES]
    if count is None and 0 in entry.subs and not understood(sheet, entry.subs[0]):
        return []  # V001 and its kin speak of it
    if count is None:
        return [sub for sub in there if number_of(sub)]
    return [sub for sub in there if sub.subindex <= count]


def slots(sheet: Sheet) -> Iterator[Slot]:
    """Yield every entry in use of every mapping that maps something."""
    for receive, entry in maps(sheet):
        yield from slots_of(sheet, receive, entry)


def no_mapping(sheet: Sheet) -> Iterator[Hit]:
    """P001."""
    for _, entry in communications(sheet):
        partner = entry.index + PDOS_OF_A_KIND
        if partner not in sheet.eds and not sheet.modular:
            text = f"[{entry.index:04X}] has no mapping parameter [{partner:04X}]"
            yield sheet.at(sheet.heads.get(entry.index), "", text, entry.index)


def no_communication(sheet: Sheet) -> Iterator[Hit]:
    """P007."""
    for _, entry in maps(sheet):
        partner = entry.index - PDOS_OF_A_KIND
        if partner not in sheet.eds and not sheet.modular:
            text = f"[{entry.index:04X}] has no communication parameter [{partner:04X}]"
            yield sheet.at(sheet.heads.get(entry.index), "", text, entry.index)


def no_target(sheet: Sheet) -> Iterator[Hit]:
    """P002."""
    for slot in slots(sheet):
        index, subindex, _ = slot.mapped
        if index in _DATA_TYPES or sheet.modular or index in _NETWORK_VARIABLES:
            continue
        if sheet.eds.get(index, subindex) is None and not _misshapen(sheet, index, subindex):
            yield _on(sheet, slot, f"maps {index:04X}:{subindex:02X}, which the file does not describe")


def _misshapen(sheet: Sheet, index: int, subindex: int) -> bool:
    """Whether the entry has a section, which a wrong ObjectType hides (O008, O011)."""
    entry, head = sheet.eds.objects.get(index), sheet.heads.get(index)
    if entry is None or head is None:
        return False
    if entry.is_record:
        return subindex == 0 and not entry.subs and "datatype" in head.entries
    return subindex in sheet.subs.get(index, {})


def wrong_size(sheet: Sheet) -> Iterator[Hit]:
    """P003."""
    for slot in slots(sheet):
        target = _target(sheet, slot)
        bits = _bits(slot.mapped) if target is None else target.bits
        if bits is None or bits == slot.mapped.bits or _right_by_standard(target, slot.mapped):
            continue
        kind = f" ({target.data_type.name})" if target is not None else ""
        text = f"maps {slot.mapped.bits} bits of {slot.mapped.index:04X}:{slot.mapped.subindex:02X}, which has {bits}{kind}"
        yield _on(sheet, slot, text)


def _bits(mapped: MappedObject) -> int | None:
    """Return the size of a dummy entry, None for what is none."""
    return DataType(mapped.index).bits if mapped.is_dummy else None


def _right_by_standard(target: Variable | None, mapped: MappedObject) -> bool:
    """Whether the mapping is as the standard has it: then the object's type is wrong, and C003 or M002 says so."""
    if target is None:
        return False
    row = standard.row(target.index, target.subindex)
    return row is not None and any(kind.bits == mapped.bits for kind in row.data_types)


def not_mappable(sheet: Sheet) -> Iterator[Hit]:
    """P004."""
    for slot in slots(sheet):
        target = _target(sheet, slot)
        if target is None or target.pdo_mapping or _mapping_is_the_fault(target):
            continue
        section = sheet.section_of(target.index, target.subindex)
        if section is not None and "pdomapping" not in section.entries:
            text = f"[{section.name}] has no PDOMapping, which means 0, but [{slot.name}] maps it"
            yield sheet.at(section, "", text, target.index, target.subindex)
        else:
            yield _on(sheet, slot, f"maps {_name(target)}, whose PDOMapping is 0")


def _mapping_is_the_fault(target: Variable) -> bool:
    """Whether the standard lets the object be mapped: then its PDOMapping is wrong, and M005 says so."""
    return target.subindex == 0 and standard.first_axis(target.index) in standard.CYCLIC


def wrong_direction(sheet: Sheet) -> Iterator[Hit]:
    """P005."""
    for slot in slots(sheet):
        target = _target(sheet, slot)
        allowed = _TO_RPDO if slot.receive else _TO_TPDO
        if target is None or target.access in allowed or _access_is_the_fault(target, allowed):
            continue
        kind = "an RPDO writes" if slot.receive else "a TPDO reads"
        yield _on(sheet, slot, f"maps {_name(target)}, which is {target.access}; {kind} it")


def _access_is_the_fault(target: Variable, allowed: frozenset[str]) -> bool:
    """Whether the standard allows this direction: then the object's access is wrong, and C004 or M004 says so."""
    row = standard.row(target.index, target.subindex)
    return (
        row is not None and bool(row.access & allowed) and not standard.access_fits(target.access, row.access)
    )


def too_long(sheet: Sheet) -> Iterator[Hit]:
    """P006."""
    for receive, entry in maps(sheet):
        every = slots_of(sheet, receive, entry)
        if sum(_right_bits(sheet, slot) for slot in every) <= MAX_BITS:
            continue  # else too long only by a wrong size, of which P003 speaks
        total, whole = 0, sum(slot.mapped.bits for slot in every)
        for slot in every:
            before, total = total, total + slot.mapped.bits
            if before <= MAX_BITS < total:
                text = f"crosses {MAX_BITS} bits; the mapping [{entry.index:04X}] has {whole}"
                yield _on(sheet, slot, text)


def _right_bits(sheet: Sheet, slot: Slot) -> int:
    """Return the bits that an entry would take by its target's type where P003 finds fault with it, else those that it takes."""
    target = _target(sheet, slot)
    bits = slot.mapped.bits if target is None or target.bits is None else target.bits
    return slot.mapped.bits if _right_by_standard(target, slot.mapped) else bits


def slots_of(sheet: Sheet, receive: bool, entry: Object) -> list[Slot]:
    """Return the entries in use of one mapping that map something."""
    found = []
    for holder in used(sheet, entry):
        value = start_value(holder)
        if value is not None and value.value and not value.plus_node_id:
            found.append(Slot(receive, holder, MappedObject.from_entry(value.value & 0xFFFF_FFFF)))
    return found


def count_beyond(sheet: Sheet) -> Iterator[Hit]:
    """P008."""
    for _, entry in maps(sheet):
        count = entry.subs.get(0)
        number = number_of(count) if count is not None else None
        if count is None or number is None or number in _MULTIPLEXED or sheet.modular:
            continue
        highest = max((sub for sub in entry.subs if 1 <= sub <= MAX_ENTRIES), default=0)
        if number > highest:
            text = f"[{entry.index:04X}sub0] says that {number} objects are mapped, but has {highest} entries"
            yield sheet.at(sheet.section_of(entry.index, 0), start_key(count), text, entry.index, 0)


def empty_entries(sheet: Sheet) -> Iterator[Hit]:
    """P015."""
    for _, entry in maps(sheet):
        empty = [holder for holder in used(sheet, entry) if number_of(holder) == 0]
        if empty:
            holder = empty[0]
            more = f", and {len(empty) - 1} more of them" if len(empty) > 1 else ""
            text = f"[{holder.index:04X}sub{holder.subindex:X}] maps nothing, but sub-index 0 counts it{more}"
            section = sheet.section_of(holder.index, holder.subindex)
            yield sheet.at(section, start_key(holder), text, holder.index, holder.subindex)


def parameter_types(sheet: Sheet) -> Iterator[Hit]:
    """P009."""
    for _, entry in communications(sheet):
        for subindex, kind in _PARAMETERS.items():
            sub = entry.subs.get(subindex)
            if sub is not None:
                yield from _type(sheet, sub, kind)
    for _, entry in maps(sheet):
        for subindex, sub in entry.subs.items():
            if 1 <= subindex <= MAX_ENTRIES:
                yield from _type(sheet, sub, DataType.UNSIGNED32)


def standard_type(index: int, subindex: int) -> DataType:
    """Return the data type that CiA 301 gives a sub-index (not 0) of a communication or mapping parameter."""
    mapping = any(first <= index < first + PDOS_OF_A_KIND for first in (o.RPDO_MAPPING, o.TPDO_MAPPING))
    return DataType.UNSIGNED32 if mapping else _PARAMETERS.get(subindex, DataType.UNSIGNED8)


def _type(sheet: Sheet, sub: Variable, kind: DataType) -> Iterator[Hit]:
    if sub.data_type is not kind and sub.data_type:
        section = sheet.section_of(sub.index, sub.subindex)
        text = f"[{sub.index:04X}sub{sub.subindex:X}] is {sub.data_type.name}, CiA 301 has {kind.name}"
        yield sheet.at(section, "datatype", text, sub.index, sub.subindex)


def dummies(sheet: Sheet) -> Iterator[Hit]:
    """P010."""
    for slot in slots(sheet):
        index = slot.mapped.index
        if index in _DATA_TYPES and index not in sheet.eds.dummies:
            yield _on(sheet, slot, f"maps the dummy {index:04X}, which [DummyUsage] does not allow")


def missing_parameters(sheet: Sheet) -> Iterator[Hit]:
    """P011."""
    for _, entry in communications(sheet):
        head = sheet.heads.get(entry.index)
        for subindex, what in _NEEDED.items():
            if subindex not in entry.subs and entry.subs and head is not None:
                text = f"[{entry.index:04X}] has no sub-index {subindex}, {what}"
                yield sheet.at(head, "", text, entry.index, subindex)


def reserved_types(sheet: Sheet) -> Iterator[Hit]:
    """P012."""
    for receive, entry in communications(sheet):
        sub = entry.subs.get(2)
        kind = number_of(sub) if sub is not None else None
        if sub is not None and kind in _RESERVED_TYPES[receive]:
            section = sheet.section_of(entry.index, 2)
            text = f"[{entry.index:04X}sub2] has transmission type {kind}, which is reserved"
            yield sheet.at(section, start_key(sub), text, entry.index, 2)


def restricted_ids(sheet: Sheet) -> Iterator[Hit]:
    """P013."""
    for _, sub, value in _valid_cob_ids(sheet):
        bad = next((identifier for identifier in _identifiers(value) if _is_restricted(identifier)), None)
        if bad is not None:
            name = f"[{sub.index:04X}sub1]"
            text = f"{name} gives the COB-ID 0x{bad:X}, which CiA 301 keeps for another service"
            yield sheet.at(sheet.section_of(sub.index, 1), start_key(sub), text, sub.index, 1)


def shared_ids(sheet: Sheet) -> Iterator[Hit]:
    """P014."""
    seen: dict[tuple[int, bool], int] = {}
    for _, sub, value in _valid_cob_ids(sheet):
        key = value.value & cob.ID_MASK_29, value.plus_node_id
        first = seen.setdefault(key, sub.index)
        if first != sub.index:
            text = f"[{sub.index:04X}sub1] has the COB-ID of [{first:04X}sub1]"
            yield sheet.at(sheet.section_of(sub.index, 1), start_key(sub), text, sub.index, 1)


def _valid_cob_ids(sheet: Sheet) -> Iterator[tuple[bool, Variable, Number]]:
    """Yield the identifiers of the PDOs that exist after power-up, with whether it is an RPDO."""
    for receive, entry in communications(sheet):
        sub = entry.subs.get(1)
        value = start_value(sub) if sub is not None else None
        if (
            sub is not None
            and value is not None
            and not value.value & cob.INVALID
            and value.value & cob.ID_MASK_29
        ):
            yield receive, sub, value


def _identifiers(value: Number) -> tuple[int, ...]:
    base = value.value & cob.ID_MASK_29
    return (base + 1, base + 127) if value.plus_node_id else (base,)


# Identifiers that no PDO may have (CiA 301 table 41).
_RESTRICTED = (
    range(0x080),
    range(0x101, 0x181),
    range(0x581, 0x600),
    range(0x601, 0x680),
    range(0x6E0, 0x700),
    range(0x701, 0x800),
)


@lru_cache(maxsize=256)
def _is_restricted(identifier: int) -> bool:
    return any(identifier in block for block in _RESTRICTED)


def understood(sheet: Sheet, entry: Variable) -> bool:
    """Whether the value after power-up is one, or there is none; else the reading has reported what is written there."""
    section = sheet.section_of(entry.index, entry.subindex)
    return section is None or not section.entries.get("defaultvalue") or entry.default is not None


def _target(sheet: Sheet, slot: Slot) -> Variable | None:
    return (
        None if slot.mapped.index in _DATA_TYPES else sheet.eds.get(slot.mapped.index, slot.mapped.subindex)
    )


def _name(target: Variable) -> str:
    return f"{target.index:04X}:{target.subindex:02X} ({target.name})"


def _on(sheet: Sheet, slot: Slot, message: str) -> Hit:
    holder = slot.holder
    section = sheet.section_of(holder.index, holder.subindex)
    text = f"[{slot.name}] {message}"
    return sheet.at(section, start_key(holder), text, holder.index, holder.subindex)


LOOKS: Looks = {
    "P001": no_mapping,
    "P002": no_target,
    "P003": wrong_size,
    "P004": not_mappable,
    "P005": wrong_direction,
    "P006": too_long,
    "P007": no_communication,
    "P008": count_beyond,
    "P009": parameter_types,
    "P010": dummies,
    "P011": missing_parameters,
    "P012": reserved_types,
    "P013": restricted_ids,
    "P014": shared_ids,
    "P015": empty_entries,
}
