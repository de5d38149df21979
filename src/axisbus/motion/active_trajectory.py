"""The active trajectory of an axis, as seen by a command or stop that takes over from it."""

from __future__ import annotations

from typing import Protocol

from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage


class Leading(Protocol):
    """``moves.follow.Follow``, without the members that only its own command needs."""

    @property
    def mode(self) -> ModeOfOperation | None:
        """The mode of operation in which it commands the axis."""

    @property
    def at_rest(self) -> bool:
        """Whether its targets no longer change."""

    def begin_braking(self) -> bool:
        """Brake along the path from the next step on; return whether that is possible. A repeated call has no effect."""

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Write the next target; return True when the axis has arrived at the last one."""
