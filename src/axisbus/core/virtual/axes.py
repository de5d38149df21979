"""The axes of a cell that have no drive, each with its core and its port: they need no link."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.cell.model import CellConfig
from axisbus.cell.virtual.parameters import all_virtual
from axisbus.cia402.port import Port
from axisbus.core.io.io_scan import IoScan
from axisbus.core.virtual.drive import VirtualDrive
from axisbus.core.virtual.encoder import EncoderPort
from axisbus.core.virtual.port import VirtualPort
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.parameters import AxisParameters


class VirtualAxis(NamedTuple):
    """An axis that the core leads alone, or that an input tells the place of."""

    core: AxisCore
    port: Port


def virtual_axes(cell: CellConfig, board: IoScan) -> dict[str, VirtualAxis]:
    """Make the axes of a cell that have no drive: virtual ones at 0 and without power, encoders where their inputs are."""
    return {name: _axis(parameters, board) for name, parameters in all_virtual(cell).items()}


def _axis(parameters: AxisParameters, board: IoScan) -> VirtualAxis:
    port = EncoderPort(board, parameters.encoder) if parameters.encoder else _led(parameters)
    core = AxisCore(parameters, port.capabilities)
    core.confirm_position(
        origin=0
    )  # that it begins at 0 is no guess: there is nothing else to be where it is
    return VirtualAxis(core, port)


def _led(parameters: AxisParameters) -> VirtualPort:
    quick = parameters.braking.quick
    assert quick is not None  # the reader asks for it
    return VirtualPort(VirtualDrive(parameters.slow_ramp or quick, quick), parameters.scan_period)
