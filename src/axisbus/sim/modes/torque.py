"""Profile torque (CiA 402-2 16) and cyclic synchronous torque (17): the motor is driven by a torque."""

from __future__ import annotations

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import CST, SW_BIT_10, SW_BIT_12, TQ
from axisbus.sim.modes.base import Mode
from axisbus.sim.power import Effort
from axisbus.sim.ramp import slope


class ProfileTorque(Mode):
    """Ramps the torque to 6071h with the slope 6087h (‰/s): with 0 it does not change, without the object it jumps."""

    code = TQ
    by_torque = True

    def __init__(self) -> None:
        self._reached = False

    def enter(self, axis: Axis) -> None:
        axis.torque_demand = axis.torque_within(axis.motor.torque)
        self._reached = False

    def step(self, axis: Axis, dt: float) -> None:
        self._towards(axis, float(axis.target_torque), dt)

    def halt(self, axis: Axis, _effort: Effort, dt: float) -> None:
        """Ramp the torque to zero on its slope; then the motor coasts."""
        self._towards(axis, 0.0, dt)

    def bits(self, axis: Axis) -> int:
        return SW_BIT_10 if self._reached and not axis.dials.target_reached_never else 0

    def _towards(self, axis: Axis, wanted: float, dt: float) -> None:
        target = axis.torque_within(wanted)
        rate = axis.settings.torque_slope
        demand = target if rate < 0 else slope(axis.torque_demand, target, rate, dt)
        axis.push(demand, dt)
        self._reached = demand == wanted


class CyclicTorque(Mode):
    """Applies the torque of each SYNC, and holds it if no other arrives."""

    code = CST
    cyclic = True
    by_torque = True

    def __init__(self) -> None:
        self._goal = 0.0

    def enter(self, axis: Axis) -> None:
        self._goal = axis.motor.torque

    def resume(self, _axis: Axis) -> None:
        self._goal = 0.0

    def sync(self, axis: Axis, _period: float) -> None:
        self._goal = axis.torque_within(float(axis.target_torque + axis.settings.torque_offset))

    def step(self, axis: Axis, dt: float) -> None:
        axis.push(self._goal, dt)

    def halt(self, axis: Axis, _effort: Effort, dt: float) -> None:
        axis.push(0.0, dt)

    def bits(self, _axis: Axis) -> int:
        return SW_BIT_12

    def halted_bits(self, axis: Axis) -> int:
        return SW_BIT_10 if axis.at_standstill else 0
