"""The halt of an interrupt: moving axes stop enabled, commands end as stopped, and the machine continues."""

from __future__ import annotations

import pytest

from axisbus import AxisState
from axisbus.errors import Stopped
from kit.cell import Stage

REASON = "the reason of the test"


@pytest.fixture
def stage(tmp_path):
    with Stage(tmp_path) as stage:
        yield stage


@pytest.fixture
def cell(stage):
    return stage.simulated("xyz").enabled()


def halt(cell, number=1):
    cell.machine.session.request_halt(REASON, number)


def stopped(cell, handle, by=""):
    error = cell.failure_of(handle)
    assert type(error) is Stopped
    assert error.message == (by or f"{handle.name.partition('.')[0]} was halted: {REASON}")
    assert handle.aborted
    return True


def states(cell):
    return [axis.state for axis in cell.machine]


STANDING = [AxisState.STANDSTILL] * 3


def test_moving_axes_halt_on_their_ramp_and_stay_enabled(cell):
    moves = cell.travelling(velocity=100.0)
    cell.run(0.5)
    halt(cell)
    assert all(stopped(cell, move) for move in moves)
    before = [axis.position for axis in cell.machine]
    cell.run(1.0)
    assert states(cell) == STANDING
    way = [axis.position - place for axis, place in zip(cell.machine, before, strict=True)]
    assert all(7.0 < each < 13.0 for each in way)  # 100 deg/s on 500 deg/s²


def test_the_next_command_is_taken_also_while_it_brakes(cell):
    cell.travelling()
    cell.run(0.5)
    halt(cell)
    cell.run(0.05)
    assert cell.end_of(cell.x.move_absolute(3.0)) is None
    assert cell.x.position == pytest.approx(3.0, abs=0.1)


def test_a_velocity_that_has_been_reached_is_halted_too(cell):
    cell.turning()
    cell.run(0.5)
    halt(cell)
    cell.run(1.0)
    assert states(cell) == STANDING


def test_of_the_waiting_commands_only_stops_are_executed(cell):
    move, disable = cell.x.move_relative(100.0), cell["y"].disable()
    halt(cell)
    assert stopped(cell, move, f"{move.name} did not begin: {REASON}")
    assert cell.end_of(disable) is None
    cell.run(0.1)
    assert states(cell) == [AxisState.STANDSTILL, AxisState.DISABLED, AxisState.STANDSTILL]


def test_a_running_enable_is_cancelled(stage):
    cell = stage.simulated("x")
    enable = cell.x.enable()
    cell.run(0.02)
    assert enable.busy
    halt(cell)
    assert type(cell.failure_of(enable)) is Stopped
    cell.run(1.0)
    assert cell.end_of(cell.x.enable()) is None


def test_a_running_disable_continues(cell):
    cell.turning(names="x")
    cell.run(0.3)
    disable = cell.x.disable()
    cell.run(0.03)
    halt(cell)
    assert cell.end_of(disable) is None
    assert cell.x.state is AxisState.DISABLED


def test_a_line_ends_as_stopped_and_its_axes_reach_standstill(cell):
    line = cell.machine.group("x", "y").move_linear((500.0, 250.0), velocity=100.0)
    cell.run(0.8)
    halt(cell)
    assert type(cell.failure_of(line)) is Stopped
    cell.run(1.0)
    assert states(cell) == STANDING
    assert cell["y"].position == pytest.approx(cell.x.position / 2, abs=1.0)
    assert cell.end_of(cell.machine.group("x", "y").move_linear((0.0, 0.0), velocity=200.0)) is None


def test_a_second_interrupt_while_one_brakes_is_a_quick_stop(cell):
    cell.turning(200.0, names="x")
    cell.run(1.0)
    halt(cell)
    cell.run(0.1)
    halt(cell, 2)
    cell.run(1.0)
    assert states(cell) == [AxisState.DISABLED, AxisState.STANDSTILL, AxisState.STANDSTILL]


@pytest.mark.parametrize("second", [1, 0])
def test_an_interrupt_reported_twice_counts_once(cell, second):
    cell.turning(200.0, names="x")
    cell.run(1.0)
    halt(cell)
    cell.run(0.1)
    halt(cell, second)
    cell.run(1.0)
    assert states(cell) == STANDING


def test_a_second_interrupt_at_standstill_changes_nothing(cell):
    cell.turning()
    halt(cell)
    cell.run(1.0)
    halt(cell, 2)
    cell.run(0.5)
    assert states(cell) == STANDING


def test_during_closing_a_halt_changes_nothing(cell):
    cell.turning()
    cell.run(0.5)
    cell.machine.session.request_stop("the way out")
    halt(cell)
    cell.run(1.0)
    assert states(cell) == [AxisState.DISABLED] * 3


def test_an_axis_that_was_never_commanded_is_left_alone(stage):
    cell = stage.simulated("xy")
    halt(cell)
    cell.run(0.1)
    assert not any(cell.core(name).touched for name in "xy")
