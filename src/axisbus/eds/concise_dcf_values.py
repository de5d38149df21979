"""Convert a DCF to a concise DCF and back: the values to write, their order, and the values of the writes.

Theory of operation. A PDO accepts a new mapping only while it is disabled and its mapping count is 0. Therefore the writes of one
PDO are: COB-ID with bit 31 set, the other communication parameters, mapping count 0, the mapping entries, the count, the final
COB-ID (CiA 301 7.5.2.36). 1020h (Verify configuration) comes last, because it confirms that the configuration is complete.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import decode, encode, size_in_bytes
from axisbus.cia402.objects import order
from axisbus.eds import assign, dcf
from axisbus.eds.concise import ConciseWrite
from axisbus.eds.io.new_file import written
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.io.text import Section
from axisbus.eds.io.values import Default
from axisbus.eds.model import Eds, Number, Variable
from axisbus.errors import EdsError
from axisbus.wording import counted

VERIFY = 0x1020

_REFUSE_WRITE = 1  # bit 0 of ObjFlags (DS 306 4.6.3.3)
_INVALID = 1 << 31
_TO_MAPPING = o.RPDO_MAPPING - o.RPDO_COMMUNICATION


_DIGITS = 3  # of a sub-index, which is decimal in [xxxxValue]

_Key = tuple[int, int]


class Configuration(NamedTuple):
    """The writes that configure a node, in order, and the entries with a value of their own that are not written.

    Left out are entries that are not writable, entries whose ObjFlags refuse a download, and objects that act when written.
    """

    writes: tuple[ConciseWrite, ...]
    left_out: tuple[Variable, ...]


def configuration(reading: EdsParseResult, node_id: int | None = None) -> Configuration:
    """Return the writes of a DCF: the values that differ from the defaults, for ``node_id`` (else the file's own).

    If a value of a PDO differs, all writes for changing the PDO are included: disable it, write its whole mapping, enable it.

    Raises:
        EdsError: a ParameterValue is not valid or needs a node-ID that is not given; or a PDO changes, and the file does not
            contain its COB-ID or mapping.
    """
    eds = reading.eds
    node = eds.node_id if node_id is None else node_id
    check_understood(reading)
    chosen: dict[_Key, bytes] = {}
    left_out = []
    for variable in dcf.differing(eds, node):
        if not variable.writable or variable.object_flags & _REFUSE_WRITE or order(variable.index):
            left_out.append(variable)
        else:
            chosen[variable.index, variable.subindex] = _data(eds, variable, variable.parameter_value, node)
    return Configuration(tuple(_ordered(eds, chosen, node)), tuple(left_out))


def check_understood(reading: EdsParseResult) -> None:
    """Raise EdsError if the file gives a parameter value that does not fit the type of its entry."""
    for section, key, index, subindex in _given(reading):
        variable = reading.eds.get(index, subindex)
        if section.entries.get(key) and variable is not None and variable.parameter_value is None:
            line, _ = reading.document.location(section, key)
            raise EdsError(
                f"{section.entries[key][:40]!r} cannot be written to {index:04X}h:{subindex:02X}",
                file=reading.eds.source,
                line=line,
                observed=f"it is not a value of {variable.data_type.name}",
                remedy="correct the value: axisbus eds check",
            )


def _given(reading: EdsParseResult) -> Iterator[tuple[Section, str, int, int]]:
    """Yield section, key, index and sub-index of each possible parameter value in the file."""
    parts = reading.parts
    for index, head in parts.heads.items():
        yield head, "parametervalue", index, 0
    for index, subs in parts.subs.items():
        for subindex, section in subs.items():
            yield section, "parametervalue", index, subindex
    for (index, kind), section in parts.list_sections.items():
        for key in section.entries if kind == "value" else ():
            if key.isdecimal() and len(key) <= _DIGITS:
                yield section, key, index, int(key)


def _data(eds: Eds, variable: Variable, value: Default, node: int | None) -> bytes:
    """Return a value as SDO sends it."""
    where = f"{variable.index:04X}h:{variable.subindex:02X} ({variable.name})"
    if isinstance(value, Number):
        if value.plus_node_id and node is None:
            raise EdsError(
                f"{where} depends on the node ID", file=eds.source, remedy="give the node ID: --node 5"
            )
        value = value.resolve(node)
    if value is None:
        raise EdsError(
            f"the file gives no value of {where}",
            file=eds.source,
            remedy=f"set it: --set 0x{variable.index:04X}:{variable.subindex:X}=...",
        )
    return encode(value, variable.data_type, where)


def _ordered(eds: Eds, chosen: Mapping[_Key, bytes], node: int | None) -> Iterator[ConciseWrite]:
    """Yield the writes: first all others, then PDO by PDO, then 1020h."""
    touched = {first for index, _ in chosen if (first := o.pdo_of(index)) is not None}
    for (index, subindex), data in sorted(chosen.items()):
        if o.pdo_of(index) is None and index != VERIFY:
            yield ConciseWrite(index, subindex, data)
    for index in sorted(touched):
        yield from _Pdo(eds, index, chosen, node).writes()
    for (index, subindex), data in sorted(chosen.items()):
        if index == VERIFY:
            yield ConciseWrite(index, subindex, data)


class _Pdo:
    """The writes of one changed PDO, from the chosen values and the other values of the file; frozen."""

    def __init__(self, eds: Eds, communication: int, chosen: Mapping[_Key, bytes], node: int | None) -> None:
        self._eds = eds
        self._communication = communication
        self._mapping = communication + _TO_MAPPING
        self._chosen = chosen
        self._node = node

    def writes(self) -> Iterator[ConciseWrite]:
        """Yield all writes of the PDO, in the order of CiA 301 7.5.2.36 and 7.5.2.38."""
        cob = self._writable(self._communication, o.PDO_COB_ID)
        final = 0 if cob is None else int.from_bytes(self._value(cob), "little")
        if cob is not None:
            yield ConciseWrite(cob.index, cob.subindex, (final | _INVALID).to_bytes(4, "little"))
        for (index, subindex), data in sorted(self._chosen.items()):
            if index == self._communication and subindex != o.PDO_COB_ID:
                yield ConciseWrite(index, subindex, data)
        if any(index == self._mapping for index, _ in self._chosen):
            yield from self._mapped()
        if cob is not None and not final & _INVALID:
            yield ConciseWrite(cob.index, cob.subindex, final.to_bytes(4, "little"))

    def _mapped(self) -> Iterator[ConciseWrite]:
        count = self._writable(self._mapping, 0)
        if count is None:  # the number is fixed, but single entries can be changed
            yield from (
                ConciseWrite(*key, data)
                for key, data in sorted(self._chosen.items())
                if key[0] == self._mapping
            )
            return
        number = self._value(count)
        yield ConciseWrite(self._mapping, 0, bytes(len(number)))
        for subindex in range(1, int.from_bytes(number, "little") + 1):
            entry = assign.at(self._eds, self._mapping, subindex)
            if entry.writable:
                yield ConciseWrite(self._mapping, subindex, self._value(entry))
        yield ConciseWrite(self._mapping, 0, number)

    def _writable(self, index: int, subindex: int) -> Variable | None:
        variable = self._eds.get(index, subindex)
        return variable if variable is not None and variable.writable else None

    def _value(self, variable: Variable) -> bytes:
        """Return the final value of an entry: the chosen one, else the value after power-up."""
        data = self._chosen.get((variable.index, variable.subindex))
        if data is not None:
            return data
        value = variable.parameter_value if variable.parameter_value is not None else variable.default
        return _data(self._eds, variable, value, self._node)


def parameters(eds: Eds, writes: Iterable[ConciseWrite]) -> list[tuple[Variable, str]]:
    """Return the values of a concise DCF by entry of the file, in the notation of an EDS; of several writes the last counts.

    Raises:
        ArgumentError: the file has no such entry.
        EdsError: the size of a write differs from the entry's type.
    """
    last = {(write.index, write.subindex): write.data for write in writes}
    return [(variable := assign.at(eds, *key), _text(eds, variable, data)) for key, data in last.items()]


def _text(eds: Eds, variable: Variable, data: bytes) -> str:
    size = size_in_bytes(variable.data_type)
    if size is not None and size != len(data):
        raise EdsError(
            f"{variable.index:04X}h:{variable.subindex:02X} ({variable.name}) takes {counted(size, 'octet')}",
            file=eds.source,
            observed=f"the concise DCF has {len(data)}: {data[:16].hex(' ')}",
            remedy="take the file of the device that the concise DCF is for",
        )
    value = decode(data, variable.data_type)
    return written(Number(value) if isinstance(value, int) else value, variable.data_type)
