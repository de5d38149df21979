"""The end of a stop in profile position mode without 6062h: a set-point where the axis stands, so that nothing pulls.

Theory of operation
-------------------
A drive that was halted on its way keeps its old target. Nobody sees whether its controller leads the motor there (something may
hold it), so it is given a new one: the position that it has now, at the lowest velocity. The halt stays set all the time; a drive
that takes no set-point then is stopped harder. Where the handshake is "on-change" nothing else can be seen, and 607Ah is read back.
"""

from __future__ import annotations

from axisbus.cia402 import objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import DriveError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import SdoTransfers
from axisbus.motion.moves.setpoint_without_ack import set_point
from axisbus.motion.parameters import AxisParameters, Handshake, HoldsLoad
from axisbus.units import wrap

_RATED = 1000  # ‰ of rated torque (6077h)
_LOWEST = 1  # 6081h, in the drive's own velocity increments


def needs_relief(image: AxisImage, parameters: AxisParameters) -> bool:
    """Whether the drive may still be led to the target of an interrupted move, and nobody sees it."""
    if image.mode != ModeOfOperation.PROFILE_POSITION or image.demand is not None:
        return False
    if image.led.set_point is None or image.position is None:
        return False
    return abs(image.led.set_point - image.position) > parameters.pull_window


def is_blind(image: AxisImage, parameters: AxisParameters) -> bool:
    """Whether nobody sees where the drive's controller leads an axis that was in the middle of a move or of a homing."""
    searching = image.mode == ModeOfOperation.HOMING and image.led.searching_since < image.now
    return needs_relief(image, parameters) or (searching and image.pull is None)


def pushes(image: AxisImage, parameters: AxisParameters) -> bool:
    """Whether an axis at rest that holds no load pushes with all its rated torque: something holds it."""
    return parameters.holds_load is HoldsLoad.NO and image.torque is not None and abs(image.torque) >= _RATED


class HoldSetPoint:
    """A set-point at ``target`` under halt; holds its transfers and its handshake."""

    __slots__ = ("_failed", "_read", "_set_point", "_transfers")

    def __init__(self, target: int, parameters: AxisParameters) -> None:
        """``target``: the actual position, in unwrapped increments."""
        slow = [(objects.PROFILE_VELOCITY, 0, _LOWEST)] if parameters.has(objects.PROFILE_VELOCITY) else []
        self._transfers = SdoTransfers(slow, parameters)
        self._set_point = set_point(target, parameters)
        # Where bit 12 proves nothing, and no motion can: that the target has arrived is what is left.
        by_sight = parameters.handshake is Handshake.ON_CHANGE
        self._read = SdoTransfers([(objects.TARGET_POSITION, 0, None)] if by_sight else [], parameters)
        self._failed = False

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once the drive has the new target; one that does not take it never has it."""
        order.halt = True
        if self._failed:
            return False
        try:
            given = self._transfers.step(image, order) and self._set_point.step(image, order)
            if not given or not self._read.step(image, order):
                return False
        except DriveError:
            self._failed = True
            return False
        shown = self._read.values.get((objects.TARGET_POSITION, 0), self._set_point.target)
        self._failed = wrap(shown) != wrap(self._set_point.target)
        return not self._failed

    def cancel(self, order: CycleOutputs) -> None:
        """Take back what is queued."""
        self._transfers.cancel(order)
        self._read.cancel(order)
