"""What has happened at a machine, as it is told over the network: without this process, and as a kind of event."""

from __future__ import annotations

from collections.abc import Iterable

from axisbus.gateway import machine_events
from axisbus.gateway.machine_events import MachineEvent
from axisbus.gateway.zenoh.event_log import Happened, Kind
from axisbus.gateway.zenoh.redact_process import without

# What is not here is not told: of an incident, when it begins and when it is over.
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
    """Return what is told of what has happened, in its order."""
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
