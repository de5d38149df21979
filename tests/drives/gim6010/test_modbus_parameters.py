"""Parameters by endpoints over Modbus, and the zero that is set by them."""

from __future__ import annotations

import pytest

from axisbus.drives.gim6010.can_simple.endpoints import Firmware
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.parameters import ModbusParameters
from axisbus.drives.gim6010.settings import zero
from axisbus.drives.gim6010.settings.parameter_settings import apply
from axisbus.drives.gim6010.sim import constants
from axisbus.drives.gim6010.sim.modbus.station import Station, StationFaults
from axisbus.errors import ArgumentError, NodeError, StateError
from kit.modbus.virtual_wire import VirtualWire, list_of

LIMIT, WATCHDOG, TIMEOUT = (
    "axis0.controller.config.vel_limit",
    "axis0.config.enable_watchdog",
    "can.config.break_timeout",
)


def opened(**dials):
    station = Station(dials=StationFaults(**dials))
    wire = VirtualWire(station)
    parameters = ModbusParameters(ModbusModule(wire, 1))
    parameters.open(*list_of(station))
    return station, wire, parameters


@pytest.mark.parametrize("hidden", [False, True])
def test_values_of_all_types_are_read_and_written_and_read_back(hidden):
    station, _, parameters = opened(number_hidden=hidden)
    assert parameters.firmware == Firmware(0, 5, 13)
    assert parameters.serial == 0x3936_3232_3334 & 0xFFFF_FFFF
    for path, value in (
        (LIMIT, 12.5),
        (WATCHDOG, True),
        (TIMEOUT, 500),
        ("axis0.config.can.heartbeat_rate_ms", 70000),
        ("axis0.controller.config.input_mode", 5),
    ):
        assert parameters.write(path, value, by_name=True) == value
        assert station.module.usb_read(path) == value
        assert parameters.read(f"odrv0.{path}") == value


@pytest.mark.parametrize("fault", ["silent", "deaf", "wrong_checksum"])
@pytest.mark.parametrize("at", range(5))
def test_a_fault_at_any_step_of_a_write_leaves_the_value_that_was_meant_and_no_other(fault, at):
    station, wire, parameters = opened()
    before = dict(station.module.parameters.values)
    begin = len(wire.asked)

    def spoil(request):
        if len(wire.asked) - begin == at:
            setattr(station.dials, fault, 1)

    wire.before = spoil
    assert parameters.write(LIMIT, 12.5) == 12.5
    assert station.module.parameters.values == before | {LIMIT: 12.5}


def test_a_number_that_may_not_have_been_taken_is_not_written_to():
    station, wire, parameters = opened()
    before = dict(station.module.parameters.values)
    wire.before = lambda request: setattr(
        station.dials, "deaf", int(request.writes and request.address == 0xA1)
    )
    with pytest.raises(NodeError, match="number of an endpoint"):
        parameters.write(LIMIT, 12.5)
    assert station.module.parameters.values == before
    assert not [request for request in wire.asked if request.address == 0xA2]


def test_a_write_fails_if_the_endpoint_number_is_neither_read_back_nor_answered():
    station, wire, parameters = opened(number_hidden=True)
    before = dict(station.module.parameters.values)
    wire.before = lambda request: setattr(
        station.dials, "silent", int(request.writes and request.address == 0xA1)
    )
    with pytest.raises(NodeError, match="number of an endpoint"):
        parameters.write(LIMIT, 12.5)
    assert station.module.parameters.values == before


def test_another_master_at_the_same_registers_is_noticed():
    station, wire, parameters = opened()
    other = station.module.endpoints.number("axis0.motor.config.current_lim")

    def meddle(request):
        if not request.writes and request.address == 0xA1:
            station.take(b"", wire.time)
            station._endpoint = other  # as another master's frame between ours would do

    wire.before = meddle
    with pytest.raises(NodeError, match="does not accept the number of an endpoint"):
        parameters.read(LIMIT)


def test_values_and_parameters_that_are_refused():
    station, _, parameters = opened()
    for path, value, error in (
        ("axis0.requested_state", 8, "not written here"),
        ("axis0.config.can.node_id", 5, "not written as a parameter"),
        ("axis0.encoder.config.index_offset", 0.5, "protected"),
        ("vbus_voltage", 5.0, "cannot be written"),
        (LIMIT, "fast", "not a value of type float"),
        ("axis0.none", 1, "there is no parameter"),
    ):
        with pytest.raises(ArgumentError, match=error):
            parameters.write(path, value)
    with pytest.raises(ArgumentError, match="does not fit into 32 bits"):
        parameters.read("axis0.motor.error")
    station.module.usb_write("axis0.requested_state", 8)
    with pytest.raises(StateError, match="closed loop"):
        parameters.write(LIMIT, 5.0)


def test_a_list_of_another_firmware_is_refused_and_nothing_is_read_by_it():
    station = Station()
    parameters = ModbusParameters(ModbusModule(VirtualWire(station), 1))
    listed, _ = list_of(Station(firmware=constants.Firmware(0, 6, 0)))
    with pytest.raises(ArgumentError, match=r"made for firmware 0\.6\.0"):
        parameters.open(listed, Firmware(0, 6, 0))
    with pytest.raises(ArgumentError, match="node ID is"):
        parameters.open(listed, Firmware(0, 5, 13))
    with pytest.raises(StateError, match="open it first"):
        parameters.read(LIMIT)
    assert not [frame for frame in station.frames if frame[1:4] == bytes.fromhex("10 00 A2")]


def test_a_written_value_is_saved_and_read_after_the_restart():
    station, _, parameters = opened()
    parameters.write(LIMIT, 12.5)
    parameters.save()
    assert station.module.restarts == 1
    assert parameters.read(LIMIT) == 12.5


def test_a_value_lost_in_the_flash_is_reported():
    station, _, parameters = opened()
    parameters.write(LIMIT, 12.5)
    station.module.parameters.save = lambda: None
    with pytest.raises(NodeError, match=r"has lost axis0\.controller\.config\.vel_limit"):
        parameters.save()


def set_zero(parameters):
    wanted = zero.wanted(zero.look(parameters), zero.look(parameters))
    apply(parameters, wanted, lambda _: None)
    parameters.save()
    found = float(wanted.values[0][1])
    zero.verify(parameters.module.device, found, zero.look(parameters))
    return found


@pytest.mark.parametrize("turns", [0.0, 0.3, -0.3, 2.75, -7.99])
@pytest.mark.parametrize("offset", [0.0, 0.6])
def test_zero_is_the_present_position(turns, offset):
    station = Station(dials=StationFaults())
    station.module.usb_write("axis0.encoder.config.index_offset", offset)
    station.module.usb_write("axis0.encoder.config.use_index_offset", 1)
    station.module.parameters.save()
    station.module.restart()
    wire = VirtualWire(station)
    wire.sleep(2.0)
    station.module.motor.position = turns * 16384
    parameters = ModbusParameters(ModbusModule(wire, 1))
    parameters.open(*list_of(station))
    found = set_zero(parameters)
    assert found == pytest.approx(turns % 1.0, abs=1e-6)
    assert (
        station.module.shaft.estimate % 1.0 == pytest.approx(0.0, abs=1e-4)
        or station.module.shaft.estimate % 1.0 > 0.9999
    )
    assert station.module.parameters["axis0.encoder.config.use_index_offset"] == 1


def test_a_zero_that_is_lost_after_the_restart_is_reported():
    station, wire, parameters = opened()

    def turned(request):
        if request.address == 0x80:
            station.module.motor.position += 0.2 * 16384

    wire.before = turned
    with pytest.raises(NodeError, match="the output was turned meanwhile"):
        set_zero(parameters)


def test_no_zero_is_set_if_the_position_is_frozen_or_the_module_is_enabled():
    station, _, parameters = opened()
    station.module.motor.position = 0.3 * 16384
    station.module.endpoints._live["axis0.encoder.pos_estimate"] = lambda: 0.0
    with pytest.raises(StateError, match="does not agree with its encoder's count"):
        set_zero(parameters)
    station.module.usb_write("axis0.requested_state", 8)
    with pytest.raises(StateError, match="closed loop"):
        parameters.require_idle()
    assert station.module.restarts == 0
    assert station.module.parameters["axis0.encoder.config.use_index_offset"] == 0


def test_the_errors_of_the_axis_are_reported_and_cleared():
    station, _, parameters = opened()
    assert parameters.axis_error == 0
    station.module.axis.estop()
    assert parameters.axis_error == 0x4000
    parameters.clear_errors()
    assert parameters.axis_error == 0
    station.module.dials.encoder_error = 4  # its cause remains, and so does the error of the axis
    with pytest.raises(NodeError, match=r"got the command to clear its errors, .* is 00000100h"):
        parameters.clear_errors()
