"""The parts for direct access to a node, from its link."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from axisbus.boot.objects import NodeObjects
from axisbus.bus.node.events import NodeEvent
from axisbus.bus.pdo.plan import PdoPlan
from axisbus.clock import Clock
from axisbus.drives.plugin import GENERIC, DrivePlugin
from axisbus.eds.model import Eds
from axisbus.errors import StateError


class NodeEventSource(Protocol):
    """The events of error control for a node: ``bus.node.events.NodeEvents``, here or in another process."""

    @property
    def events(self) -> list[NodeEvent]:
        """The events since the scan began, oldest first."""

    def subscribe(self, callback: Callable[[NodeEvent], None]) -> None:
        """Call ``callback`` with every event from now on; it must not block."""


@dataclass(frozen=True, slots=True, eq=False)
class NodeParts:
    """The objects for the access to one node. ``node`` is a ``CanopenNode``; ``clock`` gives the time stamps of its messages.

    ``plans`` are its PDOs, axis by axis; ``events`` is None if the node did not come up. ``objects_refused`` is None if it has an
    object dictionary, which ``eds`` describes. If it has none, ``eds`` describes its axis, and the function returns the error for
    an access to objects, for a reason (empty: the usual one). ``make`` is the drive plug-in by the identity in ``eds``.
    """

    node_id: int
    eds: Eds
    objects: NodeObjects
    node: Any
    clock: Clock
    plans: tuple[PdoPlan, ...] = ()
    events: NodeEventSource | None = None
    objects_refused: Callable[[str], StateError] | None = None
    make: DrivePlugin = GENERIC

    @property
    def has_objects(self) -> bool:
        """Whether the node has an object dictionary."""
        return self.objects_refused is None
