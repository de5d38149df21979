"""The events of a machine, each reported once: nodes, emergency messages, incidents, axes in ErrorStop, the bus, commands."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Literal, NamedTuple

from axisbus.boot.report import NodeReport
from axisbus.bus.link.controller import WHAT_TO_CHECK, CanErrorState, ControllerEvent
from axisbus.bus.node.events import BAD, NodeEvent
from axisbus.cia301.emcy import Emcy
from axisbus.cia301.incident import TOGETHER, Incident
from axisbus.drives.emcy_text import emcy_words
from axisbus.errors import AxisbusError, seen_of
from axisbus.machine.machine import Machine
from axisbus.machine.node_access import NodeAccess
from axisbus.machine.signal_shutdown import ShutdownRequest
from axisbus.motion.command_status import Status
from axisbus.session import CommandSeen

Severity = Literal["info", "warning", "error"]
_JOG = ".jog("  # comes twenty times per second: only errors of a jog are reported
_HALT = ".halt"  # without brackets: a halt of the core, when control changes hands
_SETTLED = 2 * TOGETHER  # seconds after which all messages of an incident have arrived


class MachineEventKind(Enum):
    """The kind of an event."""

    COMMAND = "a command was given, or has ended"
    NODE = "error control has reported a change of a node"
    BUS = "the CAN controller has changed"
    LEFT = "the shutdown of the machine has begun"
    EMCY = "an emergency message has arrived"
    INCIDENT = "an incident has begun; some of its messages may not have arrived yet"
    SETTLED = "all messages of an incident have arrived, except its resets"
    OVER = "an incident is over"
    FAULT = "an axis has changed to ErrorStop"
    WELL = "an axis no longer has an error"


@dataclass(frozen=True, slots=True)
class MachineEvent:
    """An event of a machine: ``stamp`` in seconds of the machine's clock.

    ``about`` names a node, an axis or a group, and is empty for the machine and its bus; ``axes`` are the affected axes, as far as
    known. ``cause`` is the observation, in lines, ``remedy`` the first thing to do.
    """

    stamp: float
    kind: MachineEventKind
    severity: Severity
    text: str
    about: str = ""
    axes: tuple[str, ...] = ()
    cause: tuple[str, ...] = ()
    remedy: str = ""


class _Found(NamedTuple):
    stamp: float
    key: Hashable  # identifies the event, so that it is reported once
    make: Callable[[], MachineEvent]  # makes the event; called only if it is new


class MachineEventSource:
    """Observe one machine after the other; holds the reported events, and the error of each axis.

    An event is identified by its time too, so that an event of one machine is never mistaken for one of the next.
    """

    def __init__(self, since: float = -math.inf, *, commands: bool = False) -> None:
        """``since``: earlier events, in seconds of the machine's clock, are not reported, but an axis still in ErrorStop is.

        ``commands``: report commands as well, of any program.
        """
        self._since = since
        self._commands = commands
        self._reported: set[Hashable] = set()
        self._errors: dict[str, str] = {}

    def poll(self, machine: Machine, now: float) -> list[MachineEvent]:
        """Return the new events at ``now`` (seconds of the machine's clock), oldest first; blocks for some answers of the core.

        Raises:
            AxisbusError: the core is gone.
        """
        found = [one for one in self._found(machine, now) if one.stamp >= self._since]
        new = [one.make() for one in found if one.key not in self._reported]
        new += self._of_axes(machine)
        self._reported = {one.key for one in found}  # drop the events that the machine has dropped
        return sorted(new, key=lambda event: event.stamp)

    def _found(self, machine: Machine, now: float) -> Iterator[_Found]:
        if self._commands:
            for command in machine.session.commands:
                yield from _of_command(command)
        for change in machine.bus_events:
            yield _Found(change.stamp, ("bus", change.condition, change.stamp), partial(_bus, change))
        axes = {report.node_id: _axes_of(report) for report in machine.reports}
        for event in machine.events:
            yield _of_event(event, axes)
        for node_id, names in axes.items():
            yield from _of_node(machine.node(node_id), names, now)

    def _of_axes(self, machine: Machine) -> Iterator[MachineEvent]:
        """Report the axes that have entered ErrorStop, have another error, or have left it."""
        for axis in machine:
            snapshot = axis.snapshot
            error, before = snapshot.error, self._errors.get(axis.name, "")
            self._errors[axis.name] = "" if error is None else str(error)
            if error is not None and str(error) != before:
                yield _fault(axis.name, error, snapshot.now)
            elif before and error is None:
                text = "it no longer has an error"
                yield MachineEvent(snapshot.now, MachineEventKind.WELL, "info", text, axis.name, (axis.name,))


def _axes_of(report: NodeReport) -> tuple[str, ...]:
    return tuple(axis.name for axis in report.axes)


def _fault(name: str, error: AxisbusError, now: float) -> MachineEvent:
    cause = tuple(seen_of(error).splitlines())
    return MachineEvent(
        now, MachineEventKind.FAULT, "error", error.message, name, (name,), cause, error.remedy
    )


# -- commands, the bus, error control, shutdown --------------------------------------------------------------------------


def _of_command(entry: CommandSeen) -> Iterator[_Found]:
    quiet = _JOG in entry.name or entry.name.endswith(_HALT)
    if not quiet:
        yield _Found(entry.given, (entry.name, entry.given), partial(_given, entry))
    if entry.ended is not None and (entry.status is Status.ERROR or not quiet):
        yield _Found(entry.ended, (entry.name, entry.given, "end"), partial(_ended, entry, entry.ended))


def _given(entry: CommandSeen) -> MachineEvent:
    return MachineEvent(
        entry.given, MachineEventKind.COMMAND, "info", f"{entry.name}: given", _client_of(entry)
    )


def _ended(entry: CommandSeen, stamp: float) -> MachineEvent:
    severity: Severity = "error" if entry.status is Status.ERROR else "info"
    cause = (entry.error,) if entry.error else ()
    text = f"{entry.name}: {entry.status.value}"
    return MachineEvent(stamp, MachineEventKind.COMMAND, severity, text, _client_of(entry), cause=cause)


def _client_of(entry: CommandSeen) -> str:
    return entry.name.partition(".")[0]


def _bus(event: ControllerEvent) -> MachineEvent:
    if event.condition is CanErrorState.ACTIVE:
        return MachineEvent(event.stamp, MachineEventKind.BUS, "info", str(event))
    severity: Severity = "error" if event.condition is CanErrorState.OFF else "warning"
    return MachineEvent(
        event.stamp, MachineEventKind.BUS, severity, str(event), remedy=f"check {WHAT_TO_CHECK}"
    )


def _of_event(event: NodeEvent | ShutdownRequest, axes: dict[int, tuple[str, ...]]) -> _Found:
    if isinstance(event, ShutdownRequest):
        left = MachineEvent(event.stamp, MachineEventKind.LEFT, "warning", str(event))
        return _Found(event.stamp, event, lambda: left)
    key = event.node, event.kind, event.stamp
    return _Found(event.stamp, key, partial(_node, event, axes.get(event.node, ())))


def _node(event: NodeEvent, axes: tuple[str, ...]) -> MachineEvent:
    severity: Severity = "error" if event.kind in BAD else "info"
    return MachineEvent(event.stamp, MachineEventKind.NODE, severity, str(event), f"node {event.node}", axes)


# -- emergency messages ------------------------------------------------------------------------------------------------


def _of_node(node: NodeAccess, axes: tuple[str, ...], now: float) -> Iterator[_Found]:
    for emcy in tuple(node.emcy):
        yield _Found(emcy.stamp, (node.node_id, emcy), partial(_emcy, node, axes, emcy))
    for incident in node.incidents:
        for kind, stamp in _stages(incident, now):
            key = node.node_id, incident.number, incident.began, kind
            yield _Found(stamp, key, partial(_incident, node, axes, incident, kind, stamp))


def _emcy(node: NodeAccess, axes: tuple[str, ...], emcy: Emcy) -> MachineEvent:
    severity: Severity = "info" if emcy.is_reset else "warning"
    text = f"EMCY {emcy_words(emcy, node.parts.make)}"
    return MachineEvent(emcy.stamp, MachineEventKind.EMCY, severity, text, f"node {node.node_id}", axes)


def _stages(incident: Incident, now: float) -> Iterator[tuple[MachineEventKind, float]]:
    yield MachineEventKind.INCIDENT, incident.began
    if now - incident.began > _SETTLED:
        yield MachineEventKind.SETTLED, incident.began
    if incident.ended is not None:
        yield MachineEventKind.OVER, incident.ended


def _incident(
    node: NodeAccess, axes: tuple[str, ...], incident: Incident, kind: MachineEventKind, stamp: float
) -> MachineEvent:
    first, *lines = node.format_incident(incident)
    summary, about = first.rpartition(",")[0], f"node {node.node_id}"
    if kind is MachineEventKind.OVER:
        return MachineEvent(stamp, kind, "info", summary, about, axes)
    text = summary if kind is MachineEventKind.SETTLED else f"incident {incident.number} has begun"
    return MachineEvent(stamp, kind, "error", text, about, axes, tuple(line.strip() for line in lines))
