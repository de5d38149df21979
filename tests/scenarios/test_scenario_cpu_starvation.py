"""This program is given no time, by its own threads or by the computer: that is named before a drive, a cable or an adapter is."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from axisbus.core.realtime_setup import IN_A_THREAD
from axisbus.core.scan_thread import BlockedLocation, locate_thread
from axisbus.cpu_starvation import DRIVES, REMEDY
from axisbus.errors import AxisbusError, NodeError, StaleError
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.cell import cell_file
from kit.plant_probe import ENABLED, OFF
from kit.repeating_thread import again
from kit.scenarios.simulated_bus import Line, turning, until

OWN = "this program did not run"
REAL = pytest.mark.skipif(sys.platform == "win32", reason="holds the interpreter by a call of the C library")


def hold_interpreter(seconds: float) -> None:
    """Keep every other thread from running, as one long call of json or pickle does."""
    ctypes.PyDLL(None).usleep(int(seconds * 1e6))


def greedy(hold: float, leave: float = 0.001) -> AbstractContextManager[None]:
    """A thread of the user's that holds the interpreter again and again."""
    return again(lambda: hold_interpreter(hold), leave)


def must_name_us_first(error: BaseException | None) -> None:
    """Make sure that an error names this program before it names the checks, an alarm excepted."""
    assert isinstance(error, AxisbusError)
    assert OWN in str(error), error
    lines = [line for line in error.remedy.splitlines() if not line.startswith("TREAT ")]
    assert lines[0].strip().startswith(REMEDY[:30]), error


# -- in virtual time ----------------------------------------------------------------------------------------------------------


def late(cell, times: int = 3, seconds: float = 0.15) -> None:
    """Let the scan be late several times: each delay is shorter than a suspension."""
    for _ in range(times):
        cell.faults.send_blocks = seconds
        cell.run(0.2)


def test_a_heartbeat_missed_by_a_starved_program_is_not_blamed_on_the_node(scenario, golden):
    cell = scenario.simulated("x")
    cell.turning()
    late(cell)
    assert cell.x.state is AxisState.CONTINUOUS_MOTION
    cell.device().dials.heartbeat_stops = True
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP)
    must_name_us_first(cell.x.error)
    assert isinstance(cell.x.error, NodeError)
    golden("starved_heartbeat", cell.x.error)
    cell.must_be_still(within=2.0, stages=(ENABLED, *OFF))


def test_process_data_missed_by_a_starved_program_are_not_blamed_on_the_node(scenario, golden):
    cell = scenario.simulated("x")
    cell.turning()
    late(cell)
    cell.device().dials.dead = True
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP)
    must_name_us_first(cell.x.error)
    assert isinstance(cell.x.error, StaleError)
    golden("starved_silence", cell.x.error)
    cell.must_be_still(within=3.0, stages=OFF)


@pytest.mark.parametrize("code", [0x8130, 0x8250, 0x8700])  # our heartbeat, an RPDO's deadline, SYNC
def test_a_drive_fault_for_missing_frames_names_the_starved_program_first(scenario, code):
    cell = scenario.simulated("x")
    cell.turning()
    late(cell)
    cell.drive().fault(code)
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP)
    must_name_us_first(cell.x.error)


def test_a_drives_own_fault_is_not_blamed_on_a_starved_program(scenario):
    cell = scenario.simulated("x")
    cell.turning()
    late(cell)
    cell.drive().fault(0x2310)
    cell.run(1.0)
    assert OWN not in str(cell.x.error)


def test_starvation_of_long_ago_is_not_named(scenario):
    cell = scenario.simulated("x")
    cell.turning()
    late(cell)
    cell.run(2.5)
    cell.device().dials.heartbeat_stops = True
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP)
    assert OWN not in str(cell.x.error)


# -- in real time -------------------------------------------------------------------------------------------------------------


@REAL
@pytest.mark.parametrize("hold", [0.8, 0.2], ids=["long calls", "short ones"])
def test_a_thread_that_holds_the_interpreter_is_named_and_no_hardware(tmp_path, hold):
    """Drives, simulated bus and master share the interpreter here: all of them are delayed. Calls of 0.15 s are often survived."""
    with Line(tmp_path, "xy", period="10ms", heartbeat="100ms") as line:
        machine = line.open()
        try:
            turning(machine, line)
            with greedy(hold):
                until(lambda: any(axis.error is not None for axis in machine), 40.0)
            for axis in machine:
                if axis.error is not None:
                    assert OWN in str(axis.error), axis.error
            failure = machine._core.scan.failure
            assert failure is None or OWN in str(failure), failure
            for name in "xy":
                line.must_be_still(name, stages=(ENABLED, *OFF))
        finally:
            machine._close("the scenario ends")


@REAL
def test_a_send_that_is_not_given_time_is_no_adapter_that_is_stuck(tmp_path):
    """Another thread gives a frame to the adapter, and gets no processor time before it returns; the scan waits for its turn."""
    with Line(tmp_path, heartbeat="1s") as line:
        machine = line.open()
        try:
            turning(machine, line)
            channel = machine._core.scan.cycle._channel
            send, once = channel.bus.send, threading.Event()

            def slow(message: object, timeout: float | None = None) -> None:
                if threading.current_thread().name.startswith("axisbus SDO") and not once.is_set():
                    once.set()
                    for _ in range(12):
                        hold_interpreter(0.15)
                        time.sleep(0.01)  # the scan takes its turn, and finds the channel taken
                send(message, timeout)

            channel.bus.send = slow
            machine["x"].move_relative(1e5, velocity=90.0)
            until(once.is_set)
            time.sleep(1.0)
            assert machine._core.scan.failure is None, machine._core.scan.failure
            assert channel.failure is None
            error = machine["x"].error
            assert error is None or OWN in str(error), error
        finally:
            machine._close("the scenario ends")


@REAL
def test_a_callback_that_holds_the_scan_up_is_named_and_no_adapter(tmp_path):
    with Line(tmp_path) as line:
        machine = line.open()
        free = threading.Event()
        try:
            turning(machine, line)
            handle = machine["x"].move_relative(1e5, velocity=90.0)
            until(lambda: handle.active)
            machine._core.scan.observers.append(lambda *_: free.wait())
            line.must_be_still(stages=OFF)
            error = handle.exception()
            assert "blocked by code of the program" in error.observed
            assert "test_scenario_cpu_starvation.py" in error.observed
            assert "adapter" not in error.remedy
        finally:
            free.set()
            machine._close("the scenario ends")


@contextmanager
def frozen_drives(machine: Machine) -> Iterator[None]:
    """Give the simulated drives no time, in this process or in their own."""
    if machine.real_time_status == IN_A_THREAD:
        with machine.simulated_node(1).lock:
            yield
        return
    core = machine._core
    watchdog = core._process._watchdog.pid
    children = Path(f"/proc/{watchdog}/task/{watchdog}/children").read_text().split()
    (drives,) = {int(number) for number in children} - {core.process}
    os.kill(drives, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(drives, signal.SIGCONT)


@REAL
@pytest.mark.parametrize(
    "process",
    [
        "thread",
        pytest.param("own", marks=pytest.mark.skipif(sys.platform != "linux", reason="only Linux has it")),
    ],
)
def test_simulated_drives_that_are_given_no_time_are_named_and_no_node_is_called_lost(tmp_path, process):
    file = cell_file(tmp_path, "x", heartbeat="1s", bus=f'process = "{process}"')
    with Machine.open(file) as machine:
        x = machine["x"]
        x.enable().wait(10)
        handle = x.move_velocity(30.0)
        until(lambda: x.state is AxisState.CONTINUOUS_MOTION)
        with frozen_drives(machine):
            until(lambda: x.error is not None and not handle.busy)
        assert x.error.message.startswith(f"x: {DRIVES} did not run for 0."), x.error
        assert x.error.remedy.startswith(REMEDY)


def test_the_location_of_a_thread_is_found():
    free = threading.Event()
    thread = threading.Thread(target=free.wait)
    thread.start()
    try:
        place = locate_thread(thread.ident)
        assert place is not None
        assert place.location is BlockedLocation.AXISBUS  # nothing of the program's own is on its stack
        assert locate_thread(None) is None
    finally:
        free.set()
        thread.join()
    assert locate_thread(thread.ident) is None
