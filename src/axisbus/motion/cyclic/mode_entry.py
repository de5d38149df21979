"""Preparation of csv and cst before the first target: offsets of 0, the interpolation time, ramps for a stop, and the mode."""

from __future__ import annotations

from collections.abc import Sequence

from axisbus.cia402 import controlword as cw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.interpolation import CyclicSetup
from axisbus.motion.moves.mode_switch import ModeSwitch, SourceStep
from axisbus.motion.moves.prepare import RampTransfers
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.parameters import AxisParameters


class ModeEntry:
    """Switches an axis at standstill to a cyclic mode; holds whether it is ready, and the written ramps that its drive has."""

    __slots__ = ("_gate", "_is_ready", "_mode", "_setup", "ramps")

    def __init__(
        self,
        mode: ModeOfOperation,
        parameters: AxisParameters,
        gate: StartBarrier,
        writes: Sequence[tuple[int, int, int | None]] = (),
        step_source: SourceStep | None = None,
    ) -> None:
        """``writes``: (index, sub-index, value), written before the mode change. ``step_source``: sends set-points meanwhile."""
        self._setup = CyclicSetup(parameters, f"follow set-points in {mode.text} mode")
        self.ramps = RampTransfers(writes, parameters)
        self._mode = ModeSwitch(mode, parameters, step_source)
        self._gate = gate
        self._is_ready = False

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True from the cycle on in which the first target may be sent.

        Raises:
            DriveError: the drive rejects an object that the mode needs.
            ModeError: the drive does not change to the mode.
        """
        if not self._is_ready:
            prepared = self._setup.step(image, order) and self.ramps.step(image, order)
            self._is_ready = prepared and self._mode.step(image, order)
        return self._is_ready and self._is_released(image, order) and self._gate.pass_through(self)

    @staticmethod
    def _is_released(image: AxisImage, order: CycleOutputs) -> bool:
        """Release a halt before the first target is sent; a drive that gets the controlword late would ignore that target."""
        order.halt = False
        return not (image.flight.word or 0) & cw.HALT

    @property
    def in_flight(self) -> SetPoint | None:
        """The unfinished handshake of the change of mode."""
        return self._mode.in_flight

    def cancel(self, order: CycleOutputs) -> None:
        """Cancel queued transfers, and a mode that was requested."""
        self._setup.cancel(order)
        self.ramps.cancel(order)
        self._mode.cancel(order)
