"""Joined programs that are killed, suspended or hostile disturb neither the cycle nor the program with control."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest

from axisbus.core.process import listener
from axisbus.core.process.listener import StopRequest
from axisbus.errors import OwnershipError, ScanError
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.acceptor_attacks import ATTACKS
from kit.connection_flood import Crowd
from kit.scenarios.core_process import OWN_PROCESS, mean_speed, own_cell, turns, under_way

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]
# seconds from a request until it is known to be done: half a second on a computer that is not busy
PROMPT = 2.0


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return own_cell(tmp_path_factory.mktemp("joined"))


@pytest.fixture(scope="module")
def opened(file):
    with Machine.open(file) as machine:
        yield machine


def test_control_of_a_program_that_dies_returns_to_its_previous_owner(machine, file):
    program = "import os, sys; from axisbus import Machine; guest = Machine.attach(sys.argv[1]); guest.take_control(); os._exit(0)"
    subprocess.run([sys.executable, "-c", program, str(file)], check=True)
    until = time.monotonic() + 20.0
    while not machine.has_control:
        assert time.monotonic() < until
        time.sleep(0.01)
    machine["x"].move_relative(1.0).wait(20)


def ended(handle):
    """A command that has ended, well or not."""
    until = time.monotonic() + 20.0
    while handle.busy:
        assert time.monotonic() < until
        time.sleep(0.01)
    return handle


def is_passing(handle):
    """Whether control of the machine is being returned, until the halt is known to have ended."""
    return isinstance(handle.error, OwnershipError) and "being handed over" in handle.error.observed


KILLED = """
import sys, time
from axisbus import Machine
from axisbus import TrapezoidalTrajectory
machine = Machine.attach(sys.argv[1], command=True, force=True)
y = machine["y"]
there = TrapezoidalTrajectory(y.position, y.position + 1000.0, 30.0, 300.0)
handle = y.follow(there) if sys.argv[2] == "follow" else y.move_velocity(30.0)
time.sleep(0.5)
print("moves", flush=True)
time.sleep(60)
"""


@pytest.mark.parametrize("way", ["follow", "velocity"])
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_client_that_ends_while_it_has_control_leaves_nothing_in_motion(machine, file, way, number):
    with subprocess.Popen(
        [sys.executable, "-c", KILLED, str(file), way],
        stdout=subprocess.PIPE,
        text=True,
        stderr=subprocess.DEVNULL,
    ) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "moves\n"
        assert mean_speed(machine, 2) == pytest.approx(30.0, abs=1.0)
        program.send_signal(number)
        program.wait(20)
    until = time.monotonic() + 10.0
    while abs(turns(machine, 2)) > 0.1 and time.monotonic() < until:
        time.sleep(0.01)
    assert turns(machine, 2) == pytest.approx(0.0, abs=0.1)
    while is_passing(handle := ended(machine["y"].enable())):
        assert time.monotonic() < until
        time.sleep(0.01)
    assert handle.error is None
    machine["y"].move_relative(-1.0).wait(20)


HELD = """
import sys, threading, time
from axisbus import Machine
machine = Machine.attach(sys.argv[1], command=True, force=True)
machine["y"].move_velocity(30.0)
for beat in range(1000):
    machine.hold_to_run(0.5)
    if beat == 10:
        print("moves", flush=True)
    time.sleep(0.05)
"""


def test_a_suspended_client_with_hold_to_run_halts_its_axes(machine, file):
    with subprocess.Popen(
        [sys.executable, "-c", HELD, str(file)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as program:
        assert program.stdout is not None
        try:
            assert program.stdout.readline() == "moves\n"
            time.sleep(1.0)
            assert turns(machine, 2) == pytest.approx(30.0, abs=1.0)
            program.send_signal(signal.SIGSTOP)
            must_be_still_within(machine, 5.0)
            assert not machine.has_control
        finally:
            program.kill()
    until = time.monotonic() + 20.0
    while not machine.has_control:
        assert time.monotonic() < until
        time.sleep(0.01)


def must_be_still_within(machine, seconds):
    """Axis y reaches standstill, enabled, within so many seconds."""
    until = time.monotonic() + seconds
    while abs(turns(machine, 2)) > 0.1 or machine["y"].state is not AxisState.STANDSTILL:
        assert time.monotonic() < until
        time.sleep(0.01)


def skipped_in_a_second(machine):
    """How many cycles are skipped from now on, in a second in which most of them are done."""
    start = machine.cycle_jitter
    time.sleep(1.0)
    end = machine.cycle_jitter
    assert end.cycles - start.cycles > 20
    return end.skipped - start.skipped


@pytest.mark.parametrize("attack", list(ATTACKS))
def test_hostile_clients_disturb_neither_the_cycle_nor_the_motion(machine, file, attack, caplog):
    handle = under_way(machine["x"])
    # A busy computer alone skips some, and not evenly; an attack that disturbs does it each time.
    for _ in range(3):
        before = skipped_in_a_second(machine)
        lines = ATTACKS[attack](file)
        meanwhile = skipped_in_a_second(machine)
        assert handle.active
        assert abs(turns(machine)) == pytest.approx(30.0, abs=1.0)
        for line in lines:
            line.close()
        if meanwhile <= 2 * before + 3:
            break
    assert meanwhile <= 2 * before + 3
    assert (
        "could not be taken" not in caplog.text
    )  # its program has done nothing that would be reported to it
    until = time.monotonic() + 10.0
    while True:  # the earlier clients are gone, and others may connect
        try:
            attached = Machine.attach(file)
            break
        except ScanError:
            assert time.monotonic() < until
            time.sleep(0.1)
    with attached:
        assert attached["x"].state is AxisState.DISCRETE_MOTION


CROWDS = {
    "silent": (b"", False),
    "half a request to stop": (b"s\xff", False),
    "wants to join": (b"a", False),
    "a flood of junk": (b"x" * 4096, True),
    "requests to stop another axis": (StopRequest(("y",)).pack(), True),
}


@pytest.mark.parametrize("crowd", list(CROWDS))
def test_a_thousand_hostile_connections_keep_no_stop_and_no_command_of_the_holder_waiting(
    machine, file, crowd
):
    handle = under_way(machine["x"])
    (found,) = listener.machines_of(str(file))
    said, flood = CROWDS[crowd]
    with Crowd(found.name, said, flood=flood):
        assert handle.active
        assert abs(turns(machine)) == pytest.approx(30.0, abs=1.0)
        for _ in range(2):
            began = time.monotonic()
            (stopped,) = listener.ask_to_stop(found, StopRequest(("x",), quick=False), 5.0).axes
            assert time.monotonic() - began < PROMPT
            assert stopped.ok
            began = time.monotonic()
            machine["x"].move_relative(-10.0 if machine["x"].position > 0 else 10.0, velocity=30.0).wait(10)
            assert time.monotonic() - began < PROMPT
