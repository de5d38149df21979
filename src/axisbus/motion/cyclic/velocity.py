"""A constant velocity in cyclic synchronous velocity mode: the master computes the ramp, and sends one velocity per cycle."""

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
from axisbus.motion.moves.prepare import slow_ramp_writes
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.override import scaled
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.velocity_following import master_ramp_tracker
from axisbus.motion.stop_deceleration import CommandedMotion

_FILTER = 0.2  # weight of a new sample in the mean of a noisy velocity
_MARGIN = 2.0  # seconds that the axis may be late, in addition to four times its ramp


class CyclicVelocityMove(Activity):
    """An axis at a commanded velocity in csv. The command is done at that velocity, and the motion continues; it can be changed.

    In csv the drive has no bit for *target reached* (bit 10 has another meaning), so only the measured velocity counts.
    """

    mode = ModeOfOperation.CYCLIC_SYNC_VELOCITY
    ramp = VelocityRamp
    keeps_moving = True

    def __init__(
        self,
        command: CyclicVelocity,
        parameters: AxisParameters,
        gate: StartBarrier,
        before: VelocityRamp | None = None,
    ) -> None:
        """``before``: the ramp that commands the axis in csv already; None: the axis is at standstill and changes to csv first."""
        self._parameters = parameters
        writes = slow_ramp_writes(parameters)
        self._mode_entry = None if before is not None else ModeEntry(self.mode, parameters, gate, writes)
        self._ramp = before
        self._ramp_tracker = master_ramp_tracker(parameters)
        self._mean: float | None = None
        self._factor = 1.0  # the override of the requested velocity
        self.aim(command)

    def aim(self, command: CyclicVelocity) -> None:
        """Change to another velocity, starting from the one sent last."""
        self._command = command
        self._aim()

    def _aim(self) -> None:
        """Change to the requested velocity under the override, and restart the check that the axis reaches it."""
        command, scale = self._command, self._parameters.units.per_velocity
        up, down = abs(command.acceleration * scale), abs(command.deceleration * scale)
        self._target = scaled(command.velocity, self._factor, self._parameters)
        self.commanded = CommandedMotion(self._target * scale, up, down, by_core=True)
        self._deadline: float | None = None
        self.reached = False
        if self._ramp is not None:
            self._ramp.aim(self._target, command.acceleration, command.deceleration)

    @property
    def set_point_source(self) -> VelocityRamp | None:
        """The ramp that commands the axis; None before it has begun."""
        return self._ramp

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the velocity is reached, unless an override of 0 holds it; keeps the velocity if called afterwards."""
        self.override(image)
        if self._mode_entry is not None and not self._mode_entry.step(image, order):
            return False
        ramp = self._active_ramp()
        # Before the ramp advances: if this raises, the axis brakes in this cycle, from the previous velocity.
        self._watch(image, ramp)
        ramp.step(image, order)
        self._follow(image, ramp)
        return self.reached and self._factor > 0.0

    def override(self, image: AxisImage) -> None:
        """Apply a changed override from the next step on."""
        if image.override != self._factor:
            self._factor = image.override
            self._aim()

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake of the change of mode."""
        return None if self._mode_entry is None else self._mode_entry.in_flight

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel queued transfers."""
        if self._mode_entry is not None:
            self._mode_entry.cancel(order)

    def _active_ramp(self) -> VelocityRamp:
        self._mode_entry = None
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
        self._check_resistance(image)

    def _check_resistance(self, image: AxisImage) -> None:
        resisted = is_resisted(image, self._target)
        self.resisted_since = min(self.resisted_since, image.now) if resisted else math.inf

    def _follow(self, image: AxisImage, ramp: VelocityRamp) -> None:
        """Compare the actual motion with the commanded velocities, to supervise the following error."""
        if self._ramp_tracker is not None:
            self._ramp_tracker.aim(ramp.velocity)
            self._ramp_tracker.step(image)
            self.behind, self.commanded_speed = self._ramp_tracker.behind, abs(self._ramp_tracker.speed)
            self.lag = self._ramp_tracker.lag

    def _in_velocity(self, image: AxisImage) -> bool:
        """Return whether the measured velocity, or its mean if it is noisy, is in tolerance, and more than half of the target."""
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
        """Return the deadline in s: four times the ramp from ``velocity``, if necessary through 0, to the target, plus a margin."""
        command = self._command
        ramp = min(command.acceleration, command.deceleration)
        return 4.0 * (abs(velocity) + abs(self._target)) / ramp + _MARGIN
