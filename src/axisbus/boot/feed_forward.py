"""Check that the special outputs of an axis (feed-forward offsets, ip set-points) travel in synchronous PDOs."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from axisbus.cell.model import AxisConfig
from axisbus.cia402 import dictionary as catalogue
from axisbus.cia402.axes import own_index
from axisbus.cia402.port import ALL_OUTPUTS, INTERPOLATION_OBJECTS, OFFSET_OBJECTS, ValueTransport
from axisbus.errors import BootError

_WHAT = {
    **dict.fromkeys(OFFSET_OBJECTS, "its feed-forward"),
    **dict.fromkeys(INTERPOLATION_OBJECTS, "its set-points of ip"),
}
_REMEDY = {
    **dict.fromkeys(OFFSET_OBJECTS, "delete the keys that need it in [axes.{name}.feed_forward]"),
    **dict.fromkeys(INTERPOLATION_OBJECTS, "leave ip and csp out of modes in [axes.{name}]"),
}
_WHY = {
    ValueTransport.NONE: "the drive does not have it",
    ValueTransport.SDO: "none of its RPDOs contains it: it would be sent by SDO, too late for the motion",
    ValueTransport.EVENT_PDO: "its RPDO is event-driven",
}


def require_synchronous(
    axis: AxisConfig, names: Collection[str], outputs: Mapping[str, ValueTransport]
) -> None:
    """Check that all of ``names``, the special outputs of an axis, travel in a synchronous PDO.

    Raises:
        BootError: one of them does not; the master has not sent it yet.
    """
    for name in sorted(names, key=ALL_OUTPUTS.__getitem__):
        source = outputs.get(name, ValueTransport.NONE)
        if source is not ValueTransport.SYNC_PDO:
            index = own_index(ALL_OUTPUTS[name], axis.drive_axis)
            raise BootError(
                f"axis {axis.name}: {_WHAT[name]} cannot be sent by {index:04X}h ({catalogue.name(ALL_OUTPUTS[name])})",
                node=axis.node,
                step="PDO configuration",
                index=index,
                observed=_WHY[source],
                remedy=f"{_REMEDY[name].format(name=axis.name)}, or allow remapping of the node, with sync = true in [bus]",
            )
