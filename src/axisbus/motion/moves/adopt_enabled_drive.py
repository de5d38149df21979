"""Taking over a drive that was found enabled in a mode that follows its targets: nothing changes until it has left that mode.

Theory of operation
-------------------
In pp and pv a drive stands, or brakes on its ramp, with the targets that move nothing. In csp, csv and cst it adds offsets (60B0h,
60B1h, 60B2h) to the target that it gets, and in tq and cst a torque of 0 lets go of what is being held. So targets and offsets are
read by SDO before the first frame. Where all offsets of csp, or of a csv at rest, are 0, the mode may stay. Else the targets are
such that *target plus offset* is what the drive does now, until it shows a mode in which they do not act; only then are the offsets
set to 0.
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
_SAME = 20  # increments between a target and what the drive says that it follows


class DriveAdoption:
    """What a drive was found doing in ``mode``; holds the targets and offsets that were read."""

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
            DriveError: the drive does not give them.
        """
        return self._read.step(image, order)

    def cancel(self, order: CycleOutputs) -> None:
        """Take back what is queued."""
        self._read.cancel(order)

    def choose(self, image: AxisImage, candidates: Sequence[ModeOfOperation]) -> list[ModeOfOperation]:
        """Return those of ``candidates`` (resting modes, best first) that the drive can be brought into without a jump.

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
        """Whether the targets are to be held while ``mode`` is being asked for.

        A drive that has profile torque alone stays in it: its torque goes to 0 on the drive's slope, unless a load hangs on it.
        """
        loaded = self._parameters.holds_load is not HoldsLoad.NO and self.mode in TORQUE_MODES
        return mode is not self.mode or mode is _M.CYCLIC_SYNC_POSITION or loaded

    def hold(self, image: AxisImage, order: CycleOutputs) -> None:
        """Wish for targets that leave the drive doing what it does, in the mode that it was found in."""
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
        """Return the target to be sent again in each cycle; found out once, so that it does not wander with the feedback."""
        if self._position is None:
            self._position = resting_target(
                image,
                self._read.values.get((objects.TARGET_POSITION, 0)),
                self._value(objects.POSITION_OFFSET),
            )
        return self._position

    def _held_velocity(self, image: AxisImage) -> int:
        """Standing, it is 0 with the offset: the target that was left may be one that a halt keeps back."""
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
            f"{name}: cannot be taken over in mode {modes.short(self.mode)} without a jump",
            observed=f"it was found enabled with {seen}" if seen else "its torque may be holding something",
            remedy="it has no profile position or profile velocity mode in which it could stand meanwhile: switch it off and on "
            "(axis.disable(), axis.reset(), then axis.enable())",
        )


def resting_target(image: AxisImage, found: int | None, offset: int) -> int | None:
    """Return the csp target with which a drive that adds ``offset`` stays where it is; ``found`` is 607Ah as it was read.

    The target that was found stays where the drive says that it follows it: some count the offset into the demand (6062h), others
    do not. Where it does not follow it (a halt, a limit), the actual position less the offset is safe with both.
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
    )  # a demand without the offset, and not a halt there
