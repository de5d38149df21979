"""A group is at points at their times, by the polynomials of the given values; an invalid trajectory is refused at the call."""

from __future__ import annotations

from itertools import pairwise

import pytest

from axisbus import TrajectoryPoint
from axisbus.errors import ArgumentError, AxisbusError, LimitError, StateError, Stopped
from axisbus.motion.point_stream.curve_fit import at, coefficients
from axisbus.motion.point_stream.timed import timed_segments
from axisbus.motion.states import AxisState
from kit.cell import Cell

AXIS = "max_acceleration = 2000.0\nposition_limits = [-300.0, 300.0]"


def opened(scenario, **changes) -> Cell:
    return scenario.simulated("xy", axis=AXIS, **changes).enabled()


def group(cell: Cell):
    return cell.machine.group("x", "y")


def targets(cell: Cell) -> list[tuple[float, float, float]]:
    """The targets of the drives in each cycle, from now on: time, x, y."""
    seen: list[tuple[float, float, float]] = []
    cell.each_cycle(lambda now, _: seen.append((now, *(cell.drive(n).target_position / 100 for n in "xy"))))
    return seen


def begin_of(seen, start) -> float:
    """The time of the last cycle in which both were where they began: in the next, time continues."""
    return next(before[0] for before, after in pairwise(seen) if after[1:] != start)


def test_with_velocities_axes_are_at_their_points_in_time_by_the_cubic(scenario):
    cell = opened(scenario)
    seen = targets(cell)
    group(cell).follow(
        [TrajectoryPoint(0.5, (10, -5), (30, -15)), TrajectoryPoint(1.0, (20, -10), (0, 0))]
    ).wait(5)
    begun = begin_of(seen, (0.0, 0.0))
    for now, x, y in seen:
        t = min(max(now - begun, 0.0), 1.0)
        half = t if t <= 0.5 else 1.0 - t  # it is the same back
        cubic = (60 * half**2 - 40 * half**3) + 0.0
        # p(0.5) = 10 and p'(0.5) = 30: a = 60, b = -40
        cubic = cubic if t <= 0.5 else 20 - cubic
        assert (x, y) == pytest.approx((cubic, -cubic / 2), abs=0.7)  # a cycle either way
    assert [cell.where(name) for name in "xy"] == pytest.approx([20, -10], abs=0.05)
    assert all(cell[name].state is AxisState.STANDSTILL for name in "xy")


def test_the_curve_has_the_given_values_and_does_not_overshoot_positions():
    points = [
        TrajectoryPoint(1, (10,)),
        TrajectoryPoint(1.1, (10.5,)),
        TrajectoryPoint(3, (11,)),
        TrajectoryPoint(4, (2,)),
    ]
    way = timed_segments(points, (0.0,), 0.01, "it")[1:-1]
    for one in way:
        curve = coefficients(one.from_[0], one.to[0], one.seconds)
        places = [at(curve, one.seconds * n / 100) for n in range(101)]
        low, high = sorted((one.begin.positions[0], one.end.positions[0]))
        assert low - 1e-9 <= min(places) <= max(places) <= high + 1e-9
    speeds = [(one.from_[0].speed, one.to[0].speed) for one in way]
    assert [a[1] for a in speeds[:-1]] == [b[0] for b in speeds[1:]]  # no speed jumps
    assert (speeds[0][0], speeds[2][1], speeds[-1][1]) == (
        0.0,
        0.0,
        0.0,
    )  # at standstill at both ends, and where it turns
    full = [TrajectoryPoint(1, (10,), (3,), (4,)), TrajectoryPoint(2, (12,), (0,), (-1,))]
    (_, first, last, _) = timed_segments(full, (0.0,), 0.01, "it")
    assert (first.from_[0], first.to[0], last.to[0]) == ((0, 0, 0), (10, 3, 4), (12, 0, -1))


def test_a_trajectory_of_absolute_time_begins_at_the_present_position(scenario):
    cell = opened(scenario)
    group(cell).follow([TrajectoryPoint(0, (0, 0)), TrajectoryPoint(0.4, (4, 2))]).wait(5)
    assert [cell.where(name) for name in "xy"] == pytest.approx([4, 2], abs=0.05)
    before = [cell.where(name) for name in "xy"]
    with pytest.raises(StateError, match="is not at the start"):
        group(cell).follow([TrajectoryPoint(0, (0, 0)), TrajectoryPoint(0.4, (4, 2))])
    assert [cell.where(name) for name in "xy"] == before


@pytest.mark.parametrize(
    ("points", "kind", "words"),
    [
        ([], ArgumentError, "cannot form a trajectory"),
        ([TrajectoryPoint(1, (1, 1))] * 4001, ArgumentError, "cannot form a trajectory"),
        ([TrajectoryPoint(0, (0, 0))], ArgumentError, "time of point 1"),
        ([TrajectoryPoint(-1, (0, 0))], ArgumentError, "time of point 1"),
        ([TrajectoryPoint(1, (1, 1)), TrajectoryPoint(1, (2, 2))], ArgumentError, "time of point 2"),
        ([TrajectoryPoint(1, (1, 1)), TrajectoryPoint(1.0001, (1, 1))], ArgumentError, "between two points"),
        ([TrajectoryPoint(float("inf"), (1, 1))], ArgumentError, "point 1 is invalid"),
        ([TrajectoryPoint(1, (1, float("nan")))], ArgumentError, "point 1 is invalid"),
        ([TrajectoryPoint(1, (1,))], ArgumentError, "point 1 is invalid"),
        ([TrajectoryPoint(1, None)], ArgumentError, "point 1 is invalid"),
        ([TrajectoryPoint(1, (1, 1), (0,))], ArgumentError, "point 1 is invalid"),
        ([TrajectoryPoint(1, (1, 1), (0, 0)), TrajectoryPoint(2, (1, 1))], ArgumentError, "some points have"),
        ([TrajectoryPoint(1, (1, 1), None, (0, 0))], ArgumentError, "some points have"),
        ([TrajectoryPoint(1, (1, 1), (1, 0))], ArgumentError, "last point is in motion"),
        (
            [TrajectoryPoint(0, (0, 0), (1, 0)), TrajectoryPoint(1, (1, 1), (0, 0))],
            ArgumentError,
            "first point is in",
        ),
        ([TrajectoryPoint(9, (301, 0))], LimitError, "300"),
        (
            [TrajectoryPoint(1, (1, 1)), TrajectoryPoint(1.1, (90, 1))],
            LimitError,
            "point 2 takes x beyond its velocity",
        ),
        ([TrajectoryPoint(0.05, (5, 1))], LimitError, "point 1 takes x beyond its acceleration"),
        (
            [TrajectoryPoint(1, (299, 0), (90, 0)), TrajectoryPoint(2, (299, 0), (0, 0))],
            LimitError,
            "beyond its",
        ),
    ],
)
def test_an_invalid_trajectory_is_refused_without_a_motion(scenario, points, kind, words):
    cell = opened(scenario)
    with pytest.raises(kind, match=words):
        group(cell).follow(points)
    cell.run(0.2)
    assert [cell.where(name) for name in "xy"] == pytest.approx([0, 0], abs=0.01)
    assert cell["x"].state is AxisState.STANDSTILL


def test_a_halt_brakes_on_the_path_and_resume_continues_to_the_end(scenario):
    cell = opened(scenario)
    both = group(cell)
    handle = both.follow([TrajectoryPoint(1, (40, 20)), TrajectoryPoint(2, (60, 30))])
    cell.until(lambda: cell.where("x") > 15)
    cell["y"].halt()  # of one of them
    assert isinstance(cell.failure_of(handle), Stopped)
    cell.until(lambda: cell["x"].state is AxisState.STANDSTILL)
    assert 15 < cell.where("x") < 35
    assert cell.where("y") == pytest.approx(cell.where("x") / 2, abs=0.1)
    both.resume().wait(5)
    assert [cell.where(name) for name in "xy"] == pytest.approx([60, 30], abs=0.05)
    for x, y in zip(cell.positions("x"), cell.positions("y"), strict=True):
        assert y == pytest.approx(x / 2, abs=0.15)


def test_another_timed_path_during_one_is_refused_and_the_first_continues(scenario):
    cell = opened(scenario)
    handle = group(cell).follow([TrajectoryPoint(1, (20, 10))])
    cell.run(0.5)
    error = cell.failure_of(group(cell).follow([TrajectoryPoint(1, (-20, 10))]))
    assert isinstance(error, AxisbusError)
    assert cell.end_of(handle) is None
    assert [cell.where(name) for name in "xy"] == pytest.approx([20, 10], abs=0.05)


def test_many_points_are_followed_to_their_end(scenario):
    cell = opened(scenario)
    points = [TrajectoryPoint(0.01 * n, (0.02 * n, -0.01 * n)) for n in range(1, 500)]
    handle = group(cell).follow(points)
    assert cell.end_of(handle, 20.0) is None
    assert [cell.where(name) for name in "xy"] == pytest.approx([9.98, -4.99], abs=0.05)
