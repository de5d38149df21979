"""Clear the halt bit (6040h bit 8) of an axis at standstill, so that its drive takes another mode.

Theory of operation
-------------------
Some drives ignore 6060h while the halt bit is set. When the bit falls, a drive continues with the rest of the motion that the halt
interrupted. So the bit falls only if nothing is left that moves the axis, and the axis was seen at standstill:

1. WITHDRAW: the requested mode is withdrawn. The drive must show its present mode as the answer to 6060h, because bit 4 has another
   meaning in another mode.
2. REPLACE: the rest of the motion is replaced, by the mode (``AfterHalt``). In pp the drive gets its present position as a
   set-point (``HoldSetPoint``), under halt. Bit 4 has been low for ``acknowledge`` seconds before, so that no acknowledge of an
   earlier set-point is still to come. The handshake is made twice: if a later acknowledge does come, it ends the first
   handshake, and only the acknowledge of the first edge can end the second one.
3. STANDSTILL: the axis is seen at standstill, and nothing pulls it.
4. RELEASE: the halt bit falls. From now on, the position is monitored: an axis that moves is stopped by a quick stop.

If the drive does not acknowledge the set-point, the halt bit stays set, unless the master has given no set-point since the drive
was seen without power or in another mode. With ``handshake = "on-change"``, bit 12 proves nothing. So the drive gets no set-point
here, and its halt bit falls only in that case, or if the axis was seen to arrive at its last set-point.
"""

from __future__ import annotations

from enum import Enum

from axisbus.cia402 import controlword as cw
from axisbus.cia402 import statusword as sw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.modes import MODE_PROPERTIES, TORQUE_MODES, AfterHalt
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.parameters import AxisParameters, Handshake, HoldsLoad
from axisbus.motion.stop.hold_setpoint import HoldSetPoint
from axisbus.motion.stop.standstill import StandstillCheck
from axisbus.motion.stop.standstill_monitor import StandstillMonitor

_HANDSHAKES = 2
_NOT_TAKEN = "the drive does not accept its present position as a set-point during the halt"
_WHY = "its halt bit was cleared for a change of mode"


class HaltReleasePhase(Enum):
    """The phase of the release."""

    WITHDRAW = "withdraw"
    REPLACE = "replace"
    STANDSTILL = "standstill"
    RELEASE = "release"


class HaltRelease:
    """The release of the halt bit of one axis; holds its phase.

    ``done``: the drive has the controlword without the halt bit. ``refusal``: why the bit must stay set (empty: not decided).
    """

    __slots__ = (
        "_after",
        "_check",
        "_deadline",
        "_hold",
        "_low_since",
        "_mode",
        "_monitor",
        "_parameters",
        "_phase",
        "_was_idle",
        "done",
        "refusal",
    )

    def __init__(self, image: AxisImage, parameters: AxisParameters, low_since: float) -> None:
        """``low_since``: the time (s) since which bit 4 of the controlword is low."""
        self._parameters = parameters
        self._mode = image.mode
        self._low_since = low_since
        self._deadline = image.now + parameters.stop_times.halt
        self._hold: HoldSetPoint | None = None
        self._check = StandstillCheck(parameters, image.now)
        self._monitor = StandstillMonitor(parameters, _WHY, parameters.position_tolerance)
        self._phase = HaltReleasePhase.WITHDRAW
        self._after = after_halt(image, parameters)
        self._was_idle = image.reference_tracker.idle
        self.refusal = "" if self._after is not None else _why_unknown(image, parameters)
        self.done = False

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once the drive has the controlword without the halt bit; the targets must be preloaded in this cycle.

        Raises:
            UncommandedMotion: the axis moves although the halt bit fell at standstill.
        """
        if self.refusal:
            return False
        order.mode = self._mode
        _remove_torque(image, order)
        if self._phase is HaltReleasePhase.RELEASE:
            order.halt = False
            self.watch(image, order)
            self.done = _is_received(image)
            return self.done
        if not self._advance(image, order) and not self.refusal and image.now > self._deadline:
            self.refusal = self._late(image)
        if self.refusal:
            self.cancel(order)
        return False

    def watch(self, image: AxisImage, order: CycleOutputs) -> None:
        """Keep the axis at standstill until its command begins to move it; raise UncommandedMotion if it moves."""
        _remove_torque(image, order)
        error = self._monitor.error(image)
        if error is not None:
            order.halt = True
            raise error

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake of the set-point at the present position."""
        return None if self._hold is None or self.refusal else self._hold.in_flight

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel the queued transfers."""
        if self._hold is not None:
            self._hold.cancel(order)

    def _advance(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Step the phases before the release; return True in the cycle in which the halt bit falls."""
        phase = self._phase
        if phase is HaltReleasePhase.WITHDRAW:
            if image.mode == self._mode and image.flight.mode_answered(image.now):
                self._enter(HaltReleasePhase.REPLACE, image)
        elif image.mode != self._mode:
            self.refusal = "the drive does not keep its present mode"  # bit 4 may have another meaning now
        elif phase is HaltReleasePhase.REPLACE:
            if self._replaced(image, order):
                self._enter(HaltReleasePhase.STANDSTILL, image)
        elif self._check.seen(image):
            self._enter(HaltReleasePhase.RELEASE, image)
            order.halt = False
            return True
        return False

    def _enter(self, phase: HaltReleasePhase, image: AxisImage) -> None:
        self._phase = phase
        self._deadline = image.now + self._parameters.stop_times.halt
        if (
            phase is HaltReleasePhase.REPLACE and self._after is AfterHalt.SET_POINT
        ):  # each handshake waits for both edges of bit 12
            self._deadline += (1 + 2 * _HANDSHAKES) * self._parameters.timing.acknowledge
        self._check.begin(image.now)

    def _replaced(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Whether nothing is left that moves the axis when the halt ends; the preloaded targets have been sent for a while."""
        if self._after is AfterHalt.SEARCH:
            return image.statusword is not None and bool(image.statusword & sw.TARGET_REACHED)
        if self._after is AfterHalt.TARGET or self._parameters.handshake is Handshake.ON_CHANGE:
            return True
        if image.now < self._low_since + self._parameters.timing.acknowledge:
            return False
        if self._hold is None:
            if image.reference is None:
                return False
            self._hold = HoldSetPoint(image.reference, self._parameters, _HANDSHAKES)
        if not self._hold.step(image, order):
            if self._hold.failed and not self._was_idle:
                self.refusal = _NOT_TAKEN
            return self._hold.failed and self._was_idle
        # The drive may have limited the set-point to its own limits (607Dh), and would move there.
        return image.statusword is not None and not image.statusword & sw.INTERNAL_LIMIT

    def _late(self, image: AxisImage) -> str:
        if self._phase is HaltReleasePhase.STANDSTILL:
            return f"the axis is not seen at standstill: {self._check.why_not(image)}"
        if self._phase is HaltReleasePhase.WITHDRAW:
            return "the drive does not confirm its present mode"
        if self._after is AfterHalt.SEARCH:
            return "the drive does not report that its homing is interrupted (bit 10 of 6041h)"
        return _NOT_TAKEN


def after_halt(image: AxisImage, parameters: AxisParameters) -> AfterHalt | None:
    """Return the motion with which a halted drive would continue; None if it is unknown, or cannot be replaced during the halt."""
    if image.mode is None or _is_loaded(image, parameters):
        return None
    conduct = MODE_PROPERTIES.get(ModeOfOperation(image.mode))
    rest = None if conduct is None else conduct.after_halt
    unproven = rest is AfterHalt.SET_POINT and parameters.handshake is Handshake.ON_CHANGE
    return None if unproven and not _has_ended(image, parameters) else rest


def _why_unknown(image: AxisImage, parameters: AxisParameters) -> str:
    if image.mode is not None and _is_loaded(image, parameters):
        return "in its present mode only a torque holds the load"
    if image.mode == ModeOfOperation.PROFILE_POSITION:
        return (
            'with handshake = "on-change" nothing shows whether the drive takes a set-point during the halt'
        )
    return "it is not known how the drive would continue in its present mode"


def _is_loaded(image: AxisImage, parameters: AxisParameters) -> bool:
    return image.mode in TORQUE_MODES and parameters.holds_load is not HoldsLoad.NO


def _has_ended(image: AxisImage, parameters: AxisParameters) -> bool:
    """Whether no set-point is left: none was given, or the axis is at the last one and was seen to move there."""
    reference_tracker = image.reference_tracker
    if reference_tracker.idle or reference_tracker.set_point is None or image.position is None:
        return reference_tracker.idle
    return (
        reference_tracker.taken == reference_tracker.set_point
        and abs(reference_tracker.set_point - image.position) <= parameters.pull_window
    )


def _remove_torque(image: AxisImage, order: CycleOutputs) -> None:
    """Let no torque act in the present mode; the torque that was measured at standstill may be held for the next mode."""
    if image.mode in TORQUE_MODES:
        order.target_torque = 0


def _is_received(image: AxisImage) -> bool:
    """Whether the drive has the controlword without the halt bit."""
    return not (image.flight.word or 0) & cw.HALT and image.flight.word_answered(image.now)
