"""What has happened at a machine, as it is told by OPC UA: what has gone wrong, with the severities of the standard."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from axisbus.gateway.machine_events import Happening, Kind, Severity
from axisbus.wording import with_subject

# Severities of OPC 10000-5 6.4.2 (1 to 1000; from 801 on it is urgent). What is not here is not told.
SEVERITIES: dict[tuple[Kind, Severity], int] = {
    (Kind.FAULT, "error"): 900,
    (Kind.NODE, "error"): 900,
    (Kind.BUS, "error"): 900,
    (Kind.SETTLED, "error"): 800,  # an incident is told once, with all its messages
    (Kind.EMCY, "warning"): 700,
    (Kind.BUS, "warning"): 600,
    (Kind.LEFT, "warning"): 500,
    (Kind.EMCY, "info"): 100,
    (Kind.NODE, "info"): 100,
    (Kind.BUS, "info"): 100,
}
REFUSED = 500


class Told(NamedTuple):
    """What an event says: ``stamp`` in seconds of the machine's clock, ``cause`` what was seen, ``remedy`` what to do first."""

    stamp: float
    severity: int
    message: str
    cause: str = ""
    remedy: str = ""
    axis: str = ""


def told(happenings: Iterable[Happening]) -> list[Told]:
    """Return what is told of what has happened, in its order."""
    return [
        Told(
            one.stamp,
            SEVERITIES[one.kind, one.severity],
            with_subject(one.about, one.text),
            "\n".join(one.cause),
            one.remedy,
            ", ".join(one.axes),
        )
        for one in happenings
        if (one.kind, one.severity) in SEVERITIES
    ]
