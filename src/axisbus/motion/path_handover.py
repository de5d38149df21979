"""A path that takes over from another one: until it begins, what led the axis before goes on to lead it."""

from __future__ import annotations

from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.follow import Follow
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.path_limit_check import PathSample


class PathHandover(Follow):
    """Holds what leads the axis before it begins, and whether it was stopped by then."""

    def __init__(self, parameters: AxisParameters, gate: StartBarrier, before: Follow | None) -> None:
        """``before``: what leads the axis now; None where nothing does."""
        super().__init__(None, parameters, gate)
        self._before = before
        self._is_given_up = False  # it was stopped before it began

    def begin_braking(self) -> bool:
        """Begin to slow down along the path: its own, or the one before as long as that leads."""
        if self._before is None:
            return super().begin_braking()
        self._is_given_up = True
        return self._before.begin_braking()

    @property
    def leads_now(self) -> Follow:
        """What leads the axis in this cycle: the path before, until this one takes over."""
        return self if self._before is None else self._before

    @property
    def is_under_way(self) -> bool:
        """Whether it leads the axis, or what does so before it."""
        return super().is_under_way if self._before is None else self._before.is_under_way

    @property
    def last_step(self) -> PathSample:
        """Where the axis was led to in the last cycle, and how fast."""
        return super().last_step if self._before is None else self._before.last_step

    @property
    def at_rest(self) -> bool:
        """Whether the commanded motion stands still."""
        return super().at_rest if self._before is None else self._before.at_rest

    def _go_along(self, before: Follow, image: AxisImage, order: CycleOutputs) -> None:
        """Be led by what led the axis before; where that fails, the axis is braked along it as it would have been."""
        try:
            before.step(image, order)
        finally:
            self.brakes_along = before.brakes_along
