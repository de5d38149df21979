"""A module on Modbus by names: every write read back, errors with their words, saving, restarts, and another node ID."""

from __future__ import annotations

import pytest

from axisbus.drives.gim6010.modbus.dialogue import ModbusRefused
from axisbus.drives.gim6010.modbus.module import ModbusModule, look, set_node_id
from axisbus.drives.gim6010.modbus.registers import REGISTERS, RegisterKind
from axisbus.drives.gim6010.sim.modbus.station import Station, StationFaults
from axisbus.errors import ArgumentError, LimitError, NodeError, NodeTimeout, StateError
from kit.modbus.virtual_wire import VirtualWire


def line(*others, **dials):
    station = Station(dials=StationFaults(**dials))
    wire = VirtualWire(station, *others)
    return station, wire, ModbusModule(wire, 1)


@pytest.mark.parametrize("register", [each for each in REGISTERS if each.readable], ids=repr)
def test_every_value_is_read_as_the_simulated_drive_has_it(register):
    station, _, module = line(dead_in_idle=False)
    station.module.motor.position = 3.25 * 16384
    found = module.read(register.name)
    if register.field.path in station.module.parameters.values:
        assert found == pytest.approx(station.module.usb_read(register.field.path))
    assert isinstance(found, float) == (register.field.type.name == "float32")


def test_position_and_voltage_are_in_their_units():
    station, _, module = line(dead_in_idle=False)
    station.module.motor.position = 3.25 * 16384
    assert module.read("position_feedback") == 3.25
    assert module.read("bus_voltage") == 24.0
    assert module.state == 1


def test_a_position_that_may_be_outdated_is_not_reported():
    station, wire, module = line(dead_in_idle=False)
    station.module.motor.position = 3.25 * 16384
    assert module.read("position_feedback") == 3.25
    assert (look(module, 1).position, look(module, 1).velocity) == (None, None)
    station.module.usb_write("axis0.requested_state", 8)
    wire.sleep(0.1)
    assert look(module, 1).position == pytest.approx(3.25, abs=0.001)


SETTINGS = [each for each in REGISTERS if each.kind is RegisterKind.SETTING]


@pytest.mark.parametrize("register", SETTINGS, ids=repr)
@pytest.mark.parametrize(
    "fault", [{}, {"silent": 1}, {"deaf": 1}, {"wrong_checksum": 1}, {"late": {0: 0.3}}], ids=repr
)
def test_a_setting_is_written_once_and_read_back(register, fault):
    station, _, module = line(**fault)
    assert module.write(register.name, 12.25) == 12.25
    assert station.module.usb_read(register.field.path) == 12.25
    written = [frame for frame in station.frames if frame[1] == 0x10]
    assert len(written) == (2 if "deaf" in fault else 1)


def test_a_value_that_is_not_kept_is_reported():
    _, _, module = line(clamps={0x6C: 20.0})
    with pytest.raises(NodeError, match=r"velocity_limit holds 20 after 30\.5 was written"):
        module.write("velocity_limit", 30.5)


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("position_setpoint", 1.0, "axisbus move"),
        ("state_control", 8, "axisbus move"),
        ("emergency_stop", 1, "modbus stop"),
        ("node_id", 5, "set_node_id"),
        ("endpoint_value", 5, "--list"),
        ("position_feedback", 5.0, "read only"),
        ("speed", 5.0, "there are motor_state"),
    ],
)
def test_parameters_that_are_not_written_by_name(name, value, error):
    station, _, module = line()
    with pytest.raises(ArgumentError) as caught:
        module.write(name, value)
    assert error in caught.value.remedy
    assert station.frames == []


def test_limits_hold_and_modes_are_changed_in_idle_alone():
    station, _, module = line()
    with pytest.raises(LimitError):
        module.write("current_limit", 50.5)
    assert module.write("control_mode", 2) == 2
    station.module.usb_write("axis0.requested_state", 8)
    with pytest.raises(StateError, match="closed loop"):
        module.write("control_mode", 3)
    assert module.read("control_mode") == 2
    assert module.write("velocity_limit", 10.0) == 10.0


def test_errors_have_words_and_are_cleared():
    station, _, module = line()
    axis = station.module.axis
    assert not module.errors().lines
    axis.estop()
    axis.motor_error |= 1 << 35
    found = module.errors()
    assert found.lines
    assert found.flags == 0b10001
    assert found.words == {"motor": 1 << 35, "encoder": 0, "controller": 0, "system": 0, "axis": 0x4040}
    assert any(line.startswith("motor UNBALANCED_PHASES") for line in found.lines)
    assert any(line.startswith("axis ESTOP_REQUESTED") for line in found.lines)
    assert not module.clear_errors().lines
    station.module.dials.encoder_error = 4
    station.module.usb_write("axis0.requested_state", 8)
    station.step(1.0)
    assert "encoder NO_RESPONSE" in " ".join(module.clear_errors().lines)


def test_error_flags_without_their_words_and_reserved_bits_are_reported():
    from axisbus.drives.gim6010.modbus.module import ErrorWords

    lines = ErrorWords(0x0022, dict.fromkeys(("motor", "encoder", "controller", "system", "axis"), 0)).lines
    assert lines[0].startswith("encoder: its flag is up")
    assert "0x0020 are reserved" in lines[1]
    assert len(lines) == 2


def test_errors_are_not_cleared_under_power():
    station, _, module = line()
    station.module.usb_write("axis0.requested_state", 8)
    with pytest.raises(StateError):
        module.clear_errors()
    assert bytes.fromhex("01 06 00 7F 00 01") not in station.frames


@pytest.mark.parametrize("fault", [{}, {"silent": 2}], ids=repr)
def test_saving_restarts_and_is_waited_for(fault):
    station, wire, module = line(**fault)
    module.write("velocity_limit", 11.0)
    assert module.save() is True
    assert station.module.restarts == 1
    assert module.read("velocity_limit") == 11.0
    assert wire.time < 12.0


def test_a_module_that_restarts_sooner_than_that_can_be_seen_is_saved_twice():
    station, _, module = line()
    station.module.dials.restart_time = 0.3
    module.write("velocity_limit", 11.0)
    assert module.save() is True
    assert station.module.restarts == 2
    assert module.read("velocity_limit") == 11.0


def test_if_the_answer_to_saving_was_lost_it_is_saved_again():
    station, wire, module = line(save_restarts=False)
    wire.before = lambda request: setattr(station.dials, "silent", int(request.address == 0x80 and not saved))
    saved = []
    original = station.module.parameters.save
    station.module.parameters.save = lambda: (saved.append(1), original())
    assert module.save() is False
    assert len(saved) == 2


def test_a_firmware_that_saves_without_a_restart_is_reported():
    station, _, module = line(save_restarts=False)
    assert module.save() is False
    assert station.module.restarts == 0


def test_saving_under_power_is_refused():
    station, _, module = line()
    station.module.usb_write("axis0.requested_state", 8)
    for act in (module.save, lambda: set_node_id(module, 5)):
        with pytest.raises(StateError, match="closed loop"):
            act()
    assert station.module.restarts == 0
    assert station.address == 1


def test_a_module_that_does_not_return_is_reported():
    station, wire, module = line()
    wire.before = lambda request: setattr(
        station.module.dials, "dead", request.address == 0x80 or station.module.dials.dead
    )
    with pytest.raises(NodeTimeout, match="does not come back"):
        module.save()
    assert 20.0 < wire.time < 40.0


@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize("fault", [{}, {"silent": 1}, {"wrong_checksum": 1}], ids=repr)
def test_another_node_id_is_written_found_saved_and_found_again(at_once, fault):
    station, wire, module = line(node_id_at_once=at_once)

    def spoil(request):
        if request.writes and request.address == 0x62:
            for name, value in fault.items():
                setattr(station.dials, name, value)

    wire.before = spoil
    moved = set_node_id(module, 5)
    assert (moved.device, station.address) == (5, 5)
    assert station.module.restarts == 1
    assert moved.read("node_id") == 5


@pytest.mark.parametrize("at_once", [True, False])
def test_without_saving_the_module_is_addressed_by_the_id_that_it_answers(at_once):
    station, _, module = line(node_id_at_once=at_once)
    found = set_node_id(module, 5, save=False)
    assert found.device == (5 if at_once else 1)
    assert station.module.restarts == 0


def test_a_node_id_in_use_is_refused():
    station, _, module = line(Station(7))
    with pytest.raises(StateError, match="already answers to node ID 7"):
        set_node_id(module, 7)
    with pytest.raises(LimitError):
        set_node_id(module, 64)
    with pytest.raises(StateError, match="already has the node ID"):
        set_node_id(module, 1)
    assert bytes.fromhex("01 06 00 62 00 07") not in station.frames


def test_a_node_id_that_is_not_taken_is_reported():
    station, _, module = line(exceptions={(0x62, True): 3})
    with pytest.raises(ModbusRefused):
        set_node_id(module, 5)
    station.dials.exceptions.clear()
    station.dials.clamps[0x62] = 1
    station.dials.node_id_at_once = False
    with pytest.raises(NodeError, match="does not accept node ID 5"):
        set_node_id(module, 5)
