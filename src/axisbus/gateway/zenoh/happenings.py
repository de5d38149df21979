"""What has happened at a machine since the last look: nodes, emergencies, incidents, axes in ErrorStop, the bus, commands."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import NamedTuple

from axisbus.bus.link.controller import ControllerEvent
from axisbus.bus.link.errorframe import WHAT_TO_CHECK, Condition
from axisbus.bus.node.events import BAD, NodeEvent
from axisbus.cia301.incident import Incident
from axisbus.drives.emergency import emcy_words
from axisbus.drives.registry import make_of
from axisbus.errors import AxisbusError
from axisbus.gateway.zenoh.numbered import Happened, Severity
from axisbus.gateway.zenoh.ours import without
from axisbus.machine.machine import Machine
from axisbus.machine.node_access import NodeAccess
from axisbus.motion.ticket import Status
from axisbus.session import CommandSeen

_JOG = ".jog("  # comes twenty times a second: only what has gone wrong with one is told
_HALT = ".halt"  # without brackets: of the core's own, where the command changes hands
_BEGAN = 1e-3  # seconds that two ends of a list may differ in their clocks


class _Found(NamedTuple):
    stamp: float
    key: Hashable
    happened: Happened


class Happenings:
    """Looks at a machine again and again; holds what it has told. Times are of the monotonic clock, in seconds."""

    def __init__(self, machine: Machine, since: float) -> None:
        """``since``: what was before is not told, but for what is so still."""
        self._machine = machine
        self._since = since
        self._told: set[Hashable] = set()
        self._errors: dict[str, str] = {}

    def take(self) -> list[Happened]:
        """Return what has happened and was not returned yet, in the order of time; blocks for some answers of the core.

        Raises:
            AxisbusError: the core is gone.
        """
        found = [one for one in self._look() if one.stamp >= self._since - _BEGAN]
        new = sorted((one for one in found if one.key not in self._told), key=lambda one: one.stamp)
        self._told = {one.key for one in found}  # what the machine has forgotten is not kept here
        return [*(one.happened for one in new), *self._of_axes()]

    def _look(self) -> Iterator[_Found]:
        session = self._machine.session
        for command in session.commands:
            yield from _of_command(command)
        for event in session.node_events:
            yield _of_node_event(event)
        for change in session.bus_events:
            yield _of_bus(change)
        if session.left is not None:
            stamp, why = session.left
            text = f"every axis is stopped, and no command is taken any more: {why}"
            yield _Found(stamp, ("left", stamp), Happened("machine", text, severity="warning"))
        for report in self._machine.reports:
            yield from _of_node(self._machine.node(report.node_id))

    def _of_axes(self) -> Iterator[Happened]:
        """Tell which axes have come into ErrorStop, or out of it."""
        for axis in self._machine:
            error, before = axis.error, self._errors.get(axis.name, "")
            now = "" if error is None else error.message
            self._errors[axis.name] = now
            if error is not None and now != before:
                yield of_error(axis.name, error)
            elif before and not now:
                yield Happened("incident", f"{axis.name}: it has no error any more", axis.name)


def of_error(about: str, error: AxisbusError) -> Happened:
    """Return an error as something that has happened."""
    return Happened("incident", without(error.message), about, "error", without(error.observed), error.remedy)


def _of_command(seen: CommandSeen) -> Iterator[_Found]:
    name = without(seen.name)
    axis, failed = name.partition(".")[0], seen.status is Status.ERROR
    quiet = _JOG in name or name.endswith(_HALT)
    if not quiet:
        yield _Found(seen.given, (name, seen.given), Happened("command", f"{name}: given", axis))
    if seen.ended is not None and (failed or not quiet):
        happened = Happened(
            "command",
            f"{name}: {seen.status.value}",
            axis,
            "error" if failed else "info",
            without(seen.error),
        )
        yield _Found(seen.ended, (name, seen.given, "end"), happened)


def _of_node_event(event: NodeEvent) -> _Found:
    bad = event.kind in BAD
    happened = Happened("node", str(event), f"node {event.node}", "error" if bad else "info")
    return _Found(event.stamp, (event.node, event.kind, event.stamp), happened)


def _of_bus(event: ControllerEvent) -> _Found:
    well = event.condition is Condition.ACTIVE
    severity: Severity = "info" if well else "error" if event.condition is Condition.OFF else "warning"
    remedy = "" if well else f"check {WHAT_TO_CHECK}"
    return _Found(
        event.stamp,
        ("bus", event.condition, event.stamp),
        Happened("bus", str(event), severity=severity, remedy=remedy),
    )


def _of_node(node: NodeAccess) -> Iterator[_Found]:
    about, make = f"node {node.node_id}", make_of(node.eds, node.node_id)
    for emcy in node.emcy:
        happened = Happened("emcy", emcy_words(emcy, make), about, "info" if emcy.is_reset else "warning")
        yield _Found(emcy.stamp, (node.node_id, emcy), happened)
    for incident in node.incidents:
        yield from _of_incident(node, incident, about)


def _of_incident(node: NodeAccess, incident: Incident, about: str) -> Iterator[_Found]:
    first, *lines = node.incident_words(incident)
    cause = "; ".join(line.strip() for line in lines)
    key = node.node_id, incident.number, incident.began
    text = f"{about}: incident {incident.number} has begun"
    yield _Found(incident.began, key, Happened("incident", text, about, "error", cause))
    if incident.ended is not None:
        over = f"{about}, {first.rpartition(',')[0]}"
        yield _Found(incident.ended, (*key, "end"), Happened("incident", over, about))
