"""Convert ``[axes.NAME.feed_forward]`` to the settings of motion and the outputs of the PDOs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from axisbus.bus.pdo.plan import PdoRequirements
from axisbus.cell.axis_description import Drive
from axisbus.cell.cyclic_modes.interpolated import interpolates
from axisbus.cell.model import AxisConfig, NodeConfig
from axisbus.cia402.port import INTERPOLATION_OBJECTS, OUTPUT_OBJECTS, ValueTransport
from axisbus.eds.model import Eds
from axisbus.motion.feed_forward.settings import FeedForward
from axisbus.motion.parameters import AxisParameters

_POSITION_TURNED, _VELOCITY_TURNED = 0x80, 0x40  # 607Eh (CiA 402-2, polarity)


def feed_forward(axis: AxisConfig, polarity: int | None) -> FeedForward | None:
    """Return the feed-forward of the axis, None if it has none; ``polarity``: the drive's 607Eh after boot (None: missing)."""
    given = axis.feed_forward
    bits = polarity or 0
    turned = bool(bits & _POSITION_TURNED) != bool(bits & _VELOCITY_TURNED)
    asked = FeedForward(given.velocity, given.inertia, given.torque_offset, turned)
    return asked if asked.outputs else None


def more_outputs(axis: AxisConfig, node: NodeConfig, eds: Eds | None, sync: bool = True) -> tuple[str, ...]:
    """Return the additional outputs of an axis: its feed-forward offsets, and the target of ip if the master commands it in ip.

    ``sync``: whether the bus has SYNC; without SYNC, no mode takes a target in each cycle.
    """
    asked = feed_forward(axis, None)
    offsets = () if asked is None else asked.outputs
    by_ip = sync and eds is not None and interpolates(Drive.of(axis, node, eds))
    return (*offsets, *(INTERPOLATION_OBJECTS if by_ip else ()))


def wanted_of(axis: AxisConfig, node: NodeConfig, eds: Eds | None, sync: bool = True) -> PdoRequirements:
    """Return the values that an axis's PDOs must carry."""
    more = more_outputs(axis, node, eds, sync)
    return (
        PdoRequirements(outputs=(*OUTPUT_OBJECTS, *more), synchronous_outputs=frozenset(more))
        if more
        else PdoRequirements()
    )


def carried(parameters: AxisParameters, outputs: Mapping[str, ValueTransport]) -> AxisParameters:
    """Return the parameters without the feed-forward that no PDO carries: a drive found enabled keeps its mapping."""
    asked = parameters.feed_forward
    if asked is not None and not all(outputs.get(name) is ValueTransport.SYNC_PDO for name in asked.outputs):
        return replace(parameters, feed_forward=None)
    return parameters
