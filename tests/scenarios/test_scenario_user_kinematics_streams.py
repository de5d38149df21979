"""Points in coordinates of the program's own kinematics: the tool follows them, and invalid points are refused one by one."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest

from axisbus import Scara
from axisbus.errors import ArgumentError, LimitError, StateError, Stopped
from axisbus.machine.user_kinematics.kinematics import UserKinematicsAdapter
from axisbus.machine.user_kinematics.point_solver import WorkspaceCurveFit
from axisbus.motion.point_stream.curve_fit import StreamLimits, StreamPoint, at
from kit.cell import SCALE

AXIS = "max_acceleration = 4000.0"
UPPER, FORE = 200.0, 150.0
NEAR = 350.0 * math.radians(
    2.5 / SCALE
)  # the effect of two increments of both joints, and of the spans, on the tool position
PERIOD, CYCLE = 0.02, 0.01


class Arm:
    """Two arms in a plane by the law of sines, with the nearer one of both solutions; ``said`` replaces the result."""

    def __init__(self):
        self.said = None

    def forward(self, joints):
        shoulder, elbow = (math.radians(joint) for joint in joints)
        tip = UPPER * complex(math.cos(shoulder), math.sin(shoulder))
        tip += FORE * complex(math.cos(shoulder + elbow), math.sin(shoulder + elbow))
        return tip.real, tip.imag

    def inverse(self, coordinates, near):
        if self.said is not None:
            return self.said(coordinates, near)
        x, y = coordinates
        far = math.hypot(x, y)
        if not UPPER - FORE < far < UPPER + FORE:
            raise ValueError("the arm does not reach that far")
        bend = math.degrees(math.acos((far**2 - UPPER**2 - FORE**2) / (2 * UPPER * FORE)))
        found = []
        for elbow in (bend, -bend):
            beside = math.atan2(
                FORE * math.sin(math.radians(elbow)), UPPER + FORE * math.cos(math.radians(elbow))
            )
            found.append((math.degrees(math.atan2(y, x) - beside), elbow))
        return min(found, key=lambda one: math.dist(one, near))


class Turntable:
    """x turns a table, y moves a slide on it; turns are counted on."""

    def forward(self, joints):
        turn, out = math.radians(joints[0]), 100.0 + joints[1]
        return out * math.cos(turn), out * math.sin(turn)

    def inverse(self, coordinates, near):
        turn = math.degrees(math.atan2(coordinates[1], coordinates[0]))
        return turn + 360.0 * round((near[0] - turn) / 360.0), math.hypot(*coordinates) - 100.0


class Telescope:
    """Two slides on top of each other make one height; each moves half of it."""

    def forward(self, joints):
        return (sum(joints),)

    def inverse(self, coordinates, near):
        left = coordinates[0] - sum(near)
        return near[0] + left / 2, near[1] + left / 2


def placed(scenario, kinematics, start=(0.0, 90.0), **changes):
    cell = scenario.simulated("xy", **{"axis": AXIS} | changes).enabled()
    assert cell.end_of(cell.machine.group("x", "y").move_direct(start)) is None
    return cell, cell.machine.group("x", "y", kinematics=kinematics)


def circle(number, about=(180.0, 150.0), wide=20.0, turns=0.004):
    """Positions on a circle, accelerated and braked; the first is (200, 150), the position of the arm."""
    angle = math.tau * turns * number * min(1.0, number / 50.0)
    return about[0] + wide * math.cos(angle), about[1] + wide * math.sin(angle)


def tools(cell, arm, since=0.0):
    """Where the demands have the tool."""
    xs, ys = (cell.record(name).since(since) for name in "xy")
    return [arm.forward((x.demand, y.demand)) for x, y in zip(xs, ys, strict=True)]


def test_a_stream_with_kinematics_of_the_program_moves_the_axes_as_the_scara_of_the_core_does(scenario):
    demands = []
    for arm in (Arm(), Scara(UPPER, FORE)):
        cell, tool = placed(scenario, arm)
        begun = cell.moment()
        with tool.stream(period=PERIOD) as points:
            for number in range(250):
                points.push(circle(number))
        seen = tools(cell, arm, begun)
        assert max(abs(math.dist(place, (180.0, 150.0)) - 20.0) for place in seen) < NEAR
        assert math.dist(tool.tool_position, circle(249)) < NEAR
        assert min(place[0] for place in seen) < 161.0  # it has been round
        demands.append([sample.demand for sample in cell.record("x").since(begun)])
    assert demands[0] == pytest.approx(demands[1], abs=1.5 / SCALE)


def test_turns_are_counted_from_the_previous_solution(scenario):
    cell, tool = placed(scenario, Turntable(), start=(0.0, 0.0))
    with tool.stream(period=0.05) as points:
        for number in range(201):
            angle = math.radians(4.0 * number * min(1.0, number / 40.0))
            points.push((100.0 * math.cos(angle), 100.0 * math.sin(angle)))
    assert cell.where("x") == pytest.approx(800.0, abs=0.05)
    assert cell.where("y") == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("refused", [0, 1, 20])
def test_the_spans_of_a_stream_join_after_any_refused_point(refused):
    """By spans alone: a solution that is forgotten would be looked for from the beginning, a turn off."""
    axes = {name: StreamLimits("deg", None, 400.0, 4000.0, "max_acceleration", 4000.0) for name in "xy"}
    own = UserKinematicsAdapter(Turntable(), {}, 0.05)
    own.inverse = Turntable().inverse
    joining = WorkspaceCurveFit(own, axes, lambda: (0.0, 0.0), "stream")
    ends = [(0.0, 0.0)]
    for number in range(201):
        angle = math.radians(4.0 * number * min(1.0, number / 40.0))
        for wide in [115.0 + more for more in range(refused if number == 120 else 0)]:
            with pytest.raises(LimitError, match="acceleration"):
                joining.take(StreamPoint(0.05 * number, (wide * math.cos(angle), wide * math.sin(angle))))
        for span in (
            joining.take(StreamPoint(0.05 * number, (100.0 * math.cos(angle), 100.0 * math.sin(angle)))) or ()
        ):
            assert [at(curve, 0.0) for curve in span.curves] == pytest.approx(ends[-1], abs=1e-6)
            ends.append([at(curve, span.seconds) for curve in span.curves])
    assert ends[-1] == pytest.approx((796.0, 0.0), abs=0.01)


def test_of_more_axes_than_coordinates_each_does_its_part(scenario):
    cell, tool = placed(scenario, Telescope(), start=(10.0, 20.0))
    with tool.stream(period=PERIOD) as points:
        for number in range(100):
            points.push((30.0 + 20.0 * (1.0 - math.cos(math.pi * number / 99.0)),))
        with pytest.raises(ArgumentError, match="is invalid"):
            points.push((1.0, 2.0))
    assert (cell.where("x"), cell.where("y")) == pytest.approx((30.0, 40.0), abs=0.05)


@pytest.mark.parametrize(
    ("said", "kind", "told"),
    [
        (lambda *_: (math.nan, 0.0), ArgumentError, "Arm.inverse returned"),
        (lambda *_: (1.0,), ArgumentError, "returned 1 position"),
        (lambda *_: 1 / 0, ArgumentError, "Arm.inverse failed"),
        (lambda _, near: (near[0] + 5.0, near[1]), ArgumentError, "do not agree"),
        (lambda *_: Arm().inverse((900.0, 0.0), (0.0, 0.0)), LimitError, "does not reach that far"),
    ],
    ids=["nan", "one", "raises", "elsewhere", "out of reach"],
)
@pytest.mark.parametrize("at", [0, 1, 2, 30])
def test_an_error_of_the_functions_names_the_point_and_only_that_point_is_rejected(
    scenario, said, kind, told, at
):
    arm = Arm()
    _cell, tool = placed(scenario, arm)
    with tool.stream(period=PERIOD) as points:
        for number in range(60):
            if number == at:
                arm.said = said
                with pytest.raises((kind, StateError), match="point") as refused:
                    points.push(circle(number))
                if refused.type is kind:
                    assert f"point {at + 1}" in refused.value.message
                    assert told in refused.value.message
                    assert "nothing has moved" not in refused.value.remedy
                else:
                    assert at == 0  # it is not at that position
                arm.said = None
            points.push(circle(number))
        assert points.count == 60
    assert math.dist(tool.tool_position, circle(59)) < NEAR


def test_a_point_that_an_axis_cannot_follow_is_refused(scenario):
    _cell, tool = placed(scenario, Arm())
    with tool.stream(period=PERIOD) as points:
        for number in range(40):
            points.push(circle(number))
        for place in ((340.0, 150.0), (120.0, 150.0)):  # beyond its reach, and too far to be there in time
            with pytest.raises(LimitError, match=r"point 41 .*acceleration"):
                points.push(place)
        for number in range(40, 60):
            points.push(circle(number))
    assert math.dist(tool.tool_position, circle(59)) < NEAR


def test_a_leap_to_another_solution_is_refused(scenario):
    arm = Arm()
    cell, tool = placed(scenario, arm)
    usual = arm.inverse
    with tool.stream(period=PERIOD) as points:
        for number in range(40):
            points.push(circle(number))
        arm.said = lambda place, _near: Arm().inverse(place, (90.0, -90.0))
        with pytest.raises(LimitError, match=r"point 41"):
            points.push(circle(40))
        arm.said = None
        points.push(circle(40))
    assert usual(circle(40), (0.0, 90.0)) == pytest.approx([cell.where("x"), cell.where("y")], abs=0.05)


def test_a_stream_must_begin_at_the_present_position(scenario):
    _cell, tool = placed(scenario, Arm())
    points = tool.stream(period=PERIOD)
    with pytest.raises(StateError, match="is not at the start of the stream"):
        points.push((190.0, 150.0))
    assert points.count == 0
    points.handle.exception()


def test_an_invalid_result_of_forward_is_reported_at_the_call(scenario):
    arm = Arm()
    _cell, tool = placed(scenario, arm)
    arm.forward = lambda _: ("x",)
    with pytest.raises(ArgumentError, match=r"stream: Arm.forward returned"):
        tool.stream(period=PERIOD)


def test_broken_off_by_a_halt_it_continues_through_every_point(scenario):
    arm = Arm()
    cell, tool = placed(scenario, arm)
    points = tool.stream(period=PERIOD, buffer=0.5)
    begun = cell.moment()
    for number in range(80):
        points.push(circle(number))
    tool.halt().wait(5)
    with pytest.raises(Stopped):
        points.push(circle(80))
    points.resume()
    tool.set_override(0.5).wait(1)
    for number in range(80, 160):
        points.push(circle(number))
    points.finish().wait(30)
    assert max(abs(math.dist(place, (180.0, 150.0)) - 20.0) for place in tools(cell, arm, begun)) < NEAR
    assert math.dist(tool.tool_position, circle(159)) < NEAR


@pytest.mark.parametrize("seed", range(12))
def test_no_axis_exceeds_its_velocity_or_acceleration_in_random_streams(scenario, seed):
    rng = random.Random(seed)
    arm = Arm()
    cell, tool = placed(scenario, arm)
    begun = cell.moment()
    wide, turns = rng.uniform(5.0, 25.0), rng.uniform(0.002, 0.012)
    places = [circle(number, (200.0 - wide, 150.0), wide, turns) for number in range(90)]
    points = tool.stream(period=0.03, buffer=0.3)
    taken = 0
    for place in places:  # the faster ones end where an axis would be too hard
        try:
            points.push(place)
        except LimitError:
            break
        taken += 1
        if rng.random() < 0.05:
            tool.set_override(rng.choice((0.4, 1.0))).wait(1)
        if rng.random() < 0.05:
            cell.run(0.8)  # too late: it is braked, and continues
    points.finish()
    tool.set_override(1.0).wait(1)
    points.handle.wait(30)
    assert taken > 10
    assert math.dist(tool.tool_position, places[taken - 1]) < NEAR
    for name in "xy":
        demands = [sample.demand for sample in cell.record(name).since(begun)][
            ::2
        ]  # each cycle is two steps of the plant
        speeds = [(b - a) / CYCLE for a, b in pairwise(demands)]
        rates = [abs(b - a) / CYCLE for a, b in pairwise(speeds)]
        assert max(map(abs, speeds)) < 400.0 + 1.0 / SCALE / CYCLE
        assert max(rates) < 4000.0 + 4.0 / SCALE / CYCLE**2
