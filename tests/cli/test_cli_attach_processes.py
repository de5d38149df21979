"""Commands in processes of their own that join a machine, and are interrupted, suspended or ended; and the frames that they see."""

from __future__ import annotations

import itertools
import json
import os
import re
import signal
import time

import pytest

from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit import command_line
from kit.scenarios.core_process import OWN_PROCESS, own_cell, turns

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return own_cell(tmp_path_factory.mktemp("joined"), axis="rated_torque = 10.0\nmax_torque = 5.0")


@pytest.fixture(scope="module")
def opened(file):
    with Machine.open(file) as machine:
        yield machine


def test_a_machine_of_axisbus_run_leaves_control_to_any_client(axisbus, tmp_path):
    path = own_cell(tmp_path, "x")
    with command_line.started("run", path, "--every", "0.2", stderr=None) as running:
        assert running.stdout.readline().startswith("the machine runs")
        assert axisbus("enable", path).code == 0
        with Machine.attach(path) as looking:
            assert looking["x"].state is AxisState.STANDSTILL
            assert axisbus("disable", path).out == "x: Disabled\n"
        running.terminate()
        running.wait(20)
    assert Machine.try_attach(path) is None


def test_a_command_that_is_interrupted_leaves_the_axes_as_it_found_them(axisbus, tmp_path):
    path = own_cell(tmp_path, "xy")
    with command_line.started("run", path, stderr=None) as running:
        assert running.stdout.readline().startswith("the machine runs")
        assert axisbus("enable", path, "y").code == 0
        turning = command_line.started("velocity", path, "x=30", "y=30")
        command_line.lines_before(turning, "y: has")
        turning.send_signal(signal.SIGINT)
        _, err = turning.communicate(timeout=30)
        assert turning.returncode == 130
        assert "disabled again: x\n" in err
        with Machine.attach(path) as looking:
            assert looking["x"].state is AxisState.DISABLED
            assert looking["y"].state is AxisState.STANDSTILL
            assert looking.control_owner == ""
        running.send_signal(signal.SIGINT)


def test_a_command_that_took_control_names_the_axes_that_it_leaves_enabled(opened, file):
    opened["y"].disable().wait(10)
    turning = command_line.started("velocity", file, "y=30", "--take")
    command_line.lines_before(turning, "y: has")
    turning.send_signal(signal.SIGINT)
    _, err = turning.communicate(timeout=30)
    assert re.search(rf"left enabled: y; process {os.getpid()} .* has control", err)
    assert opened["y"].state is AxisState.STANDSTILL
    opened["y"].disable().wait(10)


def test_an_axis_set_in_motion_by_a_suspended_command_halts(opened, file):
    """Ctrl-Z: nothing would monitor it, and Ctrl-C reaches the command no more."""
    opened["y"].disable().wait(10)
    turning = command_line.started("velocity", file, "y=30", "--take")
    try:
        command_line.lines_before(turning, "y: has")
        assert abs(turns(opened, 2)) > 25.0
        turning.send_signal(signal.SIGSTOP)
        until = time.monotonic() + 5.0
        while opened["y"].state is not AxisState.STANDSTILL:
            assert time.monotonic() < until, opened["y"]
            time.sleep(0.02)
        assert turns(opened, 2) == pytest.approx(0.0, abs=0.05)
    finally:
        turning.send_signal(signal.SIGCONT)
        turning.send_signal(signal.SIGINT)
        turning.communicate(timeout=30)
    opened["y"].disable().wait(10)


def test_the_frames_of_a_machine_that_runs_are_shown_in_both_directions(axisbus, moving, file):
    code, out, err = axisbus("trace", str(file), "--count", "200", "--json")
    assert code == 0, err
    assert "joined the running machine" in err
    frames = [json.loads(line) for line in out.splitlines()]
    assert {"SYNC", "RPDO", "TPDO"} <= {frame["kind"] for frame in frames}
    times = [frame["time"] for frame in frames]
    assert times == sorted(times) or max(b - a for a, b in itertools.pairwise(times)) < 0.5
    code, out, err = axisbus("load", str(file), "--seconds", "0.5", "-b", "1000000", "--json")
    assert code == 0, err
    assert json.loads(out)["measured"]["frames"] > 100
    assert moving[1].active
    assert abs(turns(moving[0])) == pytest.approx(30.0, abs=1.0)
