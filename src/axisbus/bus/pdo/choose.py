"""Choose the PDOs of a drive for the wanted values: present mappings of the drive, or a layout of axisbus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from axisbus.bus.pdo.mapping import MapEntry
from axisbus.cia301.pdo import MAX_BITS, MappedObject, PdoConfiguration

PDOS_PER_AXIS = 4  # in a device with one row of PDOs
BLOCK = 64  # distance of the axes' PDOs in a device that keeps them in blocks (CiA 402-3)

Entries = Mapping[str, MapEntry]


class Chosen(NamedTuple):
    """PDOs with their future mapping, and the names of the values that they carry."""

    pdos: tuple[tuple[PdoConfiguration, tuple[MappedObject, ...]], ...]
    carried: frozenset[str]


def names_in(mapping: Sequence[MappedObject], entries: Entries) -> tuple[str | None, ...]:
    """Return the value that each mapping entry carries.

    None for an entry that is not in ``entries`` or has another number of bits.
    """
    by_object = {entry.mapped: name for name, entry in entries.items()}
    return tuple(by_object.get(mapped) for mapped in mapping)


def keep(pdos: Sequence[PdoConfiguration], entries: Entries, switch_on: bool) -> Chosen:
    """Choose among the present mappings, repeatedly the PDO that adds most values.

    Among equal PDOs a valid one comes first, then one with fewer other objects, then the lowest number. ``switch_on``: whether a
    PDO that is off may be chosen.
    """
    carries = {
        pdo: frozenset(name for name in names_in(pdo.mapping, entries) if name is not None)
        for pdo in pdos
        if 0 < pdo.bits <= MAX_BITS and (pdo.valid or switch_on)
    }
    chosen: list[PdoConfiguration] = []
    left = frozenset(entries)
    while left and (best := _best(carries, left)) is not None:
        chosen.append(best)
        left -= carries[best]
    chosen.sort(key=lambda pdo: pdo.number)
    return Chosen(tuple((pdo, pdo.mapping) for pdo in chosen), frozenset(entries) - left)


def _best(
    carries: Mapping[PdoConfiguration, frozenset[str]], left: frozenset[str]
) -> PdoConfiguration | None:
    def merit(pdo: PdoConfiguration) -> tuple[int, bool, int, int]:
        return len(carries[pdo] & left), pdo.valid, len(carries[pdo]) - len(pdo.mapping), -pdo.number

    best = max(carries, key=merit, default=None)
    return best if best is not None and carries[best] & left else None


def lay_out(
    slots: Sequence[PdoConfiguration],
    entries: Entries,
    layout: Sequence[Sequence[str]],
    last: str | None = None,
) -> Chosen:
    """Map the entries by ``layout``, one group per slot; entries that do not fit there go into the first slot with room, in order.

    The first entry of a group is placed first. ``last`` names the value that is mapped after all others in its PDO.
    """
    rooms: list[list[str]] = [[] for _ in slots]
    homeless: list[str] = []
    for number, group in enumerate(layout):
        for name in group:
            if name in entries:
                own = rooms[number] if number < len(rooms) else None
                if own is None or not _place(name, [own], entries):
                    homeless.append(name)
    lost = frozenset(name for name in homeless if not _place(name, rooms, entries))
    pdos = tuple(
        (slot, tuple(entries[name].mapped for name in sorted(room, key=lambda name: name == last)))
        for slot, room in zip(slots, rooms, strict=True)
        if room
    )
    return Chosen(pdos, frozenset(name for group in layout for name in group if name in entries) - lost)


def _place(name: str, rooms: Sequence[list[str]], entries: Entries) -> bool:
    for room in rooms:
        if sum(entries[other].bits for other in (*room, name)) <= MAX_BITS:
            room.append(name)
            return True
    return False


def slots(pdos: Sequence[PdoConfiguration], axis: int) -> tuple[PdoConfiguration, ...]:
    """Return the PDOs that may be remapped for an axis (1 to 8): those of its block of 64 if the device has one, else its four."""
    block = range(BLOCK * (axis - 1) + 1, BLOCK * (axis - 1) + 1 + PDOS_PER_AXIS)
    row = range(PDOS_PER_AXIS * (axis - 1) + 1, PDOS_PER_AXIS * axis + 1)
    found = [pdo for pdo in pdos if pdo.number in block] or [pdo for pdo in pdos if pdo.number in row]
    return tuple(sorted(found, key=lambda pdo: pdo.number))
