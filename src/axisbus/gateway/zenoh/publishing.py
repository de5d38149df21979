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

KEPT = 1024  # events
AT_ONCE = 256  # in one answer
Kind = Literal["machine", "node", "emcy", "incident", "bus", "command", "lease"]


@dataclass(frozen=True, slots=True)
class Happened:
    """An event before it has a number; the fields are those of ``messages.Event``."""

    kind: Kind
    text: str
    about: str = ""
    severity: Severity = "info"
    cause: str = ""
    remedy: str = ""


class BridgeEventLog:
    """Hold the last events of one run of a bridge. ``enter`` is for one thread at a time, the rest for any."""

    def __init__(self, bridge: str) -> None:
        self._bridge = bridge
        self._kept: deque[Event] = deque(maxlen=KEPT)
        self._count = 0

    def enter(self, happened: Happened, clock: float) -> Event:
        """Store an event with the next number and return it; ``clock`` in s since 1970."""
        self._count += 1
        event = Event(
            self._count,
            self._bridge,
            clock,
            happened.kind,
            happened.text,
            happened.about,
            happened.severity,
            happened.cause,
            happened.remedy,
        )
        self._kept.append(event)
        return event

    def answer(self, ask: EventsAsk) -> EventsAnswer:
        """Return the requested events that are stored; oldest first, and no more than ``AT_ONCE``."""
        kept = tuple(self._kept)
        if not kept:
            return EventsAnswer(self._bridge)
        last = kept[-1].n if ask.last is None else ask.last
        asked = tuple(event for event in kept if ask.first <= event.n <= last)
        return EventsAnswer(self._bridge, kept[0].n, kept[-1].n, asked[:AT_ONCE])


# -- Publish the states of the axes and the events -------------------------------------------------------------------------

log = logging.getLogger("axisbus")
PERIOD = 0.01  # seconds between two states of an axis
_SAME = 0.1  # seconds, the same if the process image is unchanged and only its age has changed
_LOOK = 0.1  # seconds between two checks for subscribers
Counts = dict[str, Iterator[int]]  # of the states of each axis, in one run of a bridge
_JSON = zenoh.Encoding.APPLICATION_JSON


class EventPublisher:
    """Number events, store them, and publish them in order; ``tell`` is for any thread."""

    def __init__(self, session: zenoh.Session, keys: ZenohCellKeys, bridge: str) -> None:
        self.kept = BridgeEventLog(bridge)
        self._publisher = session.declare_publisher(
            keys.events,
            encoding=_JSON,
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.DATA_HIGH,
        )
        self._told: queue.Queue[Happened | None] = queue.Queue()
        self._thread = threading.Thread(target=self._run, name="events", daemon=True)
        self._thread.start()

    def tell(self, happened: Happened) -> None:
        """Publish an event; does not block."""
        self._told.put(happened)

    def close(self) -> None:
        """Publish the waiting events, and end; blocks briefly, longer if a subscriber does not read."""
        self._told.put(None)
        self._thread.join(2.0)
        self._publisher.undeclare()  # type: ignore[no-untyped-call]

    def _run(self) -> None:
        while (happened := self._told.get()) is not None:
            event: Event = self.kept.enter(happened, time.time())
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
        self._heard: frozenset[str] = frozenset()
        self._sent: dict[
            str, tuple[float, float]
        ] = {}  # by axis: the time of the process image, and of its sending
        self._seen: dict[str, object] = {}
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="states", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread; blocks briefly."""
        self._over.set()
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
        due = look = time.monotonic()
        while not self._over.wait(max(0.0, due - time.monotonic())):
            now = time.monotonic()
            due = max(due + PERIOD, now)  # missed states are not made up for in a burst
            try:
                if now >= look:
                    look = now + _LOOK
                    self._look()
                self._publish(now)
            except Exception as error:  # noqa: BLE001  # the machine or the session ends: both are reported elsewhere
                log.debug("states could not be published: %s", error)

    def _look(self) -> None:
        """Determine which axes have subscribers, and declare a publisher for new axes."""
        for axis in self._machine.session.axes:
            if axis not in self._publishers:
                self._publishers[axis] = self._session.declare_publisher(
                    self._keys.state(axis),
                    encoding=_JSON,
                    congestion_control=zenoh.CongestionControl.DROP,
                    priority=zenoh.Priority.DATA_LOW,
                )
        self._heard = frozenset(
            axis for axis, publisher in self._publishers.items() if publisher.matching_status
        )

    def _publish(self, now: float) -> None:
        session = self._machine.session
        snapshots = session.snapshots
        seen = {axis: (one.state, one.error is None) for axis, one in snapshots.items()}
        if seen != self._seen:
            self._seen = dict(seen)
            self._changed()
        silent = bool(self._heard) and session.silent is not None
        for axis in self._heard:
            snapshot = snapshots[axis]
            image, sent = self._sent.get(axis, (-1.0, -1.0))
            if snapshot.now == image and now - sent < _SAME:
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
        return AxisStateMessage(n, bridge, clock, unit, UNKNOWN, age, error=_told(error), sent=now)
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
        _told(error),
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


def _told(error: AxisbusError | None) -> str | None:
    return None if error is None else with_alarm(error.message, error)
