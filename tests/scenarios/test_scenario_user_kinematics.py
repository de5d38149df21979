"""User-defined kinematics: the tool stays on its path, and errors in them are reported before anything moves."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest

from axisbus import Scara
from axisbus.errors import ArgumentError, Interrupted, LimitError, StateError
from kit.cell import SCALE

AXIS = "max_acceleration = 4000.0"
NEAR = 350.0 * math.radians(
    2.5 / SCALE
)  # the effect of two increments of both joints, and of the sampling, on the tool position
UPPER, FORE = 200.0, 150.0


class Arm:
    """Two arms in a plane, by a geometry of its own: the elbow from a triangle, the nearer of both solutions."""

    def __init__(self):
        self.asked = 0

    def forward(self, joints):
        shoulder, elbow = (math.radians(joint) for joint in joints)
        tip = UPPER * complex(math.cos(shoulder), math.sin(shoulder))
        tip += FORE * complex(math.cos(shoulder + elbow), math.sin(shoulder + elbow))
        return tip.real, tip.imag

    def inverse(self, coordinates, near):
        self.asked += 1
        return min(self.both(coordinates), key=lambda one: math.dist(one, near))

    @staticmethod
    def both(coordinates):
        x, y = coordinates
        far = math.hypot(x, y)
        if not UPPER - FORE < far < UPPER + FORE:
            raise ValueError("the arm does not reach that far")
        inner = math.acos((UPPER**2 + FORE**2 - far**2) / (2 * UPPER * FORE))
        beside = math.asin(FORE * math.sin(inner) / far)
        if UPPER**2 + far**2 < FORE**2:
            beside = math.pi - beside
        found = []
        for side in (1.0, -1.0):
            shoulder = math.atan2(y, x) - side * beside
            found.append((math.degrees(shoulder), math.degrees(side * (math.pi - inner))))
        return found


def placed(scenario, kinematics, start=(0.0, 90.0), names="xy", **changes):
    cell = scenario.simulated(names, **{"axis": AXIS} | changes).enabled()
    joints = cell.machine.group(*names)
    assert cell.end_of(joints.move_direct(start)) is None
    return cell, cell.machine.group(*names, kinematics=kinematics)


def tool(cell, since):
    pairs = zip(cell.positions("x", since), cell.positions("y", since), strict=True)
    return [Arm().forward(pair) for pair in pairs]


def away(place, a, b):
    length = math.dist(a, b)
    along = sum((p - q) * (r - q) for p, q, r in zip(place, a, b, strict=True)) / length**2
    along = min(1.0, max(0.0, along))
    return math.dist(place, [q + along * (r - q) for q, r in zip(a, b, strict=True)])


def test_the_tool_follows_a_straight_line_and_the_program_is_not_called_meanwhile(scenario):
    own = Arm()
    cell, xy = placed(scenario, own)
    since = cell.moment()
    line = xy.move_linear((250.0, -100.0), velocity=200.0, acceleration=1000.0)
    asked = own.asked
    assert asked > 8
    assert cell.end_of(line) is None
    assert own.asked == asked
    assert xy.tool_position == pytest.approx((250.0, -100.0), abs=NEAR)
    assert max(away(place, (200.0, 150.0), (250.0, -100.0)) for place in tool(cell, since)) < NEAR
    assert all(cell.hardest_change(name, since) < 4100.0 for name in "xy")


def test_kinematics_of_the_program_move_the_tool_as_the_scara_of_the_core_does(scenario):
    cell, xy = placed(scenario, Arm())
    ends = []
    for group in (xy, xy.with_kinematics(Scara(UPPER, FORE))):
        since = cell.moment()
        assert cell.end_of(group.move_linear((250.0, -100.0), velocity=200.0, acceleration=1000.0)) is None
        ends.append((cell.moment() - since, tool(cell, since)))
        assert cell.end_of(group.move_linear((200.0, 150.0), velocity=200.0, acceleration=1000.0)) is None
    (mine, first), (core, second) = ends
    assert mine <= 1.1 * core
    assert math.dist(first[-1], second[-1]) < NEAR


def test_an_override_a_halt_and_a_resume_keep_the_tool_on_its_path_and_circle(scenario):
    cell, xy = placed(scenario, Arm())
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
    circle = xy.move_circular((260.0, 0.0), centre=(220.0, 0.0), velocity=100.0, acceleration=800.0)
    assert cell.end_of(circle) is None
    assert max(abs(math.dist(p, (220.0, 0.0)) - 40.0) for p in tool(cell, since)) < NEAR


def test_a_buffered_path_begins_at_the_end_of_the_previous_path(scenario):
    cell, xy = placed(scenario, Arm())
    handles = [
        xy.move_linear((250.0, 100.0), velocity=200.0, acceleration=1000.0),
        xy.move_circular((250.0, -100.0), via=(180.0, 0.0), velocity=200.0, acceleration=1000.0, buffer=True),
    ]
    assert [cell.end_of(handle) for handle in handles] == [None] * 2
    assert xy.tool_position == pytest.approx((250.0, -100.0), abs=NEAR)


class Polar:
    """A turntable with a slide, and a third axis that does nothing for the place: three axes make two coordinates."""

    def forward(self, joints):
        turn, out, _ = joints
        return (100.0 + out) * math.cos(math.radians(turn)), (100.0 + out) * math.sin(math.radians(turn))

    def inverse(self, coordinates, near):
        x, y = coordinates
        turn = math.degrees(math.atan2(y, x))
        turn += 360.0 * round((near[0] - turn) / 360.0)
        return turn, math.hypot(x, y) - 100.0, near[2]


def test_there_may_be_more_axes_than_coordinates(scenario):
    cell, group = placed(scenario, Polar(), (170.0, 50.0, 7.0), "xyz")
    begin = group.tool_position
    assert len(begin) == 2
    assert cell.end_of(group.move_linear((begin[0], -begin[1]), velocity=100.0, acceleration=500.0)) is None
    assert group.tool_position == pytest.approx((begin[0], -begin[1]), abs=0.05)
    assert cell.machine["x"].position == pytest.approx(190.0, abs=0.1)  # on, and not back by a turn
    assert cell.machine["z"].position == pytest.approx(7.0, abs=0.05)
    with pytest.raises(ArgumentError, match="3 coordinates"):
        group.move_linear((1.0, 2.0, 3.0), velocity=100.0, acceleration=500.0)
    with pytest.raises(ArgumentError, match="acceleration is missing"):
        group.move_linear((1.0, 2.0), velocity=100.0)


def test_once_round_the_table_continues_and_not_back(scenario):
    cell, group = placed(scenario, Polar(), (170.0, 50.0, 0.0), "xyz")
    circle = group.move_circular(group.tool_position, centre=(0.0, 0.0), velocity=400.0, acceleration=2000.0)
    assert cell.end_of(circle) is None
    assert cell.machine["x"].position == pytest.approx(530.0, abs=0.1)


class Fails(Arm):
    """An arm that is wrong from the ``count``-th question on, in a way of its own."""

    def __init__(self, wrong, method="inverse", count=6):
        super().__init__()
        self.wrong, self.method, self.count = wrong, method, count

    def inverse(self, coordinates, near):
        found = super().inverse(coordinates, near)
        return self.wrong(found) if self.method == "inverse" and self.asked >= self.count else found

    def forward(self, joints):
        found = super().forward(joints)
        return self.wrong(found) if self.method == "forward" and self.asked >= self.count else found


def other(_):
    raise ZeroDivisionError("by nothing")


def out(_):
    raise ValueError("the cable would be too short")


@pytest.mark.parametrize("method", ["forward", "inverse"])
@pytest.mark.parametrize(
    ("wrong", "kind", "text"),
    [
        (other, ArgumentError, "failed .*ZeroDivisionError"),
        (out, LimitError, "says .*the cable would be too short"),
        (lambda found: (math.nan, found[1]), ArgumentError, "returned .*nan"),
        (lambda found: (math.inf, found[1]), ArgumentError, "returned"),
        (lambda _: None, ArgumentError, "failed"),
        (lambda _: "ab", ArgumentError, "returned"),
        (lambda _: (), ArgumentError, "returned"),
        (lambda found: (found[0],), ArgumentError, "returned 1"),
        (lambda found: (found[0] + 0.5, found[1]), ArgumentError, "do not agree"),
    ],
)
def test_an_error_in_kinematics_of_the_program_is_reported_before_any_motion(
    scenario, method, wrong, kind, text
):
    cell, xy = placed(scenario, Fails(wrong, method))
    before = cell.machine["x"].position, cell.machine["y"].position
    with pytest.raises(kind, match=text) as told:
        xy.move_linear((250.0, -100.0), velocity=200.0, acceleration=1000.0)
    assert "x+y.move_linear" in str(told.value)
    assert "nothing has moved" in told.value.remedy
    cell.run(0.2)
    assert (cell.machine["x"].position, cell.machine["y"].position) == before
    assert cell.machine["x"].state.value == "Standstill"


def test_an_error_in_forward_at_the_present_position_is_reported_by_the_call(scenario):
    _, xy = placed(scenario, Fails(other, "forward", count=0))
    with pytest.raises(ArgumentError, match=r"x\+y.move_circular.*: Fails.forward failed at"):
        xy.move_circular((250.0, 0.0), via=(200.0, 10.0), velocity=100.0, acceleration=500.0)
    with pytest.raises(ArgumentError, match=r"Fails\.forward failed"):
        _ = xy.tool_position


def test_a_path_of_too_many_samples_is_refused_and_one_of_a_thousand_points_is_not(scenario):
    cell, xy = placed(scenario, Polar(), (0.0, 50.0, 0.0), "xyz")
    points = [(150.0 + 0.1 * (n % 2), 0.2 * n) for n in range(1, 1001)]
    path = xy.move_path(points, velocity=50.0, acceleration=500.0, blend=0.02)
    cell.run(0.5)
    assert path.active
    assert cell.end_of(xy.halt()) is None
    fine = cell.machine.group("x", "y", "z", kinematics=Polar(), accuracy=1e-9)
    with pytest.raises(LimitError, match=r"needs more than \d+ samples"):
        fine.move_path(
            [(150.0 + 20.0 * (n % 2), 2.0 * n) for n in range(1, 201)],
            velocity=50.0,
            acceleration=500.0,
            blend=5.0,
        )


class Flips(Arm):
    """Takes the other solution beyond a line, whatever it was near to."""

    def inverse(self, coordinates, near):
        del near
        return self.both(coordinates)[coordinates[1] < 20.03]


def test_a_jump_to_another_solution_is_refused_with_its_position_and_axis(scenario):
    _, xy = placed(scenario, Flips())
    with pytest.raises(LimitError, match=r"near \(\S+, 20\.\S+\) [xy] must jump"):
        xy.move_linear((250.0, -100.0), velocity=200.0, acceleration=1000.0)
    with pytest.raises(ArgumentError, match="returns other positions than the present positions") as told:
        placed(scenario, Flips(), (60.0, -90.0))[1].move_linear(
            (250.0, 100.0), velocity=200.0, acceleration=1000.0
        )
    assert "x is at 60" in told.value.observed


def test_a_line_out_of_reach_or_past_the_middle_of_a_turntable_is_refused(scenario):
    _, xy = placed(scenario, Arm())
    with pytest.raises(LimitError, match="does not reach that far"):
        xy.move_linear((360.0, 10.0), velocity=200.0, acceleration=1000.0)
    _, table = placed(scenario, Polar(), (0.0, 50.0, 0.0), "xyz")
    with pytest.raises(LimitError, match=r"near \S+ \S+ x must jump"):
        table.move_linear((-150.0, 0.001), velocity=200.0, acceleration=1000.0)


def test_a_path_beyond_an_axis_limit_is_refused_with_the_axis_and_the_location(scenario):
    _, xy = placed(scenario, Arm(), axis=AXIS + "\nposition_limits = [-60.0, 100.0]")
    with pytest.raises(LimitError, match=r"leaves the position limits of y near \(") as told:
        xy.move_linear((90.0, 60.0), velocity=200.0, acceleration=1000.0)
    assert "the allowed range is -60 to 100" in told.value.observed


def test_invalid_kinematics_and_an_invalid_accuracy_are_refused(scenario):
    cell = scenario.simulated("xy")
    for given in (3, object(), lambda joints: joints):
        with pytest.raises(ArgumentError, match="is not a kinematics object"):
            cell.machine.group("x", "y", kinematics=given)
    for accuracy in (0.0, -1.0, math.nan, "fine"):
        with pytest.raises(ArgumentError, match="is not a distance"):
            cell.machine.group("x", "y", kinematics=Arm(), accuracy=accuracy)
    with pytest.raises(ArgumentError, match="computed exactly"):
        cell.machine.group("x", "y", kinematics=Scara(1.0, 1.0), accuracy=0.1)


class Inexact(Arm):
    """Its inverse is good for a few tenths of a millimetre only."""

    def inverse(self, coordinates, near):
        x, y = coordinates
        return super().inverse((x + 0.15 * math.sin(0.05 * y), y), near)


def test_an_inverse_that_is_not_exact_needs_an_accuracy(scenario):
    cell, xy = placed(scenario, Inexact())
    with pytest.raises(ArgumentError, match="do not agree"):
        xy.move_linear((250.0, -100.0), velocity=200.0, acceleration=1000.0)
    xy = cell.machine.group("x", "y", kinematics=Inexact(), accuracy=0.2)
    since = cell.moment()
    assert cell.end_of(xy.move_linear((250.0, -100.0), velocity=200.0, acceleration=1000.0)) is None
    assert max(away(place, (200.0, 150.0), (250.0, -100.0)) for place in tool(cell, since)) < 0.2 + NEAR


def test_a_fault_of_one_axis_stops_the_other_on_the_path_and_nothing_resumes_from_another_position(scenario):
    cell, xy = placed(scenario, Arm())
    line = xy.move_linear((250.0, -100.0), velocity=150.0, acceleration=1000.0)
    cell.run(0.5)
    assert cell.end_of(xy.halt()) is None
    assert cell.end_of(cell.machine["x"].move_relative(20.0)) is None
    assert isinstance(cell.end_of(xy.resume()), StateError)
    assert line.error is not None


@pytest.mark.parametrize("seed", range(6))
def test_random_paths_keep_to_the_tool_path_and_the_axis_limits(scenario, seed):
    rng = random.Random(seed)
    cell, xy = placed(scenario, Arm())
    for _ in range(3):
        begin = xy.tool_position
        points = [begin]
        for _ in range(rng.choice([1, 3])):
            far, turn = rng.uniform(130.0, 300.0), math.radians(rng.uniform(-60.0, 80.0))
            points.append((far * math.cos(turn), far * math.sin(turn)))
        blend, since = rng.choice([0.0, 10.0]), cell.moment()
        try:
            path = xy.move_path(
                points[1:], velocity=rng.choice([80.0, 300.0]), acceleration=900.0, blend=blend
            )
        except LimitError:
            continue  # a line may come too near to the middle
        for _ in range(rng.randrange(3)):
            cell.run(0.2)
            cell.end_of(xy.set_override(rng.choice([0.3, 1.0, 1.5])))
        if rng.random() < 0.5:
            cell.run(rng.uniform(0.05, 0.4))
            xy.halt().wait(5)
            error = cell.end_of(xy.resume(), 90.0)
            assert error is None or "the line has ended" in str(error)
        else:
            assert cell.end_of(path, 90.0) is None
        assert xy.tool_position == pytest.approx(points[-1], abs=NEAR)
        lines = list(pairwise(points))
        assert max(min(away(p, *line) for line in lines) for p in tool(cell, since)) < blend + NEAR
        assert all(cell.hardest_change(name, since) < 4100.0 for name in "xy")
        xy.set_override(1.0)


def test_lines_and_stops_have_a_jerk_limit_and_rounded_corners_do_not(scenario):
    """The samples of a corner do not contain its curvature."""
    cell, tool = placed(scenario, Arm())
    points, pace = [(260.0, 150.0), (260.0, 50.0)], {"velocity": 150.0, "acceleration": 1000.0}
    begun = cell.now
    assert cell.end_of(tool.move_path(points, **pace)) is None
    at_once = cell.now - begun
    assert cell.end_of(tool.move_linear((200.0, 150.0), **pace, jerk=5000.0)) is None
    begun = cell.now
    assert cell.end_of(tool.move_path(points, **pace, jerk=5000.0)) is None
    assert cell.now - begun > at_once + 2 * 0.3
    assert tool.tool_position == pytest.approx(points[-1], abs=NEAR)
    with pytest.raises(ArgumentError, match="jerk cannot be limited along this path"):
        tool.move_path([(200.0, 150.0), (260.0, 150.0)], **pace, jerk=5000.0, blend=5.0)
