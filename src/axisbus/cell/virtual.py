"""Convert a virtual axis of a cell file to the parameters that motion needs."""

from __future__ import annotations

from axisbus.cell.model import CellConfig
from axisbus.cell.parameters import defaults, standstill_speed, stop_times
from axisbus.cell.quantities import units_of
from axisbus.cell.virtual_keys import quick_deceleration
from axisbus.cia402 import objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.options import Ramp
from axisbus.motion.parameters import AxisLimits, AxisParameters, HomingParameters
from axisbus.motion.stop_deceleration import Braking
from axisbus.units import INT32_HALF

# The objects that a drive would have for it: the settings of a move, and its commands and actual values.
SETTINGS = frozenset({objects.PROFILE_VELOCITY, objects.PROFILE_ACCELERATION, objects.PROFILE_DECELERATION})


OBJECTS = SETTINGS | {
    objects.CONTROLWORD,
    objects.STATUSWORD,
    objects.MODES_OF_OPERATION,
    objects.MODES_OF_OPERATION_DISPLAY,
    objects.POSITION_DEMAND,
    objects.POSITION_ACTUAL,
    objects.VELOCITY_ACTUAL,
    objects.TARGET_POSITION,
    objects.TARGET_VELOCITY,
}


OBJECTS_OF_ENCODER = frozenset({objects.STATUSWORD, objects.POSITION_ACTUAL})


MODES = frozenset(
    {
        ModeOfOperation.PROFILE_POSITION,
        ModeOfOperation.PROFILE_VELOCITY,
        ModeOfOperation.CYCLIC_SYNC_POSITION,
    }
)


def virtual_parameters(cell: CellConfig, name: str) -> AxisParameters:
    """Return the parameters of the virtual axis ``name``; raises nothing for a cell that ``reader.load`` returned."""
    axis = cell.axes[name]
    units = units_of(axis)
    quick = (quick_deceleration(axis) or 1.0) * abs(units.position.factor)
    return AxisParameters(
        name=name,
        units=units,
        limits=AxisLimits(axis.position_limits, axis.max_velocity, axis.max_acceleration),
        defaults=defaults(axis),
        homing=HomingParameters(required=False),
        stop_times=stop_times(axis),
        objects=OBJECTS,
        modes=MODES,
        braking=Braking(Ramp.SLOW, Ramp.QUICK, quick),
        following_error=INT32_HALF,  # no monitoring: its lag is only the scan's own lateness, which is reported elsewhere
        standstill_speed=standstill_speed(axis, units),
        scan_period=cell.bus.scan_period,
        virtual=True,
    )


def encoder_parameters(cell: CellConfig, name: str) -> AxisParameters:
    """Return the parameters of an axis whose position comes from an input: no command moves it, and it has no modes."""
    axis = cell.axes[name]
    source = cell.io.get(axis.encoder or "")
    return AxisParameters(
        name=name,
        node=0 if source is None else source.node,
        units=units_of(axis),
        homing=HomingParameters(required=False),
        objects=OBJECTS_OF_ENCODER,
        modes=frozenset(),
        scan_period=cell.bus.scan_period,
        virtual=True,
        encoder=axis.encoder or "",
    )


def all_virtual(cell: CellConfig) -> dict[str, AxisParameters]:
    """Return the parameters of each axis without a drive, by name."""
    made = {
        name: (encoder_parameters if axis.encoder is not None else virtual_parameters)
        for name, axis in cell.axes.items()
        if axis.virtual
    }
    return {name: make(cell, name) for name, make in made.items()}
