"""The axis of a module as a CiA 402 drive, from the description that its port provides."""

from __future__ import annotations

from dataclasses import replace

from axisbus.cell import scale_proposal
from axisbus.cell.axis_description import Drive
from axisbus.cell.model import AxisConfig, CellConfig
from axisbus.cell.parameters import axis_parameters
from axisbus.drives.gim6010.can_simple.port.synthetic_eds import MAKE, description
from axisbus.drives.gim6010.cell.modules import modules_of, settings_of
from axisbus.eds.model import Eds
from axisbus.motion.parameters import AxisParameters

_WHOLE = 1000  # ‰ of the rated torque: the highest that a port allows


def descriptions(cell: CellConfig) -> dict[int, Eds]:
    """Return the description (EDS) that each module's port provides, by node; raises as ``settings_of``."""
    return {node_id: description(settings_of(cell, node_id)) for node_id in modules_of(cell)}


def drive_of(cell: CellConfig, axis: AxisConfig) -> Drive:
    """Return the drive of an axis whose node is a module; raises as ``settings_of``."""
    return Drive.of(axis, cell.nodes[axis.node], description(settings_of(cell, axis.node)))


def module_parameters(cell: CellConfig, name: str) -> AxisParameters:
    """Return the parameters of the axis ``name``, whose node is a module; raises as ``settings_of``."""
    axis = cell.axes[name]
    drive = drive_of(cell, axis)
    found = axis_parameters(cell, name, drive.eds, MAKE)
    turning = settings_of(cell, axis.node).torque
    return replace(
        found,
        # a port has objects of modes that it cannot run: only 6502h lists the modes reliably
        modes=found.modes if axis.modes is not None else found.modes & (drive.claimed or frozenset()),
        limits=scale_proposal.limited_torque(
            found.limits, axis.rated_torque, lambda _: None if turning is None else _WHOLE
        ),
        torque_slope=None if turning is None else round(turning.ramp / turning.rated * 1000),
    )
