"""Hold to run: as a pure function, and on a simulated cell in virtual time."""

from __future__ import annotations

import math

import pytest

from axisbus.errors import ArgumentError, Stopped
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.motion.stop.hold_to_run import HoldToRun
from kit.cell import cell_file


@pytest.fixture
def cell(tmp_path):
    path = cell_file(tmp_path, "xy", axis="rated_torque = 1.0")
    with Machine.simulated(path) as machine:
        for axis in machine:
            axis.enable().wait(5)
        yield machine


def never() -> bool:
    return False


def test_a_missing_confirmation_of_hold_to_run_is_reported_once():
    held = HoldToRun()
    assert held.broken(1e9, never) is None
    held.hold(10.0, 0.5, "the page")
    assert held.broken(10.5, never) is None
    held.hold(10.4, 0.5, "the page")
    assert held.broken(10.8, never) is None
    assert held.broken(10.91, never) == "the page, the hold-to-run client, sent no confirmation for 0.5 s"
    assert held.broken(11.0, never) is None
    held.hold(12.0, 0.5, "the page")
    held.let_go()
    assert held.broken(20.0, never) is None


def test_continuous_motion_is_trusted_for_a_shorter_time():
    held, moves = HoldToRun(), []
    for moves_on, until in ((False, 11.0), (True, 10.3)):
        held.hold(10.0, 1.0, "the page", 0.3)
        assert held.broken(10.3, lambda: moves.append(1) or True) is None
        assert moves == []  # it is read only if it decides
        assert held.broken(until, lambda moves_on=moves_on: moves_on) is None
        assert held.broken(until + 0.01, lambda moves_on=moves_on: moves_on) == (
            f"the page, the hold-to-run client, sent no confirmation for {until - 10.0:g} s"
        )


@pytest.mark.parametrize("begin", ["velocity", "torque"])
def test_hold_to_run_halts_an_axis_in_continuous_motion_0_3_s_after_the_last_call(cell, begin):
    x = cell["x"]
    handle = x.move_velocity(30.0) if begin == "velocity" else x.torque_control(0.02)
    cell.sleep(0.2)
    assert x.state is AxisState.CONTINUOUS_MOTION
    cell.hold_to_run(1.0, 0.3)
    cell.sleep(0.29)
    assert x.state is AxisState.CONTINUOUS_MOTION
    cell.sleep(0.25 if begin == "velocity" else 0.6)  # a torque goes down its slope
    assert x.state is AxisState.STANDSTILL
    assert handle.done or handle.error is not None


def test_a_move_that_ends_by_itself_is_not_halted_earlier(cell):
    cell["x"].move_relative(1000.0, velocity=30.0)
    cell.hold_to_run(1.0, 0.3)
    cell.sleep(0.9)
    assert cell["x"].velocity == pytest.approx(30.0, abs=0.5)
    cell.sleep(0.6)
    assert cell["x"].state is AxisState.STANDSTILL


def test_silence_halts_everything_and_leaves_it_enabled_and_free_to_move_on(cell):
    handles = [axis.move_relative(1000.0, velocity=30.0) for axis in cell]
    cell.hold_to_run(0.5)
    cell.sleep(0.45)
    cell.hold_to_run(0.5)
    cell.sleep(0.45)
    assert [axis.velocity for axis in cell] == pytest.approx([30.0, 30.0], abs=0.5)
    cell.sleep(0.5)
    assert [axis.state for axis in cell] == [AxisState.STANDSTILL] * 2
    for handle in handles:
        with pytest.raises(
            Stopped, match=r"halted: its program, the hold-to-run client, sent no confirmation for 0\.5 s"
        ):
            handle.wait(1)
    cell["x"].move_relative(5.0).wait(5)


def test_a_promise_that_is_taken_back_halts_nothing(cell):
    cell["x"].move_velocity(30.0)
    cell.hold_to_run(0.2)
    cell.hold_to_run(None)
    cell.sleep(1.0)
    assert cell["x"].velocity == pytest.approx(30.0, abs=0.5)


@pytest.mark.parametrize("seconds", [0.0, 0.01, -1.0, 61.0, math.nan, math.inf, "1", True])
def test_an_invalid_time_is_refused(cell, seconds):
    with pytest.raises(ArgumentError, match=r"hold_to_run\(.*not a time from 0\.05 to 60 s"):
        cell.hold_to_run(seconds)
