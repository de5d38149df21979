"""Collect the events of a machine by polling: commands, nodes, emergency messages, PDOs, the bus."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from axisbus.cell.model import CellConfig
from axisbus.cia301.incident import Incident
from axisbus.motion.command_status import Status
from axisbus.record.recording_data import RecordedEvent
from axisbus.session import CommandSeen, MachineSession


class NodeEventAccess(Protocol):
    """Access to a node, such as ``machine.node(1)``."""

    @property
    def incidents(self) -> Sequence[Incident]:
        """The incidents of the node, oldest first."""

    @property
    def pdo_events(self) -> Sequence[Any]:
        """Events of the node's TPDOs."""

    def format_incident(self, incident: Incident) -> list[str]:
        """Return an incident as lines."""


class EventProvider(Protocol):
    """A source of events: a ``Machine``, or its core."""

    cell: CellConfig

    @property
    def session(self) -> MachineSession:
        """The session with the core."""

    def node(self, node_id: int) -> Any:
        """Return direct access to a node."""


class Watched(EventProvider, Protocol):
    """A machine that can be recorded: a ``Machine``."""

    @property
    def is_simulated(self) -> bool:
        """Whether its drives are simulated."""

    @property
    def real_time_status(self) -> str:
        """The real-time status of its cycle, in words."""


class RecordingEventSource:
    """Poll a machine; holds the events already returned. Times are those of the monotonic clock, in seconds."""

    def __init__(self, machine: EventProvider) -> None:
        self._machine = machine
        self._reported: set[RecordedEvent] = set()

    def take(self, since: float) -> list[RecordedEvent]:
        """Return the new events since ``since`` in the order of time; blocks for some answers."""
        found = {one for one in self._events() if one.time >= since}
        new = sorted(found - self._reported)
        self._reported = found  # events that the machine has dropped are dropped here
        return new

    def _events(self) -> Iterator[RecordedEvent]:
        session = self._machine.session
        for command in session.commands:
            yield from _of_command(command)
        for event in session.node_events:
            yield RecordedEvent(event.stamp, "nmt", f"node {event.node}", str(event))
        for change in session.bus_events:
            yield RecordedEvent(change.stamp, "bus", change.channel, str(change))
        if session.left is not None:
            yield RecordedEvent(session.left[0], "machine", "", session.left[1])
        for node_id in self._machine.cell.nodes:
            yield from _of_node(node_id, self._machine.node(node_id))


def _of_command(seen: CommandSeen) -> Iterator[RecordedEvent]:
    yield RecordedEvent(seen.given, "command", seen.name, "given")
    if seen.ended is not None:
        text = seen.status.value if seen.status is not Status.ERROR else f"ended: {seen.error}"
        yield RecordedEvent(seen.ended, "command", seen.name, text)


def _of_node(node_id: int, node: NodeEventAccess) -> Iterator[RecordedEvent]:
    where = f"node {node_id}"
    for incident in node.incidents:
        words = [line.split("s  ", 1)[-1] for line in node.format_incident(incident)[1:]]
        yield RecordedEvent(incident.began, "emcy", where, words[0] if words else "")
        if incident.ended is not None:
            yield RecordedEvent(incident.ended, "emcy", where, f"incident {incident.number} is over")
    for event in node.pdo_events:
        yield RecordedEvent(event.stamp, "pdo", where, str(event))
