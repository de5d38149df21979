"""``axisbus gim6010 modbus`` on simulated modules behind a pseudo-terminal; ended by Ctrl-C, by SIGTERM, and killed."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import pytest

from kit import command_line
from kit.modbus.on_terminal import module_on_terminal

pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals"),
]
MOVE = ("--velocity", "20", "--acceleration", "200", "--deceleration", "200")


class Line:
    def __init__(self, run, terminal):
        self.station = terminal.stations[0]
        self.path = terminal.path
        self._run = run
        self._lock = terminal.lock

    def __call__(self, command, *arguments, node=1, port=None):
        return self._run(
            "gim6010", "modbus", command, "--port", port or self.path, "--node", node, *arguments
        )

    def plant(self, path, value=None):
        with self._lock:
            if value is not None:
                self.station.module.usb_write(path, value)
            return self.station.module.usb_read(path)

    @property
    def is_off(self):
        with self._lock:
            module = self.station.module
            return not module.energised and abs(module.shaft.speed) < 0.1


@pytest.fixture
def line(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    with module_on_terminal(tmp_path) as terminal:
        yield Line(command_line.runner(monkeypatch, capsys), terminal)


def test_state_and_errors_are_printed_and_cleared(line):
    code, out, _ = line("state")
    assert code == 0
    assert "module 1 is in idle" in out
    assert "position_feedback: not alive" in out
    assert "control_mode: 3 (position)" in out
    assert "velocity_limit: 30 turns/s (rotor)" in out
    assert json.loads(line("state", "--json").out)["bus_voltage"] == 24.0
    assert line("errors") == (0, "no error\n", "")
    with line._lock:
        line.station.module.axis.estop()
    assert line("state").code == 1
    code, out, _ = line("errors")
    assert code == 1
    assert "ESTOP_REQUESTED: an emergency stop was requested" in out
    assert json.loads(line("errors", "--json").out)["axis"] == 0x4000
    code, out, _ = line("errors", "--clear")
    assert (code, out.splitlines()[-1]) == (0, "no error")
    assert out.startswith("was: axis ESTOP_REQUESTED")


def test_values_are_read_and_written_by_name(line):
    assert line("read", "velocity_limit", "bus_voltage").out == (
        "velocity_limit = 30 turns/s (rotor)\nbus_voltage = 24 V\n"
    )
    assert len(line("read").out.splitlines()) == 28
    assert json.loads(line("read", "node_id", "position_feedback", "--json").out) == {
        "node_id": 1,
        "position_feedback": None,
    }
    assert line("read", "position_feedback").out == (
        "position_feedback = 0 turns (rotor) (may be outdated: not in closed loop)\n"
    )
    code, out, _ = line("write", "velocity_limit=12.5", "input_mode=5")
    assert code == 0
    assert "velocity_limit = 12.5 turns/s (rotor) (was 30 turns/s (rotor))" in out
    assert "input_mode = 5 (trapezoidal trajectory) (was 1 (direct))" in out
    assert "in RAM only" in out
    assert line.plant("axis0.controller.config.vel_limit") == 12.5
    code, out, _ = line("write", "velocity_limit=13", "--save")
    assert (code, "saved: it restarted, and answers" in out) == (0, True)
    assert line.station.module.restarts == 1


def test_parameters_are_read_and_written_by_the_list_of_the_firmware(line):
    path = "axis0.controller.config.vel_ramp_rate"
    listed = ("--list", "endpoints_0.5.13.json")
    assert line("read", path, "velocity_limit", *listed).out == (
        f"{path} = 100\nvelocity_limit = 30 turns/s (rotor)\n"
    )
    code, out, _ = line("write", f"odrv0.{path}=50", *listed, "--save")
    assert code == 0
    assert f"odrv0.{path} = 50 (was 100)" in out
    assert line.plant(path) == 50.0
    code, _, err = line("write", "axis0.requested_state=8", *listed)
    assert (code, "not written here" in err) == (2, True)


def test_a_missing_port_or_module_is_reported(line):
    code, _, err = line("state", port="/dev/none")
    assert (code, "the serial port /dev/none cannot be used" in err) == (3, True)
    code, _, err = line("state", node=9)
    assert code == 3
    assert "module 9 does not answer" in err
    assert "that the module has this node ID" in err
    assert err.startswith("axisbus: module 9")
    code, _, err = line("stop", node=9)
    assert code == 3
    assert "NOT CONFIRMED as stopped" in err
    assert line("state", node=0).code == 2


def test_a_move_of_the_module_arrives_and_switches_the_module_off_afterwards(line):
    code, out, err = line("move", "--to", "2.5", *MOVE)
    assert code == 0, err
    assert "nothing in this module is known to notice a dead master" in err
    assert float(re.search(r"at (-?[\d.]+) turns", out)[1]) == pytest.approx(2.5, abs=0.05)
    assert "it stood, and is in idle, without power" in err
    assert line.is_off
    code, out, _ = line("move", "--by", "-1", *MOVE)
    assert code == 0
    assert line.is_off
    code, _, err = line("velocity", "-5", "--acceleration", "100", "--for", "0.1")
    assert code == 0, err
    code, out, err = line(
        "torque", "0.01", "--slope", "1", "--most", "0.1", "--max-velocity", "50", "--for", "0.1"
    )
    assert code == 0, err
    assert line.is_off


def test_another_node_id_and_the_zero(line):
    line.station.module.motor.position = 2.3 * 16384
    code, out, err = line("zero", "--list", "endpoints_0.5.13.json")
    assert code == 0, err
    assert "index_offset = 0.3" in out
    assert "its zero is the present position; saved" in out
    code, out, err = line("write", "node_id=5", "--save")
    assert code == 0, err
    assert "module 1 is now module 5, saved" in out
    assert line("state", node=5).code == 0


def test_a_motion_that_another_program_has_enabled_is_stopped(line):
    line.plant("axis0.controller.config.control_mode", 2)
    line.plant("axis0.controller.config.input_mode", 2)
    line.plant("axis0.requested_state", 8)
    line.plant("axis0.controller.input_vel", 5.0)
    code, out, _ = line("stop")
    assert (code, "it stood, and is in idle" in out) == (0, True)
    assert line.is_off
    code, out, _ = line("stop")
    assert (code, "there is no power to be stopped" in out) == (0, True)


# -- programs of their own ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sim():
    """``axisbus sim --modbus 1``, and the port that it has printed."""
    command = [sys.executable, "-m", "axisbus", "sim", "--modbus", "1", "--modbus", "2:0.5.14"]
    ran = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    told = ran.stdout.readline()
    assert (
        "2 simulated modules GIM6010-8 on RS485: node 1 with firmware 0.5.13, node 2 with firmware 0.5.14"
        in told
    )
    yield re.search(r"--port (\S+) --node 1", ran.stdout.readline())[1]
    ran.send_signal(signal.SIGINT)
    ran.communicate(timeout=20)
    assert ran.returncode == 0


def turning(port):
    command = [
        sys.executable,
        "-m",
        "axisbus",
        "gim6010",
        "modbus",
        "velocity",
        "1",
        "--port",
        port,
        "--node",
        "1",
    ]
    ran = subprocess.Popen(
        [*command, "--acceleration", "20"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    told = ran.stdout.readline()
    if "has 1 turns/s" not in told:
        ran.kill()
        pytest.fail(told + ran.communicate()[1])
    return ran


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_ctrl_c_and_sigterm_stop_the_motor_and_end_the_program(sim, monkeypatch, capsys, number, code):
    ran = turning(sim)
    ran.send_signal(number)
    _, err = ran.communicate(timeout=30)
    assert ran.returncode == code, err
    assert "it stood, and is in idle, without power" in err
    out = command_line.runner(monkeypatch, capsys)(
        "gim6010", "modbus", "state", "--port", sim, "--node", "1"
    ).out
    assert "module 1 is in idle" in out


def test_if_the_program_is_killed_its_watchdog_process_stops_the_motor(sim, monkeypatch, capsys):
    run = command_line.runner(monkeypatch, capsys)
    ran = turning(sim)
    ran.kill()
    _, err = ran.communicate(
        timeout=30
    )  # the watchdog process has its standard error until it has done its work
    assert "nothing in this module is known to notice a dead master" in err
    assert "the program that moved it is dead: it is stopped now" in err
    assert err.endswith("module 1: it stood, and is in idle, without power\n")
    state = json.loads(run("gim6010", "modbus", "state", "--json", "--port", sim, "--node", "1").out)
    assert state["state"] == 1


@pytest.mark.skipif(shutil.which("pgrep") is None, reason="its process is found by pgrep")
def test_killing_the_watchdog_process_ends_the_motion(sim):
    ran = turning(sim)
    found = subprocess.run(["pgrep", "-P", str(ran.pid)], capture_output=True, text=True).stdout.split()
    assert len(found) == 1
    os.kill(int(found[0]), signal.SIGKILL)
    _, err = ran.communicate(timeout=30)
    assert ran.returncode == 3
    assert "the watchdog process of this motion has ended" in err
    assert "it stood, and is in idle, without power" in err


def test_without_a_watchdog_process_nothing_is_enabled(line, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    code, _, err = line("velocity", "5", "--acceleration", "10")
    assert code == 1
    assert "could not be started; nothing was enabled" in err
    assert {frame[1] for frame in line.station.frames} <= {3, 4}


def test_modules_on_the_line_are_found(line, monkeypatch, capsys):
    run = command_line.runner(monkeypatch, capsys)
    code, out, err = run("gim6010", "modbus", "find", "--port", line.path, "--highest", 3)
    assert (code, err) == (0, "")
    assert re.search(r"node 1: idle, \d+\.\d V, at 115200 bit/s", out)
    assert f"modbus state --port {line.path} --node 1" in out
    assert "node 2" not in out
    line.plant("axis0.config.can.node_id", 200)
    code, _, err = run("gim6010", "modbus", "find", "--port", line.path, "--highest", 3, "--rate", "all")
    assert code in (0, 3)  # by when the module takes its new node ID


def test_an_empty_line_is_reported(line, monkeypatch, capsys):
    line.station.dials.deaf = -1
    run = command_line.runner(monkeypatch, capsys)
    code, out, err = run("gim6010", "modbus", "find", "--port", line.path, "--highest", 2)
    assert (code, out) == (3, "")
    assert "2 node IDs asked at 115200 bit/s" in err
    assert "A and B are not swapped" in err


def test_a_calibration_needs_confirmation_and_its_result_is_reported(line):
    listed = ("--list", "endpoints_0.5.13.json")
    code, out, err = line("calibrate", "full", *listed)
    assert (code, "--yes" in err, "which moves without a command" in out) == (2, True, True)
    assert "a program that is killed" not in out
    code, _, err = line("calibrate", "full", "--yes")
    assert (code, "--list" in err) == (2, True)
    code, out, err = line("calibrate", "full", *listed, "--yes")
    assert code == 0, err
    assert "was completed without an error" in out
    assert "modbus write axis0.motor.config.pre_calibrated=true" in out
    assert line.is_off


def test_a_calibration_that_is_killed_is_ended_by_its_watchdog_process(line, tmp_path):
    """Its program is killed in the middle of it: the watchdog process removes the power."""
    words = ("gim6010", "modbus", "calibrate", "full", "--port", line.path, "--node", "1", "--yes")
    process = subprocess.Popen(
        [sys.executable, "-m", "axisbus", *words, "--list", "endpoints_0.5.13.json"],
        stderr=subprocess.PIPE,
        cwd=tmp_path,
        text=True,
    )
    while line.plant("axis0.current_state") in (0, 1):
        assert process.poll() is None
        time.sleep(0.01)
    process.kill()
    _, err = process.communicate(timeout=30)
    assert "the program that moved it is dead: it is stopped now" in err
    assert line.plant("axis0.current_state") == 1
    assert line.is_off
