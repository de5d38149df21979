"""Modules on a serial line (``[bus] interface = "modbus"``): the options of their relay."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.cell.can_simple.endpoint_list import list_of
from axisbus.cell.can_simple.modules import is_line
from axisbus.cell.model import CellConfig


def line_options(cell: CellConfig) -> Mapping[str, object]:
    """Return the adapter's options beside ``[bus.options]``: on a serial line, the list of endpoints of each module.

    Raises:
        ArgumentError: a list is unusable; ``axisbus check`` reports it with its line.
    """
    if not is_line(cell.bus):
        return {}
    lists = {node.node_id: list_of(node, cell.folder) for node in cell.nodes.values()}
    return {"modules": {node_id: found for node_id, found in lists.items() if found is not None}}
