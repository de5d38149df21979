"""The trajectory that an axis is on, as it is seen by whatever takes over from it: another command, or a stop."""

from __future__ import annotations

from typing import Protocol

from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage


class Leading(Protocol):
    """``moves.follow.Follow``, without all that only its own command needs of it."""

    @property
    def mode(self) -> ModeOfOperation | None:
        """The mode of operation in which it leads."""

    @property
    def at_rest(self) -> bool:
        """Whether its targets no longer move."""

    def begin_braking(self) -> bool:
        """Brake along the path from the next step on; return whether that is possible. Harmless when repeated."""

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Ask for the next target; return True when the axis has come up with the last one."""
