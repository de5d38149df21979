"""Interpolated position mode (CiA 402-2 11), linear: set-points of 60C1h:01 latched at SYNC, straight lines between them."""

from __future__ import annotations

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import CW_BIT_4, IP, SW_BIT_10, SW_BIT_12
from axisbus.sim.modes.cyclic_position import CyclicPosition
from axisbus.sim.power import Effort

_SLOW = Effort.SLOW


class InterpolatedPosition(CyclicPosition):
    """Interpolates while bit 4 of the controlword is set (*interpolation active*, bit 12); otherwise brakes and holds."""

    code = IP

    def __init__(self) -> None:
        super().__init__()
        self._active = False
        self._asked: float | None = None  # seconds since bit 4 was set

    def enter(self, axis: Axis) -> None:
        super().enter(axis)
        self._active = False

    def command(self, axis: Axis, _old: int, new: int) -> None:
        if not new & CW_BIT_4:
            if axis.motor.ahead:
                axis.seize()
            self._asked, self._active = None, False
        elif self._asked is None:
            self._asked = 0.0
            self._begin(axis)

    def _begin(self, axis: Axis) -> None:
        if self._asked is not None and self._asked >= axis.dials.interpolation_delay:
            super().enter(axis)
            self._active = True

    def abandon(self, axis: Axis) -> None:
        super().abandon(axis)
        self._active, self._asked = False, None

    def target(self, axis: Axis) -> int:
        return axis.settings.interpolation_target

    def sync(self, axis: Axis, period: float) -> None:
        if self._active:
            super().sync(axis, period)

    def step(self, axis: Axis, dt: float) -> None:
        if self._active:
            super().step(axis, dt)
            return
        axis.brake(_SLOW, dt)
        if self._asked is not None:
            self._asked += dt
            self._begin(axis)

    def bits(self, axis: Axis) -> int:
        reached = SW_BIT_10 if axis.standing else 0
        return reached | (SW_BIT_12 if self._active else 0)

    def halted_bits(self, axis: Axis) -> int:
        return self.bits(axis)
