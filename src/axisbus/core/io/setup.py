"""Add the inputs and outputs of a node to the scan, and confirm that their outputs are safe when it has ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

from axisbus.cell.io_signals import points_of
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
    """Add the inputs and outputs of a booted node, if the cell names any."""
    port = link.io(node_id)
    if port is not None:
        points = points_of(cell, node_id, Dictionary(eds, node_id))
        board.add(NodeIo(node_id, points, port), port)


def confirm_safe_outputs(board: IoScan, link: CellLink) -> list[Unsafe]:
    """Confirm or set the safe state of every output that was set; return those that are not confirmed. Blocks.

    That the scan has sent the safe value is no proof: a node may be lost for a moment before the loss is detected.
    """
    ours = board.ours
    return link.make_safe(ours) if ours else []


def unconfirmed(board: IoScan) -> list[Unsafe]:
    """Return the outputs that were set, before any of them has been checked."""
    text = "closing was aborted before the output was checked"
    return [Unsafe(point.name, point.node, f"{point.object_text}: {text}") for point in board.ours]


def not_safe(unsafe: Unsafe) -> NodeError:
    """Return the error of closing for an output that is not confirmed to be safe."""
    return NodeError(
        f"{unsafe.output} could not be confirmed as safe",
        node=unsafe.node,
        observed=unsafe.text,
        remedy="CHECK IT before a person goes near; its module's monitoring of this master's heartbeat remains active, and "
        "may have done it",
    )
