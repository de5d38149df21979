"""What leads an axis from cycle to cycle in csv and cst: one target of velocity or torque in each, on a ramp.

Theory of operation
-------------------
In profile velocity and profile torque mode the drive has the ramp. In the cyclic modes what it gets acts within one cycle, and the
halt bit means nothing (CiA 402-2 15 and 17), so the ramp up, the ramp of a halt and that of a new target are all made here. A ramp
is what a command leaves behind: the next command, or a stop, goes on from the target that was sent last, and nothing jumps.
"""

from __future__ import annotations

import math

from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage


class VelocityRamp:
    """Leads an axis in csv (``Leading``); holds the velocity that was sent last and where it goes, in velocity increments."""

    mode = ModeOfOperation.CYCLIC_SYNC_VELOCITY

    def __init__(self, velocity: float, up: float, down: float, period: float) -> None:
        """``velocity``: the axis has it now. ``up`` and ``down`` in velocity increments per s², above 0; ``period`` in seconds."""
        self.velocity = velocity
        self._target = velocity
        self._up = up
        self._down = down
        self._period = period
        self._braking = False

    @property
    def at_target(self) -> bool:
        """Whether the last velocity that was asked for is the one that was sent."""
        return self.velocity == self._target

    @property
    def at_rest(self) -> bool:
        """Whether 0 was sent, and nothing else follows."""
        return self.velocity == 0.0 == self._target

    def aim(self, target: int, up: float, down: float) -> None:
        """Go to ``target`` from the next step on, with these ramps; a braking that was under way ends."""
        self._target, self._up, self._down = target, up, down
        self._braking = False

    def hold(self) -> None:
        """Go on with the velocity as it is, unless it is being braked: another mode is about to take over."""
        if not self._braking:
            self._target = self.velocity

    def begin_braking(self) -> bool:
        """Go to 0 with the deceleration of the command; always possible, and harmless when repeated."""
        self._target, self._braking = 0.0, True
        return True

    def step(self, _image: AxisImage, order: CycleOutputs) -> bool:
        """Ask for the velocity of this cycle; return True once it is the last one."""
        self.velocity = next_velocity(self.velocity, self._target, self._up, self._down, self._period)
        order.halt = False
        order.target_velocity = round(self.velocity)
        return self.at_target


class TorqueRamp:
    """Leads an axis in cst (``Leading``); holds the torque that was sent last and where it goes, in 0.1 % of rated torque."""

    mode = ModeOfOperation.CYCLIC_SYNC_TORQUE

    def __init__(self, torque: float, slope: float, period: float, *, lets_go: bool) -> None:
        """``torque``: the axis has it now. ``slope`` in 0.1 % per s, above 0; ``period`` in seconds.

        ``lets_go``: a halt brings the torque to 0. Else it has to hold a load or to brake, and the stop ladder does it otherwise.
        """
        self.torque = torque
        self._target = torque
        self._slope = slope
        self._period = period
        self._lets_go = lets_go

    @property
    def at_target(self) -> bool:
        """Whether the last torque that was asked for is the one that was sent."""
        return self.torque == self._target

    @property
    def at_rest(self) -> bool:
        """Whether 0 was sent, and nothing else follows."""
        return self.torque == 0.0 == self._target

    def aim(self, target: int, slope: float) -> None:
        """Go to ``target`` from the next step on, with this slope."""
        self._target, self._slope = target, slope

    def begin_braking(self) -> bool:
        """Let the torque go on its slope; return whether that is how this axis is halted. Harmless when repeated."""
        if self._lets_go:
            self._target = 0.0
        return self._lets_go

    def step(self, _image: AxisImage, order: CycleOutputs) -> bool:
        """Ask for the torque of this cycle; return True once it is the last one."""
        change, off = self._slope * self._period, self._target - self.torque
        self.torque = self._target if abs(off) <= change else self.torque + math.copysign(change, off)
        order.halt = False
        order.target_torque = round(self.torque)
        return self.at_target


def next_velocity(velocity: float, target: float, up: float, down: float, time: float) -> float:
    """Return the velocity ``time`` seconds later on the way to ``target``: ``up`` away from 0, ``down`` towards it (per s²)."""
    turns = velocity * target < 0.0
    goal = 0.0 if turns else target
    rate = down if turns or abs(target) < abs(velocity) else up
    needed = abs(goal - velocity) / rate
    if needed > time:
        return velocity + math.copysign(rate * time, goal - velocity)
    return next_velocity(goal, target, up, down, time - needed) if turns else target
