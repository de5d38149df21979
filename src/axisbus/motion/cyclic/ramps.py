"""Ramps that command an axis from cycle to cycle in csv and cst: one target velocity or torque per cycle.

Theory of operation
-------------------
In profile velocity and profile torque mode the drive computes the ramp. In the cyclic modes a target acts within one cycle, and the
halt bit has no meaning (CiA 402-2 15 and 17). So the master computes every ramp: to a target, of a halt, and to a new target. A
command leaves its ramp to its successor: the next command, or a stop, continues from the target sent last, and nothing jumps.
"""

from __future__ import annotations

import math

from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage


class VelocityRamp:
    """Commands an axis in csv (``SetPointSource``); holds the velocity sent last and its target, in velocity increments."""

    mode = ModeOfOperation.CYCLIC_SYNC_VELOCITY

    def __init__(self, velocity: float, up: float, down: float, period: float) -> None:
        """``velocity``: the present one. ``up`` and ``down`` in velocity increments per s², above 0; ``period`` in seconds."""
        self.velocity = velocity
        self._target = velocity
        self._up = up
        self._down = down
        self._period = period
        self._braking = False

    @property
    def at_target(self) -> bool:
        """Whether the velocity sent last is the requested one."""
        return self.velocity == self._target

    @property
    def at_rest(self) -> bool:
        """Whether 0 was sent, and stays the target."""
        return self.velocity == 0.0 == self._target

    def aim(self, target: int, up: float, down: float) -> None:
        """Change to ``target`` from the next step on, with these ramps; this ends braking."""
        self._target, self._up, self._down = target, up, down
        self._braking = False

    def hold(self) -> None:
        """Keep the present velocity, unless it is braking, because another mode is about to take over."""
        if not self._braking:
            self._target = self.velocity

    def begin_braking(self) -> bool:
        """Decelerate to 0 with the deceleration of the command; always possible, and a repeated call has no effect."""
        self._target, self._braking = 0.0, True
        return True

    def step(self, _image: AxisImage, order: CycleOutputs) -> bool:
        """Write the velocity of this cycle; return True when it is the requested one."""
        self.velocity = next_velocity(self.velocity, self._target, self._up, self._down, self._period)
        order.halt = False
        order.target_velocity = round(self.velocity)
        return self.at_target


class TorqueRamp:
    """Commands an axis in cst (``SetPointSource``); holds the torque sent last and its target, in 0.1 % of rated torque."""

    mode = ModeOfOperation.CYCLIC_SYNC_TORQUE

    def __init__(self, torque: float, slope: float, period: float, *, halt_removes_torque: bool) -> None:
        """``torque``: the present one. ``slope`` in 0.1 % per s, above 0; ``period`` in seconds.

        ``halt_removes_torque``: a halt reduces the torque to 0. Otherwise the torque must hold a load or brake, and the stop
        sequence does that instead.
        """
        self.torque = torque
        self._target = torque
        self._slope = slope
        self._period = period
        self._halt_removes_torque = halt_removes_torque

    @property
    def at_target(self) -> bool:
        """Whether the torque sent last is the requested one."""
        return self.torque == self._target

    @property
    def at_rest(self) -> bool:
        """Whether 0 was sent, and stays the target."""
        return self.torque == 0.0 == self._target

    def aim(self, target: int, slope: float) -> None:
        """Change to ``target`` from the next step on, with this slope."""
        self._target, self._slope = target, slope

    def begin_braking(self) -> bool:
        """Reduce the torque to 0 on its slope; return whether a halt of this axis works in this manner. May be repeated."""
        if self._halt_removes_torque:
            self._target = 0.0
        return self._halt_removes_torque

    def step(self, _image: AxisImage, order: CycleOutputs) -> bool:
        """Write the torque of this cycle; return True when it is the requested one."""
        change, off = self._slope * self._period, self._target - self.torque
        self.torque = self._target if abs(off) <= change else self.torque + math.copysign(change, off)
        order.halt = False
        order.target_torque = round(self.torque)
        return self.at_target


def next_velocity(velocity: float, target: float, up: float, down: float, time: float) -> float:
    """Return the velocity after ``time`` seconds of change to ``target``: ``up`` away from 0, ``down`` towards 0 (per s²)."""
    turns = velocity * target < 0.0
    goal = 0.0 if turns else target
    rate = down if turns or abs(target) < abs(velocity) else up
    needed = abs(goal - velocity) / rate
    if needed > time:
        return velocity + math.copysign(rate * time, goal - velocity)
    return next_velocity(goal, target, up, down, time - needed) if turns else target
