"""Measure the bus load: the bits of a frame with its stuff bits, and a meter that adds them up by node and by service."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

from axisbus.bus.link import controller
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import canopen_nodes, node_frames
from axisbus.cell.pdo_plan import travelling
from axisbus.check.context import CheckContext
from axisbus.check.cycle_schedule import per_cycle
from axisbus.cia301.frame import UNSTUFFED, CanFrame, plain_bits, worst_bits
from axisbus.eds.model import Eds

WINDOW = 0.1  # seconds
_CRC = 0x4599  # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1 (ISO 11898-1)
_RUN = 5  # equal bits after which an inverse bit is stuffed in


def actual_bits(frame: CanFrame) -> int:
    """Return the actual bits of a frame, with the stuff bits counted in identifier, data and CRC."""
    return _actual(frame.can_id, frame.data[:8], frame.extended, frame.remote)


@lru_cache(maxsize=1 << 14)  # most frames of a bus repeat
def _actual(can_id: int, data: bytes, extended: bool, remote: bool) -> int:
    bits = _head(can_id, len(data), extended, remote)
    bits += "".join(f"{octet:08b}" for octet in data)
    bits += f"{_crc(bits):015b}"
    return len(bits) + _stuffed(bits) + UNSTUFFED


def _head(can_id: int, length: int, extended: bool, remote: bool) -> str:
    """Return the bits from start of frame to data length code; dominant is 0."""
    rtr = "1" if remote else "0"
    if not extended:
        return f"0{can_id & 0x7FF:011b}{rtr}00{length:04b}"
    return f"0{can_id >> 18 & 0x7FF:011b}11{can_id & 0x3FFFF:018b}{rtr}00{length:04b}"


def _crc(bits: str) -> int:
    register = 0
    for bit in bits:
        inverted = (register >> 14 & 1) ^ (bit == "1")
        register = (register << 1) & 0x7FFF
        if inverted:
            register ^= _CRC
    return register


def _stuffed(bits: str) -> int:
    """Count stuff bits; a stuff bit begins a new run."""
    count, run, last = 0, 0, ""
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == _RUN:
            count += 1
            last, run = ("1" if bit == "0" else "0"), 1
    return count


@dataclass(slots=True)
class LoadShare:
    """The frames and bits of a part of the traffic; holds state: it grows while frames are added."""

    frames: int = 0
    bits: int = 0
    worst: int = 0

    def add(self, bits: int, worst: int) -> None:
        """Add a frame of ``bits`` bits, ``worst`` bits with the maximum number of stuff bits."""
        self.frames += 1
        self.bits += bits
        self.worst += worst


@dataclass(frozen=True, slots=True)
class PeakLoad:
    """The load of the fullest 100 ms: ``load`` from 0 to 1, and the time of its last frame."""

    load: float = 0.0
    time: float = 0.0


@dataclass(frozen=True)
class MeasuredLoad:
    """The load measured during ``seconds`` at ``bitrate`` (bit/s); ``by_node`` has None for frames of no node."""

    bitrate: int
    seconds: float
    total: LoadShare
    by_node: Mapping[int | None, LoadShare]
    by_kind: Mapping[str, LoadShare]
    peak: PeakLoad
    errors: Mapping[str, int]  # error frames by kind

    @property
    def error_frames(self) -> int:
        """The number of error frames."""
        return sum(self.errors.values())

    def load(self, share: LoadShare) -> float:
        """Return the bus load of a share, from 0 to 1, with the actual stuff bits."""
        return share.bits / (self.bitrate * self.seconds)

    def worst(self, share: LoadShare) -> float:
        """Return the bus load of a share, from 0 to 1, with the maximum number of stuff bits."""
        return share.worst / (self.bitrate * self.seconds)


@dataclass
class Meter:
    """Add up frames in the order of their times; holds state: the sums, and the frames of the last 100 ms."""

    bitrate: int
    total: LoadShare = field(default_factory=LoadShare)
    by_node: dict[int | None, LoadShare] = field(default_factory=dict)
    by_kind: dict[str, LoadShare] = field(default_factory=dict)
    errors: Counter[str] = field(default_factory=Counter)
    peak: PeakLoad = PeakLoad()
    first: float | None = None
    last: float = 0.0
    _window: deque[tuple[float, int]] = field(default_factory=deque)
    _in_window: int = 0

    def add(self, frame: CanFrame, kind: str, node: int | None) -> None:
        """Add a frame of a service and a node (None: of no node); an error frame is only counted."""
        if frame.error:
            self.errors[controller.kind(frame.can_id, frame.data)] += 1
            return
        bits, worst = actual_bits(frame), worst_bits(len(frame.data), frame.extended)
        shares = (
            self.total,
            self.by_node.setdefault(node, LoadShare()),
            self.by_kind.setdefault(kind, LoadShare()),
        )
        for share in shares:
            share.add(bits, worst)
        self.first = frame.time if self.first is None else min(self.first, frame.time)
        self.last = max(self.last, frame.time)
        self._slide(frame.time, bits)

    def result(self, seconds: float | None = None) -> MeasuredLoad | None:
        """Return the sums over ``seconds`` (None: from the first frame to the last); None if that time is 0."""
        duration = seconds if seconds is not None else self.last - (self.first or 0.0)
        if duration <= 0:
            return None
        return MeasuredLoad(
            self.bitrate, duration, self.total, self.by_node, self.by_kind, self.peak, dict(self.errors)
        )

    def _slide(self, time: float, bits: int) -> None:
        self._window.append((time, bits))
        self._in_window += bits
        while len(self._window) > 1 and self._window[0][0] <= time - WINDOW:
            self._in_window -= self._window.popleft()[1]
        load = self._in_window / (self.bitrate * WINDOW)
        if load > self.peak.load:
            self.peak = PeakLoad(load, time)


# -- The expected traffic of a cell: the rate of each frame after boot, by node and by service -------------------------


@dataclass(frozen=True, slots=True)
class TrafficStream:
    """Frames of one kind: ``node`` is None for frames of no node, ``rate`` in frames per second."""

    node: int | None
    kind: str
    name: str
    rate: float
    data_bytes: int
    extended: bool = False

    @property
    def least(self) -> float:
        """Bits per second without any stuff bit."""
        return self.rate * plain_bits(self.data_bytes, self.extended)

    @property
    def worst(self) -> float:
        """Bits per second with the maximum number of stuff bits."""
        return self.rate * worst_bits(self.data_bytes, self.extended)


def streams(cell: CellConfig, files: Mapping[int, Eds]) -> list[TrafficStream]:
    """Return the traffic while the cell runs: SYNC, PDOs, heartbeats, and the requests and targets of CAN Simple modules.

    SDO and EMCY come irregularly and are not included.
    """
    return [stream for stream in _all(cell, files) if stream.rate > 0]


def _all(cell: CellConfig, files: Mapping[int, Eds]) -> Iterator[TrafficStream]:
    bus = cell.bus
    if bus.sync:
        yield TrafficStream(None, "SYNC", "SYNC", 1 / bus.scan_period, 0)
    for node, eds, dictionary in CheckContext(cell, files).nodes:
        for receive, pdo in travelling(cell, node, eds, dictionary):
            kind = "RPDO" if receive else "TPDO"
            rate = per_cycle(pdo, receive, cell, node.node_id) / bus.scan_period
            yield TrafficStream(node.node_id, kind, f"{kind}{pdo.number}", rate, pdo.size, pdo.cob_id > 0x7FF)
    if bus.heartbeat is not None:
        for node_id in (*canopen_nodes(cell), bus.master_id):
            yield TrafficStream(node_id, "heartbeat", "heartbeat", 1 / bus.heartbeat, 1)
    for each in node_frames(cell):
        yield TrafficStream(each.node, each.kind, each.name, each.rate, each.data_bytes)
