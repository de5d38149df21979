"""A path in csp that takes over from another path: until it begins, the previous path continues to command the axis."""

from __future__ import annotations

from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.follow import Follow
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.path_limit_check import PathSample


class PathHandover(Follow):
    """Holds the path that commands the axis before this one begins, and whether that path was stopped before the handover."""

    def __init__(self, parameters: AxisParameters, gate: StartBarrier, before: Follow | None) -> None:
        """``before``: the path that commands the axis now; None if there is none."""
        super().__init__(None, parameters, gate)
        self._before = before
        self._is_given_up = False  # the axis was stopped before this path began

    def begin_braking(self) -> bool:
        """Begin to brake along this path, or along the previous path as long as that commands the axis."""
        if self._before is None:
            return super().begin_braking()
        self._is_given_up = True
        return self._before.begin_braking()

    @property
    def leads_now(self) -> Follow:
        """The path that commands the axis in this cycle: the previous path, until this one takes over."""
        return self if self._before is None else self._before

    @property
    def is_under_way(self) -> bool:
        """Whether this path commands the axis, or the previous path does."""
        return super().is_under_way if self._before is None else self._before.is_under_way

    @property
    def path_velocity(self) -> float:
        """As ``Follow.path_velocity``, of the path that commands the axis."""
        return super().path_velocity if self._before is None else self._before.path_velocity

    @property
    def last_step(self) -> PathSample:
        """The commanded position and velocity of the last cycle."""
        return super().last_step if self._before is None else self._before.last_step

    @property
    def at_rest(self) -> bool:
        """Whether the commanded motion is at standstill."""
        return super().at_rest if self._before is None else self._before.at_rest

    def _go_along(self, before: Follow, image: AxisImage, order: CycleOutputs) -> None:
        """Let the previous path command the axis. If it fails, the axis is braked along that path, as without the handover."""
        try:
            before.step(image, order)
        finally:
            self.brakes_along = before.brakes_along
