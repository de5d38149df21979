"""A move that is halted when a touch probe has latched an edge: the input is armed, then the axis moves, then it halts.

Theory of operation
-------------------
The search consists of commands of the axis: a probe, a move that waits at a barrier until the input is armed, and a halt. So any
other command to the axis meanwhile (a halt, another move, a stop by policy) affects the move as usual, and ends the search. The
axis brakes by its own halt.
"""

from __future__ import annotations

from axisbus.errors import AxisbusError, ProbeError
from axisbus.motion import commands as c
from axisbus.motion.axis.accept import accept
from axisbus.motion.axis.accept_motion import require_motion, require_rest
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, Status, broken, end_as, unattended
from axisbus.motion.group.commands import ProbeMove
from axisbus.motion.group.start_barrier import StartBarrier


class ProbeSearch:
    """Holds the ticket of the search, and those of its axis commands; stepped once per cycle, before the axis."""

    motion = None  # it provides no set-points itself

    def __init__(self, ticket: CommandStatus, core: AxisCore, command: ProbeMove) -> None:
        self._ticket, self._core, self._command = ticket, core, command
        self._gate = StartBarrier()
        self._probe = CommandStatus(f"{ticket.name} [probe]", self._on_probe)
        self._move = CommandStatus(f"{ticket.name} [move]")
        self._halt: CommandStatus | None = None
        self._edge_seen = False
        self._arrived_at = 0.0  # when the move had ended

    def begin(self) -> None:
        """Arm the input, and let the move wait for that.

        Raises:
            StateError: the axis accepts no motion command, or is not at standstill.
        """
        require_motion(self._core, self._ticket)
        require_rest(self._core, self._ticket)
        self._ticket.begin()
        accept(self._core, self._command.move, self._move, self._gate)
        if self._move.error is None:  # otherwise an input that was armed before stays armed
            accept(self._core, self._command.probe, self._probe)

    @property
    def busy(self) -> bool:
        """Whether the search has not ended."""
        return self._ticket.busy

    @property
    def is_over(self) -> bool:
        """Whether the search has ended."""
        return not self._ticket.busy

    @property
    def error(self) -> AxisbusError | None:
        """The error that has ended the search, or None."""
        return self._ticket.error

    @property
    def name(self) -> str:
        """The name of the command."""
        return self._ticket.name

    def step(self, _period: float) -> None:
        """Once per cycle, before the axis: start the move when the input is armed, halt it after an edge, detect the end."""
        self._gate.update(1 if self._probe.status is Status.ACTIVE else 2)  # one axis waits at the barrier
        try:
            self._go_on()
        except Exception as error:  # noqa: BLE001  # any exception ends this command and stops its axis
            self._give_up(broken(error, self.name))

    def abandon(self, error: AxisbusError) -> None:
        """End the search with ``error``: the scan has ended."""
        self._ticket.finish(Status.ERROR, error)

    def _on_probe(self, probe: CommandStatus) -> None:
        if probe.capture is not None:
            self._edge_seen = True
            self._ticket.report_capture(probe.capture)

    def _go_on(self) -> None:
        if self._halt is not None:
            if not self._halt.busy:
                self._end(self._halt.error)
        elif self._move.error is not None:  # replaced by another command, or failed
            self._end(self._move.error)
        elif self._edge_seen:
            self._halt = CommandStatus(f"{self.name} [halt]")
            accept(self._core, c.Halt(), self._halt)
        elif not self._probe.busy:
            self._give_up(
                self._probe.error
                or ProbeError(f"{self.name}: its touch probe was switched off", axis=self._command.axis)
            )
        elif not self._move.busy:
            self._wait_for_last_edge()

    def _wait_for_last_edge(self) -> None:
        """After the end of the move, wait for an edge that may not have been read yet, then end with ProbeError."""
        self._arrived_at = self._arrived_at or self._core.image.now
        if self._core.probes.last_poll_of(self._command.probe.number) <= self._arrived_at:
            return
        self._end(
            ProbeError(
                f"{self.name}: the axis has arrived, and there was no edge during the move",
                axis=self._command.axis,
                observed=f"60B9h shows none of input {self._command.probe.number}",
                remedy="check the sensor and its wiring (60FDh shows the inputs), or search farther",
            )
        )

    def _give_up(self, error: AxisbusError) -> None:
        """End with a failure of the search itself; stop the axis if it still executes the search's move."""
        self._gate.shut()
        if self._core.running.ticket is self._move:
            stop = c.PolicyStop(f"{self.name} was stopped because {error.message}")
            accept(self._core, stop, unattended(f"{self._command.axis}.stop"))
        self._end(error)

    def _end(self, error: AxisbusError | None) -> None:
        probe = self._command.probe
        accept(self._core, c.ProbeAbort(probe.number, probe.key), CommandStatus(f"{self.name} [abort]"))
        self._ticket.finish(Status.DONE if error is None else end_as(error), error)
