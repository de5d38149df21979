"""A module on RS485 as an axis of a machine, in real time behind a pseudo-terminal: the verbs, and every end, on the plant."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from axisbus.bus.link import ownership
from axisbus.errors import AxisbusError, BootError, DriveFault, SecondMasterError, StateError
from axisbus.machine.machine import Machine
from axisbus.motion.command_status import Status
from axisbus.motion.states import AxisState
from kit import command_line
from kit.modbus.on_terminal import module_on_terminal

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
process = "{process}"
[nodes.1]
protocol = "modbus"
[nodes.1.modbus]
velocity_limit = 40.0
current_limit = 10.0
velocity_ramp = 100.0
acceleration = 80.0
endpoints = "endpoints_0.5.13.json"
[axes.arm]
node = 1
unit = "deg"
scale = "131072/360"
max_velocity = 1000
max_acceleration = 4000
"""
RAMPS = {"velocity": 180.0, "acceleration": 720.0}
TURN = 360.0 / 8.0  # deg of the output for a turn of the rotor


class Line:
    """The cell of one module, and the module itself."""

    def __init__(self, folder: Path, terminal):
        self.station, self._lock, self._folder = terminal.stations[0], terminal.lock, folder
        self.path = terminal.path

    def cell(self, process="thread", more=""):
        file = self._folder / "cell.toml"
        file.write_text(CELL.format(port=self.path, process=process) + more, "utf-8")
        return file

    @property
    def place(self):
        """Degrees of the output."""
        with self._lock:
            return self.station.module.motor.position / 16384 * TURN

    @property
    def velocity(self):
        with self._lock:
            return self.station.module.shaft.speed * TURN

    @property
    def is_off(self):
        with self._lock:
            return not self.station.module.energised

    @property
    def is_free(self):
        """Whether no program has the line any more."""
        try:
            lock = ownership.take("modbus", self.path)
        except SecondMasterError:
            return False
        if lock is not None:
            lock.close()
        return True

    def until(self, done, seconds=10.0):
        end = time.monotonic() + seconds
        while not done():
            assert time.monotonic() < end
            time.sleep(0.01)


@pytest.fixture
def line(tmp_path):
    with module_on_terminal(tmp_path) as terminal:
        line = Line(tmp_path, terminal)
        yield line
        line.until(lambda: line.is_free)  # the next port may have the same name


@pytest.fixture
def arm(line):
    """Enabled, and homed at its position."""
    with Machine.open(line.cell()) as machine:
        axis = machine["arm"]
        axis.enable().wait(10)
        axis.home(method=35).wait(10)
        yield axis


def test_a_modbus_machine_boots_without_power(line):
    with Machine.open(line.cell()) as machine:
        assert machine["arm"].state is AxisState.DISABLED
        assert line.is_off
    assert line.is_off


def test_moves_reach_their_targets_and_the_count_survives_a_disable(line, arm):
    start = line.place
    for target in (90.0, -45.0, 10.0):
        arm.move_absolute(target, **RAMPS).wait(10)
        assert abs(line.place - start - target) < 0.5
    assert abs(arm.position - 10.0) < 0.5
    arm.disable().wait(10)
    assert line.is_off
    arm.enable().wait(10)
    arm.move_relative(-10.0, **RAMPS).wait(10)
    assert abs(line.place - start) < 0.5


def test_a_halt_ends_a_move_and_holds(line, arm):
    move = arm.move_absolute(500.0, **RAMPS)
    line.until(lambda: line.velocity > 150.0)
    arm.halt().wait(10)
    assert move.status is Status.ABORTED
    assert abs(line.velocity) < 1.0
    assert not line.is_off
    held = line.place
    time.sleep(0.3)
    assert abs(line.place - held) < 0.2
    arm.move_absolute(0.0, **RAMPS).wait(15)


def test_a_quick_stop_brakes_the_module_and_switches_its_power_off(line, arm):
    arm.move_absolute(500.0, **RAMPS)
    line.until(lambda: line.velocity > 150.0)
    arm.quick_stop().wait(10)
    line.until(lambda: line.is_off)
    assert abs(line.velocity) < 5.0
    arm.enable().wait(10)
    arm.move_relative(20.0, **RAMPS).wait(10)


def test_modes_that_it_does_not_have_are_refused_before_anything_is_sent(line, arm):
    with pytest.raises(AxisbusError, match=r"pv(?s:.)*modes = \[\.\.\.\] of \[axes\.arm\]"):
        arm.move_velocity(10.0, acceleration=100.0).wait(5)
    with pytest.raises(AxisbusError, match="torque"):
        arm.torque_control(10.0, slope=10.0).wait(5)
    assert abs(line.velocity) < 0.1


def test_a_fault_is_reported_with_its_name_and_reset(line, arm):
    with line._lock:
        line.station.module.dials.encoder_error = 0x10
    with pytest.raises(DriveFault) as caught:
        arm.move_absolute(50.0, **RAMPS).wait(10)
    assert "encoder" in str(caught.value)
    assert line.is_off
    with line._lock:
        line.station.module.dials.encoder_error = 0
    arm.reset().wait(10)
    arm.enable().wait(10)


def test_one_lost_answer_does_not_count_as_a_lost_node(line, arm):
    for lost in (1, 2):
        with line._lock:
            line.station.dials.silent = lost
        arm.move_relative(30.0, **RAMPS).wait(10)
    assert arm.state is AxisState.STANDSTILL


def test_a_line_that_falls_silent_is_a_lost_node_and_the_axis_has_to_be_homed_again(line, arm):
    move = arm.move_absolute(40.0, velocity=10.0, acceleration=720.0)
    line.until(lambda: line.velocity > 5.0)
    with line._lock:
        line.station.dials.deaf = -1
    with pytest.raises(AxisbusError):
        move.wait(10)
    assert arm.state is AxisState.ERRORSTOP
    with line._lock:
        line.station.dials.deaf = 0
    line.until(lambda: line.is_off, 15.0)


def test_a_module_that_holds_another_value_than_was_written_ends_the_machine_and_is_stopped(line):
    with line._lock:
        line.station.dials.clamps = {0x70: 2.0}
    machine = Machine.open(line.cell())
    axis = machine["arm"]
    axis.enable().wait(10)
    axis.home(method=35).wait(10)
    with pytest.raises(AxisbusError, match="trajectory_velocity holds 2"):
        axis.move_absolute(90.0, **RAMPS).wait(10)
    with pytest.raises(AxisbusError):
        machine.close()
    line.until(lambda: abs(line.velocity) < 1.0)
    assert abs(line.place) < 5.0


def test_a_module_that_refuses_a_question_ends_the_machine_and_is_stopped(line):
    machine = Machine.open(line.cell())
    axis = machine["arm"]
    axis.enable().wait(10)
    axis.home(method=35).wait(10)
    move = axis.move_absolute(2000.0, **RAMPS)
    line.until(lambda: line.velocity > 150.0)
    with line._lock:
        line.station.dials.exceptions = {(0x0F, False): 2}
    with pytest.raises(AxisbusError, match="refuses"):
        move.wait(10)
    with pytest.raises(AxisbusError):
        machine.close()
    line.until(lambda: abs(line.velocity) < 1.0)


def test_a_module_that_another_program_has_enabled_is_braked_and_switched_off(line):
    with line._lock:
        module = line.station.module
        module.usb_write("axis0.controller.config.control_mode", 2)
        module.usb_write("axis0.controller.config.input_mode", 2)
        module.usb_write("axis0.requested_state", 8)
    time.sleep(0.2)
    with line._lock:
        module.usb_write("axis0.controller.input_vel", 3.0)
    line.until(lambda: line.velocity > 100.0)
    with Machine.open(line.cell()) as machine:
        assert line.velocity > 100.0  # it is left as it was found
        axis = machine["arm"]
        axis.enable().wait(10)
        line.until(lambda: line.is_off)
        assert abs(line.velocity) < 5.0
        line.until(lambda: axis.state is AxisState.ERRORSTOP)
        axis.reset().wait(10)
        axis.enable().wait(10)
        axis.move_relative(10.0, **RAMPS).wait(10)


def test_a_missing_module_is_reported(line):
    with line._lock:
        line.station.dials.deaf = -1
    with pytest.raises(BootError, match="module 1 does not answer"):
        Machine.open(line.cell())


def test_a_line_does_not_run_in_virtual_time(line):
    with pytest.raises(StateError, match="serial line"):
        Machine.simulated(line.cell())


def test_a_list_of_another_firmware_is_refused(line, tmp_path):
    (tmp_path / "endpoints_0.5.13.json").rename(tmp_path / "endpoints_0.5.11.json")
    text = line.cell().read_text("utf-8").replace("0.5.13", "0.5.11")
    (tmp_path / "cell.toml").write_text(text, "utf-8")
    with pytest.raises(AxisbusError, match="firmware"):
        Machine.open(tmp_path / "cell.toml")


PROGRAM = """\
import sys, time
from axisbus import Machine
with Machine.open(sys.argv[1]) as machine:
    arm = machine["arm"]
    arm.enable().wait(10)
    if "pv" in open(sys.argv[1]).read():
        arm.move_velocity(180.0, acceleration=720.0)
    else:
        arm.home(method=35).wait(10)
        arm.move_absolute(2000.0, velocity=180.0, acceleration=720.0)
    time.sleep(60)
"""


VELOCITY = 'modes = ["pv"]\n'


@pytest.mark.parametrize(
    ("number", "more"),
    [
        (signal.SIGINT, ""),
        (signal.SIGTERM, ""),
        (signal.SIGKILL, ""),
        (signal.SIGINT, VELOCITY),
        (signal.SIGKILL, VELOCITY),
    ],
)
def test_a_program_that_ends_stops_the_motor_and_takes_its_power(line, number, more):
    """Its core is in a process of its own, which runs the stop sequence when the program is gone."""
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(line.cell("own", more))], stderr=subprocess.DEVNULL
    )
    line.until(lambda: line.velocity > 150.0, 20.0)
    process.send_signal(number)
    line.until(lambda: line.is_off, 15.0)
    assert abs(line.velocity) < 30.0
    process.wait(20)


@pytest.mark.skipif(sys.platform != "linux", reason="the processes are found as Linux tells them")
@pytest.mark.parametrize("more", ["", VELOCITY], ids=["position", "velocity"])
def test_the_watchdog_process_of_a_killed_core_stops_the_motor(line, more):
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(line.cell("own", more))], stderr=subprocess.DEVNULL
    )
    line.until(lambda: line.velocity > 150.0, 20.0)
    children = Path(f"/proc/{process.pid}/task").glob("*/children")
    watchdog = next(text for each in children if (text := each.read_text("utf-8").split()))[0]
    core = Path(f"/proc/{watchdog}/task/{watchdog}/children").read_text("utf-8").split()[0]
    subprocess.run(["kill", "-9", core], check=True)
    line.until(lambda: line.is_off, 15.0)
    assert abs(line.velocity) < 30.0
    process.kill()
    process.wait(20)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (("endpoints = ", "# endpoints = "), "names no list of endpoints"),
        (("acceleration = 80.0", "acceleration = 80.0\ntorque_ramp = 1.0"), "has torque_ramp"),
        (("acceleration = 80.0", "acceleration = 80.0\nfilter_bandwidth = 20.0"), "has filter_bandwidth"),
        (('interface = "modbus"', 'interface = "socketcan"'), "has the protocol modbus, and [bus]"),
        (
            ('protocol = "modbus"\n[nodes.1.modbus]', 'protocol = "can_simple"\n[nodes.1.can_simple]'),
            "serial line",
        ),
        (
            ('[nodes.1]\nprotocol = "modbus"', '[nodes.1]\nprotocol = "modbus"\nremap = "never"'),
            "uses Modbus, and has no remap",
        ),
        (
            ("max_acceleration = 4000", 'max_acceleration = 4000\n[axes.arm.stop]\nquick_stop = "ramp-hold"'),
            "it cannot",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_check_reports_keys_that_a_line_cannot_have(tmp_path, monkeypatch, capsys, change, word):
    (tmp_path / "endpoints_0.5.13.json").write_text("[]", "utf-8")
    text = CELL.format(port="/dev/ttyUSB0", process="own")
    assert change[0] in text
    file = tmp_path / "cell.toml"
    file.write_text(text.replace(*change), "utf-8")
    code, out, err = command_line.runner(monkeypatch, capsys)("check", file)
    assert code != 0
    assert word in out + err
