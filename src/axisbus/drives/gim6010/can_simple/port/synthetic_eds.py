"""EDS of the drive that a port emulates for its module: its CiA 402 objects, with the values of constant ones.

The module itself has no object dictionary. The EDS is for code that judges an axis by its drive's objects.
"""

from __future__ import annotations

from functools import cache
from itertools import groupby

from axisbus.cia301.datatypes import DataType
from axisbus.cia402 import dictionary as catalogue
from axisbus.drives.gim6010.can_simple.port import error_words
from axisbus.drives.gim6010.can_simple.port.port import ModulePort
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.make import GIM6010, VENDOR_ID
from axisbus.drives.plugin import DrivePlugin
from axisbus.eds.io.reader import loads
from axisbus.eds.model import Eds

_SOURCE = "the objects of the port of a CAN Simple module"
_HEAD = f"""[FileInfo]
FileName=module.eds
[DeviceInfo]
ProductName=GIM6010-8 (CAN Simple)
VendorNumber={VENDOR_ID:#x}
"""
_IDENTITY = f"""[1018]
ParameterName=Identity
ObjectType=0x9
SubNumber=2
[1018sub0]
ParameterName=Entries
ObjectType=0x7
DataType=0x5
AccessType=ro
DefaultValue=1
[1018sub1]
ParameterName=Vendor-ID
ObjectType=0x7
DataType=0x7
AccessType=ro
DefaultValue={VENDOR_ID:#x}
"""

# The plug-in of the emulated drive: its faults are read and explained differently from those of a CANopen GIM6010-8.
MAKE = DrivePlugin(
    name=f"{GIM6010.name} (CAN Simple)",
    vendor_id=VENDOR_ID,
    fault_objects=error_words.ADDRESSES,
    explain=error_words.explain,
    scale_proposal=GIM6010.scale_proposal,
)


@cache
def description(settings: ModuleSettings) -> Eds:
    objects = ModulePort(settings).objects
    parts = [_HEAD, _IDENTITY]
    for index, addresses in groupby(sorted(objects.addresses), key=lambda address: address[0]):
        subindices = [subindex for _, subindex in addresses]
        if subindices != [0]:
            parts.append(_record(index, len(subindices)))
        parts += [_entry(index, subindex, objects.constant(index, subindex)) for subindex in subindices]
    return loads("".join(parts).encode(), _SOURCE)


def _record(index: int, count: int) -> str:
    return (
        f"[{index:04X}]\nParameterName={_name(index)}\nObjectType=0x9\nSubNumber={count + 1}\n"
        f"[{index:04X}sub0]\nParameterName=Entries\nObjectType=0x7\nDataType=0x5\nAccessType=ro\nDefaultValue={count}\n"
    )


def _entry(index: int, subindex: int, constant: int | None) -> str:
    row = catalogue.entry(index, subindex)
    data_type = None if row is None else row.data_type
    section = f"{index:04X}sub{subindex:X}" if subindex else f"{index:04X}"
    default = "" if constant is None else f"DefaultValue={constant}\n"
    return (
        f"[{section}]\nParameterName={_name(index, subindex)}\nObjectType=0x7\n"
        f"DataType={data_type or DataType.UNSIGNED32:#x}\nAccessType={'rw' if constant is None else 'ro'}\n{default}"
    )


def _name(index: int, subindex: int = 0) -> str:
    row = catalogue.entry(index, subindex) if subindex else catalogue.whole(index)
    return f"Error word {subindex}" if row is None else row.name
