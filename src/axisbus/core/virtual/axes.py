"""The axes of a cell without a drive, each with its core and its port: they need no link."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.cell.model import CellConfig
from axisbus.cell.virtual import all_virtual
from axisbus.cia402.port import Port
from axisbus.core.io.io_scan import IoScan
from axisbus.core.virtual.drive import VirtualDrive
from axisbus.core.virtual.encoder import EncoderPort
from axisbus.core.virtual.port import VirtualPort
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.parameters import AxisParameters


class VirtualAxis(NamedTuple):
    """An axis that only the core moves, or whose position is read from an input."""

    core: AxisCore
    port: Port


def virtual_axes(cell: CellConfig, board: IoScan) -> dict[str, VirtualAxis]:
    """Make the axes of a cell without a drive: virtual ones at 0 and without power, encoders at the position of their input."""
    return {name: _axis(parameters, board) for name, parameters in all_virtual(cell).items()}


def _axis(parameters: AxisParameters, board: IoScan) -> VirtualAxis:
    port = EncoderPort(board, parameters.encoder) if parameters.encoder else _led(parameters)
    core = AxisCore(parameters, port.capabilities)
    # The start at 0 is no guess: no physical position could differ from it.
    core.confirm_position(origin=0)
    return VirtualAxis(core, port)


def _led(parameters: AxisParameters) -> VirtualPort:
    quick = parameters.braking.quick
    assert quick is not None  # required by the reader
    return VirtualPort(VirtualDrive(parameters.slow_ramp or quick, quick), parameters.scan_period)
