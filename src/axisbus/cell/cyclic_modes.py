"""Convert ``[axes.NAME.feed_forward]`` to the settings of motion and the outputs of the PDOs."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import replace

from axisbus.bus.pdo.plan import PdoRequirements
from axisbus.cell.axis_description import Drive
from axisbus.cell.model import AxisConfig, NodeConfig
from axisbus.cia402 import objects
from axisbus.cia402.modes import FACTS, ModeOfOperation
from axisbus.cia402.port import INTERPOLATION_OBJECTS, OUTPUT_OBJECTS, ValueTransport
from axisbus.eds.model import Eds
from axisbus.motion.parameters import AxisParameters, FeedForward

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


# -- Select the axes that the master commands in interpolated position mode (ip), because their drive has no csp -------


_M = ModeOfOperation
_IP, _CSP = _M.INTERPOLATED_POSITION, _M.CYCLIC_SYNC_POSITION


def interpolates(drive: Drive) -> bool:
    """Whether the master uses the drive's ip as csp.

    It does if 6502h lists ip and not csp, unless ``modes`` in the cell file lists neither; and if ``modes`` lists only ip of the
    two.
    """
    if not _can(drive):
        return False
    named, claimed = drive.axis.modes, drive.claimed
    if named is not None and FACTS[_CSP].short not in named:
        return FACTS[_IP].short in named
    return claimed is not None and _IP in claimed and _CSP not in claimed


def led_modes(drive: Drive, modes: Set[ModeOfOperation]) -> frozenset[ModeOfOperation]:
    """Return the modes of an axis as motion uses them: ip is replaced by csp if the master uses ip as csp."""
    return frozenset(modes - {_IP} | {_CSP}) if interpolates(drive) else frozenset(modes)


def _can(drive: Drive) -> bool:
    """Whether the objects exist: the first set-point of 60C1h, and 607Ah, which stores the newest position for the other modes."""
    found = drive.variable(objects.INTERPOLATION_DATA, 1) is not None
    return found and not drive.missing((objects.TARGET_POSITION, objects.POSITION_ACTUAL))
