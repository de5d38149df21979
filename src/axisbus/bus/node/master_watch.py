"""Another master in operation: frames on COB-IDs that only this master uses on its bus, which it has not sent.

Theory of operation
-------------------
``bus.link.detect_other_master`` listens before our first frame. From then on this watch is a receiver of every COB-ID that gives a
master away (``cia301.master_detection``): our adapter does not give us our own frames back, so what comes there is of another
master. A frame of any other COB-ID costs nothing. Each sign becomes an event at once, then one in ``EVERY`` seconds while it goes
on, with the number of frames. What commands a node of the cell is passed to whoever stops its axes, at most once in ``AGAIN``
seconds for each COB-ID.

An adapter that does give our own frames back would show us as another master. ``Echoes`` finds that out while the nodes are booted.
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
_FEWEST = 4  # requests of ours, before anything is concluded from those that came back
_ANY = b"\x05"  # data by which every COB-ID of a master is found, a heartbeat's too

OnCommand = Callable[[SecondMasterError, frozenset[int]], None]


class Echoes:
    """Whether an adapter gives us our own frames back as if another node had sent them; counts SDO requests during boot-up."""

    def __init__(self, channel: Channel) -> None:
        """Listen from now on, until ``end``."""
        self._both = self._received = 0
        self._listening = ExitStack()
        self._listening.enter_context(channel.overheard(self._hear))
        self._listening.callback(channel.untap, self._see)
        channel.tap(self._see)

    def end(self) -> None:
        """Listen no more; harmless when repeated."""
        self._listening.close()

    @property
    def there(self) -> bool:
        """Whether most of our requests have come back."""
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
    """What came of one kind at one COB-ID: frames and time since the last event, and when its nodes were stopped last."""

    count: int = 0
    told: float = -math.inf
    last: float = 0.0
    stopped: float = -math.inf


class MasterWatch:
    """Listens for another master; holds state: the last 256 events, and what was heard since. Its receivers may not block."""

    def __init__(self, channel: Channel, *, stops: bool) -> None:
        """``stops``: whether axes are to be stopped; else the events are all."""
        self.on_command: OnCommand | None = None
        self._channel = channel
        self._stops = stops
        self._cast = ExpectedMasters(frozenset(), frozenset())
        self._receivers: dict[int, Receiver] = {}
        self._heard: dict[tuple[int, frozenset[int]], _Heard] = {}
        self._history: deque[NodeEvent] = deque(maxlen=_KEPT)

    def begin(self, cast: ExpectedMasters) -> None:
        """Listen to what ``cast`` makes a sign; called again where nodes have come later."""
        self._cast = cast
        for can_id in range(cob.ID_MASK_11 + 1):
            if can_id not in self._receivers and sign_of(CanFrame(0.0, can_id, _ANY), cast) is not None:
                self._receivers[can_id] = partial(self._hear, can_id)
                self._channel.subscribe(can_id, self._receivers[can_id])

    def close(self) -> None:
        """Listen no more; harmless when repeated."""
        while self._receivers:
            self._channel.unsubscribe(*self._receivers.popitem())

    @property
    def events(self) -> list[NodeEvent]:
        """What was heard so far, in the order of time; may be read in any thread."""
        waits = [self._event(key, one) for key, one in list(self._heard.items()) if one.count]
        return sorted([*self._history, *waits], key=lambda event: event.stamp)

    def _hear(self, can_id: int, data: bytes, stamp: float) -> None:
        frame = CanFrame(stamp, can_id, data)
        if sign_of(frame, self._cast) is None:  # of a heartbeat, its data tells
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
            f"{whose} are stopped" if self._stops else "this bus was opened beside it, and nothing is stopped"
        )

    def _error(self, can_id: int, nodes: frozenset[int]) -> SecondMasterError:
        words = self._words(can_id, nodes)
        return SecondMasterError(
            f"another master, or a tool that acts as one, commands the drives on this bus: {words}",
            heard=(words,),
            observed="such frames came from the bus, and this program has not sent them; a frame names no sender",
            remedy="end the other program, or take the other device off the bus; then reset the axis. The machine's events say "
            "what was heard, and how often",
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
        """Return the node that it concerns, 0 for the bus."""
        _, node = sign_of(CanFrame(0.0, can_id, _ANY), self._cast) or (None, None)
        if node is not None:
            return node
        return next(iter(nodes)) if len(nodes) == 1 else 0
