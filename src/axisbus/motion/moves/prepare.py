"""Prepare a move in a profile mode: change the mode, and write the profile objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from axisbus.cia301 import abort
from axisbus.cia402 import objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.options import Ramp
from axisbus.errors import LimitError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.modes import TORQUE_MODES
from axisbus.motion.moves.activity import Activity, SdoTransfers, SetPointSource, preload
from axisbus.motion.moves.mode_switch import ModeSwitch
from axisbus.motion.moves.profile import MoveProfile, on_ramps
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.parameters import AxisParameters

# A drive without these brakes as it accelerates, and ends every move at rest.
OPTIONAL_PROFILE = frozenset({objects.PROFILE_DECELERATION, objects.END_VELOCITY})
# Objects for the computation of a braking distance: read back after the write, because a drive may have a fixed value, or limit it.
RAMPS = (objects.PROFILE_ACCELERATION, objects.PROFILE_DECELERATION)
_ROUNDING = 1.000001
# No answer arrived, or the value is impossible.
_NO_ANSWER = frozenset({abort.TIMED_OUT, *abort.VALUE_REFUSED})


def profile_writes(
    profile: MoveProfile, parameters: AxisParameters, mode: ModeOfOperation
) -> list[tuple[int, int, int | None]]:
    """Return the SDO writes that a profile needs.

    They are made for every move, because another tool may have written these objects meanwhile.
    """
    wanted = [
        (objects.PROFILE_ACCELERATION, profile.acceleration),
        (objects.PROFILE_DECELERATION, profile.deceleration),
    ]
    if mode is ModeOfOperation.PROFILE_POSITION:
        wanted.insert(0, (objects.PROFILE_VELOCITY, profile.velocity))
        wanted.append((objects.END_VELOCITY, 0))  # any other value would move the axis past the target
    return [(index, 0, value) for index, value in wanted if parameters.has(index)]


def slow_ramp_writes(
    parameters: AxisParameters, *, by_torque: bool = False
) -> list[tuple[int, int, int | None]]:
    """Return the write of 6084h before a motion that does not set it itself, if a stop of the drive brakes on this ramp.

    Otherwise a quick stop would brake with the value of the last profile move, or with the one that the drive was switched on with.
    ``by_torque``: a torque moves the axis, so a halt may also brake it, in another mode.
    """
    deceleration = parameters.path_deceleration
    by_slow_ramp = parameters.braking.quick_stop is Ramp.SLOW or (
        by_torque and parameters.halts_torque_by_mode
    )
    if deceleration is None or not by_slow_ramp or not parameters.has(objects.PROFILE_DECELERATION):
        return []
    raw = max(1, abs(parameters.units.acceleration.to_increments(deceleration)))
    return [(objects.PROFILE_DECELERATION, 0, raw)]


def expected(profile: MoveProfile, parameters: AxisParameters) -> MoveProfile:
    """Return a profile with the expected ramps of the drive, from the values known before the write."""
    fixed = dict(parameters.fixed_ramps)
    up, down = objects.PROFILE_ACCELERATION, objects.PROFILE_DECELERATION
    return on_ramps(
        profile, fixed.get(up, profile.acceleration), fixed.get(down, profile.deceleration), parameters
    )


def require_ramps(profile: MoveProfile, parameters: AxisParameters) -> MoveProfile:
    """Return ``profile``, which has the ramps of the drive.

    Raises:
        LimitError: they are harder than ``max_acceleration``.
    """
    limit, unit = parameters.limits.acceleration, abs(parameters.units.position.factor)
    hardest = max(profile.up or 0.0, profile.down or 0.0) / unit
    asked = max(profile.acceleration, profile.deceleration) / abs(parameters.units.acceleration.factor)
    if limit is None or hardest <= limit * _ROUNDING or hardest <= asked * _ROUNDING:
        return profile
    name, per = parameters.name, parameters.units.acceleration.unit
    raise LimitError(
        f"{name}: the drive's own ramps are steeper than max_acceleration",
        observed=f"6083h and 6084h were written, and the drive has {hardest:g} {per}; the limit is {limit:g}",
        remedy="make the drive accept these objects (its EDS or manual says when it does), or raise max_acceleration in "
        f"[axes.{name}] to the value of the drive",
    )


class RampTransfers(SdoTransfers):
    """Writes before a move, and the resulting ramps of its drive (6083h, 6084h); holds the values of these ramps.

    If a ramp of the drive is read-only, its value is read, and the master computes with this value.
    """

    __slots__ = ("_asked", "_refused", "_writes", "parameters")

    def __init__(
        self,
        writes: Sequence[tuple[int, int, int | None]],
        parameters: AxisParameters,
        before: RampTransfers | None = None,
    ) -> None:
        """``writes``: (index, sub-index, value); the ramps among them are read back; if it is empty, those of ``before``."""
        written = {index: value for index, _, value in writes if index in RAMPS}
        self._asked: dict[int, int | None] = ({} if before is None else before._asked) | written
        self.parameters = parameters
        shown = written if writes else self._asked
        reads = [] if parameters.virtual else [(index, 0, None) for index in shown]
        fixed = {index for index in written if (index, 0) in parameters.read_only}
        takes = [item for item in writes if item[0] not in fixed]
        super().__init__([*takes, *reads], parameters, OPTIONAL_PROFILE)
        self._writes: set[int] = set()  # the requests that write a ramp
        self._refused: set[int] = fixed
        if before is not None:
            self._refused |= before._refused - written.keys()
            self.values = {at: value for at, value in before.values.items() if at[0] not in written}

    def applied(self, profile: MoveProfile) -> MoveProfile:
        """Return ``profile`` with the ramps of the drive, if these differ from the written ones."""
        up = self._known(objects.PROFILE_ACCELERATION, profile.acceleration)
        down = self._known(objects.PROFILE_DECELERATION, profile.deceleration)
        if (up, down) == (profile.acceleration, profile.deceleration):
            return profile
        return on_ramps(profile, up, down, self.parameters)

    @property
    def deceleration(self) -> int | None:
        """The value of 6084h in the drive's increments; None if it is not known, or was not written."""
        return self._known(objects.PROFILE_DECELERATION, None)

    @property
    def was_asked(self) -> bool:
        """Whether 6084h was to be written."""
        return objects.PROFILE_DECELERATION in self._asked

    def _known(self, index: int, otherwise: int | None) -> int | None:
        """Return the value of a ramp: as read, else as written; None if the drive refused it and returns no value."""
        if (index, 0) in self.values:
            return self.values[index, 0]
        return None if index in self._refused else self._asked.get(index, otherwise)

    def _take(self, image: AxisImage, request: int) -> None:
        index, _ = self._pending[request]
        code = image.replies[request].abort
        if code is None or index not in self._asked or code in _NO_ANSWER:
            super()._take(image, request)
            return
        del self._pending[request]
        if request in self._writes:
            self._refused.add(index)

    def _start(self, image: AxisImage, order: CycleOutputs) -> None:
        super()._start(image, order)
        given = zip(self._pending, self._items, strict=True)
        self._writes = {number for number, (index, _, value) in given if index in RAMPS and value is not None}


class Prepare:
    """The preparation of a profile move: the mode, the profile objects, and (in a group) the wait for the other axes.

    ``ramps`` holds the resulting ramps of the drive.
    """

    __slots__ = (
        "_before",
        "_changes",
        "_gate",
        "_may_leave",
        "_mode",
        "_prepared",
        "_reading",
        "_set_point_source",
        "_transfers",
        "ramps",
    )  # fmt: skip

    def __init__(
        self,
        mode: ModeSwitch,
        transfers: SdoTransfers,
        ramps: RampTransfers,
        gate: StartBarrier,
        set_point_source: SetPointSource | None = None,
        before: ModeSwitch | None = None,
        may_leave: Callable[[AxisImage], bool] | None = None,
    ) -> None:
        """``transfers``: all transfers, including ``ramps``.

        ``set_point_source``: the trajectory that commands the axis while the mode changes; the drive's ramps must be written before
        it ends.

        ``before``: the change of mode out of that trajectory that another command has begun. The drive may have taken it already,
        and a return to the old mode for one cycle would cause a jolt. So this change is completed.

        ``may_leave``: whether the drive could brake within the position limits if it left that trajectory now. Until then the
        trajectory brakes. To be called in every cycle.
        """
        self._set_point_source = set_point_source
        self._before = before
        self._may_leave = may_leave
        self._mode = mode
        self._transfers = transfers
        self.ramps = ramps
        self._gate = gate
        self._prepared = self._changes = False
        self._reading: RampTransfers | None = None

    @property
    def set_point_source(self) -> SetPointSource | None:
        """The trajectory that still commands the axis; None once the drive is in the mode of the command."""
        return None if self._prepared else self._set_point_source

    @property
    def pending_mode_switch(self) -> ModeSwitch | None:
        """The change of mode that will end the trajectory, once it has been requested."""
        asked = self._before or (self._mode if self._mode.under_way else None)
        return None if self.set_point_source is None else asked

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True from the cycle on in which the move may begin."""
        if not self._prepared and self._has_left(image, order):
            ready = self._reading is not None or self._makes_ready(image, order)
            self._prepared = ready and self._has_read(image, order)
        return self._prepared and self._gate.pass_through(self)

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake of the change of mode."""
        return self._mode.in_flight

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel queued transfers, and a requested mode."""
        (self._reading or self._transfers).cancel(order)
        (self._before or self._mode).cancel(order)

    def _has_left(self, image: AxisImage, order: CycleOutputs) -> bool:
        if self._before is not None and self._before.step(image, order):
            self._before = self._set_point_source = None
        return self._before is None

    def _makes_ready(self, image: AxisImage, order: CycleOutputs) -> bool:
        written = self._transfers.step(image, order)
        if self._set_point_source is None or (self._leaves(self._set_point_source, image) and written):
            shown = self._mode.step(image, order)
            self._changes = self._changes or not shown
            return shown and written
        self._mode.step_source(image, order)
        return False

    def _leaves(self, set_point_source: SetPointSource, image: AxisImage) -> bool:
        """Whether the mode may be requested; if the drive could not stop in time by then, the trajectory brakes."""
        if self._may_leave is None or self._mode.under_way or self._may_leave(image):
            return True
        return not set_point_source.begin_braking()

    def _has_read(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether the ramps are known after a change of mode.

        An axis that moves does not wait for this, nor one in a torque mode, because nothing holds it meanwhile.
        """
        if self._reading is None:
            if not self._changes or not image.standstill or self._mode.mode in TORQUE_MODES:
                return True
            self._reading = self.ramps = RampTransfers(
                (), self.ramps.parameters, self.ramps
            )  # a mode may change them
        if self._reading.step(image, order):
            return True
        preload(order, self._mode.reference)
        return False


class Prepared(Activity):
    """A command in a profile mode; ``_prepare`` is its preparation."""

    _prepare: Prepare

    @property
    def set_point_source(self) -> SetPointSource | None:
        """The previous trajectory, until the drive is in the mode of this command."""
        return self._prepare.set_point_source

    @property
    def pending_mode_switch(self) -> ModeSwitch | None:
        """The change of mode that ends that trajectory, once it has been requested."""
        return self._prepare.pending_mode_switch

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake of the change of mode."""
        return self._prepare.in_flight

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued requests."""
        self._prepare.cancel(order)
