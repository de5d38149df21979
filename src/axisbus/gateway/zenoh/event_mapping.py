"""What has happened at a machine, as it is told over the network: without this process, and as a kind of event."""

from __future__ import annotations

from collections.abc import Iterable

from axisbus.gateway import machine_events
from axisbus.gateway.machine_events import Happening
from axisbus.gateway.zenoh.event_log import Happened, Kind
from axisbus.gateway.zenoh.redact_process import without

# What is not here is not told: of an incident, when it begins and when it is over.
KINDS: dict[machine_events.Kind, Kind] = {
    machine_events.Kind.COMMAND: "command",
    machine_events.Kind.NODE: "node",
    machine_events.Kind.BUS: "bus",
    machine_events.Kind.LEFT: "machine",
    machine_events.Kind.EMCY: "emcy",
    machine_events.Kind.INCIDENT: "incident",
    machine_events.Kind.OVER: "incident",
    machine_events.Kind.FAULT: "incident",
    machine_events.Kind.WELL: "incident",
}


def told(found: Iterable[Happening]) -> list[Happened]:
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
