"""Change the mode of operation (6060h), and wait until the drive shows it (6061h)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

from axisbus.cia402 import modes, objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import ModeError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.modes import WITHOUT_POSITION_DEMAND
from axisbus.motion.moves.activity import preload, shown_modes
from axisbus.motion.moves.halt_release import HaltRelease
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.parameters import AxisParameters, HoldsLoad

SourceStep = Callable[[AxisImage, CycleOutputs], object]


class ModeSwitch:
    """Changes the mode of operation and waits until 6061h shows it; the targets are preloaded meanwhile.

    Nothing jumps: while the mode changes, the position target is ``reference`` (actual position from disabled, demand when
    enabled), and velocity and torque targets are 0 (on an axis that holds a load, the torque is the actual one). An axis that
    follows a trajectory continues along it (``step_source``), because in a cyclic mode a target that does not continue causes a
    jolt.

    An axis that was halted stays halted while its mode changes. If the drive does not accept the mode in time, it may ignore 6060h
    while the halt bit is set. Then the halt bit is cleared (``HaltRelease``), and the mode is requested again.
    """

    __slots__ = (
        "_begun_at",
        "_deadline",
        "_mode",
        "_mode_before",
        "_parameters",
        "_reference",
        "_release",
        "_step_source",
    )

    def __init__(
        self, mode: ModeOfOperation, parameters: AxisParameters, step_source: SourceStep | None = None
    ) -> None:
        """``step_source``: the step that commands the axis until the drive has left its present mode; None if nothing does."""
        self._mode = mode
        self._parameters = parameters
        self._step_source = step_source
        self._mode_before: int | None = None  # the mode that the drive shows while the other one is requested
        self._begun_at = 0.0
        self._deadline: float | None = None
        self._reference: int | None = None
        self._release: HaltRelease | None = None

    @property
    def mode(self) -> ModeOfOperation:
        """The requested mode."""
        return self._mode

    @property
    def reference(self) -> int | None:
        """The position that was preloaded, None before the first step."""
        return self._reference

    @property
    def under_way(self) -> bool:
        """Whether the mode has been requested and is not shown yet."""
        return self._mode_before is not None

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the drive shows the mode.

        Raises:
            ModeError: 6061h does not follow in time.
            UncommandedMotion: the axis moves after its halt bit was cleared.
        """
        if self._deadline is None:
            self._begun_at = image.now
            self._deadline = image.now + self._parameters.timing.mode
            self._reference = image.reference
        if image.mode in WITHOUT_POSITION_DEMAND:  # it moves, or 6062h is old
            self._reference = image.position
        if self._is_shown(image, order):
            self._mode_before = None
            return True
        order.mode, self._mode_before = self._mode, image.mode
        preload(order, self._reference)
        self.step_source(image, order)
        if self._parameters.holds_load is not HoldsLoad.NO and image.torque is not None:
            order.target_torque = image.torque  # the actual torque holds the load; 0 would let it fall
        if self._release is not None:
            self._step_release(self._release, image, order)
        elif image.now > self._deadline:
            if not order.halt:
                self._refuse(image, order)
            self._release = HaltRelease(image, self._parameters, self._begun_at)
            self._step_release(self._release, image, order)
        return False

    def _step_release(self, release: HaltRelease, image: AxisImage, order: CycleOutputs) -> None:
        """Clear the halt bit; request the mode again once the drive has received this."""
        assert self._deadline is not None
        if not release.done:
            if release.step(image, order):
                self._deadline = image.now + self._parameters.timing.mode
            elif release.refusal:
                self._refuse(image, order, release.refusal)
            return
        release.watch(image, order)
        if image.now > self._deadline:
            self._refuse(image, order)

    def _refuse(self, image: AxisImage, order: CycleOutputs, halted: str = "") -> NoReturn:
        """Raise ModeError; ``halted``: why the halt bit could not be cleared."""
        order.mode = image.mode  # the drive must not take the mode later, unexpectedly
        raise self._refused(image, halted)

    def step_source(self, image: AxisImage, order: CycleOutputs) -> None:
        """Continue the present motion, before the mode is requested and while it changes."""
        if self._step_source is not None:
            self._step_source(image, order)

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake of the change of mode."""
        return None if self._release is None else self._release.in_flight

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel a mode that the drive has not taken yet: a later change would be unexpected."""
        if self._release is not None:
            self._release.cancel(order)
        if self._mode_before is not None:
            order.mode = self._mode_before

    def _is_shown(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether 6061h shows the mode, and no mode requested earlier can still take effect."""
        if not self._parameters.has(objects.MODES_OF_OPERATION_DISPLAY):
            order.mode = self._mode  # a drive without 6061h is used in one mode only
            return True
        if image.mode != self._mode:
            return False
        if order.asked_mode not in (None, self._mode):
            return False  # another requested mode may still take effect, and must be cancelled first
        return image.flight.mode_answered(image.now)

    def _refused(self, image: AxisImage, halted: str) -> ModeError:
        asked = f"{int(self._mode)} ({modes.short(self._mode)})"
        name = self._parameters.name
        shown = (
            "is unknown"
            if image.mode is None
            else f"stays at {image.mode} ({modes.short(ModeOfOperation(image.mode))})"
        )
        if self._parameters.interpolated and image.mode == ModeOfOperation.INTERPOLATED_POSITION:
            return ModeError(
                f"{name}: the drive does not interpolate in ip, which is its csp",
                axis=name,
                observed="bit 4 of 6040h enables it, and bit 12 of 6041h (interpolation active) stays 0 after "
                f"{self._parameters.timing.mode:g} s",
                remedy="check the drive's manual for its requirements in ip: its buffer (60C4h), a sub mode (60C0h), SYNC",
            )
        return ModeError(
            f"{name}: the drive does not enter mode {asked}",
            axis=name,
            observed=f"6060h was set to {int(self._mode)}, 6061h {shown} after {self._parameters.timing.mode:g} s; "
            + (f"the halt bit (bit 8 of 6040h) is set, and must stay set: {halted}; " if halted else "")
            + f"its modes are {shown_modes(self._parameters)}",
            remedy=(
                "disable and enable the axis, if the drive takes no mode while it is halted; "
                if halted
                else ""
            )
            + "use another mode, or check in the drive's manual when it accepts this one (some only while enabled, "
            "some only before they are enabled: disable and enable the axis; some only with a licence or a wired encoder)",
        )
