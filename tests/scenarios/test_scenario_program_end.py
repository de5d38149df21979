"""Odd ends of a program: from a callback, from two threads, by several machines, with forked children, during a fault."""

from __future__ import annotations

import itertools
import signal
import sys
import threading
import time
from contextlib import suppress

import pytest

from axisbus.cia301.nmt import NmtState
from axisbus.errors import (
    AdapterError,
    AxisbusError,
    DriveError,
    DriveFault,
    ScanError,
    StaleError,
    StateError,
)
from axisbus.machine.machine import Machine
from kit.plant_probe import FAULT, SWITCH_ON_DISABLED
from kit.scenarios.simulated_bus import STOP, Line, enable, turning, until

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="signals and forks are those of POSIX")


def ours() -> list[str]:
    """The threads of axisbus that run."""
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("axisbus ")]


def let_go(line: Line, name: str) -> None:
    """Make sure that a node was released."""
    assert line.devices[name].read(0x1016, 1) == 0
    assert line.devices[name].nmt is NmtState.PRE_OPERATIONAL


# -- from a callback --------------------------------------------------------------------------------------------------------


def test_close_in_a_callback_begins_the_stop_and_the_block_waits_for_it(tmp_path):
    """It runs in the scan's thread, which has to stop the axes."""
    took = []

    def close(machine: Machine) -> None:
        began = time.monotonic()
        machine.close()
        took.append(time.monotonic() - began)

    with Line(tmp_path, "xy") as line:
        with line.open() as machine:
            turning(machine, line)
            end = machine["y"].halt()
            end.add_done_callback(lambda: close(machine))
            line.must_be_still("x", stages=SWITCH_ON_DISABLED)
        for name in "xy":
            line.must_be_still(name, stages=SWITCH_ON_DISABLED, within=0.1)
            let_go(line, name)
            assert not line.devices[name].errors.entries
    assert took[0] < 0.2
    assert ours() == []


def test_a_block_that_ends_just_after_a_close_in_a_callback_waits_for_standstill(tmp_path):
    with Line(tmp_path) as line:
        with line.open() as machine:
            turning(machine, line)
            closed = threading.Event()

            def observe(*_: object) -> None:
                machine.close()
                closed.set()

            machine._core.scan.observers.append(observe)
            assert closed.wait(STOP)
        line.must_be_still(stages=SWITCH_ON_DISABLED, within=0.0)
        let_go(line, "x")


@pytest.mark.nets("the stop sequence")
def test_close_in_a_callback_in_virtual_time(scenario):
    cell = scenario.simulated("xy")
    cell.turning()
    end = cell["y"].halt()
    end.add_done_callback(cell.machine.close)
    cell.run(3.0)
    for name in "xy":
        cell.must_be_still(name, within=0.01, stages=SWITCH_ON_DISABLED)
    assert not cell.scan_runs
    assert cell.device("x").nmt is NmtState.PRE_OPERATIONAL
    cell.machine.close()


def test_the_error_of_a_close_in_a_callback_is_raised_by_the_next_close(scenario):
    cell = scenario.simulated("x", stop='halt_time = "300ms"')
    cell.travelling()
    cell.drive().dials.ignore_halt = True
    cell.each_cycle(lambda *_: cell.machine.close())
    cell.run(3.0)
    cell.must_be_still(within=0.01, stages=SWITCH_ON_DISABLED)
    with pytest.raises(DriveError, match="harder stop"):
        cell.machine.close()
    cell.machine.close()  # raised once


# -- from two threads -------------------------------------------------------------------------------------------------------


def test_the_end_of_the_block_waits_for_the_close_of_another_thread(tmp_path):
    with Line(tmp_path) as line:
        with line.open() as machine:
            turning(machine, line, 300.0)
            closer = threading.Thread(target=machine.close)
            closer.start()
            time.sleep(0.02)
        line.must_be_still(stages=SWITCH_ON_DISABLED, within=0.0)
        let_go(line, "x")
        closer.join(STOP)


def test_all_threads_that_close_at_once_get_the_same_error(tmp_path):
    with Line(tmp_path, stop='halt_time = "300ms"') as line:
        machine = line.open()
        enable(machine["x"])
        machine["x"].move_relative(1e5, velocity=90.0)
        until(lambda: line.speed() > 80.0)
        line.drive().dials.ignore_halt = True
        told: list[AxisbusError | None] = []

        def close() -> None:
            try:
                machine.close()
            except AxisbusError as error:
                told.append(error)
            else:
                told.append(None)
            line.must_be(SWITCH_ON_DISABLED)

        closers = [threading.Thread(target=close) for _ in range(5)]
        for closer in closers:
            closer.start()
        for closer in closers:
            closer.join(STOP)
        assert len(told) == 5
        assert all(error is told[0] for error in told)
        assert isinstance(told[0], DriveError)


@POSIX
def test_a_handler_of_the_users_own_cannot_break_the_stop_off(scenario):
    cell = scenario.simulated("x")
    cell.turning()

    def raises(*_: object) -> None:
        raise ZeroDivisionError

    before = signal.signal(signal.SIGUSR1, raises)
    run_cycle, cycles = cell.machine._core._virtual_waiter.run_cycle, itertools.count(1)

    def pumped() -> None:
        run_cycle()
        if next(cycles) == 3:
            signal.raise_signal(signal.SIGUSR1)

    cell.machine._core._virtual_waiter.run_cycle = pumped
    try:
        with pytest.raises(ZeroDivisionError):
            cell.machine.close()
    finally:
        signal.signal(signal.SIGUSR1, before)
    cell.must_be_still(within=0.01, stages=SWITCH_ON_DISABLED)


# -- during a fault -----------------------------------------------------------------------------------------------------------


def fault_while_closing(cell, code: int = 0x7305) -> None:
    """Let the drive of x go into fault in the third cycle of closing."""
    count = []

    def observe(*_: object) -> None:
        if cell.machine._closing.begun:
            count.append(1)
            if len(count) == 3:
                cell.drive().fault(code)

    cell.each_cycle(observe)


def test_a_fault_at_speed_while_closing_is_awaited(scenario):
    cell = scenario.simulated("x")
    cell.turning(360.0)
    fault_while_closing(cell)
    with pytest.raises(DriveFault) as caught:
        cell.machine.close()
    cell.must_be_still(within=0.0, stages=FAULT)
    assert "TREAT" not in caught.value.remedy


@pytest.mark.parametrize("cycles", [0, 1, 5, 20])
def test_closing_during_a_fault_reaction_waits_for_its_end(scenario, cycles):
    cell = scenario.simulated("x")
    cell.turning(360.0)
    cell.drive().fault(0x7305)
    cell.run(0.01 * cycles)
    cell.must_move()
    with suppress(DriveFault):  # raised by the command that it ended, or by closing
        cell.machine.close()
    cell.must_be_still(within=0.0, stages=FAULT)


COASTS = 'fault = "coast"'


def test_a_drive_that_coasts_in_fault_while_closing_is_awaited(scenario):
    """It is off, and turns: off is not stopped."""
    cell = scenario.simulated("x", stop=COASTS)
    cell.turning(360.0)
    fault_while_closing(cell)
    with pytest.raises(DriveFault):
        cell.machine.close()
    cell.must_be_still(within=0.0, stages=FAULT)


def test_a_drive_that_coasts_for_longer_than_its_stop_sequence_is_reported_as_moving(scenario, golden):
    times = 'halt_time = "100ms"\nquick_stop_time = "100ms"\ndisable_time = "100ms"\n'
    cell = scenario.simulated("x", stop=times + COASTS)
    cell.turning(360.0)
    fault_while_closing(cell)
    with pytest.raises(DriveError) as caught:
        cell.machine.close()
    cell.must_move()
    golden("coasts_while_closing", caught.value)


def test_a_drive_that_still_brakes_in_its_fault_reaction_is_reported_as_moving(scenario):
    times = 'halt_time = "100ms"\nquick_stop_time = "100ms"\ndisable_time = "100ms"\n'
    cell = scenario.simulated("x", stop=times, more="")
    cell.turning(360.0)
    cell.device().write(0x6085, 0, 2_000)  # 20 deg/s²
    fault_while_closing(cell)
    with pytest.raises(DriveError) as caught:
        cell.machine.close()
    cell.must_move()
    assert caught.value.remedy.startswith("TREAT THE AXIS AS MOVING")
    assert "went into fault" in caught.value.observed


# -- commands that wait when the signal comes ---------------------------------------------------------------------------


@POSIX
def test_an_enable_that_waits_during_ctrl_c_is_refused(scenario):
    cell = scenario.simulated("xy")
    cell["x"].enable().wait(3)
    moment = cell.moment("y")
    with pytest.raises(KeyboardInterrupt):
        handle = cell["y"].enable()
        signal.raise_signal(signal.SIGINT)
    cell.run(2.0)
    later = cell["x"].enable()
    cell.run(2.0)
    assert not cell.was_energised("y", since=moment)
    cell.must_be(SWITCH_ON_DISABLED, "x")
    assert isinstance(handle.exception(), StateError)
    assert isinstance(later.exception(), StateError)
    assert "Ctrl-C" in handle.exception().observed


# -- several machines, and forked children ---------------------------------------------------------------------------


# -- after the scan's death -------------------------------------------------------------------------------------------------


def test_after_the_death_of_the_scan_every_value_of_an_axis_raises_an_error(scenario, golden):
    cell = scenario.simulated("x")
    cell.turning()
    x = cell.x
    cell.faults.commit = AdapterError("the CAN adapter can0 failed while sending")
    cell.run(0.05)
    for look in (lambda: x.state, lambda: x.homed, lambda: x.position, lambda: x.velocity):
        with pytest.raises(StaleError, match="is unknown"):
            look()
    assert isinstance(x.error, StaleError)
    assert "unknown" in repr(x)
    golden("state_after_the_scan_died", x.error)
    with pytest.raises(ScanError):
        cell.machine.close()


def test_after_a_good_close_an_axis_shows_how_it_was_left(scenario):
    cell = scenario.simulated("x")
    cell.turning()
    cell.machine.close()
    cell.must_be_still(within=0.0, stages=SWITCH_ON_DISABLED)
    assert cell.x.state.value == "Disabled"
    assert cell.x.error is None
    with pytest.raises(StaleError, match="closed"):
        _ = cell.x.position
