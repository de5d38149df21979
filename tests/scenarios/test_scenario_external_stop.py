"""``axisbus stop`` beside a running master: the drives stop and stay stopped, and no program enables them again."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Self

import can
import pytest

from axisbus.bus.link.claims import CellFileId, ChannelClaim
from axisbus.cia301.nmt import NmtState
from axisbus.cli.main import cli
from axisbus.cli.shared.common import run
from axisbus.core import node_stop
from axisbus.machine import stop_external
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.plant_probe import ENABLED, OFF, QUICK_STOP
from kit.scenarios.safety_nets import patience
from kit.scenarios.simulated_bus import Line, turning, until
from kit.sending_device import Talker

STOPPED = (QUICK_STOP, *OFF)
BESIDE = pytest.mark.nets("the stop beside", "the stop sequence", "the drive's watchdog")
PERIOD = 0.02
# that of a node that is lost is waited for in vain
TIMES = 'quick_stop_time = "500ms"\ndisable_time = "500ms"'


@pytest.fixture
def axisbus_stop(monkeypatch, capsys):
    """Run ``axisbus stop CELL``; return the exit code, the output and the errors."""

    def call(line: Line) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["axisbus", "stop", str(line.file)])
        monkeypatch.setattr(node_stop, "_MAX_TIME", patience(node_stop._MAX_TIME))
        code = run(cli)
        return (code, *capsys.readouterr())

    return call


@contextmanager
def live(folder, names: str = "xy") -> Iterator[tuple[Line, Machine]]:
    """A master that lets its axes turn. It is closed at the end, and its errors are ignored."""
    with Line(folder, names, stop=TIMES) as line:
        machine = line.open()
        try:
            turning(machine, line)
            yield line, machine
        finally:
            machine._close("the scenario ends")


@BESIDE
def test_the_drives_of_a_live_master_stop_and_it_takes_that_as_a_fault(tmp_path, axisbus_stop):
    with live(tmp_path) as (line, machine):
        code, told, _ = axisbus_stop(line)
        for name in "xy":
            line.must_be_still(name, stages=STOPPED, within=0.1)
        assert code == 0, told
        for axis in machine:
            until(lambda axis=axis: "NMT state is stopped, not operational" in str(axis.error))
            assert axis.state is AxisState.ERRORSTOP
        for name in "xy":
            line.must_be_still(name, stages=STOPPED, within=0.1, for_good=0.5)
            assert line.devices[name].nmt is NmtState.STOPPED
        assert "x: " in told


def test_a_machine_that_did_not_get_the_stop_is_named_with_what_it_can_do(
    tmp_path, monkeypatch, axisbus_stop
):
    """Its core is in its program: its drives are stopped, but that program continues."""
    with live(tmp_path) as (line, _), monkeypatch.context() as patch:
        own = ChannelClaim(
            "claim",
            True,
            False,
            "can0",
            CellFileId.of(line.file),
            "",
            os.getpid(),
            os.geteuid(),
            os.getegid(),
        )
        patch.setattr(stop_external, "claims_of", lambda _: [own])
        code, told, errors = axisbus_stop(line)
        assert (code, "x: stopped" in told) == (0, True)
        assert f"process {os.getpid()} " in errors
        assert "it can boot its nodes and move its axes again" in errors


class Stubborn(Talker):
    """A master that sends *enable operation* in every cycle and looks at nothing: the recorded frames of one, repeated."""

    def __init__(self, line: Line) -> None:
        super().__init__(line.channel)
        self._frames: dict[int, bytes] = {}

    def __enter__(self) -> Self:
        self._listen()
        return super().__enter__()

    def _listen(self) -> None:
        """Take a cycle of RPDOs, and the master's heartbeat."""
        while 0x77F not in self._frames or not any(0x200 < number < 0x580 for number in self._frames):
            frame = self._bus.recv(1.0)
            assert frame is not None
            number = frame.arbitration_id
            if number == 0x77F or number & 0x780 in (0x200, 0x300, 0x400, 0x500):
                self._frames[number] = bytes(frame.data)

    def _talk(self) -> None:
        while not self._over.wait(PERIOD):
            for number, data in [*self._frames.items(), (0x80, b"")]:
                self._bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=False))


@pytest.mark.nets("the stop beside")
def test_a_master_that_continues_sending_enable_operation_is_cut_off(tmp_path, axisbus_stop):
    with live(tmp_path, "x") as (line, machine), Stubborn(line):
        machine._core.scan.quit()  # from here on only the stubborn one sends
        until(lambda: not machine._core._thread.is_alive())
        line.must_move()
        code, told, _ = axisbus_stop(line)
        line.must_be_still(stages=STOPPED, within=0.1, for_good=0.6)
        assert code == 0, told


def test_stopping_neither_boots_nor_resets_nor_configures(tmp_path, axisbus_stop):
    with live(tmp_path, "x") as (line, _):
        device = line.devices["x"]
        written = []
        write = device.write
        device.write = lambda index, *rest: (written.append(index), write(index, *rest))
        watch, commands = device.read(0x1016, 1), []
        nmt_command = device.nmt_command
        device.nmt_command = lambda command: (commands.append(command.name), nmt_command(command))
        axisbus_stop(line)
        assert set(written) <= {0x6040}
        assert device.read(0x1016, 1) == watch
        assert set(commands) <= {"ENTER_PRE_OPERATIONAL", "STOP"}


def test_axisbus_stop_reports_a_cell_that_is_not_energised(tmp_path, axisbus_stop):
    with Line(tmp_path, "x") as line:
        code, told, _ = axisbus_stop(line)
        assert code == 0
        assert "was not energised" in told
        assert line.stage() != ENABLED


def test_a_node_that_does_not_answer_is_reported_and_sets_the_exit_code(tmp_path, axisbus_stop):
    with Line(tmp_path, "xy", present="y") as line:
        code, told, _ = axisbus_stop(line)
    assert code == 3
    assert "x: NOT CONFIRMED as stopped" in told
    assert "y: was not energised" in told


@pytest.mark.parametrize("enabled", [True, False], ids=["stopped", "found off"])
def test_a_motor_that_turns_on_without_power_is_not_reported_as_stopped(tmp_path, axisbus_stop, enabled):
    """Seen on a foreign slave: reported stopped at 5 m/s."""
    with Line(tmp_path, "x") as line:
        drive = line.drive()
        with line.lock:
            drive.axis.motor._viscous = 0.0
            drive.axis.motor.params = replace(drive.params, friction=0.0)
            drive.axis.motor.velocity = 300.0 * line.scale_of("x")
            if enabled:
                drive.start_enabled(3)
                drive.target_velocity = round(300.0 * line.scale_of("x"))
        line.device_write("x", 0x605A, 0)  # its quick stop lets it coast
        line.must_move()
        code, told, _ = axisbus_stop(line)
        line.must_move()
        assert code == 3
        assert "x: NOT CONFIRMED as stopped: its power is off" in told
        assert re.search(r"still moves, at [0-9.e+]+ deg with about \d+ deg/s", told), told


@pytest.mark.parametrize("load", ["", 'holds_load = "torque"'], ids=["no load", "a load"])
def test_a_motor_that_something_holds_in_quick_stop_loses_its_power_unless_it_holds_a_load(
    tmp_path, axisbus_stop, load
):
    with Line(tmp_path, "x", axis=load) as line:
        drive = line.drive()
        line.device_write("x", 0x605A, 6)  # it holds in quick stop
        with line.lock:
            drive.start_enabled(1)
            drive.dials.blocked = True
            drive.axis.position += 90.0 * line.scale_of("x")
        code, told, _ = axisbus_stop(line)
        assert code == (3 if load else 0)
        assert ("x: NOT CONFIRMED as stopped" in told) is bool(load)
        assert line.stage() in ((QUICK_STOP,) if load else OFF)
