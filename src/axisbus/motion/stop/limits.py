"""Limits while an axis moves freely: position limits ahead of a velocity or torque move, and the velocity limit.

Theory of operation
-------------------
In each cycle the monitor computes where the axis would come to rest if it were stopped in the next cycle. Some time passes until
the stop acts: the age of the position, the period until the next check, and the drive's reaction time (``_REACTION``). During that
time the axis continues as commanded: up to the command's speed, with the command's acceleration. Under torque control the
acceleration is not known, so the measured acceleration is used. Then the axis brakes with the deceleration that the stop of this
mode really has (``stop_of``).

The monitor checks the position of the motor and the drive's demand (6062h), because a lagging motor still reaches the demand. A
demand that arrives less often than the position has an outdated velocity. Such a demand only gives the lag of the motor in
seconds, which is added to the reaction time of a stop. Without a trusted demand, the lag comes from the last targets of csp
before a velocity command, or from the ramps of the commands (``VelocityRampTracker.lag``). The lag belongs to the drive, so the
monitor uses the last value until a later command gives another one, and ``_UNKNOWN_LAG`` before the first.

An axis at rest beyond a limit may move back (``position_limits``): the limit is then its rest position.

A position has a noise of some increments, and a velocity is computed from two positions. So a velocity in a direction is ignored
while the axis has moved in that direction by no more than this noise, over all samples of its track. It is not ignored if the
command moves the axis in that direction. While the velocity is ignored, the monitor reports a danger only if the position itself is
beyond the limit by more than the noise.
"""

from __future__ import annotations

import math

from axisbus.cia402 import objects
from axisbus.cia402.options import Ramp
from axisbus.errors import AxisbusError, LimitError
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import require_position
from axisbus.motion.moves.profile import braking_distance
from axisbus.motion.parameters import NOISE, AxisParameters
from axisbus.motion.position_limits import PositionRange, narrowed, widened
from axisbus.motion.states import AxisState
from axisbus.motion.stop.stop_sequence import StopLevel
from axisbus.motion.stop_deceleration import BRAKES, CommandedMotion
from axisbus.motion.velocity_estimator import VelocityEstimator

_CONTINUOUS, _DISCRETE = AxisState.CONTINUOUS_MOTION, AxisState.DISCRETE_MOTION
_OVERSPEED = 1.1  # measured velocity is noisy, and a drive's own control overshoots
# Scan periods: until the next check, until the SYNC after it, until the drive receives the command, until it brakes.
_REACTION = 4.0
_PREPARES = 5.0  # scan periods until the ramps of a command are written by SDO
# Seconds by which a motor may lag if no command has shown it yet, or if it is pushed and no demand can show it.
_UNKNOWN_LAG = 0.02
_LAG_ERROR = 0.005  # seconds that the noise of a position may add to a lag
_NOISE = 3.0  # increments of error of a position, as a velocity over one period
_WINDOW = 20.0  # increments by which a move may overshoot its target at its end
# Positions between two demands: beyond this, the velocity between them is too old if it changes.
_SELDOM = 2.5
# Seconds that a motor may lag behind its demand; a demand farther away does not belong to this motion.
_LONGEST_LAG = 0.25


class LimitMonitor:
    """Detects a coming violation of the limits in time to brake.

    Holds the tracks of the position and of the demand, and the time since which the axis moves freely.
    """

    __slots__ = (
        "_demand",
        "_edges",
        "_free_since",
        "_lag",
        "_origin",
        "_outward",
        "_parameters",
        "_permitted_range",
        "_position",
        "_shown_at",
        "_shown_lag",
        "leaving_error",
    )

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._position, self._demand = VelocityEstimator(), VelocityEstimator()
        edges = parameters.position_edges
        self._edges = (
            None if edges is None else PositionRange(*edges)
        )  # in increments, relative to the origin
        self._permitted_range = self._edges  # widened to the rest position of an axis that rests beyond them
        self._origin: int | None = None  # to which the range refers
        self._free_since: float | None = None
        self._outward = 0  # sign of the torque that last moved the axis towards the outside of its limits
        self._lag: float | None = None  # seconds, last measured on targets or on the ramps of commands
        self._shown_lag = 0.0  # seconds, measured with a demand that arrives rarely
        self._shown_at = -math.inf  # when that demand arrived
        # the last danger of an axis inside its position limits: it can come to rest there
        self.leaving_error: LimitError | None = None

    @property
    def tracks(self) -> tuple[VelocityEstimator, VelocityEstimator | None]:
        """The tracks of the position, and of the demand if the demand is evaluated."""
        return self._position, None if self._edges is None else self._demand

    def forget(self) -> None:
        """Reset the tracks: earlier positions have another origin."""
        self._position.recount()
        self._demand.recount()

    @property
    def is_free(self) -> bool:
        """Whether the axis was seen in a motion without target and path: ``danger`` must then record the end of this motion."""
        return self._free_since is not None

    def look(self, image: AxisImage) -> None:
        """Record the positions of this cycle. Must be called in every cycle, whatever the axis does."""
        self._position.take(image.position, image.position_stamp)
        if self._edges is not None:
            self._demand.take(image.demand, image.demand_stamp)

    @property
    def _known_lag(self) -> float:
        return _UNKNOWN_LAG if self._lag is None else self._lag

    def _learn_lag(self, ahead: int) -> None:
        """Compute the lag of an axis that still follows targets, the last of which is ``ahead`` of its position (increments)."""
        if not self._position.is_known:
            return
        velocity, _ = self._position.motion
        lag = ahead / velocity if abs(velocity) * _LAG_ERROR > NOISE else math.inf
        if 0.0 <= lag <= _LONGEST_LAG:
            self._lag = max(0.0, lag - _REACTION * self._parameters.scan_period)

    def danger(
        self,
        image: AxisImage,
        state: AxisState,
        *,
        bounded: bool = True,
        commanded: CommandedMotion | None = None,
        lag: float | None = None,
    ) -> AxisbusError | None:
        """Return why the axis must be stopped now; None: no danger.

        ``bounded``: whether the position limits apply. ``commanded``: the motion commanded by the running command. ``lag``: the
        measured lag of the axis in seconds, beyond the time in which its drive accepts a command; None: keep the last value.
        """
        if self._edges is not None and image.position is not None:
            self._update_permitted_range(image, self._edges, image.position - image.origin)
        if state is not _CONTINUOUS:
            self._free_since = None
            to_target = state is _DISCRETE and bounded and self._edges is not None
            return self._overshoots(image, commanded) if to_target and commanded is not None else None
        if self._free_since is None:
            self._free_since = image.now
        if lag is not None:
            self._lag = lag
        elif (
            image.demand is None and image.reference_tracker.target is not None and image.position is not None
        ):
            self._learn_lag(image.reference_tracker.target - image.position)
        bounded = bounded and self._parameters.limits.position is not None
        if image.position is None:
            return self._position_unknown(image) if bounded else None
        if not self._position.is_known:
            return None
        commanded = commanded or CommandedMotion()
        return self._too_fast(image, commanded) or (self._too_far(image, commanded) if bounded else None)

    def note_torque(self, commanded: int, measured: int | None) -> None:
        """Record the direction of the torque under which the axis is leaving its limits, unless the drive shows another one."""
        if commanded and (measured is None or measured * commanded > 0):
            self._outward = 1 if commanded > 0 else -1

    def is_pushed_out(self, image: AxisImage, torque: int | None) -> bool:
        """Return whether ``torque`` (None: any) would move an axis farther out that is beyond its position limits.

        Only a torque shows its direction of motion: polarity and load decide on it. So this is known after a torque of the same
        sign has moved the axis out. An axis that moves back may be braked by it.
        """
        if self._edges is None or image.position is None or not self._outward:
            return False
        low, high = self._edges
        where = image.position - image.origin
        if low - NOISE <= where <= high + NOISE:
            return False
        velocity = self._position.motion[0] if self._position.is_known else 0.0
        returns = not image.standstill and (velocity > 0) == (where < low)
        return not returns and (torque is None or torque * self._outward > 0)

    def _update_permitted_range(self, image: AxisImage, edges: PositionRange, where: int) -> None:
        """Widen the limits to the rest position of an axis beyond them; narrow them again while the axis moves back."""
        if edges.has(where):
            self._permitted_range = edges
        elif image.standstill or self._permitted_range is None or self._origin != image.origin:
            self._permitted_range = widened(edges, where, 0.0)
        else:
            self._permitted_range = narrowed(self._permitted_range, edges, where, 0.0)
        self._origin = image.origin

    def overrun(
        self, image: AxisImage, down: float, before: CommandedMotion | None = None, soft: float = 0.0
    ) -> float | None:
        """Return where (in units) the axis would come to rest if it braked with ``down``; None: within its position limits.

        ``before``: the motion that is commanded until then. ``soft``: seconds by which a limited jerk may prolong its ramps.
        """
        if image.position is None or not self._position.is_known:
            return None
        velocity, _ = self._position.motion
        if before is not None and before.by_torque:
            return self._stop(image, CommandedMotion(by_torque=True), down)
        commanded = CommandedMotion(speed=velocity, up=0.0, soft=soft)
        if before is not None and before.speed is not None and before.up is not None:
            # The axis may accelerate until the drive has the next ramps, and the next set-point or velocity.
            speed = math.copysign(before.speed, velocity) if before.by_target else before.speed
            if before.by_target or abs(speed) > _OVERSPEED * abs(velocity):
                soft += 2.0 * _PREPARES * self._parameters.scan_period
            commanded = CommandedMotion(speed=speed, up=before.up, soft=soft)
        return self._stop(image, commanded, down)

    def _overshoots(self, image: AxisImage, commanded: CommandedMotion) -> LimitError | None:
        """Return why a move to a position must be stopped: its initial speed is too high for its deceleration.

        If the move ends within the limits, its computed rest position can be beyond them only because its velocity is older than
        its position. The window allows for this.
        """
        if self._edges is None or image.position is None or not self._position.is_known:
            return None
        if commanded.down is not None and self._is_far(image, commanded.down):
            return None
        velocity, _ = self._position.motion
        window = (
            max(_WINDOW, self._parameters.position_window or 0) + 2.0 * abs(velocity) * self._position.spacing
        )
        if not velocity:
            return None
        direction = 1 if velocity > 0 else -1
        if _only_wanders(self._position, direction):
            return None
        # If the braking distance is not known, the move is stopped once it has left the limits.
        distance = 0.0 if commanded.down is None else braking_distance(self._position.least, commanded.down)
        stop_distance = direction * (distance - window)
        rest = self._outside(image, image.position + stop_distance, direction)
        return None if rest is None else self._leaving_error(image, rest)

    def _is_far(self, image: AxisImage, down: float) -> bool:
        """Whether the limits are so far away that the axis could brake from twice its speed: no further computation is needed."""
        assert self._edges is not None
        assert image.position is not None
        stop_distance = _WINDOW + 4.0 * braking_distance(self._position.mean, down)
        where = image.position - image.origin
        return self._edges[0] + stop_distance < where < self._edges[1] - stop_distance

    def _position_unknown(self, image: AxisImage) -> AxisbusError | None:
        try:
            require_position(image, self._parameters.name, "keeping the position limits")
        except AxisbusError as error:
            return error
        return None

    # -- velocity ----------------------------------------------------------------------------------------------------

    def _too_fast(self, image: AxisImage, commanded: CommandedMotion) -> LimitError | None:
        limit, units = self._parameters.limits.velocity, self._parameters.units.position
        if limit is None or not self._parameters.units.ratio_known:
            return None  # a limit in the drive's own velocity increments cannot be compared with positions
        velocity, acceleration = self._position.motion
        speed, allowed = abs(units.to_units(velocity)), limit * _OVERSPEED
        if commanded.by_torque:  # only the master limits the speed here: the axis must not reach the limit
            gain = acceleration if velocity > 0 else -acceleration
            speed += abs(units.to_units(max(0.0, gain))) * self._growth(image, self._position)
            allowed = limit
        noise = abs(units.to_units(_NOISE)) / self._parameters.scan_period
        if speed <= allowed + noise:
            return None
        return LimitError(
            f"{self._parameters.name}: {'about to be ' if commanded.by_torque else ''}faster than max_velocity",
            observed=f"{abs(units.to_units(velocity)):g} {units.unit}/s"
            + (f", could be {speed:g} before a stop acts" if commanded.by_torque else "")
            + f"; the limit is {limit:g}",
            remedy=f"lower the torque or velocity, or raise max_velocity in [axes.{self._parameters.name}] of cell.toml; if "
            "a lower velocity was commanded, the drive uses another unit of velocity: check velocity_scale; the axis "
            "was stopped",
        )

    # -- position ----------------------------------------------------------------------------------------------------

    def _too_far(self, image: AxisImage, commanded: CommandedMotion) -> LimitError | None:
        ramp = stop_of(self._parameters, commanded)[1]
        if ramp is None and commanded.unknown:
            return self._unstoppable(commanded)
        stop = self._stop(image, commanded, ramp)
        return None if stop is None else self._leaving_error(image, stop)

    def _unstoppable(self, commanded: CommandedMotion) -> LimitError:
        why, remedy = unknown_braking(self._parameters, commanded)
        return LimitError(
            f"{self._parameters.name}: the axis could not be stopped within its position limits",
            observed=why,
            remedy=remedy,
        )

    def _leaving_error(self, image: AxisImage, stop: float) -> LimitError:
        limits, units = self._parameters.limits.position, self._parameters.units.position
        assert limits is not None
        assert image.position is not None
        velocity, _ = self._position.motion
        error = LimitError(
            f"{self._parameters.name}: about to leave its position limits",
            observed=f"at {units.to_units(image.position - image.origin):g} {units.unit}, moving at "
            f"{units.to_units(velocity):g} {units.unit}/s, could stop at {stop:g}; the allowed range is {limits[0]:g} to "
            f"{limits[1]:g}",
            remedy="move back into the limits; the axis was stopped",
        )
        if limits[0] <= units.to_units(image.position - image.origin) <= limits[1]:
            self.leaving_error = error
        return error

    def _demand_is_current(self, image: AxisImage) -> bool:
        """Whether the demand belongs to this motion: a drive may keep an old demand in a mode that has none."""
        if image.demand is None or image.position is None:
            return False
        if not self._demand.is_known and not self._is_seldom(image):
            return False
        velocity, _ = (self._demand if self._demand.is_known else self._position).motion
        return 0.0 < abs(image.lead or 0.0) <= _LONGEST_LAG * abs(velocity)

    def _is_seldom(self, image: AxisImage) -> bool:
        """Whether the demand arrives less often than the position; of the first demands, whether the next one has not come yet."""
        spacing = self._demand.spacing if self._demand.is_known else image.position_stamp - image.demand_stamp
        return spacing > _SELDOM * self._position.spacing

    def _stop(self, image: AxisImage, commanded: CommandedMotion, ramp: float | None) -> float | None:
        """Return where the axis would come to rest, in units, if this is beyond the limits; None otherwise."""
        demand_counts = self._demand_is_current(image) and not commanded.by_torque
        seldom = demand_counts and self._is_seldom(image)
        self._take_lag(image, seldom=seldom)
        lag = self._shown_lag if demand_counts else self._known_lag
        stop = self._beyond(image, self._position, commanded, ramp, 0.0 if commanded.by_torque else lag)
        if stop is None and demand_counts and not seldom:
            late = max(0.0, image.position_stamp - image.demand_stamp)
            stop = self._beyond(image, self._demand, commanded, ramp, late)
        return stop

    def _take_lag(self, image: AxisImage, *, seldom: bool) -> None:
        """Compute the lag from a rare demand (``seldom``) that has arrived in this cycle, and the present velocity of the axis."""
        if not seldom:
            self._shown_lag, self._shown_at = 0.0, -math.inf
            return
        if image.demand_stamp == self._shown_at:
            return
        self._shown_at = image.demand_stamp
        lead, (velocity, _) = image.lead or 0.0, self._position.motion
        ahead = math.copysign(lead, lead * velocity) - NOISE
        self._shown_lag = min(max(0.0, ahead) / abs(velocity), _LONGEST_LAG) if velocity else 0.0

    def _beyond(
        self,
        image: AxisImage,
        track: VelocityEstimator,
        commanded: CommandedMotion,
        ramp: float | None,
        late: float,
    ) -> float | None:
        """Return where a track would come to rest, in units, if this is beyond the limits; None otherwise.

        ``late``: seconds by which the axis lags behind this track, or by which the track is older than a position.
        """
        # For this time the velocity, and its rise, continue while one ramp replaces another.
        soft = 0.5 * commanded.soft + late
        growth = self._growth(image, track) + soft
        for direction in (1, -1):
            speed = _fastest(track, direction, commanded, growth)
            if speed <= 0:
                continue  # it moves in the other direction
            if self._may_be_noise(track, direction, commanded):
                stop_distance, window = 0.0, NOISE
            else:
                stop_distance, window = self._stop_distance(image, track, speed, soft, commanded, ramp), 0.0
            rest = self._outside(image, track.value + direction * stop_distance, direction, window)
            if rest is not None:
                return rest
        return None

    def _may_be_noise(self, track: VelocityEstimator, direction: int, commanded: CommandedMotion) -> bool:
        """Whether no command moves the axis in ``direction``, and it has moved there by no more than the noise of its position.

        The same if a command moves it in the other direction, and its newest positions are equal: it has just come to rest.
        """
        goal = 0.0 if commanded.speed is None else commanded.speed * direction
        if goal > 0:
            return False
        return _only_wanders(track, direction) or (goal < 0 and not track.motion[0])

    def _outside(
        self, image: AxisImage, position: float, direction: int, window: float = 0.0
    ) -> float | None:
        """Return ``position`` in units if it is beyond the limit in ``direction`` (1 or -1, of the increments) by ``window``."""
        if self._permitted_range is None:
            return None
        edge = self._permitted_range.high if direction > 0 else self._permitted_range.low
        where = position - image.origin
        return (
            self._parameters.units.position.to_units(where) if (where - edge) * direction > window else None
        )

    def _stop_distance(
        self,
        image: AxisImage,
        track: VelocityEstimator,
        speed: float,
        soft: float,
        commanded: CommandedMotion,
        ramp: float | None,
    ) -> float:
        """Return the increments to rest from ``speed``: the distance before a stop acts, plus its braking distance."""
        time = self._time(image, track.motion[0]) + soft
        stop_distance = speed * (time + max(_UNKNOWN_LAG, self._known_lag) if commanded.by_torque else time)
        return stop_distance + braking_distance(speed, ramp) if ramp else stop_distance

    def _growth(self, image: AxisImage, track: VelocityEstimator) -> float:
        """Return the seconds from the time of a track's velocity to the time at which a stop acts."""
        return self._time(image, track.motion[0]) + 1.5 * track.spacing

    def _time(self, image: AxisImage, velocity: float) -> float:
        """Return the seconds from the last position to the time at which a stop acts.

        The position of an axis at standstill may be old (a drive that sends on change). Such an axis cannot have moved before its
        free motion began.
        """
        age = image.now - image.position_stamp
        if not velocity and self._free_since is not None:
            age = min(age, image.now - self._free_since)
        return age + _REACTION * self._parameters.scan_period


def stop_of(parameters: AxisParameters, commanded: CommandedMotion) -> tuple[StopLevel, float | None]:
    """Return the stop level that brakes an axis in the ``commanded`` motion, and its deceleration (position increments/s²; None:
    unknown).

    A halt in profile torque mode only sets the torque to 0. So in this mode the quick stop brakes. If the quick stop does not
    brake, or would let a load fall, a halt brakes that changes to a braking mode (``stop_sequence``).
    """
    braking = parameters.braking
    slow = braking.capped_down(commanded.down or (None if commanded.unknown else parameters.slow_ramp))
    quick = StopLevel.QUICK_STOP, braking.deceleration(braking.quick_stop, slow)
    if commanded.by_target:
        harder = braking.quick_stop in BRAKES and (quick[1] or 0.0) > (slow or 0.0)
        return quick if harder else (StopLevel.HALT, slow)
    if commanded.by_core:
        return StopLevel.HALT, commanded.down
    if commanded.by_torque:
        return (StopLevel.HALT, slow) if parameters.halts_torque_by_mode else quick
    if braking.halt is Ramp.COAST and braking.quick_stop in BRAKES:
        return quick
    return StopLevel.HALT, braking.deceleration(braking.halt, slow)


def unknown_braking(parameters: AxisParameters, commanded: CommandedMotion) -> tuple[str, str]:
    """Return why the deceleration of a stop in the ``commanded`` motion is not known, and the remedy."""
    name, braking = parameters.name, parameters.braking
    if not parameters.units.ratio_known:
        return (
            "the units of its velocities and accelerations are unknown, and so is its braking distance",
            f"give velocity_scale (and acceleration_scale) in [axes.{name}] of cell.toml, which axisbus check explains; or move to "
            "positions",
        )
    by_quick_stop = commanded.by_torque and not parameters.halts_torque_by_mode
    ramp, code = (braking.quick_stop, "605Ah") if by_quick_stop else (braking.halt, "605Dh")
    if ramp is Ramp.COAST:
        key = "quick_stop" if by_quick_stop else "halt"
        return (
            f"its {key.replace('_', ' ')} lets the motor coast ({code} is 0)",
            f'set {key} = "ramp" or another word that brakes in [axes.{name}.stop]',
        )
    if ramp is Ramp.QUICK:
        return (
            f"{code} brakes on the quick-stop ramp, and the drive has none (6085h is missing or 0)",
            f"set deceleration in [axes.{name}.stop], or a word other than ramp",
        )
    fixed = dict(parameters.fixed_ramps)
    if objects.PROFILE_DECELERATION in fixed or commanded.unknown:
        return (
            "the drive does not accept a deceleration (6084h), and reports no deceleration of its own",
            f"see the drive's manual for its deceleration; without position_limits in [axes.{name}] it may turn freely",
        )
    return (
        "no deceleration is given",
        f"set deceleration in [axes.{name}.defaults] of cell.toml",
    )


def _only_wanders(track: VelocityEstimator, direction: int) -> bool:
    """Whether a track has moved in ``direction`` by no more than encoder noise."""
    return track.change * direction <= NOISE


def _fastest(track: VelocityEstimator, direction: int, commanded: CommandedMotion, time: float) -> float:
    """Return the highest speed of a track in ``direction`` after ``time``: by its command, else by the measured acceleration."""
    out = track.toward(direction)
    if commanded.speed is None or commanded.up is None:
        return out + max(0.0, track.motion[1] * direction) * time
    goal = commanded.speed * direction
    if goal <= out:
        return out
    if out < 0.0:  # it turns first, by the higher of both rates: the drive may use either
        turning = max(commanded.up, commanded.down or 0.0)
        if out + turning * time <= 0.0:
            return out + turning * time
        out, time = 0.0, time + out / turning
    return min(goal, out + commanded.up * time)
