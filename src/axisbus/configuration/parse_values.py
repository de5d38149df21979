"""Parse objects and values from user input: names or numbers to entries, and texts to values of the object's type."""

from __future__ import annotations

import re
from pathlib import Path

from axisbus.cell.quantities import UnitConversion, parse_quantity
from axisbus.cell.writes import resolve
from axisbus.cia301.datatypes import DataType, Value
from axisbus.cia402.axes import own_index
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.eds.model import Eds, Object
from axisbus.errors import ArgumentError, UserError

_INDEX = re.compile(r"(?:0x)?([0-9a-f]{4})h?", re.IGNORECASE)
_SHORT = re.compile(r"([iuf])(\d{1,2})", re.IGNORECASE)
_LETTERS = {"i": "INTEGER", "u": "UNSIGNED", "f": "REAL"}
_TEXT = (DataType.VISIBLE_STRING, DataType.UNICODE_STRING)
_REAL = (DataType.REAL32, DataType.REAL64)
_BOOLEANS = {"true": 1, "false": 0}


def find(dictionary: Dictionary, text: str, drive_axis: int = 1) -> list[DictionaryEntry]:
    """Return the entries of ``text``: one by index and sub-index or by name, or all of an ARRAY or RECORD.

    Examples: ``6041``, ``0x6041``, ``1018:1``, ``Position actual value`` or ``position_actual_value``. ``drive_axis`` shifts the
    profile objects of the first axis to those of another axis of the same device.

    Raises:
        ArgumentError: there is no such object; the remedy names similar ones.
    """
    name = text.replace("_", " ").strip()
    record = _record(dictionary.eds, name) if dictionary.eds is not None else None
    if record is not None:
        index = own_index(record.index, drive_axis)
        return [dictionary.entry(index, subindex) for subindex in record.subs]
    try:
        return [resolve(text, dictionary, drive_axis)]
    except ArgumentError:
        if name == text:
            raise
    return [resolve(name, dictionary, drive_axis)]


def spelling(name: str) -> str:
    """Return an object's name as one word for a command line: ``Position_actual_value``."""
    return "_".join(name.split())


def data_type(text: str) -> DataType:
    """Return the data type of ``text``: a name of CiA 301 (``UNSIGNED16``), or ``u16``, ``i32``, ``f32`` and the like.

    Raises:
        ArgumentError: it names no data type.
    """
    found = _SHORT.fullmatch(text)
    name = f"{_LETTERS[found[1].lower()]}{found[2]}" if found is not None else text.upper()
    if name not in DataType.__members__:
        raise ArgumentError(
            f"{text!r} is not a data type",
            remedy="write UNSIGNED16 (or u16), INTEGER32 (i32), REAL32, VISIBLE_STRING ...",
        )
    return DataType[name]


def value(
    text: str,
    entry: DictionaryEntry,
    kind: DataType | None,
    quantity: UnitConversion | None = None,
    *,
    files: bool = True,
) -> Value:
    """Parse a value for an object of type ``kind``: ``100``, ``0x1F``, ``90 deg`` (``quantity``), text, or hexadecimal digits.

    For an OCTET_STRING or DOMAIN, ``@file`` stands for the bytes of a file. Set ``files`` to false for users who must not read
    files of this computer.

    Raises:
        ArgumentError: it is no value of this type, or the type is unknown.
        UserError: the file cannot be read.
    """
    if kind is None:
        raise ArgumentError(
            f"{entry}: its data type is not known",
            remedy="give the node's EDS, or the type with --type, such as --type u16",
        )
    if kind in _TEXT:
        return text
    if kind in _REAL:
        return _real(text, entry, kind)
    return _integer(text, entry, kind, quantity) if kind.integer else _octets(text, entry, kind, files=files)


def _record(eds: Eds, name: str) -> Object | None:
    found = _INDEX.fullmatch(name)
    entry = eds.objects.get(int(found[1], 16)) if found is not None else None
    if entry is None:
        entry = next((each for each in eds if each.is_record and each.name.lower() == name.lower()), None)
    return entry if entry is not None and entry.is_record else None


def _integer(text: str, entry: DictionaryEntry, kind: DataType, quantity: UnitConversion | None) -> int:
    if text.lower() in _BOOLEANS and kind is DataType.BOOLEAN:
        return _BOOLEANS[text.lower()]
    increments = parse_quantity(text, quantity)
    if increments is not None:
        return increments
    try:
        return int(text, 0)
    except ValueError:
        unit = f", or a value in {quantity.unit}" if quantity is not None else ""
        raise ArgumentError(
            f"{entry}: {text!r} is not a whole number, the object is {kind.name}",
            remedy=f"write 100 or 0x64{unit}",
        ) from None


def _real(text: str, entry: DictionaryEntry, kind: DataType) -> float:
    try:
        return float(text)
    except ValueError:
        raise ArgumentError(f"{entry}: {text!r} is not a number, the object is {kind.name}") from None


def _octets(text: str, entry: DictionaryEntry, kind: DataType, *, files: bool) -> bytes:
    if files and text.startswith("@"):
        try:
            return Path(text[1:]).read_bytes()
        except OSError as error:
            raise UserError(f"{text[1:]} cannot be read", observed=str(error)) from error
    digits = "write hexadecimal digits (01FF)"
    try:
        return bytes.fromhex(text.removeprefix("0x"))
    except ValueError:
        raise ArgumentError(
            f"{entry}: {text!r} are not bytes, the object is {kind.name}",
            remedy=f"{digits}, or @file for a file's bytes" if files else digits,
        ) from None
