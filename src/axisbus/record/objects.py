"""Read objects for a recording by SDO, one after the other, as often as a small share of the bus load permits."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from axisbus.cell.io_signals import all_points
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import require_objects
from axisbus.cia301.datatypes import DataType, Value, decode
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.pdo import PdoLocation
from axisbus.cia401.signal import IoPoint
from axisbus.cia402.axes import own_index
from axisbus.clock import Clock
from axisbus.eds.dictionary import Dictionary
from axisbus.errors import ArgumentError, SdoError, UnknownNameError
from axisbus.record.events import Watched
from axisbus.session import MachineSession

_SHARE = 0.05  # of the bus load
_BITS = 260  # of a request and its answer, with stuff bits
_SLOWEST = 125_000  # bit/s, if the cell file has no bit rate


class ObjectReads:
    """Read the requested objects in turn; holds the number of reads of each, and when the next is due. For one thread."""

    def __init__(self, machine: Watched, wanted: Sequence[WantedObject], clock: Clock) -> None:
        self._machine = machine
        self._clock = clock
        self._wanted = list(wanted)
        self._counts = {one.label: 0 for one in wanted}
        self._interval = _BITS / (machine.cell.bus.bitrate or _SLOWEST) / _SHARE
        self._due = 0.0
        self._next = 0

    def wait(self, most: float) -> float:
        """Return the seconds until the next read, at most ``most``."""
        return most if not self._wanted else min(most, max(0.0, self._due - self._clock.now()))

    def read_next(self) -> tuple[str, Value | None] | None:
        """Read the object that is due and return its label and value (None: no answer); None if none is due. Blocks."""
        if not self._wanted or self._clock.now() < self._due:
            return None
        one = self._wanted[self._next]
        self._next = (self._next + 1) % len(self._wanted)
        self._due = self._clock.now() + self._interval
        return one.label, self._read(one)

    def _read(self, one: WantedObject) -> Value | None:
        try:
            value: Value | None = self._machine.node(one.node).sdo[one.index, one.subindex]
        except SdoError:
            value = None
        self._counts[one.label] += value is not None
        return one.to_user(value)

    @property
    def reads(self) -> Mapping[str, int]:
        """The number of reads of each object."""
        return self._counts


# -- The objects to record in addition to the axes, as users name them -------------------------------------------------


@dataclass(frozen=True, slots=True)
class WantedObject:
    """One object of a node; ``label`` is the name that the user gave, the index is the device's own.

    ``point``: the name of the input or output, if the object was requested as one.
    """

    label: str
    node: int
    index: int
    subindex: int
    name: str
    data_type: DataType | None
    point: IoPoint | None = None

    def json_type(self, *, carried: bool) -> str:
        """Return the JSON type of its values; ``carried``: by a PDO, whose untyped bits become a number.

        Bytes become hexadecimal digits.
        """
        if self.point is not None:
            return "number" if self.point.bit is None else "boolean"
        kind = self.data_type
        if kind is None:
            return "number" if carried else "string"
        return "number" if kind.integer or kind in (DataType.REAL32, DataType.REAL64) else "string"

    def to_user(self, value: Value | None) -> Value | None:
        """Return the meaning of a value of the object: for an input or output, True or False, or a number in its unit."""
        if self.point is None or not isinstance(value, int):
            return value
        return self.point.shown(self.point.of(value))


def wanted_object(machine: Watched, text: str) -> WantedObject:
    """Return the object for ``x:6074``, ``x:6099:01`` or ``3:1001`` (axis or node, index or name), or for ``lamp``.

    Raises:
        ArgumentError, StateError: no such object, axis, node, input or output.
    """
    if text in machine.cell.io:
        return _point(machine, text)
    where, colon, key = text.partition(":")
    if not colon or not key:
        raise ArgumentError(
            f"{text!r} names no object to record",
            remedy="write it as x:6074, x:6099:01 or 3:1001, or as the name of an input or output",
        )
    node_id, drive_axis = _node_and_axis(machine.cell, where)
    require_objects(machine.cell, node_id)
    entry = Dictionary(machine.node(node_id).eds, node_id).resolve(key)
    index = own_index(entry.index, drive_axis)
    return WantedObject(text, node_id, index, entry.subindex, entry.name, entry.data_type)


def _point(machine: Watched, name: str) -> WantedObject:
    """Return the object of an input or output."""
    node_id = machine.cell.io[name].node
    eds = machine.node(node_id).eds
    point = all_points(machine.cell, {node_id: eds})[name]
    entry = Dictionary(eds, node_id).resolve(f"{point.index:04X}:{point.subindex:02X}")
    unit = f" ({point.unit})" if point.unit else ""
    return WantedObject(
        name, node_id, *point.address, f"{point.object_text} of node {node_id}{unit}", entry.data_type, point
    )


def _node_and_axis(cell: CellConfig, where: str) -> tuple[int, int]:
    if where in cell.axes and cell.axes[where].virtual:
        raise cell.axes[where].no_drive("no objects")
    if where in cell.axes:
        return cell.axes[where].node, cell.axes[where].drive_axis
    if where.isdecimal() and len(where) <= 3 and int(where) in cell.nodes:
        return int(where), 1
    if where.isdecimal():
        raise UnknownNameError(
            f"the cell has no node {where}", observed=f"it has {', '.join(map(str, cell.nodes))}"
        )
    raise cell.no_axis(where)


# -- Record objects that PDOs carry: the value in each frame sent or received, without extra transfers -----------------


_MOST = 100_000  # the most values waiting to be written
_HOLD_TIME = 1.0  # seconds that a value waits


@dataclass(frozen=True, slots=True)
class MappedSignal:
    """The location of an object in a PDO, and the meaning of its bits."""

    wanted: WantedObject
    carried: PdoLocation

    @property
    def label(self) -> str:
        """The name under which it was requested."""
        return self.wanted.label

    def value(self, data: bytes) -> Value | None:
        """Return the value in a frame, None if the frame is too short."""
        _, _, shift, bits = self.carried
        if len(data) * 8 < shift + bits:
            return None
        raw = int.from_bytes(data, "little") >> shift & ((1 << bits) - 1)
        data_type = self.wanted.data_type
        value = raw if data_type is None else decode(raw.to_bytes((bits + 7) // 8, "little"), data_type)
        return self.wanted.to_user(value)


def mapped_signal(machine: Watched, wanted: WantedObject) -> MappedSignal | None:
    """Return the present place of an object in a PDO; None if no PDO carries it."""
    carried = machine.node(wanted.node).mapped_in(wanted.index, wanted.subindex)
    return None if carried is None else MappedSignal(wanted, carried)


class MappedObjects:
    """Extract the values of objects from the frames of the bus; holds those waiting to be written, and their number.

    A boot-up in a running machine may map an object to another place. A joined program learns of that a little later than it
    receives the first frames. So ``locate_again`` finds the places again, and a value waits ``_HOLD_TIME`` before it is written:
    values of an object that was mapped again are dropped if they still wait.
    """

    def __init__(self, session: MachineSession, locate: Callable[[], Sequence[MappedSignal]]) -> None:
        """``locate`` returns the objects that PDOs carry now."""
        self._session = session
        self._locate = locate
        self.signals = tuple(locate())
        self._by_id = _by_id(self.signals)
        self._values: deque[tuple[str, float, Value]] = deque(maxlen=_MOST)
        self.counts = {signal.label: 0 for signal in self.signals}
        self._listening = False

    def begin(self) -> None:
        """Start listening."""
        self._listening = True
        if self._by_id:
            self._session.tap(self._on_frames, self._by_id)

    def end(self) -> None:
        """Stop listening."""
        self._listening = False
        if self._by_id:
            self._session.untap(self._on_frames)

    def locate_again(self) -> list[str]:
        """Find the places again; return the objects that have another one. For the thread that writes."""
        signals = tuple(self._locate())
        if signals == self.signals:
            return []
        before = {signal.label: signal.carried for signal in self.signals}
        now = {signal.label: signal.carried for signal in signals}
        moved = [label for label in before if now.get(label) != before[label]]
        listening = self._listening
        if listening:
            self.end()
        self.signals, self._by_id = signals, _by_id(signals)
        for _ in range(len(self._values)):
            value = self._values.popleft()
            if value[0] not in moved:
                self._values.append(value)
        self.counts = {**dict.fromkeys(now, 0), **self.counts}
        if listening:
            self.begin()
        return moved

    def write(self, write: Callable[[str, float, Value | None], None], until: float = math.inf) -> None:
        """Call ``write(label, time, value)`` for every waiting value that came ``_HOLD_TIME`` before ``until``."""
        while self._values and self._values[0][1] <= until - _HOLD_TIME:
            label, now, value = self._values.popleft()
            write(label, now, value)
            self.counts[label] += 1

    def _on_frames(self, frames: Sequence[CanFrame]) -> None:
        for frame in frames:
            for signal in () if frame.remote else self._by_id.get(frame.can_id, ()):
                value = signal.value(frame.data)
                if value is not None:
                    self._values.append((signal.label, frame.time, value))


def _by_id(signals: Sequence[MappedSignal]) -> dict[int, list[MappedSignal]]:
    found: dict[int, list[MappedSignal]] = {}
    for signal in signals:
        found.setdefault(signal.carried.can_id, []).append(signal)
    return found
