"""Blended moves of one axis with a limit of jerk, and refusals."""

from __future__ import annotations

import math
import random

import pytest

from axisbus.errors import LimitError, Replaced, StateError, Stopped
from axisbus.motion.states import AxisState
from kit.cell import GENERIC, cell_text
from kit.scenarios.jerk_limited import JERK, NEAR, PERIOD, WITHOUT_JERK, ComputedMotion, soft
from kit.virtual_axis import virtual

HARD = 500.0  # deg/s²
FASTER = {"low": 60.0, "previous": 60.0, "next": 120.0, "high": 120.0}  # from 60 to 120 deg/s
SLOWER = {"low": 60.0, "previous": 120.0, "next": 60.0, "high": 120.0}


def speed_at(led, at):
    """The commanded speed of the axis at a position, in the positive direction."""
    row = next(row for row in led.rows if row)
    number = next(k for k, place in enumerate(row) if place >= at)
    return (row[number] - row[number - 1]) / PERIOD


def must_be_soft(led, hardest=HARD, jerk=JERK):
    assert led.worst(2) <= hardest * 1.001
    assert led.worst(3) <= jerk * 1.001


@pytest.mark.parametrize("eds", [WITHOUT_JERK, GENERIC])
@pytest.mark.parametrize(
    ("mode", "velocities", "joint"),
    [
        *((mode, (60.0, 120.0), joint) for mode, joint in FASTER.items()),
        *((mode, (120.0, 60.0), joint) for mode, joint in SLOWER.items()),
    ],
)
def test_a_transition_has_the_velocity_of_its_mode(scenario, eds, mode, velocities, joint):
    """By the master, also where the drive has a profile jerk."""
    cell = soft(scenario, eds)
    led = ComputedMotion(cell)
    first = cell.x.move_absolute(70.0, velocity=velocities[0], buffer=f"blending_{mode}")
    second = cell.x.move_absolute(150.0, velocity=velocities[1], buffer=f"blending_{mode}")
    assert cell.end_of(first) is None
    assert second.active
    assert cell.where("x") == pytest.approx(70.0, abs=4.0)
    assert cell.end_of(second) is None
    assert (first.note, second.note) == ("", "")
    assert speed_at(led, 70.0) == pytest.approx(joint, abs=0.1)
    assert led.worst(1) == pytest.approx(120.0)
    assert cell.where("x") == pytest.approx(150.0, abs=0.1)
    assert cell.x.state is AxisState.STANDSTILL
    must_be_soft(led)


@pytest.mark.parametrize("moment", [0.0, 0.02, 0.2, 0.6, 0.75])
def test_a_jerk_limited_move_can_be_joined_before_it_begins_and_while_it_moves(scenario, moment):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    first = cell.x.move_absolute(70.0, velocity=100.0)
    cell.run(moment)
    second = cell.x.move_absolute(150.0, velocity=60.0, buffer="blending_low")
    third = cell.x.move_relative(40.0, velocity=100.0, buffer="blending_previous")
    assert cell.end_of(first) is None
    assert second.active
    assert cell.end_of(third) is None
    assert [each.note for each in (first, second, third)] == [""] * 3
    assert speed_at(led, 70.0) == pytest.approx(60.0, abs=0.5)
    assert speed_at(led, 150.0) == pytest.approx(60.0, abs=0.1)
    assert cell.where("x") == pytest.approx(190.0, abs=0.1)
    assert len([row for row in led.rows if row]) == 1
    must_be_soft(led)


def test_a_move_given_while_the_axis_brakes_has_a_slower_transition_and_its_note_gives_the_velocity(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    cell.x.move_absolute(70.0, velocity=100.0)
    cell.run(0.9)
    second = cell.x.move_absolute(150.0, velocity=100.0, buffer="blending_low")
    assert cell.end_of(second) is None
    assert "instead of 100" in second.note
    assert 10.0 < speed_at(led, 70.0) < 100.0
    must_be_soft(led)


def test_if_the_path_reverses_it_stops_at_the_end_and_the_note_gives_the_reason(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    first = cell.x.move_absolute(70.0, buffer="blending_next")
    second = cell.x.move_absolute(20.0, buffer="blending_next")
    assert cell.end_of(first) is None
    assert cell.where("x") == pytest.approx(70.0, abs=NEAR)
    assert cell.end_of(second) is None
    assert "reverses there" in second.note
    assert max(max(row) for row in led.rows if row) == pytest.approx(70.0, abs=1e-6)
    must_be_soft(led)


def test_moves_that_need_more_time_for_their_jerk_are_not_blended_and_the_note_gives_the_reason(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    first = cell.x.move_absolute(70.0, jerk=10_000.0, buffer="blending_next")
    second = cell.x.move_absolute(150.0, jerk=5000.0, buffer="blending_next")
    assert cell.end_of(first) is None
    assert cell.where("x") == pytest.approx(70.0, abs=0.1)
    assert cell.end_of(second) is None
    assert "needs a longer averaging time than the previous moves" in second.note
    cell.end_of(cell.x.move_absolute(0.0, jerk=math.inf, buffer="blending_next"))
    third = cell.x.move_absolute(100.0, jerk=math.inf, buffer="blending_next")
    fourth = cell.x.move_absolute(150.0, buffer="blending_next")
    assert cell.end_of(third) is None
    assert cell.end_of(fourth) is None
    assert "needs a longer averaging time" in fourth.note
    assert led.worst(2) <= HARD * 1.001


def test_a_move_without_a_jerk_is_blended_with_the_jerk_of_the_one_before(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    cell.x.move_absolute(70.0, velocity=60.0, buffer="blending_next")
    second = cell.x.move_absolute(150.0, velocity=100.0, jerk=math.inf, buffer="blending_next")
    assert cell.end_of(second) is None
    assert second.note == ""
    assert speed_at(led, 70.0) == pytest.approx(100.0, abs=0.1)
    must_be_soft(led)


def test_a_jerk_limited_blend_after_a_move_of_the_drive_is_refused_with_the_remedy(scenario):
    cell = soft(scenario, GENERIC)
    first = cell.x.move_absolute(70.0)
    cell.run(0.1)
    error = cell.failure_of(cell.x.move_absolute(150.0, buffer="blending_next"))
    assert isinstance(error, StateError)
    assert "with a jerk limit only one in csp" in str(error)
    assert "let the first move begin with a blending mode, too" in str(error)
    assert cell.end_of(first) is None
    cell = soft(scenario, WITHOUT_JERK)
    first = cell.x.move_absolute(70.0, jerk=math.inf)
    cell.run(0.2)
    assert isinstance(cell.failure_of(cell.x.move_absolute(150.0, buffer="blending_next")), StateError)
    assert cell.end_of(first) is None
    first = cell.x.move_velocity(-30.0)
    assert isinstance(cell.failure_of(cell.x.move_absolute(0.0, buffer="blending_next")), StateError)
    assert cell.end_of(first) is None


def test_a_drive_without_csp_plans_them_itself_or_refuses(scenario):
    modes = 'modes = ["pp", "pv", "hm"]'
    cell = soft(scenario, GENERIC, axis=modes)
    assert cell.end_of(cell.x.move_absolute(20.0, buffer="blending_next")) is None
    assert cell.device().read(0x6086, 0) == 3
    cell = soft(scenario, WITHOUT_JERK, axis=modes)
    assert isinstance(cell.failure_of(cell.x.move_absolute(20.0, buffer="blending_next")), StateError)


def test_an_override_slows_and_holds_it_and_above_1_it_is_as_fast_as_at_1(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    handles = [
        cell.x.move_absolute(70.0, velocity=100.0, buffer="blending_next"),
        cell.x.move_absolute(300.0, velocity=60.0, buffer="blending_high"),
    ]
    for factor in (0.3, 0.0, 1.5, 0.6):
        cell.x.set_override(factor).wait()
        cell.run(1.0)
        if not factor:
            assert cell.x.velocity == pytest.approx(0.0, abs=0.5)
            assert handles[1].busy
    assert cell.end_of(handles[1], 20.0) is None
    assert handles[0].done
    assert led.worst(1) <= 100.0 * 1.001
    must_be_soft(led)
    assert cell.where("x") == pytest.approx(300.0, abs=0.1)


@pytest.mark.parametrize("call", ["halt", "stop"])
def test_a_halt_and_a_stop_are_as_hard_as_without_and_end_all(scenario, call):
    cell = soft(scenario, WITHOUT_JERK)
    handles = [cell.x.move_absolute(at, velocity=200.0, buffer="blending_next") for at in (150.0, 300.0)]
    cell.until(lambda: cell.where("x") > 100.0)
    begun = cell.where("x")
    assert cell.end_of(getattr(cell.x, call)()) is None
    assert cell.where("x") - begun < 200.0**2 / (2 * HARD) + 0.05 * 200.0
    assert all(isinstance(handle.exception(), Stopped) for handle in handles)
    if call == "stop":
        cell.x.release().wait(5)
    assert cell.end_of(cell.x.move_absolute(0.0)) is None


@pytest.mark.parametrize("moment", [0.2, 0.6, 0.9])
@pytest.mark.parametrize("by", ["move", "velocity", "harder"])
def test_a_move_that_takes_over_begins_with_the_present_velocity_and_acceleration(scenario, moment, by):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    handles = [
        cell.x.move_absolute(60.0, velocity=100.0, buffer="blending_next"),
        cell.x.move_absolute(150.0, velocity=30.0, buffer="blending_next"),
    ]
    cell.run(moment)
    if by == "velocity":
        assert cell.end_of(cell.x.move_velocity(-20.0)) is None
    else:
        ramps = {"acceleration": 300.0} if by == "harder" else {}
        assert cell.end_of(cell.x.move_absolute(20.0, **ramps)) is None
        assert cell.where("x") == pytest.approx(20.0, abs=NEAR)
    assert isinstance(handles[1].exception(), Replaced)
    assert led.worst(2) <= HARD * 1.001
    assert led.worst(3) <= 1.001 * JERK
    assert len([row for row in led.rows if row]) == 1


def test_an_end_beyond_the_limits_is_refused_and_the_running_moves_continue(scenario):
    cell = soft(scenario, WITHOUT_JERK, axis="position_limits = [-10.0, 100.0]")
    first = cell.x.move_absolute(70.0, buffer="blending_next")
    second = cell.x.move_relative(50.0, buffer="blending_next")
    assert isinstance(cell.failure_of(second), LimitError)
    assert cell.end_of(first) is None
    assert cell.where("x") == pytest.approx(70.0, abs=0.1)


def test_a_virtual_axis_blends_moves_with_a_jerk_limit_too(scenario):
    cell = scenario.simulated(text=cell_text("", more=virtual("max_velocity = 400.0")))
    v = cell["v"]
    v.enable().wait(5)
    led = ComputedMotion(cell, "v")
    v.move_absolute(50.0, velocity=100.0, jerk=JERK)
    last = v.move_absolute(120.0, velocity=40.0, jerk=JERK, buffer="blending_high")
    assert cell.end_of(last) is None
    assert last.note == ""
    assert speed_at(led, 50.0) == pytest.approx(100.0, abs=0.5)
    must_be_soft(led)
    assert v.position == 120.0


def test_a_fault_during_the_moves_ends_all_of_them(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    handles = [cell.x.move_absolute(at, buffer="blending_next") for at in (60.0, 90.0, 150.0)]
    cell.until(lambda: handles[0].done)
    cell.drive().fault(0x2310)
    assert all(cell.end_of(handle) is not None for handle in handles[1:])
    cell.run(1.0)
    cell.x.reset().wait(5)
    cell.x.enable().wait(5)
    where = cell.where("x")
    cell.run(1.0)
    assert cell.where("x") == pytest.approx(where, abs=0.1)
    assert cell.end_of(cell.x.move_absolute(0.0, buffer="blending_next")) is None


@pytest.mark.parametrize("seed", range(8))
def test_random_moves_that_join_at_random_times_keep_their_jerk(scenario, seed):
    cell, chance = soft(scenario, WITHOUT_JERK, axis="max_acceleration = 500"), random.Random(seed)
    led, end = ComputedMotion(cell), 0.0
    handles = []
    for _ in range(12):
        end += chance.choice([0.0, 0.02, 1.0, 20.0, 80.0]) * chance.choice([1.0, 1.0, -1.0])
        ways = {"velocity": chance.choice([20.0, 100.0, 300.0]), "acceleration": chance.choice([200.0, HARD])}
        mode = f"blending_{chance.choice(sorted(FASTER))}"
        handles.append(cell.x.move_absolute(end, **ways, buffer=mode))
        cell.run(chance.choice([0.0, 0.05, 0.3, 0.8]))
        if chance.random() < 0.3:
            cell.x.set_override(chance.choice([0.3, 0.7, 1.0, 1.5])).wait()
    cell.x.set_override(1.0).wait()
    assert cell.end_of(handles[-1], 60.0) is None
    assert all(handle.done for handle in handles)
    assert cell.where("x") == pytest.approx(end, abs=0.1)
    must_be_soft(led)
