"""Objects of a drive that its PDOs can carry, by its dictionary and by the standard."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from axisbus.cia301.datatypes import DataType
from axisbus.cia301.pdo import MappedObject, PdoConfiguration
from axisbus.cia402 import dictionary as catalogue
from axisbus.cia402 import objects
from axisbus.cia402.axes import own_index
from axisbus.cia402.port import ALL_OUTPUTS, INPUT_OBJECTS
from axisbus.eds.dictionary import Dictionary, merged_type, standard
from axisbus.eds.model import RPDO_ACCESS, TPDO_ACCESS

_POSITION_BITS = 32


@dataclass(frozen=True, slots=True)
class MapEntry:
    """One object with its mapping options; ``index`` is the device's own (the axis's offset included)."""

    index: int
    subindex: int
    bits: int
    signed: bool
    receive: bool
    transmit: bool

    @property
    def mapped(self) -> MappedObject:
        """The entry for a mapping parameter."""
        return MappedObject(self.index, self.subindex, self.bits)


@dataclass(frozen=True, slots=True)
class DevicePdos:
    """The PDOs of a device with their present parameters."""

    rpdos: tuple[PdoConfiguration, ...]
    tpdos: tuple[PdoConfiguration, ...]

    @property
    def mapped(self) -> Iterable[MappedObject]:
        """Every mapped entry."""
        return (entry for pdo in (*self.rpdos, *self.tpdos) for entry in pdo.mapping)


def axis_objects(dictionary: Dictionary, device: DevicePdos, axis: int = 1) -> dict[int, MapEntry]:
    """Return the objects of motion's values that the axis has, by their index in the device.

    An object exists if the EDS has it, or if the drive maps it already. Without an EDS the standard's objects are assumed to exist,
    and mapping them shows whether the drive has them.
    """
    wanted = {*INPUT_OBJECTS.values(), *ALL_OUTPUTS.values()}
    mapped = {(entry.index, entry.subindex): entry.bits for entry in device.mapped}
    found = {}
    for first in sorted(wanted):
        index = own_index(first, axis)
        entry = (
            _entry(dictionary, index) or _mapped_entry(index, mapped.get((index, 0)))
            if first != objects.INTERPOLATION_DATA
            else _interpolation_entry(dictionary, index)
        )
        if entry is not None:
            found[index] = entry
    return found


def map_entry_of(dictionary: Dictionary, index: int, subindex: int = 0) -> MapEntry | None:
    """Return an integer object with the mapping options of its EDS; None if the EDS has no such object."""
    variable = None if dictionary.eds is None else dictionary.eds.get(index, subindex)
    if variable is None:
        return None
    data_type = merged_type(variable.data_type, standard(index, subindex)[1])
    if data_type.bits is None or not (data_type.integer or data_type is DataType.BOOLEAN):
        return None
    return MapEntry(
        index,
        subindex,
        data_type.bits,
        data_type.signed,
        receive=variable.pdo_mapping and variable.access in RPDO_ACCESS,
        transmit=variable.pdo_mapping and variable.access in TPDO_ACCESS,
    )


def _interpolation_entry(dictionary: Dictionary, index: int) -> MapEntry | None:
    """Return the first set-point of 60C1h: a position, which is signed whatever the file says."""
    found = map_entry_of(dictionary, index, 1)
    return None if found is None or found.bits != _POSITION_BITS else replace(found, signed=True)


def _entry(dictionary: Dictionary, index: int) -> MapEntry | None:
    _, standard_type = standard(index, 0)
    if dictionary.eds is None:
        row = catalogue.entry(index, 0)
        bits = standard_type.bits if standard_type is not None else None
        if row is None or bits is None:
            return None
        return MapEntry(index, 0, bits, _signed(index), "RPDO" in row.mapping, "TPDO" in row.mapping)
    variable = dictionary.eds.get(index, 0)
    if variable is None:
        return None
    data_type = merged_type(variable.data_type, standard_type)
    if data_type.bits is None:
        return None
    return MapEntry(
        index,
        0,
        data_type.bits,
        data_type.signed,
        receive=variable.pdo_mapping and variable.access in RPDO_ACCESS,
        transmit=variable.pdo_mapping and variable.access in TPDO_ACCESS,
    )


def _mapped_entry(index: int, bits: int | None) -> MapEntry | None:
    """Return an object that the file lacks but the drive maps: it has the drive's size and cannot be mapped elsewhere."""
    return None if bits is None else MapEntry(index, 0, bits, _signed(index), receive=False, transmit=False)


def _signed(index: int) -> bool:
    data_type = standard(index, 0)[1]
    return data_type is not None and data_type.signed
