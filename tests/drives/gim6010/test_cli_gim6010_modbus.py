"""``axisbus gim6010 modbus`` on simulated modules behind a pseudo-terminal; ended by Ctrl-C, by SIGTERM, and killed."""

from __future__ import annotations

import json
import re
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
    assert (code, "module 1: stands, without power" in out) == (0, True)
    assert line.is_off
    code, out, _ = line("stop")
    assert (code, "is in idle, without power, and was not seen in closed loop" in out) == (0, True)


def test_a_stop_is_repeated_until_it_is_seen_on_a_slow_ramp_and_ctrl_c_goes_to_the_next_step(line, tmp_path):
    line.plant("axis0.controller.config.vel_ramp_rate", 0.1)
    line.plant("axis0.controller.config.control_mode", 2)
    line.plant("axis0.controller.config.input_mode", 2)
    line.plant("axis0.requested_state", 8)
    line.plant("axis0.controller.input_vel", 5.0)
    time.sleep(2.0)
    words = ("gim6010", "modbus", "stop", "--port", line.path, "--node", "1")
    ran = subprocess.Popen([sys.executable, "-m", "axisbus", *words], stderr=subprocess.PIPE, text=True)
    while line.plant("axis0.controller.input_vel") != 0.0:
        assert ran.poll() is None
        time.sleep(0.01)
    time.sleep(0.5)
    assert not line.is_off
    ran.send_signal(signal.SIGINT)
    _, err = ran.communicate(timeout=20)
    assert ran.returncode == 3
    assert "whether it is at standstill is NOT known" in err
    assert line.plant("axis0.current_state") == 1


def test_a_calibration_without_a_watchdog_process_is_not_begun(line, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    code, _, err = line("calibrate", "motor", "--list", "endpoints_0.5.13.json", "--yes")
    assert code == 1
    assert "could not be started; nothing was enabled" in err
    assert line.plant("axis0.current_state") == 1
    assert (0x06, 0x63) not in {(frame[1], frame[3]) for frame in line.station.frames}


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


@pytest.fixture
def calibrating(line, tmp_path):
    """A program that calibrates the module, in the middle of it."""
    line.station.module.dials.calibration_time = 20.0
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
    yield process
    process.kill()
    process.wait()


def test_a_calibration_that_is_killed_is_ended_by_its_watchdog_process(calibrating, line):
    """Its program is killed in the middle of it: the watchdog process removes the power."""
    calibrating.kill()
    _, err = calibrating.communicate(timeout=30)
    assert "the program that moved it is dead: it is stopped now" in err
    assert line.plant("axis0.current_state") == 1
    assert line.is_off


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (getattr(signal, "SIGTSTP", 0), 130)]
)
def test_a_signal_ends_a_calibration_by_idle(line, calibrating, number, code):
    calibrating.send_signal(number)
    _, err = calibrating.communicate(timeout=30)
    assert calibrating.returncode == code, err
    assert "was not completed" in err
    assert line.plant("axis0.current_state") == 1


def test_a_reading_that_is_refused_during_a_calibration_does_not_prevent_idle(line, calibrating):
    with line._lock:
        line.station.dials.exceptions = {(0x02, False): 4}
    _, err = calibrating.communicate(timeout=30)
    assert calibrating.returncode == 3, err
    assert "NOT CONFIRMED" in err
    assert line.plant("axis0.current_state") == 1
