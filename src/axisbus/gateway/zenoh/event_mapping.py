"""Map the events of a machine to events for the network: without the name of this process, and by kind."""

from __future__ import annotations

from collections.abc import Iterable

from axisbus.gateway import machine_events
from axisbus.gateway.machine_events import MachineEvent
from axisbus.gateway.zenoh.event_log import Happened, Kind
from axisbus.gateway.zenoh.redact_process import without

# Other kinds are not reported: of an incident, only its beginning and its end are.
KINDS: dict[machine_events.MachineEventKind, Kind] = {
    machine_events.MachineEventKind.COMMAND: "command",
    machine_events.MachineEventKind.NODE: "node",
    machine_events.MachineEventKind.BUS: "bus",
    machine_events.MachineEventKind.LEFT: "machine",
    machine_events.MachineEventKind.EMCY: "emcy",
    machine_events.MachineEventKind.INCIDENT: "incident",
    machine_events.MachineEventKind.OVER: "incident",
    machine_events.MachineEventKind.FAULT: "incident",
    machine_events.MachineEventKind.WELL: "incident",
}


def told(found: Iterable[MachineEvent]) -> list[Happened]:
    """Return the events to report, in their order."""
    return [
        Happened(
            KINDS[one.kind],
            without(one.text),
            one.about,
            one.severity,
            without("; ".join(one.cause)),
            one.remedy,
        )
        for one in found
        if one.kind in KINDS
    ]
