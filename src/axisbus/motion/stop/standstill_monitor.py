"""Monitor an axis at rest: without a command an enabled axis must keep its position, and nothing may pull it.

If the drive reports no position, its velocity is monitored: the approximate distance that it adds up to within the last ``_MEMORY``
s. So a small velocity offset does not accumulate.
"""

from __future__ import annotations

import math

from axisbus.cia402 import modes
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import PowerState
from axisbus.errors import UncommandedMotion
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.parameters import AxisParameters

_TWICE = 2  # consecutive samples
_MEMORY = 0.5  # seconds


class StandstillMonitor:
    """Monitors an enabled axis at rest; holds the position at which its rest began in ``rest_position`` (None: it has not)."""

    __slots__ = (
        "_allowed",
        "_distance",
        "_misses",
        "_parameters",
        "_per_velocity",
        "_pulled_at",
        "_since",
        "_stamp",
        "_why",
        "rest_position",
    )

    def __init__(
        self, parameters: AxisParameters, why: str = "no command runs", allowed: float | None = None
    ) -> None:
        """``why``: why the axis must be at rest, for the error. ``allowed``: increments; by default those of the axis's own lag."""
        self._parameters = parameters
        self._why = why
        self._allowed = parameters.lag_allowed(0.0, by_position=False) if allowed is None else allowed
        self.rest_position: int | None = None
        self._stamp = 0.0
        self._since = 0.0  # the time of the first position of this rest
        self._pulled_at = 0.0  # the time of the last value that showed a pull
        self._misses = 0
        units = parameters.units
        self._per_velocity = units.position.factor / units.velocity.factor if units.ratio_known else None
        self._distance = 0.0  # distance by velocity

    def forget(self) -> None:
        """End the monitoring of this rest: a command moves the axis, or its power is off. The next rest starts again."""
        self.rest_position = None
        self._misses = 0
        self._distance = 0.0

    def error(self, image: AxisImage) -> UncommandedMotion | None:
        """Return the error if the axis moves without a command, or is being pulled; None while it rests."""
        position = image.position
        if position is None:
            return self._turns(image)
        if image.position_stamp == self._stamp:
            return None
        self._stamp = image.position_stamp
        if self.rest_position is None:
            self.rest_position, self._since = position, self._stamp
        allowed = self._allowed
        moved = abs(position - self.rest_position) > allowed
        pull, stamp = self._pull(image)
        if not moved and abs(pull) <= allowed:
            self._misses = 0
            return None
        if not moved and stamp == self._pulled_at:
            return None  # the same demand as before
        self._pulled_at = stamp
        self._misses += 1
        if self._misses < _TWICE:
            return None
        return (
            self._moves(image, position, self.rest_position) if moved else self._pulled(image, position, pull)
        )

    def _pull(self, image: AxisImage) -> tuple[float, float]:
        """Return how far the axis is pulled, and the time of the sample; 0 if the sample is older than this rest."""
        pull = image.pull or 0.0
        if image.reference_tracker.target is not None and image.state is not PowerState.QUICK_STOP_ACTIVE:
            return pull, self._stamp
        return (pull if image.lead_stamp >= self._since else 0.0), image.lead_stamp

    def _turns(self, image: AxisImage) -> UncommandedMotion | None:
        """Return the error that the velocity shows, for an axis with unknown position."""
        gap = image.velocity_stamp - self._stamp
        if image.velocity is None or self._per_velocity is None or not gap:
            return None
        self._stamp = image.velocity_stamp
        speed = image.velocity * self._per_velocity
        # Motion longer than _MEMORY ago does not count, nor does a gap during which the velocity is unknown.
        self._distance = (
            self._distance + speed * gap - self._distance * gap / _MEMORY if gap < _MEMORY else 0.0
        )
        continues = math.copysign(speed, speed * self._distance) * _MEMORY > self._allowed
        if abs(self._distance) <= self._allowed or not continues:
            self._misses = 0
            return None
        self._misses += 1
        units = self._parameters.units.position
        return (
            None
            if self._misses < _TWICE
            else self._restless(image, f"it moved by about {units.to_units(self._distance):g} {units.unit}")
        )

    def _moves(self, image: AxisImage, position: int, rest_position: int) -> UncommandedMotion:
        units = self._parameters.units.position
        went = (
            f"it moved from {units.to_units(rest_position - image.origin):g} to {units.to_units(position - image.origin):g} "
            f"{units.unit}"
        )
        return self._restless(image, went)

    def _restless(self, image: AxisImage, went: str) -> UncommandedMotion:
        name, speed = self._parameters.name, self._parameters.units.velocity
        moving = "" if image.velocity is None else f", now at {speed.to_units(image.velocity):g} {speed.unit}"
        mode = (
            ""
            if image.mode is None
            else f"; it shows mode {image.mode} ({modes.short(ModeOfOperation(image.mode))})"
        )
        return UncommandedMotion(
            f"{name}: the axis moves without a command",
            axis=name,
            observed=f"{self._why}, and {went}{moving}{mode}",
            remedy="look for another master or tool that commands it, a drive that still follows an old target, or a load "
            f"that the motor cannot hold; standstill_window and following_error in [axes.{name}] set how far it may "
            "move",
        )

    def _pulled(self, image: AxisImage, position: int, pull: float) -> UncommandedMotion:
        name, units = self._parameters.name, self._parameters.units.position
        return UncommandedMotion(
            f"{name}: the axis is at standstill, but its drive pulls it to another position",
            axis=name,
            observed=f"it is held at {units.to_units(position - image.origin):g} {units.unit}, and the demand of its drive is "
            f"{abs(units.to_units(pull)):g} {units.unit} away (6062h, or the last target)",
            remedy="KEEP CLEAR: when it comes free, it jumps; switch its power off, then find the obstacle",
        )
