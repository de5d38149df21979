"""A beam that two motors carry: compliant, so that skew pulls the one back and the other on.

Theory of operation
-------------------
Where the second motor is farther than the first, less what makes the beam square, the beam is bent: it pulls the second back and
the first on, by ``stiffness`` times that, and by ``damping`` times how fast it changes. What one motor feels the other feels the
other way round. A motor whose drive has no power, or is in fault, is dragged along so far as its friction lets it.
"""

from __future__ import annotations

from axisbus.sim.device import Device
from axisbus.sim.drive import Drive


class Beam:
    """The tie between two drives; positions are increments of the motors, which both turn the same way."""

    def __init__(self, first: Drive, second: Drive, stiffness: float, damping: float = 0.0) -> None:
        """It is square as both stand. ``stiffness``: ‰ of rated torque per increment; ``damping``: ‰ per increment/s."""
        self._first, self._second = first.axis.motor, second.axis.motor
        self._stiffness, self._damping = stiffness, damping
        self._square = self._second.position - self._first.position

    @property
    def skew(self) -> float:
        """How far it is out of square, in increments."""
        return self._second.position - self._first.position - self._square

    def step(self) -> None:
        """Let it pull on both motors."""
        rate = self._second.velocity - self._first.velocity
        force = self._stiffness * self.skew + self._damping * rate
        self._second.pull, self._first.pull = force, -force


def tied(first: Device, second: Device, stiffness: float, damping: float = 0.0) -> Beam:
    """Tie the first drives of two devices together; the beam pulls anew in every step of the second."""
    beam = Beam(first.drives[0], second.drives[0], stiffness, damping)
    second.ties.append(beam.step)
    return beam
