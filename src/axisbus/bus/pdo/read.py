"""Read the PDO parameters of a live drive by SDO, with tolerance for what real drives lack."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from axisbus.bus.pdo.mapping import DevicePdos
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.pdo import MAX_BITS, MappedObject, PdoConfiguration
from axisbus.cia301.sdo import number_if_served
from axisbus.eds.dictionary import Dictionary

_PROBED = (*range(1, 9), *range(65, 69))  # if no EDS lists the PDOs
_MULTIPLEXED = 0xFE  # sub-index 0 of an MPDO (CiA 301 7.5.2.36): FEh and FFh are not counts


@dataclass(frozen=True, slots=True)
class Indices:
    """Indices of the parameters of one PDO."""

    communication: int
    mapping: int

    @classmethod
    def of(cls, receive: bool, number: int) -> Indices:
        """Return those of RPDO or TPDO ``number`` (from 1)."""
        if receive:
            return cls(o.RPDO_COMMUNICATION + number - 1, o.RPDO_MAPPING + number - 1)
        return cls(o.TPDO_COMMUNICATION + number - 1, o.TPDO_MAPPING + number - 1)


def read_pdos(sdo: SdoClient, also: Collection[tuple[bool, int]] = ()) -> DevicePdos:
    """Read every PDO of the device by SDO; blocks for about a dozen transfers each.

    If a device has many PDOs, only those that an axis may need are read, and those of ``also`` (whether it is an RPDO, its number).
    Entries that a device lacks are None or left out. A PDO without COB-ID or transmission type does not exist. The parameters are
    read by number, so their types in an EDS do not matter.

    Raises:
        SdoTimeout, SdoError, AdapterError: as ``SdoClient.upload``.
    """
    return DevicePdos(
        tuple(_read_existing(sdo, True, also)),
        tuple(_read_existing(sdo, False, also)),
    )


def read_pdo(sdo: SdoClient, receive: bool, number: int) -> PdoConfiguration | None:
    """Read one PDO (number from 1); None if the device has no such PDO. Blocks, raises as ``read_pdos``."""
    at = Indices.of(receive, number)
    cob_id = read_number(sdo, at.communication, o.PDO_COB_ID)
    transmission = read_number(sdo, at.communication, o.PDO_TRANSMISSION_TYPE)
    if cob_id is None or transmission is None:
        return None
    return PdoConfiguration(
        number,
        cob_id & (cob.ID_MASK_29 if cob_id & cob.EXTENDED else cob.ID_MASK_11),
        not cob_id & cob.INVALID,
        transmission,
        _read_mapping(sdo, at.mapping),
        read_number(sdo, at.communication, o.PDO_INHIBIT_TIME) if not receive else None,
        read_number(sdo, at.communication, o.PDO_EVENT_TIMER),
        None if receive else _sync_start(sdo, at.communication),
    )


def _read_existing(
    sdo: SdoClient, receive: bool, also: Collection[tuple[bool, int]]
) -> Iterable[PdoConfiguration]:
    own = {number for direction, number in also if direction is receive}
    for number in sorted(own.union(_numbers(sdo.dictionary, receive))):
        pdo = read_pdo(sdo, receive, number)
        if pdo is not None:
            yield pdo


def _numbers(dictionary: Dictionary, receive: bool) -> list[int]:
    """Return PDO numbers to try: the first eight that the EDS has in each axis's block of 64."""
    if dictionary.eds is None:
        return list(_PROBED)
    numbers = [
        number
        for number in range(1, o.PDOS_OF_A_KIND + 1)
        if Indices.of(receive, number).communication in dictionary.eds
    ]
    blocks: dict[int, list[int]] = {}
    for number in numbers:
        blocks.setdefault((number - 1) // 64, []).append(number)
    return [number for block in blocks.values() for number in block[:8]]


def _read_mapping(sdo: SdoClient, index: int) -> tuple[MappedObject, ...]:
    count = read_number(sdo, index, 0)
    if count is None or count >= _MULTIPLEXED:
        return ()
    entries = []
    for subindex in range(1, min(count, MAX_BITS) + 1):
        entry = read_number(sdo, index, subindex)
        if entry is None:
            break
        entries.append(MappedObject.from_entry(entry))
    return tuple(entries)


def _sync_start(sdo: SdoClient, index: int) -> int | None:
    """Read the SYNC start value, unless the EDS says that the drive does not have it (few drives do)."""
    return (
        None
        if sdo.dictionary.has(index, o.PDO_SYNC_START) is False
        else read_number(sdo, index, o.PDO_SYNC_START)
    )


def read_number(sdo: SdoClient, index: int, subindex: int) -> int | None:
    return number_if_served(sdo.upload, index, subindex)
