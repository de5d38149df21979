"""Commands that wait for the one before them: in order, none begun early, none left behind a motion that did not end well."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest

from axisbus.errors import AxisbusError, DriveFault, Interrupted, StateError, Stopped
from axisbus.motion.axis.queue import MOST
from axisbus.motion.states import AxisState
from kit.cell import Cell

AXIS = "max_acceleration = 1000.0"


def one(scenario, names: str = "x", **changes: str) -> Cell:
    return scenario.simulated(names, **{"axis": AXIS} | changes).enabled()


def turns(places: list[float]) -> list[float]:
    """Where a motor turned round."""
    found, way = [], 0.0
    for before, after in pairwise(places):
        step = after - before
        if step * way < 0.0:
            found.append(before)
        way = step or way
    return found


def test_moves_wait_for_each_other(scenario):
    cell = one(scenario)
    x = cell["x"]
    handles = [
        x.move_absolute(20.0),
        x.move_absolute(5.0, buffer=True),
        x.move_relative(-15.0, buffer=True),
        x.move_additive(40.0, buffer=True),
    ]
    ends = []
    for handle in handles:
        assert cell.end_of(handle) is None
        assert all(later.busy for later in handles[len(ends) + 1 :])
        ends.append(cell.where("x"))
    assert ends == pytest.approx([20.0, 5.0, -10.0, 30.0], abs=0.1)
    assert turns(cell.positions("x")) == pytest.approx([20.0, -10.0], abs=0.2)
    assert x.state is AxisState.STANDSTILL


def test_a_buffered_move_begins_at_once_without_another_before_it_and_is_refused_without_power(scenario):
    cell = one(scenario)
    assert cell.end_of(cell["x"].move_absolute(10.0, buffer=True)) is None
    assert cell.where("x") == pytest.approx(10.0, abs=0.1)
    cell["x"].disable().wait()
    assert isinstance(cell.failure_of(cell["x"].move_absolute(0.0, buffer=True)), StateError)


def test_a_move_behind_a_velocity_begins_when_that_is_reached(scenario):
    cell = one(scenario)
    turning = cell["x"].move_velocity(50.0)
    back = cell["x"].move_absolute(0.0, buffer=True)
    more = cell["x"].move_absolute(7.0, buffer=True)
    assert cell.end_of(turning) is None
    assert cell.top_speed("x") == pytest.approx(50.0, abs=1.0)
    assert cell.end_of(back) is None
    assert cell.end_of(more) is None
    assert cell.where("x") == pytest.approx(7.0, abs=0.1)


@pytest.mark.parametrize("how", ["halt", "stop", "quick_stop", "disable", "move", "fault"])
def test_buffered_moves_do_not_begin_after_a_motion_that_failed(scenario, how):
    cell = one(scenario)
    x = cell["x"]
    first = x.move_absolute(200.0)
    waits = [x.move_absolute(-50.0, buffer=True), x.move_velocity(30.0, buffer=True)]
    cell.run(0.5)
    if how == "fault":
        cell.machine.simulated_node(1).fault(0x2310)
        assert isinstance(cell.failure_of(first), DriveFault)
    elif how == "move":
        assert cell.end_of(x.move_absolute(90.0)) is None
    else:
        assert cell.end_of(getattr(x, how)()) is None
    for handle in waits:
        error = cell.failure_of(handle)
        assert isinstance(error, Interrupted)
        assert "did not begin, because x.move_absolute(200 deg) failed" in str(error)
    before = cell.where("x")
    cell.run(1.0)
    assert cell.where("x") == pytest.approx(before, abs=0.5 if how != "fault" else 20.0)


def test_a_buffered_move_that_is_refused_at_its_start_ends_those_behind_it(scenario):
    cell = one(scenario, axis=AXIS + "\nposition_limits = [-60.0, 60.0]")
    x = cell["x"]
    first = x.move_absolute(50.0)
    beyond, behind = x.move_relative(20.0, buffer=True), x.move_absolute(0.0, buffer=True)
    assert cell.end_of(first) is None
    assert "would end beyond the position limits" in str(cell.failure_of(beyond))
    assert isinstance(cell.failure_of(behind), Interrupted)
    cell.run(0.5)
    assert cell.where("x") == pytest.approx(50.0, abs=0.1)


def test_a_move_does_not_wait_for_a_halt(scenario):
    cell = one(scenario)
    cell["x"].move_velocity(90.0).wait()
    halt = cell["x"].halt()
    assert "is being halted" in str(cell.failure_of(cell["x"].move_absolute(0.0, buffer=True)))
    assert cell.end_of(halt) is None


def test_so_many_wait_and_no_more(scenario):
    cell = one(scenario)
    x = cell["x"]
    first = x.move_absolute(100.0)
    handles = [x.move_relative(0.1, buffer=True) for _ in range(MOST + 1)]
    assert f"{MOST} commands are waiting already" in str(cell.failure_of(handles[-1]))
    x.halt().wait()
    assert all(isinstance(handle.exception(), Interrupted) for handle in (first, *handles[:-1]))


def test_closing_the_machine_ends_a_buffered_move(scenario):
    cell = one(scenario)
    cell["x"].move_absolute(100.0)
    waits = cell["x"].move_absolute(0.0, buffer=True)
    cell.run(0.2)
    assert cell.ctrl_c(5.0) == []
    assert not waits.busy
    assert waits.exception() is not None


def test_lines_paths_and_circles_of_a_group_wait_for_each_other(scenario):
    cell = one(scenario, "xy")
    xy = cell.machine.group("x", "y")
    handles = [
        xy.move_linear((30.0, 0.0), velocity=90.0),
        xy.move_path([(30.0, 30.0), (0.0, 30.0)], velocity=90.0, blend=2.0, buffer=True),
        xy.move_circular((0.0, 0.0), centre=(0.0, 15.0), velocity=90.0, buffer=True),
        xy.move_linear((10.0, 20.0), velocity=90.0, jerk=8000.0, buffer=True),
    ]
    ends = []
    for handle in handles:
        assert cell.end_of(handle) is None
        ends.append((cell.where("x"), cell.where("y")))
    for end, place in zip(ends, [(30.0, 0.0), (0.0, 30.0), (0.0, 0.0), (10.0, 20.0)], strict=True):
        assert end == pytest.approx(place, abs=0.1)


@pytest.mark.parametrize("how", ["halt", "fault"])
def test_a_path_buffered_behind_an_interrupted_line_does_not_begin(scenario, how):
    cell = one(scenario, "xy")
    xy = cell.machine.group("x", "y")
    first = xy.move_linear((300.0, 0.0), velocity=90.0)
    waits = xy.move_path([(0.0, 0.0)], velocity=90.0, buffer=True)
    cell.run(0.5)
    if how == "halt":
        cell.end_of(xy.halt())
    else:
        cell.machine.simulated_node(2).fault(0x2310)
    assert cell.end_of(first) is not None
    assert "did not begin" in str(cell.failure_of(waits))


def test_a_line_does_not_wait_for_a_halt_of_its_group_to_begin_behind_another(scenario):
    cell = scenario.simulated("xy").enabled()
    xy = cell.machine.group("x", "y")
    xy.move_linear([90.0, 40.0], velocity=90.0)
    cell.run(0.5)
    xy.halt()
    cell.run(0.02)
    waiting = xy.move_linear([0.0, 0.0], velocity=50.0, buffer=True)
    cell.run(0.02)
    error = cell.failure_of(waiting)
    assert "being halted" in error.message
    assert cell.end_of(xy.halt()) is None
    here = cell.where("x")
    cell.run(1.0)
    assert cell.where("x") == here


@pytest.mark.parametrize("how", ["halt", "stop", "quick_stop", "disable"])
def test_a_line_buffered_behind_an_enable_of_the_group_does_not_begin_after_a_stop(scenario, how):
    cell = scenario.simulated("xy").enabled()
    xy = cell.machine.group("x", "y")
    cell.drive("y").dials.transition_delay = {2: 0.3}
    cell.end_of(xy.disable())
    xy.enable()
    cell.run(0.05)
    waiting = xy.move_linear([10.0, 10.0], velocity=50.0, buffer=True)
    cell.run(0.02)
    getattr(xy, how)()
    cell.run(1.0)
    assert isinstance(cell.failure_of(waiting), Stopped)
    assert cell.where("x") == cell.where("y") == 0.0


@pytest.mark.parametrize("seed", range(20))
def test_every_handle_of_random_buffered_commands_ends_and_the_scan_survives(scenario, seed):
    rng = random.Random(seed)
    cell = one(scenario)
    x, handles = cell["x"], []
    for _ in range(30):
        buffer = rng.random() < 0.7
        handles.append(
            rng.choice(
                [
                    lambda b=buffer: x.move_absolute(rng.uniform(-40.0, 40.0), buffer=b),
                    lambda b=buffer: x.move_relative(rng.uniform(-20.0, 20.0), buffer=b),
                    lambda b=buffer: x.move_velocity(rng.uniform(-60.0, 60.0), buffer=b),
                    x.halt,
                ]
            )()
        )
        cell.run(rng.choice([0.0, 0.0, 0.05, 0.6]))
    last = x.move_absolute(3.0, buffer=True)
    cell.until(lambda: not last.busy and all(not handle.busy for handle in handles), 60.0)
    assert cell.scan_runs
    if last.exception() is None:
        assert cell.where("x") == pytest.approx(3.0, abs=0.1)
    else:
        assert isinstance(last.exception(), AxisbusError)
    x.halt().wait()
    assert x.state is AxisState.STANDSTILL
