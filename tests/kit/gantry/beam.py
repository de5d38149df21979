"""A compliant beam carried by two motors: skew pulls one motor back and the other forward.

Theory of operation
-------------------
If the second motor is ahead of the first by more than the offset of a square beam, the beam is bent: it pulls the second back and
the first forward, with ``stiffness`` times the skew plus ``damping`` times its rate of change. The forces on both motors are equal
and opposite. A motor without power, or in fault, is dragged along as far as its friction permits.
"""

from __future__ import annotations

from axisbus.sim.device import Device
from axisbus.sim.drive import Drive


class Beam:
    """The coupling of two drives; positions are increments of the motors, which both turn in the same direction."""

    def __init__(self, first: Drive, second: Drive, stiffness: float, damping: float = 0.0) -> None:
        """The beam is square now. ``stiffness``: ‰ of rated torque per increment; ``damping``: ‰ per increment/s."""
        self._first, self._second = first.axis.motor, second.axis.motor
        self._stiffness, self._damping = stiffness, damping
        self._square = self._second.position - self._first.position

    @property
    def skew(self) -> float:
        """Deviation from square, in increments."""
        return self._second.position - self._first.position - self._square

    def step(self) -> None:
        """Apply its force to both motors."""
        rate = self._second.velocity - self._first.velocity
        force = self._stiffness * self.skew + self._damping * rate
        self._second.pull, self._first.pull = force, -force


def tied(first: Device, second: Device, stiffness: float, damping: float = 0.0) -> Beam:
    """Couple the first drives of two devices; the force is computed in every step of the second device."""
    beam = Beam(first.drives[0], second.drives[0], stiffness, damping)
    second.step_hooks.append(beam.step)
    return beam
