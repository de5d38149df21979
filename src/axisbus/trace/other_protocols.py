"""Frames of nodes that use a protocol other than CANopen, as text: the part of a drive plug-in that decodes them.

A plug-in names a ``TracePart`` in the ``parts`` of its ``Extension``.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from axisbus.cia301.frame import CanFrame
from axisbus.drives import registry
from axisbus.trace.services import Words

PACKAGE = "trace"


class NodeFrameText(NamedTuple):
    """The text of a frame of a named node; ``from_node`` is False if only a master can have sent it."""

    node: int
    words: Words
    from_node: bool


class NodeDecoder(Protocol):
    """Decodes the frames of named nodes; holds state."""

    def decode(self, frame: CanFrame) -> NodeFrameText | None:
        """Return the text of a frame; None if it belongs to none of the named nodes."""


@dataclass(frozen=True, slots=True)
class TracePart:
    """The frames that a plug-in knows: ``decoder`` of the nodes with these IDs, ``heartbeat``: the identifier of a node's."""

    decoder: Callable[[Collection[int]], NodeDecoder]
    heartbeat: Callable[[int], int]


def part_for(protocol: str) -> TracePart:
    """Return the part of the plug-in that has a protocol. Blocks while it is imported."""
    (part,) = registry.parts(PACKAGE, protocol)
    found: TracePart = part
    return found


def decoders(nodes: Mapping[str, Collection[int]]) -> list[NodeDecoder]:
    """Return the decoders of nodes, which are given by their protocols."""
    ids: dict[TracePart, set[int]] = {}
    for protocol, some in nodes.items():
        ids.setdefault(part_for(protocol), set()).update(some)
    return [part.decoder(found) for part, found in ids.items()]
