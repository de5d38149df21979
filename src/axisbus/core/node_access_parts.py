"""The parts for direct access to a node, from its link."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from axisbus.boot.objects import NodeObjects
from axisbus.bus.node.events import NodeEvent
from axisbus.bus.pdo.plan import PdoPlan
from axisbus.eds.model import Eds


class NodeEventSource(Protocol):
    """The events of error control for a node: ``bus.node.events.NodeEvents``, here or in another process."""

    @property
    def events(self) -> list[NodeEvent]:
        """The events since the scan began, oldest first."""

    def hear(self, call: Callable[[NodeEvent], None]) -> None:
        """Call ``call`` with every event from now on; it must not block."""


@dataclass(frozen=True, slots=True, eq=False)
class NodeParts:
    """``node`` is a ``CanopenNode``, or a ``DirectNode`` if there is no bus; ``clock`` (s) is that of its messages.

    ``plans`` are its PDOs, axis by axis; ``events`` is None if the node did not come up. ``has_objects``: whether it has an object
    dictionary, which ``eds`` describes. If it has none, ``eds`` describes its axis.
    """

    node_id: int
    eds: Eds
    objects: NodeObjects
    node: Any
    plans: tuple[PdoPlan, ...] = ()
    events: NodeEventSource | None = None
    clock: Callable[[], float] = time.monotonic
    has_objects: bool = True
