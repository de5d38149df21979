"""An axis controlled in csv or cst by a controller in the user's program: one output per cycle; if one is missing, it stops.

Theory of operation
-------------------
The program reads the values of a cycle, and answers before the next cycle. The output is reached on the ramps of the command, like
any velocity or torque in these modes. An output belongs to the cycle whose values it was computed from. So the age of these values
counts, and not the arrival of the output. Before the first output the axis keeps its velocity or torque.

A velocity becomes the target of the ramp as soon as its output is received, before the supervision of that cycle. So the
supervision checks the new target before the drive receives it. An output received before the drive is in csv is ignored.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

from axisbus.errors import CommandError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.commands import ControllerCommand, ControllerOutput, CyclicTorque, CyclicVelocity
from axisbus.motion.cyclic.ramps import TorqueRamp, VelocityRamp
from axisbus.motion.cyclic.torque import CyclicTorqueMove
from axisbus.motion.cyclic.velocity import CyclicVelocityMove
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.parameters import AxisParameters
from axisbus.wording import counted

_FIRST = 1.0  # seconds within which the first output must come


class ControllerOutputBuffer:
    """Holds the newest output of a controller, and the times of the last cycles; the oldest of them limits its age."""

    def __init__(self, command: ControllerCommand, name: str) -> None:
        """``name``: of the axis."""
        self._number, self._late, self._name = command.number, command.max_missed_cycles, name
        self._cycles: deque[float] = deque(maxlen=command.max_missed_cycles + 1)
        self._since: float | None = None
        self._newest: ControllerOutput | None = None

    @property
    def newest(self) -> int | None:
        """The newest output; None before the first one and after the controller has failed."""
        return None if self._newest is None or self._newest.failure else self._newest.value

    def take(self, output: ControllerOutput) -> bool:
        """Accept an output; return whether it belongs to this controller."""
        if output.number != self._number:
            return False
        if self._newest is None or output.cycle > self._newest.cycle or output.failure:
            self._newest = output
        return True

    def due(self, now: float) -> int | None:
        """Return the output to use in the cycle at ``now`` (s); None if there is none yet.

        Raises:
            CommandError: the controller has failed, has not begun within 1 s, or its output is too old.
        """
        self._since = now if self._since is None else self._since
        oldest = self._cycles[0] if self._cycles else -math.inf
        self._cycles.append(now)
        newest = self._newest
        if newest is None:
            if now - self._since > _FIRST:
                raise self._never()
            return None
        if newest.failure:
            raise self._failed(newest.failure)
        if newest.cycle < oldest:
            raise self._too_late(now - newest.cycle)
        return newest.value

    def _never(self) -> CommandError:
        return CommandError(
            f"{self._name}: its controller has given no first answer",
            observed=f"no answer within {_FIRST:g} s",
            remedy="see whether the function of the controller returns",
        )

    def _failed(self, failure: str) -> CommandError:
        return CommandError(
            f"{self._name}: its controller has failed: {failure}",
            remedy="correct the function of the controller",
        )

    def _too_late(self, age: float) -> CommandError:
        return CommandError(
            f"{self._name}: its controller answered too late",
            observed=f"the newest answer belongs to values that are {age * 1e3:.1f} ms old; at most "
            f"{counted(self._late + 1, 'cycle')} are allowed",
            remedy="let the function do less, give the program more processor time (its threads wait for each other), or "
            "set a longer scan_period, or max_missed_cycles = ... (further cycles for which the last answer stays valid)",
        )


class ControlledVelocityMove(CyclicVelocityMove):
    """An axis at the velocity of a user's controller; the command never ends as done."""

    def __init__(
        self,
        command: ControllerCommand,
        parameters: AxisParameters,
        gate: StartBarrier,
        before: VelocityRamp | None = None,
    ) -> None:
        """As ``CyclicVelocityMove``; an axis that moves already keeps its velocity until the first output."""
        assert isinstance(command.by, CyclicVelocity)
        self.output_buffer = ControllerOutputBuffer(command, parameters.name)
        by = command.by if before is None else replace(command.by, velocity=round(before.velocity))
        super().__init__(by, parameters, gate, before)

    def take(self, output: ControllerOutput) -> bool:
        """Accept an output; return whether it belongs to this controller."""
        if not self.output_buffer.take(output):
            return False
        velocity = self.output_buffer.newest
        if self._mode_entry is None and velocity is not None:
            self.aim(replace(self._command, velocity=velocity))
        return True

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Advance by one cycle; never True."""
        if self._mode_entry is None:
            self.output_buffer.due(image.now)
        super().step(image, order)
        return False

    def _watch(self, image: AxisImage, _ramp: VelocityRamp) -> None:
        self._check_resistance(image)


class ControlledTorqueMove(CyclicTorqueMove):
    """An axis at the torque of a user's controller; the command never ends as done."""

    def __init__(
        self,
        command: ControllerCommand,
        parameters: AxisParameters,
        gate: StartBarrier,
        before: TorqueRamp | None = None,
    ) -> None:
        """As ``CyclicTorqueMove``; the axis keeps its torque until the first output."""
        assert isinstance(command.by, CyclicTorque)
        self.output_buffer = ControllerOutputBuffer(command, parameters.name)
        by = command.by if before is None else replace(command.by, torque=round(before.torque))
        super().__init__(by, parameters, gate, before)

    def take(self, output: ControllerOutput) -> bool:
        """Accept an output; return whether it belongs to this controller."""
        return self.output_buffer.take(output)

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Advance by one cycle; never True."""
        if self._mode_entry is None:
            torque = self.output_buffer.due(image.now)
            if torque is not None:
                self.aim(replace(self._command, torque=torque))
        super().step(image, order)
        return False

    def _active_ramp(self, image: AxisImage) -> TorqueRamp:
        is_first = self._ramp is None
        ramp = super()._active_ramp(image)
        if is_first:
            self.aim(replace(self._command, torque=round(ramp.torque)))
        return ramp

    def _watch(self, _image: AxisImage, _ramp: TorqueRamp) -> None:
        """Do nothing: there is no torque to reach."""
