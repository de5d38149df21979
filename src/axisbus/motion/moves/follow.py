"""Follow a trajectory in cyclic synchronous position mode: one target per cycle, which the drive takes at SYNC."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import ClassVar, NoReturn

from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import AxisbusError, LimitError, MotionTimeout
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.activity import Activity, SetPointSource, require_position, where_text
from axisbus.motion.moves.interpolation import CyclicSetup
from axisbus.motion.moves.interpolation import interpolation_period as interpolation_period
from axisbus.motion.moves.mode_switch import ModeSwitch
from axisbus.motion.moves.prepare import RampTransfers, slow_ramp_writes
from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed, Start
from axisbus.motion.moves.remote_trajectory import Streamed
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.override import MAX_OVERRIDE
from axisbus.motion.parameters import NOISE, AxisParameters
from axisbus.motion.path_limit_check import (
    LimitExceeded,
    PathLimitCheck,
    PathSample,
    Ramped,
    brakes_smoothly,
    limit_check_of,
)
from axisbus.motion.pathclock import BrakingClock, PathClock, PathParameter
from axisbus.motion.position_limits import (
    UNLIMITED,
    Excess,
    LookaheadTrajectory,
    Path,
    PositionRange,
    braking,
    count_range,
    excess,
    is_beyond,
    narrowed,
    rest_beyond,
    rest_position,
    steps_to_rest,
    widened,
)
from axisbus.motion.superimposed import Addition, admit, look_ahead
from axisbus.motion.trajectory import CheckedTrajectory, SampledTrajectory, Trajectory
from axisbus.units import INT32_HALF, INT32_LEAST

START_TOLERANCE = 20  # increments between the axis's position and the start of its trajectory
_BRAKING = 1.1  # factor by which a braked path may exceed its deceleration, because the path curves meanwhile
_NEAR_ITS_END = 0.05  # of a drive's count: no axis needs more to brake
_ARRIVAL = 2.0  # seconds that the axis may need to reach the last target
# The next position, the velocity of the path there, and the target in increments.
Foreseen = tuple[float, float, int]
# Of a path: the position at a time, its duration, whether the look-ahead is needed, the period, the highest velocity and
# acceleration, the limits, and the conversion of a position to a target: its factor, and the origin.
_PathValues = tuple[Callable[[float], float], float, bool, float, float, float, float, float, float, int]
_tuple = tuple.__new__  # makes a named tuple of values known to fit, without the call of its own ``__new__``


class Follow(Activity):
    """One axis on a trajectory: 60C2h and the mode first, then a target in each cycle; holds the last target.

    ``brakes_along``: it has failed before a limit was exceeded, so the stop brakes along its path.
    """

    mode = ModeOfOperation.CYCLIC_SYNC_POSITION
    ends_at_rest = True
    foresees: ClassVar[bool] = True  # ``foresee`` and ``use_foreseen`` are all of its step

    def __init__(
        self,
        trajectory: Trajectory | None,
        parameters: AxisParameters,
        gate: StartBarrier,
        travel: BrakingClock | None = None,
    ) -> None:
        """``trajectory`` None: the group sets it with ``begin`` while all axes wait at the start barrier; its clock is ``travel``.

        Without ``travel``, the path is followed by time, and a halt brakes the axis's own path with its deceleration.
        """
        self._trajectory: CheckedTrajectory | None = None
        # the trajectory itself, for its properties known in advance
        self._raw_trajectory: Trajectory | None = None
        self._stream: Streamed | None = None  # the trajectory, if it arrives in parts
        self._parameters = parameters
        self._units = parameters.units.position
        self._period = parameters.scan_period
        self._gate = gate
        self._travel: BrakingClock | None = travel
        self._own_clock = travel is None
        self._time = PathClock()
        self.clock: PathParameter = travel or self._time
        self._mode = ModeSwitch(ModeOfOperation.CYCLIC_SYNC_POSITION, parameters)
        self._setup = CyclicSetup(parameters)
        self._stop_ramp = RampTransfers(slow_ramp_writes(parameters), parameters)
        self._prepared = False
        self._running = False
        self._last: int | None = None
        self._origin = 0  # stored at the beginning: a later change of the origin must not move the axis
        self._arrive_by: float | None = None
        self._edges: tuple[float, float] | None = None  # the position limits that apply to it
        # The range of the drive's count; None: the axis may continue past its end.
        self._count: PositionRange | None = None
        # the permitted range: within both, the limits widened to its start
        self._limits: PositionRange | None = None
        self._is_returning = False  # the axis moves back from beyond the limits
        self._is_known = False  # the path is known in advance, and checked as a whole
        self._stepped = False
        self._pace: PathLimitCheck | None = None
        # The step to the last target, before it was rounded to increments.
        self._step: PathSample | None = None
        self._brake = 0.0  # unit/s²: its own braking deceleration; 0: it does not brake on its own
        self._path_values: _PathValues | None = None
        self._highest_override = 1.0  # the highest override that keeps the path within the limits of its axis
        self.brakes_along = False
        self.shifted = 0.0  # distance of the commanded position from the path: the superimposed distance
        self._addition: Addition | None = None  # that still changes ``shifted``
        if trajectory is not None:
            self.begin(trajectory)

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the axis has reached the end of the trajectory."""
        self._stepped = True
        continues = (
            self._running and image.position is not None
        )  # a running one is prepared, and its start barrier stays open
        if continues and self._own_clock and not self.clock.braking:
            self._apply_override(image.override)
        if self._addition is not None:
            self._addition.factor = image.override
        trajectory = self._trajectory
        if not continues and (not self._prepare(image, order) or trajectory is None):
            return False
        assert trajectory is not None
        clock, after = self.clock, None
        if not self._running:
            self._start(image)
        elif self._own_clock:
            if not clock.braking:
                after = self._look_ahead(trajectory)
            clock.advance(self._period)
        order.halt = False
        order.target_position = self._target(trajectory, after)
        if clock.t < trajectory.duration or clock.braking or self._addition is not None:
            self.rests_from = image.now
            return False
        return self._arrived(image)

    def superimpose(self, addition: Addition) -> None:
        """Superimpose a distance on the path from the next cycle on; it continues at the rate of the one that it replaces."""
        if self._addition is not None:
            addition.continue_from(self._addition)
        self._addition = addition

    def foresee(self) -> Foreseen | None:
        """Return the next target in the usual case (not at the end, and within all limits); ``step`` computes the same target.

        Nothing changes by this. None: not the usual case.
        """
        clock, before = self.clock, self._step
        if (
            clock.braking
            or before is None
            or not self._running
            or self._is_returning
            or self._addition is not None
            or (self._own_clock and not self._time.is_even)
        ):
            return None
        path = self._path_values or self._collect_path_values()
        position, duration, looks, period, fastest, hardest, lowest, highest, factor, origin = path
        t = clock.t + period if self._own_clock else clock.t
        if t >= duration:
            return None
        braked = self.brakes_along
        try:
            if looks:
                self._check_path_ahead()
            path_position = position(t)
            target = round(path_position * factor) + origin
        except (AxisbusError, OverflowError):  # ``step`` finds this error again, and raises it
            self.brakes_along = braked
            return None
        velocity = (path_position - before.position) / period
        if (
            -fastest <= velocity <= fastest
            and -hardest <= (velocity - before.velocity) / period <= hardest
            and lowest <= path_position <= highest
            and INT32_LEAST <= target < INT32_HALF
        ):
            return path_position, velocity, target
        return None

    def _collect_path_values(self) -> _PathValues:
        """Collect the values that every cycle needs from the path, and that stay constant while the axis is on it."""
        trajectory, pace, limits = self._trajectory, self._pace, self._limits or UNLIMITED
        assert trajectory is not None
        assert pace is not None
        looks = self._own_clock and (
            self._stream is not None or (self._limits is not None and not self._is_known)
        )
        self._path_values = path = (
            partial(self._axis_position, trajectory) if self.shifted else trajectory.position,
            trajectory.duration,
            looks,
            self._period,
            math.inf if pace.velocity is None else pace.velocity,
            math.inf if pace.acceleration is None else pace.acceleration,
            *limits,
            self._units.factor,
            self._origin,
        )
        return path

    def use_foreseen(self, foreseen: Foreseen, now: float) -> int:
        """Use the foreseen target in the cycle at ``now``, as ``step`` does; return the target in increments."""
        self._stepped = True
        if self._own_clock:
            self._time.run_on(self._period)  # a foreseen target implies an even clock
        path_position, velocity, self._last = foreseen
        self._step = _tuple(PathSample, (path_position, velocity))
        self.rests_from = now
        return self._last

    def reference(self, image: AxisImage) -> int:
        """Return the position at which to start, in increments: the demand, else the actual position."""
        if self._mode.reference is not None:
            return self._mode.reference
        return (
            image.demand
            if image.demand is not None
            else require_position(image, self._parameters.name, "csp")
        )

    def begin(self, trajectory: Trajectory) -> None:
        """Take the trajectory that the group has planned."""
        self._trajectory, self._raw_trajectory = (
            CheckedTrajectory(trajectory, self._parameters.name),
            trajectory,
        )
        self._path_values = None
        if isinstance(trajectory, Streamed):
            self._stream = trajectory
            trajectory.brakes_with(self._parameters.path_deceleration, self._parameters.scan_period)

    def guide_by(self, guide: BrakingClock, trajectory: Trajectory) -> None:
        """Follow the clock ``guide`` instead of time, along ``trajectory``."""
        self._travel = self.clock = guide
        self._own_clock = False
        self.begin(trajectory)

    def replace_trajectory(self, trajectory: Trajectory) -> None:
        """Continue along another trajectory, which has the same position and speed as the previous one at this time."""
        self.begin(trajectory)
        if self._running:
            self._pace = limit_check_of(self._parameters, trajectory)
            self._highest_override = _highest_override(trajectory, self._pace)

    def take_stepped(self) -> bool:
        """Return whether it was stepped, by its axis's command or stop, since the last call."""
        stepped, self._stepped = self._stepped, False
        return stepped

    def resume(self, before: Follow) -> None:
        """Continue from the last target of ``before``, one cycle ago, with the trajectory that has been begun."""
        assert self._raw_trajectory is not None
        self._prepared = self._running = True
        self._path_values = None
        self._last, self._step = before._last, before._step
        if self._step is not None:
            self._time.start_at(self._step.velocity)
        self._edges, self._count, self._limits = before._edges, before._count, before._limits
        self._is_returning = before._is_returning
        self._origin = before._origin
        self._pace = limit_check_of(self._parameters, self._raw_trajectory)
        self._highest_override = _highest_override(self._raw_trajectory, self._pace)

    @property
    def is_under_way(self) -> bool:
        """Whether it commands the axis: there is a ``last_step``."""
        return self._step is not None

    @property
    def last_step(self) -> PathSample:
        """The position of the path in the last cycle, and its velocity there; only once it runs."""
        assert self._step is not None
        return self._step

    @property
    def permitted_range(self) -> PositionRange:
        """The permitted range of its positions, in units."""
        return self._limits or UNLIMITED

    @property
    def path_step(self) -> PathSample:
        """The position and velocity of the path itself in the last cycle, without the superimposed distance."""
        rate = 0.0 if self._addition is None else self._addition.rate
        return PathSample(self.last_step.position - self.shifted, self.last_step.velocity - rate)

    @property
    def path_velocity(self) -> float:
        """The velocity that the path itself has at its present position (unit/s); of an unknown path, its mean over the last cycle.

        If the path brakes, the mean is higher, and a move that was planned with it would pass its end.
        """
        path = self._raw_trajectory
        if isinstance(path, ProfileFromSpeed) and self._own_clock and self._time.rate == 1.0:
            return path.speed(self.clock.t)
        return self.path_step.velocity

    @property
    def acceleration(self) -> float:
        """The present acceleration of the trajectory (unit/s²) if it is known; else 0."""
        path, t = self._raw_trajectory, self.clock.t
        if not isinstance(path, ProfileFromSpeed) or self._addition is not None:
            return 0.0
        if not self._own_clock or self._time.rate != 1.0:
            return 0.0
        return (path.speed(t) - path.speed(t - self._period)) / self._period

    @property
    def commanding_path(self) -> Follow:
        """The path that commands the axis in this cycle: itself, once it has begun."""
        return self

    def begin_braking(self) -> bool:
        """Begin to brake along the path; return False if nothing moves yet, or no deceleration is known."""
        if self._trajectory is None or not self._running:
            return False
        if self._addition is not None:
            self._addition.halt()
        if self._travel is not None:
            self._travel.brake()
            return True
        deceleration = self._parameters.path_deceleration
        if deceleration and not self.clock.braking:
            self._time.brake(partial(self._axis_position, self._trajectory), deceleration)
        return self.clock.braking

    def brake_hard(self) -> None:
        """Make a soft halt as hard as any other stop from now on; most paths brake like this already."""

    def brake_alone(self) -> bool:
        """Begin to brake with the axis's own deceleration, from the last target and its speed, whatever its path was.

        It brakes harder if this keeps it within its position limits: the path may have approached them with a harder deceleration.
        Return False if nothing moves yet, or no deceleration is known.
        """
        usual = self._parameters.path_deceleration
        if self._step is None or not usual:
            return False
        if self._travel is None and self._own_clock and self.clock.braking:
            return True
        (at, speed), permitted_range = self._step, self._limits or UNLIMITED
        if self._edges is not None:
            permitted_range = widened(self._edges, at, 0.0)
        if rest_beyond(permitted_range, at, speed, usual) is None:
            self._brake = usual
            self.begin(
                ProfileFromSpeed(
                    Start(at, speed), rest_position(at, speed, usual), abs(speed) or 1.0, usual, usual
                )
            )
        else:
            self._brake = down = braking(
                permitted_range, at, speed, usual, max(usual, self._hardest), self._period
            )
            self.begin(SampledTrajectory(steps_to_rest(at, speed, down, self._period), self._period))
        self._travel, self._own_clock = None, True
        self.shifted, self._addition = 0.0, None  # the sum of both is braked
        self.clock = self._time = PathClock()
        self.clock.braking = True
        return True

    @property
    def _hardest(self) -> float:
        """The hardest permitted deceleration of a stop: that of a stop of this axis, or that of its trajectory if it is harder."""
        limit, as_text = self._parameters.limits.acceleration, self._raw_trajectory
        own = as_text.top_acceleration if limit is None and isinstance(as_text, Ramped) else 0.0
        return max(own, self._parameters.hardest_deceleration or 0.0)

    @property
    def at_rest(self) -> bool:
        """Whether the commanded motion is at standstill: before the start, after braking, at the end."""
        ended = self._trajectory is not None and self.clock.t >= self._trajectory.duration
        rests = self.clock.stopped or ended
        return not self._running or self._step is None or (rests and self._addition is None)

    @property
    def set_point_source(self) -> SetPointSource | None:
        """This trajectory itself."""
        return self

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake of the change of mode."""
        return self._mode.in_flight

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued requests."""
        self._setup.cancel(order)
        self._stop_ramp.cancel(order)
        self._mode.cancel(order)

    def _axis_position(self, trajectory: Trajectory, t: float) -> float:
        end = trajectory.duration
        return trajectory.position(0.0 if t < 0.0 else end if t > end else t) + self.shifted

    def _prepare(self, image: AxisImage, order: CycleOutputs) -> bool:
        require_position(image, self._parameters.name, "cyclic synchronous position mode")
        if not self._prepared:
            written = self._setup.step(image, order) and self._stop_ramp.step(image, order)
            self._prepared = written and self._mode.step(image, order)
        return self._prepared and self._may_begin(image) and self._gate.pass_through(self)

    def _may_begin(self, image: AxisImage) -> bool:
        """Whether enough is known of a trajectory that arrives in parts."""
        return self._running or self._stream is None or self._stream.ready(image.now, self._parameters.name)

    def _start(self, image: AxisImage) -> None:
        assert self._trajectory is not None
        assert self._raw_trajectory is not None
        units = self._parameters.units.position
        reference = self.reference(image)
        first = units.to_increments(self._trajectory.position(self.clock.t)) + image.origin
        if abs(first - reference) > START_TOLERANCE:
            self.refused = True
            raise LimitError(
                f"{self._parameters.name}: the trajectory does not begin at the position of the axis",
                observed=f"it begins at {units.to_units(first - image.origin):g} {units.unit}, the axis is at "
                f"{units.to_units(reference - image.origin):g} {units.unit}",
                remedy="begin it at axis.position",
            )
        self._running = True
        self._path_values = None
        self._last, self._origin = reference, image.origin
        self._is_known = isinstance(self._raw_trajectory, LookaheadTrajectory)
        self._pace = limit_check_of(self._parameters, self._raw_trajectory)
        self._highest_override = _highest_override(self._raw_trajectory, self._pace)
        self._set_limits(
            self._parameters.limits.position,
            *(units.to_units(at - image.origin) for at in (reference, first)),
        )
        self._require_count(self._raw_trajectory)

    def _set_limits(self, edges: tuple[float, float] | None, *positions: float) -> None:
        """Apply the limits ``edges`` (None: no limits) and the drive's count from now on; ``positions``: positions of the axis."""
        units = self._parameters.units
        self._edges, self._count, self._is_returning = edges, None, False
        if units.modulo is None and not self._parameters.virtual:
            count = count_range(units.position.to_increments(positions[0]) + self._origin)
            self._count = PositionRange(*sorted(units.position.to_units(end - self._origin) for end in count))
        self._limits = self._count
        if edges is None:
            return
        self._is_returning = any(is_beyond(edges, path_position, self._noise) for path_position in positions)
        self._is_known = self._is_known and not self._is_returning
        permitted_range = edges
        for path_position in positions:
            permitted_range = widened(permitted_range, path_position, 0.0)
        margin = abs(units.position.to_units(1))  # possible error of a trajectory's arithmetic
        low, high = self._count or UNLIMITED
        self._limits = PositionRange(
            max(permitted_range[0] - margin, low), min(permitted_range[1] + margin, high)
        )

    @property
    def _noise(self) -> float:
        """The possible difference of two positions of an axis at rest, in units."""
        return abs(self._parameters.units.position.to_units(NOISE))

    def _require_count(self, trajectory: Trajectory | None) -> None:
        """Raise LimitError if a trajectory with a known span would leave the drive's count."""
        if self._count is None or not isinstance(trajectory, LookaheadTrajectory):
            return
        for end in trajectory.span:
            if not self._count.has(end):
                seen = f"it would move to {end:.10g} {self._units.unit}"
                raise self._count_exceeded("the trajectory", seen, "left where it was")

    def _apply_override(self, override: float) -> None:
        """Let the time of the trajectory run at ``override``, as far as this exceeds no limit."""
        time, factor = self._time, min(override, self._highest_override)
        if factor == 1.0 and time.is_even:
            return
        assert self._trajectory is not None
        assert self._pace is not None
        ramps = [ramp for ramp in (self._parameters.path_deceleration, self._pace.acceleration) if ramp]
        time.aim(factor, partial(self._axis_position, self._trajectory), min(ramps, default=None))

    def _look_ahead(self, trajectory: CheckedTrajectory) -> PathSample:
        """Return the step to the next target; raise an error if it exceeds a limit, or the path after it could not be braked.

        The path is then braked from its present position (``brakes_along``). If the path breaks off, the drive's quick stop
        brakes.
        """
        self._check_path_ahead()
        assert self._pace is not None
        assert self._step is not None
        t, before, end = self._time.next(self._period), self._step, trajectory.duration
        path_position = trajectory.position(t if t < end else end)
        if self._addition is not None:
            self._advance_addition(self._addition, path_position)
        after = self._pace.next(before, path_position + self.shifted)
        found = self._pace.excess(before, after)
        if found is not None:
            self._refuse(found, trajectory, t)
        return after

    def _check_path_ahead(self) -> None:
        """Raise an error if the axis could soon no longer brake within the known path, or within its limits."""
        trajectory = self._trajectory
        assert trajectory is not None
        if self._stream is not None:
            self._check_stream(self._stream)
        if self._limits is not None and not self._is_known and self._may_leave(self._limits):
            self._check_limits_ahead(partial(self._axis_position, trajectory), self._limits)

    def _check_stream(self, stream: Streamed) -> None:
        """Check that the axis can still brake within the known part of the path."""
        error = stream.shortage(self.clock.t, self._parameters.name, self._time.rate)
        if error is not None:
            self.brakes_along = bool(self._parameters.path_deceleration)
            raise error

    def _may_leave(self, permitted_range: PositionRange) -> bool:
        """Whether the axis may come near the ends of its range; those of a drive's count are nearly always far away."""
        if self._edges is not None or self._step is None:
            return True
        far = _NEAR_ITS_END * (permitted_range.high - permitted_range.low)
        return not permitted_range.low + far < self._step.position < permitted_range.high - far

    def _check_limits_ahead(self, path: Path, limits: tuple[float, float]) -> None:
        """Look as far ahead as braking takes; a path known in advance has been checked before."""
        deceleration = self._parameters.path_deceleration
        if not deceleration:
            return
        found = excess(path, self.clock.t, self._period, limits, deceleration)
        if found is not None:
            self.brakes_along = True
            raise self._leaving_error(found)

    def _refuse(self, found: LimitExceeded, trajectory: Trajectory, t: float) -> NoReturn:
        """End the motion in the cycle before the target at ``t``, which would exceed a limit."""
        ramp, path, speed = (
            self._parameters.path_deceleration,
            partial(self._axis_position, trajectory),
            self.last_step.velocity,
        )
        self.brakes_along = bool(ramp) and brakes_smoothly(
            path, self.clock.t, self._period, speed, ramp or 0.0
        )
        raise self._limit_exceeded(found, t)

    def _target(self, trajectory: Trajectory, known: PathSample | None) -> int:
        """Return the target of this cycle, in increments; ``known``: the step to it, if it was checked in advance."""
        limits, t = self._limits, self.clock.t
        if known is None and self._addition is not None:
            self._advance_addition(self._addition, self._axis_position(trajectory, t) - self.shifted)
        value = self._axis_position(trajectory, t) if known is None else known.position
        if limits is not None and not self._brake and not limits.has(value):
            raise self._leaving_error(None, value)
        if known is None:
            self._record_step(value)
        else:
            self._step = known
        if self._is_returning:
            self._narrow_limits(value)
        self._last = last = self._units.to_increments(value) + self._origin
        return last

    def _narrow_limits(self, position: float) -> None:
        """Narrow the permitted range while the axis moves back inside its limits."""
        assert self._edges is not None
        assert self._limits is not None
        self._limits = narrowed(self._limits, self._edges, position, self._noise)
        self._is_returning = is_beyond(self._edges, position, self._noise)
        self._path_values = None

    def _advance_addition(self, addition: Addition, path_position: float) -> None:
        """Advance the superimposed distance, with the path at ``path_position``, within the permitted velocity and acceleration."""
        pace, step = self._pace, self._step
        if pace is None or step is None or self._raw_trajectory is None:
            return  # the first target is the axis's position
        if not addition.is_admitted:
            pace = self._pace = self._admit(addition, self._raw_trajectory)
        velocity = (path_position + self.shifted - step.position) / self._period
        if self._limits is not None and not self._is_known:
            error = look_ahead(
                addition, path_position + self.shifted, velocity, pace, self._limits, self._parameters
            )
            if error is not None:
                addition.halt(error)
        fastest = math.inf if pace.velocity is None else pace.velocity
        hardest = math.inf if pace.acceleration is None else pace.acceleration
        if (
            self.clock.braking
        ):  # without the tolerance for the braked path, which the distance must not use up
            hardest = max(hardest, self._brake, self._parameters.path_deceleration or 0.0)
        low = max(-fastest, step.velocity - hardest * self._period)
        high = min(fastest, step.velocity + hardest * self._period)
        before = addition.value
        addition.step(velocity, low, high)
        self.shifted += addition.value - before
        if addition.over:
            self._addition = None
        self._path_values = None

    def _admit(self, addition: Addition, path: Trajectory) -> PathLimitCheck:
        """Check the properties of the path that are known in advance; return the limits of the sum."""
        addition.is_admitted, pace = True, limit_check_of(self._parameters, path)
        try:
            admit(addition, path, self.shifted, self._parameters, self._limits)
        except LimitError as error:
            addition.halt(error)
            return pace
        if self._parameters.limits.acceleration is not None or pace.acceleration is None:
            return pace
        # Which then only detects a jump.
        return replace(pace, acceleration=pace.acceleration + addition.hardest)

    def _record_step(self, value: float) -> None:
        """Record the step to the next target; a target that exceeds a limit is never sent, whatever was checked in advance."""
        assert self._pace is not None
        if self._step is None:
            self._step = PathSample(value)
            return
        after = self._pace.next(self._step, value)
        found = self._pace.excess(self._step, after, self._braked_by if self.clock.braking else 0.0)
        if found is not None:
            raise self._limit_exceeded(found, self.clock.t)
        self._step = after

    @property
    def _braked_by(self) -> float:
        """The permitted deceleration of a braked path, in unit/s²."""
        return _BRAKING * max(self._brake, self._parameters.path_deceleration or 0.0)

    def _limit_exceeded(self, found: LimitExceeded, t: float) -> LimitError:
        name = self._parameters.name
        how = "braked along it" if self.brakes_along else "stopped"
        return LimitError(
            f"{name}: the trajectory is {found.what}",
            observed=f"at {self.clock.as_text(t)}: {found.seen}",
            remedy=f"slow the trajectory down or smooth it, or raise the limit in [axes.{name}] of cell.toml; the axis was {how}",
        )

    def _leaving_error(self, found: Excess | None, value: float = 0.0) -> LimitError:
        name, unit = self._parameters.name, self._parameters.units.position.unit
        seen = (
            f"{value:g} {unit} at {self.clock.as_text(self.clock.t)}"
            if found is None
            else f"at {found.here:g} {unit}, with {found.speed:g} {unit}/s, it would stop at {found.stop:g} {unit} if it "
            f"continued; the trajectory is at {found.there:g} {unit} at {found.time:.3f} s"
        )
        how = "stopped" if found is None else "braked along it, to stop within them"
        if self._edges is None:
            return self._count_exceeded("the trajectory", seen, how)
        return LimitError(
            f"{name}: the trajectory leaves the position limits",
            observed=f"{seen}; the allowed range is {self._edges[0]:g} to {self._edges[1]:g}",
            remedy=f"change the trajectory, or position_limits in [axes.{name}] of cell.toml; the axis was {how}",
        )

    def _count_exceeded(self, what: str, seen: str, how: str) -> LimitError:
        """Return the error for the case that ``what`` moves the axis beyond the positions that its drive can count."""
        name, unit, permitted_range = self._parameters.name, self._parameters.units.position.unit, self._count
        assert permitted_range is not None
        return LimitError(
            f"{name}: {what} leaves the drive's position range (INTEGER32)",
            observed=f"{seen}; the range of the drive is {permitted_range.low:.10g} to {permitted_range.high:.10g} {unit}",
            remedy=f"home {name} nearer to its working range, or set modulo in [axes.{name}] of cell.toml for an endless "
            f"axis; the axis was {how}",
        )

    def _arrived(self, image: AxisImage) -> bool:
        assert self._last is not None
        if self._arrive_by is None:
            self._arrive_by = image.now + _ARRIVAL
        window = self._parameters.position_window or START_TOLERANCE
        if image.position is not None and image.standstill and abs(image.position - self._last) <= window:
            return True
        if image.now > self._arrive_by:
            raise self._late(image, window)
        return False

    def _late(self, image: AxisImage, window: int) -> MotionTimeout:
        assert self._last is not None
        name, units = self._parameters.name, self._parameters.units.position
        hints = [] if image.statusword is None else sw.hints(image.statusword, image.mode)
        return MotionTimeout(
            (
                f"{name}: the axis does not reach the end of its trajectory, {units.to_units(self._last - self._origin):g} "
                f"{units.unit}"
            ),
            axis=name,
            observed=f"position {where_text(image, self._parameters)} after {_ARRIVAL:g} s; within "
            f"{abs(units.to_units(window)):g} {units.unit} was expected"
            + "".join(f"; {hint}" for hint in hints),
            remedy="check whether the axis is blocked or badly tuned; position_window in [axes."
            + name
            + "] sets the tolerance",
        )


def _highest_override(trajectory: Trajectory, pace: PathLimitCheck) -> float:
    """Return the highest override of a trajectory: 1 if its velocity and acceleration are not known in advance.

    If its time runs faster by a factor, the velocity increases by the factor, and the acceleration by its square.
    """
    most = MAX_OVERRIDE
    if pace.velocity is not None:
        if not isinstance(trajectory, LookaheadTrajectory):
            return 1.0
        if trajectory.top_speed:
            most = min(most, pace.velocity / trajectory.top_speed)
    if pace.acceleration is not None:
        if not isinstance(trajectory, Ramped):
            return 1.0
        if trajectory.top_acceleration:
            most = min(most, math.sqrt(pace.acceleration / trajectory.top_acceleration))
    return max(1.0, most)
