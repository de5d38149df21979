"""``axisbus velocity``, ``torque`` and ``jog``: axes that go on, of a cell of their own and in a machine that runs."""

from __future__ import annotations

import os
import re
import select
import subprocess
import sys
import time

import pytest

from axisbus.machine.axis import Axis
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit import command_line
from kit.cell import MODULE, cell_file
from kit.scenarios.core_process import OWN_PROCESS, own_cell, turns, under_way

pytestmark = [pytest.mark.timeout(120)]

FORWARD, BACK = b"\x1b[C", b"\x1b[D"


@pytest.fixture
def cell(tmp_path):
    return cell_file(
        tmp_path, "xy", period="20ms", heartbeat="1s", axis="rated_torque = 10.0\nmax_torque = 5.0"
    )


def test_axes_turn_for_the_given_time_and_are_disabled(axisbus, cell):
    begin = time.monotonic()
    code, out, err = axisbus("velocity", cell, "x=30", "y=-15", "--for", "1")
    assert code == 0, err
    assert time.monotonic() - begin > 1.0
    assert "x: has 30 deg/s\ny: has -15 deg/s\n" in out
    x, y = (float(re.search(rf"{name}: stands at (-?[\d.]+) deg", out)[1]) for name in "xy")
    assert 25.0 < x < 90.0
    assert -45.0 < y < -12.0
    assert "all axes are at standstill and disabled" in out


def test_a_torque_is_pressed_with_for_its_time(axisbus, cell):
    code, out, err = axisbus("torque", cell, "x=0.5", "--slope", "5", "--for", "0.3")
    assert code == 0, err
    assert "x: has 0.5 N·m" in out
    assert "all axes are at standstill and disabled" in out


def test_a_value_missing_in_the_drive_is_reported_before_it_is_enabled(axisbus, tmp_path, monkeypatch):
    cell = cell_file(tmp_path, "x", period="20ms", heartbeat="1s", eds=MODULE, axis="rated_torque = 10.0")
    monkeypatch.setattr(Axis, "enable", lambda *_, **__: pytest.fail("it was enabled"))
    code, _, err = axisbus("torque", cell, "x=0.5", "--for", "0.3")
    assert code != 0
    assert "slope is missing" in err
    assert "6087h) is 0" in err


@pytest.mark.parametrize(
    "words",
    [
        ("velocity", "x=30", "--acceleration", "15"),
        ("torque", "x=0.5", "--slope", "0.25"),
    ],
    ids=lambda words: words[0],
)
def test_a_command_suspended_before_its_set_value_is_reached_is_halted_by_the_core(
    axisbus, cell, words, monkeypatch
):
    """Its ramp lasts 2 s. Of a suspended command (Ctrl-Z) nothing arrives any more, so that nothing else would end the motion."""
    monkeypatch.setattr(
        "axisbus.cli.shared.enabled_axes.machine_of", lambda path, **_: Machine.simulated(path)
    )
    hold = Machine.hold_to_run

    def until_it_moves(self, *seconds):
        if self["x"].state is AxisState.STANDSTILL:
            hold(self, *seconds)

    monkeypatch.setattr(Machine, "hold_to_run", until_it_moves)
    code, _, err = axisbus(words[0], cell, *words[1:], "--for", "0")
    assert code == 3, err
    assert "sent no confirmation for 0.5 s" in err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("velocity", "x=1e9"), "x"),
        (("velocity", "z=1"), "no axis 'z'"),
        (("torque", "x=50"), "max_torque"),
        (("velocity", "x"), "AXIS=VELOCITY"),
        (("torque", "x=a"), "AXIS=TORQUE"),
        (("jog", "z"), "no axis 'z'"),
        (("jog", "x", "--velocity", "1e9"), "x"),
    ],
    ids=lambda each: " ".join(each) if isinstance(each, tuple) else "",
)
def test_invalid_commands_are_refused_before_the_bus_is_opened(axisbus, cell, words, told, monkeypatch):
    monkeypatch.setattr(Machine, "open", lambda *_, **__: pytest.fail("it was opened"))
    code, _, err = axisbus(words[0], cell, *words[1:])
    assert code in (1, 2)
    assert told in err


@OWN_PROCESS
def test_a_halt_of_another_program_ends_the_command(tmp_path):
    path = own_cell(tmp_path, "x")
    with command_line.started("velocity", path, "x=30") as turning:
        command_line.lines_before(turning, "has 30")
        with Machine.attach(path) as looking:
            looking["x"].halt().wait(10)
        _, err = turning.communicate(timeout=20)
    assert turning.returncode == 1
    assert "x: the motion ended early" in err


# -- jog -----------------------------------------------------------------------------------------------------------------------


class Terminal:
    """``axisbus jog`` on a terminal of its own."""

    def __init__(self, *words: object) -> None:
        import pty

        self.keys, theirs = pty.openpty()
        self._command = subprocess.Popen(
            [sys.executable, "-m", "axisbus", "jog", *map(str, words)],
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            start_new_session=True,
        )
        os.close(theirs)
        self.shown = ""

    def read(self, seconds: float = 0.0) -> str:
        """Read the output within some time."""
        end = time.monotonic() + seconds
        while select.select([self.keys], [], [], max(0.0, end - time.monotonic()))[0]:
            try:
                data = os.read(self.keys, 4096)
            except OSError:
                break
            self.shown += data.decode("utf-8", "replace")
        return self.shown

    def await_text(self, text: str, seconds: float = 40.0) -> None:
        end = time.monotonic() + seconds
        while text not in self.read(0.05):
            assert time.monotonic() < end, self.shown

    def hold(self, key: bytes, seconds: float) -> None:
        """A key that is held, as a terminal repeats it."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            os.write(self.keys, key)
            self.read(0.03)

    def end(self) -> int:
        self.read(0.2)
        code = self._command.wait(30)
        self.read(0.0)
        os.close(self.keys)
        return code

    def cut(self) -> None:
        """The terminal goes away, as of a connection that is lost."""
        os.close(self.keys)
        self._command.wait(30)


pty_only = pytest.mark.skipif(sys.platform != "linux", reason="terminals of their own, on Linux")


@pty_only
def test_a_held_key_moves_the_axis_and_its_release_stops_it(tmp_path):
    path = own_cell(tmp_path, "x")
    terminal = Terminal(path, "x", "--velocity", "30")
    terminal.await_text("arrow keys move it at 30 deg/s")
    with Machine.attach(path) as looking:
        x = looking["x"]
        terminal.hold(FORWARD, 2.0)
        there = x.position
        assert there > 20.0
        _stands(terminal, x)
        terminal.hold(BACK, 1.0)
        assert x.position < there
        os.write(terminal.keys, b" ")
        _stands(terminal, x)
        assert x.state is AxisState.STANDSTILL
        os.write(terminal.keys, b"q")
        assert terminal.end() == 0
    assert "x: stands at" in terminal.shown
    assert "all axes are at standstill and disabled" in terminal.shown


def _stands(terminal: Terminal, axis) -> None:
    end = time.monotonic() + 5.0
    while abs(axis.velocity) > 0.5 or axis.state is not AxisState.STANDSTILL:
        terminal.read(0.02)
        assert time.monotonic() < end, axis


@pty_only
def test_a_held_key_does_not_undo_a_halt_of_another_program(tmp_path):
    path = own_cell(tmp_path, "x")
    terminal = Terminal(path, "x", "--velocity", "30", "--acceleration", "60")
    terminal.await_text("arrow keys move it at 30 deg/s")
    with Machine.attach(path) as looking:
        x = looking["x"]
        terminal.hold(FORWARD, 1.5)
        assert x.velocity > 20.0
        x.halt()
        terminal.hold(FORWARD, 1.0)
        _stands(terminal, x)
        there = x.position
        terminal.hold(FORWARD, 0.5)
        assert x.position == pytest.approx(there, abs=0.1)
        terminal.await_text("it was halted: release the key", 1.0)
        terminal.read(1.0)
        terminal.hold(FORWARD, 1.0)
        assert x.velocity > 20.0
        os.write(terminal.keys, b"q")
        assert terminal.end() == 0


@pty_only
def test_closing_the_terminal_of_turn_stops_the_axis(tmp_path):
    path = own_cell(tmp_path, "x")
    with Machine.open(path, shared=True) as machine:
        terminal = Terminal(path, "x", "--velocity", "30")
        terminal.await_text("arrow keys move it")
        terminal.hold(FORWARD, 1.0)
        assert machine["x"].velocity > 20.0
        terminal.cut()
        end = time.monotonic() + 5.0
        while abs(machine["x"].velocity) > 0.5:
            assert time.monotonic() < end, machine["x"]
            time.sleep(0.02)
        assert not machine.simulated_node(1).drive().axis.motor.velocity


@pty_only
def test_beside_a_program_that_moves_an_axis_a_jog_is_refused_before_it_takes_a_key(tmp_path):
    path = own_cell(tmp_path, "xy")
    with Machine.open(path) as machine:
        machine["x"].enable().wait(20)
        handle = under_way(machine["x"])
        terminal = Terminal(path, "y", "--velocity", "30")
        assert terminal.end() == 1
        assert "has control" in terminal.shown
        assert "--take" in terminal.shown
        assert handle.active
        assert abs(turns(machine)) == pytest.approx(30.0, abs=1.0)


def test_without_a_terminal_a_jog_is_refused_and_nothing_is_opened(axisbus, cell, monkeypatch):
    monkeypatch.setattr(Machine, "open", lambda *_, **__: pytest.fail("it was opened"))
    code, _, err = axisbus("jog", cell, "x", "--velocity", "30")
    assert code == 1
    assert "standard input is not a terminal" in err
