"""The files of a cell: the cell file, and the EDS or DCF of each node that has one."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.eds import load
from axisbus.eds.builtin import resolve
from axisbus.eds.model import Eds


def load_dictionaries(cell: CellConfig) -> dict[int, Eds]:
    """Read the EDS or DCF of every CANopen node; blocks until they are read.

    A module that uses CAN Simple has none, and is not included.

    Raises:
        EdsError: one is missing or cannot be read.
    """
    return {
        node_id: load(resolve(node.file or "", cell.folder))
        for node_id, node in sorted(cell.nodes.items())
        if node.module is None
    }


@cache
def read_once(cell: str) -> tuple[CellConfig, Mapping[int, Eds]]:
    """Read a cell and its dictionaries, once: a forked child has its parent's result. Raises as ``cell.reader.load``."""
    config = reader.load(cell)
    return config, load_dictionaries(config)
