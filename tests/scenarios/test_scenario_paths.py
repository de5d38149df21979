"""Paths of a group on the plant: rounded corners, circles, an override at any time, a halt on the path, and one axis that fails."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from axisbus.errors import ArgumentError, DriveFault, Interrupted, LimitError, StateError
from axisbus.machine.groups import Group
from kit.cell import Cell
from kit.plant_probe import ENABLED

AXIS = "max_acceleration = 1000.0"
SQUARE = [(60.0, 0.0), (60.0, 40.0), (0.0, 40.0), (0.0, 0.0)]
EIGHT = [(60.0, 60.0), (60.0, 0.0), (0.0, 60.0), (0.0, 0.0)]  # it crosses itself at (30, 30)


def two(scenario, **changes: str) -> tuple[Cell, Group]:
    cell = scenario.simulated("xy", **{"axis": AXIS} | changes)
    cell.enabled()
    return cell, cell.machine.group("x", "y")


def away_from(points: list[tuple[float, ...]], place: tuple[float, ...]) -> float:
    """How far a place is from the lines through ``points``."""
    found = []
    for a, b in pairwise(points):
        length = math.dist(a, b)
        share = sum((p - q) * (r - q) for p, q, r in zip(place, a, b, strict=True)) / length**2
        share = min(1.0, max(0.0, share))
        found.append(math.dist(place, [q + share * (r - q) for q, r in zip(a, b, strict=True)]))
    return min(found)


def must_have_kept_to(cell: Cell, points: list[tuple[float, ...]], within: float, since: float = 0.0) -> None:
    places = list(zip(cell.positions("x", since), cell.positions("y", since), strict=True))
    assert max(away_from([(0.0, 0.0), *points], place) for place in places) < within


def must_be_at(cell: Cell, *place: float) -> None:
    cell.run(0.3)
    assert [cell.where(name) for name in "xy"] == pytest.approx(place, abs=0.1)


@pytest.mark.parametrize("blend", [0.0, 0.5, 5.0])
def test_a_path_passes_its_points_and_cuts_corners_within_the_blend(scenario, blend):
    cell, group = two(scenario)
    handle = group.move_path(SQUARE, velocity=100.0, acceleration=500.0, blend=blend)
    assert cell.end_of(handle) is None
    must_be_at(cell, 0.0, 0.0)
    must_have_kept_to(cell, SQUARE, blend + 0.15)
    places = list(zip(cell.positions("x", 0.0), cell.positions("y", 0.0), strict=True))
    nearest = min(math.dist(place, SQUARE[1]) for place in places)
    assert nearest == pytest.approx(blend, abs=0.3)


def test_wide_corners_take_less_time(scenario):
    times = []
    for blend in (0.0, 0.5, 5.0):
        cell, group = two(scenario)
        begun = cell.now
        cell.end_of(group.move_path(SQUARE, velocity=100.0, acceleration=500.0, blend=blend))
        times.append(cell.now - begun)
    assert times == sorted(times, reverse=True)
    assert times[0] > times[2] + 0.3


def test_a_circle_is_round_and_ends_at_its_start(scenario):
    cell, group = two(scenario)
    assert cell.end_of(group.move_circular((0.0, 0.0), centre=(30.0, 0.0), velocity=80.0)) is None
    must_be_at(cell, 0.0, 0.0)
    places = list(zip(cell.positions("x", 0.0), cell.positions("y", 0.0), strict=True))
    assert max(abs(math.dist(place, (30.0, 0.0)) - 30.0) for place in places) < 0.2
    assert min(y for _, y in places) == pytest.approx(-30.0, abs=0.2)
    assert cell.end_of(group.move_circular((60.0, 0.0), via=(30.0, 30.0), velocity=80.0, jerk=4000.0)) is None
    must_be_at(cell, 60.0, 0.0)


def test_an_override_changes_the_speed_and_never_the_path(scenario):
    cell, group = two(scenario)
    handle = group.move_path(SQUARE, velocity=100.0, acceleration=500.0, blend=2.0)
    speeds = []
    for factor in (1.0, 0.2, 1.5, 0.0, 0.7, 1.2):
        assert cell.end_of(group.set_override(factor)) is None
        assert group.override == factor
        cell.run(0.3)
        speeds.append(math.hypot(*(cell.machine[name].velocity for name in "xy")))
    assert speeds[1] == pytest.approx(20.0, abs=4.0)
    assert speeds[3] == pytest.approx(0.0, abs=1.0)
    assert handle.active
    assert cell.end_of(handle) is None
    must_be_at(cell, 0.0, 0.0)
    must_have_kept_to(cell, SQUARE, 2.2)


def test_an_override_applies_to_later_lines_and_holds_a_line_before_it_begins(scenario):
    cell, group = two(scenario)
    cell.end_of(group.set_override(0.0))
    line = group.move_linear((30.0, 30.0), velocity=100.0)
    cell.run(1.0)
    assert line.active
    assert [cell.where(name) for name in "xy"] == pytest.approx([0.0, 0.0], abs=0.01)
    cell.end_of(group.set_override(1.0))
    assert cell.end_of(line) is None
    must_be_at(cell, 30.0, 30.0)


def test_a_line_with_a_limit_of_jerk_begins_and_ends_softly_and_is_halted_on_its_line(scenario):
    cell, group = two(scenario)
    times = []
    for end, jerk in (((60.0, 30.0), None), ((0.0, 0.0), None), ((60.0, 30.0), 5000.0), ((0.0, 0.0), 5000.0)):
        begun = cell.now
        assert cell.end_of(group.move_linear(end, velocity=100.0, acceleration=500.0, jerk=jerk)) is None
        times.append(cell.now - begun)
    assert times[3] == pytest.approx(times[1] + 0.2, abs=0.06)
    line = group.move_linear((60.0, 30.0), velocity=100.0, acceleration=500.0, jerk=5000.0)
    cell.run(0.4)
    assert cell.end_of(group.halt()) is None
    assert line.status.name == "ABORTED"
    assert cell.end_of(group.resume()) is None
    must_be_at(cell, 60.0, 30.0)
    must_have_kept_to(cell, [(60.0, 30.0)], 0.15)
    assert "jerk 100 is too small" in str(
        cell.failure_of(group.move_linear((0.0, 0.0), velocity=100.0, acceleration=500.0, jerk=100.0))
    )


def test_a_path_with_a_limit_of_jerk_is_halted_in_its_corner_and_continued_with(scenario):
    cell, group = two(scenario)
    corners = [(60.0, 0.0), (60.0, 40.0), (0.0, 40.0)]
    begun = cell.now
    assert cell.end_of(group.move_path(corners, velocity=100.0, acceleration=500.0, blend=4.0)) is None
    at_once, begun = cell.now - begun, cell.now
    path = [(60.0, 40.0), (60.0, 0.0), (0.0, 0.0)]
    softly = {"velocity": 100.0, "acceleration": 500.0, "blend": 4.0, "jerk": 5000.0}
    assert cell.end_of(group.move_path(path, **softly)) is None
    assert cell.now - begun > at_once + 0.2
    way = group.move_path(corners, **softly)
    while math.hypot(cell.where("x") - 60.0, cell.where("y")) > 5.0:
        cell.run(0.01)
    assert cell.end_of(group.halt()) is None
    assert way.status.name == "ABORTED"
    assert cell.end_of(group.resume()) is None
    must_be_at(cell, 0.0, 40.0)
    waits = group.move_path(path, **softly, buffer=True)
    assert cell.end_of(waits) is None
    must_be_at(cell, 0.0, 0.0)


def test_a_held_path_can_be_halted_and_an_override_scales_no_halt(scenario):
    cell, group = two(scenario)
    line = group.move_linear((200.0, 0.0), velocity=100.0, acceleration=400.0)
    cell.run(0.8)
    cell.end_of(group.set_override(0.05))
    since, begun = cell.now, cell.where("x")
    assert cell.end_of(group.halt()) is None
    assert cell.now - since < 0.5
    assert cell.where("x") - begun < 14.0  # 12.5 deg by 400 deg/s²
    assert isinstance(line.exception(), Interrupted)
    cell.end_of(group.set_override(0.0))
    held = group.resume()
    cell.run(0.5)
    assert held.active
    assert cell.end_of(group.halt()) is None
    assert isinstance(held.exception(), Interrupted)


@pytest.mark.parametrize("after", [0.5, 1.2, 1.9, 2.6])
def test_a_path_that_crosses_itself_continues_with_the_branch_on_which_it_was_halted(scenario, after):
    cell, group = two(scenario)
    handle = group.move_path(EIGHT, velocity=100.0, acceleration=500.0, blend=1.0)
    cell.run(after)
    assert cell.end_of(group.halt()) is None
    assert handle.status.name == "ABORTED"
    cell.run(0.2)
    assert cell.end_of(group.resume()) is None
    must_be_at(cell, 0.0, 0.0)
    must_have_kept_to(cell, EIGHT, 1.2)
    places = list(zip(cell.positions("x", 0.0), cell.positions("y", 0.0), strict=True))
    assert all(min(math.dist(place, point) for place in places) < 1.3 for point in EIGHT)


def test_one_axis_in_fault_stops_the_other_on_the_path(scenario):
    cell, group = two(scenario)
    handle = group.move_path(SQUARE, velocity=100.0, acceleration=500.0, blend=2.0)
    cell.run(0.9)
    cell.machine.simulated_node(2).fault(0x2310)
    assert isinstance(cell.failure_of(handle), DriveFault)
    cell.run(1.0)
    cell.must_be_still("x", within=0.1, stages=ENABLED)
    assert "is ErrorStop" in str(cell.failure_of(group.resume()))


def test_the_start_of_a_path_is_compared_with_the_position_when_it_begins(scenario):
    """Of two paths that are asked for at once the second does not begin where the first has ended."""
    cell, group = two(scenario)
    first = group.move_path([(30.0, 0.0)], velocity=100.0)
    second = group.move_path([(0.0, 30.0)], velocity=100.0)
    assert isinstance(cell.failure_of(second), StateError)
    assert cell.end_of(first) is None
    must_be_at(cell, 30.0, 0.0)


@pytest.mark.parametrize(
    ("ask", "error", "words"),
    [
        (
            lambda g: g.move_path([], velocity=50.0),
            ArgumentError,
            "a path has 1 to 1000 points, this one has 0",
        ),
        (lambda g: g.move_path([(1.0,)], velocity=50.0), ArgumentError, "point 1 has 1 position for 2 axes"),
        (lambda g: g.move_path([(1.0, math.nan)], velocity=50.0), ArgumentError, "nan"),
        (lambda g: g.move_path([(1.0, 1.0)], velocity=50.0, blend=-1.0), ArgumentError, "blend -1"),
        (lambda g: g.move_path([(1.0, 1.0)], velocity=0.0), LimitError, "velocity 0"),
        (
            lambda g: g.move_path([(1.0, 1.0)], velocity=50.0, acceleration=1e-300),
            LimitError,
            "more than a year",
        ),
        (lambda g: g.move_path([(1.0, 1.0), (2.0, 0.0)], velocity=5e-324, blend=1.0), LimitError, "year"),
        (lambda g: g.move_path([(1.0, 1.0), (500.0, 0.0)], velocity=50.0), LimitError, "position limits"),
        (
            lambda g: g.move_circular((60.0, 0.0), via=(2.0, 55.0), velocity=50.0),
            LimitError,
            "leaves the position limits of x",
        ),
        (lambda g: g.move_circular((9.0, 9.0), velocity=50.0), ArgumentError, "one of via and centre"),
        (lambda g: g.move_circular((9.0, 9.0), via=(4.0, 4.0), velocity=50.0), ArgumentError, "on one line"),
        (lambda g: g.move_circular((9.0, 9.0), centre=(1.0, 0.0), velocity=50.0), ArgumentError, "as far"),
        (
            lambda g: g.move_circular((9.0, 9.0), centre=(math.inf, 0.0), velocity=50.0),
            ArgumentError,
            "centre inf",
        ),
        (lambda g: g.move_linear((1.0, 1.0), velocity=50.0, jerk=0.0), LimitError, "jerk 0"),
        (lambda g: g.move_path([(1.0, 1.0)], velocity=50.0, jerk=-1.0), LimitError, "jerk -1"),
        (
            lambda g: g.move_path([(1.0, 1.0)], velocity=50.0, acceleration=500.0, jerk=10.0),
            LimitError,
            "jerk 10 is too small",
        ),
        (
            lambda g: g.move_path([(1.0, 1.0)], velocity=50.0, jerk=5000.0, more=True),
            ArgumentError,
            "no points can be added",
        ),
        (
            lambda g: g.move_path([(1.0, 1.0)], velocity=50.0, jerk=5000.0, buffer="blending_low", blend=1.0),
            ArgumentError,
            "with a jerk limit the axes must stop",
        ),
        (lambda g: g.set_override(1.6), ArgumentError, "from 0 to 1.5"),
        (lambda g: g.set_override("1"), ArgumentError, "from 0 to 1.5"),
        (lambda g: g.set_override(math.nan), ArgumentError, "from 0 to 1.5"),
    ],
)
def test_an_invalid_path_is_refused_before_anything_moves(scenario, ask, error, words):
    cell, group = two(
        scenario,
        axis=AXIS + "\nposition_limits = [-90.0, 65.0]",
    )
    with pytest.raises(error, match=words.replace("(", r"\(")):
        ask(group)
    cell.run(0.2)
    must_be_at(cell, 0.0, 0.0)


def test_a_circle_about_a_centre_needs_two_axes_and_no_path_takes_an_endless_one(scenario):
    cell = scenario.simulated("xyz", axis=AXIS)
    cell.enabled()
    with pytest.raises(ArgumentError, match="needs two axes, these are 3"):
        cell.machine.group("x", "y", "z").move_circular((0.0, 0.0, 0.0), centre=(1.0, 1.0, 1.0), velocity=9.0)
    endless = scenario.simulated("xy", axis=AXIS + "\nmodulo = 360.0")
    with pytest.raises(ArgumentError, match="x is endless"):
        endless.machine.group("x", "y").move_path([(1.0, 1.0)], velocity=9.0)
