"""Statusword of a simulated drive: state, common bits, and the bits of its mode."""

from __future__ import annotations

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import SW_BIT_10, SW_INTERNAL_LIMIT, SW_REMOTE, SW_VOLTAGE, SW_WARNING
from axisbus.sim.fault_injection import DriveFaults
from axisbus.sim.modes.base import Mode
from axisbus.sim.power import PowerStage, Stage

_ENABLED, _QUICK_STOP = Stage.ENABLED, Stage.QUICK_STOP  # used in every step


def compose(
    power: PowerStage, dials: DriveFaults, mode: Mode, axis: Axis, *, halted: bool, warning: bool
) -> int:
    """Return the value of 6041h; mode bits and the internal limit are included while enabled."""
    word = power.pattern
    if not dials.no_voltage:
        word |= SW_VOLTAGE
    if not dials.local_control:
        word |= SW_REMOTE
    if warning:
        word |= SW_WARNING
    if power.stage is _ENABLED:
        word |= mode.halted_bits(axis) if halted else mode.bits(axis)
        if axis.clamped or axis.speed_limited or axis.forbidden or axis.motor.saturated:
            word |= SW_INTERNAL_LIMIT
    elif power.stage is _QUICK_STOP and axis.at_standstill:
        word |= SW_BIT_10
    if dials.target_reached_always:
        word |= SW_BIT_10
    return word
