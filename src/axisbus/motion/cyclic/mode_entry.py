"""What comes before the first target of csv and cst: offsets of 0, the interpolation time, what a stop needs, and the mode."""

from __future__ import annotations

from collections.abc import Sequence

from axisbus.cia402 import controlword as cw
from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.activity import Lead, ModeSwitch
from axisbus.motion.moves.interpolation import CyclicSetup
from axisbus.motion.moves.prepare import RampTransfers
from axisbus.motion.parameters import AxisParameters


class ModeEntry:
    """Brings a standing axis into a cyclic mode; holds whether it is there, and which ramps of the written ones its drive has."""

    __slots__ = ("_gate", "_is_ready", "_mode", "_setup", "ramps")

    def __init__(
        self,
        mode: ModeOfOperation,
        parameters: AxisParameters,
        gate: StartBarrier,
        writes: Sequence[tuple[int, int, int | None]] = (),
        lead: Lead | None = None,
    ) -> None:
        """``writes``: (index, sub-index, value) before the mode is asked for. ``lead``: what is sent while it changes."""
        self._setup = CyclicSetup(parameters, f"be led in {mode.text} mode")
        self.ramps = RampTransfers(writes, parameters)
        self._mode = ModeSwitch(mode, parameters, lead)
        self._gate = gate
        self._is_ready = False

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True from the cycle on in which the first target may go out.

        Raises:
            DriveError: the drive does not take what it needs for the mode.
            ModeError: it does not take the mode.
        """
        if not self._is_ready:
            prepared = self._setup.step(image, order) and self.ramps.step(image, order)
            self._is_ready = prepared and self._mode.step(image, order)
        return self._is_ready and self._is_released(image, order) and self._gate.pass_through(self)

    @staticmethod
    def _is_released(image: AxisImage, order: CycleOutputs) -> bool:
        """Release a halt before the first target goes out: a drive that hears the word late would leave that target out."""
        order.halt = False
        return not (image.flight.word or 0) & cw.HALT

    def cancel(self, order: CycleOutputs) -> None:
        """Take back what is queued, and a mode that was asked for."""
        self._setup.cancel(order)
        self.ramps.cancel(order)
        self._mode.cancel(order)
