"""Where a program is given in cells: whose handler has an interrupt, when it is raised, and that it is given back."""

from __future__ import annotations

import signal
import sys
import threading
import time
import types

import pytest

from axisbus import AxisState, Machine
from axisbus.errors import Stopped
from axisbus.interrupt_guard import postpone, sheltered
from axisbus.machine import signal_shutdown as exit_signals
from axisbus.machine.notebook_interrupts import Interrupt, interactive
from axisbus.machine.signal_shutdown import EXIT
from kit.pages import ROOT

CELL = ROOT / "examples" / "cell.toml"


class Events:
    """IPython's events."""

    def __init__(self):
        self.is_running = []

    def register(self, event, call):
        assert event == "pre_execute"
        self.is_running.append(call)

    def unregister(self, event, call):
        self.is_running.remove(call)


class Shell:
    """IPython with its kernel, as far as it concerns us: it takes the signal for each cell, and ignores it in between."""

    def __init__(self):
        self.events = Events()
        self.kernel = types.SimpleNamespace(saved_sigint_handler=signal.SIG_IGN)

    def cell(self, code, handler=signal.default_int_handler):
        self.kernel.saved_sigint_handler = signal.signal(signal.SIGINT, handler)
        for call in list(self.events.is_running):
            call()
        try:
            return code()
        finally:
            signal.signal(signal.SIGINT, self.kernel.saved_sigint_handler)


@pytest.fixture
def shell(monkeypatch):
    made = Shell()
    fake = types.ModuleType("IPython")
    fake.get_ipython = lambda: made
    monkeypatch.setitem(sys.modules, "IPython", fake)
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield made
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    assert made.events.is_running == []
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def cell(shell):
    machine = shell.cell(lambda: Machine.simulated(CELL))
    machine["x"].enable().wait()
    machine["x"].home().wait()
    yield machine
    shell.cell(machine.close)


def interrupt():
    signal.raise_signal(signal.SIGINT)


def moved_on(cell, shell):
    """Whether the axis is at standstill after its halt, the scan lives, and the next cell moves."""
    cell.sleep(1.0)
    assert cell["x"].state is AxisState.STANDSTILL
    shell.cell(lambda: cell["x"].move_absolute(5.0).wait())
    return not cell.session.failed


def test_a_cell_is_ended_and_the_machine_stays_open(cell, shell):
    def code():
        move = cell["x"].move_absolute(90.0)
        cell.sleep(0.3)
        try:
            interrupt()
        except KeyboardInterrupt:
            return move
        return None

    move = shell.cell(code)
    cell.sleep(0.5)
    assert isinstance(move.error, Stopped)
    assert "interrupted" in str(move.error)
    assert moved_on(cell, shell)


def test_an_interrupt_between_two_cells_raises_nothing_and_halts_moving_axes(cell, shell):
    shell.cell(lambda: cell["x"].move_velocity(20.0).wait())
    assert isinstance(signal.getsignal(signal.SIGINT), Interrupt)
    interrupt()
    assert moved_on(cell, shell)


def test_a_cell_that_awaits_is_cancelled_by_the_event_loop_that_runs_it(cell, shell):
    cancelled = []

    def code():
        cell["x"].move_absolute(90.0)
        interrupt()

    shell.cell(code, lambda *_: cancelled.append(True))
    assert cancelled == [True]
    assert moved_on(cell, shell)


def test_an_interrupt_during_a_cycle_is_raised_after_it(cell, shell):
    whole = []

    def look(now, snapshots):
        if snapshots["x"].velocity:
            interrupt()
            whole.append(now)

    cell.session.observe(look)
    with pytest.raises(KeyboardInterrupt):
        shell.cell(lambda: cell["x"].move_absolute(90.0).wait())
    cell.session.forget(look)
    assert len(whole) == 1
    assert moved_on(cell, shell)


def test_an_interrupt_while_a_command_is_given_is_raised_after_that(cell, shell, monkeypatch):
    submit, given = cell.session.submit, []

    def submitted(*command):
        interrupt()
        given.append(submit(*command))
        return given[-1]

    monkeypatch.setattr(cell.session, "submit", submitted)
    with pytest.raises(KeyboardInterrupt):
        shell.cell(lambda: cell["x"].move_absolute(90.0))
    monkeypatch.undo()
    assert len(given) == 1
    assert moved_on(cell, shell)
    assert cell["x"].position == pytest.approx(5.0, abs=0.1)


def test_an_interrupt_during_close_waits_until_all_axes_are_at_standstill(shell):
    machine = shell.cell(lambda: Machine.simulated(CELL))
    x = machine["x"]
    x.enable().wait()
    x.move_velocity(90.0).wait()

    def look(now, snapshots):
        if machine.session.leaving_because is not None and snapshots["x"].velocity:
            machine.session.forget(look)
            interrupt()

    machine.session.observe(look)
    with pytest.raises(KeyboardInterrupt):
        shell.cell(machine.close)
    assert machine.session.ended
    assert x.snapshot.state is AxisState.DISABLED
    assert machine.session.left[1] == "the machine was closed"


def test_a_with_block_in_a_cell_is_left_by_it(shell):
    def code():
        with Machine.simulated(CELL) as machine:
            machine["x"].enable().wait()
            machine["x"].move_velocity(90.0).wait()
            left.append(machine)
            interrupt()

    left = []
    with pytest.raises(KeyboardInterrupt):
        shell.cell(code)
    assert left[0]["x"].snapshot.state is AxisState.DISABLED


@pytest.mark.parametrize(("seconds", "quick"), [(0.0, True), (3.0, False)])
def test_a_second_interrupt_while_a_machine_is_being_closed_is_a_quick_stop(
    shell, monkeypatch, seconds, quick
):
    machine = shell.cell(lambda: Machine.simulated(CELL))
    now, asked = time.monotonic(), []
    machine["x"].enable().wait()
    with pytest.raises(KeyboardInterrupt):
        shell.cell(interrupt)
    monkeypatch.setattr(exit_signals.time, "monotonic", lambda: now + seconds)
    request_stop = machine.session.request_stop

    def requested(reason, quick=False):
        asked.append(quick)
        request_stop(reason, quick)

    machine.session.request_stop("the way out")
    monkeypatch.setattr(machine.session, "request_stop", requested)
    with pytest.raises(KeyboardInterrupt):
        shell.cell(interrupt)
    assert asked == [quick]
    monkeypatch.undo()
    shell.cell(machine.close)


def test_a_machine_opened_in_another_thread_is_interrupted_from_the_next_cell_on(shell):
    made = []
    thread = threading.Thread(target=lambda: made.append(Machine.simulated(CELL)))
    thread.start()
    thread.join()
    (machine,) = made
    machine["x"].enable().wait()
    machine["x"].move_velocity(20.0).wait()
    with pytest.raises(KeyboardInterrupt):
        shell.cell(interrupt)
    machine.sleep(1.0)
    assert machine["x"].state is AxisState.STANDSTILL
    shell.cell(machine.close)


def test_the_signal_is_given_back_with_the_last_machine_only(shell):
    first, second = (shell.cell(lambda: Machine.simulated(CELL)) for _ in range(2))
    shell.cell(first.close)
    assert isinstance(signal.getsignal(signal.SIGINT), Interrupt)
    shell.cell(second.close)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_outside_ipython_ctrl_c_ends_the_program():
    def program():
        with Machine.simulated(CELL) as machine:
            left.append(machine)
            assert not EXIT.in_cells
            machine["x"].enable().wait()
            machine["x"].move_velocity(90.0).wait()
            interrupt()

    left = []
    with pytest.raises(KeyboardInterrupt):
        program()
    assert left[0].session.left[1] == "Ctrl-C"
    assert left[0]["x"].snapshot.state is AxisState.DISABLED


def test_a_program_is_interactive_at_a_prompt_of_python_or_in_ipython(shell, monkeypatch):
    assert interactive()
    monkeypatch.delitem(sys.modules, "IPython")
    assert not interactive()
    monkeypatch.setattr(sys, "ps1", ">>> ", raising=False)
    assert interactive()


# -- shelters -----------------------------------------------------------------------------------------------------------


def test_a_postponed_signal_is_handled_once_after_the_outermost_block():
    done = []

    @sheltered
    def inner():
        assert postpone(sys._getframe(), lambda: done.append("done"))
        return "inner"

    @sheltered
    def outer():
        found = inner()
        assert done == []
        return found

    assert outer() == "inner"
    assert done == ["done"]
    assert not postpone(sys._getframe(), lambda: done.append("again"))


def test_a_function_that_does_not_return_is_interrupted_by_the_next_signal(monkeypatch):
    @sheltered
    def endless():
        assert postpone(sys._getframe(), lambda: None)
        assert postpone(sys._getframe(), lambda: None)
        now = time.monotonic()
        monkeypatch.setattr(time, "monotonic", lambda: now + 1.5)
        return postpone(sys._getframe(), lambda: None)

    assert endless() is False


def test_another_thread_leaves_postponed_interrupts_to_the_main_thread():
    done = []

    @sheltered
    def quick():
        return None

    @sheltered
    def long():
        postpone(sys._getframe(), lambda: done.append(threading.current_thread()))
        thread = threading.Thread(target=quick)
        thread.start()
        thread.join()
        assert done == []

    long()
    assert done == [threading.main_thread()]
