"""Velocities with a jerk limit: by the drive if it has one, otherwise streamed by the master; changes from and to other moves."""

from __future__ import annotations

import math
import random

import pytest

from axisbus.errors import ArgumentError, Interrupted, LimitError, MotionTimeout, Replaced, StateError
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.cell import cell_text
from kit.scenarios.jerk_limited import (
    JERK,
    NEAR,
    PERIOD,
    WITHOUT_JERK,
    ComputedMotion,
    Demand,
    differences,
    soft,
    without_jerk,
)
from kit.virtual_axis import virtual

CSP, PV = 8, 3
TYPE, LIMIT = 0x6086, 0x60A4
HARD = 500.0  # deg/s²


def must_be_soft(seen, hardest=HARD, jerk=JERK):
    assert seen.worst(2) <= hardest * 1.001
    assert seen.worst(3) <= jerk * 1.001


# -- by the drive --------------------------------------------------------------------------------------------------------


def test_a_drive_with_a_profile_jerk_limits_it_itself(scenario):
    cell = scenario.simulated("x").enabled()
    demand = Demand(cell)
    assert cell.end_of(cell.x.move_velocity(100.0, jerk=JERK)) is None
    assert cell.x.snapshot.mode == PV
    assert (cell.device().read(TYPE, 0), cell.device().read(LIMIT, 1)) == (3, JERK * 100)
    assert cell.end_of(cell.x.move_velocity(-100.0, jerk=JERK)) is None
    cell.run(0.5)
    assert demand.worst(2) == pytest.approx(HARD, rel=1e-3)
    assert 0.45 * JERK < demand.worst(3) <= JERK * 1.001
    assert cell.x.velocity == pytest.approx(-100.0, abs=1.0)


def test_the_type_of_profile_is_put_back_for_a_velocity_without_a_jerk_and_for_a_jog(scenario):
    cell = soft(scenario)
    for call in (lambda: cell.x.move_velocity(50.0, jerk=math.inf), lambda: cell.x.jog(50.0)):
        assert cell.end_of(cell.x.move_velocity(30.0)) is None
        assert cell.device().read(TYPE, 0) == 3
        handle = call()
        cell.run(0.1)
        assert cell.device().read(TYPE, 0) == 0
        assert not handle.exception() if handle.done else handle.busy
        cell.end_of(cell.x.halt())


def test_an_override_of_a_velocity_that_the_drive_makes_keeps_its_jerk(scenario):
    cell = soft(scenario)
    demand = Demand(cell)
    assert cell.end_of(cell.x.move_velocity(100.0)) is None
    for factor in (0.3, 1.5, 0.0, 1.0):
        cell.x.set_override(factor).wait()
        cell.run(1.0)
        assert cell.x.velocity == pytest.approx(100.0 * factor, abs=2.0)
    must_be_soft(demand)


def test_a_drive_that_takes_long_for_its_jerk_limit_does_not_count_as_jammed(scenario):
    """From 300 to rest and back in four seconds of softness: it is hundreds of degrees from where its ramps alone would have it."""
    cell = scenario.simulated("x", axis="following_error = 5.0").enabled()
    for velocity in (300.0, -300.0, 0.0):
        assert cell.end_of(cell.x.move_velocity(velocity, acceleration=400.0, jerk=200.0), 30.0) is None
        cell.run(1.0)
    assert cell.x.state is AxisState.CONTINUOUS_MOTION


def test_a_drive_that_is_jammed_during_a_jerk_limited_velocity_is_detected(scenario):
    cell = soft(scenario)
    assert cell.end_of(cell.x.move_velocity(100.0)) is None
    cell.jam()
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 5.0)


def test_a_soft_drive_is_stopped_ahead_of_its_position_limits(scenario):
    """Its halt may be as soft as its ramps: its braking distance is counted."""
    cell = soft(scenario, axis="position_limits = [-10.0, 100.0]")
    cell.x.move_velocity(200.0)
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP)
    assert isinstance(cell.x.error, LimitError)
    # 0.2 s by which the jerk may prolong its ramps: half of that at its speed, after as much of its rise.
    room = 100.0 - cell.where("x")
    assert room > 200.0**2 / (2 * HARD) + 0.1 * 180.0
    cell.run(1.0)
    assert cell.where("x") <= 100.0


# -- by the master -------------------------------------------------------------------------------------------------------


def test_without_a_profile_jerk_the_master_controls_the_velocity(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    led, begun = ComputedMotion(cell), cell.now
    handle = cell.x.move_velocity(100.0)
    assert cell.end_of(handle) is None
    assert cell.now - begun < 100.0 / HARD + HARD / JERK + 0.4
    assert (cell.x.snapshot.mode, cell.x.state) == (CSP, AxisState.CONTINUOUS_MOTION)
    cell.run(1.0)
    assert cell.x.velocity == pytest.approx(100.0, abs=0.5)
    assert cell.end_of(cell.x.move_velocity(-60.0)) is None
    cell.run(0.5)
    assert cell.x.velocity == pytest.approx(-60.0, abs=0.5)
    assert led.worst(2) == pytest.approx(HARD)
    assert 0.95 * JERK < led.worst(3) <= JERK * 1.001
    assert len([row for row in led.rows if row]) == 1


def test_without_a_jerk_the_drive_makes_the_ramp(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    assert cell.end_of(cell.x.move_velocity(50.0, jerk=math.inf)) is None
    assert cell.x.snapshot.mode == PV
    error = cell.failure_of(cell.x.move_velocity(80.0))
    assert isinstance(error, StateError)
    assert "no profile jerk (60A4h with 6086h)" in str(error)
    assert cell.x.velocity == pytest.approx(50.0, abs=2.0)


def test_a_velocity_of_0_stops_the_axis_under_control_of_the_master(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    cell.end_of(cell.x.move_velocity(100.0))
    assert cell.end_of(cell.x.move_velocity(0.0)) is None
    must_be_soft(led)
    where = cell.where("x")
    cell.run(1.0)
    assert cell.where("x") == pytest.approx(where, abs=0.05)
    assert cell.x.state is AxisState.CONTINUOUS_MOTION
    assert cell.end_of(cell.x.move_absolute(0.0)) is None
    assert cell.where("x") == pytest.approx(0.0, abs=NEAR)


@pytest.mark.parametrize("moment", [0.05, 0.15, 0.2, 0.5])
@pytest.mark.parametrize("target", [300.0, 20.0, -50.0])
def test_a_move_takes_over_from_it_with_its_velocity_and_its_acceleration(scenario, moment, target):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    first = cell.x.move_velocity(100.0)
    cell.run(moment)
    second = cell.x.move_absolute(target)
    assert cell.end_of(second) is None
    assert first.done or isinstance(first.exception(), Replaced)
    assert cell.where("x") == pytest.approx(target, abs=NEAR)
    assert cell.x.state is AxisState.STANDSTILL
    must_be_soft(led)
    assert len([row for row in led.rows if row]) == 1


@pytest.mark.parametrize("moment", [0.1, 0.2, 0.25, 0.6, 2.03])
@pytest.mark.parametrize("velocity", [80.0, 0.0, -80.0])
def test_a_jerk_limited_velocity_takes_over_from_a_running_move(scenario, moment, velocity):
    """Speeding up, going evenly, and braking; with another acceleration as well."""
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    first = cell.x.move_absolute(200.0)
    cell.run(moment)
    second = cell.x.move_velocity(velocity, acceleration=300.0)
    assert cell.end_of(second) is None
    assert isinstance(first.exception(), Interrupted)
    cell.run(0.3)
    assert cell.x.velocity == pytest.approx(velocity, abs=0.5)
    must_be_soft(led)


@pytest.mark.parametrize("moment", [0.1, 0.5, 2.03])
def test_out_of_a_move_without_a_jerk_it_continues_with_its_acceleration_too(scenario, moment):
    cell = soft(scenario, WITHOUT_JERK)
    cell.x.follow(TrapezoidalTrajectory(0.0, 10.0, 50.0, HARD))
    cell.run(0.1)
    cell.x.move_absolute(200.0, jerk=math.inf)  # from a streamed trajectory
    cell.run(moment)
    led = ComputedMotion(cell)
    cell.run(0.0101)
    assert cell.end_of(cell.x.move_velocity(30.0)) is None
    must_be_soft(led)


@pytest.mark.parametrize("moment", [0.1, 0.3, 1.0])
def test_a_halt_is_as_soft_and_may_be_interrupted(scenario, moment):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    cell.x.move_velocity(100.0)
    cell.run(moment)
    assert cell.end_of(cell.x.halt()) is None
    assert cell.x.state is AxisState.STANDSTILL
    must_be_soft(led)
    cell.x.move_velocity(100.0)
    cell.run(moment)
    halt = cell.x.halt()
    cell.run(0.08)
    assert halt.busy
    assert cell.end_of(cell.x.move_velocity(100.0)) is None
    assert isinstance(halt.exception(), Replaced)
    cell.x.halt()
    cell.run(0.08)
    assert cell.end_of(cell.x.move_absolute(0.0)) is None
    assert cell.where("x") == pytest.approx(0.0, abs=NEAR)
    must_be_soft(led)


@pytest.mark.parametrize("call", ["stop", "quick_stop", "disable"])
def test_every_other_stop_is_as_hard_as_without(scenario, call):
    ways = {}
    for jerk in (JERK, math.inf):
        cell = soft(scenario, WITHOUT_JERK)
        cell.end_of(cell.x.move_velocity(200.0, jerk=jerk))
        cell.run(0.5)
        begun = cell.where("x")
        assert cell.end_of(getattr(cell.x, call)()) is None
        ways[jerk] = cell.where("x") - begun
    assert ways[JERK] == pytest.approx(ways[math.inf], abs=4.5)  # two cycles
    assert ways[JERK] < 200.0**2 / (2 * HARD) + 0.7 * 200.0 * HARD / JERK


def test_a_stop_makes_a_soft_halt_hard(scenario):
    def way(*calls):
        cell = soft(scenario, WITHOUT_JERK)
        cell.end_of(cell.x.move_velocity(200.0, deceleration=200.0))
        cell.run(0.3)
        begun = cell.where("x")
        for call in calls:
            handle = getattr(cell.x, call)()
            cell.run(0.05)
        assert cell.end_of(handle) is None
        return cell.where("x") - begun

    softly, at_once = way("halt"), way("stop")
    assert softly > 200.0**2 / (2 * 200.0)
    assert at_once < 200.0**2 / (2 * HARD) + 0.1 * 200.0
    assert way("halt", "stop") < at_once + 0.06 * 200.0


@pytest.mark.parametrize("eds", [WITHOUT_JERK, None])
def test_an_override_scales_and_holds_it_and_the_handle_waits(scenario, eds):
    if eds is None:
        cell, name = scenario.simulated(text=cell_text("", more=virtual("max_velocity = 400.0"))), "v"
        cell[name].enable().wait(5)
    else:
        cell, name = soft(scenario, eds), "x"
    axis, led = cell[name], ComputedMotion(cell, name)
    axis.set_override(0.0).wait()
    handle = axis.move_velocity(300.0, jerk=JERK)
    cell.run(10.0)
    assert handle.busy
    for factor in (0.3, 1.5, 0.5, 0.0):
        axis.set_override(factor).wait()
        cell.run(1.5)
        assert axis.velocity == pytest.approx(min(300.0 * factor, 400.0), abs=2.0)
    assert handle.done
    must_be_soft(led)


# -- limits ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("velocity", [200.0, -200.0])
@pytest.mark.parametrize("deceleration", [100.0, 500.0])
def test_a_jerk_limited_velocity_is_braked_before_the_position_limits_by_the_axis_deceleration(
    scenario, velocity, deceleration
):
    cell = soft(scenario, WITHOUT_JERK, axis="position_limits = [-150.0, 150.0]")
    cell.x.move_velocity(velocity, deceleration=deceleration)
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP and cell.core().stop_sequence is None)
    assert isinstance(cell.x.error, LimitError)
    assert "about to leave its position limits" in str(cell.x.error)
    assert 140.0 < abs(cell.where("x")) <= 150.0 + 0.1
    cell.x.reset().wait(5)
    assert cell.end_of(cell.x.move_velocity(math.copysign(20.0, -velocity))) is None


def test_a_soft_halt_for_which_there_is_no_room_is_a_hard_one(scenario):
    cell = soft(scenario, WITHOUT_JERK, axis="position_limits = [-150.0, 150.0]")
    cell.x.move_velocity(200.0, deceleration=60.0)
    cell.until(lambda: cell.where("x") > 60.0)
    assert cell.end_of(cell.x.halt()) is None
    assert 140.0 < cell.where("x") <= 150.0 + 0.1
    assert cell.x.state is AxisState.STANDSTILL


def test_a_velocity_back_that_would_first_exceed_the_limits_is_refused(scenario):
    cell = soft(scenario, WITHOUT_JERK, axis="position_limits = [-10.0, 205.0]")
    first = cell.x.move_absolute(200.0, velocity=300.0)
    cell.run(0.62)
    error = cell.failure_of(cell.x.move_velocity(-50.0, acceleration=100.0))
    assert isinstance(error, LimitError)
    assert "could not stop within the position limits" in str(error)
    assert cell.end_of(first) is None
    assert cell.where("x") == pytest.approx(200.0, abs=NEAR)


def test_a_move_out_of_a_velocity_that_could_not_stop_in_time_is_refused(scenario):
    """The acceleration that is ended first, and the mean that continues, count."""
    cell = soft(scenario, WITHOUT_JERK, axis="position_limits = [-10.0, 120.0]")
    cell.x.move_velocity(200.0)
    cell.until(lambda: cell.where("x") > 60.0)
    error = cell.failure_of(cell.x.move_absolute(0.0))
    assert isinstance(error, LimitError)
    assert "could not stop within the position limits" in str(error)
    cell.run(0.1)
    assert cell.x.velocity > 150.0


def test_before_homing_no_position_limit_holds(scenario):
    cell = scenario.simulated(
        text=cell_text("x", eds=without_jerk(scenario), axis="position_limits = [-20.0, 20.0]").replace(
            "required = false", "required = true"
        )
    ).enabled()
    assert cell.end_of(cell.x.move_velocity(100.0, jerk=JERK)) is None
    cell.run(1.0)
    assert cell.where("x") > 50.0
    assert cell.x.state is AxisState.CONTINUOUS_MOTION


@pytest.mark.parametrize("jerk", [0.0, -1.0, math.nan, "soft"])
def test_an_invalid_jerk_is_refused_at_the_call(scenario, jerk):
    cell = scenario.simulated("x")
    with pytest.raises(ArgumentError, match="jerk"):
        cell.x.move_velocity(10.0, jerk=jerk)


def test_a_jerk_that_would_take_seconds_is_refused_and_nothing_moves(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    error = cell.failure_of(cell.x.move_velocity(10.0, deceleration=600.0, jerk=2399.0))
    assert isinstance(error, LimitError)
    assert "jerk 2399 is too small" in str(error)
    assert cell.x.state is AxisState.STANDSTILL
    assert cell.end_of(cell.x.move_velocity(10.0, deceleration=600.0, jerk=2401.0)) is None


def test_a_drive_without_csp_and_without_a_profile_jerk_cannot(scenario):
    cell = soft(scenario, WITHOUT_JERK, axis='modes = ["pp", "pv", "hm"]')
    error = cell.failure_of(cell.x.move_velocity(10.0))
    assert isinstance(error, StateError)
    assert "its jerk cannot be limited" in str(error)
    assert cell.end_of(cell.x.move_velocity(10.0, jerk=math.inf)) is None


# -- faults, and with other things -------------------------------------------------------------------------------------------


def test_an_axis_that_jams_is_detected_and_stopped(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    cell.end_of(cell.x.move_velocity(100.0))
    cell.jam()
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 5.0)
    cell.free()
    cell.until(lambda: cell.core().stop_sequence is None, 5.0)
    cell.x.reset().wait(5)
    cell.x.enable().wait(5)
    assert cell.end_of(cell.x.move_velocity(50.0)) is None


def test_a_velocity_that_is_not_reached_in_time_ends_with_an_error_and_the_axis_brakes_on_its_path(scenario):
    cell = soft(scenario, WITHOUT_JERK)
    led = ComputedMotion(cell)
    error = cell.failure_of(cell.x.move_velocity(100.0, timeout=0.05))
    assert isinstance(error, MotionTimeout)
    assert "has not reached 100 deg/s" in str(error)
    assert cell.x.state is AxisState.ERRORSTOP
    cell.until(lambda: cell.core().stop_sequence is None, 5.0)
    assert led.worst(2) <= HARD * 1.001
    assert cell.core().stop_sequence is None


def test_a_buffered_move_begins_when_the_velocity_is_reached_and_a_blended_one_is_buffered(
    scenario,
):
    cell = soft(scenario, WITHOUT_JERK)
    turning = cell.x.move_velocity(50.0)
    waits = cell.x.move_absolute(100.0, buffer=True)
    blended = cell.x.move_absolute(120.0, buffer="blending_next")
    for handle, place in ((waits, 100.0), (blended, 120.0)):
        assert cell.end_of(handle) is None
        assert cell.where("x") == pytest.approx(place, abs=NEAR)
    assert turning.done
    assert "buffered instead of blended" in blended.note


def test_a_distance_is_laid_over_it_and_a_slave_follows_it(scenario):
    cell = scenario.simulated("xy", eds=without_jerk(scenario)).enabled()
    x, y = cell["x"], cell["y"]
    assert cell.end_of(y.gear_in(x, 0.5)) is None
    assert cell.end_of(x.move_velocity(60.0, jerk=JERK)) is None
    cell.run(1.0)
    assert y.velocity == pytest.approx(30.0, abs=0.5)
    before = cell.where("x")
    assert cell.end_of(x.move_superimposed(5.0, velocity=20.0)) is None
    assert cell.x.state is AxisState.CONTINUOUS_MOTION
    assert cell.end_of(x.halt()) is None
    cell.run(0.3)
    assert cell.where("y") == pytest.approx(0.5 * cell.where("x"), abs=NEAR)
    assert cell.where("x") > before


def test_an_endless_axis_rotates_and_a_move_continues_to_its_position_in_the_turn(scenario):
    cell = soft(scenario, WITHOUT_JERK, axis="modulo = 360.0")
    led = ComputedMotion(cell)
    assert cell.end_of(cell.x.move_velocity(390.0)) is None
    cell.run(5.0)
    assert 0.0 <= cell.x.position < 360.0
    assert cell.where("x") > 4 * 360.0
    assert cell.end_of(cell.x.move_absolute(10.0, direction=1)) is None
    assert cell.x.position == pytest.approx(10.0, abs=NEAR)
    must_be_soft(led)


def test_a_failing_axis_stops_the_others_without_jerk_limit(scenario):
    cell = scenario.simulated("xy", eds=without_jerk(scenario)).enabled()
    for axis in cell.machine:
        assert cell.end_of(axis.move_velocity(100.0, jerk=JERK)) is None
    led = ComputedMotion(cell, "y")
    cell.run(0.1)
    cell.drive("x").fault(0x2310)
    cell.until(lambda: cell["y"].state is AxisState.STANDSTILL, 5.0)
    assert led.worst(2) <= HARD * 1.001
    assert led.worst(3) > 3 * JERK


def test_other_modes_take_over_from_it_without_a_jolt(scenario):
    for call in ("pv", "homing", "csv"):
        cell = soft(scenario, WITHOUT_JERK)
        demand = Demand(cell)
        cell.end_of(cell.x.move_velocity(60.0))
        if call == "pv":
            assert cell.end_of(cell.x.move_velocity(30.0, jerk=math.inf)) is None
            assert demand.worst(2) <= 2.5 * HARD
        else:
            error = cell.failure_of(cell.x.home() if call == "homing" else cell.x.cyclic_velocity(10.0))
            assert isinstance(error, StateError)
            assert cell.x.velocity == pytest.approx(60.0, abs=1.0)


@pytest.mark.parametrize("seed", range(10))
def test_random_velocities_moves_halts_and_overrides_keep_jerk_and_acceleration(scenario, seed):
    cell, chance = soft(scenario, WITHOUT_JERK, axis="max_acceleration = 1000.0"), random.Random(seed)
    led, handles = ComputedMotion(cell), []
    ramps = (200.0, 500.0, 1000.0)
    for _ in range(30):
        kind = chance.choice("vvvmho")
        if kind == "v":
            velocity = chance.choice([0.0, 30.0, chance.uniform(-300.0, 300.0), 400.0, -400.0])
            ways = {"acceleration": chance.choice(ramps), "deceleration": chance.choice(ramps)}
            handles.append(cell.x.move_velocity(velocity, **ways))
        elif kind == "m":
            handles.append(cell.x.move_absolute(chance.uniform(-300.0, 300.0)))
            cell.run(chance.choice([0.02, 0.3]))
        elif kind == "h" and cell.x.state is AxisState.CONTINUOUS_MOTION:
            handles.append(cell.x.halt())
        else:
            cell.x.set_override(chance.choice([0.0, 0.3, 1.0, 1.5])).wait()
        cell.run(chance.choice([0.0, 0.01, 0.05, 0.3, 1.0]))
    cell.x.set_override(1.0).wait()
    cell.run(1.0)
    assert cell.end_of(cell.x.halt()) is None
    assert all(not handle.busy for handle in handles)
    assert cell.x.state is AxisState.STANDSTILL
    rows = [row for row in led.rows if len(row) > 3]
    assert max(abs(v) for row in rows for v in differences(row, 1)) <= 400.0 * 1.001
    assert max(abs(v) for row in rows for v in differences(row, 2)) <= 1000.0 * 1.001
    assert sum(map(len, rows)) * PERIOD > 3.0
