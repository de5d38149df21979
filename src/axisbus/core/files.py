"""The files of a cell: its own, and the EDS or DCF of each node."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.eds import load
from axisbus.eds.builtin import resolve
from axisbus.eds.model import Eds
from axisbus.errors import ConfigError


def load_dictionaries(cell: CellConfig) -> dict[int, Eds]:
    """Read the EDS or DCF of every node; blocks for as long as that takes.

    Raises:
        EdsError: one is missing or cannot be read.
        ConfigError: a node speaks CAN Simple.
    """
    for node in cell.nodes.values():
        if node.module is not None:  # nothing here would reach it, and nobody may believe that something did
            raise ConfigError(
                f"node {node.node_id} speaks CAN Simple, and is not reached by this command",
                file=cell.file,
                line=node.at.line,
                remedy="leave node and axis out of the cell file for it",
            )
    return {
        node_id: load(resolve(node.file or "", cell.folder)) for node_id, node in sorted(cell.nodes.items())
    }


@cache
def read_once(cell: str) -> tuple[CellConfig, Mapping[int, Eds]]:
    """Read a cell and its dictionaries, once: a forked child has what its parent has read. Raises as ``cell.reader.load`` does."""
    config = reader.load(cell)
    return config, load_dictionaries(config)
