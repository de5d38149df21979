"""Random motion that the master controls keeps to velocity, acceleration and jerk; ``make bounds`` tries 10,000 commands."""

from __future__ import annotations

import pytest

from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.bounds.highest_shares import ACCELERATION, JERK, MOST, VELOCITY, Ledger
from kit.bounds.random_motion import HARDEST, ORDER, PERIOD, Play, played

COMMANDS = 40


@pytest.fixture(scope="module")
def total(tmp_path_factory) -> Play:
    total = Play()
    for seed in (7, 29):  # by which every limit is come to
        total.join(played(seed, COMMANDS, tmp_path_factory.mktemp("play")))
    return total


def test_no_axis_is_faster_harder_or_more_sudden_than_it_may_be(total):
    worst = total.worst
    assert worst.cycles > 10_000
    for share, where in worst.shares.values():
        assert 0.7 < share <= MOST, where  # and the limits were come to


def test_every_kind_of_command_was_given_and_each_was_executed_or_interrupted(total):
    assert set(total.asked) == set(ORDER)
    assert all(total.done[what] + total.broken_off[what] for what in ORDER)


def test_an_excess_over_the_allowed_values_would_be_measured(scenario):
    """The ledger compares with the given limits: twice that acceleration is allowed, and far less jerk."""
    cell = scenario.simulated("x", axis=f"max_acceleration = {HARDEST}").enabled()
    ledger = Ledger(cell, PERIOD)
    ledger.jerk = 1000.0
    cell.end_of(cell.x.follow(TrapezoidalTrajectory(0.0, 90.0, 200.0, 0.5 * HARDEST)))
    assert ledger.worst.shares[ACCELERATION][0] == pytest.approx(0.5, abs=1e-6)
    assert ledger.worst.shares[VELOCITY][0] == pytest.approx(0.5, abs=1e-6)
    assert ledger.worst.shares[JERK][0] > 10.0


@pytest.mark.parametrize("moment", [0.2, 0.33, 0.41])
@pytest.mark.parametrize("acceleration", [1000.0, 1500.0])
def test_no_axis_of_a_resumed_line_exceeds_its_maximum_acceleration(scenario, moment, acceleration):
    """It begins where its axes were rounded to, and is as fast as the faster of them may be."""
    cell = scenario.simulated("xy", axis=f"max_acceleration = {HARDEST}").enabled()
    ledger, group = Ledger(cell, PERIOD), cell.machine.group("x", "y")
    group.move_linear([1500.0, 333.3], velocity=2000.0, acceleration=acceleration)
    cell.run(moment)
    cell.end_of(group.halt())
    assert cell.end_of(group.resume(), 20.0) is None
    assert cell.where("x") == pytest.approx(1500.0, abs=0.01)
    assert 0.999 < ledger.worst.shares[VELOCITY][0] <= MOST


@pytest.mark.parametrize("moment", [0.2, 0.33, 0.41])
def test_a_line_that_joins_a_resumed_one_makes_no_axis_too_fast(scenario, moment):
    """It joins while the axes still remove their initial rounding."""
    cell = scenario.simulated("xy", axis=f"max_acceleration = {HARDEST}").enabled()
    ledger, group = Ledger(cell, PERIOD), cell.machine.group("x", "y")
    group.move_path([(750.0, 166.65), (1500.0, 333.3)], velocity=2000.0, acceleration=HARDEST)
    cell.run(moment)
    cell.end_of(group.halt())
    group.resume()
    cell.run(0.05)
    last = group.move_linear(
        [1700.0, 800.0], velocity=2000.0, acceleration=HARDEST, buffer="blending_high", blend=20.0
    )
    assert cell.end_of(last, 20.0) is None
    assert cell.where("x") == pytest.approx(1700.0, abs=0.01)
    assert 0.999 < ledger.worst.shares[VELOCITY][0] <= MOST


@pytest.mark.parametrize("moment", [0.30, 0.33, 0.36, 0.39])
def test_a_move_that_joins_under_an_override_is_no_harder_by_that(scenario, moment):
    """If the axis needs all of its deceleration for the running motion, time cannot be slowed down for a harder leg."""
    cell = scenario.simulated("x", axis=f"max_acceleration = {HARDEST}").enabled()
    ledger = Ledger(cell, PERIOD)
    cell.end_of(cell.x.set_override(1.5))
    soft = {"velocity": 400.0, "acceleration": 800.0, "deceleration": 800.0}
    cell.x.move_relative(30.0, **soft, buffer="blending_high")
    cell.run(moment)
    handle = cell.x.move_relative(
        2.0, velocity=400.0, acceleration=2000.0, deceleration=2000.0, buffer="blending_high"
    )
    assert cell.end_of(handle) is None
    assert cell.where("x") == pytest.approx(32.0, abs=0.01)
    assert 0.9 < ledger.worst.shares[ACCELERATION][0] <= MOST
