"""The PDOs of an EDS: the position of each mapped object in its frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from axisbus.cia301 import cob, objects
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.pdo import MAX_BITS, MappedObject, PdoConfiguration, dummy_type
from axisbus.eds.dictionary import merged_type, standard
from axisbus.eds.model import Eds, Number, Variable
from axisbus.wording import counted

_MULTIPLEXED = {0xFE: "SAM-MPDO", 0xFF: "DAM-MPDO"}  # sub-index 0 of a multiplexed PDO (CiA 301 7.5.2.36)


@dataclass(frozen=True, slots=True)
class PdoSlot:
    """One mapped object: ``first_bit`` counts from 0, the least significant of byte 0; ``data_type`` is None if unknown.

    ``variable`` is None for a dummy, and for an object that the file does not describe; ``record`` says whether the object has
    sub-indices.
    """

    mapped: MappedObject
    first_bit: int
    name: str
    data_type: DataType | None
    variable: Variable | None
    record: bool = False

    @property
    def bits(self) -> int:
        """The number of bits of the object."""
        return self.mapped.bits

    @property
    def end(self) -> int:
        """The first bit after the object."""
        return self.first_bit + self.mapped.bits

    @property
    def address(self) -> str:
        """Index, and sub-index if the object has sub-indices: ``6041``, ``60C1:01``; for a dummy, the name of its type."""
        if self.mapped.is_dummy:
            return DataType(self.mapped.index).name
        sub = f":{self.mapped.subindex:02X}" if self.record or self.mapped.subindex else ""
        return f"{self.mapped.index:04X}{sub}"

    @property
    def signed(self) -> bool:
        """Whether the value is in two's complement: by the standard if it defines the object, else by the file."""
        return self.data_type is not None and self.data_type.signed

    @property
    def where(self) -> str:
        """The bytes of the object, or its bits if they are not whole bytes: ``bytes 2-5``, ``byte 0 bit 3``."""
        first, last = self.first_bit, max(self.first_bit, self.end - 1)
        if self.first_bit % 8 == 0 and self.end % 8 == 0 and self.bits:
            return f"byte {first // 8}" if last // 8 == first // 8 else f"bytes {first // 8}-{last // 8}"
        if first == last:
            return f"byte {first // 8} bit {first % 8}"
        if first // 8 == last // 8:
            return f"byte {first // 8} bits {first % 8}-{last % 8}"
        return f"byte {first // 8} bit {first % 8} to byte {last // 8} bit {last % 8}"


@dataclass(frozen=True, slots=True)
class PdoLayout:
    """One PDO of the file, for one node-ID or (``node_id`` None) as a formula; ``number`` counts from 1.

    ``cob_id`` is the entry with its flags (None: missing in the file, or a formula without node-ID). ``transmission_type``,
    ``inhibit_time`` (100 µs) and ``event_timer`` (ms) are None if the file gives none. ``notes`` describe oddities.
    """

    receive: bool
    number: int
    cob_id: int | None
    formula: Number | None
    transmission_type: int | None
    inhibit_time: int | None
    event_timer: int | None
    slots: tuple[PdoSlot, ...]
    notes: tuple[str, ...]

    @property
    def name(self) -> str:
        """``RPDO1`` and so on, in the device's point of view."""
        return f"{'RPDO' if self.receive else 'TPDO'}{self.number}"

    @property
    def communication(self) -> int:
        """The index of its communication parameter."""
        return (objects.RPDO_COMMUNICATION if self.receive else objects.TPDO_COMMUNICATION) + self.number - 1

    @property
    def mapping(self) -> int:
        """The index of its mapping parameter."""
        return (objects.RPDO_MAPPING if self.receive else objects.TPDO_MAPPING) + self.number - 1

    @property
    def valid(self) -> bool:
        """Whether the PDO is enabled (bit 31 of its COB-ID is 0)."""
        given = self.formula.value if self.formula is not None else None
        return given is not None and not given & cob.INVALID

    @property
    def identifier(self) -> int | None:
        """The CAN identifier without flags, None if it is unknown."""
        if self.cob_id is None:
            return None
        return self.cob_id & (cob.ID_MASK_29 if self.extended else cob.ID_MASK_11)

    @property
    def extended(self) -> bool:
        """Whether the identifier has 29 bits."""
        return bool(self.cob_id is not None and self.cob_id & cob.EXTENDED)

    @property
    def bits(self) -> int:
        """The sum of the mapped bits."""
        return self.slots[-1].end if self.slots else 0

    @property
    def size(self) -> int:
        """The number of data bytes in the frame."""
        return (self.bits + 7) // 8


def layouts(eds: Eds, node_id: int | None) -> tuple[PdoLayout, ...]:
    """Return all PDOs that the file describes, RPDOs first; ``node_id`` (1 to 127) resolves ``$NODEID``."""
    return tuple(
        _layout(eds, node_id, receive, index)
        for receive, first in ((True, objects.RPDO_COMMUNICATION), (False, objects.TPDO_COMMUNICATION))
        for index in range(first, first + objects.PDOS_OF_A_KIND)
        if index in eds
    )


def of_pdo(eds: Eds, pdo: PdoConfiguration, *, receive: bool) -> PdoLayout:
    """Return the layout of a drive's PDO; ``eds`` provides the names of the mapped objects."""
    flags = (0 if pdo.valid else cob.INVALID) | (cob.EXTENDED if pdo.cob_id > cob.ID_MASK_11 else 0)
    slots = tuple(_slots(eds, list(pdo.mapping)))
    return PdoLayout(
        receive,
        pdo.number,
        pdo.cob_id | flags,
        Number(pdo.cob_id | flags),
        pdo.transmission_type,
        None if receive else pdo.inhibit_time,
        pdo.event_timer,
        slots,
        tuple(_oddities(eds, slots)),
    )


def describe_mapped(eds: Eds, entry: int) -> str:
    """Return the UNSIGNED32 of a mapping parameter in words: ``6041:00/16 Statusword``."""
    mapped = MappedObject.from_entry(entry)
    return f"{mapped} {_slot(eds, mapped, 0).name}".rstrip() if entry else ""


def _layout(eds: Eds, node_id: int | None, receive: bool, index: int) -> PdoLayout:
    first = objects.RPDO_COMMUNICATION if receive else objects.TPDO_COMMUNICATION
    mapping = (objects.RPDO_MAPPING if receive else objects.TPDO_MAPPING) + index - first
    formula = _number(eds, index, objects.PDO_COB_ID)
    unresolved = formula is None or (formula.plus_node_id and node_id is None)
    entries, notes = _entries(eds, mapping, node_id)
    slots = tuple(_slots(eds, entries))
    return PdoLayout(
        receive,
        index - first + 1,
        None if formula is None or unresolved else formula.resolve(node_id),
        formula,
        _plain(eds, index, objects.PDO_TRANSMISSION_TYPE, node_id),
        None if receive else _plain(eds, index, objects.PDO_INHIBIT_TIME, node_id),
        _plain(eds, index, objects.PDO_EVENT_TIMER, node_id),
        slots,
        (*notes, *_oddities(eds, slots)),
    )


def _entries(eds: Eds, index: int, node_id: int | None) -> tuple[list[MappedObject], list[str]]:
    """Return the mapped objects at ``index``, and notes about oddities."""
    if index not in eds:
        return [], [f"the file has no mapping parameter {index:04X}h"]
    count = _plain(eds, index, 0, node_id)
    if count in _MULTIPLEXED:
        return [], [f"a {_MULTIPLEXED[count]}: the object travels in the frame"]
    found: list[int] = []
    for subindex in range(1, MAX_BITS + 1 if count is None else min(count, MAX_BITS) + 1):
        entry = _plain(eds, index, subindex, node_id)
        if entry is None or (count is None and not entry):
            break
        found.append(entry)
    notes = _count_notes(index, count, found)
    return [MappedObject.from_entry(entry) for entry in found if entry], notes


def _count_notes(index: int, count: int | None, found: list[int]) -> list[str]:
    if count is None:
        return [f"{index:04X}h:00 has no default: how many objects are mapped is the drive's to say"]
    notes = []
    if count > len(found):
        notes.append(f"{index:04X}h:00 counts {count} mapped objects, the file gives {len(found)}")
    if 0 in found:
        notes.append(
            f"{found.count(0)} of the {counted(count, 'entry', 'entries')} that {index:04X}h:00 counts map nothing"
        )
    return notes


def _slots(eds: Eds, entries: list[MappedObject]) -> Iterator[PdoSlot]:
    at = 0
    for mapped in entries:
        slot = _slot(eds, mapped, at)
        at = slot.end
        yield slot


def _slot(eds: Eds, mapped: MappedObject, at: int) -> PdoSlot:
    if mapped.is_dummy:
        return PdoSlot(mapped, at, "(space)", dummy_type(mapped), None)
    variable = eds.get(mapped.index, mapped.subindex)
    name, data_type = standard(mapped.index, mapped.subindex)
    if variable is None:
        return PdoSlot(mapped, at, name, data_type, None)
    return PdoSlot(
        mapped,
        at,
        _name(eds, variable),
        merged_type(variable.data_type, data_type),
        variable,
        eds.objects[mapped.index].is_record,
    )


def _name(eds: Eds, variable: Variable) -> str:
    """Return the entry's name; if other sub-indices share the name, the name of the object with the sub-index."""
    name = variable.denotation or variable.name
    owner = eds.objects[variable.index]
    if not owner.is_record:
        return name
    shared = sum(sub.name == variable.name for sub in owner.subs.values()) > 1
    return f"{owner.name} {variable.subindex}" if shared or not name else name


def _oddities(eds: Eds, slots: tuple[PdoSlot, ...]) -> Iterator[str]:
    for slot in slots:
        if slot.variable is None and not slot.mapped.is_dummy:
            yield f"{slot.mapped} is mapped, but the file does not describe it"
        elif slot.data_type is not None and slot.data_type.bits not in (None, slot.bits):
            yield f"{slot.mapped} takes {counted(slot.bits, 'bit')}, its type {slot.data_type.name} has {slot.data_type.bits}"
        if slot.mapped.is_dummy and slot.mapped.index not in eds.dummies:
            yield f"{slot.mapped} fills space with {slot.address}, which [DummyUsage] does not allow"
    if slots and slots[-1].end > MAX_BITS:
        yield f"{counted(slots[-1].end, 'bit')} are mapped, a CAN frame holds {MAX_BITS}"


def _number(eds: Eds, index: int, subindex: int) -> Number | None:
    variable = eds.get(index, subindex)
    if variable is None:
        return None
    given = variable.parameter_value if variable.parameter_value is not None else variable.default
    return given if isinstance(given, Number) else None


def _plain(eds: Eds, index: int, subindex: int, node_id: int | None) -> int | None:
    given = _number(eds, index, subindex)
    return None if given is None else given.resolve(node_id)
