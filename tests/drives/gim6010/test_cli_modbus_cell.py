"""A module on RS485 as the axis of a cell file, by the commands of every axis: check, boot, move, velocity, torque, stop."""

from __future__ import annotations

import sys
import time
from types import SimpleNamespace

import pytest

from axisbus.drives.gim6010 import checks
from kit import command_line
from kit.modbus.on_terminal import LISTED, module_on_terminal

pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals"),
]
CELL = """\
[bus]
interface = "modbus"
channel = "{port}"
bitrate = 115200
scan_period = "20ms"
[nodes.1]
protocol = "modbus"
[nodes.1.modbus]
velocity_limit = 40.0
current_limit = 10.0
velocity_ramp = 100.0
acceleration = 80.0
endpoints = "{listed}"
{torque}
[axes.arm]
node = 1
unit = "deg"
scale = "131072/360"
{fastest}max_acceleration = 4000
{axis}
[axes.arm.defaults]
velocity = 180.0
acceleration = 720.0
{slope}[axes.arm.homing]
method = 35
"""
TORQUE = "gear_ratio = 8.0\ntorque_constant = 0.097\ntorque_ramp = 5.0"


class Cell:
    def __init__(self, run, terminal, folder):
        self.station, self._lock, self._run = terminal.stations[0], terminal.lock, run
        self._file, self._port = folder / "cell.toml", terminal.path
        self.write()

    def write(self, axis="", torque="", fastest="max_velocity = 1000\n"):
        slope = "torque_slope = 20.0\n" if "rated_torque" in axis else ""
        text = CELL.format(
            port=self._port, listed=LISTED, axis=axis, torque=torque, slope=slope, fastest=fastest
        )
        self._file.write_text(text, "utf-8")

    def __call__(self, command, *words):
        return self._run(command, self._file, *words)

    def turn(self, velocity=5.0):
        """Another program, which is then gone, has left it at a velocity."""
        for path, value in (
            ("controller.config.control_mode", 2),
            ("controller.config.input_mode", 2),
            ("requested_state", 8),
        ):
            self.plant(path, value)
        time.sleep(0.2)
        self.plant("controller.input_vel", velocity)
        while abs(self.speed) < 0.9 * abs(velocity):
            time.sleep(0.01)

    def plant(self, path, value):
        with self._lock:
            self.station.module.usb_write(f"axis0.{path}", value)

    @property
    def speed(self):
        with self._lock:
            return self.station.module.shaft.speed

    @property
    def place(self):
        with self._lock:
            return self.station.module.motor.position / 16384 * 45.0

    @property
    def is_off(self):
        with self._lock:
            return not self.station.module.energised


@pytest.fixture
def cell(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    with module_on_terminal(tmp_path) as terminal:
        yield Cell(command_line.runner(monkeypatch, capsys), terminal, tmp_path)


def test_it_is_checked_booted_and_moved(cell):
    code, out, err = cell("check")
    assert code in (0, 1), err
    assert "no function of its module is known to detect the loss of the master" in out + err
    code, out, err = cell("boot")
    assert code == 0, err
    assert "registers, read one after the other" in out
    assert "a velocity or a torque continues" in " ".join(out.split())
    assert cell.is_off
    code, out, err = cell("move", "arm=90", "--home")
    assert code == 0, err
    assert abs(cell.place - 90.0) < 1.0
    assert cell.is_off


def test_check_says_that_nothing_stops_it_when_the_program_is_killed_on_a_system_without_a_core_process(
    cell, monkeypatch
):
    said = "and nothing stops it when this program is killed"
    assert said not in cell("check").out
    monkeypatch.setattr(checks, "sys", SimpleNamespace(platform="win32"))
    found = cell("check")
    assert said in found.out + found.err


def test_it_is_turned_at_a_velocity(cell):
    cell.write('modes = ["pv", "hm"]')
    code, out, err = cell("velocity", "arm=90", "--for", "1s")
    assert code == 0, err
    assert "arm: has 90 deg/s" in out
    assert cell.place > 45.0
    assert cell.is_off


def test_it_is_given_a_torque(cell):
    cell.write('modes = ["tq"]\nrated_torque = 5.0', TORQUE)
    cell.plant("controller.config.torque_ramp_rate", 5.0)
    code, out, err = cell("torque", "arm=0.5", "--for", "0.5s")
    assert code == 0, err
    assert "arm: has 0.5 N·m" in out
    assert cell.place > 0.5
    assert cell.is_off


def test_commands_of_another_mode_name_the_key_of_the_cell_file(cell):
    for command, value in (("velocity", "arm=90"), ("torque", "arm=0.5")):
        code, _, err = cell(command, value, "--for", "0.1s")
        assert code != 0
        assert "modes = [...] of [axes.arm]" in err or "rated_torque" in err
    assert cell.is_off


def test_torques_without_a_highest_velocity_are_refused_by_check(cell):
    cell.write('modes = ["tq"]\nrated_torque = 5.0', TORQUE, fastest="")
    code, out, err = cell("check")
    assert code != 0
    assert "axis arm has the mode tq, and no max_velocity" in out + err


def test_a_module_that_another_program_has_enabled_is_stopped_without_a_machine(cell):
    cell.turn()
    code, out, err = cell("stop")
    assert code == 0, err
    assert "arm: stands, without power" in out
    assert cell.is_off
    assert abs(cell.speed) < 0.1


def test_a_module_that_answers_nothing_is_stopped_blind_and_reported_as_not_confirmed(cell):
    cell.turn()
    with cell._lock:
        cell.station.dials.silent = -1
    code, out, err = cell("stop")
    assert code == 3
    assert "NOT CONFIRMED as stopped" in out + err
    assert cell.is_off


@pytest.mark.parametrize(
    ("axis", "torque", "word"),
    [
        ('modes = ["pp", "pv"]', "", "exactly one of pp, pv and tq"),
        ('modes = ["csp"]', "", "csp"),
        (
            'modes = ["tq"]',
            "",
            "missing: gear_ratio, torque_constant, torque_ramp, rated_torque in [axes.arm]",
        ),
        ("rated_torque = 5.0", TORQUE, 'torques only with modes = ["tq"]'),
    ],
    ids=str,
)
def test_modes_that_a_line_cannot_have_are_refused_by_check(cell, axis, torque, word):
    cell.write(axis, torque)
    code, out, err = cell("check")
    assert code != 0
    assert word in " ".join((out + err).split())
    assert cell.station.frames == []
