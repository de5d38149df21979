"""A move to a position that begins while the axis follows a trajectory: from its present velocity, in the mode that it is in.

Theory of operation
-------------------
A drive that is put into profile position mode while it moves has no set-point there until the handshake has given it one: for a
cycle or more it brakes as hard as it sees fit, and then speeds up again. Drives differ in that, and a master cannot know it. In
cyclic synchronous position mode it is the master that leads: so the axis stays in it, and the master plans the rest of the way from
where its last target was and how fast it came there. Nothing is written, nothing changes but the path. The next move that begins at
rest goes in profile position mode, as ever.

While a group's axes wait for each other, the trajectory before goes on.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.errors import LimitError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.activity import timed_out
from axisbus.motion.moves.follow import Follow
from axisbus.motion.moves.profile import MoveProfile, braking_distance
from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed, Start
from axisbus.motion.override.factor import spared
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.path_handover import PathHandover
from axisbus.motion.pathclock import PathClock
from axisbus.motion.position_limits import widened


class MoveProgress(NamedTuple):
    """The way of a move that goes on as it was planned, and the time along it."""

    way: ProfileFromSpeed
    clock: PathClock


class CspMove(PathHandover):
    """The rest of a move in cyclic synchronous position mode; holds its deadline."""

    foresees = False

    def __init__(
        self,
        target: int,
        profile: MoveProfile,
        parameters: AxisParameters,
        gate: StartBarrier,
        before: Follow | None,
    ) -> None:
        """``target`` in unwrapped increments; ``profile`` with ``speed``, ``up`` and ``down`` known."""
        # One that has not begun itself is led by what leads it.
        super().__init__(parameters, gate, (isinstance(before, CspMove) and before._before) or before)
        self._goal = target
        self._profile = profile
        self._deadline: float | None = None
        self._factor = 1.0  # the override of the plan; at 0 it leads to rest, and the axis is held there

    def plan(self, origin: int) -> ProfileFromSpeed:
        """Return the way from what the axis was given last; ``origin``: the position that the user calls 0."""
        units, profile, last = self._parameters.units.position, self._profile, self.path_step
        unit = abs(units.factor)
        assert profile.speed
        assert profile.up
        assert profile.down
        speed, up, down = profile.speed / unit, profile.up / unit, profile.down / unit
        start, end = Start(last.position, last.velocity), units.to_units(self._goal - origin)
        if not self._factor:
            end = last.position + math.copysign(braking_distance(last.velocity, down), last.velocity)
        else:
            limit = self._parameters.limits.velocity
            speed *= self._factor
            speed = speed if limit is None else min(speed, max(limit, speed / self._factor))
        return ProfileFromSpeed(start, end, speed, up, down)

    def require_room(self, origin: int) -> None:
        """Raise LimitError where the axis could not brake within its position limits."""
        limits, unit = self._parameters.limits.position, self._parameters.units.position
        if limits is None or self._before is None:
            return
        path = self.plan(origin)
        low, high = widened(limits, path.start.position, abs(unit.to_units(1)))
        if low <= path.span[0] and path.span[1] <= high:
            return
        raise LimitError(
            f"{self._parameters.name}: could not stop within the position limits with that deceleration",
            observed=f"from its present speed of {path.start.velocity:g} {unit.unit}/s it would go from {path.span[0]:g} to "
            f"{path.span[1]:g} {unit.unit}; allowed are {limits[0]:g} to {limits[1]:g}",
            remedy="ask for a harder deceleration, or halt the axis first; what it did before goes on",
        )

    @property
    def target(self) -> int:
        """Where it ends, in unwrapped increments."""
        return self._goal

    @property
    def profile(self) -> MoveProfile:
        """Its profile, as it was asked for."""
        return self._profile

    @property
    def deadline(self) -> float | None:
        """Until when it must have arrived (s, monotonic), where the caller said so."""
        return self._deadline

    def going(self) -> MoveProgress | None:
        """Return its way and its time on it, where that goes on as it was planned, straight to its end; None where it does not."""
        way, t = self._told, self.clock.t
        if not isinstance(way, ProfileFromSpeed) or self._addition is not None or self._before is not None:
            return None
        if self._factor != 1.0 or not self._time.is_even or t >= way.duration:
            return None
        left, speed = way.end - way.position(t), way.speed(t)
        straight = left * speed >= 0.0 and braking_distance(speed, way.down) <= abs(left) * (1.0 + 1e-9)
        return MoveProgress(way, self._time) if straight else None

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the axis has come up with its target."""
        if self._deadline is None and self._profile.timeout is not None:
            self._deadline = image.now + self._profile.timeout
        if self._deadline is not None:
            self._deadline += spared(image.override, self._parameters.scan_period)
        self._check_deadline(
            image
        )  # before it goes on: what fails is braked in this cycle, from where it was
        self._go_ahead(image)
        if self._before is not None:
            if (
                self._is_given_up
                or not self._may_follow(self._before, image)
                or not self._gate.pass_through(self)
            ):
                self._go_along(self._before, image, order)
                return False
            self._take_over(self._before, image)
        return super().step(image, order)

    def _go_ahead(self, image: AxisImage) -> None:
        """Let what is in front of the axis go on by one cycle; here nothing is."""

    def _may_follow(self, _before: Follow, _image: AxisImage) -> bool:
        """Whether it can take over from what leads the axis now."""
        return True

    def _keep_pace(self, override: float) -> None:
        """Lay the rest of the way anew where the override has changed: with its ramps, from the speed that the axis has."""
        if override == self._factor:
            return
        self._factor = override
        self.begin(self.plan(self._origin))
        self.clock = self._time = PathClock()
        self._arrive_by = None

    def _arrived(self, image: AxisImage) -> bool:
        if self._factor:
            return super()._arrived(image)
        self.rests_from = image.now
        return False

    def _take_over(self, before: Follow, image: AxisImage) -> None:
        self._factor = image.override
        self.begin(self.plan(image.origin))
        self.resume(before)
        self._before = None

    def _check_deadline(self, image: AxisImage) -> None:
        if self._deadline is None or image.now <= self._deadline or self._is_given_up or self.clock.braking:
            return
        assert self._profile.timeout is not None
        raise timed_out(self._goal, self._profile.timeout, image, self._parameters)
