"""The way out of all axes: every one that this program has commanded is stopped, and looked at until it is seen at rest.

Theory of operation
-------------------
A stop that was asked for is not one that has happened. The stop ladder of an axis ends with its own verdict; a fault ends it before
that, and a drive that is off may still coast. So once the ladder is over, the axis is looked at until its drive is off (or holds,
as it was asked to) and its position stands, within the time that the ladder's rungs have together. What is not seen by then is told
as moving. A drive that has neither position nor velocity can only be believed.
"""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.cia402 import objects
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.errors import AxisbusError, DriveError, DriveFault, one_line
from axisbus.motion.axis.accept import accept
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.commands import Shutdown
from axisbus.motion.stop.diagnosis import join_remedies

_MAY_MOVE = ENERGISED | {PowerState.UNKNOWN}
_ALARM = "TREAT THE AXIS AS MOVING: use the emergency stop; then check cable and drive"


class AxisLeaving:
    """One axis on its way out; holds its ticket, until when it is looked at, and what is to be told of it."""

    def __init__(self, core: AxisCore, command: Shutdown, now: float) -> None:
        """Ask the axis to stop."""
        self.over = False
        self.error: AxisbusError | None = None
        self._core = core
        self._ticket = CommandStatus(f"{core.parameters.name}.stop ({command.reason})")
        self._since = now
        self._until = now + core.parameters.stop_times.ladder
        accept(core, command, self._ticket)

    def step(self, now: float) -> None:
        """See whether it is at rest, or its time is over."""
        if self.over or self._ticket.busy:
            return
        error = self._ticket.error
        if self._unsure(error) or self._seen_at_rest:
            self._end(error)
        elif now > self._until:
            self._end(self._moving(error))

    @property
    def told(self) -> AxisbusError | None:
        """What is to be told of it so far."""
        return self.error if self.over else self._ticket.error

    @property
    def verdict(self) -> AxisbusError | None:
        """What is to be told of it when nobody looks any longer."""
        return self.error if self.over or self._ticket.busy else self._moving(self._ticket.error)

    def _unsure(self, error: AxisbusError | None) -> bool:
        """Whether the ladder itself says that nobody knows, or the scan has ended: looking on brings no more."""
        return error is not None and not isinstance(error, DriveFault) and not self._core.stopped_for_sure

    @property
    def _seen_at_rest(self) -> bool:
        core = self._core
        if not core.touched:
            return True
        image = core.image
        if image.state in _MAY_MOVE and not core.stopped_for_sure:
            return False
        if image.position is None:
            if image.velocity is not None:
                return not image.velocity
            return core.stopped_for_sure or not core.parameters.has(objects.POSITION_ACTUAL)
        seen_since = (
            core.stopped_for_sure or image.position_stamp >= self._since
        )  # one of before says nothing
        return image.standstill and seen_since

    def _end(self, error: AxisbusError | None) -> None:
        self.over, self.error = True, error

    def _moving(self, error: AxisbusError | None) -> AxisbusError:
        """The ladder had its time, and the axis is not seen at rest."""
        name, image = self._core.parameters.name, self._core.image
        before = "" if error is None else f"{one_line(error, alarm=False)}; "
        return DriveError(
            f"{name}: could not be confirmed as stopped",
            axis=name,
            observed=f"{before}when the time of its stop ladder was over: state {image.state.value!r}, standstill not seen",
            remedy=join_remedies(_ALARM, "" if error is None else error.remedy),
        )


class ShutdownStop:
    """The way out that has been asked for; holds the axes on it, and what was told of them by an earlier request."""

    def __init__(self) -> None:
        self._axes: list[AxisLeaving] = []
        self._told: list[AxisbusError] = []

    def begin(self, cores: Mapping[str, AxisCore], command: Shutdown, now: float) -> None:
        """Let the stop ladder run on every axis that this program has commanded; asked for again, it becomes harder."""
        self._told += [axis.told for axis in self._axes if axis.told is not None]
        self._axes = [AxisLeaving(core, command, now) for core in cores.values()]

    def step(self, now: float) -> None:
        """Once per cycle, after the axes."""
        for axis in self._axes:
            axis.step(now)

    @property
    def over(self) -> bool:
        """Whether every axis has come to its end."""
        return all(axis.over for axis in self._axes)

    def failures(self) -> list[AxisbusError]:
        """Return why axes could not be stopped as asked, for when nobody looks any longer; empty when all went well."""
        last = [axis.verdict for axis in self._axes]
        return [*self._told, *(error for error in last if error is not None and error not in self._told)]
