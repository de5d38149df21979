"""One axis of a device as its EDS and the cell file describe it: its objects, and their values after boot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, NamedTuple

from axisbus.cell import scale_proposal
from axisbus.cell.model import AxisConfig, CellConfig, NodeConfig
from axisbus.cell.quantities import units_of
from axisbus.cell.writes import CellWrite, implied_writes, initial, known_writes
from axisbus.cia301.datatypes import Value
from axisbus.cia402 import objects
from axisbus.cia402.axes import PROFILE_AREA, first_axis, indices_of, own_index
from axisbus.cia402.modes import FACTS, ModeOfOperation, needed, supported
from axisbus.drives.registry import make_of
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.eds.model import Eds, Variable
from axisbus.motion.parameters import Units
from axisbus.units import toward_zero, whole_above, whole_below


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


# -- The limits that ``limits_in_drive`` writes into a drive, where they also apply without a master -----------------------
#
# Limits are rounded inwards, so that the drive allows no more than the master does. The maximum motor speed (6080h, in whole
# revolutions per minute) is rounded up: it is a coarse limit in addition to 607Fh, and must not slow down an axis at its limit.

LIMITS_IN_DRIVE = "limits_in_drive"


class Limit(NamedTuple):
    """One limit of the cell file (``key``) and its object in the drive; ``value`` None: not expressible in the drive's unit."""

    key: str
    number: int
    subindex: int
    value: int | None


def wanted_limits(
    axis: AxisConfig, dictionary: Dictionary, writes: Sequence[CellWrite] = ()
) -> Iterator[Limit]:
    """Yield the limits that the drive should hold; ``writes``: the other writes of the cell file to the drive."""
    if not axis.limits_in_drive:
        return
    units = units_of(axis)
    if axis.position_limits is not None:
        low, high = sorted(edge * units.position.factor for edge in axis.position_limits)
        yield Limit("position_limits", objects.SOFTWARE_POSITION_LIMIT, 1, whole_above(low))
        yield Limit("position_limits", objects.SOFTWARE_POSITION_LIMIT, 2, whole_below(high))
    if axis.max_velocity is not None:
        fastest = whole_below(axis.max_velocity * abs(units.velocity.factor))
        yield Limit("max_velocity", objects.MAX_PROFILE_VELOCITY, 0, fastest or None)
        yield Limit("max_velocity", objects.MAX_MOTOR_SPEED, 0, _motor_speed(axis, units, dictionary, writes))
    if axis.max_torque is not None:
        most = None if not axis.rated_torque else toward_zero(axis.max_torque / axis.rated_torque * 1000)
        yield Limit("max_torque", objects.MAX_TORQUE, 0, most or None)


def limit_writes(
    axis: AxisConfig, dictionary: Dictionary, writes: Sequence[CellWrite] = ()
) -> list[CellWrite]:
    """Return the writes of ``limits_in_drive``: limits for which the drive has objects, and that no other entry writes."""
    given = {write.address for write in writes}
    return [
        CellWrite(
            index,
            limit.subindex,
            limit.value,
            axis.at.of(LIMITS_IN_DRIVE),
            f"{limit.key} by {LIMITS_IN_DRIVE} in [{axis.at.name}]",
        )
        for limit in wanted_limits(axis, dictionary, writes)
        if limit.value is not None
        and (index := own_index(limit.number, axis.drive_axis), limit.subindex) not in given
        and dictionary.has(index, limit.subindex) is not False
    ]


def limits_left_out(
    axis: AxisConfig, dictionary: Dictionary, writes: Sequence[CellWrite] = ()
) -> Iterator[Limit]:
    """Yield the limits that cannot be written into the drive."""
    addresses = {write.address for write in writes}
    for limit in wanted_limits(axis, dictionary, writes):
        if (own_index(limit.number, axis.drive_axis), limit.subindex) not in addresses:
            yield limit


def _motor_speed(
    axis: AxisConfig, units: Units, dictionary: Dictionary, writes: Sequence[CellWrite]
) -> int | None:
    """Return 6080h in revolutions per minute; None unless 608Fh and the scale agree on the increments of a revolution."""
    written = {write.address: write.value for write in writes}

    def value(index: int, subindex: int) -> int | None:
        address = own_index(index, axis.drive_axis), subindex
        found = written.get(address, initial(dictionary, axis.node, *address))
        return found if isinstance(found, int) else None

    values = {address: value(*address) for address in scale_proposal.OBJECTS}
    increments, turns = values[objects.ENCODER_RESOLUTION, 1], values[objects.ENCODER_RESOLUTION, 2]
    if not increments or not turns or not scale_proposal.compare(units.position, values).agrees:
        return None
    per_minute = Fraction(axis.max_velocity or 0) * abs(units.position.exact) * 60 * turns / increments
    return math.ceil(per_minute)
