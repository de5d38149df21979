"""A constant velocity in cyclic synchronous velocity mode: the ramp is made here, and the drive gets one velocity per cycle."""

from __future__ import annotations

import math

from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.commands import CyclicVelocity
from axisbus.motion.cyclic.mode_entry import ModeEntry
from axisbus.motion.cyclic.ramps import VelocityRamp
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.activity import Activity
from axisbus.motion.moves.continuous_motion import (
    VELOCITY_FLOOR,
    VELOCITY_SHARE,
    is_resisted,
    velocity_missed,
)
from axisbus.motion.override.factor import scaled
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.velocity_following import led_way
from axisbus.motion.stop_deceleration import CommandedMotion

_FILTER = 0.2  # share of a new sample in the mean of a noisy velocity
_MARGIN = 2.0  # seconds that the axis may be late, beside four times its ramp


class CyclicVelocityMove(Activity):
    """An axis that is led at a velocity; ends well when it is reached, and goes on. Another one may be given to it meanwhile.

    In csv the drive has no word for *reached* (bit 10 is none of it): only what is measured counts.
    """

    mode = ModeOfOperation.CYCLIC_SYNC_VELOCITY
    ramp = VelocityRamp
    goes_on = True

    def __init__(
        self,
        command: CyclicVelocity,
        parameters: AxisParameters,
        gate: StartBarrier,
        before: VelocityRamp | None = None,
    ) -> None:
        """``before``: what leads the axis in csv already; else it stands, and the mode comes first."""
        self._parameters = parameters
        self._ready = None if before is not None else ModeEntry(self.mode, parameters, gate)
        self._ramp = before
        self._way = led_way(parameters)
        self._mean: float | None = None
        self._factor = 1.0  # the override of the velocity that is asked for
        self.aim(command)

    def aim(self, command: CyclicVelocity) -> None:
        """Go on to another velocity, from the one that was sent last."""
        self._command = command
        self._aim()

    def _aim(self) -> None:
        """Go to the velocity that was asked for, under the override, and look anew whether the axis comes to it."""
        command, scale = self._command, self._parameters.units.per_velocity
        up, down = abs(command.acceleration * scale), abs(command.deceleration * scale)
        self._target = scaled(command.velocity, self._factor, self._parameters)
        self.course = CommandedMotion(self._target * scale, up, down, by_core=True)
        self._deadline: float | None = None
        self.reached = False
        if self._ramp is not None:
            self._ramp.aim(self._target, command.acceleration, command.deceleration)

    @property
    def leading(self) -> VelocityRamp | None:
        """The ramp on which it is led, once it is."""
        return self._ramp

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once the velocity is reached, and not while an override holds it; to be stepped on afterwards, to keep it."""
        self.override(image)
        if self._ready is not None and not self._ready.step(image, order):
            return False
        ramp = self._begun()
        self._watch(image, ramp)  # what fails is braked in this cycle, from the velocity before
        ramp.step(image, order)
        self._follow(image, ramp)
        return self.reached and self._factor > 0.0

    def override(self, image: AxisImage) -> None:
        """Go to the velocity under another override from the next step on."""
        if image.override != self._factor:
            self._factor = image.override
            self._aim()

    def cancel(self, order: CycleOutputs) -> None:
        """Take back what is queued."""
        if self._ready is not None:
            self._ready.cancel(order)

    def _begun(self) -> VelocityRamp:
        self._ready = None
        if self._ramp is None:
            command = self._command
            self._ramp = VelocityRamp(
                0.0, command.acceleration, command.deceleration, self._parameters.scan_period
            )
            self._ramp.aim(self._target, command.acceleration, command.deceleration)
        return self._ramp

    def _watch(self, image: AxisImage, ramp: VelocityRamp) -> None:
        if self._deadline is None:
            self._deadline = image.now + self._allowed(ramp.velocity)
        if not self.reached:
            self.reached = ramp.at_target and self._in_velocity(image)
            if not self.reached and image.now > self._deadline:
                raise velocity_missed(image, self._parameters, self._target)
        self._look_for_a_jam(image)

    def _look_for_a_jam(self, image: AxisImage) -> None:
        resisted = is_resisted(image, self._target)
        self.resisted_since = min(self.resisted_since, image.now) if resisted else math.inf

    def _follow(self, image: AxisImage, ramp: VelocityRamp) -> None:
        """Hold the way that was made against that of the velocities that were sent."""
        if self._way is not None:
            self._way.aim(ramp.velocity)
            self._way.step(image)
            self.behind, self.led_speed = self._way.behind, abs(self._way.speed)
            self.lag = self._way.lag

    def _in_velocity(self, image: AxisImage) -> bool:
        """The measured velocity, or its mean where it is noisy; more than half of what was asked for must be there in any case."""
        target, velocity = self._target, image.velocity
        if velocity is None:
            return False
        if not target:
            return abs(velocity) <= VELOCITY_FLOOR or image.standstill
        before = float(velocity) if self._mean is None else self._mean
        self._mean = mean = before + _FILTER * (velocity - before)
        off = min(abs(velocity - target), abs(mean - target))
        return off < abs(target) / 2 and off <= max(VELOCITY_FLOOR, abs(target) * VELOCITY_SHARE)

    def _allowed(self, velocity: float) -> float:
        """Four times the ramp from ``velocity`` (perhaps the other way) through 0 to the new one, and a margin."""
        command = self._command
        ramp = min(command.acceleration, command.deceleration)
        return 4.0 * (abs(velocity) + abs(self._target)) / ramp + _MARGIN
