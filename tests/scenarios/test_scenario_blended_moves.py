"""Moves of one axis that pass into the next one without a stop."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest

from axisbus.errors import (
    ArgumentError,
    DriveFault,
    Interrupted,
    LimitError,
    MotionTimeout,
    StateError,
    Stopped,
)
from axisbus.motion.states import AxisState
from kit.bounds.highest_shares import ACCELERATION, MOST, VELOCITY, Ledger
from kit.cell import Cell

AXIS = "max_acceleration = 1000.0"
PERIOD = 0.01
FASTER = {"low": 60.0, "previous": 60.0, "next": 120.0, "high": 120.0}  # from 60 to 120 deg/s
MODES = ("low", "previous", "next", "high")
SLOWER = {"low": 60.0, "previous": 120.0, "next": 60.0, "high": 120.0}


def one(scenario, **more) -> tuple[Cell, Ledger]:
    cell = scenario.simulated("x", axis=more.pop("axis", AXIS), **more).enabled()
    return cell, Ledger(cell, PERIOD)


def speeds(cell: Cell) -> list[tuple[float, float]]:
    """Each place of the motor, and the speed that it was come to with."""
    return [(b, (b - a) / PERIOD) for a, b in pairwise(cell.positions("x", 0.0))]


def speed_at(cell: Cell, at: float) -> float:
    """How fast the motor was when it came by a place for the first time, in the positive direction."""
    return next(speed for x, speed in speeds(cell) if x >= at)


def must_have_kept_limits(ledger: Ledger) -> None:
    assert ledger.worst.cycles > 50
    for limit in (VELOCITY, ACCELERATION):
        assert ledger.worst.shares[limit][0] <= MOST, ledger.worst.shares


@pytest.mark.parametrize(("mode", "joint"), FASTER.items())
def test_a_transition_has_the_velocity_of_its_mode(scenario, mode, joint):
    cell, ledger = one(scenario)
    first = cell.x.move_absolute(60.0, velocity=60.0, buffer=f"blending_{mode}")
    second = cell.x.move_absolute(150.0, velocity=120.0, buffer=f"blending_{mode}")
    assert cell.end_of(first) is None
    assert second.active
    assert cell.where("x") == pytest.approx(60.0, abs=3.0)
    assert cell.end_of(second) is None
    assert (first.note, second.note) == ("", "")
    assert speed_at(cell, 60.0) == pytest.approx(joint, abs=8.0)
    assert speed_at(cell, 20.0) == pytest.approx(60.0, abs=2.0)
    assert max(speed for _, speed in speeds(cell)) == pytest.approx(120.0, abs=2.0)
    assert cell.where("x") == pytest.approx(150.0, abs=0.1)
    assert cell.x.state is AxisState.STANDSTILL
    must_have_kept_limits(ledger)


@pytest.mark.parametrize(("mode", "joint"), SLOWER.items())
def test_a_transition_into_a_slower_move_has_the_velocity_of_its_mode(scenario, mode, joint):
    cell, ledger = one(scenario)
    cell.x.move_absolute(100.0, velocity=120.0, buffer=f"blending_{mode}")
    second = cell.x.move_absolute(150.0, velocity=60.0, buffer=f"blending_{mode}")
    assert cell.end_of(second) is None
    assert speed_at(cell, 100.0) == pytest.approx(joint, abs=8.0)
    assert speed_at(cell, 130.0) == pytest.approx(60.0, abs=2.0)
    must_have_kept_limits(ledger)


def test_relative_and_additive_moves_count_from_the_end_of_the_one_before(scenario):
    cell, _ = one(scenario)
    cell.x.move_relative(20.0, buffer="blending_low")
    cell.x.move_relative(15.0, buffer="blending_low")
    last = cell.x.move_additive(10.0, buffer="blending_low")
    assert cell.end_of(last) is None
    assert cell.where("x") == pytest.approx(45.0, abs=0.1)
    assert cell.end_of(cell.x.move_additive(5.0)) is None
    assert cell.where("x") == pytest.approx(50.0, abs=0.1)


def test_a_move_that_reverses_stops_at_the_transition_and_its_note_gives_the_reason(scenario):
    cell, ledger = one(scenario)
    first = cell.x.move_absolute(60.0, buffer="blending_high")
    second = cell.x.move_absolute(10.0, buffer="blending_high")
    assert cell.end_of(first) is None
    assert cell.end_of(second) is None
    assert max(cell.positions("x", 0.0)) == pytest.approx(60.0, abs=0.1)
    assert "reverses there" in second.note
    assert first.note == ""
    must_have_kept_limits(ledger)


def test_a_move_given_while_the_axis_brakes_makes_the_transition_slower_and_its_note_gives_the_velocity(
    scenario,
):
    cell, ledger = one(scenario)
    first = cell.x.move_absolute(60.0, velocity=100.0, acceleration=200.0, buffer="blending_low")
    cell.until(lambda: cell.where("x") > 52.0)
    second = cell.x.move_absolute(120.0, velocity=100.0, acceleration=200.0, buffer="blending_low")
    assert cell.end_of(first) is None
    assert cell.end_of(second) is None
    slowest = min(speed for x, speed in speeds(cell) if 50.0 < x < 70.0)
    assert 30.0 < slowest < 80.0
    assert "instead of 100" in second.note
    must_have_kept_limits(ledger)


def test_a_move_given_after_the_last_one_has_reached_its_end_is_buffered_and_its_note_gives_the_reason(
    scenario,
):
    cell, ledger = one(scenario)
    first = cell.x.move_absolute(60.0, buffer="blending_low")
    cell.until(lambda: cell.core("x").activity is not None and bool(cell.core("x").activity.why_not))
    assert first.busy
    second = cell.x.move_absolute(100.0, buffer="blending_low")
    third = cell.x.move_absolute(150.0, buffer="blending_low")
    assert cell.end_of(first) is None
    assert second.busy
    assert cell.end_of(third) is None
    assert second.done
    assert "buffered instead of blended" in second.note
    assert third.note == ""
    assert min(abs(speed) for x, speed in speeds(cell) if 59.0 < x < 61.0) < 1.0
    assert speed_at(cell, 100.0) == pytest.approx(100.0, abs=8.0)
    must_have_kept_limits(ledger)


def test_a_move_behind_a_buffered_one_joins_it_when_that_begins(scenario):
    cell, _ = one(scenario)
    cell.x.move_absolute(30.0)
    cell.x.move_absolute(40.0, buffer=True)
    third = cell.x.move_absolute(80.0, buffer="blending_low")
    assert cell.end_of(third) is None
    assert cell.where("x") == pytest.approx(80.0, abs=0.1)


def test_a_halt_ends_all_blended_moves_and_leaves_the_axis_at_standstill_on_its_path(scenario):
    cell, ledger = one(scenario)
    handles = [cell.x.move_absolute(end, buffer="blending_low") for end in (40.0, 80.0, 120.0)]
    cell.until(lambda: cell.where("x") > 50.0)
    assert cell.end_of(cell.x.halt()) is None
    assert handles[0].done
    for handle in handles[1:]:
        assert isinstance(cell.end_of(handle), Stopped)
    assert 50.0 < cell.where("x") < 80.0
    assert cell.x.state is AxisState.STANDSTILL
    must_have_kept_limits(ledger)


@pytest.mark.parametrize("way_out", ["stop", "quick_stop", "disable"])
def test_every_other_stop_ends_all_of_them(scenario, way_out):
    cell, _ = one(scenario)
    handles = [cell.x.move_absolute(end, buffer="blending_low") for end in (40.0, 80.0, 120.0)]
    cell.until(lambda: cell.where("x") > 50.0)
    assert cell.end_of(getattr(cell.x, way_out)()) is None
    assert handles[0].done
    assert all(isinstance(cell.end_of(handle), Interrupted) for handle in handles[1:])
    rests = cell.where("x")
    cell.run(1.0)
    assert cell.where("x") == pytest.approx(rests, abs=0.1)


def test_a_fault_ends_all_of_them_with_its_reason(scenario):
    cell, _ = one(scenario)
    handles = [cell.x.move_absolute(end, buffer="blending_low") for end in (40.0, 80.0, 120.0)]
    cell.until(lambda: cell.where("x") > 50.0)
    cell.machine.simulated_node(1).fault(0x2310)
    assert all(isinstance(cell.end_of(handle), DriveFault) for handle in handles[1:])
    assert handles[0].done
    assert cell.end_of(cell.x.reset()) is None
    assert cell.end_of(cell.x.enable()) is None
    rests = cell.where("x")
    cell.run(1.0)
    assert cell.where("x") == pytest.approx(rests, abs=0.1)  # no further motion


def test_another_move_takes_over_from_them_without_a_jolt(scenario):
    cell, ledger = one(scenario)
    handles = [cell.x.move_absolute(end, buffer="blending_low") for end in (40.0, 120.0)]
    cell.until(lambda: cell.where("x") > 50.0)
    assert cell.end_of(cell.x.move_absolute(-10.0)) is None
    assert isinstance(cell.end_of(handles[1]), Interrupted)
    assert cell.where("x") == pytest.approx(-10.0, abs=0.1)
    must_have_kept_limits(ledger)


@pytest.mark.parametrize(("mode", "joint"), FASTER.items())
def test_a_move_that_took_over_is_blended_into_the_next(scenario, mode, joint):
    cell, ledger = one(scenario)
    cell.x.move_absolute(100.0, velocity=90.0, buffer="blending_low")
    cell.until(lambda: cell.where("x") > 10.0)
    over = cell.x.move_absolute(60.0, velocity=60.0)
    cell.run(0.05)
    last = cell.x.move_absolute(150.0, velocity=120.0, buffer=f"blending_{mode}")
    assert cell.end_of(over) is None
    assert last.active
    assert cell.end_of(last) is None
    assert speed_at(cell, 60.0) == pytest.approx(joint, abs=8.0)
    assert cell.where("x") == pytest.approx(150.0, abs=0.1)
    assert last.note == ""
    must_have_kept_limits(ledger)


def test_a_superimposed_distance_survives_a_move_that_takes_over(scenario):
    cell, ledger = one(scenario)
    cell.x.move_absolute(100.0, velocity=40.0, buffer="blending_low")
    cell.until(lambda: cell.where("x") > 10.0)
    over = cell.x.move_absolute(80.0, velocity=40.0)
    cell.run(0.05)
    assert cell.end_of(cell.x.move_superimposed(5.0, velocity=20.0)) is None
    assert over.busy
    last = cell.x.move_absolute(150.0, velocity=40.0, buffer="blending_low")
    assert cell.end_of(over) is None
    assert cell.end_of(last, 20.0) is None
    assert cell.where("x") == pytest.approx(155.0, abs=0.1)
    must_have_kept_limits(ledger)


def test_a_blended_move_that_took_over_and_reverses_is_still_waited_for(scenario):
    cell, ledger = one(scenario)
    cell.x.move_absolute(100.0, velocity=90.0, buffer="blending_low")
    cell.until(lambda: cell.where("x") > 50.0)
    back = cell.x.move_absolute(20.0)
    last = cell.x.move_absolute(-30.0, buffer="blending_low")
    assert cell.end_of(back) is None
    assert cell.end_of(last) is None
    assert "reverses" in last.note
    assert cell.where("x") == pytest.approx(-30.0, abs=0.1)
    must_have_kept_limits(ledger)


def test_the_time_of_one_that_took_over_counts_on(scenario):
    cell, _ = one(scenario)
    cell.x.move_absolute(100.0, velocity=90.0, buffer="blending_low")
    cell.until(lambda: cell.where("x") > 10.0)
    over = cell.x.move_absolute(150.0, velocity=20.0, timeout=1.0)
    cell.run(0.6)
    last = cell.x.move_absolute(160.0, velocity=20.0, buffer="blending_low")
    began = cell.now
    assert isinstance(cell.end_of(over), MotionTimeout)
    assert isinstance(cell.end_of(last), MotionTimeout)
    assert cell.now - began < 1.0


@pytest.mark.parametrize("factor", [0.3, 1.5])
def test_an_override_scales_all_of_it(scenario, factor):
    cell, ledger = one(scenario)
    assert cell.end_of(cell.x.set_override(factor)) is None
    cell.x.move_absolute(60.0, velocity=60.0, acceleration=300.0, buffer="blending_next")
    second = cell.x.move_absolute(150.0, velocity=120.0, acceleration=300.0, buffer="blending_next")
    assert cell.end_of(second, 20.0) is None
    assert speed_at(cell, 60.0) == pytest.approx(120.0 * factor, abs=8.0)
    assert speed_at(cell, 30.0) == pytest.approx(60.0 * factor, abs=8.0)
    assert second.note == ""
    must_have_kept_limits(ledger)


def test_blended_moves_continue_after_an_override_of_zero(scenario):
    cell, ledger = one(scenario)
    handles = [cell.x.move_absolute(end, buffer="blending_low") for end in (40.0, 120.0)]
    cell.until(lambda: cell.where("x") > 30.0)
    cell.x.set_override(0.0)
    cell.run(1.0)
    held = cell.where("x")
    cell.run(1.0)
    assert cell.where("x") == pytest.approx(held, abs=0.1)
    handles.append(cell.x.move_absolute(150.0, buffer="blending_low"))
    cell.x.set_override(1.0)
    assert [cell.end_of(handle) for handle in handles] == [None] * 3
    assert cell.where("x") == pytest.approx(150.0, abs=0.1)
    must_have_kept_limits(ledger)


def test_a_superimposed_distance_displaces_moves_that_join_later(scenario):
    cell, ledger = one(scenario)
    cell.x.move_absolute(100.0, velocity=40.0, buffer="blending_low")
    cell.until(lambda: cell.where("x") > 10.0)
    assert cell.end_of(cell.x.move_superimposed(5.0, velocity=20.0)) is None
    last = cell.x.move_absolute(150.0, velocity=40.0, buffer="blending_low")
    assert cell.end_of(last, 20.0) is None
    assert cell.where("x") == pytest.approx(155.0, abs=0.1)
    assert cell.end_of(cell.x.move_additive(1.0)) is None
    assert cell.where("x") == pytest.approx(156.0, abs=0.1)
    must_have_kept_limits(ledger)


def test_a_move_given_during_a_superimposed_move_waits_and_its_note_gives_the_reason(scenario):
    cell, _ = one(scenario)
    cell.x.move_absolute(60.0, velocity=40.0, buffer="blending_low")
    cell.until(lambda: cell.where("x") > 10.0)
    cell.x.move_superimposed(5.0, velocity=5.0)
    last = cell.x.move_absolute(80.0, buffer="blending_low")
    assert cell.end_of(last, 20.0) is None
    assert "being superimposed" in last.note


def test_a_blended_move_beyond_the_limits_is_refused_and_the_others_continue(scenario):
    cell, _ = one(scenario, axis=f"{AXIS}\nposition_limits = [-10.0, 100.0]")
    first = cell.x.move_absolute(60.0, buffer="blending_low")
    with pytest.raises(LimitError):
        cell.x.move_absolute(101.0, buffer="blending_low")
    beyond = cell.x.move_relative(41.0, buffer="blending_low")
    assert isinstance(cell.end_of(beyond), LimitError)
    last = cell.x.move_relative(39.0, buffer="blending_low")
    assert cell.end_of(first) is None
    assert cell.end_of(last) is None
    assert cell.where("x") == pytest.approx(99.0, abs=0.1)


def test_each_blended_move_has_the_time_that_it_was_given(scenario):
    cell, _ = one(scenario)
    first = cell.x.move_absolute(60.0, timeout=5.0, buffer="blending_low")
    second = cell.x.move_absolute(160.0, velocity=20.0, timeout=1.0, buffer="blending_low")
    assert cell.end_of(first) is None
    began = cell.now
    assert isinstance(cell.end_of(second), MotionTimeout)
    assert cell.now - began == pytest.approx(1.0, abs=0.1)
    assert cell.x.state is AxisState.ERRORSTOP


def test_a_time_that_was_given_runs_as_slowly_as_the_move(scenario):
    cell, _ = one(scenario)
    cell.x.set_override(0.2)
    first = cell.x.move_absolute(60.0, timeout=1.5, buffer="blending_low")
    second = cell.x.move_absolute(120.0, timeout=1.5, buffer="blending_low")
    assert cell.end_of(first) is None
    assert cell.end_of(second) is None


def test_a_move_that_cannot_be_blended_is_refused_with_the_reason(scenario):
    cell, _ = one(scenario)
    with pytest.raises(ArgumentError, match="only a move to a position"):
        cell.x.move_velocity(20.0, buffer="blending_low")
    with pytest.raises(ArgumentError, match="is not a buffer mode"):
        cell.x.move_absolute(20.0, buffer="blending")
    cell.x.move_absolute(60.0, buffer="blending_low")
    assert cell.end_of(cell.x.halt()) is None
    late = cell.x.home(35)
    refused = cell.x.move_absolute(20.0, buffer="blending_low")
    assert isinstance(cell.end_of(refused), StateError)
    assert cell.end_of(late) is None


def test_no_more_than_a_hundred_share_one_motion(scenario):
    cell, _ = one(scenario)
    handles = [cell.x.move_relative(0.5, velocity=5.0, buffer="blending_low") for _ in range(101)]
    assert isinstance(cell.end_of(handles[-1]), StateError)
    assert cell.end_of(handles[-2], 60.0) is None
    assert all(handle.done for handle in handles[:-1])
    assert cell.where("x") == pytest.approx(50.0, abs=0.1)


# -- behind a move that the drive plans ------------------------------------------------------------------------------


@pytest.mark.parametrize(("mode", "joint"), FASTER.items())
def test_a_move_of_the_drive_is_blended_with_a_faster_one(scenario, mode, joint):
    cell, _ = one(scenario)
    first = cell.x.move_absolute(60.0, velocity=60.0)
    second = cell.x.move_absolute(150.0, velocity=120.0, buffer=f"blending_{mode}")
    assert cell.end_of(first) is None
    assert second.active
    assert cell.where("x") == pytest.approx(60.0, abs=4.0)
    assert cell.end_of(second) is None
    assert speed_at(cell, 60.0) == pytest.approx(joint, abs=8.0)
    assert speed_at(cell, 25.0) == pytest.approx(60.0, abs=2.0)
    assert max(speed for _, speed in speeds(cell)) == pytest.approx(120.0, abs=2.0)
    assert min(speed for x, speed in speeds(cell) if 20.0 < x < 130.0) > 55.0
    assert cell.where("x") == pytest.approx(150.0, abs=0.1)
    assert cell.core("x").image.mode == 1
    assert (first.note, second.note) == ("", "")


@pytest.mark.parametrize(("mode", "joint"), SLOWER.items())
def test_a_move_of_the_drive_is_blended_with_a_slower_one(scenario, mode, joint):
    cell, _ = one(scenario)
    cell.x.move_absolute(100.0, velocity=120.0)
    second = cell.x.move_absolute(150.0, velocity=60.0, buffer=f"blending_{mode}")
    assert cell.end_of(second) is None
    assert speed_at(cell, 100.0) == pytest.approx(joint, abs=8.0)
    assert speed_at(cell, 130.0) == pytest.approx(60.0, abs=2.0)


def test_many_moves_of_the_drive_share_one_motion_and_end_in_turn(scenario):
    cell, _ = one(scenario)
    handles = [cell.x.move_absolute(30.0, velocity=50.0)]
    for number in range(2, 8):
        speed = 100.0 if number % 2 else 50.0
        handles.append(cell.x.move_relative(30.0, velocity=speed, buffer="blending_low"))
    for number, handle in enumerate(handles, 1):
        assert cell.end_of(handle) is None
        assert cell.where("x") == pytest.approx(30.0 * number, abs=4.0)
    assert min(speed for x, speed in speeds(cell) if 5.0 < x < 200.0) > 45.0
    assert speed_at(cell, 74.0) == pytest.approx(100.0, abs=8.0)
    assert speed_at(cell, 90.0) == pytest.approx(50.0, abs=8.0)


def test_a_move_that_reverses_behind_a_move_of_the_drive_is_buffered_and_its_note_gives_the_reason(scenario):
    cell, _ = one(scenario)
    first = cell.x.move_absolute(60.0)
    second = cell.x.move_absolute(10.0, buffer="blending_high")
    assert cell.end_of(first) is None
    assert cell.where("x") == pytest.approx(60.0, abs=0.1)
    assert cell.end_of(second) is None
    assert cell.where("x") == pytest.approx(10.0, abs=0.1)
    assert "reverses there" in second.note


def test_a_move_of_no_length_behind_one_of_the_drive_is_buffered_and_its_note_gives_the_reason(scenario):
    cell, _ = one(scenario)
    first = cell.x.move_absolute(60.0)
    second = cell.x.move_relative(0.0, buffer="blending_high")
    third = cell.x.move_absolute(100.0, buffer="blending_high")
    assert [cell.end_of(handle) for handle in (first, second, third)] == [None] * 3
    assert "has no length" in second.note
    assert cell.where("x") == pytest.approx(100.0, abs=0.1)


def test_an_additive_move_counts_from_the_end_of_all_that_shared_a_move_of_the_drive(scenario):
    cell, _ = one(scenario)
    cell.x.move_absolute(30.0)
    assert cell.end_of(cell.x.move_absolute(60.0, buffer="blending_low")) is None
    assert cell.end_of(cell.x.move_additive(5.0)) is None
    assert cell.where("x") == pytest.approx(65.0, abs=0.1)


def test_a_move_that_a_superimposed_distance_would_take_beyond_the_limits_does_not_join(scenario):
    cell, _ = one(scenario, axis=f"{AXIS}\nposition_limits = [-10.0, 100.0]")
    first = cell.x.move_absolute(80.0, velocity=40.0, buffer="blending_low")
    cell.until(lambda: cell.where("x") > 10.0)
    assert cell.end_of(cell.x.move_superimposed(5.0, velocity=20.0)) is None
    assert isinstance(cell.end_of(cell.x.move_absolute(98.0, buffer="blending_low")), LimitError)
    assert cell.end_of(first) is None
    assert cell.where("x") == pytest.approx(85.0, abs=0.1)


def test_a_blended_move_that_took_over_under_an_override_is_waited_for(scenario):
    cell, ledger = one(scenario)
    cell.x.move_absolute(100.0, velocity=90.0, buffer="blending_low")
    cell.until(lambda: cell.where("x") > 10.0)
    cell.x.set_override(0.5)
    over = cell.x.move_absolute(60.0, velocity=60.0)
    cell.run(0.05)
    last = cell.x.move_absolute(120.0, buffer="blending_low")
    assert cell.end_of(over) is None
    assert cell.end_of(last) is None
    assert "has an override" in last.note
    assert cell.where("x") == pytest.approx(120.0, abs=0.1)
    must_have_kept_limits(ledger)


def test_a_move_given_late_behind_a_move_of_the_drive_is_slower_or_buffered_and_its_note_gives_the_reason(
    scenario,
):
    cell, _ = one(scenario)
    cell.x.move_absolute(60.0, velocity=100.0, acceleration=200.0)
    cell.until(lambda: cell.where("x") > 55.0)
    slower = cell.x.move_absolute(120.0, velocity=100.0, acceleration=200.0, buffer="blending_low")
    assert cell.end_of(slower) is None
    assert "instead of 100" in slower.note
    cell.x.move_absolute(200.0)
    cell.until(lambda: cell.where("x") > 199.9)
    late = cell.x.move_absolute(250.0, buffer="blending_low")
    assert cell.end_of(late) is None
    assert "buffered instead of blended" in late.note
    assert cell.where("x") == pytest.approx(250.0, abs=0.1)


@pytest.mark.parametrize("way_out", ["halt", "stop", "quick_stop", "disable"])
@pytest.mark.parametrize("at", [0.0, 0.05, 20.0, 41.0, 55.0])
def test_a_stop_ends_all_that_share_a_move_of_the_drive_and_nothing_continues(scenario, way_out, at):
    cell, _ = one(scenario)
    handles = [cell.x.move_absolute(40.0, velocity=60.0)]
    handles += [cell.x.move_absolute(end, velocity=90.0, buffer="blending_next") for end in (80.0, 120.0)]
    cell.until(lambda: cell.where("x") >= at)
    assert cell.end_of(getattr(cell.x, way_out)()) is None
    for handle in handles:
        assert handle.done or isinstance(cell.end_of(handle), Interrupted)
    assert not handles[2].done
    rests = cell.where("x")
    cell.run(1.0)
    assert cell.where("x") == pytest.approx(rests, abs=0.1)
    assert rests < at + 30.0


@pytest.mark.parametrize("factor", [0.3, 1.5])
def test_an_override_scales_a_move_of_the_drive_through_its_transition(scenario, factor):
    cell, _ = one(scenario)
    cell.x.move_absolute(60.0, velocity=60.0)
    second = cell.x.move_absolute(150.0, velocity=120.0, buffer="blending_next")
    cell.x.set_override(factor)
    assert cell.end_of(second, 20.0) is None
    assert speed_at(cell, 60.0) == pytest.approx(120.0 * factor, abs=8.0)
    assert speed_at(cell, 30.0) == pytest.approx(60.0 * factor, abs=8.0)


def test_a_hold_of_a_move_of_the_drive_while_another_joins_it(scenario):
    cell, _ = one(scenario)
    handles = [cell.x.move_absolute(60.0, velocity=60.0)]
    cell.until(lambda: cell.where("x") > 20.0)
    cell.x.set_override(0.0)
    cell.run(1.0)
    held = cell.where("x")
    handles.append(cell.x.move_absolute(100.0, velocity=60.0, buffer="blending_low"))
    cell.run(1.0)
    assert cell.where("x") == pytest.approx(held, abs=0.1)
    cell.x.set_override(1.0)
    assert [cell.end_of(handle) for handle in handles] == [None, None]
    assert cell.where("x") == pytest.approx(100.0, abs=0.1)
    assert min(speed for x, speed in speeds(cell) if 50.0 < x < 70.0) > 55.0


def test_a_tiny_move_is_not_mistaken_for_the_end_of_the_move_that_joins_it(scenario):
    cell, _ = one(scenario)
    first = cell.x.move_absolute(1.0)
    second = cell.x.move_absolute(50.0, buffer="blending_low")
    assert cell.end_of(second) is None
    assert first.done
    assert cell.where("x") == pytest.approx(50.0, abs=0.1)


def test_each_move_of_the_drive_has_the_time_that_it_was_given(scenario):
    cell, _ = one(scenario)
    first = cell.x.move_absolute(60.0, velocity=60.0, timeout=2.0)
    second = cell.x.move_absolute(160.0, velocity=20.0, timeout=3.0, buffer="blending_previous")
    assert cell.end_of(first) is None
    began = cell.now
    assert isinstance(cell.end_of(second), MotionTimeout)
    assert cell.now - began == pytest.approx(3.0, abs=0.3)


@pytest.mark.parametrize("handshake", ["on-change", "acknowledge"])
def test_a_drive_whose_bit_12_proves_nothing_passes_the_end_without_stopping_as_well(scenario, handshake):
    axis = AXIS + (f'\nhandshake = "{handshake}"' if handshake == "on-change" else "")
    cell, _ = one(scenario, axis=axis)
    cell.x.move_absolute(60.0, velocity=60.0)
    last = cell.x.move_absolute(150.0, velocity=120.0, buffer="blending_low")
    assert cell.end_of(last) is None
    assert min(speed for x, speed in speeds(cell) if 20.0 < x < 130.0) > 55.0
    assert cell.where("x") == pytest.approx(150.0, abs=0.1)


def test_a_move_of_a_group_is_waited_for(scenario):
    cell = scenario.simulated("xy", axis=AXIS).enabled()
    direct = cell.machine.group("x", "y").move_direct((30.0, 10.0))
    last = cell.x.move_absolute(60.0, buffer="blending_low")
    assert cell.end_of(direct) is None
    assert cell.end_of(last) is None
    assert "belongs to a group" in last.note
    assert cell.where("x") == pytest.approx(60.0, abs=0.1)


def test_without_csp_the_drive_plans_all_of_it(scenario):
    cell = scenario.simulated("x", axis=AXIS, bus="sync = false").enabled()
    first = cell.x.move_absolute(60.0, velocity=60.0, buffer="blending_high")
    last = cell.x.move_absolute(150.0, velocity=120.0, buffer="blending_high")
    assert cell.end_of(first) is None
    assert cell.end_of(last) is None
    assert cell.core("x").image.mode == 1
    assert speed_at(cell, 60.0) == pytest.approx(120.0, abs=8.0)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("far", [1.0, 5.0, 20.0, 60.0, 300.0])
def test_a_short_move_with_a_weak_deceleration_is_not_overrun_by_the_drive(scenario, mode, far):
    cell, _ = one(scenario, axis=f"{AXIS}\nposition_limits = [-10.0, {100.0 + far}]")
    first = cell.x.move_absolute(100.0, velocity=300.0, acceleration=900.0)
    last = cell.x.move_absolute(100.0 + far, velocity=200.0, acceleration=200.0, buffer=f"blending_{mode}")
    assert cell.end_of(first) is None
    assert cell.end_of(last) is None
    assert max(cell.positions("x", 0.0)) < 100.0 + far + 0.3
    assert ("deceleration of the previous move" in last.note) is (far < 240.0)
    assert cell.where("x") == pytest.approx(100.0 + far, abs=0.1)


def test_equal_times_count_for_each_move_of_the_drive(scenario):
    cell, _ = one(scenario)
    first = cell.x.move_absolute(80.0, velocity=50.0, timeout=2.5)
    last = cell.x.move_absolute(160.0, velocity=50.0, timeout=2.5, buffer="blending_low")
    assert cell.end_of(first) is None
    assert cell.end_of(last) is None


@pytest.mark.parametrize("first", [False, "blending_low"])
def test_on_an_endless_axis_the_shortest_direction_counts_from_the_end_of_the_previous_move(scenario, first):
    cell, _ = one(scenario, axis=f"{AXIS}\nmodulo = 360.0")
    handles = [cell.x.move_absolute(170.0, buffer=first)]
    handles += [cell.x.move_absolute(place, buffer="blending_low") for place in (340.0, 90.0)]
    handles.append(cell.x.move_absolute(80.0, direction=1, buffer="blending_low"))
    assert [cell.end_of(handle, 20.0) for handle in handles] == [None] * 4
    assert cell.where("x") == pytest.approx(360.0 + 90.0 + 350.0, abs=0.2)
    assert min(speed for x, speed in speeds_between(cell, 20.0, 780.0)) > 90.0


def speeds_between(cell: Cell, low: float, high: float) -> list[tuple[float, float]]:
    return [(x, speed) for x, speed in speeds(cell) if low < x < high]


# -- random plays ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(20))
def test_any_sequence_of_moves_keeps_the_limits_and_ends_at_the_last_target(scenario, seed):
    chance = random.Random(seed)
    cell, _ = one(scenario)
    handles = []
    for _ in range(chance.randint(5, 25)):
        handles.append(random_command(cell, chance))
        cell.run(chance.choice([0.0, 0.0, 0.02, 0.1, 0.3, 1.0]))
    cell.x.set_override(1.0)
    target = chance.uniform(-100.0, 100.0)
    if chance.random() < 0.5 and cell.core("x").stop_sequence is None:
        blended = cell.x.move_relative(10.0, buffer="blending_low")
        last = cell.x.move_absolute(target, buffer="blending_high")
        handles.append(blended)
    else:
        last = cell.x.move_absolute(target)
    error = cell.end_of(last, 60.0)
    assert error is None or isinstance(error, StateError), error  # it is being halted
    if error is None:
        assert cell.where("x") == pytest.approx(target, abs=0.3)
    cell.run(2.0)
    for handle in handles:
        assert not handle.busy, handle
        assert handle.done or isinstance(handle.exception(), Interrupted | StateError), handle.exception()
    places = cell.positions("x", 0.0)
    jolts = [abs(c - 2 * b + a) / PERIOD**2 for a, b, c in zip(places, places[1:], places[2:], strict=False)]
    assert max(jolts) < 1100.0  # of the motor, whichever side controls it
    assert max(abs(speed) for _, speed in speeds(cell)) < 400.0


def random_command(cell: Cell, chance: random.Random):
    """A move that passes into the next, or replaces it, or something that comes between."""
    x, mode = cell.x, f"blending_{chance.choice(MODES)}"
    pace = {
        "velocity": chance.choice([20.0, 100.0, 250.0]),
        "acceleration": chance.choice([200.0, 700.0]),
        "deceleration": chance.choice([200.0, 700.0]),
    }
    far = chance.choice([0.0, 0.05, 1.0, 20.0, 60.0]) * chance.choice([1.0, 1.0, -1.0])
    return chance.choice(
        [
            *[lambda: x.move_relative(far, buffer=mode, **pace)] * 6,
            *[lambda: x.move_absolute(chance.uniform(-100.0, 100.0), buffer=mode, **pace)] * 3,
            *[lambda: x.move_absolute(chance.uniform(-100.0, 100.0), **pace)] * 3,
            lambda: x.move_relative(far, buffer=True, **pace),
            lambda: x.set_override(chance.choice([0.0, 0.3, 1.0, 1.0, 1.5])),
            lambda: x.set_override(1.0),
            x.halt,
        ]
    )()
