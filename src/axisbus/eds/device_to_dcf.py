"""Convert the values read from a device to the texts of a DCF, and check that each text gives the same value."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType, decode, encode, size_in_bytes
from axisbus.eds import dcf
from axisbus.eds.io import values
from axisbus.eds.io.new_file import written
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.model import Number, Variable
from axisbus.errors import AxisbusError
from axisbus.wording import counted

Key = tuple[int, int]

_REFUSES_SCAN = 2  # bit 1 of ObjFlags (DS 306 4.6.3.3)
_TEXTS = frozenset((DataType.VISIBLE_STRING, DataType.UNICODE_STRING))
_NOT_ASCII = re.compile(r"[^\x20-\x7e]")
# COB-IDs of the pre-defined connection set: the object -> the part without the node-ID (CiA 301 7.3.5).
_PREDEFINED: Mapping[Key, int] = {
    (o.COB_ID_EMCY, 0): cob.EMCY,
    **{(o.RPDO_COMMUNICATION + number, o.PDO_COB_ID): base for number, base in enumerate(cob.RPDO)},
    **{(o.TPDO_COMMUNICATION + number, o.PDO_COB_ID): base for number, base in enumerate(cob.TPDO)},
}


@dataclass(frozen=True, slots=True)
class LeftOut:
    """An entry that is not in a backup, and the reason."""

    index: int
    subindex: int
    name: str
    reason: str


def readable(reading: EdsParseResult) -> tuple[list[Variable], list[LeftOut]]:
    """Return the entries to read for a backup, and the entries that are left out."""
    variables, left_out = [], []
    for entry in reading.eds:
        for variable in entry.subs.values():
            reason = _reason(reading, variable)
            if reason:
                left_out.append(left(variable, reason))
            else:
                variables.append(variable)
    return variables, left_out


def left(variable: Variable, reason: str) -> LeftOut:
    """Return an entry as one that is left out."""
    return LeftOut(variable.index, variable.subindex, variable.name, reason)


def _reason(reading: EdsParseResult, variable: Variable) -> str:
    if not variable.readable:
        return "it can only be written"
    if variable.object_flags & _REFUSES_SCAN:
        return "its ObjFlags say that it is not to be read on a scan"
    if variable.data_type is DataType.DOMAIN:
        return "a DOMAIN is a separate file"
    if not dcf.has_section_for(reading, variable.index, variable.subindex):
        return "the EDS has no section for it"
    return ""


def text_of(variable: Variable, data: bytes, node_id: int) -> str | LeftOut:
    """Return the value read from a device in the notation of an EDS; COB-IDs that follow the node-ID become formulas.

    A writable entry is left out if its text would not give the same bytes again. A read-only entry gets the nearest possible text.
    """
    size = size_in_bytes(variable.data_type)
    if size is not None and size != len(data):
        return left(
            variable,
            f"the device sends {counted(len(data), 'octet')}, {variable.data_type.name} has {size}: wrong EDS?",
        )
    text = _text(variable, data, node_id)
    if not text and variable.writable:
        return left(variable, "it is empty, which an EDS cannot say")
    if _means(text, variable, data, node_id) or not variable.writable:
        return text
    return left(variable, f"{data[:16].hex(' ')} cannot be written in an EDS as {variable.data_type.name}")


def printable(text: str) -> str:
    """Return a device's text in the form that an EDS allows: trimmed, with ``?`` for each character that is not printable ASCII."""
    return _NOT_ASCII.sub("?", text.strip())


def _text(variable: Variable, data: bytes, node_id: int) -> str:
    value = decode(data, variable.data_type)
    if isinstance(value, int):
        return written(_relative(variable, value, node_id), variable.data_type)
    if variable.data_type in _TEXTS:
        return printable(str(value))
    return written(value, variable.data_type)


def _relative(variable: Variable, value: int, node_id: int) -> Number:
    default = variable.default
    if isinstance(default, Number) and default.plus_node_id and default.resolve(node_id) == value:
        return default
    base = _PREDEFINED.get((variable.index, variable.subindex))
    if base is not None and value & cob.ID_MASK_29 == base + node_id:
        return Number(value - node_id, plus_node_id=True)
    return Number(value)


def _means(text: str, variable: Variable, data: bytes, node_id: int) -> bool:
    """Whether parsing the text gives the same bytes again."""
    value, _ = values.parse(text, variable.data_type)
    plain = value.resolve(node_id) if isinstance(value, Number) else value
    padded = variable.data_type in _TEXTS  # many devices end a text with zeros
    try:
        return plain is not None and encode(plain, variable.data_type) == (
            data.rstrip(b"\0") if padded else data
        )
    except AxisbusError:
        return False
