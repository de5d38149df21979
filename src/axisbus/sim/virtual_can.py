"""A simulated CAN wire in virtual time, with simulated nodes on it and one adapter for each master.

Theory of operation
-------------------
A frame occupies the wire for its bits. Of the frames that wait, the one with the lowest identifier goes first; those of one sender
keep their order. When the frame has ended, it is passed to all others: at once to the nodes, whose answers then wait in the same
way, and to the masters. There are no threads: the ``VirtualClock`` calls ``run`` at each time at which something is due.

The nodes are stepped when a program's wait ends (for a cycle, for example) and when SYNC comes, unless that was just before, and at
least every ``_LONGEST_STEP`` seconds. A controlword that takes effect between two steps acts from the earlier step on.
"""

from __future__ import annotations

import errno
import heapq
import math
import random
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from threading import RLock
from typing import Generic, Protocol, TypeVar

import can

from axisbus.clock import VirtualClock
from axisbus.sim.device import Device
from axisbus.sim.node.network import ForeignNode, SimulatedLocalNode
from axisbus.sim.node.slave import Slave

_LONGEST_STEP = 0.0105  # s; a little more than the usual period of a scan, with whose cycles they are stepped
_FRESH = 0.0005  # s; nodes that were stepped so short a time ago are not stepped again at SYNC
_ID_11 = 0x7FF
_HEARTBEAT = 0xE  # the function code of error control (CiA 301 7.3.3)
_FRAME_BITS, _EXTENDED_BITS = 47, 67  # without data and stuff bits, with the space between frames
_UNSTUFFED = 13
_QUEUE = 1000  # frames of one sender that may wait for the wire
BITRATE = 1_000_000


class FrameReceiver(Protocol):
    """The receiver of an adapter's frames: a ``bus.link.channel.Channel``."""

    def take_frame(self, can_id: int, data: bytes) -> None:
        """Take a received data frame with an 11-bit identifier."""

    def take_message(self, message: can.Message) -> None:
        """Take any other frame, error frames included."""

    def take_failure(self, error: Exception) -> None:
        """Take the error of an adapter that receives nothing any more."""


@dataclass(slots=True)
class FrameFaults:
    """Faults of the frames of one identifier: the probability of their loss, and the seconds by which they are late."""

    loss: float = 0.0
    delay: float = 0.0


@dataclass(slots=True)
class WireFaults:
    """Faults of the wire; every field may be changed at any time. Probabilities are from 0 to 1, for each frame.

    loss: a frame is lost for everybody
    duplication: a frame is received twice
    corruption: a data byte is changed (as by a faulty gateway; CAN itself detects errors on the wire)
    delay: seconds by which frames to and from the masters are late, as behind a gateway
    jitter: random additional delay, at most so many seconds; the order of the frames remains
    cut: no frame passes
    sync_lost, heartbeat_lost: the masters' SYNC, or their heartbeats, do not reach the nodes
    by_id: further faults of the frames of single identifiers
    """

    loss: float = 0.0
    duplication: float = 0.0
    corruption: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    cut: bool = False
    sync_lost: bool = False
    heartbeat_lost: bool = False
    by_id: dict[int, FrameFaults] = field(default_factory=dict)


Frame = tuple[int, bytes, bool]
"""Identifier, data, and whether it is a remote frame."""


class _Sender:
    """A device on the wire; holds its frames that wait for it."""

    __slots__ = ("waiting",)

    def __init__(self) -> None:
        self.waiting: deque[Frame] = deque()


class VirtualAdapter(_Sender):
    """A master's adapter on a simulated wire, used by its ``Channel`` as its bus; holds whether it works, and its ``wire``.

    ``failure``: an exception that each send raises. ``full``: the queue accepts no frame.
    """

    thread_safe = True
    __slots__ = ("_receiver", "channel_info", "failure", "full", "off", "wire")

    def __init__(self, wire: VirtualWire) -> None:
        super().__init__()
        self.wire = wire
        self._receiver: FrameReceiver | None = None
        self.channel_info = "a simulated wire"
        self.failure: Exception | None = None
        self.full = False
        self.off = False

    def attach(self, receiver: FrameReceiver) -> None:
        """Pass all frames to ``receiver`` from now on."""
        self._receiver = receiver

    @property
    def receiver(self) -> FrameReceiver | None:
        """The receiver of its frames."""
        return self._receiver

    @property
    def calling(self) -> bool:
        """Whether the caller was called with a frame."""
        return self.wire.runs_in == threading.get_ident()

    @property
    def state(self) -> can.BusState:
        """The state of the controller."""
        return can.BusState.ERROR if self.off else can.BusState.ACTIVE

    def send(self, can_id: int, data: bytes) -> None:
        """Put a data frame into the queue.

        Raises:
            Exception: that of ``failure``. CanOperationError: the queue is full.
        """
        self._check()
        self.wire.put(self, (can_id, bytes(data), False))

    def send_remote(self, can_id: int, length: int) -> None:  # noqa: ARG002 - the answer has its own length
        """Put a remote frame into the queue; raises as ``send``."""
        self._check()
        self.wire.put(self, (can_id, b"", True))

    def send_all(self, frames: Sequence[tuple[int, bytes]]) -> int:
        """Put data frames into the queue; return how many it accepted."""
        taken = 0
        for can_id, data in frames:
            if self.failure is not None or self.full or len(self.waiting) >= _QUEUE:
                break
            self.wire.put(self, (can_id, data, False))
            taken += 1
        return taken

    def shutdown(self) -> None:
        """Leave the wire."""
        self._receiver = None
        self.wire.remove(self)

    def unplug(self) -> None:
        """Let the adapter fail: it receives nothing any more, and cannot send."""
        self.failure = OSError(errno.ENODEV, "No such device")
        self.waiting.clear()
        if self._receiver is not None:
            self._receiver.take_failure(self.failure)

    def go_off(self, off: bool) -> None:
        """Make the controller bus-off, or restart it."""
        self.off = off
        self.waiting.clear()
        if self._receiver is not None:
            kind = 0x40 if off else 0x100  # linux/can/error.h: bus-off, restarted
            self._receiver.take_message(can.Message(arbitration_id=kind, is_error_frame=True, data=bytes(8)))

    def _check(self) -> None:
        if self.failure is not None:
            raise self.failure
        if self.full or len(self.waiting) >= _QUEUE:
            raise can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)


_Kind = TypeVar("_Kind", Slave, ForeignNode)


class _Node(_Sender, Generic[_Kind]):
    """A simulated node on the wire: ``frames`` is its communication, that of CANopen (``Slave``) or of another protocol."""

    __slots__ = ("frames",)

    def __init__(self, frames: _Kind) -> None:
        super().__init__()
        self.frames: _Kind = frames


class VirtualWire:
    """One CAN wire with its nodes (``axisbus.clock.EventSource``); holds the frames that wait, and the faults of the wire."""

    def __init__(
        self,
        clock: VirtualClock,
        devices: Sequence[Device],
        foreign_nodes: Sequence[ForeignNode] = (),
        *,
        bitrate: int = BITRATE,
        seed: int = 0,
    ) -> None:
        """Put nodes on a wire with ``bitrate`` bit/s and power them up. ``seed`` is that of the random faults."""
        self.faults = WireFaults()
        self.devices = list(devices)
        self.frames = 0  # that have passed
        self.runs_in: int | None = None  # the thread in which it passes frames now
        self._clock = clock
        self._bit = 1.0 / bitrate
        self._random = random.Random(seed)
        self._nodes = [_Node(Slave(device)) for device in devices]
        self._foreign_nodes = [_Node(foreign_node) for foreign_node in foreign_nodes]
        self._all: list[_Node[Slave] | _Node[ForeignNode]] = [*self._nodes, *self._foreign_nodes]
        self._listeners: dict[int, list[_Node[Slave]]] = {}  # of the identifiers so far
        for node in self._nodes:
            node.frames.on_routes = self._listeners.clear
        self._adapters: list[VirtualAdapter] = []
        self._delayed_to_masters: deque[tuple[float, VirtualAdapter, Frame]] = (
            deque()
        )  # frames to masters behind a gateway
        self._delayed_to_nodes: deque[tuple[float, VirtualAdapter, Frame]] = deque()  # and from them
        self._senders: list[_Sender] = [*self._all]
        self._waiting = 0
        self._held: list[tuple[float, int, _Sender, Frame]] = []  # late by a fault of their identifier
        self._lossy = False  # whether some frames of masters are lost
        self._behind_gateway = False  # whether frames are held back
        self._has_answers = False  # whether a node has SDO answers to send later
        self._sending: tuple[_Sender, Frame] | None = None
        self._ends = math.inf  # of the frame on the wire
        self._stepped = -math.inf  # when the nodes were stepped last
        self._step_due = clock.now()
        self._longest_step = 0.005 if foreign_nodes else _LONGEST_STEP
        self.due = clock.now()
        clock.add(self)

    @cached_property
    def nodes(self) -> list[SimulatedLocalNode]:
        """The nodes as ``canopen.LocalNode``, for local access to their objects by ``node.sdo``."""
        return [SimulatedLocalNode(node.frames.device, RLock(), node.frames) for node in self._nodes]

    def connect(self) -> VirtualAdapter:
        """Return a new adapter on this wire."""
        adapter = VirtualAdapter(self)
        self._adapters.append(adapter)
        self._senders.append(adapter)
        return adapter

    @property
    def has_sync_producer(self) -> bool:
        """Whether a node sends SYNC by its objects (1005h, 1006h)."""
        return any(node.frames.sync.enabled for node in self._nodes)

    @property
    def masters(self) -> list[VirtualAdapter]:
        """The adapters on this wire, in the order of ``connect``."""
        return self._adapters

    def remove(self, adapter: VirtualAdapter) -> None:
        """Take an adapter from the wire; its frames that still wait are lost."""
        if adapter in self._adapters:  # new lists: a frame may be on its way to those on the old one
            self._adapters = [other for other in self._adapters if other is not adapter]
            self._senders = [other for other in self._senders if other is not adapter]
            self._waiting -= len(adapter.waiting)

    def put(self, adapter: VirtualAdapter, frame: Frame) -> None:
        """Take a frame of a master."""
        if self.faults.delay > 0.0 or self.faults.jitter > 0.0 or self._delayed_to_nodes:
            at = self._clock.now() + self._delay()
            if self._delayed_to_nodes:
                at = max(at, self._delayed_to_nodes[-1][0])
            self._delayed_to_nodes.append((at, adapter, frame))
            self._behind_gateway = True
            self.due = min(self.due, at)
            return
        self._queue(adapter, frame)

    # -- time ----------------------------------------------------------------------------------------------------------

    def run(self, now: float, until: float) -> None:
        """As ``EventSource.run``: end the frames that have passed, and step the nodes."""
        self.runs_in = threading.get_ident()
        try:
            self._run(now, until)
        finally:
            self.runs_in = None

    def _run(self, now: float, until: float) -> None:
        clock = self._clock
        while True:
            if self._ends <= now:
                assert self._sending is not None
                sender, frame = self._sending
                self._sending, self._ends = None, math.inf
                self._arrive(sender, frame, now)
                if self._sending is None and self._waiting:
                    self._begin(now)
            if now >= self._step_due:
                self._step(now)
            due = self._step_due
            if self._behind_gateway:
                due = min(due, self._pass_gateway(now))
            if self._has_answers:
                due = min(due, self._answer(now))
            if self._held:
                due = min(due, self._pass_held(now))
            if self._ends < due:
                due = self._ends
            self.due = due
            if due > until or clock.news:
                return
            if due > now:
                now = due
                clock.go_to(now)

    def catch_up(self, now: float) -> None:
        """As ``EventSource.catch_up``: step the nodes, so that their next SYNC finds them so."""
        if now - self._stepped > _FRESH:
            self._step(now)
            self.due = min(self._ends, self.due)

    def _pass_gateway(self, now: float) -> float:
        """Pass the frames that a gateway has held back; return when the next is due."""
        while self._delayed_to_nodes and self._delayed_to_nodes[0][0] <= now:
            _, adapter, frame = self._delayed_to_nodes.popleft()
            self._queue(adapter, frame)
        while self._delayed_to_masters and self._delayed_to_masters[0][0] <= now:
            _, adapter, frame = self._delayed_to_masters.popleft()
            _pass_to_adapter(adapter, frame)
        self._behind_gateway = bool(self._delayed_to_nodes or self._delayed_to_masters)
        return min(
            [held[0][0] for held in (self._delayed_to_nodes, self._delayed_to_masters) if held],
            default=math.inf,
        )

    def _pass_held(self, now: float) -> float:
        """Pass the frames that were late by a fault of their identifier; return when the next is due."""
        while self._held and self._held[0][0] <= now:
            _, _, sender, frame = heapq.heappop(self._held)
            self._distribute(sender, frame, now)
        return self._held[0][0] if self._held else math.inf

    def _answer(self, now: float) -> float:
        """Let the nodes send the SDO answers that are due; return when the next is."""
        due, self._has_answers = math.inf, False
        for node in self._all:
            answer = node.frames.next_answer
            if answer is not None and answer <= now:
                node.frames.serve(now)
                self._collect(node)
                answer = node.frames.next_answer
            if answer is not None:
                due, self._has_answers = min(due, answer), True
        return due

    def _step(self, now: float) -> None:
        self._stepped, self._step_due = now, now + self._longest_step
        for node in self._all:
            node.frames.step(now)
            self._collect(node)
            self._has_answers = self._has_answers or node.frames.next_answer is not None

    # -- frames --------------------------------------------------------------------------------------------------------

    def _queue(self, sender: _Sender, frame: Frame) -> None:
        sender.waiting.append(frame)
        self._waiting += 1
        if self._sending is None:
            self._begin(self._clock.now())
            if self._ends < self.due:
                self.due = self._ends

    def _begin(self, now: float) -> None:
        """Put the waiting frame with the lowest identifier on the wire."""
        best: _Sender | None = None
        lowest = math.inf
        for sender in self._senders:
            waiting = sender.waiting
            if waiting and waiting[0][0] < lowest:
                best, lowest = sender, waiting[0][0]
        if best is None:
            self._waiting = 0
            return
        frame = best.waiting.popleft()
        self._waiting -= 1
        bits = (_FRAME_BITS if frame[0] <= _ID_11 else _EXTENDED_BITS) + 8 * len(frame[1])
        bits += (bits - _UNSTUFFED) // 8  # a usual number of stuff bits
        self._sending, self._ends = (best, frame), now + bits * self._bit

    def _arrive(self, sender: _Sender, frame: Frame, now: float) -> None:
        """Pass a frame to everybody but its sender."""
        self.frames += 1
        faults = self.faults
        self._lossy = faults.sync_lost or faults.heartbeat_lost
        if faults.by_id and frame[0] in faults.by_id:
            own = faults.by_id[frame[0]]
            if own.loss and self._random.random() < own.loss:
                return
            if own.delay > 0.0:
                heapq.heappush(self._held, (now + own.delay, self.frames, sender, frame))
                return
        self._distribute(sender, frame, now)

    def _distribute(self, sender: _Sender, frame: Frame, now: float) -> None:
        faults = self.faults
        if faults.loss or faults.cut or faults.duplication or faults.corruption:
            for damaged in self._damaged(frame):
                self._to_masters(sender, damaged, now)
                self._to_nodes(sender, damaged, now)
            return
        self._to_masters(sender, frame, now)
        self._to_nodes(sender, frame, now)

    def _damaged(self, frame: Frame) -> list[Frame]:
        """Return what a faulty wire makes of a frame."""
        faults, chance = self.faults, self._random.random
        if faults.cut or chance() < faults.loss:
            return []
        times = 2 if chance() < faults.duplication else 1
        if frame[1] and chance() < faults.corruption:
            frame = self._corrupted(frame)
        return [frame] * times

    def _to_masters(self, sender: _Sender, frame: Frame, now: float) -> None:
        late = self.faults.delay > 0.0 or self.faults.jitter > 0.0 or self._delayed_to_masters
        for adapter in self._adapters:
            if adapter is sender or adapter.off or adapter.failure is not None:
                continue
            if late:
                at = now + self._delay()
                if self._delayed_to_masters:
                    at = max(at, self._delayed_to_masters[-1][0])
                self._delayed_to_masters.append((at, adapter, frame))
                self._behind_gateway = True
            else:
                _pass_to_adapter(adapter, frame)

    def _to_nodes(self, sender: _Sender, frame: Frame, now: float) -> None:
        can_id, data, remote = frame
        if self._lossy and isinstance(sender, VirtualAdapter) and self._is_lost(can_id):
            return
        if can_id > _ID_11:
            return
        listeners = self._listeners.get(can_id)
        if listeners is None:
            listeners = [node for node in self._nodes if node.frames.listens_to(can_id)]
            self._listeners[can_id] = listeners
        for node in listeners:
            if node is sender:
                continue
            slave = node.frames
            if can_id == slave.sync.cob_id and now - self._stepped > _FRESH:
                self._step(now)
            slave.on_frame(can_id, data, now, remote=remote)
            if slave.has_frames:
                self._collect(node)
            if slave.has_requests:
                self._has_answers = True
        for foreign_node in self._foreign_nodes:
            if sender in self._foreign_nodes and sender.frames.node_id == foreign_node.frames.node_id:
                continue
            foreign_node.frames.on_frame(can_id, data, now, remote=remote)
            self._collect(foreign_node)
            self._has_answers = self._has_answers or foreign_node.frames.next_answer is not None

    def _is_lost(self, can_id: int) -> bool:
        """Whether a fault keeps a master's frame from the nodes."""
        faults = self.faults
        if faults.heartbeat_lost and can_id >> 7 == _HEARTBEAT:
            return True
        return faults.sync_lost and any(can_id == node.frames.sync.cob_id for node in self._nodes)

    def _collect(self, node: _Node[Slave] | _Node[ForeignNode]) -> None:
        for can_id, data in node.frames.take_frames():
            self._queue(node, (can_id, bytes(data), False))

    def _corrupted(self, frame: Frame) -> Frame:
        data = bytearray(frame[1])
        data[self._random.randrange(len(data))] ^= 1 << self._random.randrange(8)
        return frame[0], bytes(data), frame[2]

    def _delay(self) -> float:
        jitter = self.faults.jitter
        return self.faults.delay + (self._random.uniform(0.0, jitter) if jitter > 0.0 else 0.0)


class VirtualSyncProducer:
    """Another device that sends SYNC (``axisbus.clock.EventSource``); holds when the next is due."""

    def __init__(
        self, wire: VirtualWire, clock: VirtualClock, cob_id: int, period: float, counter: int = 0
    ) -> None:
        """Send SYNC with ``cob_id`` each ``period`` seconds; ``counter`` is the last value of its counter, 0: it has none."""
        self.due = clock.now()
        self._adapter = wire.connect()
        self._frame_id, self._period, self._last = cob_id, period, counter
        self._count = 0
        clock.add(self)

    def run(self, now: float, until: float) -> None:  # noqa: ARG002  # one at a time
        """As ``EventSource.run``."""
        self.due = now + self._period
        self._count = self._count % self._last + 1 if self._last else 0
        self._adapter.send(self._frame_id, bytes((self._count,)) if self._last else b"")

    def catch_up(self, now: float) -> None:
        """As ``EventSource.catch_up``: it has no plant."""


def _pass_to_adapter(adapter: VirtualAdapter, frame: Frame) -> None:
    receiver = adapter.receiver
    if receiver is None:
        return
    can_id, data, remote = frame
    if remote or can_id > _ID_11:
        receiver.take_message(
            can.Message(
                arbitration_id=can_id, data=data, is_remote_frame=remote, is_extended_id=can_id > _ID_11
            )
        )
    else:
        receiver.take_frame(can_id, data)
