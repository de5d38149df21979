"""The default mappings of a file's PDOs, entry by entry, for the rules (CiA 301 7.5.2.36, 7.5.2.38)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from axisbus.cia301 import objects as o
from axisbus.cia301.pdo import MappedObject
from axisbus.eds.model import Object, Variable
from axisbus.eds.rules.context import RuleContext, number_of, start_value

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


def maps(sheet: RuleContext) -> Iterator[tuple[bool, Object]]:
    """Yield each mapping parameter, with whether it belongs to an RPDO.

    A mapping that a DCF configures comes twice: as configured, and with the device's defaults.
    """
    for first, receive in ((o.RPDO_MAPPING, True), (o.TPDO_MAPPING, False)):
        for entry in _objects(sheet, first):
            yield receive, entry
            if any(sub.parameter_value is not None for sub in entry.subs.values()):
                subs = {key: replace(sub, parameter_value=None) for key, sub in entry.subs.items()}
                yield receive, replace(entry, subs=subs)


def communications(sheet: RuleContext) -> Iterator[tuple[bool, Object]]:
    """Yield each communication parameter, with whether it belongs to an RPDO."""
    for first, receive in ((o.RPDO_COMMUNICATION, True), (o.TPDO_COMMUNICATION, False)):
        for entry in _objects(sheet, first):
            yield receive, entry


def _objects(sheet: RuleContext, first: int) -> Iterator[Object]:
    yield from sheet.blocks.get(first // o.PDOS_OF_A_KIND, ())


def used(sheet: RuleContext, entry: Object) -> list[Variable]:
    """Return the entries of a mapping that its sub-index 0 counts; all that are not 0 if it gives no number."""
    count = number_of(entry.subs[0]) if 0 in entry.subs else None
    if count in MULTIPLEXED:
        return []
    there = [sub for subindex, sub in entry.subs.items() if 1 <= subindex <= MAX_ENTRIES]
    if count is None and 0 in entry.subs and not understood(sheet, entry.subs[0]):
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


def slots(sheet: RuleContext) -> Iterator[MappingEntry]:
    """Yield each mapped object in use of each mapping."""
    for receive, entry in maps(sheet):
        yield from slots_of(sheet, receive, entry)


def every_slot(sheet: RuleContext) -> Iterator[MappingEntry]:
    """Yield each mapped object of each mapping, including entries that sub-index 0 does not count."""
    yield from slots(sheet)
    for receive, entry in maps(sheet):
        yield from filled(unused(entry), receive, active=False)


def slots_of(sheet: RuleContext, receive: bool, entry: Object) -> list[MappingEntry]:
    """Return the mapped objects in use of one mapping."""
    return list(filled(used(sheet, entry), receive))


def filled(holders: Iterable[Variable], receive: bool, active: bool = True) -> Iterator[MappingEntry]:
    for holder in holders:
        value = start_value(holder)
        if value is not None and value.value and not value.plus_node_id:
            mapped = MappedObject.from_entry(value.value & 0xFFFF_FFFF)
            yield MappingEntry(receive, holder, mapped, active)


def understood(sheet: RuleContext, entry: Variable) -> bool:
    """Whether the value after power-up is valid, or there is none; else the reader has reported it."""
    section = sheet.section_of(entry.index, entry.subindex)
    return section is None or not section.entries.get("defaultvalue") or entry.default is not None
