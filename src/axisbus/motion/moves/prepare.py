"""What comes before a move in a profile mode: the mode itself, and the profile objects."""

from __future__ import annotations

from axisbus.cia402 import objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.options import Ramp
from axisbus.motion.axis.image import Image
from axisbus.motion.axis.order import Order
from axisbus.motion.group.gate import Gate
from axisbus.motion.leading import Leading
from axisbus.motion.moves.activity import Activity, ModeSwitch, Transfers
from axisbus.motion.moves.profile import Profile
from axisbus.motion.parameters import AxisParameters

# A drive without these brakes as it accelerates, and ends every move at rest.
OPTIONAL_PROFILE = frozenset({objects.PROFILE_DECELERATION, objects.END_VELOCITY})


def profile_writes(
    profile: Profile, parameters: AxisParameters, mode: ModeOfOperation
) -> list[tuple[int, int, int | None]]:
    """Return the SDO writes that a profile needs.

    They are made for every move: what another tool may have written meanwhile is not trusted.
    """
    wanted = [
        (objects.PROFILE_ACCELERATION, profile.acceleration),
        (objects.PROFILE_DECELERATION, profile.deceleration),
    ]
    if mode is ModeOfOperation.PROFILE_POSITION:
        wanted.insert(0, (objects.PROFILE_VELOCITY, profile.velocity))
        wanted.append((objects.END_VELOCITY, 0))  # anything else would run past the target
    return [(index, 0, value) for index, value in wanted if parameters.has(index)]


def slow_ramp_writes(parameters: AxisParameters) -> list[tuple[int, int, int | None]]:
    """Return the write of 6084h before a move under torque, where it is what will brake the axis ahead of its limits."""
    deceleration = parameters.path_deceleration
    by_slow_ramp = parameters.halts_torque_by_mode or parameters.braking.quick_stop is Ramp.SLOW
    if deceleration is None or not by_slow_ramp or not parameters.has(objects.PROFILE_DECELERATION):
        return []
    raw = max(1, abs(parameters.units.acceleration.to_increments(deceleration)))
    return [(objects.PROFILE_DECELERATION, 0, raw)]


class Prepare:
    """What comes before a profile move: the mode, the profile objects, and (in a group) waiting for the others."""

    __slots__ = ("_before", "_gate", "_leading", "_mode", "_prepared", "_transfers")

    def __init__(
        self,
        mode: ModeSwitch,
        transfers: Transfers,
        gate: Gate,
        leading: Leading | None = None,
        before: ModeSwitch | None = None,
    ) -> None:
        """``leading``: the trajectory that leads the axis while the mode changes; it must find its ramps written afterwards.

        ``before``: the change of mode out of that trajectory that another command has begun. The drive may have taken it already:
        to be called back for a cycle would be a jolt, so it is seen through.
        """
        self._leading = leading
        self._before = before
        self._mode = mode
        self._transfers = transfers
        self._gate = gate
        self._prepared = False

    @property
    def leading(self) -> Leading | None:
        """The trajectory that leads the axis still; None once the drive is in the mode of the command."""
        return None if self._prepared else self._leading

    @property
    def leaving(self) -> ModeSwitch | None:
        """The change of mode that will end the trajectory, once it has been asked for."""
        asked = self._before or (self._mode if self._mode.under_way else None)
        return None if self.leading is None else asked

    def step(self, image: Image, order: Order) -> bool:
        """Return True from the cycle on in which the move may begin."""
        if not self._prepared and self._has_left(image, order):
            self._prepared = self._makes_ready(image, order)
        return self._prepared and self._gate.pass_through(self)

    def cancel(self, order: Order) -> None:
        """Take back queued transfers, and a mode that was asked for."""
        self._transfers.cancel(order)
        (self._before or self._mode).cancel(order)

    def _has_left(self, image: Image, order: Order) -> bool:
        if self._before is not None and self._before.step(image, order):
            self._before = self._leading = None
        return self._before is None

    def _makes_ready(self, image: Image, order: Order) -> bool:
        written = self._transfers.step(image, order)
        if written or self._leading is None:
            return self._mode.step(image, order) and written
        self._mode.lead(image, order)
        return False


class Prepared(Activity):
    """A command in a profile mode; ``_prepare`` is what comes before it."""

    _prepare: Prepare

    @property
    def leading(self) -> Leading | None:
        """The trajectory before, until the drive is in the mode of this command."""
        return self._prepare.leading

    @property
    def leaving(self) -> ModeSwitch | None:
        """The change of mode that ends it, once it has been asked for."""
        return self._prepare.leaving

    def cancel(self, order: Order) -> None:
        """Take back what is queued."""
        self._prepare.cancel(order)
