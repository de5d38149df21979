"""Lines that pass into the next without a stop, and points that are added to a path while it runs."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from axisbus.errors import ArgumentError, DriveFault, Interrupted, LimitError, StateError, Stopped
from axisbus.machine.groups import Group
from axisbus.motion.states import AxisState
from kit.bounds.highest_shares import ACCELERATION, MOST, VELOCITY, Ledger
from kit.cell import Cell

AXIS = "max_acceleration = 1000.0"
PERIOD = 0.01
MODES = {"low": 60.0, "previous": 60.0, "next": 120.0, "high": 120.0}  # from 60 to 120 deg/s


def two(scenario, names: str = "xy") -> tuple[Cell, Group, Ledger]:
    cell = scenario.simulated(names, axis=AXIS).enabled()
    return cell, cell.machine.group(*names), Ledger(cell, PERIOD)


def place(cell: Cell, names: str = "xy") -> list[float]:
    return [cell.where(name) for name in names]


def speeds(cell: Cell, names: str = "xy", since: float = 0.0) -> list[tuple[tuple[float, ...], float]]:
    """Each place, and the speed that it was come to with."""
    places = list(zip(*(cell.positions(name, since) for name in names), strict=True))
    return [(b, math.dist(a, b) / PERIOD) for a, b in pairwise(places)]


def must_have_kept_limits(ledger: Ledger) -> None:
    assert ledger.worst.cycles > 50
    for limit in (VELOCITY, ACCELERATION):
        assert ledger.worst.shares[limit][0] <= MOST, ledger.worst.shares


def speed_at(cell: Cell, at: float) -> float:
    """How fast x was when it passed a place."""
    return next(speed for (x, *_), speed in speeds(cell, "x") if x >= at)


@pytest.mark.parametrize(("mode", "joint"), MODES.items())
def test_the_transition_has_the_velocity_of_its_mode(scenario, mode, joint):
    cell, group, ledger = two(scenario, "x")
    first = group.move_linear((60.0,), velocity=60.0)
    second = group.move_linear((150.0,), velocity=120.0, buffer=f"blending_{mode}")
    assert cell.end_of(first) is None
    assert second.active
    assert cell.where("x") == pytest.approx(60.0, abs=3.0)
    assert cell.end_of(second) is None
    assert speed_at(cell, 60.0) == pytest.approx(joint, abs=8.0)
    assert speed_at(cell, 20.0) == pytest.approx(60.0, abs=2.0)
    assert max(speed for _, speed in speeds(cell, "x")) == pytest.approx(120.0, abs=2.0)
    assert cell.where("x") == pytest.approx(150.0, abs=0.1)
    must_have_kept_limits(ledger)


def test_the_transition_to_a_slower_line_has_the_velocity_of_its_mode(scenario):
    found = {}
    for mode in MODES:
        cell, group, _ = two(scenario, "x")
        group.move_linear((60.0,), velocity=120.0)
        assert cell.end_of(group.move_linear((150.0,), velocity=60.0, buffer=f"blending_{mode}")) is None
        found[mode] = speed_at(cell, 60.0)
    assert found == pytest.approx({"low": 60.0, "next": 60.0, "previous": 120.0, "high": 120.0}, abs=8.0)


def test_a_blended_line_that_reverses_stops_at_the_transition(scenario):
    cell, group, ledger = two(scenario, "x")
    first = group.move_linear((50.0,), velocity=100.0)
    back = group.move_linear((-20.0,), velocity=100.0, buffer="blending_high")
    assert cell.end_of(first) is None
    assert cell.end_of(back) is None
    assert max(cell.positions("x")) == pytest.approx(50.0, abs=0.3)
    assert cell.where("x") == pytest.approx(-20.0, abs=0.1)
    must_have_kept_limits(ledger)


def test_lines_round_a_square_keep_their_speed_through_the_corners(scenario):
    cell, group, ledger = two(scenario)
    lines = [group.move_linear((60.0, 0.0), velocity=60.0)]
    lines += [
        group.move_linear(corner, velocity=60.0, buffer="blending_previous", blend=4.0)
        for corner in [(60.0, 60.0), (0.0, 60.0), (0.0, 0.0)]
    ]
    for line in lines:
        assert cell.end_of(line) is None
    assert place(cell) == pytest.approx([0.0, 0.0], abs=0.1)
    seen = speeds(cell)
    for tip in [(60.0, 0.0), (60.0, 60.0), (0.0, 60.0)]:
        near, speed = min(seen, key=lambda each, tip=tip: math.dist(each[0], tip))
        assert 3.0 < math.dist(near, tip) < 4.3
        assert speed > 40.0
    must_have_kept_limits(ledger)


@pytest.mark.parametrize("after", [0.0, 0.3, 0.8, 0.9, 1.0, 1.05, 1.1, 1.2, 1.6])
def test_a_line_given_late_has_a_narrower_corner_or_a_stop_and_never_a_jolt(scenario, after):
    cell, group, ledger = two(scenario)
    first = group.move_linear((60.0, 0.0), velocity=60.0)
    cell.run(after)
    second = group.move_linear((60.0, 60.0), velocity=60.0, buffer="blending_low", blend=20.0)
    assert cell.end_of(first) is None
    assert cell.end_of(second) is None
    assert place(cell) == pytest.approx([60.0, 60.0], abs=0.1)
    late = 0.5 < after < 1.5  # before that there is time, after that no motion is running
    assert ("narrower" in second.note or "stop before it" in second.note) is late
    must_have_kept_limits(ledger)


def test_a_line_given_after_the_last_target_is_buffered_and_its_note_gives_the_reason(scenario):
    cell, group, _ = two(scenario)
    first = group.move_linear((60.0, 0.0), velocity=60.0)
    cell.until(lambda: cell.where("x") > 59.99)
    second = group.move_linear((60.0, 60.0), velocity=60.0, buffer="blending_low", blend=20.0)
    assert first.busy
    assert cell.end_of(second) is None
    assert "buffered instead of blended" in second.note


def test_if_the_path_reverses_the_note_reports_that_the_axes_stopped(scenario):
    cell, group, _ = two(scenario, "x")
    group.move_linear((50.0,), velocity=100.0)
    back = group.move_linear((-20.0,), velocity=100.0, buffer="blending_high")
    assert cell.end_of(back) is None
    assert "reverses there" in back.note


@pytest.mark.parametrize("factor", [0.3, 1.5, 0.0])
def test_an_override_holds_for_all_of_it(scenario, factor):
    cell, group, ledger = two(scenario)
    group.move_linear((60.0, 0.0), velocity=60.0)
    last = group.move_linear((60.0, 60.0), velocity=90.0, buffer="blending_next", blend=5.0)
    cell.run(0.6)
    assert cell.end_of(group.set_override(factor)) is None
    cell.run(0.8)
    assert cell.end_of(group.set_override(1.0)) is None
    assert cell.end_of(last) is None
    assert place(cell) == pytest.approx([60.0, 60.0], abs=0.1)
    must_have_kept_limits(ledger)


@pytest.mark.parametrize("how", ["halt", "stop", "fault"])
def test_buffered_commands_end_with_the_motion(scenario, how):
    cell, group, _ = two(scenario)
    passed = group.move_linear((20.0, 0.0), velocity=60.0)
    others = [
        group.move_linear((60.0, 60.0), velocity=60.0, buffer="blending_low", blend=5.0),
        group.extend_path([(0.0, 60.0)], velocity=60.0, blend=5.0),
        group.move_linear((0.0, 0.0), velocity=60.0, buffer=True),
    ]
    cell.until(lambda: others[0].active)
    assert passed.done
    if how == "fault":
        cell.machine.simulated_node(2).fault(0x2310)
    else:
        assert cell.end_of(getattr(group, how)()) is None
    errors = [cell.failure_of(handle) for handle in others]
    assert all(isinstance(error, Stopped | Interrupted | DriveFault) for error in errors)
    cell.run(0.5)
    before = place(cell)
    cell.run(0.5)
    assert place(cell) == pytest.approx(before, abs=0.1)


def test_a_move_that_took_over_after_a_halt_continues_to_the_end_of_all(scenario):
    cell, group, ledger = two(scenario)
    group.move_linear((60.0, 0.0), velocity=60.0)
    group.move_linear((60.0, 60.0), velocity=90.0, buffer="blending_high", blend=5.0)
    cell.run(0.7)
    assert cell.end_of(group.halt()) is None
    cell.run(0.2)
    on = group.resume()
    cell.run(0.3)
    more = group.extend_path([(0.0, 60.0)], velocity=60.0, blend=5.0)
    assert cell.end_of(on) is None
    assert cell.end_of(more) is None
    assert place(cell) == pytest.approx([0.0, 60.0], abs=0.1)
    must_have_kept_limits(ledger)


# -- points that are added -----------------------------------------------------------------------------------------------


def test_points_added_in_time_are_passed_at_the_speed_of_the_path(scenario):
    cell, group, ledger = two(scenario)
    handles = [group.move_path([(30.0, 0.0), (30.0, 30.0)], velocity=60.0, blend=4.0, more=True)]
    for corner in [(60.0, 30.0), (60.0, 60.0), (90.0, 60.0), (90.0, 90.0)]:
        cell.run(0.4)
        handles.append(group.extend_path([corner]))
    assert [cell.end_of(handle) for handle in handles] == [None] * 5
    assert place(cell) == pytest.approx([90.0, 90.0], abs=0.1)
    inside = [speed for (x, y), speed in speeds(cell) if 5.0 < x + y < 165.0]
    assert min(inside) > 40.0
    must_have_kept_limits(ledger)


def test_a_path_that_runs_out_of_points_ends_at_standstill_and_takes_no_more_points(scenario):
    cell, group, ledger = two(scenario)
    path = group.move_path([(30.0, 0.0)], velocity=60.0, blend=4.0, more=True)
    assert cell.end_of(path) is None
    assert place(cell) == pytest.approx([30.0, 0.0], abs=0.1)
    error = cell.failure_of(group.extend_path([(30.0, 30.0)]))
    assert isinstance(error, StateError)
    assert "the group follows no path to which points could be added" in str(error)
    cell.run(0.3)
    assert place(cell) == pytest.approx([30.0, 0.0], abs=0.1)
    must_have_kept_limits(ledger)


def test_an_invalid_point_is_refused_and_the_path_continues(scenario):
    cell = scenario.simulated("xy", axis=AXIS + "\nposition_limits = [-100.0, 100.0]").enabled()
    group = cell.machine.group("x", "y")
    path = group.move_path([(30.0, 0.0)], velocity=60.0, blend=4.0, more=True)
    with pytest.raises(LimitError):
        group.extend_path([(30.0, 101.0)])
    with pytest.raises(ArgumentError):
        group.extend_path([(30.0,)])
    assert cell.end_of(path) is None
    assert place(cell) == pytest.approx([30.0, 0.0], abs=0.1)


def test_a_path_accepts_a_limited_number_of_blended_commands(scenario):
    cell, group, _ = two(scenario, "x")
    path = group.move_path([(1.0,)], velocity=60.0, more=True)
    handles = [group.extend_path([(1.0 + 0.01 * n,)]) for n in range(1, 102)]
    assert "too many commands are blended" in str(cell.failure_of(handles[-1]))
    assert cell.end_of(path) is None
    assert cell.end_of(handles[98]) is None


# -- refusals ------------------------------------------------------------------------------------------------------------


def test_a_segment_appended_to_a_refused_path_joins_no_other_path(scenario):
    """The program does not know yet that the path is refused, and assumes its end; the running motion ends elsewhere."""
    cell, group, ledger = two(scenario)
    line = group.move_linear((40.0, 60.0), velocity=60.0)
    refused = group.move_path(
        [(60.0, -60.0)], velocity=60.0, blend=4.0, more=True
    )  # it does not wait for the line
    added = group.extend_path([(-20.0, 60.0)])
    assert isinstance(cell.failure_of(refused), StateError)
    assert "does not begin at the end of the present motion" in str(cell.failure_of(added))
    assert cell.end_of(line) is None
    assert place(cell) == pytest.approx([40.0, 60.0], abs=0.1)
    assert max(y for (_, y), _ in speeds(cell)) < 60.1
    must_have_kept_limits(ledger)


def test_a_continuation_that_has_not_begun_is_extended_at_its_end(scenario):
    cell, group, ledger = two(scenario)
    group.move_linear((60.0, 0.0), velocity=60.0)
    group.move_linear((60.0, 60.0), velocity=90.0, buffer="blending_high", blend=5.0)
    cell.run(0.7)
    assert cell.end_of(group.halt()) is None
    on = group.resume()
    more = group.extend_path([(0.0, 60.0)], velocity=60.0, blend=5.0)
    assert cell.end_of(on) is None
    assert cell.end_of(more) is None
    assert place(cell) == pytest.approx([0.0, 60.0], abs=0.1)
    must_have_kept_limits(ledger)


def test_a_blend_that_would_be_a_stop_is_refused_with_the_missing_argument(scenario):
    cell, group, _ = two(scenario)
    with pytest.raises(ArgumentError, match="is not a buffer mode"):
        group.move_linear((1.0, 1.0), velocity=10.0, buffer="blending")
    with pytest.raises(ArgumentError, match="without blend it would stop"):
        group.move_linear((1.0, 1.0), velocity=10.0, buffer="blending_low")
    with pytest.raises(ArgumentError, match="jerk limit"):
        group.move_linear((1.0, 1.0), velocity=10.0, jerk=5000.0, buffer="blending_low", blend=1.0)
    with pytest.raises(ArgumentError, match="circle"):
        group.move_circular((1.0, 1.0), via=(1.0, 0.0), velocity=10.0, buffer="blending_low")
    assert cell["x"].state is AxisState.STANDSTILL


@pytest.mark.parametrize("what", ["circle", "jerk", "direct"])
def test_invalid_blends_are_refused_before_any_motion(scenario, what):
    cell, group, _ = two(scenario)
    before = {
        "circle": lambda: group.move_circular((0.0, 0.0), centre=(30.0, 0.0), velocity=60.0),
        "jerk": lambda: group.move_linear((60.0, 0.0), velocity=60.0, jerk=5000.0),
        "direct": lambda: group.move_direct((30.0, 10.0)),
    }[what]()
    cell.run(0.2)
    refused = group.move_linear((50.0, 50.0), velocity=60.0, buffer="blending_low", blend=3.0)
    assert "cannot be blended with the next one" in str(cell.failure_of(refused))
    assert cell.end_of(before) is None
