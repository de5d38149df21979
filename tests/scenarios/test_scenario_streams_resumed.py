"""Streams that are resumed after a halt, of endless axes, and in a workspace."""

from __future__ import annotations

import math
import random

import pytest

from axisbus import PointStream, Scara, TrajectoryPoint, wait
from axisbus.errors import AxisbusError, Interrupted, LimitError, StateError
from axisbus.motion.states import AxisState
from kit.cell import SCALE, Cell

HARDEST = 2000.0
AXIS = f"max_acceleration = {HARDEST}"
STEP = 0.01
NEAR = 350.0 * math.radians(2.0 / SCALE)  # the effect of two increments of both joints on the tool position
ARM = Scara(200.0, 150.0)


def place(t: float) -> tuple[float, float]:
    x = 60.0 * (1.0 - math.cos(2.0 * t))
    return x, 0.5 * x


def opened(scenario, names: str = "xy", axis: str = AXIS) -> Cell:
    return scenario.simulated(names, axis=axis).enabled()


def feed(cell: Cell, points: PointStream, seconds: float, path=place) -> None:
    """Give points as there is room for them, for so long."""
    end = cell.now + seconds
    while cell.now < end:
        while points.try_push(path(points.count * STEP)):
            pass
        cell.run(STEP)


def must_be_on_the_line(cell: Cell) -> None:
    for x, y in zip(cell.positions("x"), cell.positions("y"), strict=True):
        assert y == pytest.approx(0.5 * x, abs=0.15)


def must_not_jolt(cell: Cell) -> None:
    assert all(cell.hardest_change(name) < 1.3 * HARDEST for name in "xy")


def backwards(cell: Cell) -> float:
    """How far x has gone back while it was to go out."""
    positions, most, back = cell.positions("x"), 0.0, 0.0
    for position in positions:
        most = max(most, position)
        back = max(back, most - position)
    return back


def broken_off(cell: Cell, how: str) -> None:
    """Let the axes be stopped on their path, and be ready again."""
    group = cell.machine.group("x", "y")
    if how == "halt of one":
        cell["y"].halt().wait(5)
    elif how == "stop":
        group.stop().wait(5)
        group.release().wait(5)
    elif how == "fault":
        cell.machine.simulated_node(1).fault(0x2310)
        cell.run(1.5)
        group.reset().wait(5)
        group.enable().wait(5)
    else:
        group.halt().wait(5)


@pytest.mark.parametrize("how", ["halt", "halt of one", "stop"])
def test_a_stream_continues_from_its_interruption_and_takes_points_again(scenario, how):
    cell = opened(scenario)
    group = cell.machine.group("x", "y")
    points = group.stream(period=STEP)
    feed(cell, points, 0.8)
    broken_off(cell, how)
    cell.run(0.5)
    assert cell["x"].state is AxisState.STANDSTILL
    count, first = points.count, points.handle
    with pytest.raises(Interrupted):
        points.push(place(count * STEP))
    assert points.count == count
    there = cell.where("x")
    resumed = points.resume()
    assert resumed is points.handle is not first
    feed(cell, points, 1.0)
    assert points.count > count + 50
    last = place((points.count - 1) * STEP)
    assert cell.end_of(points.finish()) is None
    assert resumed.done
    assert [cell.where(name) for name in "xy"] == pytest.approx(last, abs=0.1)
    assert there != pytest.approx(cell.where("x"), abs=1.0)
    must_be_on_the_line(cell)
    must_not_jolt(cell)


def test_after_a_fault_a_stream_continues_only_from_the_position_of_its_interruption(scenario):
    cell = opened(scenario)
    points = cell.machine.group("x", "y").stream(period=STEP)
    feed(cell, points, 0.8)
    with pytest.raises(AxisbusError):
        cell.machine.simulated_node(1).fault(0x2310)
        feed(cell, points, 1.0)
    broken_off(cell, "fault")
    there = cell.where("x"), cell.where("y")
    error = cell.failure_of(points.resume())  # the drive has braked on its own, and off the path
    assert "x is no longer at the position at which the stream was interrupted" in error.message
    cell.run(0.3)
    assert (cell.where("x"), cell.where("y")) == pytest.approx(there, abs=0.05)
    left = [float(value) for value in error.remedy.partition("((")[2].partition(",))")[0].split(",")]
    cell.machine.group("x", "y").move_direct(left).wait(5)  # as it says
    points.resume()
    feed(cell, points, 0.8)
    assert cell.end_of(points.finish()) is None
    assert cell.where("x") == pytest.approx(place((points.count - 1) * STEP)[0], abs=0.1)


def test_no_accepted_point_is_left_out_or_passed_twice(scenario):
    cell = opened(scenario)
    group = cell.machine.group("x", "y")
    points = group.stream(period=STEP, buffer="100ms")

    def out(t):
        return 80.0 * t, 40.0 * t

    for _ in range(4):
        feed(cell, points, 0.3, out)
        group.halt().wait(5)
        cell.run(0.1)
        points.resume()
    feed(cell, points, 0.5, out)
    assert cell.end_of(points.finish()) is None
    assert backwards(cell) < 0.05
    assert cell.where("x") == pytest.approx(out((points.count - 1) * STEP)[0], abs=0.1)
    must_be_on_the_line(cell)
    must_not_jolt(cell)


def test_a_group_continues_to_the_last_point_that_was_taken_and_takes_no_more(scenario):
    cell = opened(scenario)
    group = cell.machine.group("x", "y")
    points = group.stream(period=STEP)
    feed(cell, points, 0.8)
    group.halt().wait(5)
    last = place((points.count - 1) * STEP)
    before = place((points.count - 2) * STEP)
    assert cell.end_of(group.resume()) is None
    assert min(abs(cell.where("x") - value) for value in (last[0], before[0])) < 0.1
    with pytest.raises(Interrupted):
        points.push(place(points.count * STEP))
    assert "the line has ended" in str(cell.failure_of(points.resume()))
    assert "the line has ended" in str(cell.failure_of(group.resume()))
    must_be_on_the_line(cell)
    must_not_jolt(cell)


def test_a_stream_that_had_its_end_before_a_halt_continues_to_its_end(scenario):
    cell = opened(scenario)
    group = cell.machine.group("x", "y")
    points = group.stream(period=STEP, buffer="1s")
    for number in range(60):
        points.push(place(number * STEP))
    points.finish()
    cell.run(0.3)
    group.halt().wait(5)
    assert points.handle.aborted
    assert cell.end_of(points.resume()) is None
    assert [cell.where(name) for name in "xy"] == pytest.approx(place(0.59), abs=0.1)
    with pytest.raises(StateError, match="has come to its end"):
        points.resume()
    with pytest.raises(StateError, match="ended"):
        points.push(place(0.6))


def test_a_stream_that_was_halted_before_it_began_continues(scenario):
    cell = opened(scenario)
    group = cell.machine.group("x", "y")
    points = group.stream(period=STEP, buffer="500ms")
    for number in range(10):
        points.push(place(number * STEP))
    cell.run(0.1)
    group.halt().wait(5)
    points.resume()
    feed(cell, points, 1.0)
    assert cell.end_of(points.finish()) is None
    assert cell.where("x") == pytest.approx(place((points.count - 1) * STEP)[0], abs=0.1)


def test_a_stream_is_not_resumed_from_another_position_or_while_running_or_after_another_motion(scenario):
    cell = opened(scenario)
    group = cell.machine.group("x", "y")
    points = group.stream(period=STEP)
    feed(cell, points, 0.8)
    with pytest.raises(StateError, match="is under way"):
        points.resume()
    group.halt().wait(5)
    cell["y"].move_relative(3.0).wait(5)
    there = cell.where("x"), cell.where("y")
    error = cell.failure_of(points.resume())
    assert isinstance(error, StateError)
    assert "y is no longer at the position at which the stream was interrupted" in error.message
    cell.run(0.5)
    assert (cell.where("x"), cell.where("y")) == pytest.approx(there, abs=0.02)
    cell["y"].move_relative(-3.0).wait(5)
    assert cell.end_of(group.move_linear((0.0, 0.0), velocity=100.0)) is None
    error = cell.failure_of(points.resume())
    assert isinstance(error, StateError)
    assert "another command" in error.message


def test_an_underrun_that_ended_a_stream_can_be_continued_after(scenario):
    cell = opened(scenario)
    points = cell.machine.group("x", "y").stream(period=STEP, on_underrun="error")
    feed(cell, points, 0.8)
    assert "underrun" in str(cell.failure_of(points.handle))
    cell.run(0.5)
    points.resume()
    feed(cell, points, 0.8)
    assert cell.end_of(points.finish()) is None
    must_be_on_the_line(cell)
    must_not_jolt(cell)


def test_a_move_that_waits_behind_a_resumed_stream_does_not_begin_from_an_older_end(scenario):
    cell = opened(scenario)
    group = cell.machine.group("x", "y")
    assert cell.end_of(group.move_linear((10.0, 5.0), velocity=60.0)) is None
    points = group.stream(period=STEP)
    feed(cell, points, 0.8, lambda t: (10.0 + place(t)[0], 5.0 + place(t)[1]))
    group.halt().wait(5)
    resumed = group.resume()
    after = group.move_path([(0.0, 0.0)], velocity=60.0, buffer=True)
    assert cell.end_of(resumed) is None
    error = cell.end_of(after)
    assert error is None or isinstance(error, StateError)
    must_not_jolt(cell)


@pytest.mark.parametrize("seed", range(8))
def test_random_halts_overrides_pauses_and_resumes_stay_on_the_line_within_the_limits(scenario, seed):
    rnd = random.Random(seed)
    cell = opened(scenario)
    group = cell.machine.group("x", "y")
    points = group.stream(period=STEP, buffer=rnd.choice([0.05, 0.25]))
    for _ in range(12):
        try:
            feed(cell, points, rnd.uniform(0.05, 0.5))
        except AxisbusError:
            cell.run(1.5)
            points.resume()
            continue
        what = rnd.randrange(5)
        if what == 0:
            group.halt()
        elif what == 1:
            cell.run(rnd.uniform(0.0, 1.0))
        elif what == 2:
            group.set_override(rnd.choice([0.0, 0.3, 1.0])).wait(5)
        elif what == 3:
            cell["y"].halt().wait(5)
    group.set_override(1.0).wait(5)
    cell.run(1.5)
    if not points.handle.busy:
        points.resume()
    assert cell.end_of(points.finish(), 30.0) is None
    assert [cell.where(name) for name in "xy"] == pytest.approx(place((points.count - 1) * STEP), abs=0.1)
    must_be_on_the_line(cell)
    must_not_jolt(cell)


# -- endless axes ------------------------------------------------------------------------------------------------------


def test_an_endless_axis_counts_on_over_its_turn(scenario):
    cell = opened(scenario, axis=AXIS + "\nmodulo = 360.0")
    x = cell["x"]
    assert cell.end_of(x.move_velocity(100.0)) is None
    cell.run(9.0)
    x.halt().wait(5)
    begin, turned = x.position, cell.where("x")
    assert turned > 720.0
    group = cell.machine.group("x")
    points = group.stream(period=STEP)
    with points:
        for number in range(300):
            points.push((begin + 200.0 * (1.0 - math.cos(0.01 * number)),))
    assert cell.where("x") == pytest.approx(turned + 200.0 * (1.0 - math.cos(2.99)), abs=0.1)
    assert 0.0 <= x.position < 360.0
    assert x.position == pytest.approx((begin + 200.0 * (1.0 - math.cos(2.99))) % 360.0, abs=0.1)
    assert cell.hardest_change("x") < 1.3 * HARDEST


def test_the_first_point_of_an_endless_axis_may_be_given_in_any_turn(scenario):
    cell = opened(scenario, axis=AXIS + "\nmodulo = 360.0")
    x = cell["x"]
    cell.end_of(x.move_absolute(350.0, direction=-1))
    group = cell.machine.group("x")
    for begin in (350.02, -10.02, 3950.0, -370.02):
        there = cell.where("x")
        with group.stream(period=STEP) as points:
            with pytest.raises(StateError, match="is not at the start of the stream"):
                points.push((begin + 90.0,))
            for number in range(50):
                points.push((begin + 10.0 * (1.0 - math.cos(0.1 * number)),))
            with pytest.raises(LimitError, match="velocity"):
                points.push((begin - 340.0,))
            for number in range(50, 63):
                points.push((begin + 10.0 * (1.0 - math.cos(0.1 * number)),))
        assert cell.where("x") == pytest.approx(there, abs=0.2)


# -- a workspace -------------------------------------------------------------------------------------------------------


def arm(scenario, start=(0.0, 90.0)):
    cell = opened(scenario)
    joints = cell.machine.group("x", "y")
    assert cell.end_of(joints.move_direct(start)) is None
    return cell, joints.with_kinematics(ARM)


def tool(cell: Cell, since: float) -> list[tuple[float, ...]]:
    pairs = zip(cell.positions("x", since), cell.positions("y", since), strict=True)
    return [ARM.forward(pair) for pair in pairs]


def ring(t: float) -> tuple[float, float]:
    angle = 0.8 * t * t if t < 1.0 else 0.8 * (2.0 * t - 1.0)
    return 160.0 + 40.0 * math.cos(angle), 150.0 + 40.0 * math.sin(angle)


@pytest.mark.parametrize("period", [0.01, 0.1, 0.25])
def test_the_tool_passes_the_points_of_the_workspace(scenario, period):
    cell, xy = arm(scenario)
    since = cell.moment()
    with xy.stream(period=period, buffer="500ms") as points:
        for number in range(int(4.0 / period)):
            points.push(ring(number * period))
    assert xy.tool_position == pytest.approx(ring((points.count - 1) * period), abs=NEAR)
    sagitta = 40.0 * (1.0 - math.cos(0.8 * period)) + 0.2 * period
    off = max(abs(math.dist(p, (160.0, 150.0)) - 40.0) for p in tool(cell, since))
    assert off < NEAR + sagitta
    must_not_jolt(cell)


def test_between_two_positions_on_a_line_the_tool_is_on_the_line(scenario):
    cell, xy = arm(scenario)
    since = cell.moment()
    with xy.stream(period=3.0, buffer="6s") as points:
        for number in range(3):
            points.push((200.0, 150.0 - 120.0 * number))
    places = tool(cell, since)
    assert xy.tool_position == pytest.approx((200.0, -90.0), abs=NEAR)
    assert max(abs(x - 200.0) for x, _ in places) < 1.5 * NEAR
    must_not_jolt(cell)


def test_a_pose_out_of_reach_or_too_fast_for_a_joint_is_refused_and_later_ones_are_accepted(scenario):
    cell, xy = arm(scenario)
    points = xy.stream(period=STEP)
    for number in range(20):
        points.push(ring(number * STEP))
    for wrong, kind, text in (
        ((400.0, 0.0), LimitError, "point 21 takes x beyond its velocity"),  # on the path to it
        ((160.0, 140.0), LimitError, "takes [xy] beyond its"),
    ):
        count = points.count
        with pytest.raises(kind, match=text):
            points.push(wrong)
        assert points.count == count
    feed(cell, points, 0.5, ring)
    assert cell.end_of(points.finish()) is None
    assert xy.tool_position == pytest.approx(ring((points.count - 1) * STEP), abs=NEAR)
    with pytest.raises(StateError, match="x is not at the start of the stream"):
        xy.stream(period=STEP).push((250.0, 10.0))


def test_a_point_out_of_reach_is_refused(scenario):
    cell, xy = arm(scenario)
    points = xy.stream(period=5.0)
    points.push(ring(0.0))
    with pytest.raises(LimitError, match="point 2 is out of the reach of the machine") as refused:
        points.push((400.0, 0.0))
    assert "out of the arm's reach" in refused.value.observed
    assert points.count == 1
    points.push(ring(0.1))
    assert cell.end_of(points.finish()) is None
    assert xy.tool_position == pytest.approx(ring(0.1), abs=NEAR)


def test_a_stream_of_the_workspace_is_halted_and_continued_with(scenario):
    cell, xy = arm(scenario)
    since = cell.moment()
    points = xy.stream(period=STEP)
    feed(cell, points, 0.8, ring)
    xy.halt().wait(5)
    points.resume()
    feed(cell, points, 0.8, ring)
    assert cell.end_of(points.finish()) is None
    assert xy.tool_position == pytest.approx(ring((points.count - 1) * STEP), abs=NEAR)
    assert max(abs(math.dist(p, (160.0, 150.0)) - 40.0) for p in tool(cell, since)) < NEAR
    must_not_jolt(cell)


WIDE = f"{AXIS}\nposition_window = 1.0"


def must_rest_at(cell: Cell, place: tuple[float, float]) -> None:
    cell.run(0.2)
    assert [cell.where(name) for name in "xy"] == pytest.approx(place, abs=0.02)
    must_not_jolt(cell)


@pytest.mark.parametrize("seconds", [0.6, 0.9, 0.98])
def test_a_start_offset_is_removed_even_if_the_rest_of_the_trajectory_is_short(scenario, seconds):
    cell = opened(scenario, axis=WIDE)
    group = cell.machine.group("x", "y")
    rows = [(0.0, (0.0, 0.0)), (0.5, (20.0, 10.0)), (1.0, (40.0, 20.0))]
    group.follow([TrajectoryPoint(t, place) for t, place in rows])
    cell.run(seconds)
    group.halt().wait(5)
    wait([cell["x"].move_relative(0.7), cell["y"].move_relative(-0.7)])
    assert cell.end_of(group.resume()) is None
    must_rest_at(cell, (40.0, 20.0))


def test_a_stream_that_is_resumed_beside_its_path_and_then_ended_rests_at_its_last_point(scenario):
    cell = opened(scenario, axis=WIDE)
    group = cell.machine.group("x", "y")
    points = group.stream(period=STEP, buffer="50ms")
    feed(cell, points, 0.5)
    group.halt().wait(5)
    wait([cell["x"].move_relative(0.7), cell["y"].move_relative(-0.7)])
    points.resume()
    assert cell.end_of(points.finish()) is None
    must_rest_at(cell, place((points.count - 1) * STEP))


@pytest.mark.parametrize("seconds", [0.1, 0.3, 1.0])
def test_a_short_trajectory_from_beside_its_first_point_ends_at_its_last(scenario, seconds):
    cell = opened(scenario, axis=WIDE)
    group = cell.machine.group("x", "y")
    wait([cell["x"].move_absolute(0.7), cell["y"].move_absolute(-0.7)])
    rows = [(0.0, (0.0, 0.0)), (0.5 * seconds, (0.4, 0.2)), (seconds, (0.8, 0.4))]
    assert cell.end_of(group.follow([TrajectoryPoint(t, place) for t, place in rows])) is None
    must_rest_at(cell, (0.8, 0.4))


def test_a_stream_that_is_resumed_at_its_last_point_goes_there(scenario):
    cell = opened(scenario, axis=WIDE)
    group = cell.machine.group("x", "y")
    rows = [(0.0, (0.0, 0.0)), (0.5, (20.0, 10.0)), (1.0, (40.0, 20.0))]
    group.follow([TrajectoryPoint(t, place) for t, place in rows])
    cell.run(1.0)
    group.halt().wait(5)
    wait([cell["x"].move_absolute(40.7), cell["y"].move_absolute(19.4)])
    assert cell.end_of(group.resume()) is None
    must_rest_at(cell, (40.0, 20.0))
