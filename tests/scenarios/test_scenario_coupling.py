"""Gears and cams on the plant: in step within an increment and a cycle, into step without a jolt, braked without a master."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest

from axisbus import Cam, wait
from axisbus.errors import ArgumentError, Interrupted, LimitError, StateError
from axisbus.motion.axis.fast_path import FastPath
from axisbus.motion.coupling.master import LagCorrection
from axisbus.motion.coupling.slave_axis import Coupled
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.cell import SCALE, Cell
from kit.plant_probe import ENABLED
from kit.virtual_axis import Trail, virtual

AXIS = "max_acceleration = 2000.0"
ALONE = 'on_lost_node = "report"'  # else the fault policy stops the slave before its joint does
CYCLE = 0.01  # seconds
INCREMENT = 1.0 / SCALE
STEP = INCREMENT / CYCLE**2  # deg/s²: the effect of rounding to increments on an acceleration
LOBE = [(0.0, 0.0), (90.0, 20.0), (180.0, 0.0), (270.0, -10.0), (360.0, 0.0)]


def two(scenario, names: str = "xy", **changes: str) -> Cell:
    return scenario.simulated(names, **{"axis": AXIS} | changes).enabled()


def off(cell: Cell, law, since: float, slave: str = "y", master: str = "x", late: float = CYCLE) -> float:
    """How far the slave's motor was at most from where its master's, one cycle before, has it."""
    xs, ys = cell.record(master).samples, cell.record(slave).samples
    step = xs[1].time - xs[0].time
    shift = round(late / step)
    pairs = [(x, y) for x, y in zip(xs, ys[shift:], strict=False) if x.time >= since]
    assert len(pairs) > 50
    return max(abs(y.position - law(x.position)) for x, y in pairs)


def must_brake(cell: Cell, name: str) -> None:
    cell.run(1.0)
    cell.must_be_still(name, within=0.1, stages=ENABLED)
    assert cell.hardest_change(name) < 2100.0


# In step.


@pytest.mark.parametrize("ratio", [1.0, 2.0, -0.75, 0.001])
def test_a_gear_keeps_to_its_master_within_an_increment_and_a_cycle(scenario, ratio):
    cell = two(scenario)
    assert cell.end_of(cell["y"].gear_in(cell["x"], ratio)) is None
    since = cell.moment()
    cell.end_of(cell["x"].follow([(0.0, 0.0), (0.8, 40.0), (1.4, 25.0), (2.5, 60.0)]))
    cell.run(0.2)
    assert cell["y"].state is AxisState.SYNCHRONIZED_MOTION
    assert cell.where("y") == pytest.approx(60.0 * ratio, abs=INCREMENT)
    assert off(cell, lambda x: ratio * x, since) <= (1.0 + abs(ratio)) * INCREMENT


def test_a_gear_follows_a_profile_move_of_its_master_without_a_jolt(scenario):
    """In profile position mode the drive controls the master axis: its positions are rounded to increments."""
    cell = two(scenario)
    cell.end_of(cell["y"].gear_in(cell["x"], 1.5))
    since = cell.moment()
    assert cell.end_of(cell["x"].move_absolute(60.0)) is None
    cell.run(0.4)
    assert cell.where("y") == pytest.approx(90.0, abs=2.0 * INCREMENT)
    assert off(cell, lambda x: 1.5 * x, since, late=2 * CYCLE) < 3.0
    assert cell.hardest_change("y") < 1500.0


@pytest.mark.parametrize("names", ["xy", "xyz"])
def test_a_gear_follows_a_profile_move_whose_demand_comes_only_at_every_nth_sync(scenario, names):
    """On a busy bus, the drives send 6062h less often than 6064h: the slave must notice at once that its master moves."""
    cell = two(scenario, names, period="2ms", bus="bitrate = 1000000", axis="max_acceleration = 4000.0")
    cell.end_of(cell["y"].gear_in(cell["x"], 1.0))
    for distance in (20.0, -20.0):
        assert cell.end_of(cell["x"].move_relative(distance, velocity=90.0, acceleration=2000.0)) is None
        cell.run(0.2)
    assert cell["y"].state is AxisState.SYNCHRONIZED_MOTION
    assert cell.where("y") == pytest.approx(cell.where("x"), abs=2.0 * INCREMENT)


@pytest.mark.parametrize("every", [2, 3, 4, 5, 8])
def test_a_gear_follows_positions_that_come_only_at_every_nth_sync(scenario, every):
    """The position of an encoder, or of a drive whose TPDO is sent less often, corrects the estimate in steps."""
    seldom = {"every": {"position": every}}
    cell = two(scenario, axis="max_acceleration = 4000.0", port=lambda node, _: seldom if node == 1 else {})
    cell.end_of(cell["y"].gear_in(cell["x"], 1.0, master_value_source="actual"))
    for distance in (60.0, -60.0):
        assert cell.end_of(cell["x"].move_relative(distance, velocity=90.0, acceleration=500.0)) is None
        cell.run(0.5)
    assert cell["y"].state is AxisState.SYNCHRONIZED_MOTION
    assert cell.where("y") == pytest.approx(cell.where("x"), abs=2.0 * INCREMENT)
    print(every, cell.hardest_change("y"), off(cell, lambda x: x, 0.0, late=2 * CYCLE))
    assert cell.hardest_change("y") < 2000.0


# Shifted.


def shifting(scenario) -> Cell:
    """A cell whose x moves at 30 deg/s, with y synchronised."""
    cell = two(scenario)
    cell.end_of(cell["y"].gear_in(cell["x"], 2.0))
    cell["x"].follow(TrapezoidalTrajectory(0.0, 180.0, 30.0, 60.0))
    cell.run(1.5)
    return cell


def test_a_slave_may_see_its_master_shifted_while_both_continue(scenario):
    cell = shifting(scenario)
    moment = cell.moment()
    phase = cell["y"].phasing_relative(10.0, velocity=20.0, acceleration=100.0)
    cell.run(0.3)
    assert phase.busy
    assert cell.end_of(phase) is None
    assert cell["y"].state is AxisState.SYNCHRONIZED_MOTION
    since = cell.moment()
    cell.run(1.0)
    assert off(cell, lambda x: 2.0 * (x + 10.0), since) <= 3.0 * INCREMENT
    assert cell.hardest_change("y", since=moment) < 2.0 * 100.0 + STEP
    cell.run(6.0)
    assert cell.where("y") == pytest.approx(380.0, abs=2.0 * INCREMENT)


def test_shifts_add_up_and_the_one_before_ends_as_replaced(scenario):
    cell = shifting(scenario)
    moment = cell.moment()
    first = cell["y"].phasing_relative(-8.0, velocity=10.0, acceleration=50.0)
    cell.run(0.4)
    assert cell.end_of(cell["y"].phasing_relative(20.0, velocity=10.0, acceleration=50.0)) is None
    assert isinstance(first.exception(), Interrupted)
    since = cell.moment()
    cell.run(0.8)
    assert off(cell, lambda x: 2.0 * (x + 12.0), since) <= 3.0 * INCREMENT
    assert cell.hardest_change("y", since=moment) < 2.0 * 50.0 + STEP


@pytest.mark.parametrize("stop", ["halt", "stop", "gear_out"])
def test_a_command_that_ends_a_gear_ends_a_running_phase_shift(scenario, stop):
    cell = shifting(scenario)
    phase = cell["y"].phasing_relative(30.0, velocity=10.0, acceleration=50.0)
    cell.run(0.3)
    cell.end_of(getattr(cell["y"], stop)())
    assert isinstance(phase.exception(), Interrupted)
    assert cell.hardest_change("y") < 2100.0
    if stop != "gear_out":
        must_brake(cell, "y")


def test_a_phase_shift_is_refused_if_the_axis_is_not_synchronised(scenario):
    cell = two(scenario)
    error = cell.failure_of(cell["y"].phasing_relative(1.0, velocity=1.0, acceleration=1.0))
    assert isinstance(error, StateError)
    cell["x"].follow([(0.0, 0.0), (6.0, 180.0)])
    cell["y"].gear_in(cell["x"], 1.0, sync_positions=(90.0, 40.0), master_start_distance=40.0)
    cell.run(0.3)
    error = cell.failure_of(cell["y"].phasing_relative(1.0, velocity=1.0, acceleration=1.0))
    assert isinstance(error, StateError)
    assert "not synchronised" in error.message
    with pytest.raises(ArgumentError):
        cell["y"].phasing_relative(1.0, velocity=0.0, acceleration=1.0)


def test_a_gear_takes_up_the_speed_of_a_master_that_turns(scenario):
    cell = two(scenario)
    cell["x"].move_velocity(80.0).wait()
    assert cell.end_of(cell["y"].gear_in(cell["x"], 2.0, acceleration=400.0)) is None
    assert cell["y"].velocity == pytest.approx(160.0, abs=5.0)
    assert cell.hardest_change("y") < 500.0
    cell.run(0.3)
    away = cell.where("y") - 2.0 * cell.where("x")
    cell.run(2.0)
    assert cell.where("y") - 2.0 * cell.where("x") == pytest.approx(away, abs=3 * INCREMENT)


def test_a_new_gear_ratio_is_reached_from_the_present_velocity(scenario):
    cell = two(scenario)
    cell["x"].move_velocity(80.0).wait()
    for ratio in (1.0, -1.0, 0.5):
        assert cell.end_of(cell["y"].gear_in(cell["x"], ratio)) is None
        cell.run(0.3)
        assert cell["y"].velocity == pytest.approx(80.0 * ratio, abs=2.0)
    assert cell.hardest_change("y") < 700.0


@pytest.mark.parametrize("back", [False, True])
def test_master_and_slave_are_at_their_sync_positions_at_the_same_time(scenario, back):
    way = -1.0 if back else 1.0
    cell = two(scenario)
    handle = cell["y"].gear_in(cell["x"], 0.5, sync_positions=(way * 60.0, 25.0), master_start_distance=30.0)
    cell.run(0.2)
    assert handle.active
    since = cell.moment()
    cell["x"].follow([(0.0, 0.0), (4.0, way * 120.0)]).wait()
    assert cell.end_of(handle) is None
    cell.run(0.3)
    assert cell.where("y") == pytest.approx(25.0 + way * 30.0, abs=2 * INCREMENT)
    xs = cell.record("x").since(since)
    reached = next(x.time for x in xs if way * x.position >= 60.0)
    assert off(cell, lambda x: 25.0 + 0.5 * (x - way * 60.0), reached) <= 2 * INCREMENT
    before = [
        y.position for x, y in zip(xs, cell.record("y").since(since), strict=False) if way * x.position < 29.0
    ]
    assert max(map(abs, before)) < INCREMENT
    assert cell.hardest_change("y") < 700.0


def test_an_endless_master_reaches_the_sync_position_again_in_each_turn(scenario):
    cell = two(scenario, axis=AXIS + "\nmodulo = 360.0")
    cell["x"].move_velocity(200.0).wait()
    for turn in (1, 2):
        begun = cell.now
        handle = cell["y"].gear_in(cell["x"], 1.0, sync_positions=(90.0, 45.0), master_start_distance=180.0)
        assert cell.end_of(handle) is None
        cell.run(0.1)
        assert (cell["y"].position - cell["x"].position) % 360.0 == pytest.approx(315.0, abs=4.1), (
            turn
        )  # two cycles at 200 deg/s
        assert cell.now - begun < 4.0
        cell["y"].halt().wait()


def test_a_cam_is_kept_to_over_many_turns_in_both_directions(scenario):
    cell = two(scenario, axis="max_acceleration = 5000.0")
    cam = Cam(LOBE, periodic=True)
    assert cell.end_of(cell["y"].cam_in(cell["x"], cam)) is None
    since = cell.moment()
    cell["x"].follow([(0.0, 0.0), (3.0, 500.0), (4.0, 470.0), (8.0, -380.0)]).wait()
    cell.run(0.2)
    assert off(cell, cam.at, since) <= 2 * INCREMENT
    assert cell.farthest("y") == pytest.approx(cam.span, abs=2 * INCREMENT)


def test_a_cam_that_lifts_takes_its_slave_on(scenario):
    cell = two(scenario)
    cam = Cam([(0.0, 0.0), (60.0, 5.0), (120.0, 40.0)], periodic=True)
    assert cam.lift == 40.0
    cell.end_of(cell["y"].cam_in(cell["x"], cam))
    cell["x"].follow([(0.0, 0.0), (4.0, 360.0)]).wait()
    cell.run(0.2)
    assert cell.where("y") == pytest.approx(120.0, abs=2 * INCREMENT)


def test_a_cam_that_does_not_repeat_leaves_its_slave_at_its_ends(scenario):
    cell = two(scenario)
    cam = Cam([(20.0, 0.0), (40.0, 15.0), (60.0, 10.0)])
    assert cell.end_of(cell["y"].cam_in(cell["x"], cam)) is None
    since = cell.moment()
    cell["x"].follow([(0.0, 0.0), (3.0, 100.0), (6.0, 30.0)]).wait()
    cell.run(0.2)
    assert off(cell, cam.at, since) <= 2 * INCREMENT
    assert cell.where("y") == pytest.approx(cam.at(30.0), abs=2 * INCREMENT)


def test_a_cam_is_entered_over_a_distance_of_the_master_axis_and_scaled_and_shifted(scenario):
    cell = two(scenario)
    cam = Cam(LOBE, periodic=True)
    cell["y"].move_absolute(30.0).wait()
    handle = cell["y"].cam_in(
        cell["x"], cam, master_start_distance=90.0, master_offset=45.0, slave_scaling=0.5, master_scaling=2.0
    )
    cell.run(0.3)
    assert handle.active  # its master is at standstill
    since = cell.moment()
    cell["x"].follow([(0.0, 0.0), (3.0, 300.0)]).wait()
    assert cell.end_of(handle) is None
    cell.run(0.2)
    reached = next(x.time for x in cell.record("x").since(since) if x.position >= 92.0)
    assert off(cell, lambda x: 0.5 * cam.at((x + 45.0) / 2.0), reached) <= 2 * INCREMENT
    assert cell.hardest_change("y", since) < 900.0


def test_a_relative_cam_begins_at_the_position_of_the_slave_axis(scenario):
    cell = two(scenario)
    cell["y"].move_absolute(33.0).wait()
    cam = Cam(LOBE, periodic=True)
    assert "is not at the position that belongs" in str(cell.failure_of(cell["y"].cam_in(cell["x"], cam)))
    cell.run(0.3)
    cell["y"].reset().wait()
    assert cell.end_of(cell["y"].cam_in(cell["x"], cam, relative=True)) is None
    cell["x"].follow([(0.0, 0.0), (2.0, 90.0)]).wait()
    cell.run(0.2)
    assert cell.where("y") == pytest.approx(53.0, abs=2 * INCREMENT)


def test_a_chain_is_one_cycle_later_with_each_link(scenario):
    cell = two(scenario, "xyz")
    cell.end_of(cell["y"].gear_in(cell["x"], 2.0))
    cell.end_of(cell["z"].gear_in(cell["y"], -0.5))
    since = cell.moment()
    cell["x"].follow([(0.0, 0.0), (2.0, 60.0)]).wait()
    cell.run(0.2)
    assert off(cell, lambda x: -x, since, slave="z", late=2 * CYCLE) <= 3 * INCREMENT
    assert "x is led by z is led by y is led by x" in str(cell.failure_of(cell["x"].gear_in(cell["z"], 1.0)))
    assert cell["z"].state is AxisState.SYNCHRONIZED_MOTION


def test_a_slave_follows_the_actual_position_of_a_master_without_power(scenario):
    """A master without power that is turned by hand is followed too."""
    cell = two(scenario)
    cell["x"].disable().wait()
    assert cell.end_of(cell["y"].gear_in(cell["x"], 1.0, master_value_source="actual")) is None
    motor = cell.drive("x").axis.motor
    cell.each_cycle(
        lambda *_: setattr(motor, "position", motor.position + (30.0 if motor.position < 4000 else 0.0))
    )
    cell.run(3.0)
    assert cell.where("x") == pytest.approx(40.0, abs=0.5)
    assert cell.where("y") == pytest.approx(cell.where("x"), abs=3 * INCREMENT)
    assert cell.hardest_change("y") < 2000.0


@pytest.mark.parametrize("ratio", [1.0, -2.5])
def test_a_virtual_master_is_followed_within_an_increment_and_a_cycle_in_any_mode(scenario, ratio):
    cell = scenario.simulated("x", axis=AXIS, more=virtual())
    cell.enabled()
    x, v, trail = cell["x"], cell["v"], Trail(cell)
    assert cell.end_of(x.gear_in(v, ratio)) is None
    begun = len(trail.positions)
    targets = []
    cell.each_cycle(lambda *_: targets.append(cell.core("x").image.reference_tracker.target / SCALE))
    for move in (
        lambda: v.move_absolute(30.0),
        lambda: v.move_velocity(-40.0),
        v.halt,
        lambda: v.move_absolute(5.0),
    ):
        assert cell.end_of(move()) is None
    cell.run(0.2)
    masters = trail.positions[begun:]
    pairs = list(zip(masters, targets[1:], strict=False))
    assert len(pairs) > 120
    assert (
        max(abs(target - ratio * place) for place, target in pairs)
        <= 0.5 * INCREMENT + 1e-6 + abs(ratio) * 1e-4
    )
    assert cell.hardest_change("x") < 500.0 * abs(ratio) * 1.1 + 200.0
    assert cell.where("x") == pytest.approx(5.0 * ratio, abs=INCREMENT)


def test_a_virtual_master_without_power_holds_its_slave(scenario):
    cell = scenario.simulated("x", axis=AXIS, more=virtual())
    cell.enabled()
    cell.end_of(cell["x"].gear_in(cell["v"], 1.0))
    cell["v"].move_velocity(60.0).wait()
    cell.end_of(cell["v"].disable(coast=True))
    cell.run(0.5)
    assert cell["x"].state is AxisState.SYNCHRONIZED_MOTION
    assert cell.speed("x") == 0.0
    assert cell.hardest_change("x") < 600.0


# Out of it.


def test_gear_out_keeps_the_speed_and_a_halt_brakes(scenario):
    cell = two(scenario)
    cell["x"].move_velocity(80.0).wait()
    cell.end_of(cell["y"].gear_in(cell["x"], 1.0))
    assert cell.end_of(cell["y"].gear_out()) is None
    assert cell["y"].state is AxisState.CONTINUOUS_MOTION
    cell["x"].halt().wait()
    cell.run(0.3)
    assert cell["y"].velocity == pytest.approx(80.0, abs=1.0)
    assert cell.end_of(cell["y"].halt()) is None
    must_brake(cell, "y")
    assert cell["y"].state is AxisState.STANDSTILL
    assert "is not coupled to a master axis" in str(cell.failure_of(cell["y"].gear_out()))


def test_a_halt_of_the_slave_takes_it_away_and_one_of_the_master_takes_it_along(scenario):
    cell = two(scenario)
    cell["x"].move_velocity(80.0).wait()
    cell.end_of(cell["y"].gear_in(cell["x"], 1.0))
    assert cell.end_of(cell["x"].halt()) is None
    cell.run(0.5)
    assert cell["y"].state is AxisState.SYNCHRONIZED_MOTION
    assert cell.speed("y") < 0.1
    cell["x"].move_velocity(-80.0).wait()
    cell.run(0.3)
    assert cell["y"].velocity == pytest.approx(-80.0, abs=2.0)
    assert cell.end_of(cell["y"].halt()) is None
    must_brake(cell, "y")
    assert cell.speed("x") == pytest.approx(80.0, abs=1.0)


def test_a_move_takes_over_from_the_present_speed(scenario):
    cell = two(scenario)
    cell["x"].move_velocity(80.0).wait()
    cell.end_of(cell["y"].gear_in(cell["x"], 1.0))
    assert cell.end_of(cell["y"].move_absolute(0.0)) is None
    assert cell.where("y") == pytest.approx(0.0, abs=0.1)
    assert cell.hardest_change("y") < 700.0


@pytest.mark.parametrize("when", ["waits", "takes up", "in step"])
def test_a_halt_at_any_stage_brakes_the_slave(scenario, when):
    cell = two(scenario)
    cell["x"].move_velocity(80.0).wait()
    x = cell["x"].position
    at = (x + 200.0, 10.0) if when == "waits" else None
    handle = cell["y"].gear_in(
        cell["x"],
        1.0,
        sync_positions=at,
        master_start_distance=20.0 if at else None,
        acceleration=100.0 if not at else None,
    )
    cell.run(0.3 if when != "in step" else 1.2)
    assert handle.active is (when != "in step")
    assert cell.end_of(cell["y"].halt()) is None
    assert when == "in step" or isinstance(handle.exception(), Interrupted)
    must_brake(cell, "y")


# Losses and excesses.


@pytest.mark.parametrize("how", ["dead", "homed"])
def test_a_slave_is_braked_if_its_master_is_lost(scenario, how):
    cell = two(scenario, bus=ALONE)
    cell["x"].move_velocity(80.0).wait()
    cell.end_of(cell["y"].gear_in(cell["x"], 1.0))
    if how == "homed":
        cell["x"].halt().wait()
        cell["x"].home()
    else:
        cell.device("x").dials.dead = True
    cell.until(lambda: cell["y"].error is not None, 1.0)
    assert "its master is lost" in str(cell["y"].error)
    assert "couple y to it again" in str(cell["y"].error)
    must_brake(cell, "y")
    assert cell["y"].state is AxisState.ERRORSTOP


def test_the_fault_of_a_master_stops_its_slave_by_the_policy(scenario):
    cell = two(scenario)
    cell["x"].move_velocity(80.0).wait()
    cell.end_of(cell["y"].gear_in(cell["x"], 1.0))
    cell.machine.simulated_node(1).fault(0x2310)
    must_brake(cell, "y")
    assert cell["y"].state is AxisState.STANDSTILL


def test_a_master_that_is_lost_before_the_slave_is_in_step_ends_its_command(scenario):
    cell = two(scenario, bus=ALONE)
    handle = cell["y"].gear_in(cell["x"], 1.0, sync_positions=(60.0, 20.0), master_start_distance=10.0)
    cell.run(0.2)
    cell["x"].home()
    error = cell.failure_of(handle)
    assert isinstance(error, StateError)
    assert "x is being homed" in str(error)


def test_an_axis_in_fault_cannot_be_a_master(scenario):
    cell = two(scenario, bus=ALONE)
    cell.machine.simulated_node(1).fault(0x2310)
    cell.run(0.3)
    assert "x is in ErrorStop" in str(cell.failure_of(cell["y"].gear_in(cell["x"], 1.0)))


@pytest.mark.parametrize("velocity", [60.0, -150.0])
def test_a_slave_is_braked_within_its_limits(scenario, velocity):
    text = AXIS + "\nposition_limits = [-100.0, 100.0]"
    cell = two(scenario, axis=text)
    cell["x"].move_velocity(velocity / 4.0).wait()
    assert cell.end_of(cell["y"].gear_in(cell["x"], 4.0)) is None
    cell.until(lambda: cell["y"].error is not None, 8.0)
    assert "would take it out of the position limits" in str(cell["y"].error)
    must_brake(cell, "y")
    assert 90.0 < abs(cell.where("y")) <= 100.0 + INCREMENT


def test_a_slave_after_gear_out_is_braked_within_its_limits_too(scenario):
    cell = two(scenario, axis=AXIS + "\nposition_limits = [-100.0, 100.0]")
    cell["x"].move_velocity(40.0).wait()
    cell.end_of(cell["y"].gear_in(cell["x"], 1.0))
    cell.end_of(cell["y"].gear_out())
    cell["x"].halt().wait()
    cell.until(lambda: cell["y"].error is not None, 8.0)
    must_brake(cell, "y")
    assert 90.0 < cell.where("y") <= 100.0 + INCREMENT


def test_a_coupling_that_exceeds_the_slave_axis_limits_ends_in_a_braked_stop(scenario):
    cell = two(scenario)
    cell.end_of(cell["y"].gear_in(cell["x"], 8.0))
    cell["x"].move_velocity(100.0, acceleration=100.0)
    cell.until(lambda: cell["y"].error is not None, 3.0)
    assert isinstance(cell["y"].error, LimitError)
    assert "faster than max_velocity" in str(cell["y"].error)
    must_brake(cell, "y")
    assert cell.top_speed("y") < 401.0


def test_a_jammed_slave_is_seen_not_to_follow(scenario):
    cell = two(scenario, axis=AXIS + "\nfollowing_error = 20.0")
    cell["x"].move_velocity(80.0).wait()
    cell.end_of(cell["y"].gear_in(cell["x"], 1.0))
    cell.jam("y")
    cell.until(lambda: cell["y"].error is not None, 2.0)
    assert "does not follow" in str(cell["y"].error)
    assert cell["x"].state is AxisState.CONTINUOUS_MOTION


def test_a_sync_position_that_the_master_is_too_near_to_is_reported(scenario):
    cell = two(scenario)
    handle = cell["y"].gear_in(cell["x"], 1.0, sync_positions=(20.0, 10.0), master_start_distance=40.0)
    cell["x"].move_absolute(60.0)
    assert "was too near to 20 deg" in str(cell.failure_of(handle))


@pytest.mark.parametrize(
    ("ask", "error", "words"),
    [
        (lambda c: c["y"].gear_in(c["y"], 1.0), ArgumentError, "it is the axis itself"),
        (lambda c: c["y"].gear_in("x", 1.0), ArgumentError, "another axis of this machine"),
        (lambda c: c["y"].gear_in(c["x"], 0.0), ArgumentError, "ratio 0"),
        (lambda c: c["y"].gear_in(c["x"], math.nan), ArgumentError, "ratio nan"),
        (
            lambda c: c["y"].gear_in(c["x"], 1.0, master_start_distance=3.0),
            ArgumentError,
            "master_start_distance requires sync_positions",
        ),
        (
            lambda c: c["y"].gear_in(c["x"], 1.0, sync_positions=(1.0, 2.0)),
            ArgumentError,
            "master_start_distance is missing",
        ),
        (
            lambda c: c["y"].gear_in(c["x"], 1.0, sync_positions=(1.0,), master_start_distance=1.0),
            ArgumentError,
            "of the master and",
        ),
        (
            lambda c: c["y"].gear_in(c["x"], 1.0, sync_positions=(1.0, 2.0), master_start_distance=0.0),
            ArgumentError,
            "above 0",
        ),
        (
            lambda c: c["y"].gear_in(c["x"], 1.0, sync_positions=(1.0, 900.0), master_start_distance=1.0),
            LimitError,
            "beyond the position limits",
        ),
        (
            lambda c: c["y"].gear_in(c["x"], 1.0, master_value_source="hand"),
            ArgumentError,
            "master_value_source 'hand' is not known",
        ),
        (lambda c: c["y"].gear_in(c["x"], 1.0, acceleration=1e9), LimitError, "max_acceleration"),
        (lambda c: c["y"].cam_in(c["x"], LOBE), ArgumentError, "is not a cam"),
        (lambda c: c["y"].cam_in(c["x"], Cam(LOBE), slave_scaling=0.0), ArgumentError, "slave_scaling 0"),
        (
            lambda c: c["y"].cam_in(c["x"], Cam(LOBE), slave_scaling=50.0),
            LimitError,
            "leaves the position limits of y",
        ),
        (
            lambda c: c["y"].cam_in(c["x"], Cam(LOBE), master_start_distance=-1.0),
            ArgumentError,
            "must not be negative",
        ),
    ],
)
def test_invalid_couplings_are_refused_before_any_motion(scenario, ask, error, words):
    cell = two(scenario, axis=AXIS + "\nposition_limits = [-500.0, 500.0]")
    with pytest.raises(error, match=words):
        ask(cell)
    cell.run(0.1)
    assert cell["y"].state is AxisState.STANDSTILL


# On a busy computer.


def targets_of(cell: Cell, name: str) -> list[float]:
    """The targets of the axis from now on, one per cycle, in its unit."""
    led: list[float] = []
    core = cell.core(name)
    cell.each_cycle(lambda *_: led.append((core.image.reference_tracker.target or 0) / SCALE))
    return led


def hardest_of(targets: list[float]) -> float:
    speeds = [(b - a) / CYCLE for a, b in pairwise(targets)]
    return max(abs(b - a) / CYCLE for a, b in pairwise(speeds))


@pytest.mark.parametrize("lateness", ["a little", "a lot"])
@pytest.mark.parametrize("way", ["velocity", "position"])
def test_late_cycles_of_a_master_axis_that_its_drive_controls_do_not_shake_the_slave_axis(
    scenario, way, lateness
):
    """The drive of a master in pv or pp continues while the scan is late; the slave gets no target, and makes up for it later."""
    rng = random.Random(7)
    cell = two(scenario)
    x, y = cell["x"], cell["y"]
    if way == "position":
        wait(x.move_absolute(5.0))  # this proves its 6062h
    wait(x.move_velocity(80.0) if way == "velocity" else y.gear_in(x, 1.5))
    if way == "velocity":
        wait(y.gear_in(x, 1.5, acceleration=1000.0))
    else:
        x.move_absolute(900.0, velocity=80.0)
    cell.run(0.5)
    away, targets = cell.where("y") - 1.5 * cell.where("x"), targets_of(cell, "y")
    for _ in range(200):
        late = rng.uniform(0.0, 0.4) if lateness == "a little" else rng.choice([0.0] * 20 + [0.7, 1.2, 4.0])
        cell.faults.wait_late = late * CYCLE
        cell.run(CYCLE)
    cell.faults.wait_late = 0.0
    assert y.state is AxisState.SYNCHRONIZED_MOTION
    cell.run(5.0)
    assert cell.where("y") - 1.5 * cell.where("x") == pytest.approx(away, abs=0.1)
    assert hardest_of(targets) < 600.0
    cell["x"].halt()
    cell.run(2.0)
    behind = 1.5 * 80.0 * 2 * CYCLE  # while they moved: a reported position is two cycles old
    assert cell.where("y") - 1.5 * cell.where("x") == pytest.approx(away + behind, abs=0.1)


def test_a_debt_is_taken_back_without_a_jump_of_speed_and_by_a_tenth_of_the_master_s_at_most():
    for off, speed in ((-4.0, 100.0), (-40.0, -100.0), (0.5, 0.0), (0.5, 1e-12)):
        debt = LagCorrection(CYCLE)
        debt.add(off, speed)
        rates = [debt.rate]
        for _ in range(40_000):
            debt.step()
            rates.append(debt.rate)
        assert abs(debt.value) < 1e-3 * abs(off)
        assert max(map(abs, rates)) <= 1.01 * max(
            0.1 * abs(speed), 1.2 * abs(off) if speed == 0.0 else 0.2 * abs(off)
        )
        assert max(abs(b - a) for a, b in pairwise(rates)) <= 9.1 * abs(off) * CYCLE


# At random.


@pytest.mark.parametrize("seed", range(25))
def test_random_commands_of_master_and_slave_cause_no_jolt_and_every_slave_can_be_stopped(scenario, seed):
    rng = random.Random(seed)
    cell = two(scenario)
    x, y, cam = cell["x"], cell["y"], Cam(LOBE, periodic=True)
    asks = [
        lambda: x.move_velocity(rng.uniform(-90.0, 90.0)),
        lambda: x.move_absolute(rng.uniform(-90.0, 90.0)),
        lambda: x.halt(),
        lambda: y.gear_in(x, rng.choice([-1.0, 0.5, 1.0, 1.5])),
        lambda: y.gear_in(
            x, 1.0, sync_positions=(rng.uniform(-90.0, 90.0), y.position), master_start_distance=60.0
        ),
        lambda: y.cam_in(x, cam, relative=True),
        lambda: y.cam_in(x, cam, master_start_distance=120.0),
        lambda: y.gear_out(),
        lambda: y.halt(),
        lambda: y.move_absolute(rng.uniform(-90.0, 90.0)),
        lambda: y.reset(),
        lambda: x.reset(),
    ]
    for _ in range(25):
        rng.choice(asks)()
        cell.run(rng.choice([0.0, 0.02, 0.1, 0.5]))
        assert cell.scan_runs
    assert cell.hardest_change("y") < 2300.0
    assert cell.top_speed("y") < 410.0
    assert cell.end_of(y.halt()) is None
    must_brake(cell, "y")


@pytest.fixture
def short_cycles(monkeypatch):
    """The cycles that used the fast path."""
    taken, step = [], FastPath.step

    def noted(self, inputs):
        outputs = step(self, inputs)
        if outputs is not None and isinstance(self._follow, Coupled):
            taken.append(outputs)
        return outputs

    monkeypatch.setattr(FastPath, "step", noted)
    return taken


def test_a_slave_axis_in_step_takes_the_short_cycle_and_moves_as_in_the_whole_cycle(
    scenario, monkeypatch, short_cycles
):
    ways = []
    for _ in range(2):
        cell = two(scenario, axis=AXIS + "\nposition_limits = [-90.0, 90.0]")
        cell.end_of(cell["y"].gear_in(cell["x"], 2.0))
        cell["x"].follow([(0.0, 0.0), (0.8, 30.0), (1.4, 12.0)]).wait()
        cell["x"].follow([(0.0, 12.0), (1.0, 60.0)])
        cell.run(2.0)
        assert "would take it out" in str(cell["y"].error)
        ways.append(cell.positions("y"))
        monkeypatch.setattr("axisbus.motion.axis.core.fast_path_of", lambda _: None)
    assert len(short_cycles) > 150
    assert ways[0] == ways[1]
