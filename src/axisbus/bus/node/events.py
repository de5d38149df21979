"""What error control has to tell of one node while the scan runs: lost, back again, restarted, in another NMT state.

The scan's cycle looks in each period, just when its frames go out. Where the node has an axis that moves, those frames carry the
stop already, so that ``reaction`` is the time from when the event could be known until the stop was sent.
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

_KEPT = 256
EVERY = 1.0  # seconds between two events of the same kind in the history
_OPERATIONAL = NmtState.OPERATIONAL  # looked at in every cycle


class NodeEventKind(Enum):
    """What happened."""

    LOST = "is lost: its heartbeat stays away"
    UNANSWERED = "is lost: it does not answer node guarding"
    BACK = "is heard again"
    BOOT_UP = (
        "sent a boot-up message that nobody asked for: it has restarted, or a second device has its node-ID"
    )
    STATE = "is in another NMT state than operational"
    UNKNOWN = "is unknown: the CAN controller went bus-off"
    OPERATIONAL = "is operational again"
    DUPLICATE = "shares its node-ID with a second device"
    MASTER = "another master, or a tool that acts as one, is on the bus"


BAD = frozenset(NodeEventKind) - {NodeEventKind.BACK, NodeEventKind.OPERATIONAL}


@dataclass(frozen=True, slots=True)
class NodeEvent:
    """One event: ``stamp`` in seconds of the monotonic clock; ``silent`` and ``reaction`` in seconds.

    ``silent`` is how long nothing had been heard of the node, ``reaction`` the time from when the event could be known (the
    deadline of a heartbeat, the reception of a message) until the scan acted. ``times`` is how often it has happened since the last
    event of its kind: a node that goes mad is told once in ``EVERY`` seconds for each kind, with the newest of them.

    Of another master (``MASTER``) ``text`` says what was heard, and ``times`` how many frames; ``node`` is the one that they are
    for (0: the bus), and nothing is said of its state.
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
            f"node {self.node} {self.kind.value} ({often}{self.state.text}, heard {self.silent * 1000:.0f} ms ago; "
            f"noticed within {self.reaction * 1000:.1f} ms)"
        )


class Monitored(Protocol):
    """What is known of a node by its heartbeats: a ``NodeMonitor``, or what stands for it without a bus. Times in seconds."""

    @property
    def node_id(self) -> int:
        """The node's ID."""

    @property
    def state(self) -> NmtState:
        """The NMT state that it reported last."""

    @property
    def stamp(self) -> float | None:
        """When it reported last."""

    @property
    def bootups(self) -> int:
        """How many boot-up messages have come."""

    @property
    def bootup_stamp(self) -> float | None:
        """When the last of them came."""

    @property
    def duplicate(self) -> str:
        """What shows that a second device has its node-ID; empty where nothing does."""

    @property
    def guarded(self) -> bool:
        """Whether it is asked for its state by node guarding, because it sends no heartbeat."""

    @property
    def deadline(self) -> float:
        """When the next report is overdue."""

    def overdue(self, now: float) -> bool:
        """Whether it is."""


class NodeEvents:
    """Watches what the monitor of a node has heard; holds state: what was seen last, and the last 256 events."""

    def __init__(self, monitor: Monitored) -> None:
        """Begin with the node as it is now."""
        self.history: deque[NodeEvent] = deque(maxlen=_KEPT)
        self._hear: tuple[Callable[[NodeEvent], None], ...] = ()
        self._monitor = monitor
        self._bootups = monitor.bootups
        self._operational = monitor.state is NmtState.OPERATIONAL
        self._lost = self._doubled = False
        self._told: dict[NodeEventKind, float] = {}  # when each kind was told last
        self._held: dict[NodeEventKind, NodeEvent] = {}  # what waits until it may be told again

    @property
    def events(self) -> list[NodeEvent]:
        """The history and what waits to get into it, in the order of time; may be read in any thread."""
        return sorted([*self.history, *list(self._held.values())], key=lambda event: event.stamp)

    def hear(self, call: Callable[[NodeEvent], None]) -> None:
        """Have ``call`` called with every single event from now on, in the scan's thread: it must not block."""
        self._hear = (*self._hear, call)

    def look(self, now: float) -> None:
        """Note what has changed since the last look; does not block. Belongs to the scan's thread."""
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
        if self._held:
            self._tell_held(now)

    def _note_loss(self, now: float) -> None:
        if self._lost:
            kind = NodeEventKind.UNANSWERED if self._monitor.guarded else NodeEventKind.LOST
            self._note(kind, now, self._monitor.deadline)
        else:
            self._note(NodeEventKind.BACK, now, self._monitor.stamp)

    def _note(self, kind: NodeEventKind, now: float, since: float | None) -> None:
        """Note an event that could be known ``since`` a time; None: since now."""
        monitor = self._monitor
        event = NodeEvent(
            monitor.node_id, kind, now, monitor.state, _passed(monitor.stamp, now), _passed(since, now)
        )
        self._hold(event)
        for hear in self._hear:
            hear(event)

    def _hold(self, event: NodeEvent) -> None:
        held = self._held.get(event.kind)
        self._held[event.kind] = event if held is None else replace(event, times=held.times + 1)

    def _tell_held(self, now: float) -> None:
        for kind in [kind for kind in self._held if now - self._told.get(kind, -math.inf) >= EVERY]:
            self._told[kind] = now
            self.history.append(self._held.pop(kind))


def _passed(since: float | None, now: float) -> float:
    """The seconds since then; what is stamped while the scan looks has not passed."""
    return 0.0 if since is None else max(0.0, now - since)
