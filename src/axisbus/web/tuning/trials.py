"""The trials at a machine: the one that may run at a time, its supervision by its page, and the reports for pages."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass

from axisbus.client_support.dead_man import DeadMan
from axisbus.errors import AxisbusError, StateError
from axisbus.machine.handle import Handle, mark_end_as_read
from axisbus.machine.machine import Machine
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import MOVING, AxisState
from axisbus.record.columns import NAMES, AxisForm
from axisbus.record.sample_packing import sample_of
from axisbus.web.commands.authorize import PageAction
from axisbus.web.commands.request import PageRequest
from axisbus.web.tuning.outcome import TrialOutcome, outcome
from axisbus.web.tuning.step import TuningStep, TuningStepKind, question
from axisbus.web.tuning.trial import NextAction, TrialSample, TuningTrial
from axisbus.web.view import Values

MAX_OUTCOMES = 4  # finished trials whose samples may be fetched
PAGE_CLOSED, CONTROLS_LOST, SILENT, ENDED, STOPPED = (
    "its page was closed",
    "its page no longer has the controls",
    "the server received nothing from its page for 0.2 s",
    "its page has ended it",
    "it was halted, or stopped",
)


@dataclass(slots=True)
class _Running:
    """The running trial; holds its dead-man check, and the running command."""

    number: int
    page: int
    trial: TuningTrial
    deadman: DeadMan
    recording: TrialRecording
    broken: frozenset[str]  # axes that were in ErrorStop before
    handle: Handle | None = None
    reported: str = ""
    error: AxisbusError | None = None


class Trials:
    """Hold the running trial, the last results, and unread reports for pages; used by one thread.

    Times are seconds of one clock, which the caller reads.
    """

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._count = 0
        self._running: _Running | None = None
        self._outcomes: dict[int, TrialOutcome] = {}
        self._unread: dict[int, Values] = {}

    def request(
        self, page: int, action: PageAction, request: PageRequest, clock: DeadMan, now: float
    ) -> None:
        """Check a step, and ask its question, or start the trial if the question was confirmed.

        ``clock``: the known offset of the page's clock. A question carries the number that the page gave it, so that a confirmation
        belongs to the step in its text.

        Raises:
            AxisbusError: as ``question``, or another trial runs, or the confirmation came too late.
        """
        name = action.axes[0]
        step = TuningStep.of(name, action.values)
        if self._running is not None:
            raise StateError("another trial is running", remedy="wait for its end, or end it")
        facts = self._machine.session.axes[name].parameters
        text = question(step, self._machine[name], facts)
        if not request.sure:
            self._unread[page] = {"question": text, "press": request.press}
            return
        deadman = DeadMan(lag=clock.lag).beaten(request.press, name, 1.0, request.sent, now)
        if not deadman.held:
            raise StateError(
                "the confirmation of a trial came too late: nothing moves", remedy="try it again"
            )
        self._count += 1
        trial = TuningTrial(step, facts.scan_period, now)
        recording = TrialRecording(self._machine, name, step.kind)
        self._running = _Running(self._count, page, trial, deadman, recording, self._in_error())
        self._report(self._running)

    def supervise(self, page: int, request: PageRequest, now: float) -> None:
        """Note that the page still supervises its trial; a late message does not continue a trial."""
        running = self._running
        if running is not None and running.page == page:
            running.deadman = running.deadman.beaten(
                request.press, running.trial.step.axis, 1.0, request.sent, now
            )
            if not running.deadman.held:
                self._end(running, SILENT)

    def end(self, page: int, why: str) -> None:
        """Halt and end the trial of a page; harmless if it has none."""
        if self._running is not None and self._running.page == page:
            self._end(self._running, why)

    def remove_page(self, page: int) -> None:
        """Remove a closed page."""
        self.end(page, PAGE_CLOSED)
        self._unread.pop(page, None)

    def end_of(self, axes: Collection[str], verb: str) -> None:
        """End the trial of an axis that gets another command, by a halt, from which that command takes over."""
        if self._running is not None and self._running.trial.step.axis in axes:
            self._end(self._running, f"another command took over: {verb}()")

    def end_stopped(self, axes: Collection[str] | None, why: str) -> None:
        """End the trial of an axis (None: of any axis) that is halted or stopped; that stop ends its motion."""
        running = self._running
        if running is not None and (axes is None or running.trial.step.axis in axes):
            running.trial.disturb(why)
            self._close(running)

    def poll(self, now: float) -> None:
        """Advance the trial; to be called at least every 50 ms."""
        running = self._running
        if running is None:
            return
        running.trial.add_points(running.recording.take(), now)
        self._watch(running, now)
        do = running.trial.next(now)
        if do in (NextAction.GO, NextAction.RETURN):
            self._send(running, do)
        if running.trial.ended:
            self._end(running, running.trial.why)
        else:
            self._report(running)

    def unread(self, page: int) -> Values | None:
        """Return the report about its trial that a page has not received yet."""
        return self._unread.pop(page, None)

    def outcome(self, number: int) -> TrialOutcome | None:
        """Return the result of one of the last trials."""
        return self._outcomes.get(number)

    def _watch(self, running: _Running, now: float) -> None:
        handle, trial = running.handle, running.trial
        if running.deadman.silent(now):
            trial.disturb(SILENT)
        if broken := sorted(self._in_error() - running.broken):
            trial.disturb(f"{broken[0]} is in {AxisState.ERRORSTOP.value}")
        if handle is not None and not handle.busy and (error := handle.exception()) is not None:
            running.error = error
            trial.disturb(error.message)

    def _send(self, running: _Running, do: NextAction) -> None:
        step = running.trial.step
        if running.handle is not None:
            mark_end_as_read(running.handle)  # if it has not arrived, the command back replaces it
        try:
            running.handle = self._go(step) if do is NextAction.GO else self._return(step)
        except AxisbusError as error:
            running.error = error
            running.trial.disturb(error.message)

    def _go(self, step: TuningStep) -> Handle:
        axis = self._machine[step.axis]
        if step.kind is TuningStepKind.VELOCITY:
            return axis.move_velocity(step.size, acceleration=step.acceleration)
        return axis.move_relative(step.size, velocity=step.velocity, acceleration=step.acceleration)

    def _return(self, step: TuningStep) -> Handle:
        """Send the axis back from its target, not from its position: if it has not arrived, it must not pass its start."""
        axis = self._machine[step.axis]
        if step.kind is TuningStepKind.VELOCITY:
            return axis.move_velocity(0.0, acceleration=step.acceleration)
        return axis.move_additive(-step.size, velocity=step.velocity, acceleration=step.acceleration)

    def _end(self, running: _Running, why: str) -> None:
        """End the trial; halt the axis unless it does not move and no command runs."""
        if why:
            running.trial.disturb(why)
        axis = self._machine[running.trial.step.axis]
        if (running.handle is not None and running.handle.busy) or axis.snapshot.state in MOVING:
            mark_end_as_read(axis.halt())
        self._close(running)

    def _close(self, running: _Running) -> None:
        running.recording.end()
        if running.handle is not None:
            mark_end_as_read(running.handle)
        self._running = None
        parameters = self._machine.session.axes[running.trial.step.axis].parameters
        self._outcomes[running.number] = finished = outcome(
            running.number, running.trial, parameters, running.error
        )
        for old in list(self._outcomes)[:-MAX_OUTCOMES]:
            del self._outcomes[old]
        self._unread[running.page] = finished.report

    def _report(self, running: _Running) -> None:
        phase = running.trial.phase.value
        if phase != running.reported:
            running.reported = phase
            self._unread[running.page] = {
                "number": running.number,
                "axis": running.trial.step.axis,
                "phase": phase,
            }

    def _in_error(self) -> frozenset[str]:
        snapshots = self._machine.session.snapshots
        return frozenset(name for name in snapshots if snapshots[name].state is AxisState.ERRORSTOP)


# -- Record every cycle of one axis during a trial: the core's thread adds samples, the page's thread takes them -------


_MAX_WAITING = 1 << 16  # the most waiting cycles; beyond that the oldest are dropped, which shows as a gap
_ACTUAL = {kind: NAMES.index(kind.value) for kind in TuningStepKind}
_TARGET, _DEMAND, _ERROR = (NAMES.index(name) for name in ("target", "demand", "following_error"))


class TrialRecording:
    """Hold the cycles of an axis that were not taken yet, from construction until ``end``."""

    def __init__(self, machine: Machine, axis: str, kind: TuningStepKind) -> None:
        self._session = machine.session
        self._axis = axis
        self._actual = _ACTUAL[kind]
        self._form = AxisForm.of(self._session.axes[axis].parameters)
        self._waiting: deque[tuple[float, Snapshot]] = deque(maxlen=_MAX_WAITING)
        self._session.observe(self._add)

    def take(self) -> list[TrialSample]:
        """Return the cycles since the last call, oldest first."""
        found = []
        with suppress(IndexError):
            while True:
                found.append(self._point(*self._waiting.popleft()))
        return found

    def end(self) -> None:
        """Stop recording."""
        self._session.forget(self._add)

    def _add(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        if self._axis in snapshots:
            self._waiting.append((now, snapshots[self._axis]))

    def _point(self, now: float, snapshot: Snapshot) -> TrialSample:
        row = self._form.values(sample_of(snapshot))
        clients = (self._actual, _TARGET, _DEMAND, _ERROR)
        return TrialSample(now, snapshot.state, *(_number(row[client]) for client in clients))


def _number(value: object) -> float:
    return float(value) if isinstance(value, float | int) else math.nan
