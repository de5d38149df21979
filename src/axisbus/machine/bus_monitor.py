"""The traffic of a bus, by node: NMT states, heartbeats, newest PDOs, and the events since the last call."""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import fmean

from axisbus.cell.model import CellConfig
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.master_detection import MasterDetector
from axisbus.cia301.nmt import NmtState
from axisbus.core.master_detection import expected_masters_of
from axisbus.drives.foreign_protocols import ForeignProtocols
from axisbus.eds.model import Eds
from axisbus.trace import context
from axisbus.trace.decoded import Decoded, FrameKind, TraceErrorCounters
from axisbus.trace.decoder import Decoder
from axisbus.trace.other_protocols import part_for

_INTERVALS = 64  # number of last frames from which a period is calculated
_NEWS = 50  # events stored between two calls; further ones are counted
_OF_A_KIND = 5  # maximum of them for one service and node
_LASTING = frozenset({FrameKind.TPDO, FrameKind.RPDO, FrameKind.SDO})  # the newest frame is displayed
_HAPPENING = frozenset(
    {FrameKind.NMT, FrameKind.EMCY, FrameKind.BOOT_UP, FrameKind.LSS, FrameKind.ERROR_FRAME}
)
_PDO = re.compile(r"[ ,:]")  # follows the name of a PDO in its description
_STATE = 0x7F


@dataclass(slots=True)
class Beat:
    """A recurring frame. State: the adapter's times of the last frames, and the local time at which the newest arrived."""

    times: deque[float] = field(default_factory=lambda: deque(maxlen=_INTERVALS + 1))
    taken: float = 0.0

    def add(self, time: float, now: float) -> None:
        """Add the next frame."""
        self.times.append(time)
        self.taken = now

    @property
    def intervals(self) -> tuple[float, float, float] | None:
        """Mean, shortest and longest of the last intervals in seconds; None before the second one."""
        found = [after - before for before, after in pairwise(self.times)]
        return (fmean(found), min(found), max(found)) if found else None


@dataclass(slots=True)
class Newest:
    """The newest frame of a kind. State: the frame, the local time of its arrival, and the count of such frames."""

    one: Decoded
    taken: float
    count: int = 1


@dataclass(slots=True)
class NodeHeard:
    """The traffic of one node. ``state`` is None until the node has reported one; ``newest`` is by PDO or service."""

    node_id: int
    name: str = ""
    state: NmtState | None = None
    beat: Beat = field(default_factory=Beat)
    newest: dict[str, Newest] = field(default_factory=dict)
    frames: int = 0


class BusMonitor:
    """Takes the frames of a bus. State: all traffic so far, and the events since the last ``take_news``."""

    def __init__(self, cell: CellConfig, files: Mapping[int, Eds]) -> None:
        """Begin with the nodes of a cell, without any traffic."""
        found = context.of_cell(cell, files)
        self.nodes = {node.node_id: NodeHeard(node.node_id, node.name) for node in found.nodes.values()}
        self.nodes |= {node_id: NodeHeard(node_id, other.name) for node_id, other in found.others.items()}
        self._beats = {part_for(other.protocol).heartbeat(node_id) for node_id, other in found.others.items()}
        self.sync = Beat()
        self.signs = MasterDetector(expected_masters_of(cell, files))
        self.frames = 0
        self.unknown = 0
        self.missed = 0  # events that were too many to store
        self.tally = TraceErrorCounters()
        self._of_a_kind: Counter[tuple[FrameKind, int | None]] = Counter()  # events since the last call
        self._news: deque[Decoded] = deque(maxlen=_NEWS)
        self._decoder = Decoder(found)

    def feed(self, frame: CanFrame, now: float) -> None:
        """Take a frame; ``now`` is its arrival time by the listener's clock."""
        one = self._decoder.feed(frame)
        self.tally.note(one)
        self.frames += 1
        self.signs.note(frame)
        if one.kind is FrameKind.SYNC:
            self.sync.add(frame.time, now)
        if one.kind is FrameKind.UNKNOWN:
            self.unknown += 1
        if one.node is not None:
            self._of_node(one, now)
        if one.kind in _HAPPENING or one.trouble:
            self._note(one)

    @property
    def foreign(self) -> ForeignProtocols:
        """The nodes that use a protocol other than CANopen."""
        return self._decoder.foreign

    def take_news(self) -> list[Decoded]:
        """Return the events since the last call: NMT commands, boot-ups, EMCYs, LSS, error frames, and any irregular frame."""
        news = list(self._news)
        self._news.clear()
        self._of_a_kind.clear()
        return news

    def _note(self, one: Decoded) -> None:
        """Store an event, but only a few of one service and node: a faulty node must not hide the events of the others."""
        key = one.kind, one.node
        self._of_a_kind[key] += 1
        if self._of_a_kind[key] > _OF_A_KIND:
            self.missed += 1
            return
        self.missed += len(self._news) == _NEWS
        self._news.append(one)

    def _of_node(self, one: Decoded, now: float) -> None:
        assert one.node is not None
        node = self.nodes.setdefault(one.node, NodeHeard(one.node, one.name))
        if one.from_node:
            node.frames += 1
            self._state(node, one, now)
        if one.kind in _LASTING or one.frame.can_id in self._beats:
            _renew(node.newest, one, now)

    def _state(self, node: NodeHeard, one: Decoded, now: float) -> None:
        if one.kind is FrameKind.BOOT_UP:
            node.state = NmtState.PRE_OPERATIONAL
            node.beat.times.clear()
        elif one.frame.can_id in self._beats:
            node.beat.add(one.frame.time, now)
        elif one.kind in (FrameKind.HEARTBEAT, FrameKind.GUARD) and len(one.frame.data) == 1:
            node.state = NmtState(one.frame.data[0] & _STATE)
            node.beat.add(one.frame.time, now)


def _renew(newest: dict[str, Newest], one: Decoded, now: float) -> None:
    """Replace the newest frame. A PDO is identified by its name; requests for a value contain none."""
    if one.frame.remote or (one.kind is FrameKind.SDO and not one.from_node):
        return
    name = one.kind.value if one.kind is FrameKind.SDO else _PDO.split(one.what)[0]
    before = newest.get(name)
    newest[name] = Newest(one, now, 1 if before is None else before.count + 1)
