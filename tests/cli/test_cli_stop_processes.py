"""``axisbus stop`` and ``halt`` beside programs in other processes, of other users, and that hang."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from axisbus import SimulationControl
from axisbus.bus.link import ownership
from axisbus.bus.link.claims import CellFileId, claim
from axisbus.cell import reader
from axisbus.errors import ScanError
from axisbus.machine.machine import Machine
from kit import command_line
from kit.cell import cell_file
from kit.other_user import STRANGER, as_user, needs_root
from kit.scenarios.core_process import OWN_PROCESS, own_cell, turns

pytestmark = [OWN_PROCESS, pytest.mark.timeout(180)]
RUNS = "import sys, time; from axisbus import Machine; m = Machine.open(sys.argv[1]); print('runs', flush=True); time.sleep(100)"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return own_cell(tmp_path_factory.mktemp("found"))


@pytest.fixture(scope="module")
def opened(file):
    with Machine.open(file) as machine:
        yield machine


def run_elsewhere(file, **environment):
    """A machine of another program; its environment has ``environment``."""
    process = subprocess.Popen(
        [sys.executable, "-c", RUNS, str(file)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, **environment},
    )
    assert process.stdout.readline() == "runs\n"
    return process


def end(process):
    process.send_signal(signal.SIGTERM)
    process.wait(30)
    process.stdout.close()


def test_a_machine_with_its_core_in_its_program_is_found_and_reported_as_not_reached(axisbus, tmp_path):
    path = cell_file(tmp_path, "x")
    process = run_elsewhere(path, AXISBUS_PROCESS="thread")
    try:
        code, out, err = axisbus("stop", path)
        assert code == 3
        assert f"x: NOT REACHED in the machine that process {process.pid} " in out
        assert "no other program can join" in err
        code, _, err = axisbus("halt", path)
        assert code == 1
        assert f"process {process.pid} " in err
        code, _, err = axisbus("od", "read", "x:6041", "--cell", path)
        assert code == 1
        assert "this command cannot join it" in err
    finally:
        end(process)
    assert "no machine of this cell was found" in axisbus("stop", path).out


def processes_of(core):
    """The core's process and its watchdog process."""
    watchdog = int(re.search(r"PPid:\s+(\d+)", Path(f"/proc/{core}/status").read_text())[1])
    return [watchdog, core]


def test_a_machine_that_hangs_is_reported_as_not_reached(axisbus, tmp_path):
    file = own_cell(tmp_path, "x")
    machine = Machine.open(file)
    stopped = processes_of(machine._core.process)
    try:
        for process in stopped:
            os.kill(process, signal.SIGSTOP)
        code, out, err = axisbus("stop", file)
        assert code == 3
        assert "x: NOT REACHED" in out
        assert "it does not answer" in err
    finally:
        for process in reversed(stopped):
            os.kill(process, signal.SIGCONT)
        with suppress(ScanError):  # its scan has missed its cycles
            machine.close()


@needs_root
def test_a_machine_of_another_user_is_named_and_not_reported_as_stopped(axisbus, tmp_path):
    file = own_cell(tmp_path, "x")
    with as_user(lambda: claim(None, CellFileId.of(file), exclusive=False, accepts_clients=True)) as stranger:
        code, out, err = axisbus("stop", file)
        assert code == 3
        assert "x: NOT REACHED" in out
        assert f"process {stranger} " in err
        assert f"of user {STRANGER}" in err
        code, _, err = axisbus("halt", file)
        assert code == 1
        assert f"of user {STRANGER}" in err


@needs_root
def test_the_claim_of_another_user_does_not_hide_ones_own_machine(axisbus, moving, file):
    machine, _ = moving
    with as_user(lambda: claim(None, CellFileId.of(file), exclusive=False, accepts_clients=True)):
        code, out, _ = axisbus("stop", file)
    assert (code, "x: is at standstill" in out) == (0, True)
    assert turns(machine) == pytest.approx(0.0, abs=0.1)


@pytest.fixture
def bus(tmp_path):
    """The cell file of simulated drives in a process of their own, and their plant."""
    cell = cell_file(tmp_path, "xy", period="20ms", heartbeat="1s")
    mine, control = tmp_path / "mine.toml", tmp_path / "c"
    with command_line.simulating(cell, "-o", mine, "--control", control) as sim:
        command_line.lines_before(sim, "or take")
        with SimulationControl(control) as plant:
            yield mine, plant


GOES = """
import sys, time
from axisbus import Machine
machine = Machine.open(sys.argv[1])
machine["x"].enable().wait(20)
machine["x"].move_velocity(30.0).wait(20)
print(machine._core.process if sys.argv[2] == "own" else 0, flush=True)
time.sleep(100)
"""


def going(file, mode):
    """A program whose machine turns x, and its core's process; ``mode``: the location of the core."""
    process = subprocess.Popen(
        [sys.executable, "-c", GOES, str(file), mode],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "AXISBUS_PROCESS": mode},
    )
    return process, int(process.stdout.readline())


def test_stop_from_the_command_line_stops_a_machine_on_a_bus_and_leaves_its_nodes_up(axisbus, bus):
    file, plant = bus
    process, _ = going(file, "own")
    try:
        assert abs(turns(plant)) == pytest.approx(30.0, abs=1.0)
        code, out, err = axisbus("stop", file)
        assert code == 0, err
        assert turns(plant) == pytest.approx(0.0, abs=0.1)
        assert out == "x: is at standstill, Disabled\ny: is at standstill, Disabled\n"
    finally:
        end(process)


@pytest.mark.parametrize("way", ["in its program", "a copy of the cell file", "it hangs"])
def test_if_the_machine_is_not_reached_its_drives_are_stopped_over_the_bus(axisbus, bus, tmp_path, way):
    file, plant = bus
    asked = file
    if way == "a copy of the cell file":
        asked = tmp_path / "copy.toml"
        asked.write_text(file.read_text())
    process, core = going(file, "thread" if way == "in its program" else "own")
    stopped = processes_of(core) if way == "it hangs" else []
    try:
        for each in stopped:
            os.kill(each, signal.SIGSTOP)
        assert abs(turns(plant)) == pytest.approx(30.0, abs=1.0)
        code, out, err = axisbus("stop", asked)
        assert turns(plant) == pytest.approx(0.0, abs=0.1)
        assert code == 0, (out, err)
        assert re.search(r"x: (stopped, power is off|is at standstill, held|was not energised)", out)
        assert f"process {process.pid} " in err or way == "a copy of the cell file"
        assert ("it can boot its nodes and move its axes again" in err) is (way != "a copy of the cell file")
        assert "next: bring the nodes up again" in out
    finally:
        process.kill()
        for each in reversed(stopped):
            os.kill(each, signal.SIGCONT)
        process.wait(30)
        process.stdout.close()
    until = time.monotonic() + 30
    while ownership.holder("socketcand", reader.load(file).bus.channel) is not None:
        assert time.monotonic() < until
        time.sleep(0.1)
    assert turns(plant) == pytest.approx(0.0, abs=0.1)
