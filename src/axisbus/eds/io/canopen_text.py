"""A clean EDS text of a model, which the ``canopen`` library reads as axisbus reads the original.

Theory of operation. ``canopen.import_od`` is built on ``configparser`` and refuses or misreads the contents of many real files:
duplicates, 8-bit text, incomplete [DummyUsage], other cases and orders, compact sub-indices, octal, ``$NODEID`` after the number,
limits in hexadecimal. This module does not repair such a text, but writes a new one from the model: one section for each entry,
explicit sub-indices, decimal numbers, formulas as ``$NODEID+n``. Contents that the library cannot represent get the nearest form
that it can: unknown object types become RECORD or VAR, types of the maker become DOMAIN (the library passes their bytes unchanged),
and a `` ;`` in a text loses its space, because it would begin a comment.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from axisbus.cia301.datatypes import DataType
from axisbus.eds.io import values
from axisbus.eds.io.values import Default
from axisbus.eds.model import BAUD_RATES, Eds, Number, Object, ObjectType, Variable

_KNOWN_DATA_TYPES = frozenset(kind for kind in DataType if kind <= DataType.UNSIGNED64)
_TIMES = (DataType.TIME_OF_DAY, DataType.TIME_DIFFERENCE)
_CONTROL = re.compile(r"[\x00-\x08\x0a-\x1f\x7f\x85\u2028\u2029]+")
_COMMENT = re.compile(r"(?<!\s)\s+;")  # the look-behind keeps searches in long gaps fast

# Keys of [DeviceInfo] that the library reads as numbers, and as texts.
_NUMBERS = (
    "VendorNumber",
    "ProductNumber",
    "RevisionNumber",
    "SimpleBootUpMaster",
    "SimpleBootUpSlave",
    "Granularity",
    "DynamicChannelsSupported",
    "GroupMessaging",
    "NrOfRXPDO",
    "NrOfTXPDO",
    "LSS_Supported",
    *(f"BaudRate_{rate}" for rate in BAUD_RATES),
)
_TEXTS = ("VendorName", "ProductName", "OrderCode")


def canopen_text(eds: Eds) -> str:
    """Return a text for ``canopen.import_od``; made on first use and cached in ``eds``.

    That function derives the format from the stream's name, so its stream must have one, such as an ``io.StringIO`` with
    ``stream.name = "axis.eds"``.
    """
    text = eds._texts.get("canopen")
    if text is None:
        text = eds._texts["canopen"] = "\n".join(_lines(eds)) + "\n"
    return text


def _lines(eds: Eds) -> Iterator[str]:
    yield from _device(eds.info.get("deviceinfo", {}))
    if eds.node_id is not None:
        yield "[DeviceComissioning]"
        yield f"NodeID={eds.node_id}"
        yield from _baudrate(eds.info)
    yield "[DummyUsage]"
    for number in range(1, 8):
        yield f"Dummy{number:04d}={int(number in eds.dummies)}"
    for entry in eds:
        yield from _object(entry)


def _device(info: Mapping[str, str]) -> Iterator[str]:
    yield "[DeviceInfo]"
    for key in _NUMBERS:
        number = values.plain(info.get(key.lower(), ""))
        if number is not None:
            yield f"{key}={number}"
    for key in _TEXTS:
        if key.lower() in info:
            yield f"{key}={_clean(info[key.lower()])}"


def _baudrate(info: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    section = info.get("devicecomissioning", info.get("devicecommissioning", {}))
    rate = values.plain(section.get("baudrate", ""))
    if rate is not None:
        yield f"Baudrate={rate}"


def _object(entry: Object) -> Iterator[str]:
    single = not entry.is_record and len(entry.subs) == 1 and 0 in entry.subs
    if single:
        yield from _variable(f"{entry.index:04X}", entry.subs[0])
        return
    array = entry.object_type is ObjectType.ARRAY
    yield f"[{entry.index:04X}]"
    yield f"ParameterName={_clean(entry.name)}"
    yield f"ObjectType={ObjectType.ARRAY if array else ObjectType.RECORD:d}"
    yield f"SubNumber={len(entry.subs)}"
    for subindex, sub in entry.subs.items():
        yield from _variable(f"{entry.index:04X}sub{subindex:X}", sub)


def _variable(section: str, entry: Variable) -> Iterator[str]:
    domain = entry.object_type is ObjectType.DOMAIN
    data_type = entry.data_type if entry.data_type in _KNOWN_DATA_TYPES else DataType.DOMAIN
    yield f"[{section}]"
    yield f"ParameterName={_clean(entry.name)}"
    yield f"ObjectType={ObjectType.DOMAIN if domain else ObjectType.VAR:d}"
    yield f"DataType={data_type:d}"
    yield f"AccessType={entry.access}"
    yield f"PDOMapping={int(entry.pdo_mapping)}"
    for key, value in (
        ("DefaultValue", entry.default),
        ("ParameterValue", entry.parameter_value),
        ("LowLimit", entry.low),
        ("HighLimit", entry.high),
    ):
        if value is not None:
            yield f"{key}={_value(value, data_type)}"


def _value(value: Default, data_type: DataType) -> str:
    if isinstance(value, Number):
        return f"$NODEID+{value.value}" if value.plus_node_id else str(value.value)
    if isinstance(value, bytes):
        return str(int.from_bytes(value, "little")) if data_type in _TIMES else value.hex()
    return _clean(value) if isinstance(value, str) else repr(value)


def _clean(text: str) -> str:
    return _COMMENT.sub(";", _CONTROL.sub(" ", text)).strip()
