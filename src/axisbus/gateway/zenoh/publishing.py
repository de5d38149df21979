"""Publish the states of a cell's axes, at most a hundred times per second, and its events."""

from __future__ import annotations

import itertools
import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import msgspec
import zenoh

from axisbus.cia402.modes import ModeOfOperation, short
from axisbus.errors import AxisbusError, with_alarm
from axisbus.fleet.keys import ZenohCellKeys
from axisbus.fleet.messages import AxisInfo, AxisStateMessage, Event, EventsAnswer, EventsAsk
from axisbus.gateway import values
from axisbus.gateway.machine_events import Severity
from axisbus.machine.axis import Axis
from axisbus.machine.machine import Machine
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.snapshot import Snapshot

# -- Number events, and store the last ones for clients that have missed some ----------------------------------------------

MAX_EVENTS = 1024  # events
MAX_ANSWER = 256  # in one answer
Kind = Literal["machine", "node", "emcy", "incident", "bus", "command", "lease"]


@dataclass(frozen=True, slots=True)
class BridgeEvent:
    """An event before it has a number; the fields are those of ``messages.Event``."""

    kind: Kind
    text: str
    about: str = ""
    severity: Severity = "info"
    cause: str = ""
    remedy: str = ""


class BridgeEventLog:
    """Hold the last events of one run of a bridge. ``add`` is for one thread at a time, the rest for any."""

    def __init__(self, bridge: str) -> None:
        self._bridge = bridge
        self._events: deque[Event] = deque(maxlen=MAX_EVENTS)
        self._count = 0

    def add(self, content: BridgeEvent, clock: float) -> Event:
        """Store an event with the next number and return it; ``clock`` in s since 1970."""
        self._count += 1
        event = Event(
            self._count,
            self._bridge,
            clock,
            content.kind,
            content.text,
            content.about,
            content.severity,
            content.cause,
            content.remedy,
        )
        self._events.append(event)
        return event

    def answer(self, request: EventsAsk) -> EventsAnswer:
        """Return the requested events that are stored; oldest first, and no more than ``MAX_ANSWER``."""
        stored = tuple(self._events)
        if not stored:
            return EventsAnswer(self._bridge)
        last = stored[-1].n if request.last is None else request.last
        requested = tuple(event for event in stored if request.first <= event.n <= last)
        return EventsAnswer(self._bridge, stored[0].n, stored[-1].n, requested[:MAX_ANSWER])


# -- Publish the states of the axes and the events -------------------------------------------------------------------------

log = logging.getLogger("axisbus")
PERIOD = 0.01  # seconds between two states of an axis
_UNCHANGED_PERIOD = 0.1  # seconds, the same if the process image is unchanged and only its age has changed
_SUBSCRIBER_PERIOD = 0.1  # seconds between two checks for subscribers
Counts = dict[str, Iterator[int]]  # of the states of each axis, in one run of a bridge
_JSON = zenoh.Encoding.APPLICATION_JSON


class EventPublisher:
    """Number events, store them, and publish them in order; ``publish`` is for any thread."""

    def __init__(self, session: zenoh.Session, keys: ZenohCellKeys, bridge: str) -> None:
        self.stored = BridgeEventLog(bridge)
        self._publisher = session.declare_publisher(
            keys.events,
            encoding=_JSON,
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.DATA_HIGH,
        )
        self._queue: queue.Queue[BridgeEvent | None] = queue.Queue()
        self._thread = threading.Thread(target=self._run, name="events", daemon=True)
        self._thread.start()

    def publish(self, content: BridgeEvent) -> None:
        """Publish an event; does not block."""
        self._queue.put(content)

    def close(self) -> None:
        """Publish the waiting events, and end; blocks briefly, longer if a subscriber does not read."""
        self._queue.put(None)
        self._thread.join(2.0)
        self._publisher.undeclare()  # type: ignore[no-untyped-call]

    def _run(self) -> None:
        while (content := self._queue.get()) is not None:
            event: Event = self.stored.add(content, time.time())
            try:
                self._publisher.put(msgspec.json.encode(event))
            except Exception as error:  # noqa: BLE001  # it is stored and can be queried
                log.debug("an event could not be published: %s", error)


class States:
    """Publish the states of a machine's axes in a thread of its own, if there are subscribers; ``of`` is for any thread."""

    def __init__(
        self,
        session: zenoh.Session,
        keys: ZenohCellKeys,
        bridge: str,
        machine: Machine,
        changed: Callable[[], None],
        counts: Counts,
    ) -> None:
        """The thread calls ``changed`` when an axis has changed its state.

        ``counts`` outlive a machine: subscribers take a lower number of the same bridge for an older state.
        """
        self._session = session
        self._keys = keys
        self._bridge = bridge
        self._machine = machine
        self._changed = changed
        self._counts = counts
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._subscribed: frozenset[str] = frozenset()
        self._sent: dict[
            str, tuple[float, float]
        ] = {}  # by axis: the time of the process image, and of its sending
        self._states: dict[str, object] = {}
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="states", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread; blocks briefly."""
        self._closing.set()
        self._thread.join(2.0)
        for publisher in self._publishers.values():
            publisher.undeclare()  # type: ignore[no-untyped-call]

    def of(self, axis: str) -> AxisStateMessage:
        """Return the newest state of an axis."""
        session = self._machine.session
        return self._state(axis, session.snapshots[axis], time.monotonic(), session.silent is not None)

    def _state(self, axis: str, snapshot: Snapshot, now: float, silent: bool) -> AxisStateMessage:
        parameters = self._machine.session.axes[axis].parameters
        n = next(self._counts.setdefault(axis, itertools.count(1)))
        return state_of(snapshot, parameters, now, time.time(), n, self._bridge, silent)

    def _run(self) -> None:
        due = next_check = time.monotonic()
        while not self._closing.wait(max(0.0, due - time.monotonic())):
            now = time.monotonic()
            due = max(due + PERIOD, now)  # missed states are not made up for in a burst
            try:
                if now >= next_check:
                    next_check = now + _SUBSCRIBER_PERIOD
                    self._find_subscribers()
                self._publish(now)
            except Exception as error:  # noqa: BLE001  # the machine or the session ends: both are reported elsewhere
                log.debug("states could not be published: %s", error)

    def _find_subscribers(self) -> None:
        """Determine which axes have subscribers, and declare a publisher for new axes."""
        for axis in self._machine.session.axes:
            if axis not in self._publishers:
                self._publishers[axis] = self._session.declare_publisher(
                    self._keys.state(axis),
                    encoding=_JSON,
                    congestion_control=zenoh.CongestionControl.DROP,
                    priority=zenoh.Priority.DATA_LOW,
                )
        self._subscribed = frozenset(
            axis for axis, publisher in self._publishers.items() if publisher.matching_status
        )

    def _publish(self, now: float) -> None:
        session = self._machine.session
        snapshots = session.snapshots
        states = {axis: (one.state, one.error is None) for axis, one in snapshots.items()}
        if states != self._states:
            self._states = dict(states)
            self._changed()
        silent = bool(self._subscribed) and session.silent is not None
        for axis in self._subscribed:
            snapshot = snapshots[axis]
            image, sent = self._sent.get(axis, (-1.0, -1.0))
            if snapshot.now == image and now - sent < _UNCHANGED_PERIOD:
                continue
            self._sent[axis] = snapshot.now, now
            self._publishers[axis].put(msgspec.json.encode(self._state(axis, snapshot, now, silent)))


# -- The state of an axis as a message: in its units, with its age, and without values that are too old ----------------


UNKNOWN = "unknown"
OLD = 1.0  # seconds; the states of an older process image are not valid


def state_of(
    snapshot: Snapshot,
    parameters: AxisParameters,
    now: float,
    clock: float,
    n: int,
    bridge: str,
    silent: bool,
) -> AxisStateMessage:
    """Return the state of an axis from its process image; ``now`` (s, monotonic) of this computer, ``clock`` for people.

    ``silent``: the process image is out of date, so that only its age is reported.
    """
    age = max(0.0, now - snapshot.now)
    unit, error = parameters.units.position.unit, snapshot.error
    if silent or age > OLD:
        return AxisStateMessage(n, bridge, clock, unit, UNKNOWN, age, error=_error_text(error), sent=now)
    units = parameters.units
    return AxisStateMessage(
        n,
        bridge,
        clock,
        unit,
        snapshot.state.value,
        age,
        snapshot.power_state.value,
        None if snapshot.mode is None else short(ModeOfOperation(snapshot.mode)),
        values.position(snapshot, units),
        values.velocity(snapshot, units),
        values.torque(snapshot, units),
        values.following_error(snapshot, units),
        snapshot.homed,
        _error_text(error),
        None if snapshot.position is None else max(0.0, now - snapshot.position_stamp),
        now,
    )


def info_of(axis: Axis, node: int | None) -> AxisInfo:
    """Return the description of an axis."""
    limits = axis.limits
    found = {
        "min_position": None if limits.position is None else limits.position[0],
        "max_position": None if limits.position is None else limits.position[1],
        "max_velocity": limits.velocity,
        "max_acceleration": limits.acceleration,
        "max_torque": limits.torque,
    }
    known = {name: float(value) for name, value in found.items() if value is not None}
    return AxisInfo(axis.name, axis.unit, node, known)


def _error_text(error: AxisbusError | None) -> str | None:
    return None if error is None else with_alarm(error.message, error)
