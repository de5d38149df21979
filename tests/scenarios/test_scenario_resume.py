"""An interrupted straight line is resumed to its end from the position of its axes, and never from another position."""

from __future__ import annotations

import re

import pytest

from axisbus.errors import StateError
from axisbus.machine.handle import Handle
from kit.cell import Cell

AXIS = "max_acceleration = 1000.0"
END = (400.0, 200.0, -100.0)


def on_a_line(scenario, **changes):
    """Three axes in the middle of a line, at full speed."""
    cell = scenario.simulated("xyz", axis=AXIS, **changes)
    group = cell.machine.group("x", "y", "z")
    cell.enabled()
    line = group.move_linear(END, velocity=300.0, acceleration=900.0)
    cell.run(0.8)
    assert line.active
    return cell, group, line


def refusal_of(handle: Handle, cell: Cell, words: str) -> StateError:
    error = cell.failure_of(handle)
    assert isinstance(error, StateError)
    assert words in str(error)
    return error


def must_have_kept_to_the_line(cell: Cell, since: float = 0.0) -> None:
    for places in zip(*(cell.positions(name, since) for name in "xyz"), strict=True):
        share = places[0] / END[0]
        assert places == pytest.approx(tuple(share * end for end in END), abs=0.2)


def must_be_at_the_end(cell: Cell) -> None:
    cell.run(0.3)
    assert [cell.where(name) for name in "xyz"] == pytest.approx(END, abs=0.1)


@pytest.mark.parametrize("times", [1, 3])
def test_after_a_halt_the_line_continues_to_its_end(scenario, times):
    cell, group, _ = on_a_line(scenario)
    for _ in range(times):
        cell.end_of(group.halt())
        assert [cell.machine[name].velocity for name in "xyz"] == pytest.approx([0.0] * 3, abs=0.5)
        line = group.resume()
        cell.run(0.25)
        assert line.active
    assert cell.end_of(line) is None
    must_be_at_the_end(cell)
    must_have_kept_to_the_line(cell)


def test_a_halt_of_one_axis_stops_all_on_the_line_and_it_continues(scenario):
    cell, group, _ = on_a_line(scenario)
    cell.end_of(cell.machine["y"].halt())
    cell.run(0.5)
    assert cell.end_of(group.resume()) is None
    must_be_at_the_end(cell)
    must_have_kept_to_the_line(cell)


def test_a_group_that_a_quick_stop_took_off_its_line_returns_to_it_before_it_resumes(scenario):
    cell, group, _ = on_a_line(scenario)
    cell.end_of(group.quick_stop())
    cell.end_of(group.enable())
    told = refusal_of(
        group.resume(), cell, "is no longer at the position at which the path was interrupted"
    )  # each drive had a ramp of its own
    places = re.search(r"group\.move_direct\(\((.*),\)\)", told.remedy)[1]
    assert cell.end_of(group.move_direct([float(place) for place in places.split(",")])) is None
    cell.run(0.3)
    assert cell.end_of(group.resume()) is None
    must_be_at_the_end(cell)


def test_after_a_fault_the_line_continues_only_if_the_axes_are_still_on_it(scenario):
    cell, group, _ = on_a_line(scenario)
    cell.machine.simulated_node(2).fault(0x2310)
    cell.run(2.0)
    cell.end_of(group.reset())
    cell.end_of(group.enable())
    assert all(cell.machine[name].enabled for name in "xyz")
    before = [cell.where(name) for name in "xyz"]
    refusal_of(
        group.resume(), cell, "is no longer at the position at which the path was interrupted"
    )  # by the drive's own reaction
    cell.run(0.3)
    assert [cell.where(name) for name in "xyz"] == pytest.approx(before, abs=0.05)
    assert cell.end_of(group.move_linear(END, velocity=300.0)) is None
    must_be_at_the_end(cell)


def test_an_axis_that_was_moved_meanwhile_keeps_the_line_from_continuing(scenario):
    cell, group, _ = on_a_line(scenario)
    cell.end_of(group.halt())
    cell.end_of(cell.machine["z"].move_relative(-20.0))
    told = refusal_of(
        group.resume(), cell, "z is no longer at the position at which the path was interrupted"
    )
    assert float(told.observed.split()[2]) == pytest.approx(20.0, abs=0.1)
    cell.end_of(cell.machine["z"].move_relative(20.0))
    assert cell.end_of(group.resume()) is None
    must_be_at_the_end(cell)


def test_a_position_that_was_set_meanwhile_keeps_the_line_from_continuing(scenario):
    cell, group, _ = on_a_line(scenario)
    cell.end_of(group.halt())
    cell.end_of(cell.machine["x"].set_position(0.0))
    refusal_of(group.resume(), cell, "no longer at the position at which the path was interrupted")


def test_without_a_line_that_was_broken_off_there_is_nothing_to_continue_with(scenario):
    cell = scenario.simulated("xy", axis=AXIS)
    group = cell.machine.group("x", "y")
    cell.enabled()
    refusal_of(group.resume(), cell, "there is no line to continue")
    line = group.move_linear((10.0, 10.0), velocity=50.0)
    refusal_of(group.resume(), cell, "the line still runs")
    assert cell.end_of(line) is None
    refusal_of(group.resume(), cell, "the line has ended")


def test_a_resume_of_a_disabled_group_is_refused_like_any_line(scenario):
    cell, group, _ = on_a_line(scenario)
    cell.end_of(group.halt())
    cell.end_of(group.disable())
    assert "is Disabled" in str(cell.failure_of(group.resume()))
    cell.end_of(group.enable())
    assert cell.end_of(group.resume()) is None
    must_be_at_the_end(cell)
