"""A trial from its request to its end, as a state machine: takes cycles and times, returns the next action; no I/O, no clock.

Theory of operation
-------------------
A trial begins when the axis is seen at standstill. The axis is sent there and observed for the step's seconds, from the cycle in
which it is seen to move: its demand changes, or it has moved by 2 % of the step. Earlier cycles belong to the transmission of the
command, such as a change of mode by SDO. Then the axis is sent back and observed for as long. Meanwhile it must be in the state of
its motion or at standstill. Any other observation (another state, a second motion, a gap, an unknown value, no cycle at all)
disturbs the trial: it is over, and it has no figures.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

from axisbus.motion.states import AxisState
from axisbus.step_response import BAND
from axisbus.web.tuning.step import TuningStep, TuningStepKind

START = 3.0  # s from a command until the axis is seen to move
NO_CYCLE_TIME = 0.5  # s without any cycle
GAP = 3.5  # periods between two cycles; with more, cycles are missing


class TrialPhase(Enum):
    """The phase of a trial."""

    ASKED = "asked"
    THERE = "there"
    BACK = "back"
    OVER = "over"


class NextAction(Enum):
    """The next action."""

    WAIT = "wait"
    GO = "go there"
    RETURN = "go back"
    END = "end"


class TrialSample(NamedTuple):
    """The axis in one cycle, in its units; NaN is unknown. ``actual`` is the actual value of the step's quantity."""

    time: float
    state: AxisState
    actual: float
    target: float
    demand: float
    error: float


_MOTION = {
    TuningStepKind.POSITION: AxisState.DISCRETE_MOTION,
    TuningStepKind.VELOCITY: AxisState.CONTINUOUS_MOTION,
}


class TrialSide:
    """One direction of a trial; holds its points, and when it was seen to begin."""

    def __init__(self, sent: TrialSample) -> None:
        """``sent`` is the last point before the command."""
        self.sent = sent
        self.points = [sent]
        self.started: float | None = None
        self.arrived = False


class TuningTrial:
    """One trial; holds its phase and points. ``why`` is the reason of a disturbance, empty if there was none."""

    def __init__(self, step: TuningStep, period: float, now: float) -> None:
        """``period`` is the cycle period in s; ``now`` is a time of the clock of ``add_points`` and ``next``, not of the points."""
        self.step = step
        self.phase = TrialPhase.ASKED
        self.sides: dict[TrialPhase, TrialSide] = {}
        self.why = ""
        self._gap = GAP * period
        self._seconds = step.seconds - 0.5 * period
        self._last_cycle = now
        self._last: TrialSample | None = None

    @property
    def ended(self) -> bool:
        """Whether it has ended, successfully or not."""
        return self.phase is TrialPhase.OVER

    def disturb(self, why: str) -> None:
        """End the trial because of a disturbance; the first reason is stored."""
        if not self.ended:
            self.phase, self.why = TrialPhase.OVER, why

    def add_points(self, points: Iterable[TrialSample], now: float) -> None:
        """Process the cycles since the last call."""
        for point in points:
            self._last_cycle = now
            if not self.ended:
                self._follow(point)
            self._last = point

    def next(self, now: float) -> NextAction:
        """Return the next action; going there, going back and the end are each returned once."""
        if self.ended:
            return NextAction.WAIT
        if now - self._last_cycle > NO_CYCLE_TIME:
            self.disturb(f"no cycle of the axis was seen for {NO_CYCLE_TIME:g} s")
        elif self._last is not None and self.phase is TrialPhase.ASKED:
            return self._send(TrialPhase.THERE, self._last, NextAction.GO)
        elif self._last is not None:
            return self._next_of_side(self.sides[self.phase], self._last)
        return NextAction.WAIT

    def _next_of_side(self, side: TrialSide, last: TrialSample) -> NextAction:
        if side.started is None:
            if last.time - side.sent.time > START:
                self.disturb(f"the axis did not start within {START:g} s")
            return NextAction.WAIT
        if last.time - side.started < self._seconds:
            return NextAction.WAIT
        if self.phase is TrialPhase.THERE:
            return self._send(TrialPhase.BACK, last, NextAction.RETURN)
        self.phase = TrialPhase.OVER
        return NextAction.END

    def _send(self, phase: TrialPhase, last: TrialSample, do: NextAction) -> NextAction:
        self.phase = phase
        self.sides[phase] = TrialSide(last)
        return do

    def _follow(self, point: TrialSample) -> None:
        gap = 0.0 if self._last is None else point.time - self._last.time
        if gap > self._gap:
            self.disturb(f"cycles are missing: {gap * 1000:.0f} ms between two of them")
        elif math.isnan(point.actual):
            self.disturb(f"the {self.step.kind.value} of the axis is not known")
        elif self.phase is TrialPhase.ASKED:
            if point.state is not AxisState.STANDSTILL:
                self.disturb(f"the axis was in {point.state.value}")
        else:
            self._go_on(self.sides[self.phase], point)

    def _go_on(self, side: TrialSide, point: TrialSample) -> None:
        side.points.append(point)
        if point.state is _MOTION[self.step.kind]:
            if side.arrived:
                self.disturb("the axis moved again, without a command")
            elif side.started is None and self._has_started(side, point):
                side.started = point.time
        elif point.state is not AxisState.STANDSTILL:
            self.disturb(f"the axis changed to {point.state.value}")
        elif side.started is not None:
            side.arrived = True
            if self.step.kind is TuningStepKind.VELOCITY:
                self.disturb("the axis came to rest")

    def _has_started(self, side: TrialSide, point: TrialSample) -> bool:
        """Return whether the axis moves because of the new command: its demand changes, or its actual value has.

        If the axis had not arrived when it was sent back, the change of its target shows that the new command is active.
        """
        sent, position = side.sent, self.step.kind is TuningStepKind.POSITION
        if position and sent.state is not AxisState.STANDSTILL and point.target == sent.target:
            return False
        demand_changed = (
            position and abs(point.demand - sent.demand) > 0.0
        )  # never true if one of them is unknown
        return demand_changed or abs(point.actual - sent.actual) > BAND * abs(self.step.size)
