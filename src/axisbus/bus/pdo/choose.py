"""Choose the PDOs of a drive for the wanted values: present mappings of the drive, or a layout of axisbus."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

from axisbus.bus.pdo.mapping import DevicePdos, MapEntry
from axisbus.cia301 import cob
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


def keep_mappings(pdos: Sequence[PdoConfiguration], entries: Entries, switch_on: bool) -> Chosen:
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
    mappings: list[list[str]] = [[] for _ in slots]
    unplaced: list[str] = []
    for number, group in enumerate(layout):
        for name in group:
            if name in entries:
                own = mappings[number] if number < len(mappings) else None
                if own is None or not _add_to_mapping(name, [own], entries):
                    unplaced.append(name)
    lost = frozenset(name for name in unplaced if not _add_to_mapping(name, mappings, entries))
    pdos = tuple(
        (slot, tuple(entries[name].mapped for name in sorted(mapping, key=lambda name: name == last)))
        for slot, mapping in zip(slots, mappings, strict=True)
        if mapping
    )
    return Chosen(pdos, frozenset(name for group in layout for name in group if name in entries) - lost)


def _add_to_mapping(name: str, mappings: Sequence[list[str]], entries: Entries) -> bool:
    for mapping in mappings:
        if sum(entries[other].bits for other in (*mapping, name)) <= MAX_BITS:
            mapping.append(name)
            return True
    return False


def slots(pdos: Sequence[PdoConfiguration], axis: int) -> tuple[PdoConfiguration, ...]:
    """Return the PDOs that may be remapped for an axis (1 to 8): those of its block of 64 if the device has one, else its four."""
    block = range(BLOCK * (axis - 1) + 1, BLOCK * (axis - 1) + 1 + PDOS_PER_AXIS)
    row = range(PDOS_PER_AXIS * (axis - 1) + 1, PDOS_PER_AXIS * axis + 1)
    found = [pdo for pdo in pdos if pdo.number in block] or [pdo for pdo in pdos if pdo.number in row]
    return tuple(sorted(found, key=lambda pdo: pdo.number))


# -- Assign a COB-ID to each PDO of a plan -----------------------------------------------------------------------------


_PDO_COB_IDS = range(0x181, 0x580)
_NODE_BITS = 0x7F


class CobIds:
    """Assigns COB-IDs while one plan is made; holds state: the COB-IDs that the plan has used."""

    def __init__(
        self, node_id: int, device: DevicePdos, taken: Collection[int], spare: Iterable[int]
    ) -> None:
        """``taken`` are COB-IDs of other nodes, ``spare`` those available to PDOs after the fourth."""
        self._node_id = node_id
        self._used = set(taken)
        self._spare: Iterator[int] = iter(spare)
        self._owners = {pdo.cob_id: pdo for pdo in (*device.rpdos, *device.tpdos) if pdo.valid}

    def choose(self, pdo: PdoConfiguration, receive: bool) -> int | None:
        """Return the predefined COB-ID of PDOs 1 to 4, else the PDO's own, else a spare one; None if none is free.

        The predefined one comes first because files and drives often contain the COB-ID of another node.
        """
        predefined = cob.of_pdo(pdo.number, self._node_id, receive=receive)
        for candidate in chain((predefined, pdo.cob_id), self._spare):
            if candidate is not None and _is_pdo_cob_id(candidate) and self._is_free(candidate, pdo):
                self._used.add(candidate)
                return candidate
        return None

    def _is_free(self, cob_id: int, pdo: PdoConfiguration) -> bool:
        return cob_id not in self._used and self._owners.get(cob_id, pdo) is pdo


def _is_pdo_cob_id(cob_id: int) -> bool:
    """Whether a PDO may have this COB-ID (CiA 301 7.3.5).

    Without a node-ID it was written without ``$NODEID`` and is the same in all nodes.
    """
    if cob_id > cob.ID_MASK_11:
        return True  # 29 bits: no range is reserved there
    return cob_id in _PDO_COB_IDS and cob_id & _NODE_BITS != 0
