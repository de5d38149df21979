"""What direct access to a node is made of, as its link has it."""

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
    """What error control tells of a node: ``bus.node.events.NodeEvents``, here or in another process."""

    @property
    def events(self) -> list[NodeEvent]:
        """What it has told since the scan began, oldest first."""

    def hear(self, call: Callable[[NodeEvent], None]) -> None:
        """Have ``call`` called with every event from now on; it must not block."""


@dataclass(frozen=True, slots=True, eq=False)
class NodeParts:
    """``node`` is a ``CanopenNode``, or a ``DirectNode`` where there is no bus; ``clock`` (s) is that of its messages.

    ``plans`` are its PDOs, axis by axis; ``events`` is None where the node did not come up. ``has_objects``: whether it has an
    object dictionary, which ``eds`` is of; of one that has none, ``eds`` is what its axis is made of.
    """

    node_id: int
    eds: Eds
    objects: NodeObjects
    node: Any
    plans: tuple[PdoPlan, ...] = ()
    events: NodeEventSource | None = None
    clock: Callable[[], float] = time.monotonic
    has_objects: bool = True
