"""Moves without an end of their own: at a velocity (pv), with a torque (tq)."""

from __future__ import annotations

import math

from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import MotionTimeout, Stopped
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.commands import MoveVelocity
from axisbus.motion.moves.activity import Activity, SetPointSource, present_speed
from axisbus.motion.moves.mode_switch import ModeSwitch
from axisbus.motion.moves.prepare import Prepare, Prepared, RampTransfers, require_ramps
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.override import scaled
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.velocity_following import VelocityRampTracker, drive_ramp_tracker
from axisbus.motion.stop_deceleration import CommandedMotion

VELOCITY_FLOOR = 2  # velocity increments
VELOCITY_SHARE = 0.05  # of the commanded velocity
TORQUE_FLOOR = 10  # per mille of rated torque
TORQUE_SHARE = 0.05  # of the commanded torque
_UNKNOWN_SLOPE = 10.0  # seconds


class VelocityMove(Prepared):
    """A move at constant velocity in profile velocity mode; ends well when the velocity is reached, and continues to move."""

    mode = ModeOfOperation.PROFILE_VELOCITY
    keeps_moving = True
    in_effect = False

    def __init__(
        self,
        profile: MoveProfile,
        parameters: AxisParameters,
        prepare: Prepare,
        before: CommandedMotion | None = None,
        ramp_tracker: VelocityRampTracker | None = None,
    ) -> None:
        """``profile.velocity`` is signed here: the direction. ``before``: the motion commanded until now.

        ``ramp_tracker``: the ramp of the previous velocity command, if the drive is on one.
        """
        self._soft = profile.soft_seconds(abs(parameters.units.position.factor))
        self.commanded = _commanded_motion(profile, self._soft, before)
        self._fastest = 0.0  # position increments per s, since the velocity was commanded
        self._profile = profile
        self._parameters = parameters
        self._prepare = prepare
        self._deadline: float | None = None
        self._commanded_at: float | None = None
        self._begun = False
        self.ramp_tracker = ramp_tracker
        if ramp_tracker is not None and profile.up and profile.down:
            ramp_tracker.expect(profile.up, profile.down)
        self._factor = 1.0  # the override of the commanded velocity
        self._target = profile.velocity  # with the override
        self.reached = False

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once the velocity is reached, unless an override of 0 holds the axis. Must be stepped further to keep it."""
        if not self._begun and self.ramp_tracker is not None:
            self.ramp_tracker.step(image)
        if not self._prepare.step(image, order):
            return False
        if not self._begun:
            self._begin()
        self.override(image)
        if self.ramp_tracker is not None:
            self.ramp_tracker.step(image)
            self.commanded_speed = abs(self.ramp_tracker.speed)
            self.behind = self._behind(self.ramp_tracker.behind)
            self.lag = self._lag(self.ramp_tracker.lag)
        order.target_velocity = self._target
        order.halt = False
        if self._commanded_at is None:
            self.commanded, speed = (
                _commanded_motion(self._overridden, self._soft),
                present_speed(image, self._parameters),
            )
            self._commanded_at = image.now
            self.in_effect = True
            self._deadline = image.now + self._allowed(speed)
            self._fastest = max(speed, abs(self.commanded.speed or 0.0))
        if not self.reached:
            self.reached = self._in_velocity(image)
            self._watch(image)
        resisted = is_resisted(image, self._target)
        self.resisted_since = min(self.resisted_since, image.now) if resisted else math.inf
        return self.reached and self._factor > 0.0

    def _begin(self) -> None:
        """Compute from now on with the ramps that the drive has."""
        self._begun = True
        self._profile = require_ramps(self._prepare.ramps.applied(self._profile), self._parameters)
        self.ramp_tracker = drive_ramp_tracker(self._profile, self._parameters, self.ramp_tracker)

    def _behind(self, distance: float | None) -> float | None:
        """Return the distance behind the ramp, without the share of a jerk limit: drives differ in how they apply it."""
        if distance is None or not self._soft:
            return distance
        return math.copysign(max(0.0, abs(distance) - self._fastest * self._soft), distance)

    def _lag(self, lag: float | None) -> float | None:
        """Return the lag without the delay of the jerk limit (half of its time), which the look-ahead adds separately."""
        return lag if lag is None else max(0.0, lag - 0.5 * self._soft)

    def override(self, image: AxisImage) -> None:
        """Command the velocity under a new override from the next step on, and restart the check that the axis reaches it."""
        factor = image.override
        if not self._begun or factor == self._factor:
            return
        self._factor = factor
        self._target = scaled(self._profile.velocity, factor, self._parameters)
        if self.ramp_tracker is not None:
            self.ramp_tracker.aim(self._target)
        self._commanded_at, self.reached = None, False
        self.commanded = _commanded_motion(self._overridden, self._soft)

    @property
    def _overridden(self) -> MoveProfile:
        profile, asked = self._profile, self._profile.velocity
        share = self._target / asked if asked else 1.0
        return profile._replace(
            velocity=self._target, speed=None if profile.speed is None else profile.speed * share
        )

    def _in_velocity(self, image: AxisImage) -> bool:
        """Whether the measured velocity has reached the target; if it is noisy, or not received, bit 10 of the drive counts.

        More than half of the velocity must be measured in any case: in coarse units (rpm) an axis at standstill may be two
        increments off, and a drive with a wide window (606Dh) reports *reached* for a blocked axis.
        """
        target, velocity = self._target, image.velocity
        if velocity is None:
            return self._says_reached(image)
        off = abs(velocity - target)
        if not target:
            return off <= VELOCITY_FLOOR or image.standstill
        close = max(VELOCITY_FLOOR, abs(target) * VELOCITY_SHARE)
        return off < abs(target) / 2 and (off <= close or self._says_reached(image))

    def _says_reached(self, image: AxisImage) -> bool:
        return _says_reached(image, self._commanded_at, self._parameters)

    def _allowed(self, speed: float) -> float:
        """Return four times the ramp from ``speed`` (of either direction) through zero to the new one, plus a margin."""
        profile = self._profile
        if profile.timeout is not None:
            return profile.timeout
        if profile.speed is not None and profile.ramp:
            return 4.0 * (speed + profile.speed) / profile.ramp + 2.0 * self._soft + 2.0
        return 10.0

    def _watch(self, image: AxisImage) -> None:
        assert self._deadline is not None
        if self.reached or image.now <= self._deadline:
            return
        raise velocity_missed(image, self._parameters, self._target)


class TorqueMove(Prepared):
    """A torque in profile torque mode; ends well when it is measured (or, without 6077h, reported) as reached, and keeps it."""

    mode = ModeOfOperation.PROFILE_TORQUE
    keeps_moving = True

    def __init__(
        self,
        torque: int,
        timeout: float | None,
        parameters: AxisParameters,
        prepare: Prepare,
        slope: int | None = None,
    ) -> None:
        """``torque`` in 0.1 % of rated torque; ``slope`` in the same per second, None if it is unknown."""
        self._torque = torque
        self._slope = slope
        self._timeout = timeout
        self._parameters = parameters
        self._prepare = prepare
        self._commanded_at: float | None = None
        self.reached = False
        self._leave_path()

    def _leave_path(self) -> None:
        """Note that the torque moves the axis, once it leaves a path of the master: until then a halt brakes it along this path."""
        if self.commanded is None and (self.set_point_source is None or self.pending_mode_switch is not None):
            self.commanded = CommandedMotion(by_torque=True)

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once the torque is reached. Must be stepped further to keep it."""
        ready = self._prepare.step(image, order)
        self._leave_path()
        if not ready:
            return False
        order.target_torque = self._torque
        order.halt = False
        if self._commanded_at is None:
            self._commanded_at = image.now
            self.commanded = motion_by_torque(self._prepare.ramps)
            self._timeout = self._timeout or self._allowed(image.torque or 0)
        if not self.reached:
            self.reached = self._in_torque(image)
            self._watch(image)
        return self.reached

    @property
    def torque(self) -> int:
        """See ``Activity``."""
        return self._torque

    def _allowed(self, torque: int) -> float:
        """Return four times the slope from the present ``torque`` to the new one, plus a margin."""
        return 4.0 * (abs(torque) + abs(self._torque)) / self._slope + 2.0 if self._slope else _UNKNOWN_SLOPE

    def _in_torque(self, image: AxisImage) -> bool:
        """Whether the measured torque is close to its target. A small torque is lost in noise, so bit 10 of the drive counts."""
        assert self._commanded_at is not None
        says = _says_reached(image, self._commanded_at, self._parameters)
        if image.torque is None:
            return says
        if image.now < self._commanded_at + self._parameters.timing.settle:
            return False
        off, target = abs(image.torque - self._torque), abs(self._torque)
        close = off <= max(TORQUE_FLOOR, target * TORQUE_SHARE)
        return close and (says or off < target / 2 or not target)

    def _watch(self, image: AxisImage) -> None:
        assert self._commanded_at is not None
        if self.reached or self._timeout is None or image.now <= self._commanded_at + self._timeout:
            return
        by_slope = (
            "check max torque (6072h) and torque slope (6087h) of the drive: with a slope of 0 some drives never reach the "
            f"torque; torque_slope in [axes.{self._parameters.name}.defaults] sets it"
        )
        raise torque_missed(image, self._parameters, self._torque, by_slope)


def motion_by_torque(ramps: RampTransfers) -> CommandedMotion:
    """Return the commanded motion of an axis under torque, with its drive's deceleration (6084h) if that was written."""
    down = ramps.parameters.acceleration_increments(ramps.deceleration)
    return CommandedMotion(by_torque=True, down=down, unknown=ramps.was_asked and down is None)


def is_resisted(image: AxisImage, velocity: int) -> bool:
    """Whether an axis that must turn with ``velocity`` (increments) is at standstill, and no value shows its drive's set-point."""
    if image.pull is not None or abs(velocity) <= VELOCITY_FLOOR:
        return False
    if image.position is not None:
        return image.standstill
    return image.velocity is not None and abs(image.velocity) <= VELOCITY_FLOOR


def velocity_missed(image: AxisImage, parameters: AxisParameters, target: int) -> MotionTimeout:
    """Return the error of a velocity (increments) that the axis has not reached in time."""
    name, velocity = parameters.name, parameters.units.velocity
    shown = "unknown" if image.velocity is None else f"{velocity.to_units(image.velocity):g} {velocity.unit}"
    return MotionTimeout(
        f"{name}: the axis has not reached {velocity.to_units(target):g} {velocity.unit}",
        axis=name,
        observed=f"velocity {shown}, statusword 0x{image.statusword or 0:04X}",
        remedy="check whether the axis is blocked and whether the drive limits velocity or torque (607Fh, 6080h, 6072h)",
    )


def torque_missed(
    image: AxisImage,
    parameters: AxisParameters,
    target: int,
    remedy: str = "check max torque (6072h) of the drive, and its limits (60E0h, 60E1h)",
) -> MotionTimeout:
    """Return the error of a torque (0.1 % of rated torque) that the drive has not shown in time."""
    shown = "unknown" if image.torque is None else f"{image.torque / 10:g} % of rated torque"
    return MotionTimeout(
        f"{parameters.name}: the axis has not reached {target / 10:g} % of rated torque",
        axis=parameters.name,
        observed=f"torque {shown}, statusword 0x{image.statusword or 0:04X}",
        remedy=remedy,
    )


def _commanded_motion(
    profile: MoveProfile, soft: float, before: CommandedMotion | None = None
) -> CommandedMotion:
    """Return the commanded motion of a velocity move.

    Until its ramp is written, the weaker ramp of this move and of the motion ``before`` counts. ``soft``: seconds by which a jerk
    limit may prolong its ramps.
    """
    speed = None if profile.speed is None else math.copysign(profile.speed, profile.velocity)
    ramps = [ramp for ramp in (profile.down, None if before is None else before.down) if ramp is not None]
    unknown = profile.down is None
    return CommandedMotion(speed, profile.up, None if unknown else min(ramps), soft=soft, unknown=unknown)


def _says_reached(image: AxisImage, commanded_at: float | None, parameters: AxisParameters) -> bool:
    """Return bit 10 of a word received well after the new target was sent; earlier words refer to the previous target."""
    if image.statusword is None or commanded_at is None:
        return False
    return image.statusword_stamp >= commanded_at + parameters.timing.settle and bool(
        image.statusword & sw.TARGET_REACHED
    )


# -- Jogging: a velocity move that ends automatically unless it is renewed (like a dead man's handle) ------------------


class Jog(Activity):
    """A velocity move with a lifetime; holds the time of its end.

    At a position limit it ends in a halt, and the axis may be jogged back.
    """

    mode = ModeOfOperation.PROFILE_VELOCITY
    keeps_moving = True
    stops_at_limit = True
    in_effect = False

    def __init__(self, move: VelocityMove, command: MoveVelocity, image: AxisImage) -> None:
        self.commanded, self.ramp_tracker = move.commanded, move.ramp_tracker
        self._move = move
        self._profile = command.profile
        self._until = image.now + (command.life or 0.0)
        self.expired = False

    def renew(self, command: MoveVelocity, image: AxisImage) -> bool:
        """Extend the lifetime, if ``command`` requests the same motion; return whether it does."""
        if command.profile != self._profile or self.expired or command.life is None:
            return False
        self._until = image.now + command.life
        return True

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once the velocity is reached.

        Raises:
            Stopped: the lifetime has ended; the core halts the axis.
        """
        if image.now > self._until:
            self.expired = True
            raise Stopped("jog was not renewed")
        reached = self._move.step(image, order)
        move = self._move
        self.commanded, self.ramp_tracker = move.commanded, move.ramp_tracker
        self.behind, self.commanded_speed, self.resisted_since = (
            move.behind,
            move.commanded_speed,
            move.resisted_since,
        )
        self.lag, self.in_effect = move.lag, move.in_effect
        return reached

    def override(self, image: AxisImage) -> None:
        """See ``VelocityMove.override``."""
        self._move.override(image)
        self.commanded = self._move.commanded

    @property
    def set_point_source(self) -> SetPointSource | None:
        """The previous trajectory, until the drive is in the mode of this command."""
        return self._move.set_point_source

    @property
    def pending_mode_switch(self) -> ModeSwitch | None:
        """The change of mode that ends that trajectory, once it has been requested."""
        return self._move.pending_mode_switch

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake of the change of mode."""
        return self._move.in_flight

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued requests."""
        self._move.cancel(order)
