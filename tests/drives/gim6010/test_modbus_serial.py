"""Both sides on a pseudo-terminal, in real time: pymodbus's frames and checksums against those of the simulated module."""

from __future__ import annotations

import os
import sys
import time

import pytest
import serial

from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.dialogue import ModbusRefused
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.registers import REGISTERS, named
from axisbus.drives.gim6010.modbus.requests import ModbusTimeout
from axisbus.drives.gim6010.modbus.serial_wire import SerialWire
from axisbus.drives.gim6010.sim.modbus.station import Station, framed
from axisbus.drives.gim6010.sim.modbus.terminal import served
from axisbus.errors import AdapterError, NodeTimeout, UserError

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals")


@pytest.fixture
def line():
    station = Station()
    with served(station) as terminal:
        wire = SerialWire(terminal.path)
        yield station, wire, ModbusModule(wire, 1)
        wire.close()


def test_every_request_is_sent_as_in_the_manual_and_answered(line):
    station, wire, _ = line
    wire.close()
    wire = SerialWire(wire.port, timeout=3.0)  # each is asked once, and this computer may be busy
    asked = [requests.read(each) for each in REGISTERS if each.readable]
    asked += [
        requests.write(each, 1)
        for each in REGISTERS
        if each.writable and not each.field.values and each.address < 0x7E
    ]
    for request in asked:
        if request.address in (0x61, 0x62):
            continue
        reply = wire.exchange(1, request)
        assert requests.fits(request, reply), request
        assert station.frames[-1] == request.frame(1)
    wire.close()
    assert station.broken == 0
    assert len(station.frames) == 40


def test_values_are_written_and_read_back(line):
    station, _, module = line
    assert module.write("position_gain", 12.25) == 12.25
    assert module.write("control_mode", 2) == 2
    assert station.module.usb_read("axis0.controller.config.pos_gain") == 12.25
    assert module.read("motor_error") == 0


def test_faults_of_the_line_are_lived_through_or_reported(line):
    station, wire, module = line
    for fault in ("silent", "wrong_checksum", "short"):
        setattr(station.dials, fault, 1)
        assert module.read("bus_voltage") == 24.0, fault
    station.dials.late[len(station.frames)] = 0.3
    assert module.write("velocity_limit", 12.0) == 12.0
    assert module.read("current_limit") == 45.0
    station.dials.exceptions[0x13, False] = 4
    with pytest.raises(ModbusRefused, match="refuses the request: bus_voltage"):
        module.read("bus_voltage")
    begin = time.monotonic()
    with pytest.raises(ModbusTimeout):
        wire.exchange(9, requests.read(named("motor_state")))
    assert 0.15 < time.monotonic() - begin < 5.0


def test_another_module_s_answer_is_not_taken(line):
    station, wire, _ = line
    station.dials.silent = 1
    station._answers.append((0.0, framed(bytes.fromhex("07 04 04 41 C0 00 00"))))
    with pytest.raises(ModbusTimeout):
        wire.exchange(1, requests.read(named("bus_voltage")))


def test_a_port_is_had_by_one_program_and_a_lost_one_is_reported(line):
    _, wire, module = line
    with pytest.raises(AdapterError, match="cannot be used"):
        SerialWire(wire.port)
    wire.close()
    other = SerialWire(wire.port)
    assert module.device == 1
    other.close()


def test_a_line_that_takes_nothing_for_a_while_is_a_silent_module_and_no_lost_port(line, monkeypatch):
    _, wire, module = line

    def stuck(_: bytes) -> int:
        raise serial.SerialTimeoutException("Write timeout")

    with monkeypatch.context() as patched:
        patched.setattr(wire._client.socket, "write", stuck)
        with pytest.raises(ModbusTimeout):
            wire.exchange(1, requests.read(REGISTERS[0]))
    assert module.state == 1


def test_a_line_that_is_pulled_is_reported_at_once():
    station = Station()
    with served(station) as terminal:
        wire = SerialWire(terminal.path)
        module = ModbusModule(wire, 1)
        assert module.state == 1
    begin = time.monotonic()
    with pytest.raises((AdapterError, NodeTimeout)) as caught:
        module.read("bus_voltage")
    assert "check" in caught.value.remedy
    assert time.monotonic() - begin < 20.0
    wire.close()


@pytest.mark.parametrize("port", ["/dev/none", "", "/dev/null"])
def test_an_invalid_serial_port_is_reported(port):
    with pytest.raises(AdapterError, match="cannot be used") as caught:
        SerialWire(port)
    assert "check its name" in caught.value.remedy


def test_a_missing_extra_is_reported(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(UserError, match="pymodbus and pyserial") as caught:
        SerialWire("/dev/ttyUSB0")
    assert 'pip install "axisbus[modbus]"' in caught.value.remedy


def test_the_terminal_is_given_back():
    before = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    with served(Station()) as terminal:
        assert os.path.exists(terminal.path)
        terminal.close()
    after = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    assert after == before
