"""Whether the offsets of feed-forward travel with SYNC, as they must."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.cell.forward.asked import feed_forward
from axisbus.cell.model import AxisConfig
from axisbus.cia402 import dictionary as catalogue
from axisbus.cia402.axes import own_index
from axisbus.cia402.port import OFFSET_OBJECTS, Source
from axisbus.errors import BootError

_WHY = {
    Source.NONE: "the drive does not have it",
    Source.SDO: "none of its RPDOs carries it: it would go by SDO, behind the motion",
    Source.EVENT_PDO: "its RPDO is event-driven",
}


def require_offsets(axis: AxisConfig, outputs: Mapping[str, Source]) -> None:
    """Raise where an offset that the cell file asks for does not travel in a synchronous PDO.

    Raises:
        BootError: one does not; nothing was sent by it.
    """
    asked = feed_forward(axis, None)
    for name in () if asked is None else asked.outputs:
        source = outputs.get(name, Source.NONE)
        if source is not Source.SYNC_PDO:
            index = own_index(OFFSET_OBJECTS[name], axis.drive_axis)
            raise BootError(
                f"axis {axis.name}: its feed-forward cannot be sent by {index:04X}h ({catalogue.name(OFFSET_OBJECTS[name])})",
                node=axis.node,
                step="PDO configuration",
                index=index,
                observed=_WHY[source],
                remedy=f"delete what asks for it in [axes.{axis.name}.feed_forward], or let the node be remapped",
            )
