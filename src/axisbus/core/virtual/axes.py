"""The virtual axes of a cell, each with its core and its port: they need no link."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.cell.model import CellConfig
from axisbus.cell.virtual.parameters import all_virtual
from axisbus.core.virtual.drive import VirtualDrive
from axisbus.core.virtual.port import VirtualPort
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.parameters import AxisParameters


class VirtualAxis(NamedTuple):
    """An axis that the core leads alone."""

    core: AxisCore
    port: VirtualPort


def virtual_axes(cell: CellConfig) -> dict[str, VirtualAxis]:
    """Make the virtual axes of a cell, each at 0 and without power."""
    return {name: _axis(parameters) for name, parameters in all_virtual(cell).items()}


def _axis(parameters: AxisParameters) -> VirtualAxis:
    quick = parameters.braking.quick
    assert quick is not None  # the reader asks for it
    drive = VirtualDrive(parameters.slow_ramp or quick, quick)
    port = VirtualPort(drive, parameters.scan_period)
    core = AxisCore(parameters, port.capabilities)
    core.confirm_position(
        origin=0
    )  # that it begins at 0 is no guess: there is nothing else to be where it is
    return VirtualAxis(core, port)
