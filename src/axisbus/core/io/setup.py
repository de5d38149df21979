"""Bringing the inputs and outputs of a node into the scan, and seeing their outputs safe when it has ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

from axisbus.cell.io.signals import points_of
from axisbus.cell.model import CellConfig
from axisbus.core.io.io_scan import IoScan
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import NodeError
from axisbus.link import Unsafe
from axisbus.motion.io.node import NodeIo

if TYPE_CHECKING:
    from axisbus.core.runtime import CellLink


def add_io(board: IoScan, cell: CellConfig, link: CellLink, node_id: int, eds: Eds) -> None:
    """Take in the inputs and outputs of a node that has come up, where the cell names any."""
    port = link.io(node_id)
    if port is not None:
        points = points_of(cell, node_id, Dictionary(eds, node_id))
        board.add(NodeIo(node_id, points, port), port)


def confirm_safe_outputs(board: IoScan, link: CellLink) -> list[Unsafe]:
    """See that every output that was set is in its safe state, or lead it there; return what is not confirmed. Blocks.

    That the scan has sent it says little: a node may be gone for a moment before that is known of it.
    """
    ours = board.ours
    return link.make_safe(ours) if ours else []


def unconfirmed(board: IoScan) -> list[Unsafe]:
    """Return the outputs that were set, as long as nobody has looked at them."""
    text = "leaving was broken off before it was looked at"
    return [Unsafe(point.name, point.node, f"{point.object_text}: {text}") for point in board.ours]


def not_safe(unsafe: Unsafe) -> NodeError:
    """Return what closing tells of an output that is not confirmed to be safe."""
    return NodeError(
        f"{unsafe.output} could not be confirmed as safe",
        node=unsafe.node,
        observed=unsafe.text,
        remedy="LOOK AT IT before anybody goes near; its module's own watch over us is left armed, and may have done it",
    )
