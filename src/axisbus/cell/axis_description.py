"""One axis of a device as its EDS and the cell file describe it: its objects, and their values after boot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from axisbus.cell.drive_limits import limit_writes
from axisbus.cell.model import AxisConfig, CellConfig, NodeConfig
from axisbus.cell.writes import CellWrite, implied_writes, initial, known_writes
from axisbus.cia301.datatypes import Value
from axisbus.cia402 import objects
from axisbus.cia402.axes import PROFILE_AREA, first_axis, indices_of, own_index
from axisbus.cia402.modes import FACTS, ModeOfOperation, needed, supported
from axisbus.drives.registry import make_of
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.eds.model import Eds, Variable


def of_make(axis: AxisConfig, node: NodeConfig, eds: Eds) -> AxisConfig:
    """Return an axis with the behaviour of its drive's make for each key that the cell file leaves out."""
    keys = make_of(eds, node.makes).behaviour.of_axis()
    missing: dict[str, Any] = {key: value for key, value in keys if getattr(axis, key) is None}
    return replace(axis, **missing) if missing else axis


def by_make(axis: AxisConfig, node: NodeConfig, eds: Eds) -> str:
    """Return what ``of_make`` adds to an axis of the cell file, and the name of the make; empty if it adds nothing."""
    make = make_of(eds, node.makes)
    left = {key: None for key, _ in make.behaviour.of_axis() if getattr(axis, key) is not None}
    added = ", ".join(replace(make.behaviour, lists_modes=True, store_restarts=False, **left).lines())
    return f"{added} ({make.name})" if added else ""


def with_makes(cell: CellConfig, dictionaries: Mapping[int, Eds]) -> CellConfig:
    """Return a cell whose axes have the behaviour of their makes, where the EDS of their node is known."""
    axes = {
        name: of_make(axis, cell.nodes[axis.node], dictionaries[axis.node])
        if axis.node in dictionaries and axis.node in cell.nodes
        else axis
        for name, axis in cell.axes.items()
    }
    return replace(cell, axes=axes)


@dataclass(frozen=True)
class Drive:
    """One axis of a device, with the behaviour of its make.

    Indices are those of a single-axis drive; ``written`` maps the device's own addresses to writes.
    Settings whose key names no object are left out of ``written``.
    """

    axis: AxisConfig
    node: NodeConfig
    dictionary: Dictionary
    eds: Eds
    written: Mapping[tuple[int, int], CellWrite] = field(default_factory=dict)

    @classmethod
    def of(cls, axis: AxisConfig, node: NodeConfig, eds: Eds) -> Drive:
        """Combine an axis, its node and the node's EDS."""
        axis = of_make(axis, node, eds)
        dictionary = Dictionary(eds, node.node_id)
        writes = [
            *known_writes(node.objects, dictionary, 1),
            *known_writes(axis.objects, dictionary, axis.drive_axis),
        ]
        writes += implied_writes(axis, frozenset(write.address for write in writes))
        writes += limit_writes(axis, dictionary, writes)
        return cls(axis, node, dictionary, eds, {write.address: write for write in writes})

    def index(self, index: int) -> int:
        """Return the device's index of an object."""
        return own_index(index, self.axis.drive_axis)

    def variable(self, index: int, subindex: int = 0) -> Variable | None:
        """Return an entry of the EDS, None if the EDS does not have it."""
        return None if self.ignores(index) else self.eds.get(self.index(index), subindex)

    def entry(self, index: int, subindex: int = 0) -> DictionaryEntry:
        """Return the entry with the data type for writing it."""
        return self.dictionary.entry(self.index(index), subindex)

    def has(self, index: int) -> bool:
        """Whether the EDS has the object, and the drive acts on it."""
        return self.index(index) in self.eds and not self.ignores(index)

    def ignores(self, index: int) -> bool:
        """Whether the drive has the object, but does not act on it."""
        return index in (self.axis.ignored_objects or ())

    def missing(self, indices: tuple[int, ...]) -> tuple[int, ...]:
        """Return the ``indices`` that the drive does not have."""
        return tuple(index for index in indices if not self.has(index))

    def write(self, index: int, subindex: int = 0) -> CellWrite | None:
        """Return the cell file's write to an object, None if there is none."""
        return self.written.get((self.index(index), subindex))

    def value(self, index: int, subindex: int = 0) -> Value | None:
        """Return the value of an object after boot: the cell file's, else the EDS's, else None."""
        if self.ignores(index):
            return None
        write = self.write(index, subindex)
        if write is not None:
            return write.value
        return initial(self.dictionary, self.node.node_id, self.index(index), subindex)

    def number(self, index: int, subindex: int = 0) -> int | None:
        """Return the same as ``value``, or None if it is not an integer."""
        value = self.value(index, subindex)
        return value if isinstance(value, int) else None

    @property
    def objects(self) -> frozenset[int]:
        """The indices of this axis: its profile objects as those of a single-axis drive, and all below 6000h."""
        own = indices_of(self.axis.drive_axis)
        return frozenset(
            first_axis(index) for index in self.eds.objects if index in own or index < PROFILE_AREA.start
        ) - frozenset(self.axis.ignored_objects or ())

    @property
    def read_only(self) -> frozenset[tuple[int, int]]:
        """The profile entries of this axis that are read-only in the EDS; indices as those of a single-axis drive."""
        own = indices_of(self.axis.drive_axis)
        return frozenset(
            (first_axis(entry.index), subindex)
            for entry in self.eds
            if entry.index in own
            for subindex, variable in entry.subs.items()
            if not variable.writable
        )

    @property
    def runnable(self) -> frozenset[ModeOfOperation]:
        """The modes for which all the objects exist that a master needs."""
        return frozenset(mode for mode in FACTS if not self.missing(needed(mode)))

    @property
    def claimed(self) -> frozenset[ModeOfOperation] | None:
        """The modes that the EDS's 6502h lists, None if the EDS has no value for it."""
        value = initial(self.dictionary, self.node.node_id, self.index(objects.SUPPORTED_DRIVE_MODES), 0)
        return frozenset(supported(value)) if isinstance(value, int) else None
