"""The short forms of DS 306: sub-indices by CompactSubObj (4.6.3.2), PDO parameters by CompactPDO (4.5)."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

from axisbus.cia301 import objects
from axisbus.cia301.datatypes import DataType
from axisbus.eds.io.values import Default
from axisbus.eds.model import Number, Object, ObjectType, Variable, variable

MAX_ENTRIES = 254  # sub-index 0 holds their number, FFh is reserved (CiA 301 7.4.4)
MAPPED_OBJECTS = 8  # entries of an implicit mapping: one per byte of the frame

_U8, _U16, _U32 = DataType.UNSIGNED8, DataType.UNSIGNED16, DataType.UNSIGNED32

# Bit of CompactPDO, by sub-index of the communication parameter, with its name and type (CiA 301 7.5.2.35, 7.5.2.37).
_COMMUNICATION = (
    (1, "COB-ID used by PDO", _U32),
    (2, "Transmission type", _U8),
    (3, "Inhibit time", _U16),
    (4, "Compatibility entry", _U8),
    (5, "Event-timer", _U16),
    (6, "SYNC start value", _U8),
)
_NOTHING: Mapping[str, str] = {}
_INVALID_PDO = 0x80000000
_EVENT_DRIVEN = 255


class SubIndices(Mapping[int, Variable]):
    """Sub-index 0 and ``count`` copies of ``template``, by ``names`` (decimal sub-index) or by number; and those in ``explicit``.

    An entry is made on each access, and not stored: a small file may describe millions, and only few are needed.
    """

    __slots__ = ("_count", "_explicit", "_names", "_subindices", "_template")

    def __init__(
        self,
        template: Variable,
        count: int,
        names: Mapping[str, str],
        explicit: Mapping[int, Variable] = MappingProxyType({}),
    ) -> None:
        self._template = template
        self._count = count
        self._names = names
        self._explicit = explicit
        self._subindices: Sequence[int] = range(count + 1)
        if not all(subindex in self._subindices for subindex in explicit):
            self._subindices = sorted({*self._subindices, *explicit})

    def __getitem__(self, subindex: int) -> Variable:
        found = self._explicit.get(subindex)
        if found is None:
            if subindex not in range(self._count + 1):
                raise KeyError(subindex)
            found = self._make(subindex)
        return found

    def _make(self, subindex: int) -> Variable:
        like = self._template
        if subindex == 0:
            return _count(like.index, self._count, like.line, "NrOfObjects")
        name = self._names.get(str(subindex)) or f"{like.name}{subindex}"
        return variable(
            *(like.index, subindex, name, like.data_type, like.access, like.default, like.parameter_value),
            *(like.low, like.high, like.pdo_mapping, like.object_flags, like.line, like.object_type),
            *("", _NOTHING),
        )

    def __iter__(self) -> Iterator[int]:
        return iter(self._subindices)

    def __len__(self) -> int:
        return len(self._subindices)

    def __contains__(self, subindex: object) -> bool:
        return subindex in self._subindices

    def __repr__(self) -> str:
        return repr(dict(self))

    def with_explicit(self, explicit: Mapping[int, Variable]) -> SubIndices:
        """Return the same with these entries instead of, or in addition to, those that are made."""
        return SubIndices(self._template, self._count, self._names, explicit)

    def grouped(self) -> Iterator[tuple[Variable, int]]:
        """Yield each entry with the number of entries, including itself, that differ from it only in name and sub-index."""
        if 0 not in self._explicit:
            yield self[0], 1
        copies = [subindex for subindex in range(1, self._count + 1) if subindex not in self._explicit]
        if copies:
            yield self[copies[0]], len(copies)
        yield from ((entry, 1) for entry in self._explicit.values())


def grouped(subs: Mapping[int, Variable]) -> Iterator[tuple[Variable, int]]:
    """Yield the entries of an object, each with the number of equal ones; the copies of CompactSubObj are one entry."""
    return subs.grouped() if isinstance(subs, SubIndices) else ((entry, 1) for entry in subs.values())


def valued(entry: Variable, value: Default) -> Variable:
    """Return the entry with its parameter value of ``[xxxxValue]``."""
    return replace(entry, parameter_value=value)


def denoted(entry: Variable, text: str) -> Variable:
    """Return the entry with its name of ``[xxxxDenotation]``."""
    return replace(entry, denotation=text)


class Implied(NamedTuple):
    """An object that CompactPDO implies for PDO ``number`` (from 0); a communication parameter if ``parts`` is not 0."""

    number: int
    receive: bool
    parts: int = 0


def pdos(rpdos: int, tpdos: int, parts: int, described: Container[int]) -> dict[int, Implied]:
    """Return the PDO parameters that CompactPDO (bit mask ``parts``) implies in addition to those ``described``, by index.

    ``rpdos`` and ``tpdos`` are the numbers of all PDOs (NrOfRXPDO, NrOfTXPDO). The PDOs that the file does not describe get the
    lowest free numbers.
    """
    found: dict[int, Implied] = {}
    for total, first, mapping, receive in (
        (rpdos, objects.RPDO_COMMUNICATION, objects.RPDO_MAPPING, True),
        (tpdos, objects.TPDO_COMMUNICATION, objects.TPDO_MAPPING, False),
    ):
        numbers = range(objects.PDOS_OF_A_KIND)
        missing = total - sum(first + number in described for number in numbers)
        free = [number for number in numbers if first + number not in described]
        for number in free[: max(0, missing)]:
            found[first + number] = Implied(number, receive, parts)
            if mapping + number not in described:
                found[mapping + number] = Implied(number, receive)
    return found


def pdo(index: int, implied: Implied) -> Object:
    """Return the implied object at ``index``."""
    if implied.parts:
        return _communication(index, implied.number, implied.parts, implied.receive)
    return _mapping(index, implied.number, implied.receive)


def _communication(index: int, number: int, parts: int, receive: bool) -> Object:
    subs = {
        subindex: Variable(index, subindex, name, data_type, "rw")
        for subindex, name, data_type in _COMMUNICATION
        if parts >> (subindex - 1) & 1 or subindex <= 2
    }
    subs[1] = replace(subs[1], default=_cob_id(number, receive))
    subs[2] = replace(subs[2], default=Number(_EVENT_DRIVEN))
    name = f"{'RPDO' if receive else 'TPDO'} communication parameter {number + 1}"
    count = _count(index, max(subs), 0, "Highest sub-index supported")
    return Object(index, name, ObjectType.RECORD, {0: count, **subs})


def _cob_id(number: int, receive: bool) -> Number:
    """Return the identifier of the predefined connection set for the first four PDOs; the others have none and are disabled."""
    if number >= 4:
        return Number(_INVALID_PDO)
    return Number((0x200 if receive else 0x180) + 0x100 * number, plus_node_id=True)


def _mapping(index: int, number: int, receive: bool) -> Object:
    count = replace(_count(index, 0, 0, "Number of mapped objects"), access="rw")
    entries = {
        subindex: Variable(index, subindex, f"Mapped object {subindex}", _U32, "rw", Number(0))
        for subindex in range(1, MAPPED_OBJECTS + 1)
    }
    name = f"{'RPDO' if receive else 'TPDO'} mapping parameter {number + 1}"
    return Object(index, name, ObjectType.RECORD, {0: count, **entries})


def _count(index: int, count: int, line: int, name: str) -> Variable:
    return Variable(index, 0, name, _U8, "ro", Number(count), line=line)
