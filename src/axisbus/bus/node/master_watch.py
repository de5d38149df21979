"""Detect another master during operation: frames that this master has not sent, on COB-IDs that only it uses on its bus.

Theory of operation
-------------------
``axisbus.bus.link.detect_other_master`` listens before the first frame is sent. From then on this watch receives every COB-ID that
indicates a master (``axisbus.cia301.master_detection``). The adapter does not return the master's own frames, so frames received
there come from another master. A frame of any other COB-ID costs nothing. Each sign becomes an event at once, then one event in
``EVERY`` seconds while it continues, with the number of frames. If a frame commands a node of the cell, ``on_command`` is called to
stop its axes, at most once in ``AGAIN`` seconds for each COB-ID.

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

AGAIN = 0.1  # seconds
_KEPT = 256
_FEWEST = 4  # own requests before anything is concluded from the number that came back
_ANY = b"\x05"  # data with which the COB-ID of every sign is found, also that of a heartbeat

OnCommand = Callable[[SecondMasterError, frozenset[int]], None]


class Echoes:
    """Detects whether an adapter returns own frames as if another node had sent them; counts SDO requests during boot-up."""

    def __init__(self, channel: Channel) -> None:
        """Start to count; ``end`` stops it."""
        self._both = self._received = 0
        self._listening = ExitStack()
        self._listening.enter_context(channel.overheard(self._hear))
        self._listening.callback(channel.untap, self._see)
        channel.tap(self._see)

    def end(self) -> None:
        """Stop counting; harmless when repeated."""
        self._listening.close()

    @property
    def there(self) -> bool:
        """Whether most own requests have come back."""
        sent = self._both - self._received
        return sent >= _FEWEST and self._received > sent / 2

    def _see(self, frame: CanFrame) -> None:
        self._both += _is_request(frame)

    def _hear(self, frame: CanFrame) -> None:
        self._received += _is_request(frame)


def _is_request(frame: CanFrame) -> bool:
    return cob.SDO_RX < frame.can_id <= cob.SDO_RX + cob.NODE_IDS[-1]


@dataclass(slots=True)
class _Heard:
    """Frames of one kind at one COB-ID: count and times since the last event, and the time of the last stop of its nodes."""

    count: int = 0
    told: float = -math.inf
    last: float = 0.0
    stopped: float = -math.inf


class MasterWatch:
    """Listens for another master; holds state: the last 256 events, and the frames since them. Its callbacks must not block."""

    def __init__(self, channel: Channel, *, stops: bool) -> None:
        """``stops``: whether axes are stopped; otherwise there are only events."""
        self.on_command: OnCommand | None = None
        self._channel = channel
        self._stops = stops
        self._cast = ExpectedMasters(frozenset(), frozenset())
        self._receivers: dict[int, Receiver] = {}
        self._heard: dict[tuple[int, frozenset[int]], _Heard] = {}
        self._history: deque[NodeEvent] = deque(maxlen=_KEPT)

    def begin(self, cast: ExpectedMasters) -> None:
        """Listen to the signs by ``cast``; called again if nodes have been added later."""
        self._cast = cast
        for can_id in range(cob.ID_MASK_11 + 1):
            if can_id not in self._receivers and sign_of(CanFrame(0.0, can_id, _ANY), cast) is not None:
                self._receivers[can_id] = partial(self._hear, can_id)
                self._channel.subscribe(can_id, self._receivers[can_id])

    def close(self) -> None:
        """Stop listening; harmless when repeated."""
        while self._receivers:
            self._channel.unsubscribe(*self._receivers.popitem())

    @property
    def events(self) -> list[NodeEvent]:
        """The events so far, in the order of time; may be read in any thread."""
        waits = [self._event(key, one) for key, one in list(self._heard.items()) if one.count]
        return sorted([*self._history, *waits], key=lambda event: event.stamp)

    def _hear(self, can_id: int, data: bytes, stamp: float) -> None:
        frame = CanFrame(stamp, can_id, data)
        if sign_of(frame, self._cast) is None:  # for a heartbeat the data decides
            return
        nodes = commanded(frame, self._cast)
        key = can_id, nodes
        one = self._heard.setdefault(key, _Heard())
        one.count, one.last = one.count + 1, stamp
        if stamp - one.told >= EVERY:
            self._history.append(self._event(key, one))
            one.count, one.told = 0, stamp
        if nodes and self._stops and self.on_command is not None and stamp - one.stopped >= AGAIN:
            one.stopped = stamp
            self.on_command(self._error(can_id, nodes), nodes)

    def _event(self, key: tuple[int, frozenset[int]], one: _Heard) -> NodeEvent:
        can_id, nodes = key
        passed = one.last - one.told
        often = "" if math.isinf(passed) else f" in {passed:.1f} s"
        node = self._node(can_id, nodes)
        text = f"{self._words(can_id, nodes)}: {counted(one.count, 'frame')}{often}; {self._outcome(nodes)}"
        return NodeEvent(
            node, NodeEventKind.MASTER, one.last, NmtState.UNKNOWN, 0.0, 0.0, times=one.count, text=text
        )

    def _outcome(self, nodes: frozenset[int]) -> str:
        if not nodes:
            return "it commands no node of this cell, and nothing is stopped"
        whose = "all axes" if nodes == self._cast.all_nodes else f"the axes of {nodes_text(nodes)}"
        return (
            f"{whose} are stopped"
            if self._stops
            else "this bus was opened in spite of it, and nothing is stopped"
        )

    def _error(self, can_id: int, nodes: frozenset[int]) -> SecondMasterError:
        words = self._words(can_id, nodes)
        return SecondMasterError(
            f"another master, or a tool that acts as one, commands the drives on this bus: {words}",
            heard=(words,),
            observed="such frames came from the bus, and this program has not sent them; a frame has no sender",
            remedy="end the other program, or disconnect the other device; then reset the axis. The machine's events list "
            "these frames and how often they came",
        )

    def _words(self, can_id: int, nodes: frozenset[int]) -> str:
        sign, node = sign_of(CanFrame(0.0, can_id, _ANY), self._cast) or (Sign.NMT, None)
        writes = " that write" if sign is Sign.SDO and nodes else ""
        of = "of" if sign is Sign.HEARTBEAT else "to"
        whose = {node} if node is not None else nodes if sign is Sign.NMT else frozenset()
        everybody = sign is Sign.NMT and nodes == self._cast.all_nodes
        to = " to all nodes" if everybody else f" {of} {nodes_text(whose)}" if whose else ""
        return f"{sign.value}{writes}{to} ({can_id:03X}h)"

    def _node(self, can_id: int, nodes: frozenset[int]) -> int:
        """Return the node that a frame is for, 0 for the bus."""
        _, node = sign_of(CanFrame(0.0, can_id, _ANY), self._cast) or (None, None)
        if node is not None:
            return node
        return next(iter(nodes)) if len(nodes) == 1 else 0
