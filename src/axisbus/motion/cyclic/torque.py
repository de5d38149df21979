"""A torque in cyclic synchronous torque mode: the master computes the slope, and sends one torque per cycle."""

from __future__ import annotations

from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.commands import CyclicTorque
from axisbus.motion.cyclic.mode_entry import ModeEntry
from axisbus.motion.cyclic.ramps import TorqueRamp
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.activity import Activity
from axisbus.motion.moves.continuous_motion import TORQUE_FLOOR, TORQUE_SHARE, motion_by_torque, torque_missed
from axisbus.motion.moves.prepare import slow_ramp_writes
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop_deceleration import CommandedMotion

_MARGIN = 2.0  # seconds that the torque may be late, in addition to four times its slope


class CyclicTorqueMove(Activity):
    """An axis at a commanded torque in cst. The command is done when 6077h shows it, and the torque stays; it can be changed.

    It begins with the torque that the axis has when the command comes, so that a load or a contact force is not released.
    """

    mode = ModeOfOperation.CYCLIC_SYNC_TORQUE
    ramp = TorqueRamp
    keeps_moving = True
    commanded = CommandedMotion(by_torque=True)

    def __init__(
        self,
        command: CyclicTorque,
        parameters: AxisParameters,
        gate: StartBarrier,
        before: TorqueRamp | None = None,
    ) -> None:
        """``before``: the ramp that commands the axis in cst already; None: the axis is at standstill and changes to cst first."""
        self._parameters = parameters
        writes = slow_ramp_writes(parameters, by_torque=True)
        fresh = before is None
        self._mode_entry = (
            ModeEntry(self.mode, parameters, gate, writes, self._keep_torque) if fresh else None
        )
        self._ramp = before
        self._torque_before: int | None = None  # the torque that was sent while the mode changed
        self.aim(command)

    def aim(self, command: CyclicTorque) -> None:
        """Change to another torque, starting from the one sent last."""
        self._command = command
        self._deadline: float | None = None
        self.reached = False
        if self._ramp is not None:
            self._ramp.aim(command.torque, command.slope)

    @property
    def set_point_source(self) -> TorqueRamp | None:
        """The ramp that commands the axis; None before it has begun."""
        return self._ramp

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the torque is reached; keeps the torque if called afterwards."""
        if self._mode_entry is not None and not self._mode_entry.step(image, order):
            self._torque_before = self._torque_before if order.target_torque is None else order.target_torque
            return False
        ramp = self._active_ramp(image)
        # Before the ramp advances: if this raises, the axis is stopped in this cycle, from the previous torque.
        self._watch(image, ramp)
        ramp.step(image, order)
        return self.reached

    @property
    def torque(self) -> int:
        """See ``Activity``."""
        return 0 if self._ramp is None else round(self._ramp.torque)

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake of the change of mode."""
        return None if self._mode_entry is None else self._mode_entry.in_flight

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel queued transfers."""
        if self._mode_entry is not None:
            self._mode_entry.cancel(order)

    def _keep_torque(self, image: AxisImage, order: CycleOutputs) -> None:
        """While the mode changes, send the torque that the axis had before."""
        if self._torque_before is None:
            self._torque_before = image.torque
        order.target_torque = self._torque_before or 0

    def _active_ramp(self, image: AxisImage) -> TorqueRamp:
        mode_entry, self._mode_entry = self._mode_entry, None
        if self._ramp is None:
            parameters, command = self._parameters, self._command
            if mode_entry is not None:
                self.commanded = motion_by_torque(mode_entry.ramps)
            present = self._torque_before if self._torque_before is not None else image.torque
            halt_removes_torque = not parameters.halts_torque_by_mode
            self._ramp = TorqueRamp(
                float(present or 0),
                command.slope,
                parameters.scan_period,
                halt_removes_torque=halt_removes_torque,
            )
            self._ramp.aim(command.torque, command.slope)
        return self._ramp

    def _watch(self, image: AxisImage, ramp: TorqueRamp) -> None:
        if self._deadline is None:
            self._deadline = image.now + self._allowed(ramp.torque)
        if self.reached:
            return
        self.reached = ramp.at_target and self._in_torque(image)
        if not self.reached and image.now > self._deadline:
            raise torque_missed(image, self._parameters, self._command.torque)

    def _in_torque(self, image: AxisImage) -> bool:
        """Return whether the measured torque is in tolerance, and more than half of the target; bit 10 does not show it in cst."""
        if image.torque is None:
            return False
        target = self._command.torque
        off = abs(image.torque - target)
        return off <= max(TORQUE_FLOOR, abs(target) * TORQUE_SHARE) and (not target or off < abs(target) / 2)

    def _allowed(self, torque: float) -> float:
        """Return the timeout of the call, otherwise four times the slope from ``torque`` to the target, plus a margin (s)."""
        command = self._command
        return command.timeout or 4.0 * (abs(torque) + abs(command.torque)) / command.slope + _MARGIN
