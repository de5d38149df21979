"""Detect another master during operation: frames that this master has not sent, on COB-IDs that only it uses on its bus.

Theory of operation
-------------------
``axisbus.bus.link.detect_other_master`` listens before the first frame is sent. From then on this watch receives every COB-ID that
indicates a master (``axisbus.cia301.master_detection``). The adapter does not return the master's own frames, so frames received
there come from another master. A frame of any other COB-ID costs nothing. Each sign becomes an event at once, then one event in
``EVERY`` seconds while it continues, with the number of frames. If a frame commands a node of the cell, ``on_command`` is called to
stop its axes, at most once in ``STOP_PERIOD`` seconds for each COB-ID.

An adapter that does return the master's own frames would make this master appear as another one. ``Echoes`` detects that while the
nodes are booted.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial

from axisbus.bus.link.channel import Channel, Receiver
from axisbus.bus.node.events import EVERY, NodeEvent, NodeEventKind
from axisbus.cia301 import cob
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.master_detection import ExpectedMasters, Sign, commanded, nodes_text, sign_of
from axisbus.cia301.nmt import NmtState
from axisbus.errors import SecondMasterError
from axisbus.wording import counted

STOP_PERIOD = 0.1  # seconds
_HISTORY = 256
_MIN_REQUESTS = 4  # own requests before anything is concluded from the number that came back
_ANY = b"\x05"  # data with which the COB-ID of every sign is found, also that of a heartbeat

OnCommand = Callable[[SecondMasterError, frozenset[int]], None]


class Echoes:
    """Detects whether an adapter returns own frames as if another node had sent them; counts SDO requests during boot-up."""

    def __init__(self, channel: Channel) -> None:
        """Start to count; ``end`` stops it."""
        self._both = self._received = 0
        self._listening = ExitStack()
        self._listening.enter_context(channel.frames_to(self._on_received_frame))
        self._listening.callback(channel.untap, self._on_frame)
        channel.tap(self._on_frame)

    def end(self) -> None:
        """Stop counting; harmless when repeated."""
        self._listening.close()

    @property
    def detected(self) -> bool:
        """Whether most own requests have come back."""
        sent = self._both - self._received
        return sent >= _MIN_REQUESTS and self._received > sent / 2

    def _on_frame(self, frame: CanFrame) -> None:
        self._both += _is_request(frame)

    def _on_received_frame(self, frame: CanFrame) -> None:
        self._received += _is_request(frame)


def _is_request(frame: CanFrame) -> bool:
    return cob.SDO_RX < frame.can_id <= cob.SDO_RX + cob.NODE_IDS[-1]


@dataclass(slots=True)
class _ReceivedFrames:
    """Frames of one kind at one COB-ID: count and times since the last event, and the time of the last stop of its nodes."""

    count: int = 0
    reported: float = -math.inf
    last: float = 0.0
    last_stop: float = -math.inf


class MasterWatch:
    """Listens for another master; holds state: the last 256 events, and the frames since them. Its callbacks must not block."""

    def __init__(self, channel: Channel, *, stops: bool) -> None:
        """``stops``: whether axes are stopped; otherwise there are only events."""
        self.on_command: OnCommand | None = None
        self._channel = channel
        self._stops = stops
        self._expected = ExpectedMasters(frozenset(), frozenset())
        self._receivers: dict[int, Receiver] = {}
        self._frames: dict[tuple[int, frozenset[int]], _ReceivedFrames] = {}
        self._history: deque[NodeEvent] = deque(maxlen=_HISTORY)

    def begin(self, expected: ExpectedMasters) -> None:
        """Listen to the signs by ``expected``; called again if nodes have been added later."""
        self._expected = expected
        for can_id in range(cob.ID_MASK_11 + 1):
            if can_id not in self._receivers and sign_of(CanFrame(0.0, can_id, _ANY), expected) is not None:
                self._receivers[can_id] = partial(self._on_received_frame, can_id)
                self._channel.subscribe(can_id, self._receivers[can_id])

    def close(self) -> None:
        """Stop listening; harmless when repeated."""
        while self._receivers:
            self._channel.unsubscribe(*self._receivers.popitem())

    @property
    def events(self) -> list[NodeEvent]:
        """The events so far, in the order of time; may be read in any thread."""
        pending = [self._event(key, entry) for key, entry in list(self._frames.items()) if entry.count]
        return sorted([*self._history, *pending], key=lambda event: event.stamp)

    def _on_received_frame(self, can_id: int, data: bytes, stamp: float) -> None:
        frame = CanFrame(stamp, can_id, data)
        if sign_of(frame, self._expected) is None:  # for a heartbeat the data decides
            return
        nodes = commanded(frame, self._expected)
        key = can_id, nodes
        entry = self._frames.setdefault(key, _ReceivedFrames())
        entry.count, entry.last = entry.count + 1, stamp
        if stamp - entry.reported >= EVERY:
            self._history.append(self._event(key, entry))
            entry.count, entry.reported = 0, stamp
        if nodes and self._stops and self.on_command is not None and stamp - entry.last_stop >= STOP_PERIOD:
            entry.last_stop = stamp
            self.on_command(self._error(can_id, nodes), nodes)

    def _event(self, key: tuple[int, frozenset[int]], entry: _ReceivedFrames) -> NodeEvent:
        can_id, nodes = key
        passed = entry.last - entry.reported
        often = "" if math.isinf(passed) else f" in {passed:.1f} s"
        node = self._node(can_id, nodes)
        text = f"{self._description(can_id, nodes)}: {counted(entry.count, 'frame')}{often}; {self._outcome(nodes)}"
        return NodeEvent(
            node, NodeEventKind.MASTER, entry.last, NmtState.UNKNOWN, 0.0, 0.0, times=entry.count, text=text
        )

    def _outcome(self, nodes: frozenset[int]) -> str:
        if not nodes:
            return "it commands no node of this cell, and nothing is stopped"
        target_nodes = "all axes" if nodes == self._expected.all_nodes else f"the axes of {nodes_text(nodes)}"
        return (
            f"{target_nodes} are stopped"
            if self._stops
            else "this bus was opened in spite of it, and nothing is stopped"
        )

    def _error(self, can_id: int, nodes: frozenset[int]) -> SecondMasterError:
        words = self._description(can_id, nodes)
        return SecondMasterError(
            f"another master, or a tool that acts as one, commands the drives on this bus: {words}",
            heard=(words,),
            observed="such frames came from the bus, and this program has not sent them; a frame has no sender",
            remedy="end the other program, or disconnect the other device; then reset the axis. The machine's events list "
            "these frames and how often they came",
        )

    def _description(self, can_id: int, nodes: frozenset[int]) -> str:
        sign, node = sign_of(CanFrame(0.0, can_id, _ANY), self._expected) or (Sign.NMT, None)
        writes = " that write" if sign is Sign.SDO and nodes else ""
        of = "of" if sign is Sign.HEARTBEAT else "to"
        target_nodes = {node} if node is not None else nodes if sign is Sign.NMT else frozenset()
        everybody = sign is Sign.NMT and nodes == self._expected.all_nodes
        to = " to all nodes" if everybody else f" {of} {nodes_text(target_nodes)}" if target_nodes else ""
        return f"{sign.value}{writes}{to} ({can_id:03X}h)"

    def _node(self, can_id: int, nodes: frozenset[int]) -> int:
        """Return the node that a frame is for, 0 for the bus."""
        _, node = sign_of(CanFrame(0.0, can_id, _ANY), self._expected) or (None, None)
        if node is not None:
            return node
        return next(iter(nodes)) if len(nodes) == 1 else 0
