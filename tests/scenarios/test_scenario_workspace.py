"""Groups in a workspace on the plant: an arm's tool follows lines, corners and circles, and unreachable positions are refused."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from axisbus import CoreXY, Delta, Scara
from axisbus.errors import ArgumentError, Interrupted, LimitError
from axisbus.machine.groups import Group
from kit.cell import SCALE, Cell
from kit.scenarios.jerk_limited import ComputedMotion, differences

AXIS = "max_acceleration = 4000.0"
ARM = Scara(200.0, 150.0)
NEAR = 350.0 * math.radians(2.0 / SCALE)  # the effect of two increments of both joints on the tool position


def arm(scenario, start: tuple[float, float] = (0.0, 90.0), **changes: str) -> tuple[Cell, Group]:
    cell = scenario.simulated("xy", **{"axis": AXIS} | changes).enabled()
    joints = cell.machine.group("x", "y")
    assert cell.end_of(joints.move_direct(start)) is None
    return cell, joints.with_kinematics(ARM)


def tool(cell: Cell, since: float) -> list[tuple[float, ...]]:
    pairs = zip(cell.positions("x", since), cell.positions("y", since), strict=True)
    return [ARM.forward(pair) for pair in pairs]


def away(place: tuple[float, ...], a: tuple[float, float], b: tuple[float, float]) -> float:
    length = math.dist(a, b)
    along = sum((p - q) * (r - q) for p, q, r in zip(place, a, b, strict=True)) / length**2
    along = min(1.0, max(0.0, along))
    return math.dist(place, [q + along * (r - q) for q, r in zip(a, b, strict=True)])


def test_the_tool_continues_a_straight_line(scenario):
    cell, xy = arm(scenario)
    assert xy.tool_position == pytest.approx((200.0, 150.0), abs=NEAR)
    since = cell.moment()
    assert cell.end_of(xy.move_linear((250.0, -100.0), velocity=200.0, acceleration=1000.0)) is None
    assert xy.tool_position == pytest.approx((250.0, -100.0), abs=NEAR)
    assert max(away(place, (200.0, 150.0), (250.0, -100.0)) for place in tool(cell, since)) < NEAR
    assert all(cell.hardest_change(name, since) < 4100.0 for name in "xy")


def test_the_tool_continues_paths_and_circles_and_an_override_and_a_halt_keep_it_there(scenario):
    cell, xy = arm(scenario)
    corners = [(200.0, 150.0), (260.0, 150.0), (260.0, 0.0)]
    since = cell.moment()
    path = xy.move_path(corners[1:], velocity=150.0, acceleration=1000.0, blend=5.0)
    cell.run(0.3)
    cell.end_of(xy.set_override(0.4))
    cell.run(0.3)
    assert cell.end_of(xy.halt()) is None
    assert isinstance(path.exception(), Interrupted)
    cell.end_of(xy.set_override(1.0))
    assert cell.end_of(xy.resume()) is None
    lines = list(pairwise(corners))
    assert max(min(away(p, *line) for line in lines) for p in tool(cell, since)) < 5.0 + NEAR
    since = cell.moment()
    assert (
        cell.end_of(xy.move_circular((260.0, 0.0), centre=(220.0, 0.0), velocity=100.0, acceleration=800.0))
        is None
    )
    assert max(abs(math.dist(p, (220.0, 0.0)) - 40.0) for p in tool(cell, since)) < NEAR


def test_a_buffered_path_begins_at_the_end_of_the_previous_path(scenario):
    cell, xy = arm(scenario)
    handles = [
        xy.move_linear((250.0, 100.0), velocity=200.0, acceleration=1000.0),
        xy.move_linear((250.0, -100.0), velocity=200.0, acceleration=1000.0, buffer=True),
        xy.move_circular((250.0, 100.0), via=(180.0, 0.0), velocity=200.0, acceleration=1000.0, buffer=True),
    ]
    assert [cell.end_of(handle) for handle in handles] == [None] * 3
    assert xy.tool_position == pytest.approx((250.0, 100.0), abs=NEAR)


def test_a_belt_moves_one_axis_by_two_motors(scenario):
    cell = scenario.simulated("xy", axis=AXIS).enabled()
    xy = cell.machine.group("x", "y").with_kinematics(CoreXY())
    assert cell.end_of(xy.move_linear((20.0, 0.0), velocity=50.0, acceleration=500.0, jerk=5000.0)) is None
    assert (cell.where("x"), cell.where("y")) == pytest.approx((20.0, 20.0), abs=0.02)
    assert cell.end_of(xy.move_linear((20.0, 15.0), velocity=50.0, acceleration=500.0)) is None
    assert (cell.where("x"), cell.where("y")) == pytest.approx((35.0, 5.0), abs=0.02)


@pytest.mark.parametrize("what", ["line", "path", "stops", "circle"])
@pytest.mark.parametrize("jerk", [5000.0, 40_000.0])
def test_the_tool_has_limited_jerk_under_an_override_and_a_halt(scenario, what, jerk):
    """Its jerk, from the targets of its joints; on a circle only that of the speed along it, without the turning."""
    cell, xy = arm(scenario)
    led = [ComputedMotion(cell, name) for name in "xy"]
    pace = {"velocity": 200.0, "acceleration": 1000.0, "jerk": jerk}
    points = [(260.0, 150.0), (260.0, 0.0)]
    if what == "line":
        handle = xy.move_linear((250.0, -100.0), **pace)
    elif what == "circle":
        handle = xy.move_circular((200.0, 150.0), centre=(190.0, 110.0), **pace)
    else:
        handle = xy.move_path(points, **pace, blend=5.0 if what == "path" else 0.0)
    cell.run(0.4)
    cell.end_of(xy.set_override(0.4))
    cell.run(0.3)
    assert cell.end_of(xy.halt()) is None
    assert isinstance(handle.exception(), Interrupted)
    cell.end_of(xy.set_override(1.0))
    assert cell.end_of(xy.resume()) is None
    end = {"line": (250.0, -100.0), "circle": (200.0, 150.0)}.get(what, points[-1])
    assert xy.tool_position == pytest.approx(end, abs=NEAR)
    rows = [
        [list(pair) for pair in zip(*pairs, strict=True)]
        for pairs in zip(*(x.rows for x in led), strict=True)
    ]
    worst = 0.0
    for row in rows:
        columns = list(zip(*(ARM.forward(tuple(pair)) for pair in row), strict=True))
        jerks = zip(*(differences(list(column), 3) for column in columns), strict=True)
        worst = max([worst, *(math.hypot(*each) for each in jerks)])
    assert what == "circle" or 0.3 * jerk < worst <= jerk * 1.01
    assert all(cell.hardest_change(name) < 4100.0 for name in "xy")


@pytest.mark.parametrize(
    ("ask", "error", "words"),
    [
        (
            lambda g: g.move_linear((400.0, 0.0), velocity=50.0, acceleration=500.0),
            LimitError,
            "leaves the reach of the machine",
        ),
        (
            lambda g: g.move_linear((-200.0, -150.0), velocity=50.0, acceleration=500.0),
            LimitError,
            "leaves the reach of the machine",
        ),
        (
            lambda g: g.move_circular((200.0, 150.0), centre=(100.0, 75.0), velocity=9.0, acceleration=9.0),
            LimitError,
            "leaves the reach of the machine",
        ),
        (
            lambda g: g.move_linear((200.0, 100.0), velocity=50.0),
            ArgumentError,
            "in a workspace, the default accelerations",
        ),
        (
            lambda g: g.move_linear((200.0,), velocity=50.0, acceleration=500.0),
            ArgumentError,
            "1 position for 2",
        ),
        (lambda g: g.move_linear((60.0, 90.0), velocity=50.0, acceleration=500.0), LimitError, "limits of y"),
    ],
)
def test_an_impossible_path_is_refused_before_anything_moves(scenario, ask, error, words):
    cell, xy = arm(scenario, axis=AXIS + "\nposition_limits = [-95.0, 95.0]")
    since = cell.moment()
    with pytest.raises(error, match=words):
        ask(xy)
    cell.run(0.2)
    assert cell.top_speed("x", since) == 0.0


def test_lines_of_a_named_group_run_in_its_workspace(scenario):
    arm = '[groups.arm]\naxes = ["x", "y"]\n[groups.arm.kinematics]\nkind = "scara"\nupper = 200.0\nfore = 150.0\n'
    cell = scenario.simulated("xy", axis="max_acceleration = 2000.0", more=arm).enabled()
    group = cell.machine.group("arm")
    group.move_direct((10.0, 60.0)).wait(10)
    x, y = group.tool_position
    group.move_linear((x, y + 60.0), velocity=100.0, acceleration=400.0).wait(10)
    assert group.tool_position == pytest.approx((x, y + 60.0), abs=0.2)
    plain = cell.machine.group("x", "y")
    assert plain.tool_position == pytest.approx((cell.where("x"), cell.where("y")), abs=0.1)


def test_axis_positions_without_a_tool_position_are_reported(scenario):
    cell = scenario.simulated("xyz", axis=AXIS).enabled()
    robot = cell.machine.group("x", "y", "z").with_kinematics(Delta(300.0, 40.0, 120.0, 100.0))
    with pytest.raises(LimitError, match="the arms do not meet"):
        _ = robot.tool_position
    with pytest.raises(LimitError, match="leaves the reach of the machine"):
        robot.move_linear((0.0, 0.0, -100.0), velocity=10.0, acceleration=100.0)
