"""End a stop in profile position mode without 6062h: give a set-point at the actual position, so that nothing pulls the axis.

Theory of operation
-------------------
A drive that was halted during a move keeps its old target. Without 6062h the master cannot see whether the controller pulls the
motor towards that target (something may hold the motor). So the drive gets a new target: its present position, at the lowest
velocity. The halt bit stays set all the time. If a drive takes no set-point in this state, it is stopped harder. If the handshake
is ``"on-change"``, the drive gives no other confirmation, so 607Ah is read back.
"""

from __future__ import annotations

from axisbus.cia402 import controlword as cw
from axisbus.cia402 import objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import DriveError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import SdoTransfers
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.moves.setpoint_without_ack import set_point
from axisbus.motion.parameters import AxisParameters, Handshake, HoldsLoad
from axisbus.units import wrap

_RATED = 1000  # ‰ of rated torque (6077h)
_LOWEST = 1  # 6081h, in the drive's own velocity increments


def needs_relief(image: AxisImage, parameters: AxisParameters) -> bool:
    """Whether the controller may still pull the axis to the target of an interrupted move, and no value shows it."""
    if image.mode != ModeOfOperation.PROFILE_POSITION or image.demand is not None:
        return False
    if image.reference_tracker.set_point is None or image.position is None:
        return False
    return abs(image.reference_tracker.set_point - image.position) > parameters.pull_window


def is_target_unknown(image: AxisImage, parameters: AxisParameters) -> bool:
    """Whether no value shows the controller's target, for an axis that was in the middle of a move or of a homing."""
    searching = image.mode == ModeOfOperation.HOMING and image.reference_tracker.homing_since < image.now
    return needs_relief(image, parameters) or (searching and image.pull is None)


def pushes(image: AxisImage, parameters: AxisParameters) -> bool:
    """Whether an axis at rest that holds no load pushes with its full rated torque: something holds it."""
    return parameters.holds_load is HoldsLoad.NO and image.torque is not None and abs(image.torque) >= _RATED


class HoldSetPoint:
    """A set-point at ``target`` under halt; holds its transfers and its handshake. ``failed``: the drive does not take it."""

    __slots__ = ("_handshakes", "_parameters", "_read", "_set_point", "_transfers", "failed")

    def __init__(self, target: int, parameters: AxisParameters, handshakes: int = 1) -> None:
        """``target``: the position to hold, in unwrapped increments; ``handshakes``: how often it is given."""
        self._parameters = parameters
        self._handshakes = handshakes
        slow = [(objects.PROFILE_VELOCITY, 0, _LOWEST)] if parameters.has(objects.PROFILE_VELOCITY) else []
        self._transfers = SdoTransfers(slow, parameters)
        self._set_point = set_point(target, parameters)
        # Bit 12 proves nothing here, and no motion can. The only remaining evidence is the target itself, read back from the drive.
        by_sight = parameters.handshake is Handshake.ON_CHANGE
        self._read = SdoTransfers([(objects.TARGET_POSITION, 0, None)] if by_sight else [], parameters)
        self.failed = False

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once the drive has the new target. If the drive has rejected it, return False in every cycle."""
        order.halt = True
        if self.failed:
            return False
        try:
            given = self._transfers.step(image, order) and self._give(image, order)
            if not given or not self._read.step(image, order):
                return False
        except DriveError:
            self.failed = True
            return False
        shown = self._read.values.get((objects.TARGET_POSITION, 0), self._set_point.target)
        self.failed = wrap(shown) != wrap(self._set_point.target)
        return not self.failed

    def _give(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Step the handshake; return True once the last one has ended."""
        if order.bits & cw.NEW_SET_POINT:
            return False  # the handshake of an interrupted move: its acknowledge must not count for this set-point
        if not self._set_point.step(image, order):
            return False
        if self._handshakes > 1:
            self._handshakes -= 1
            self._set_point = set_point(self._set_point.target, self._parameters)
            return False
        return True

    @property
    def in_flight(self) -> SetPoint | None:
        """The handshake, if it has begun and has not ended."""
        return self._set_point if self._set_point.begun else None

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued transfers."""
        self._transfers.cancel(order)
        self._read.cancel(order)
