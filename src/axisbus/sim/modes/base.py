"""Base class of the modes of operation, which is also the mode without motion."""

from __future__ import annotations

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import SW_BIT_10
from axisbus.sim.power import Effort

_SLOW = Effort.SLOW  # used in every step at standstill


class Mode:
    """A mode that holds the position of the axis (6060h = 0); other modes override the methods that differ."""

    code = 0
    cyclic = False  # latches its targets at SYNC
    supervised = False  # the following error is supervised
    by_torque = False  # the motor gets a torque, not a position demand

    def enter(self, axis: Axis) -> None:
        """Begin the mode, or begin after enabling: start from the present demand."""

    def resume_last_motion(self, axis: Axis) -> None:
        """Resume the last motion after ``enter``, in a drive that does so after being disabled."""

    def command(self, axis: Axis, old: int, new: int) -> None:
        """Process a change of the controlword."""

    def sync(self, axis: Axis, period: float) -> None:
        """Process a SYNC; ``period`` is the time in s until the next one."""

    def step(self, axis: Axis, dt: float) -> None:
        """Advance the demand by ``dt`` seconds."""
        axis.brake(_SLOW, dt)

    def halt(self, axis: Axis, effort: Effort, dt: float) -> None:
        """Brake according to 605Dh while the halt bit is set (``Effort.OFF``: coast)."""
        if effort is Effort.OFF:
            axis.push(0.0, dt)
        else:
            axis.brake(effort, dt)

    def resume(self, axis: Axis) -> None:
        """Continue after the halt bit was cleared."""

    def abandon(self, axis: Axis) -> None:
        """Discard the active motion: the power stage takes over."""

    def bits(self, _axis: Axis) -> int:
        """Return bits 10, 12 and 13 of the statusword."""
        return 0

    def halted_bits(self, axis: Axis) -> int:
        """Return the same bits while the halt bit is set: bit 10 reports standstill."""
        keep = self.bits(axis) & ~SW_BIT_10
        return keep | SW_BIT_10 if axis.at_standstill else keep
