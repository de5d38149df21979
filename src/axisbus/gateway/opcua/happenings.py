"""What has gone wrong at a machine, each told once: incidents, emergency messages, faults, lost nodes, the bus, the way out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from axisbus.bus.link.controller import ControllerEvent
from axisbus.bus.link.errorframe import WHAT_TO_CHECK, Condition
from axisbus.bus.node.events import BAD, NodeEvent
from axisbus.cia301.emcy import describe
from axisbus.cia301.incident import TOGETHER
from axisbus.errors import AxisbusError
from axisbus.machine.exit import Leaving
from axisbus.machine.machine import Machine
from axisbus.machine.node_access import NodeAccess

# Severities of OPC 10000-5 6.4.2 (1 to 1000; from 801 on it is urgent).
FAULT, LOST, BUS_OFF, BUS_WARNING, INCIDENT, EMCY, LEAVING, REFUSED, RESET, BACK = (
    900,
    900,
    900,
    600,
    800,
    700,
    500,
    500,
    100,
    100,
)
_SETTLED = 2 * TOGETHER  # seconds after which all that belongs to an incident has come


class Happening(NamedTuple):
    """Something to be told: ``stamp`` in seconds of the machine's clock, ``cause`` what was seen, ``remedy`` what to do first."""

    stamp: float
    severity: int
    message: str
    cause: str = ""
    remedy: str = ""
    axis: str = ""


class Happenings:
    """Finds what is new in the lists of a machine; holds the newest time of each list, and the error of each axis.

    The lists of a machine are short and are looked at about twice a second. Times are of the computer's clock, so that what was
    told of one machine is not told again of the next.
    """

    def __init__(self) -> None:
        self._newest: dict[object, float] = {}
        self._errors: dict[str, AxisbusError] = {}

    def look(self, machine: Machine, now: float) -> list[Happening]:
        """Return what is new at ``now`` (seconds of the machine's clock), the oldest first. May block for a moment."""
        found = [*self._of_nodes(machine, now), *self._of_machine(machine), *self._of_axes(machine)]
        return sorted(found, key=lambda happening: happening.stamp)

    def _new(self, key: object, found: Iterable[Happening]) -> Iterator[Happening]:
        """Yield what of a list is newer than all of it that was seen before."""
        before = newest = self._newest.get(key, float("-inf"))
        for happening in found:
            if happening.stamp > before:
                newest = max(newest, happening.stamp)
                yield happening
        self._newest[key] = newest

    def _of_nodes(self, machine: Machine, now: float) -> Iterator[Happening]:
        for report in machine.reports:
            node = machine.node(report.node_id)
            axes = ", ".join(axis.name for axis in report.axes)
            yield from self._new(("emcy", node.node_id), _emcys(node, axes))
            yield from self._new(("incident", node.node_id), _incidents(node, axes, now))

    def _of_machine(self, machine: Machine) -> Iterator[Happening]:
        yield from self._new("bus", map(_of_controller, machine.bus_events))
        yield from self._new("events", map(_of_event, machine.events))

    def _of_axes(self, machine: Machine) -> Iterator[Happening]:
        for axis in machine:
            snapshot = axis.snapshot
            error, before = snapshot.error, self._errors.pop(axis.name, None)
            if error is None:
                continue
            self._errors[axis.name] = error
            if before is None or str(before) != str(error):
                yield _fault(axis.name, error, snapshot.now)


def _emcys(node: NodeAccess, axes: str) -> Iterator[Happening]:
    for emcy in tuple(node.emcy):
        text = f"node {node.node_id}: EMCY {describe(emcy.code)}"
        yield Happening(emcy.stamp, RESET if emcy.is_reset else EMCY, text, axis=axes)


def _incidents(node: NodeAccess, axes: str, now: float) -> Iterator[Happening]:
    for incident in node.incidents:
        if now - incident.began > _SETTLED:
            first, *rest = node.incident_words(incident)
            text = f"node {node.node_id}, {first.rpartition(',')[0]}"
            yield Happening(incident.began, INCIDENT, text, "\n".join(rest), axis=axes)


def _of_controller(event: ControllerEvent) -> Happening:
    well = event.condition is Condition.ACTIVE
    worst = BUS_OFF if event.condition is Condition.OFF else BUS_WARNING
    return Happening(
        event.stamp, BACK if well else worst, str(event), remedy="" if well else f"check {WHAT_TO_CHECK}"
    )


def _of_event(event: NodeEvent | Leaving) -> Happening:
    if isinstance(event, Leaving):
        return Happening(event.stamp, LEAVING, str(event))
    return Happening(event.stamp, LOST if event.kind in BAD else BACK, str(event))


def _fault(name: str, error: AxisbusError, now: float) -> Happening:
    text = error.message if error.message.startswith(name) else f"{name}: {error.message}"
    return Happening(now, FAULT, text, error.observed, error.remedy, name)
