"""Map the events of a machine to OPC UA: errors and warnings, with the severities of the standard."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from axisbus.gateway.machine_events import MachineEvent, MachineEventKind, Severity
from axisbus.wording import with_subject

# Severities of OPC 10000-5 6.4.2 (1 to 1000; urgent from 801). Events that are not listed are not reported.
SEVERITIES: dict[tuple[MachineEventKind, Severity], int] = {
    (MachineEventKind.FAULT, "error"): 900,
    (MachineEventKind.NODE, "error"): 900,
    (MachineEventKind.BUS, "error"): 900,
    (MachineEventKind.SETTLED, "error"): 800,  # an incident is reported once, with all its messages
    (MachineEventKind.EMCY, "warning"): 700,
    (MachineEventKind.BUS, "warning"): 600,
    (MachineEventKind.LEFT, "warning"): 500,
    (MachineEventKind.EMCY, "info"): 100,
    (MachineEventKind.NODE, "info"): 100,
    (MachineEventKind.BUS, "info"): 100,
}
REFUSED = 500


class OpcuaEvent(NamedTuple):
    """An event: ``stamp`` in seconds of the machine's clock, ``cause`` the observation, ``remedy`` the first thing to do."""

    stamp: float
    severity: int
    message: str
    cause: str = ""
    remedy: str = ""
    axis: str = ""


def opcua_events(events: Iterable[MachineEvent]) -> list[OpcuaEvent]:
    """Return the events to report, in their order."""
    return [
        OpcuaEvent(
            one.stamp,
            SEVERITIES[one.kind, one.severity],
            with_subject(one.about, one.text),
            "\n".join(one.cause),
            one.remedy,
            ", ".join(one.axes),
        )
        for one in events
        if (one.kind, one.severity) in SEVERITIES
    ]
