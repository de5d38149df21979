"""The object dictionary of each node from its EDS, as a page fetches it: made once for all pages, without asking the node."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

from axisbus.cell.quantities import Quantities
from axisbus.client_support.object_access import node_of
from axisbus.core.node_access_parts import NodeParts
from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from axisbus.web.objects.dictionary import tree
from axisbus.web.objects.findings import findings
from axisbus.web.objects.pdos import layouts
from axisbus.web.view.axes import Values, explained


class DictionaryCache:
    """Cache the dictionary of each node for as long as its parts stay the same; used by one event loop."""

    def __init__(self, machine: Machine) -> None:
        """Make no dictionary before it is requested."""
        self._machine = machine
        self._made: dict[int, tuple[NodeParts, bytes]] = {}
        self._making = asyncio.Lock()

    async def page(self, node_id: int) -> bytes:
        """Return the dictionary, the PDOs and the findings of a node as JSON, or why there is none."""
        async with self._making:  # fifty simultaneous requests must make it only once
            try:
                return await self._page(node_id)
            except AxisbusError as error:
                return json.dumps({"node": node_id, "error": explained(error)}).encode()

    async def _page(self, node_id: int) -> bytes:
        parts = node_of(self._machine, node_id).access.parts
        made = self._made.get(node_id)
        if made is None or made[0] is not parts:  # a node that joined late has new parts
            told = await asyncio.to_thread(book, self._machine, node_id)
            self._made[node_id] = made = parts, json.dumps(told).encode()
        return made[1]


def book(machine: Machine, node_id: int) -> Values:
    """Return the dictionary of a node as plain values; may take a second.

    Raises:
        StateError: as ``node_of``.
    """
    node = node_of(machine, node_id)
    assert node.eds is not None
    return {
        "node": node_id,
        "file": Path(node.eds.source).name,
        "objects": tree(node, Quantities(machine.cell)),
        "pdos": layouts(node.eds, node_id, node.access.plans),
        "findings": findings(node.eds),
        "error": None,
    }
