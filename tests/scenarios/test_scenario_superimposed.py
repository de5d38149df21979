"""Superimposed moves on the plant: the sum keeps its limits, and the motion below continues displaced."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest

from axisbus.errors import ArgumentError, Interrupted, LimitError, StateError
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.cell import SCALE, Cell, cell_text
from kit.plant_probe import ENABLED, OFF

AXIS = "max_acceleration = 2000.0"
INCREMENT = 1.0 / SCALE
CYCLE = 0.01  # seconds
STEP = 2.0 * INCREMENT / CYCLE**2  # deg/s²: the effect of rounding to increments on an acceleration


def one(scenario, names: str = "x", **changes: str) -> Cell:
    return scenario.simulated(names, **{"axis": AXIS} | changes).enabled()


class Targets:
    """The targets of an axis in each cycle, in degrees, from its construction on."""

    def __init__(self, cell: Cell, name: str = "x") -> None:
        self.places: list[float] = []
        core = cell.core(name)

        def look(_now: float, _known: object) -> None:
            if core.image.reference_tracker.target is not None:
                self.places.append(core.image.reference_tracker.target / SCALE)

        cell.each_cycle(look)

    @property
    def speeds(self) -> list[float]:
        return [(b - a) / CYCLE for a, b in pairwise(self.places)]

    @property
    def fastest(self) -> float:
        return max(map(abs, self.speeds))

    @property
    def hardest(self) -> float:
        return max(abs(b - a) / CYCLE for a, b in pairwise(self.speeds))


def going(scenario, velocity: float = 30.0, end: float = 150.0, **changes: str):
    """A cell whose x follows a trajectory, and its handle."""
    cell = one(scenario, **changes)
    below = cell.x.follow(TrapezoidalTrajectory(0.0, end, velocity, 200.0))
    cell.run(0.5)
    return cell, below


def test_a_distance_is_laid_over_a_trajectory_which_ends_displaced_by_it(scenario):
    cell, below = going(scenario)
    targets = Targets(cell)
    over = cell.x.move_superimposed(12.0, velocity=40.0, acceleration=300.0)
    cell.run(0.2)
    assert over.busy
    assert below.busy
    assert cell.end_of(over) is None
    assert below.busy
    assert cell.x.state is AxisState.SYNCHRONIZED_MOTION
    assert cell.end_of(below) is None
    assert cell.where("x") == pytest.approx(162.0, abs=INCREMENT)
    assert targets.fastest == pytest.approx(70.0, abs=1.1)
    assert targets.hardest <= 300.0 + STEP


@pytest.mark.parametrize("distance", [25.0, -25.0, 0.004, 0.0])
def test_any_superimposed_distance_is_moved_within_an_increment(scenario, distance):
    cell, below = going(scenario, end=60.0)
    assert cell.end_of(cell.x.move_superimposed(distance, velocity=90.0)) is None
    assert cell.end_of(below) is None
    assert cell.where("x") == pytest.approx(60.0 + distance, abs=INCREMENT)


def test_the_motion_below_waits_for_an_addition_that_is_not_over(scenario):
    cell, below = going(scenario, end=30.0)
    over = cell.x.move_superimposed(40.0, velocity=10.0)
    cell.run(2.0)
    assert below.busy
    assert over.busy
    assert cell.end_of(below) is None
    assert over.exception() is None
    assert cell.where("x") == pytest.approx(70.0, abs=INCREMENT)


@pytest.mark.parametrize("factor", [0.3, 0.4, 0.7, 1.1, 1.3, 1.5])
def test_time_that_is_scaled_lays_it_over_once_in_each_cycle(scenario, factor):
    cell = one(scenario)
    targets = Targets(cell)
    cell.end_of(cell.x.set_override(factor))
    below = cell.x.follow(TrapezoidalTrajectory(0.0, -115.0, 300.0, 1500.0))
    cell.run(0.15)
    over = cell.x.move_superimposed(-14.6, velocity=100.0, acceleration=1000.0)
    cell.run(0.1)
    cell.end_of(cell.x.set_override(1.0))
    assert cell.end_of(over) is None
    assert cell.end_of(below) is None
    assert cell.where("x") == pytest.approx(-129.6, abs=INCREMENT)
    assert targets.hardest <= 2000.0 + STEP


def test_the_line_continues_beneath_and_the_other_axis_keeps_its_path(scenario):
    cell = one(scenario, "xy")
    xy = cell.machine.group("x", "y")
    line = xy.move_linear((80.0, 40.0), velocity=60.0, acceleration=300.0)
    over = cell["x"].move_superimposed(-15.0, velocity=30.0, acceleration=200.0)  # before it has begun
    assert cell.end_of(over) is None
    assert line.busy
    assert cell.end_of(line) is None
    assert (cell.where("x"), cell.where("y")) == pytest.approx((65.0, 40.0), abs=INCREMENT)
    assert cell.hardest_change("y") < 310.0 + STEP
    assert cell.end_of(xy.move_linear((0.0, 0.0), velocity=60.0)) is None
    assert (cell.where("x"), cell.where("y")) == pytest.approx((0.0, 0.0), abs=INCREMENT)


def test_a_buffered_line_begins_at_the_end_of_the_displaced_one(scenario):
    cell = one(scenario, "xy")
    xy = cell.machine.group("x", "y")
    lines = [
        xy.move_linear((40.0, 20.0), velocity=60.0),
        xy.move_linear((0.0, 0.0), velocity=60.0, buffer=True),
    ]
    targets = Targets(cell)
    assert cell.end_of(cell["x"].move_superimposed(9.0)) is None
    assert [cell.end_of(line) for line in lines] == [None, None]
    assert (cell.where("x"), cell.where("y")) == pytest.approx((0.0, 0.0), abs=INCREMENT)
    assert targets.hardest <= 2000.0 + STEP


def test_a_slave_and_its_own_slave_are_displaced(scenario):
    cell = one(scenario, "xyz")
    assert cell.end_of(cell["y"].gear_in(cell["x"], 1.0)) is None
    assert cell.end_of(cell["z"].gear_in(cell["y"], 2.0)) is None
    cell["x"].follow(TrapezoidalTrajectory(0.0, 60.0, 30.0, 100.0))
    cell.run(0.5)
    assert cell.end_of(cell["y"].move_superimposed(10.0, velocity=20.0, acceleration=100.0)) is None
    cell.run(3.0)
    assert cell.where("y") == pytest.approx(70.0, abs=2.0 * INCREMENT)
    assert cell.where("z") == pytest.approx(140.0, abs=4.0 * INCREMENT)
    assert cell.end_of(cell["y"].gear_out()) is None
    cell.run(0.3)
    assert cell.where("y") == pytest.approx(70.0, abs=2.0 * INCREMENT)


def test_a_shift_of_the_master_and_a_distance_of_the_slave_continue_together(scenario):
    cell = one(scenario, "xy")
    assert cell.end_of(cell["y"].gear_in(cell["x"], 1.0)) is None
    cell["x"].follow(TrapezoidalTrajectory(0.0, 90.0, 30.0, 100.0))
    cell.run(0.5)
    over = cell["y"].move_superimposed(10.0, velocity=10.0)
    phase = cell["y"].phasing_relative(-4.0, velocity=5.0, acceleration=50.0)
    assert [cell.end_of(handle) for handle in (phase, over)] == [None, None]
    cell.run(3.0)
    assert cell.where("y") == pytest.approx(96.0, abs=2.0 * INCREMENT)


def test_a_stream_continues_beneath(scenario):
    cell = one(scenario, "xy")
    points = cell.machine.group("x", "y").stream(period=0.01, buffer=3.0)
    targets = Targets(cell)
    for number in range(250):
        points.try_push((20.0 - 20.0 * math.cos(0.01 * number), 0.1 * number))
    points.finish()
    cell.run(0.5)
    assert cell.end_of(cell["x"].move_superimposed(-8.0, velocity=50.0)) is None
    assert cell.end_of(points.handle) is None
    assert cell.where("x") == pytest.approx(20.0 - 20.0 * math.cos(2.49) - 8.0, abs=2.0 * INCREMENT)
    assert cell.where("y") == pytest.approx(24.9, abs=2.0 * INCREMENT)
    assert targets.hardest <= 600.0 + STEP


@pytest.mark.parametrize("on_fault", ["path", "each", "quick"])
def test_the_fault_of_one_axis_of_a_line_ends_the_addition_of_another(scenario, on_fault):
    more = f'[groups.table]\naxes = ["x", "y"]\non_fault = "{on_fault}"\n'
    cell = one(scenario, "xy", more=more)
    line = cell.machine.group("x", "y").move_linear((150.0, 150.0), velocity=60.0)
    cell.run(0.5)
    over = cell["x"].move_superimposed(60.0, velocity=30.0)
    cell.run(0.4)
    targets = Targets(cell)
    cell.machine.simulated_node(2).fault(0x2310)
    assert cell.end_of(line) is not None
    assert isinstance(cell.end_of(over), Interrupted)
    cell.run(0.5)
    cell.must_be_still("x", within=0.1, stages=(*OFF, ENABLED) if on_fault == "quick" else ENABLED)
    assert on_fault == "quick" or targets.hardest <= 2000.0 + STEP


def test_late_cycles_delay_an_addition_without_a_jump(scenario):
    cell, below = going(scenario)
    targets = Targets(cell)
    over = cell.x.move_superimposed(30.0, velocity=40.0, acceleration=300.0)
    for late in (0.0, 0.02, 0.0, 0.02, 0.0):
        cell.faults.wait_late = late
        cell.run(0.1)
    assert cell.end_of(over) is None
    assert cell.end_of(below) is None
    assert cell.where("x") == pytest.approx(180.0, abs=INCREMENT)
    assert targets.hardest <= 300.0 + STEP


# Limits.


def test_the_sum_is_no_faster_than_the_axis_and_the_addition_waits(scenario):
    cell, below = going(scenario, velocity=380.0, end=700.0)
    targets = Targets(cell)
    over = cell.x.move_superimposed(60.0, velocity=200.0)
    assert cell.end_of(over) is None
    assert cell.end_of(below) is None
    assert cell.where("x") == pytest.approx(760.0, abs=INCREMENT)
    assert targets.fastest <= 400.0 + 1.1
    assert targets.hardest <= 2000.0 + STEP


def test_a_superimposed_move_is_refused_if_no_acceleration_is_left(scenario):
    cell = one(scenario)
    below = cell.x.follow(TrapezoidalTrajectory(0.0, 100.0, 100.0, 1990.0))
    error = cell.failure_of(cell.x.move_superimposed(10.0))
    assert isinstance(error, LimitError)
    assert "needs all of max_acceleration" in error.message
    assert cell.end_of(below) is None
    assert cell.where("x") == pytest.approx(100.0, abs=INCREMENT)


def test_a_sum_that_would_exceed_the_limits_is_refused_if_it_is_known_in_advance(scenario):
    cell, below = going(scenario, end=90.0, axis=AXIS + "\nposition_limits = [-100.0, 100.0]")
    error = cell.failure_of(cell.x.move_superimposed(12.0))
    assert isinstance(error, LimitError)
    assert "102" in error.observed
    assert cell.end_of(cell.x.move_superimposed(9.0)) is None
    assert cell.end_of(below) is None
    assert cell.where("x") == pytest.approx(99.0, abs=INCREMENT)


def test_an_addition_is_braked_within_the_limits_if_the_motion_is_not_known_in_advance(scenario):
    cell = one(scenario, "xy", axis=AXIS + "\nposition_limits = [-100.0, 100.0]")
    assert cell.end_of(cell["y"].gear_in(cell["x"], 1.0)) is None
    cell["x"].follow(TrapezoidalTrajectory(0.0, 60.0, 20.0, 100.0))
    targets = Targets(cell, "y")
    error = cell.failure_of(cell["y"].move_superimposed(90.0, velocity=60.0))
    assert isinstance(error, LimitError)
    assert "position limits" in error.message
    assert cell["y"].state is AxisState.SYNCHRONIZED_MOTION
    assert max(targets.places) < 100.0
    assert targets.hardest <= 2000.0 + STEP


@pytest.mark.parametrize("below", [TrapezoidalTrajectory(0.0, 60.0, 60.0, 300.0), lambda t: 20.0 * t * t])
def test_an_addition_is_no_jump_for_an_axis_without_max_velocity(scenario, below):
    cell = scenario.simulated("x", text=cell_text("x").replace("max_velocity = 400.0\n", "")).enabled()
    handle = cell.x.follow(below, duration=1.0 if callable(below) else None)
    assert cell.end_of(cell.x.move_superimposed(5.0, velocity=50.0)) is None
    targets = Targets(cell)
    ended = cell.end_of(handle)
    assert (ended is None) == (not callable(below)), ended  # the function breaks off at its highest speed
    assert targets.places[0] > 0.0


# Superseded, halted, ended.


def test_a_second_one_supersedes_the_first_from_its_present_speed(scenario):
    cell, below = going(scenario)
    first = cell.x.move_superimposed(50.0, velocity=60.0, acceleration=200.0)
    cell.run(0.4)
    targets = Targets(cell)
    second = cell.x.move_superimposed(-10.0, velocity=60.0, acceleration=200.0)
    cell.run(0.05)
    assert isinstance(first.exception(), Interrupted)
    gone = float(first.exception().observed.split()[0])
    assert 5.0 < gone < 40.0
    assert cell.end_of(second) is None
    assert cell.end_of(below) is None
    assert cell.where("x") == pytest.approx(150.0 + gone - 10.0, abs=0.7)
    assert targets.hardest <= 200.0 + STEP


def test_a_halt_of_the_addition_leaves_the_motion_below_as_it_is(scenario):
    cell, below = going(scenario)
    over = cell.x.move_superimposed(80.0, velocity=60.0, acceleration=200.0)
    cell.run(0.6)
    targets = Targets(cell)
    assert cell.end_of(cell.x.halt_superimposed(deceleration=400.0)) is None
    assert isinstance(over.exception(), Interrupted)
    assert cell.end_of(cell.x.halt_superimposed()) is None
    cell.run(0.1)
    assert cell.x.velocity == pytest.approx(30.0, abs=2.0)
    assert cell.end_of(below) is None
    assert 155.0 < cell.where("x") < 200.0
    assert targets.hardest <= 400.0 + STEP


@pytest.mark.parametrize("command", ["halt", "stop", "quick_stop", "disable"])
def test_a_command_that_stops_the_axis_ends_both_motions(scenario, command):
    cell, below = going(scenario)
    over = cell.x.move_superimposed(80.0, velocity=60.0)
    cell.run(0.4)
    assert cell.end_of(getattr(cell.x, command)()) is None
    assert isinstance(below.exception(), Interrupted)
    assert isinstance(over.exception(), Interrupted)
    cell.must_be_still("x", within=0.1, stages=ENABLED if command in ("halt", "stop") else OFF)
    assert cell.hardest_change("x") < 2100.0


def test_another_move_takes_over_from_the_sum_without_a_jolt(scenario):
    cell, below = going(scenario)
    over = cell.x.move_superimposed(80.0, velocity=60.0)
    cell.run(0.5)
    targets = Targets(cell)
    assert cell.end_of(cell.x.move_absolute(100.0, velocity=80.0)) is None
    assert isinstance(below.exception(), Interrupted)
    assert isinstance(over.exception(), Interrupted)
    assert cell.where("x") == pytest.approx(100.0, abs=INCREMENT)
    assert targets.hardest <= 500.0 + STEP


def test_a_move_out_of_a_trajectory_is_displaced_under_any_override(scenario):
    cell, _ = going(scenario)
    below = cell.x.move_absolute(60.0, velocity=40.0)
    cell.run(0.2)
    targets = Targets(cell)
    over = cell.x.move_superimposed(15.0, velocity=20.0, acceleration=200.0)
    cell.run(0.2)
    for factor in (0.5, 0.0, 1.5, 1.0):
        assert cell.end_of(cell.x.set_override(factor)) is None
        cell.run(0.6)
        if not factor:
            cell.must_be_still("x", within=0.1, stages=ENABLED)
    assert cell.end_of(over) is None
    assert cell.end_of(below) is None
    assert cell.where("x") == pytest.approx(75.0, abs=INCREMENT)
    assert targets.hardest <= 700.0 + STEP
    assert cell.end_of(cell.x.move_additive(5.0)) is None
    assert cell.where("x") == pytest.approx(80.0, abs=2.0 * INCREMENT)


def test_a_fault_ends_both_motions_with_its_reason(scenario):
    cell, below = going(scenario)
    over = cell.x.move_superimposed(80.0, velocity=60.0)
    cell.run(0.4)
    cell.machine.simulated_node(1).fault(0x2310)
    errors = [cell.failure_of(handle) for handle in (below, over)]
    assert errors[0].message == errors[1].message
    assert cell.x.state is AxisState.ERRORSTOP


@pytest.mark.parametrize(
    ("begin", "words"),
    [
        (lambda x: x.halt(), "stands"),
        (lambda x: x.move_absolute(100.0), "the drive generates"),
        (lambda x: x.move_velocity(30.0), "the drive generates"),
        (lambda x: x.cyclic_velocity(30.0), "velocity set-points"),
    ],
)
def test_without_a_path_of_the_master_it_is_refused_with_the_remedy(scenario, begin, words):
    cell = one(scenario)
    begin(cell.x)
    cell.run(0.5)
    error = cell.failure_of(cell.x.move_superimposed(5.0))
    assert isinstance(error, StateError)
    assert words in error.observed
    assert cell.end_of(cell.x.halt_superimposed()) is None


def test_an_invalid_distance_raises_at_the_call(scenario):
    cell = one(scenario)
    for bad in (float("nan"), float("inf"), "far", None):
        with pytest.raises(ArgumentError):
            cell.x.move_superimposed(bad)
    with pytest.raises(ArgumentError):
        cell.x.move_superimposed(1.0, velocity=0.0)
    with pytest.raises(LimitError):
        cell.x.move_superimposed(1.0, velocity=500.0)
    with pytest.raises(LimitError):
        cell.x.halt_superimposed(deceleration=1e5)


@pytest.mark.parametrize("seed", range(4))
def test_random_additions_never_make_the_sum_too_fast_or_too_hard(scenario, seed):
    draw = random.Random(seed)
    cell = one(scenario, "xy")
    xy = cell.machine.group("x", "y")
    targets = [Targets(cell, name) for name in "xy"]
    for _ in range(6):
        ends = tuple(draw.uniform(-200.0, 200.0) for _ in "xy")
        line = xy.move_linear(
            ends, velocity=draw.uniform(20.0, 500.0), acceleration=draw.uniform(100.0, 3000.0)
        )
        for _ in range(6):
            axis = cell[draw.choice("xy")]
            kind = draw.random()
            if kind < 0.7:
                axis.move_superimposed(
                    draw.uniform(-80.0, 80.0),
                    velocity=draw.uniform(1.0, 400.0),
                    acceleration=draw.uniform(50.0, 2000.0),
                )
            elif kind < 0.8:
                axis.halt_superimposed()
            elif kind < 0.9:
                axis.set_override(draw.choice([0.3, 1.0, 1.5]))
            else:
                xy.halt()
            cell.run(draw.uniform(0.02, 0.5))
        cell["x"].set_override(1.0)
        cell["y"].set_override(1.0)
        cell.end_of(line, limit=60.0)
        cell.run(1.0)
        assert [axis.state for axis in (cell["x"], cell["y"])] == [AxisState.STANDSTILL] * 2
    for each in targets:
        assert each.fastest <= 400.0 + 1.1
        assert each.hardest <= 2000.0 + STEP
