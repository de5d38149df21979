"""Error control events of one node while the scan runs: lost, back again, restarted, in another NMT state.

The scan checks for events in each cycle, just when it sends its frames. If an axis of the node moves, those frames already contain
the stop. So ``reaction`` is the time from the moment at which the event could be known until the stop was sent.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Protocol

from axisbus.cia301.nmt import NmtState
from axisbus.wording import counted

_HISTORY = 256
EVERY = 1.0  # seconds between two events of the same kind in the history
_OPERATIONAL = NmtState.OPERATIONAL  # compared in every cycle


class NodeEventKind(Enum):
    """Kind of an event."""

    LOST = "is lost: its heartbeat does not come"
    UNANSWERED = "is lost: it does not answer node guarding"
    BACK = "is heard again"
    BOOT_UP = "sent an unexpected boot-up message: it has restarted, or a second device has its node-ID"
    STATE = "is in an NMT state other than operational"
    UNKNOWN = "is unknown: the CAN controller went bus-off"
    OPERATIONAL = "is operational again"
    DUPLICATE = "shares its node-ID with a second device"
    MASTER = "another master, or a tool that acts as one, is on the bus"


BAD = frozenset(NodeEventKind) - {NodeEventKind.BACK, NodeEventKind.OPERATIONAL}


@dataclass(frozen=True, slots=True)
class NodeEvent:
    """One event: ``stamp`` in seconds of the monotonic clock; ``silent`` and ``reaction`` in seconds.

    ``silent`` is the time since the last report of the node. ``reaction`` is the time from the moment at which the event could be
    known (the deadline of a heartbeat, the reception of a message) until the scan reacted. ``times`` is the number of occurrences
    since the last event of this kind. A node that floods the bus causes only one event of each kind in ``EVERY`` seconds, with the
    newest occurrence.

    For another master (``MASTER``), ``text`` describes the frames, ``times`` is their number, and ``node`` is the node they are
    sent to (0: the bus). The state is then not meaningful.
    """

    node: int
    kind: NodeEventKind
    stamp: float
    state: NmtState
    silent: float
    reaction: float
    times: int = 1
    text: str = ""

    def __str__(self) -> str:
        if self.text:
            return f"{self.kind.value}: {self.text}"
        often = f"{counted(self.times, 'time')}; " if self.times > 1 else ""
        return (
            f"node {self.node} {self.kind.value} ({often}{self.state.text}, last frame {self.silent * 1000:.0f} ms ago; "
            f"detected within {self.reaction * 1000:.1f} ms)"
        )


class Monitored(Protocol):
    """A node as known by its heartbeats. Times in seconds."""

    @property
    def node_id(self) -> int:
        """The node's ID."""

    @property
    def state(self) -> NmtState:
        """The last reported NMT state."""

    @property
    def stamp(self) -> float | None:
        """Time of the last report."""

    @property
    def bootups(self) -> int:
        """Number of received boot-up messages."""

    @property
    def bootup_stamp(self) -> float | None:
        """Time of the last boot-up message."""

    @property
    def duplicate(self) -> str:
        """Evidence that a second device has this node-ID; empty if there is none."""

    @property
    def guarded(self) -> bool:
        """Whether node guarding monitors the node, because it sends no heartbeat."""

    @property
    def deadline(self) -> float:
        """Time at which the next report is overdue."""

    def overdue(self, now: float) -> bool:
        """Whether the next report is overdue at the time ``now``."""


class NodeEvents:
    """Detects events from the monitor of a node; holds state: the last values of the monitor, and the last 256 events."""

    def __init__(self, monitor: Monitored) -> None:
        """Begin with the present state of the node."""
        self.history: deque[NodeEvent] = deque(maxlen=_HISTORY)
        self._callbacks: tuple[Callable[[NodeEvent], None], ...] = ()
        self._monitor = monitor
        self._bootups = monitor.bootups
        self._operational = monitor.state is NmtState.OPERATIONAL
        self._lost = self._doubled = False
        self._reported: dict[NodeEventKind, float] = {}  # time of the last event of each kind in the history
        # Events that wait until they may be added to the history.
        self._pending: dict[NodeEventKind, NodeEvent] = {}

    @property
    def events(self) -> list[NodeEvent]:
        """The history and the waiting events, in the order of time; may be read in any thread."""
        return sorted([*self.history, *list(self._pending.values())], key=lambda event: event.stamp)

    def subscribe(self, callback: Callable[[NodeEvent], None]) -> None:
        """Call ``callback`` for every single event from now on, in the scan's thread; it must not block."""
        self._callbacks = (*self._callbacks, callback)

    def look(self, now: float) -> None:
        """Record the changes since the last call; does not block. Only for the scan's thread."""
        monitor = self._monitor
        if monitor.bootups != self._bootups:
            self._bootups, self._operational = monitor.bootups, False
            self._note(NodeEventKind.BOOT_UP, now, monitor.bootup_stamp)
        elif (monitor.state is _OPERATIONAL) is not self._operational:
            self._operational = not self._operational
            forgotten = monitor.state is NmtState.UNKNOWN
            bad = NodeEventKind.UNKNOWN if forgotten else NodeEventKind.STATE
            since = None if forgotten else monitor.stamp
            self._note(NodeEventKind.OPERATIONAL if self._operational else bad, now, since)
        if monitor.overdue(now) is not self._lost:
            self._lost = not self._lost
            self._note_loss(now)
        if monitor.duplicate and not self._doubled:
            self._doubled = True
            self._note(NodeEventKind.DUPLICATE, now, monitor.stamp)
        if self._pending:
            self._release_pending(now)

    def _note_loss(self, now: float) -> None:
        if self._lost:
            kind = NodeEventKind.UNANSWERED if self._monitor.guarded else NodeEventKind.LOST
            self._note(kind, now, self._monitor.deadline)
        else:
            self._note(NodeEventKind.BACK, now, self._monitor.stamp)

    def _note(self, kind: NodeEventKind, now: float, since: float | None) -> None:
        """Record an event that could be known at the time ``since``; None: now."""
        monitor = self._monitor
        event = NodeEvent(
            monitor.node_id, kind, now, monitor.state, _passed(monitor.stamp, now), _passed(since, now)
        )
        self._merge_pending(event)
        for callback in self._callbacks:
            callback(event)

    def _merge_pending(self, event: NodeEvent) -> None:
        pending = self._pending.get(event.kind)
        self._pending[event.kind] = event if pending is None else replace(event, times=pending.times + 1)

    def _release_pending(self, now: float) -> None:
        for kind in [kind for kind in self._pending if now - self._reported.get(kind, -math.inf) >= EVERY]:
            self._reported[kind] = now
            self.history.append(self._pending.pop(kind))


def _passed(since: float | None, now: float) -> float:
    """Return the seconds since ``since``, at least 0: a stamp may be newer than ``now``."""
    return 0.0 if since is None else max(0.0, now - since)
