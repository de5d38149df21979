"""A trial cycle by cycle: its steps, its disturbances, and its figures, against curves computed here."""

from __future__ import annotations

import math

import pytest

from axisbus.motion.states import AxisState
from axisbus.web.tuning.outcome import FIGURES, report
from axisbus.web.tuning.step import TuningStep, TuningStepKind
from axisbus.web.tuning.trial import NO_CYCLE_TIME, START, NextAction, TrialPhase, TrialSample, TuningTrial

PERIOD = 0.01
MOVE = TuningStep("x", TuningStepKind.POSITION, 10.0, 100.0, 1000.0, 1.0)
TURN = TuningStep("x", TuningStepKind.VELOCITY, 20.0, 20.0, 200.0, 1.0)
NAN = math.nan
STANDS, MOVES, TURNS = AxisState.STANDSTILL, AxisState.DISCRETE_MOTION, AxisState.CONTINUOUS_MOTION


class TrialBench:
    """A trial, and the cycles that it gets."""

    def __init__(self, step=MOVE):
        self.trial = TuningTrial(step, PERIOD, 0.0)
        self.time = 500.0
        self.now = 0.0

    def cycle(self, state=STANDS, actual=0.0, target=NAN, error=NAN, after=PERIOD):
        """One more cycle; return the next action."""
        self.time += after
        self.now += after
        self.trial.add_points([TrialSample(self.time, state, actual, target, NAN, error)], self.now)
        return self.trial.next(self.now)

    def side(self, state, target, actual, seconds=1.0):
        """A side of so many seconds; ``actual`` is a function of its time. Return the next action, each time."""
        return [
            self.cycle(state, actual((k + 1) * PERIOD), target) for k in range(round(seconds / PERIOD) + 1)
        ]


def rising(start, end, slowness=0.05):
    return lambda time: start + (end - start) * (1.0 - math.exp(-time / slowness))


def test_a_trial_moves_measures_returns_measures_and_ends():
    seen = TrialBench()
    assert seen.cycle() is NextAction.GO
    assert seen.trial.phase is TrialPhase.THERE
    assert seen.side(MOVES, 10.0, rising(0.0, 10.0))[-1] is NextAction.RETURN
    done = seen.side(MOVES, 0.0, rising(10.0, 0.0))
    assert done[-1] is NextAction.END
    assert set(done[:-1]) == {NextAction.WAIT}
    assert (seen.trial.ended, seen.trial.why) == (True, "")
    assert seen.trial.next(seen.now) is NextAction.WAIT


def test_a_velocity_trial_returns_to_0_and_is_in_motion_all_the_time():
    seen = TrialBench(TURN)
    assert seen.cycle() is NextAction.GO
    seen.cycle(STANDS)
    assert seen.side(TURNS, NAN, rising(0.0, 20.0))[-1] is NextAction.RETURN
    assert seen.side(TURNS, NAN, rising(20.0, 0.0))[-1] is NextAction.END
    found = report(TURN, TrialPhase.BACK, seen.trial.sides[TrialPhase.BACK], ("deg/s", "deg"))
    assert found["error"] == "unknown"
    assert float(found["settled"].split()[0]) == pytest.approx(0.05 * math.log(50), abs=0.02)


@pytest.mark.parametrize("state", [each for each in AxisState if each is not STANDS])
def test_a_trial_begins_only_at_standstill(state):
    seen = TrialBench()
    assert seen.cycle(state) is NextAction.WAIT
    assert state.value in seen.trial.why


@pytest.mark.parametrize("state", [each for each in AxisState if each not in (STANDS, MOVES)])
def test_another_axis_state_disturbs_a_trial_which_then_does_not_return(state):
    seen = TrialBench()
    seen.cycle()
    seen.cycle(MOVES, target=10.0)
    assert seen.cycle(state, 1.0, 10.0) is NextAction.WAIT
    assert state.value in seen.trial.why
    assert set(seen.side(MOVES, 10.0, rising(0.0, 10.0))) == {NextAction.WAIT}


def test_a_second_motion_disturbs_it():
    seen = TrialBench()
    seen.cycle()
    seen.cycle(MOVES, 5.0, target=10.0)
    seen.cycle(STANDS, 10.0, 10.0)
    seen.cycle(MOVES, 10.0, 11.0)
    assert "moved again" in seen.trial.why


def test_a_turning_axis_that_stops_ends_the_trial():
    seen = TrialBench(TURN)
    seen.cycle()
    seen.cycle(TURNS, 5.0)
    seen.cycle(STANDS)
    assert "came to rest" in seen.trial.why


@pytest.mark.parametrize(("after", "gap"), [(3 * PERIOD, False), (4 * PERIOD, True), (1.0, True)])
def test_missing_cycles_disturb_a_trial(after, gap):
    seen = TrialBench()
    seen.cycle()
    seen.cycle(MOVES, target=10.0)
    seen.cycle(MOVES, target=10.0, after=after)
    assert ("cycles are missing" in seen.trial.why) is gap


def test_an_unknown_position_disturbs_it():
    seen = TrialBench()
    seen.cycle()
    seen.cycle(MOVES, NAN, 10.0)
    assert "not known" in seen.trial.why


def test_the_time_until_the_drive_begins_is_not_the_axis_s():
    """The state shows that the command is taken; the demand, or the axis, shows the motion."""
    seen = TrialBench()
    seen.cycle()
    for _ in range(20):
        seen.cycle(MOVES, 0.1, 10.0)
    assert seen.trial.sides[TrialPhase.THERE].started is None
    seen.cycle(MOVES, 0.3, 10.0)
    assert seen.trial.sides[TrialPhase.THERE].started == seen.time


def test_a_demand_that_moves_begins_it():
    seen = TrialBench()
    for state, demand in ((STANDS, 3.0), (MOVES, 3.0), (MOVES, 3.01)):
        seen.time += PERIOD
        seen.trial.add_points([TrialSample(seen.time, state, 3.0, 13.0, demand, 0.0)], 0.0)
        seen.trial.next(0.0)
    assert seen.trial.sides[TrialPhase.THERE].started == seen.time


@pytest.mark.parametrize("begun", [False, True])
def test_silence_of_the_core_disturbs_it(begun):
    seen = TrialBench()
    if begun:
        seen.cycle()
    assert seen.trial.next(seen.now + NO_CYCLE_TIME - 0.01) is (NextAction.WAIT)
    seen.trial.next(seen.now + NO_CYCLE_TIME + 0.01)
    assert "no cycle" in seen.trial.why


def test_an_axis_that_does_not_begin_disturbs_it():
    seen = TrialBench()
    seen.cycle()
    seen.side(STANDS, NAN, lambda _: 0.0, START - 0.1)
    assert seen.trial.why == ""
    seen.side(STANDS, NAN, lambda _: 0.0, 0.2)
    assert "did not start" in seen.trial.why


def test_the_first_reason_is_the_one_that_is_reported():
    trial = TrialBench().trial
    trial.disturb("one")
    trial.disturb("two")
    assert trial.why == "one"


def test_an_axis_that_rings_returns_by_its_new_target_and_is_measured():
    """The drive never reports its arrival: the axis is in motion all the time."""
    seen = TrialBench()
    seen.cycle()
    assert seen.side(MOVES, 10.0, lambda time: 10.0 + math.sin(60 * time))[-1] is NextAction.RETURN
    assert seen.cycle(MOVES, 10.0, 10.0) is NextAction.WAIT
    assert seen.trial.sides[TrialPhase.BACK].started is None
    assert seen.side(MOVES, 0.3, rising(10.0, 0.3))[-1] is NextAction.END
    found = report(MOVE, TrialPhase.THERE, seen.trial.sides[TrialPhase.THERE], ("deg", "deg"))
    assert found["settled"] == "not settled"
    assert float(found["ripple"].split("%")[0]) == pytest.approx(20.0, abs=0.2)
    assert float(found["overshoot"].split("%")[0]) == pytest.approx(10.0, abs=0.1)


def test_the_figures_are_those_of_the_curve():
    seen = TrialBench()
    seen.cycle()
    decay, swing = 8.0, 30.0
    seen.side(MOVES, 10.0, lambda time: 10.0 * (1.0 - math.exp(-decay * time) * math.cos(swing * time)))
    side = seen.trial.sides[TrialPhase.THERE]
    found = report(MOVE, TrialPhase.THERE, side, ("deg", "deg"))
    assert set(found) == {name for name, _ in FIGURES}
    peak = max(-math.exp(-decay * k * PERIOD) * math.cos(swing * k * PERIOD) for k in range(1, 101))
    assert found["overshoot"] == f"{peak * 100:.1f} % ({peak * 10:.3g} deg)"
    assert 0.3 < float(found["settled"].split()[0]) < math.log(50) / decay + 0.02
    assert found["error"] == "unknown"


def test_the_highest_following_error_is_a_magnitude():
    seen = TrialBench()
    seen.cycle()
    for error in (0.1, -0.7, NAN, 0.3, *[0.0] * 30):
        seen.cycle(MOVES, 10.0, 10.0, error)
    assert (
        report(MOVE, TrialPhase.THERE, seen.trial.sides[TrialPhase.THERE], ("deg", "mm"))["error"] == "0.7 mm"
    )


def test_of_too_little_there_are_no_figures():
    seen = TrialBench()
    seen.cycle()
    found = report(MOVE, TrialPhase.THERE, seen.trial.sides[TrialPhase.THERE], ("deg", "deg"))
    assert set(found.values()) == {"unknown"}


@pytest.mark.parametrize(
    ("step", "seconds"),
    [
        (MOVE, 0.2),  # a trapezoid: 10 / 100 + 100 / 1000
        (TuningStep("x", TuningStepKind.POSITION, -10.0, 100.0, 10.0, 9.0), 2.0),  # a triangle
        (TURN, 0.1),
    ],
)
def test_how_long_a_step_takes(step, seconds):
    assert step.expected_time() == pytest.approx(seconds)
