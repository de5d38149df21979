"""Stop all axes at shutdown: each axis that this master has commanded is stopped, then monitored until it is seen at rest.

Theory of operation
-------------------
A requested stop is not yet a completed stop. The stop sequence of an axis ends with its own result. A fault ends the sequence
earlier, and a drive without power may still coast. So after the end of the stop sequence, the axis is monitored until its drive is
off (or holds the axis, if that was requested) and its position is at standstill. The time limit is the total time of the steps of
the stop sequence. If standstill is not seen by then, the axis is reported as moving. For a drive with neither position nor
velocity, no check is possible, and the drive is trusted.
"""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.cia402 import objects
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.errors import AxisbusError, DriveError, DriveFault, one_line
from axisbus.motion.axis.accept import accept
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, unattended
from axisbus.motion.commands import HandOver, QuickStop, Shutdown
from axisbus.motion.states import MOVING, AxisState
from axisbus.motion.stop.diagnosis import join_remedies

_MAY_MOVE = ENERGISED | {PowerState.UNKNOWN}
_ALARM = "TREAT THE AXIS AS MOVING: use the emergency stop; then check cable and drive"


class AxisShutdown:
    """Shutdown of one axis; holds its ticket, the time until which it is monitored, and the error to report."""

    def __init__(self, core: AxisCore, command: Shutdown, now: float) -> None:
        """Request the stop of the axis."""
        self.over = False
        self.error: AxisbusError | None = None
        self._core = core
        self._ticket = CommandStatus(f"{core.parameters.name}.stop ({command.reason})")
        self._since = now
        self._until = now + core.parameters.stop_times.stop_sequence
        accept(core, command, self._ticket)

    def step(self, now: float) -> None:
        """Check whether the axis is at rest, or its time is over."""
        if self.over or self._ticket.busy:
            return
        error = self._ticket.error
        if self._unsure(error) or self._seen_at_rest:
            self._end(error)
        elif now > self._until:
            self._end(self._moving(error))

    @property
    def error_so_far(self) -> AxisbusError | None:
        """The error to report so far."""
        return self.error if self.over else self._ticket.error

    @property
    def final_error(self) -> AxisbusError | None:
        """The error to report if the monitoring ends now."""
        return self.error if self.over or self._ticket.busy else self._moving(self._ticket.error)

    def _unsure(self, error: AxisbusError | None) -> bool:
        """Whether the stop sequence itself ended without a certain result, or the scan has ended: further monitoring is useless."""
        return error is not None and not isinstance(error, DriveFault) and not self._core.stop_confirmed

    @property
    def _seen_at_rest(self) -> bool:
        core = self._core
        if not core.touched:
            return True
        image = core.image
        if image.state in _MAY_MOVE and not core.stop_confirmed:
            return False
        if image.position is None:
            if image.velocity is not None:
                return not image.velocity
            return core.stop_confirmed or not core.parameters.has(objects.POSITION_ACTUAL)
        seen_since = (
            core.stop_confirmed or image.position_stamp >= self._since
        )  # an earlier position proves nothing
        return image.standstill and seen_since

    def _end(self, error: AxisbusError | None) -> None:
        self.over, self.error = True, error

    def _moving(self, error: AxisbusError | None) -> AxisbusError:
        """Return the error of an axis that is not seen at rest although the time of its stop sequence is over."""
        name, image = self._core.parameters.name, self._core.image
        before = "" if error is None else f"{one_line(error, alarm=False)}; "
        return DriveError(
            f"{name}: the stop of the axis could not be confirmed",
            axis=name,
            observed=f"{before}when the time of its stop sequence was over: state {image.state.value!r}, standstill not "
            "observed",
            remedy=join_remedies(_ALARM, "" if error is None else error.remedy),
        )


class ShutdownStop:
    """The requested shutdown; holds its axes, and the errors of these axes from an earlier request."""

    def __init__(self) -> None:
        self._axes: list[AxisShutdown] = []
        self._earlier_errors: list[AxisbusError] = []

    def begin(self, cores: Mapping[str, AxisCore], command: Shutdown, now: float) -> None:
        """Start the stop sequence on every axis that this master has commanded; a repeated request makes the stop harder."""
        self._earlier_errors += [axis.error_so_far for axis in self._axes if axis.error_so_far is not None]
        self._axes = [AxisShutdown(core, command, now) for core in cores.values()]

    def step(self, now: float) -> None:
        """Check the axes; called once per cycle, after the axes."""
        for axis in self._axes:
            axis.step(now)

    @property
    def over(self) -> bool:
        """Whether the shutdown of every axis has ended."""
        return all(axis.over for axis in self._axes)

    def failures(self) -> list[AxisbusError]:
        """Return why axes could not be stopped as requested, for the end of the monitoring; empty if all were stopped."""
        last = [axis.final_error for axis in self._axes]
        return [
            *self._earlier_errors,
            *(error for error in last if error is not None and error not in self._earlier_errors),
        ]


# -- Halt every axis that this master has commanded, after its program was interrupted; the axes stay enabled ----------
#
# The program continues.


class Halting:
    """Holds the number of the last interrupt, and the tickets of its halts."""

    def __init__(self) -> None:
        self._last = 0
        self._tickets: list[CommandStatus] = []

    def begin(self, cores: Mapping[str, AxisCore], reason: str, number: int) -> None:
        """Halt every axis that was set in motion; if halts of an earlier interrupt still run, do a quick stop of all.

        ``number`` identifies the interrupt, because one interrupt may be reported twice; 0 identifies none.
        """
        again = 0 not in (number, self._last) and number != self._last
        harder = again and any(ticket.busy for ticket in self._tickets)
        self._last = number or self._last
        self._tickets = [ticket for ticket in self._tickets if ticket.busy]
        for name, core in cores.items():
            ticket = unattended(f"{name}.quick_stop()" if harder else f"{name}.halt()")
            moves = core.touched and (core.state in MOVING or core.state is AxisState.STOPPING)
            why = f"{name} was halted: {reason}"
            accept(core, QuickStop() if harder and moves else HandOver(why), ticket)
            self._tickets.append(ticket)
