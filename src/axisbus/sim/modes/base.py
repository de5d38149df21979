"""What every mode of operation offers the drive, and the mode that does nothing."""

from __future__ import annotations

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import SW_BIT_10
from axisbus.sim.power import Effort

_SLOW = Effort.SLOW  # asked for in every step at rest


class Mode:
    """A mode that holds the axis where it is (6060h = 0); the others replace what differs."""

    code = 0
    cyclic = False  # takes its targets at SYNC
    supervised = False  # the following error is watched
    by_torque = False  # the motor is pushed, not led by a position demand

    def enter(self, axis: Axis) -> None:
        """The mode takes over, or the drive has been enabled: start from the demand as it is."""

    def go_on(self, axis: Axis) -> None:
        """After ``enter``, in a drive that takes up again what it was at before it was disabled."""

    def command(self, axis: Axis, old: int, new: int) -> None:
        """The controlword has changed."""

    def sync(self, axis: Axis, period: float) -> None:
        """A SYNC came; ``period`` is the time in s until the next is due."""

    def step(self, axis: Axis, dt: float) -> None:
        """Move the demand on by ``dt`` seconds."""
        axis.brake(_SLOW, dt)

    def halt(self, axis: Axis, effort: Effort, dt: float) -> None:
        """The halt bit is set: come to rest as 605Dh says (``Effort.OFF``: coast)."""
        if effort is Effort.OFF:
            axis.push(0.0, dt)
        else:
            axis.brake(effort, dt)

    def resume(self, axis: Axis) -> None:
        """The halt bit was taken back."""

    def abandon(self, axis: Axis) -> None:
        """The power stage takes over: forget what was under way."""

    def bits(self, _axis: Axis) -> int:
        """Return bits 10, 12 and 13 of the statusword."""
        return 0

    def halted_bits(self, axis: Axis) -> int:
        """Return the same while the halt bit is set: bit 10 tells that the axis stands."""
        keep = self.bits(axis) & ~SW_BIT_10
        return keep | SW_BIT_10 if axis.standing else keep
