"""What has happened at a machine, as it is told over the network: without this process, and as a kind of event."""

from __future__ import annotations

from collections.abc import Iterable

from axisbus.gateway import happenings
from axisbus.gateway.happenings import Happening
from axisbus.gateway.zenoh.numbered import Happened, Kind
from axisbus.gateway.zenoh.ours import without

# What is not here is not told: of an incident, when it begins and when it is over.
KINDS: dict[happenings.Kind, Kind] = {
    happenings.Kind.COMMAND: "command",
    happenings.Kind.NODE: "node",
    happenings.Kind.BUS: "bus",
    happenings.Kind.LEFT: "machine",
    happenings.Kind.EMCY: "emcy",
    happenings.Kind.INCIDENT: "incident",
    happenings.Kind.OVER: "incident",
    happenings.Kind.FAULT: "incident",
    happenings.Kind.WELL: "incident",
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
