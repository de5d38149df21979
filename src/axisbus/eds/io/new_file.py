"""A new EDS or DCF of a model, in the layout of DS 306; for models that were not read from a file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping

from axisbus.cia301.datatypes import DataType
from axisbus.eds.io import values
from axisbus.eds.io.edit import check_key, check_name
from axisbus.eds.io.values import Default
from axisbus.eds.model import DEVICE_NUMBERS, Eds, Number, Object, ObjectType, Variable
from axisbus.errors import ArgumentError

MANDATORY = frozenset((0x1000, 0x1001, 0x1018))
MANUFACTURER = range(0x2000, 0x6000)
FIRST_OBJECT = 0x1000  # indices below are data types, which no list contains

_NUMBERS = (*DEVICE_NUMBERS, "NodeID", "Baudrate", "NetNumber", "CANopenManager", "LSS_SerialNumber")
# Keys in the standard's spelling: the model's keys are in lower case, but many readers accept only this spelling.
_PRINTED = {
    key.lower(): key
    for key in (
        *_NUMBERS,
        *("FileName", "FileVersion", "FileRevision", "LastEDS", "EDSVersion", "Description", "CreationTime"),
        *("CreationDate", "CreatedBy", "ModificationTime", "ModificationDate", "ModifiedBy"),
        *("VendorName", "ProductName", "OrderCode", "NodeName", "NetworkName", "NrOfEntries", "NrOfSeg"),
        *("UploadFile", "DownloadFile", "NodeRefd", "NetRefd", "ParamRefd", "SRDOMapping", "InvertedSRAD"),
    )
}
_SECTIONS = {
    name.lower(): name
    for name in ("FileInfo", "DeviceInfo", "DeviceComissioning", "Comments", "StandardDataTypes")
}
_FIRST = ("fileinfo", "deviceinfo", "devicecomissioning")
_LISTS = ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
_REGENERATED = re.compile(
    r"dummyusage|devicecommissioning|(?:mandatory|optional|manufacturer)objects"
    r"|[0-9a-f]{4}(?:name|value|denotation|objectlinks)|[0-9a-f]{1,4}(?:sub[0-9a-f]+)?"
)
_COMMENT_LINE = re.compile(r"line[0-9]+")

_TIMES = (DataType.TIME_OF_DAY, DataType.TIME_DIFFERENCE)


def compose(eds: Eds) -> str:
    """Return the text of a new EDS, or of a DCF if the model has a node-ID; lines end in LF.

    Sub-indices are explicit and numbers normalised. Comments between a file's lines are lost. Of modules, only the information
    sections are written.

    Raises:
        ArgumentError: a text is not ASCII, has control characters or spaces at its ends, or is no number although [DeviceInfo] or
            [DeviceComissioning] requires one.
    """
    text = "".join(f"{line}\n" for line in _lines(eds))
    if not text.isascii():
        line = next(line for line in text.splitlines() if not line.isascii())
        raise ArgumentError(f"{line[:60]!r} is not ASCII", remedy="write it with ASCII letters (DS 306 4.2)")
    return text


def _lines(eds: Eds) -> Iterator[str]:
    for name, entries in _information(eds).items():
        yield from _section(_SECTIONS.get(name, name), entries)
    dummies = {f"Dummy{kind:04X}": str(int(kind in eds.dummies)) for kind in range(1, 8)}
    yield from _section("DummyUsage", dummies)
    for name, indices in zip(_LISTS, _listed(eds), strict=True):
        yield from _section(name, _counted("SupportedObjects", indices))
    for entry in eds:
        yield from _object(entry)


def _information(eds: Eds) -> dict[str, dict[str, str]]:
    """Return the information sections in the order of the standard's examples, with the node-ID of a DCF."""
    found = {
        name: dict(eds.info.get(name, {})) for name in _FIRST if name in eds.info or name == "deviceinfo"
    }
    if eds.node_id is not None:
        given = found.get("devicecomissioning") or eds.info.get("devicecommissioning", {})
        found["devicecomissioning"] = {**given, "nodeid": str(eds.node_id)}
    for name, entries in eds.info.items():
        if name not in found and not _REGENERATED.fullmatch(name):
            found[name] = _comments(entries) if name == "comments" else dict(entries)
    return {name: _printed(entries) for name, entries in found.items()}


def _comments(entries: Mapping[str, str]) -> dict[str, str]:
    lines = [text for key, text in entries.items() if _COMMENT_LINE.fullmatch(key)]
    return {"Lines": str(len(lines)), **{f"Line{number}": text for number, text in enumerate(lines, 1)}}


def _printed(entries: Mapping[str, str]) -> dict[str, str]:
    """Return the entries with keys in the standard's spelling; empty numbers are left out."""
    found = {}
    for key, text in entries.items():
        name = _PRINTED.get(key, key)
        if name not in _NUMBERS:
            found[name] = text
        elif text:
            found[name] = _number(name, text)
    return found


def _number(key: str, text: str) -> str:
    number = values.plain(text)
    if number is None:
        raise ArgumentError(
            f"{key}={text[:40]!r} is not a number", remedy=f"give {key} a number, or leave it out"
        )
    return str(number)


def _listed(eds: Eds) -> tuple[list[int], list[int], list[int]]:
    """Return the indices for the three lists of DS 306 4.6.3.1."""
    mandatory, optional, manufacturer = [], [], []
    for index in eds.objects:
        if index in MANDATORY:
            mandatory.append(index)
        elif index in MANUFACTURER:
            manufacturer.append(index)
        elif index >= FIRST_OBJECT:
            optional.append(index)
    return mandatory, optional, manufacturer


def _counted(key: str, indices: Iterable[int]) -> dict[str, str]:
    numbered = {str(number): f"0x{index:04X}" for number, index in enumerate(indices, 1)}
    return {key: str(len(numbered)), **numbered}


def _object(entry: Object) -> Iterator[str]:
    section = f"{entry.index:04X}"
    if entry.is_record:
        yield from _section(section, _head(entry))
        for subindex, sub in entry.subs.items():
            yield from _section(f"{section}sub{subindex:X}", _variable(sub))
    else:
        yield from _section(section, _variable(entry.subs[0]))
    if entry.links:
        yield from _section(f"{section}ObjectLinks", _counted("ObjectLinks", entry.links))


def _head(entry: Object) -> dict[str, str]:
    found = {
        "ParameterName": entry.name,
        "ObjectType": f"0x{entry.object_type:X}",
        "SubNumber": str(len(entry.subs)),
        "Denotation": entry.denotation,
    }
    return {key: text for key, text in found.items() if text} | _printed(entry.more)


def _variable(entry: Variable) -> dict[str, str]:
    domain = entry.object_type is ObjectType.DOMAIN
    found = {
        "ParameterName": entry.name,
        "ObjectType": f"0x{entry.object_type:X}",
        "DataType": f"0x{entry.data_type:04X}",
        "AccessType": entry.access,
        "DefaultValue": written(entry.default, entry.data_type),
        "PDOMapping": "" if domain else str(int(entry.pdo_mapping)),
        "LowLimit": written(entry.low, entry.data_type),
        "HighLimit": written(entry.high, entry.data_type),
        "ObjFlags": f"0x{entry.object_flags:X}" if entry.object_flags else "",
        "ParameterValue": written(entry.parameter_value, entry.data_type),
        "Denotation": entry.denotation,
    }
    return {key: text for key, text in found.items() if text or key == "ParameterName"} | _printed(entry.more)


def written(value: Default, data_type: DataType) -> str:
    """Return a value in the notation of an EDS (DS 306 4.3); empty for None.

    Raises:
        ArgumentError: a REAL is infinite or not a number, for which an EDS has no notation.
    """
    if value is None or isinstance(value, str):
        return value or ""
    if isinstance(value, Number):
        return _integer(value)
    if isinstance(value, bytes):
        return str(int.from_bytes(value, "little")) if data_type in _TIMES else value.hex().upper()
    if not math.isfinite(value):
        raise ArgumentError(f"{value} cannot be written in an EDS", remedy="give a finite number")
    return repr(float(value))


def _integer(value: Number) -> str:
    if not value.plus_node_id:
        return str(value.value)
    # DS 306 4.3 allows $NODEID alone, but some readers, canopen among them, require a number after it.
    return f"$NODEID+0x{value.value:X}" if value.value >= 0 else f"$NODEID+{value.value}"


def _section(name: str, entries: Mapping[str, str]) -> Iterator[str]:
    check_name(name)
    yield f"[{name}]"
    for key, text in entries.items():
        check_key(key, text)
        yield f"{key}={text}"
    yield ""
