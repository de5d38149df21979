"""The running stop of one axis: its stop sequence, its kind, its reason, the tickets that wait for it, and its result."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum

from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.errors import AxisbusError, DriveError
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.moves.activity import Activity
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.stop.stop_sequence import AfterStop, StopLevel, StopSequence

_MAYBE_ENERGISED = ENERGISED | {PowerState.UNKNOWN}


class StopKind(IntEnum):
    """Why the stop sequence runs; higher is stronger."""

    HALT = 0
    POLICY = 1
    STOP = 2
    DISABLE = 3
    QUICK_STOP = 4
    ERROR = 5
    SHUTDOWN = 6


# Remedy for a command that a stop has ended; none if the stop was requested for this axis.
REMEDIES = {
    StopKind.POLICY: "first clear the error of the axis that failed (its error has the remedy); this axis accepts "
    "commands again at standstill; if its stop has taken its power (it is Disabled), enable it: axis.enable()",
}


# Missing reaction of the drive when a time of [axes.NAME.stop] has passed, and the objects that define the reaction.
_TOO_SLOW = {
    "halt_time": "did not come to standstill on a halt in time (605Dh, 6084h)",
    "quick_stop_time": "did not come to standstill on a quick stop in time (605Ah, 6085h)",
    "disable_time": "did not switch off in time (605Bh, 605Ch, its brake)",
}


class Stopping:
    """Holds the stop sequence of the running stop (None: there is none), its kind and reason, and the waiting tickets."""

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._tickets: list[CommandStatus] = []
        self._resets: list[
            tuple[CommandStatus, Callable[[], None]]
        ] = []  # each with the function that begins it after the stop
        self.stop_sequence: StopSequence | None = None
        self.kind = StopKind.HALT
        self.locks = False  # MC_Stop was requested: the axis stays in Stopping
        self.reason = ""
        self.power_note = ""  # why the last stop took the power of an axis that was to keep it
        self.motion_requested_at = -math.inf  # when motion was last requested from the drive

    @property
    def name(self) -> str:
        """The name of the running stop, for the user."""
        return self._tickets[0].name if self._tickets else f"{self._parameters.name}'s stop"

    @property
    def interruptible(self) -> bool:
        """Whether a new motion command may interrupt the stop: a halt that has not become a harder stop."""
        return self.stop_sequence is None or (
            self.kind is StopKind.HALT and self.stop_sequence.level is StopLevel.HALT
        )

    @property
    def explained(self) -> str:
        """The reason of the running stop, and its steps if it has become harder than it began."""
        if self.stop_sequence is None or len(self.stop_sequence.path) == 1:
            return self.reason
        return f"{self.reason}; {_steps(self.stop_sequence)}"

    def ask(
        self,
        kind: StopKind,
        then: AfterStop,
        level: StopLevel,
        reason: str,
        ticket: CommandStatus | None,
        ended_activity: Activity | None = None,
    ) -> None:
        """Begin to stop, or make the running stop as hard as this one; a step that continues gets no more time.

        ``ended_activity``: the command that has just ended; the axis brakes along the trajectory of this command.
        """
        if ticket is not None:
            self.join(ticket)
        self.locks = self.locks or kind is StopKind.STOP
        if self.stop_sequence is None:
            self.power_note = ""
            self.stop_sequence = self._make_stop_sequence(then, level, ended_activity)
            self.kind, self.reason = kind, reason
            return
        self.stop_sequence.harden(then, level)
        if kind >= self.kind:
            self.kind, self.reason = kind, reason

    def _make_stop_sequence(
        self, then: AfterStop, level: StopLevel, ended_activity: Activity | None
    ) -> StopSequence:
        if ended_activity is None:
            return StopSequence(
                self._parameters, then, start=level, motion_requested_at=self.motion_requested_at
            )
        return StopSequence(
            self._parameters,
            then,
            start=level,
            follow=ended_activity.set_point_source,
            pending_mode_switch=ended_activity.pending_mode_switch,
            commanded=ended_activity.commanded,
            resisted_since=ended_activity.resisted_since,
            motion_requested_at=self.motion_requested_at,
        )

    def join(self, ticket: CommandStatus) -> None:
        """Let ``ticket`` end when the stop ends."""
        self._tickets.append(ticket)
        ticket.begin()

    def add_reset(self, ticket: CommandStatus, begin: Callable[[], None]) -> None:
        """Add a reset that waits for the end of the stop."""
        self._resets.append((ticket, begin))
        ticket.begin()

    @property
    def has_resets(self) -> bool:
        """Whether a reset waits."""
        return bool(self._resets)

    def begin_resets(self) -> None:
        """Begin the waiting resets: the stop has ended."""
        resets, self._resets = self._resets, []
        for _, begin in resets:
            begin()

    def drop_resets(self) -> list[CommandStatus]:
        """Discard the waiting resets; return their tickets."""
        tickets, self._resets = [ticket for ticket, _ in self._resets], []
        return tickets

    def drop(self) -> list[CommandStatus]:
        """Discard the stop; return the tickets that waited for it."""
        tickets, self._tickets = self._tickets, []
        self.stop_sequence, self.locks = None, False
        return tickets


def stop_error(stop_sequence: StopSequence, name: str) -> AxisbusError | None:
    """Return the error of a stop sequence that has ended; None if the axis stopped as requested."""
    if stop_sequence.confirmed and not stop_sequence.escalated:
        return None
    seen = _seen(stop_sequence)
    if not stop_sequence.confirmed:
        return DriveError(
            f"{name}: the stop of the axis could not be confirmed",
            axis=name,
            observed=f"{seen}, standstill not observed",
            remedy="TREAT THE AXIS AS MOVING: use the emergency stop; then check cable and drive",
        )
    if stop_sequence.removes_power and stop_sequence.seen in _MAYBE_ENERGISED:
        return DriveError(
            f"{name}: the axis is at standstill, but its drive could not be switched off",
            axis=name,
            observed=seen,
            remedy="TREAT THE AXIS AS ENERGISED: cut its supply; then find out why the drive does not obey",
        )
    if stop_sequence.power_left_on:
        return DriveError(
            f"{name}: the axis is at standstill, but its drive did not execute the quick stop",
            axis=name,
            observed=seen,
            remedy=f"find out why the drive {_TOO_SLOW['quick_stop_time']}, or raise quick_stop_time in [axes.{name}.stop]; "
            "it is still energised",
        )
    if stop_sequence.blocked:
        return DriveError(
            f"{name}: the axis was blocked during a move",
            axis=name,
            observed=seen,
            remedy="remove the obstacle before the axis gets power again; it was stopped with a quick stop, so it cannot "
            "jump when it comes free",
        )
    if not stop_sequence.late:
        return None  # only the statusword was missing, and all required actions have happened
    return DriveError(
        f"{name}: the axis stopped only by a harder stop than was commanded",
        axis=name,
        observed=seen,
        remedy=_remedy_for_late(stop_sequence, name),
    )


def power_note(stopping: Stopping) -> str:
    """Return why a stop that has ended took the power of an axis that was to keep it; empty if it did not."""
    stop_sequence = stopping.stop_sequence
    if stop_sequence is None or not stop_sequence.removed_power or stopping.kind is StopKind.QUICK_STOP:
        return ""
    if stop_sequence.statusword_missing:
        why = "its statusword (6041h) was missing during the halt, so that only a quick stop was safe"
    elif StopLevel.QUICK_STOP in stop_sequence.path:
        why = "it was stopped by a quick stop, after which its drive switches off (605Ah)"
    else:
        why = "its drive switched off by itself during the halt"
    return f"the last stop ({stopping.reason}) took its power: {why}; {_seen(stop_sequence)}"


def _remedy_for_late(stop_sequence: StopSequence, name: str) -> str:
    raised = f"raise {' and '.join(stop_sequence.late)} in [axes.{name}.stop]"
    if stop_sequence.on_its_path and stop_sequence.late == ["halt_time"]:
        return (
            "braking along its path took longer than halt_time: command a higher acceleration or a lower velocity, or "
            f"{raised}"
        )
    return f"find out why the drive {' and '.join(_TOO_SLOW[key] for key in stop_sequence.late)}, or {raised}"


def _seen(stop_sequence: StopSequence) -> str:
    texts = [_steps(stop_sequence)]
    if stop_sequence.late:
        texts.append(f"passed: {', '.join(stop_sequence.late)}")
    texts += [text for text in (stop_sequence.missing_condition, stop_sequence.coasting_text) if text]
    if stop_sequence.power_left_on:
        texts.append("its power remains on because it holds a load")
    texts.append(f"state {stop_sequence.seen.value!r}")
    return "; ".join(texts)


def _steps(stop_sequence: StopSequence) -> str:
    return "stop sequence: " + " > ".join(level.text for level in stop_sequence.path)
