"""Adopt a drive found enabled in a mode that follows its targets: nothing changes until the drive has left that mode.

Theory of operation
-------------------
In pp and pv a drive is at standstill, or brakes on its ramp, with the targets that move nothing. In csp, csv and cst it adds
offsets (60B0h, 60B1h, 60B2h) to its target, and in tq and cst a torque of 0 releases whatever is being held. So targets and offsets
are read by SDO before the first frame. If all offsets of csp, or of a csv at standstill, are 0, the mode may stay. Otherwise the
targets are chosen so that *target plus offset* is the drive's present motion, until the drive shows a mode in which they have no
effect. Only then are the offsets set to 0.
"""

from __future__ import annotations

from collections.abc import Sequence

from axisbus.cia402 import modes, objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import StateError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.modes import ON_RAMPS, TORQUE_MODES
from axisbus.motion.moves.activity import SdoTransfers
from axisbus.motion.moves.interpolation import OFFSETS
from axisbus.motion.parameters import AxisParameters, HoldsLoad

_M = ModeOfOperation
_ADDED = {
    _M.CYCLIC_SYNC_POSITION: OFFSETS,
    _M.CYCLIC_SYNC_VELOCITY: frozenset({objects.VELOCITY_OFFSET, objects.TORQUE_OFFSET}),
}
_TARGETS = (objects.TARGET_POSITION, objects.TARGET_VELOCITY, objects.TARGET_TORQUE)
_SAME = 20  # increments between a target and the value that the drive follows


class DriveAdoption:
    """The state of a drive found in ``mode``; holds the targets and offsets that were read."""

    def __init__(self, mode: ModeOfOperation, parameters: AxisParameters) -> None:
        """``mode``: one of ``FOLLOWS_TARGETS``."""
        self.mode = mode
        self._parameters = parameters
        wanted = [index for index in (*_TARGETS, *sorted(OFFSETS)) if parameters.has(index)]
        self._read = SdoTransfers([(index, 0, None) for index in wanted], parameters, frozenset(wanted))
        self._position: int | None = None

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once targets and offsets are known; nothing else is sent to the drive before.

        Raises:
            DriveError: the drive does not return them.
        """
        return self._read.step(image, order)

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued transfers."""
        self._read.cancel(order)

    def choose(self, image: AxisImage, candidates: Sequence[ModeOfOperation]) -> list[ModeOfOperation]:
        """Return those ``candidates`` (resting modes, best first) to which the drive can change without a jump.

        Raises:
            StateError: there is none.
        """
        by_torque = self.mode in TORQUE_MODES
        offsets = [
            index for index in sorted(OFFSETS if by_torque else _ADDED[self.mode]) if self._value(index)
        ]
        brakes = (
            self.mode is _M.CYCLIC_SYNC_VELOCITY and not image.standstill
        )  # its target is a step, with no ramp
        if not offsets and not by_torque and not brakes:
            return [self.mode]
        usable = [mode for mode in candidates if mode not in TORQUE_MODES]
        if offsets or brakes:
            usable = [mode for mode in usable if mode in ON_RAMPS]
        if usable:
            return usable
        if self.mode is _M.PROFILE_TORQUE or (brakes and not offsets):
            return [self.mode]
        raise self._stuck(offsets)

    def holds_until(self, mode: ModeOfOperation | None) -> bool:
        """Whether the targets must be held while ``mode`` is being requested.

        A drive that has only profile torque stays in it: its torque goes to 0 on the drive's slope, unless it holds a load.
        """
        loaded = self._parameters.holds_load is not HoldsLoad.NO and self.mode in TORQUE_MODES
        return mode is not self.mode or mode is _M.CYCLIC_SYNC_POSITION or loaded

    def hold(self, image: AxisImage, order: CycleOutputs) -> None:
        """Request targets that do not change the drive's motion, in the mode in which it was found."""
        order.target_position, order.target_velocity, order.target_torque = image.reference, 0, 0
        if self.mode is _M.CYCLIC_SYNC_POSITION:
            order.target_position = self._held_position(image)
        elif self.mode is _M.CYCLIC_SYNC_VELOCITY:
            order.target_velocity = self._held_velocity(image)
        else:
            order.target_torque = self._held_torque(image)

    def _value(self, index: int) -> int:
        return self._read.values.get((index, 0), 0)

    def _held_position(self, image: AxisImage) -> int | None:
        """Return the target to send in each cycle; determined once, so that it does not drift with the feedback."""
        if self._position is None:
            self._position = resting_target(
                image,
                self._read.values.get((objects.TARGET_POSITION, 0)),
                self._value(objects.POSITION_OFFSET),
            )
        return self._position

    def _held_velocity(self, image: AxisImage) -> int:
        """Return the velocity target; at standstill, target plus offset is 0, because a halt may suppress the target found."""
        offset = self._value(objects.VELOCITY_OFFSET)
        return -offset if image.standstill else self._value(objects.TARGET_VELOCITY)

    def _held_torque(self, image: AxisImage) -> int:
        """Return the torque that acts now, without the offset."""
        offset = self._value(objects.TORQUE_OFFSET) if self.mode is _M.CYCLIC_SYNC_TORQUE else 0
        return self._value(objects.TARGET_TORQUE) if image.torque is None else image.torque - offset

    def _stuck(self, offsets: list[int]) -> StateError:
        name = self._parameters.name
        seen = ", ".join(f"{index:04X}h = {self._value(index)}" for index in offsets)
        return StateError(
            f"{name}: the axis cannot be taken over in mode {modes.short(self.mode)} without a jump",
            observed=f"it was found enabled with {seen}" if seen else "its torque may be holding a load",
            remedy="it has no profile position or profile velocity mode in which it could hold standstill: switch it off "
            "and on (axis.disable(), axis.reset(), then axis.enable())",
        )


def resting_target(image: AxisImage, found: int | None, offset: int) -> int | None:
    """Return the csp target with which a drive that adds ``offset`` keeps its position; ``found`` is 607Ah as read.

    The target found remains if the drive shows that it follows it: some drives include the offset in the demand (6062h), others do
    not. If the drive does not follow it (a halt, a limit), the actual position minus the offset is safe with both kinds.
    """
    target = None if found is None else image.unwrapped(found)
    if target is not None and _follows(image, target, offset):
        return target
    if not offset or image.position is None:
        return image.reference
    return image.position - offset


def _follows(image: AxisImage, target: int, offset: int) -> bool:
    summed = target + offset
    if any(seen is not None and abs(seen - summed) <= _SAME for seen in (image.position, image.demand)):
        return True
    if image.position is None or image.demand is None or abs(image.demand - target) > _SAME:
        return False
    return abs(image.position - summed) < abs(
        image.position - target
    )  # a demand without the offset, and not a halt at this position
