"""Jogging: a velocity move that ends automatically unless it is renewed (like a dead man's handle)."""

from __future__ import annotations

from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import Stopped
from axisbus.motion.active_trajectory import Leading
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.commands import MoveVelocity
from axisbus.motion.moves.activity import Activity
from axisbus.motion.moves.continuous_motion import VelocityMove
from axisbus.motion.moves.mode_switch import ModeSwitch
from axisbus.motion.moves.setpoint import SetPoint


class Jog(Activity):
    """A velocity move with a lifetime; holds the time of its end.

    At a position limit it ends in a halt, and the axis may be jogged back.
    """

    mode = ModeOfOperation.PROFILE_VELOCITY
    goes_on = True
    stops_at_limit = True
    in_effect = False

    def __init__(self, move: VelocityMove, command: MoveVelocity, image: AxisImage) -> None:
        self.course, self.ramped = move.course, move.ramped
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
        self.course, self.ramped = move.course, move.ramped
        self.behind, self.led_speed, self.resisted_since = move.behind, move.led_speed, move.resisted_since
        self.lag, self.in_effect = move.lag, move.in_effect
        return reached

    def override(self, image: AxisImage) -> None:
        """See ``VelocityMove.override``."""
        self._move.override(image)
        self.course = self._move.course

    @property
    def leading(self) -> Leading | None:
        """The previous trajectory, until the drive is in the mode of this command."""
        return self._move.leading

    @property
    def leaving(self) -> ModeSwitch | None:
        """The change of mode that ends that trajectory, once it has been requested."""
        return self._move.leaving

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake of the change of mode."""
        return self._move.in_flight

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued requests."""
        self._move.cancel(order)
