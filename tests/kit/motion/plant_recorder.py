"""A witness beside the rig: the motion of the plant and the outputs to it, cycle by cycle."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

from axisbus.cia402.port import Outputs
from kit.motion.rig import PERIOD, Rig

# Transitions by the states before and after, from the figure of CiA 402-2 7.2; S: the simulated drive's numbers of its states.
NOT_READY, DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, REACTION, FAULT = range(8)
TRANSITION = {
    (NOT_READY, DISABLED): [1],
    (DISABLED, READY): [2],
    (READY, SWITCHED_ON): [3],
    (SWITCHED_ON, ENABLED): [4],
    (ENABLED, SWITCHED_ON): [5],
    (SWITCHED_ON, READY): [6],
    (READY, DISABLED): [7],
    (ENABLED, READY): [8],
    (ENABLED, DISABLED): [9],
    (SWITCHED_ON, DISABLED): [10],
    (ENABLED, QUICK_STOP): [11],
    (QUICK_STOP, DISABLED): [12],
    (FAULT, DISABLED): [15],
    (QUICK_STOP, ENABLED): [16],
    **{(state, REACTION): [13] for state in range(6)},
    **{(state, FAULT): [13, 14] for state in range(6)},
    (REACTION, FAULT): [14],
}
ENABLE_BITS = 0x0F
FAULT_RESET = 0x80
HALT = 0x100


class Row(NamedTuple):
    """The plant after some time has passed."""

    t: float
    position: float
    velocity: float
    stage: int
    torque: float


class Sent(NamedTuple):
    """The outputs to the port in the cycle at ``t``."""

    t: float
    outputs: Outputs


class Watch:
    """Follows one drive from now on: ``rows`` of the plant, ``sent`` to the port."""

    def __init__(self, rig: Rig, name: str | None = None) -> None:
        self.rig = rig
        name = name or rig.axis.name
        self.drive = rig.drive_of(name)
        self.rows: list[Row] = []
        self.sent: list[Sent] = []
        self._wrap(rig.cycle, rig.ports[name])
        self._note()

    def _wrap(self, cycle, port) -> None:
        wait_until, write = cycle.wait_until, port.write

        def watched_wait(t: float) -> None:
            wait_until(t)
            self._note()

        def watched_write(outputs: Outputs) -> None:
            self.sent.append(Sent(cycle.now(), outputs))
            write(outputs)

        cycle.wait_until, port.write = watched_wait, watched_write

    def _note(self) -> None:
        motor = self.drive.axis.motor
        self.rows.append(
            Row(
                self.rig.cycle.now(),
                motor.position,
                motor.velocity,
                int(self.drive.power.stage),
                motor.torque,
            )
        )

    def forget(self) -> Watch:
        """Begin again."""
        self.rows, self.sent = [], []
        self._note()
        return self

    # The motion of the plant.

    @property
    def transitions(self) -> list[int]:
        """Numbers of the power stage's transitions, in order."""
        return [
            number
            for a, b in pairwise(self.rows)
            if a.stage != b.stage
            for number in TRANSITION[a.stage, b.stage]
        ]

    @property
    def displacement(self) -> float:
        """The farthest that the motor was from where the watch began, in increments."""
        start = self.rows[0].position
        return max(abs(row.position - start) for row in self.rows)

    @property
    def travel(self) -> tuple[float, float]:
        """The least and the greatest position, in increments."""
        positions = [row.position for row in self.rows]
        return min(positions), max(positions)

    @property
    def speed(self) -> float:
        """The greatest speed, in increments/s."""
        return max(abs(row.velocity) for row in self.rows)

    def acceleration(self, cycles: int = 1) -> float:
        """The greatest change of velocity per second, over so many scan periods (positions are whole increments)."""
        rows = self.rows
        return max(
            abs(b.velocity - a.velocity) / (b.t - a.t)
            for a, b in zip(rows, rows[cycles:], strict=False)
            if b.t - a.t > PERIOD / 2
        )

    def moving(self, threshold: float = 20.0) -> tuple[float, float]:
        """When the motor began to move and when it came to rest, in seconds."""
        times = [row.t for row in self.rows if abs(row.velocity) > threshold]
        return times[0] - PERIOD, times[-1] + PERIOD

    def stage_times(self, stage: int) -> list[float]:
        """When the power stage came into a state."""
        return [b.t for a, b in pairwise(self.rows) if b.stage == stage and a.stage != stage]

    # The sent outputs.

    @property
    def words(self) -> list[int]:
        """The controlwords, without repetitions."""
        every = [item.outputs.controlword for item in self.sent if item.outputs.controlword is not None]
        return [word for number, word in enumerate(every) if number == 0 or every[number - 1] != word]

    @property
    def targets(self) -> list[int]:
        """The target positions, in every cycle that sent one."""
        return [
            item.outputs.target_position for item in self.sent if item.outputs.target_position is not None
        ]

    @property
    def modes(self) -> list[int]:
        """The modes that were asked for, without repetitions."""
        every = [int(item.outputs.mode) for item in self.sent if item.outputs.mode is not None]
        return [mode for number, mode in enumerate(every) if number == 0 or every[number - 1] != mode]

    @property
    def writes(self) -> list[tuple[int, int, int]]:
        """The SDO writes as (index, sub-index, value), in order."""
        return [
            (request.index, request.subindex, request.value)
            for item in self.sent
            for request in item.outputs.sdo
            if request.value is not None
        ]
