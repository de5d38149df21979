"""The requests of a program to its core, apart from commands: one row for each, answered by plain values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from axisbus.core.node_access_parts import NodeParts
from axisbus.errors import AxisbusError, ScanError, one_line
from axisbus.ipc.messages import CoreCondition
from axisbus.session import MachineSession

# Of the core itself; in the order of ``MachineSession``.
OF_CORE: Mapping[str, Callable[[MachineSession], Any]] = {
    "node_events": lambda session: session.node_events,
    "bus_events": lambda session: session.bus_events,
    "commands": lambda session: session.commands,
    "drops": lambda session: session.drops,
    "sdo_counts": lambda session: session.sdo_counts,
    "programs": lambda session: session.programs,  # while the core runs, ``clients`` answers this
    "bus_time": lambda session: session.bus_time,
}

# Of one node; the further parameters are the arguments of the request.
OF_NODE: Mapping[str, Callable[..., Any]] = {
    "read": lambda parts, *key: parts.objects.read(*key),
    "write": lambda parts, *what: parts.objects.write(*what),
    "write_unchecked": lambda parts, *what: parts.objects.write_unchecked(*what),
    "upload": lambda parts, *key: parts.objects.upload(*key),
    "download": lambda parts, index, subindex, data, way: parts.objects.download(
        index, subindex, data, way=way
    ),
    "nmt": lambda parts: parts.node.nmt.state,
    "reports": lambda parts: parts.node.nmt.reports,
    "command": lambda parts, command, timeout: _command(parts, command, timeout),
    "emcy": lambda parts: list(parts.node.emcy.history),
    "incidents": lambda parts: list(parts.node.emcy.incidents),
    "pdo_events": lambda parts: list(parts.node.pdo_events),
    "events": lambda parts: [] if parts.events is None else parts.events.events,
}


# Requests that change something: only for the client with control.
COMMANDING = frozenset({"write", "write_unchecked", "download", "command"})

# Requests about a node that are still of interest after the core has ended.
_KEPT = ("nmt", "reports", "emcy", "incidents", "pdo_events", "events")


def last_words(session: MachineSession, nodes: Mapping[int, NodeParts]) -> dict[tuple[int, str], Any]:
    """Return the present answers to all requests without a transfer, by node (0: the core) and request."""
    found: dict[tuple[int, str], Any] = {(0, what): answer(session) for what, answer in OF_CORE.items()}
    for node_id, parts in nodes.items():
        found.update({(node_id, what): OF_NODE[what](parts) for what in _KEPT})
    return found


def _command(parts: NodeParts, command: object, timeout: float) -> None:
    parts.node.command(command, timeout)


def condition_of(session: MachineSession) -> CoreCondition:
    """Return the present condition of a core."""
    return CoreCondition(session.dead, session.ended, session.failed, session.left)


def told(error: BaseException) -> AxisbusError:
    """Return an error that can be sent: one outside the tree becomes the cause of a ScanError."""
    if isinstance(error, AxisbusError):
        return error
    made = ScanError(
        "the core aborted the request",
        observed=one_line(error),
        remedy="this is a mistake in axisbus: please report it",
    )
    made.__cause__ = error
    return made
