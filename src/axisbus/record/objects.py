"""Objects that are read beside a recording, one after the other, by SDO: as often as a small share of the bus allows."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from axisbus.cell.model import CellConfig
from axisbus.cia301.datatypes import Value
from axisbus.cia402.axes import own_index
from axisbus.eds.dictionary import Dictionary
from axisbus.errors import ArgumentError, SdoError, StateError
from axisbus.record.happenings import Watched

_SHARE = 0.05  # of the bus
_BITS = 260  # of a request and its answer, with stuff bits
_SLOWEST = 125_000  # bit/s, where the cell file gives none


@dataclass(slots=True)
class _Wanted:
    label: str
    node: int
    index: int
    subindex: int
    name: str
    reads: int = 0


class ObjectReads:
    """Reads what was asked for, in turn; holds how often each was, and when the next is due. For one thread."""

    def __init__(self, machine: Watched, wanted: Iterable[str]) -> None:
        """``wanted``: such as ``x:6074``, ``x:6099:01`` or ``3:1001``: of an axis or a node, by index or name.

        Raises:
            ArgumentError, StateError: no such object, axis or node.
        """
        self._machine = machine
        self._wanted = [_found(machine, text) for text in dict.fromkeys(wanted)]
        self._interval = _BITS / (machine.cell.bus.bitrate or _SLOWEST) / _SHARE
        self._due = 0.0
        self._next = 0

    def __iter__(self) -> Iterator[tuple[str, str]]:
        """Yield the label and the name of each."""
        return ((one.label, one.name) for one in self._wanted)

    def wait(self, most: float) -> float:
        """Return how many seconds there is nothing to do, at most ``most``."""
        return most if not self._wanted else min(most, max(0.0, self._due - time.monotonic()))

    def read_next(self) -> tuple[str, Value | None] | None:
        """Read the one whose turn it is and return its label and value (None: no answer); None where none is due. Blocks."""
        if not self._wanted or time.monotonic() < self._due:
            return None
        one = self._wanted[self._next]
        self._next = (self._next + 1) % len(self._wanted)
        self._due = time.monotonic() + self._interval
        try:
            value: Value | None = self._machine.node(one.node).sdo[one.index, one.subindex]
        except SdoError:
            value = None
        one.reads += value is not None
        return one.label, value

    @property
    def reads(self) -> Mapping[str, int]:
        """How often each has been read."""
        return {one.label: one.reads for one in self._wanted}


def _found(machine: Watched, text: str) -> _Wanted:
    where, colon, key = text.partition(":")
    if not colon or not key:
        raise ArgumentError(
            f"{text!r} names no object to record", remedy="write it as x:6074, x:6099:01 or 3:1001"
        )
    node_id, drive_axis = _place(machine.cell, where)
    entry = Dictionary(machine.node(node_id).eds, node_id).resolve(key)
    return _Wanted(text, node_id, own_index(entry.index, drive_axis), entry.subindex, entry.name)


def _place(cell: CellConfig, where: str) -> tuple[int, int]:
    if where in cell.axes:
        return cell.axes[where].node, cell.axes[where].drive_axis
    if where.isdecimal() and int(where) in cell.nodes:
        return int(where), 1
    if where.isdecimal():
        raise StateError(
            f"the cell has no node {where}", observed=f"it has {', '.join(map(str, cell.nodes))}"
        )
    raise cell.no_axis(where)
