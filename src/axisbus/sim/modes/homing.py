"""Homing mode (CiA 402-2 11) by methods 17, 18, 33, 34, 35 and 37; any other ends with a homing error.

A search has several phases: to the switch at the speed of 6099h:1, then off it at 6099h:2 until its edge; or directly to the next
index pulse at 6099h:2. The position of the edge or pulse becomes home; then the axis brakes to standstill. The home position has
the value of the home offset (607Ch). With a speed or acceleration of 0 the search waits until it is set.
"""

from __future__ import annotations

import math
from enum import IntEnum

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import CW_BIT_4, HM, SW_BIT_10, SW_BIT_12, SW_BIT_13
from axisbus.sim.modes.base import Mode
from axisbus.sim.power import Effort

NEGATIVE_SWITCH, POSITIVE_SWITCH = 17, 18
INDEX_NEGATIVE, INDEX_POSITIVE = 33, 34
IN_PLACE = (35, 37)


class Phase(IntEnum):
    """Phase of a homing run."""

    IDLE = 0  # not started, or interrupted
    TO_SWITCH = 1
    OFF_SWITCH = 2
    TO_INDEX = 3
    STOPPING = 4
    DONE = 5
    FAILED = 6


_RUNNING = (Phase.TO_SWITCH, Phase.OFF_SWITCH, Phase.TO_INDEX, Phase.STOPPING)


class Homing(Mode):
    """Homing with its phase; the result of the last homing stays in the bits until a new one starts."""

    code = HM

    def __init__(self) -> None:
        self.phase = Phase.IDLE
        self._direction = 1.0
        self._edge = 0.0

    def abandon(self, _axis: Axis) -> None:
        self._interrupt()

    def enter(self, _axis: Axis) -> None:
        self._interrupt()

    def command(self, axis: Axis, old: int, new: int) -> None:
        if new & CW_BIT_4 and not old & CW_BIT_4:
            self._start(axis)
        elif old & CW_BIT_4 and not new & CW_BIT_4:
            self._interrupt()

    def halt(self, axis: Axis, _effort: Effort, dt: float) -> None:
        self._interrupt()
        rate = self._rate(axis)
        axis.ramp_to(0.0, rate, rate, dt)

    def step(self, axis: Axis, dt: float) -> None:
        rate = self._rate(axis)
        acceleration = self._acceleration(axis)
        axis.ramp_to(self._velocity(axis), acceleration, rate, dt)
        if self.phase is Phase.TO_SWITCH:
            if self._on_switch(axis):
                self.phase = Phase.OFF_SWITCH
        elif self.phase in (Phase.OFF_SWITCH, Phase.TO_INDEX):
            self._look_for_edge(axis)
        elif self.phase is Phase.STOPPING and axis.at_standstill:
            self.phase = Phase.DONE

    def bits(self, axis: Axis) -> int:
        if self.phase is Phase.FAILED:
            return SW_BIT_13 | (SW_BIT_10 if axis.at_standstill else 0)
        if self.phase is Phase.DONE:
            return SW_BIT_12 | (0 if axis.dials.homing_reached_never else SW_BIT_10)
        if self.phase is Phase.STOPPING:
            return SW_BIT_12
        if self.phase is Phase.IDLE:
            return SW_BIT_10 if axis.at_standstill else 0
        return 0

    def _start(self, axis: Axis) -> None:
        method = axis.settings.homing_method
        if axis.dials.homing_fails:
            self.phase = Phase.FAILED
        elif method in IN_PLACE:
            self._define(axis, axis.motor.position)
            self.phase = Phase.DONE
        elif method in (INDEX_NEGATIVE, INDEX_POSITIVE):
            self._direction = 1.0 if method == INDEX_POSITIVE else -1.0
            self._edge = _next_index(axis, self._direction)
            self.phase = Phase.TO_INDEX
        elif method in (NEGATIVE_SWITCH, POSITIVE_SWITCH):
            self._start_switch(axis, 1.0 if method == POSITIVE_SWITCH else -1.0)
        else:
            self.phase = Phase.FAILED

    def _start_switch(self, axis: Axis, direction: float) -> None:
        switch = axis.params.limit_switches[1 if direction > 0 else 0]
        if switch is None:
            self.phase = Phase.FAILED
            return
        self._direction = direction
        self._edge = switch
        self.phase = Phase.OFF_SWITCH if self._on_switch(axis) else Phase.TO_SWITCH

    def _interrupt(self) -> None:
        if self.phase in _RUNNING:
            self.phase = Phase.IDLE

    def _velocity(self, axis: Axis) -> float:
        settings = axis.settings
        if self.phase is Phase.TO_SWITCH:
            return self._direction * axis.speed(settings.homing_speed_switch)
        if self.phase is Phase.OFF_SWITCH:
            return -self._direction * axis.speed(settings.homing_speed_zero)
        if self.phase is Phase.TO_INDEX:
            return self._direction * axis.speed(settings.homing_speed_zero)
        return 0.0

    def _on_switch(self, axis: Axis) -> bool:
        return (axis.motor.position - self._edge) * self._direction >= 0.0

    def _look_for_edge(self, axis: Axis) -> None:
        search_direction = self._direction if self.phase is Phase.TO_INDEX else -self._direction
        if (
            axis.motor.position - self._edge
        ) * search_direction > 0.0 and axis.motor.velocity * search_direction > 0.0:
            self._define(axis, self._edge)
            self.phase = Phase.STOPPING

    def _define(self, axis: Axis, home: float) -> None:
        """Give the motor position ``home`` the value of the home offset."""
        axis.offset += axis.settings.home_offset - axis.to_user(home)

    def _acceleration(self, axis: Axis) -> float:
        value = axis.settings.homing_acceleration
        return axis.acceleration if value < 0 else value / axis.params.acceleration_unit

    def _rate(self, axis: Axis) -> float:
        """Return the deceleration: the homing acceleration, but never 0."""
        return self._acceleration(axis) or axis.braking(Effort.SLOW)


def _next_index(axis: Axis, direction: float) -> float:
    """Return the motor position of the next index pulse, one per turn."""
    turn, offset = axis.params.increments_per_turn, axis.params.index_offset
    turns = (axis.motor.position - offset) / turn
    number = math.floor(turns) + 1 if direction > 0 else math.ceil(turns) - 1
    return offset + number * turn
