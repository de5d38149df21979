"""Give the set-point again while its drive moves to it: with another profile velocity (6081h), or after a hold.

Theory of operation
-------------------
An override changes the profile velocity of a move that the drive plans. A drive takes 6081h with a set-point (CiA 402-2 10.3), so
the master writes the velocity, and then gives the same target again with bit 5 (change set immediately). At an override of 0 the
halt bit holds the axis, and the drive keeps its target. To continue, the master gives the target before it ends the halt, as in any
other move out of a halt. There is one handshake at a time: a change during a handshake waits for its end.

A drive may take the set-point but keep its old velocity. The positions show this. The check begins twice the ramp time plus half a
second after the drive took the set-point. The move fails if the axis then moves steadily towards its target, and its speed is
nearer to the old velocity than to the commanded one. An axis that still accelerates, or has to reverse first, does not show its
final velocity yet.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.cia402 import objects
from axisbus.cia402 import statusword as sw
from axisbus.cia402.options import Ramp
from axisbus.errors import DriveError, StateError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.prepare import RampTransfers, expected
from axisbus.motion.moves.profile import MoveProfile, braking_distance
from axisbus.motion.override import scaled
from axisbus.motion.parameters import AxisParameters

_SETTLING_TIME = 0.5  # seconds in addition to twice the ramp
_MEASURING_TIME = 0.2  # seconds over which the speed is measured
_CHANGE = 0.1  # of a speed: smaller changes are not checked
# of the change that the ramp makes in _MEASURING_TIME: a smaller change counts as a constant speed
_STEADY = 0.25


def overridden(profile: MoveProfile, factor: float, parameters: AxisParameters) -> MoveProfile:
    """Return the profile of a move under an override; an override of 0 leaves it unchanged, because the halt bit holds the axis."""
    if factor in (0.0, 1.0):
        return profile
    velocity = scaled(profile.velocity, factor, parameters)
    speed = None if profile.speed is None else profile.speed * velocity / profile.velocity
    return profile._replace(velocity=velocity, speed=speed)


def driven(profile: MoveProfile, parameters: AxisParameters) -> float | None:
    """Return the speed that 6081h represents (position increments/s): on a coarse scale it may be far below the command."""
    if profile.speed is None:
        return None
    units = parameters.units
    return abs(units.velocity.to_units(profile.velocity) * units.position.factor)


class SetPointUpdate:
    """Holds the override that the drive has now, and the running write of another one."""

    __slots__ = ("_factor", "_parameters", "_profile", "_sent", "_write", "held", "is_requested", "ramps")

    def __init__(self, profile: MoveProfile, factor: float, parameters: AxisParameters) -> None:
        """``profile``: as commanded, without override; its set-point is prepared for the override ``factor``."""
        self._profile = self._sent = profile
        self.is_requested = False  # another profile, or target, which has not been given yet
        self._factor = factor or 1.0
        self._parameters = parameters
        self._write: tuple[float, RampTransfers] | None = None
        self.held = False
        # The last ones written here, with the values that the drive has.
        self.ramps: RampTransfers | None = None

    @property
    def profile(self) -> MoveProfile:
        """The profile that the drive has."""
        return overridden(self._profile, self._factor, self._parameters)

    @property
    def requested(self) -> MoveProfile:
        """The commanded profile, without the override."""
        return self._profile

    def request(self, profile: MoveProfile) -> None:
        """Request to give the set-point again, with another profile, or with the same profile for another target."""
        self._profile, self.is_requested = expected(profile, self._parameters), True

    def step(self, image: AxisImage, order: CycleOutputs) -> bool | None:
        """Return True in the cycle from which the set-point must be given again, None if the move continues, False if it waits.

        Raises:
            DriveError: the drive does not accept the velocity.
            StateError: its halt would let the motor coast.
        """
        wanted = image.override
        if self._write is None:
            if not wanted:
                return self._hold(order)
            if wanted == self._factor and not self.held and not self.is_requested:
                return None
            self._write = wanted, RampTransfers(self._writes(wanted), self._parameters, self.ramps)
        factor, transfers = self._write
        if not transfers.step(image, order):
            return False
        self._write, self._factor, self.held, self.ramps = None, factor, False, transfers
        return True

    def _writes(self, factor: float) -> list[tuple[int, int, int | None]]:
        """Return the required writes under an override: the velocity, and those ramps that have changed."""
        given, profile, self._sent, self.is_requested = self._sent, self._profile, self._profile, False
        ramps = [
            (objects.PROFILE_ACCELERATION, given.acceleration, profile.acceleration),
            (objects.PROFILE_DECELERATION, given.deceleration, profile.deceleration),
        ]
        changed = [(index, 0, new) for index, old, new in ramps if new != old and self._parameters.has(index)]
        velocity = overridden(profile, factor, self._parameters).velocity
        return [(objects.PROFILE_VELOCITY, 0, velocity), *changed]

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued transfers."""
        if self._write is not None:
            self._write[1].cancel(order)

    def _hold(self, order: CycleOutputs) -> bool:
        if self._parameters.braking.halt is Ramp.COAST:
            name = self._parameters.name
            raise StateError(
                f"{name}: an override of 0 cannot hold a move with a profile of the drive",
                observed="its halt (605Dh is 0) lets the motor coast",
                remedy=f'set halt = "slow-ramp" in [axes.{name}.stop]',
            )
        order.halt = self.held = True
        return False


class _Mark(NamedTuple):
    """A position of the axis (increments), and its time (s)."""

    time: float
    position: int


class VelocityChangeCheck:
    """Checks whether an axis changes to another speed; holds its position at the start, and the previous measured speed."""

    __slots__ = ("_after", "_before", "_from", "_last", "_parameters", "_profile", "_target")

    def __init__(
        self, before: MoveProfile, profile: MoveProfile, target: int, parameters: AxisParameters, now: float
    ) -> None:
        """``before``: the profile that the drive had for this move; ``profile``: the one that it was given at ``now``."""
        self._before = driven(before, parameters)
        self._profile = profile = profile._replace(speed=driven(profile, parameters))
        self._target = target
        self._parameters = parameters
        self._from: _Mark | None = None
        self._last: float | None = None
        self._after = math.inf
        had = self._before
        if had and profile.speed and profile.ramp and abs(had - profile.speed) > _CHANGE * had:
            self._after = now + 2.0 * abs(had - profile.speed) / profile.ramp + _SETTLING_TIME
            self._after += 2.0 * profile.soft_seconds(abs(parameters.units.position.factor))

    def look(self, image: AxisImage) -> None:
        """Evaluate this cycle's position.

        Raises:
            DriveError: the axis continues at its old speed.
        """
        if image.now < self._after or image.position is None:
            return
        if self._from is None:
            self._from = _Mark(image.position_stamp, image.position)
            return
        seconds = image.position_stamp - self._from.time
        if seconds < _MEASURING_TIME:
            return
        towards = math.copysign(1.0, self._target - image.position)
        speed, last = towards * (image.position - self._from.position) / seconds, self._last
        self._from, self._last = _Mark(image.position_stamp, image.position), speed
        cruises = self._cruises(image.position)
        if last is None or (cruises and self._changes(speed, last)):
            return
        self._after = math.inf
        if cruises and self._keeps_old_speed(speed) and not self._is_limited(image):
            raise self._error(speed)

    def _changes(self, speed: float, last: float) -> bool:
        """Whether the speed still changes."""
        assert self._profile.ramp
        return abs(speed - last) > _STEADY * self._profile.ramp * _MEASURING_TIME

    def _cruises(self, position: int) -> bool:
        """Whether the axis is still too far from its target to brake for it."""
        before, requested, ramp = self._before, self._profile.speed, self._profile.ramp
        assert before
        assert requested
        assert ramp
        fastest = max(before, requested)
        return (
            abs(self._target - position) > 1.2 * braking_distance(fastest, ramp) + _MEASURING_TIME * fastest
        )

    def _keeps_old_speed(self, speed: float) -> bool:
        assert self._before
        assert self._profile.speed
        return abs(speed - self._before) < min(
            abs(speed - self._profile.speed), abs(self._profile.speed - self._before)
        )

    @staticmethod
    def _is_limited(image: AxisImage) -> bool:
        """Whether the drive reports that one of its own limits holds it back."""
        return image.statusword is not None and bool(image.statusword & sw.INTERNAL_LIMIT)

    def _error(self, speed: float) -> DriveError:
        name, units = self._parameters.name, self._parameters.units.position
        per = abs(units.factor)
        assert self._profile.speed
        return DriveError(
            f"{name}: its drive does not accept another velocity during a move",
            axis=name,
            observed=f"6081h was written and the set-point sent again for {self._profile.speed / per:g} {units.unit}/s; the "
            f"axis still moves at {speed / per:g}",
            remedy="set the override before the move begins, or move the axis in csp: as a group of one, on a line",
        )
