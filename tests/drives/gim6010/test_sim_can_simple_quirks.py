"""Behaviour that owners saw of real modules: restarts, watchdogs, runaways, endpoints, changes of protocol."""

from __future__ import annotations

import json
import struct

import pytest

from axisbus.drives.gim6010.sim.constants import Firmware
from axisbus.drives.gim6010.sim.module import Module
from axisbus.drives.gim6010.sim.parameters import number_in, rows
from kit.sim.can_simple_module import (
    CLEAR,
    CLOSED_LOOP,
    DISABLE,
    ESTIMATES,
    IDLE,
    LIMITS,
    POS,
    REBOOT,
    RX_SDO,
    SAVE,
    SET_ID,
    SET_MODE,
    SET_STATE,
    TX_SDO,
    VEL,
    Bench,
    Wire,
    gim_eds,
)  # fmt: skip

BREAK = "can.config.break_timeout"
PROTOCOL = "can.config.protocol"
BUS_FAILED, WATCHDOG = 0x100000, 0x800


@pytest.fixture
def bench() -> Bench:
    made = Bench()
    made.run(0.01)
    return made


def error(bench: Bench) -> int:
    return int.from_bytes(bench.beats(bench.node)[-1][:4], "little")


# -- restarts ---------------------------------------------------------------------------------------------------------------------


def test_after_saving_the_module_restarts_silent_for_a_while_and_then_idle(bench):
    bench.order(SET_ID, 9)
    bench.order(SAVE)
    since = bench.now
    assert bench.send(9 << 5 | ESTIMATES, remote=True) == []
    bench.run(2.0)
    times = [frame.time for frame in bench.heard if frame.time > since]
    assert min(times) - since == pytest.approx(1.5, abs=0.01)
    assert bench.beats(9, since)[0][4:] == bytes([IDLE, 0x80, 0, 0])
    assert bench.module.restarts == 1


def test_unsaved_values_are_lost_and_a_restart_switches_the_power_off(bench):
    bench.order(LIMITS, 7.0, 9.0)
    bench.enable(2, 1)
    bench.order(VEL, 5.0, 0.0)
    bench.run(0.2)
    bench.order(SAVE)  # not while it is enabled
    assert bench.module.restarts == 0
    assert bench.module.energised
    bench.order(REBOOT)
    assert not bench.module.energised
    bench.run(3.0)
    assert bench.module.parameters["axis0.controller.config.vel_limit"] == 30.0
    assert bench.module.shaft.speed == 0.0
    bench.must_be_smooth()


def test_a_restart_loses_the_turns_and_may_change_the_origin(bench):
    bench.module.motor.position = 16384 * 3.25
    bench.order(REBOOT)
    bench.run(2.0)
    bench.enable()
    assert bench.floats(ESTIMATES)[0] == 0.25
    bench.order(SET_STATE, IDLE)
    bench.module.dials.branch = 0.142469
    for _ in range(2):
        bench.order(REBOOT)
        bench.run(2.0)
    bench.enable()
    assert bench.floats(ESTIMATES)[0] == pytest.approx(0.25 + 0.142469)


def test_a_module_without_can_or_at_another_bit_rate_is_silent(bench):
    bench.order(DISABLE)
    assert bench.module.restarts == 1
    bench.run(2.0)
    bench.heard.clear()
    bench.run(1.0)
    assert bench.heard == []
    other = Bench(Module(5, baud_rate=1_000_000))
    other.module.dials.line_bitrate = 500_000
    other.run(0.5)
    assert other.heard == other.send(0xA9, remote=True) == []


# -- detection of the loss of the master ------------------------------------------------------------------------------------------


def test_a_break_timeout_latches_and_closed_loop_is_then_refused_in_silence(bench):
    bench.module.usb_write(BREAK, 200)
    bench.order(POS, 0.0, 0, 0)
    bench.enable(3, 3)
    for _ in range(50):
        bench.order(POS, 0.1, 0, 0)
        bench.run(0.01)
    assert bench.module.energised
    for _ in range(40):  # nothing else feeds it
        bench.order(LIMITS, 20.0, 20.0)
        bench.ask(5, ESTIMATES)
        bench.run(0.01)
    assert not bench.module.energised
    bench.run(0.1)
    assert error(bench) == BUS_FAILED
    bench.order(CLEAR)
    bench.order(SET_STATE, CLOSED_LOOP)  # still armed, and not fed
    bench.run(0.1)
    assert bench.state == IDLE
    bench.module.usb_write(BREAK, 0)
    bench.order(CLEAR)
    bench.order(SET_STATE, CLOSED_LOOP)
    assert bench.state == CLOSED_LOOP


def test_a_break_timeout_is_armed_by_writing_it_also_in_idle(bench):
    bench.module.usb_write(BREAK, 500)
    bench.run(1.0)
    assert error(bench) == BUS_FAILED


@pytest.mark.parametrize(("firmware", "trips"), [("0.5.13", True), ("0.6.5", False)])
def test_the_watchdog_latches_if_the_firmware_has_one(firmware, trips):
    bench = Bench(Module(5, firmware=Firmware.read(firmware), watchdog_timeout=0.2, enable_watchdog=1))
    bench.order(SET_MODE, 3, 3)
    bench.order(SET_STATE, CLOSED_LOOP)
    bench.run(0.5)
    assert bench.state == (IDLE if trips else CLOSED_LOOP)
    assert error(bench) == (WATCHDOG if trips else 0)


def test_with_neither_a_dead_master_is_not_noticed(bench):
    bench.enable(2, 2)
    bench.order(VEL, 2.0, 0.0)
    bench.run(5.0, 0.005)
    assert bench.module.shaft.speed == pytest.approx(2.0)


# -- the runaway ------------------------------------------------------------------------------------------------------------------


def test_in_passthrough_a_module_runs_away_when_set_points_pause_and_disarms(bench):
    bench.order(LIMITS, 20.0, 40.0)
    bench.enable(3, 1)
    bench.run(2.0, 0.005)
    assert bench.module.position == 0.0  # without a set-point it holds its position
    for _ in range(20):
        bench.order(POS, 0.5, 0, 0)
        bench.run(0.02)
    assert bench.module.position == pytest.approx(0.5, abs=0.01)
    bench.run(1.5)
    assert min(plant.velocity for plant in bench.plant) == pytest.approx(-20.0, rel=0.01)
    assert bench.module.position < -3.0
    assert not bench.module.energised
    assert bench.state == IDLE
    assert error(bench) == 0x40
    bench.must_be_smooth()


@pytest.mark.parametrize(
    ("inputs", "armed", "dial"), [(3, 0, 0.5), (5, 0, 0.5), (1, 5000, 0.5), (1, 0, None)]
)
def test_other_modes_an_armed_timeout_and_the_dial_hold_it(inputs, armed, dial):
    bench = Bench(break_timeout=armed)
    bench.module.dials.runaway_after = dial
    bench.enable(3, inputs)
    bench.order(POS, 0.05, 0, 0)
    bench.run(3.0, 0.005)
    assert bench.module.position == pytest.approx(0.05, abs=0.01)
    assert bench.module.energised


# -- faults -----------------------------------------------------------------------------------------------------------------------


def test_too_little_voltage_is_latched_beyond_its_cause(bench):
    bench.enable()
    bench.module.dials.bus_voltage = 11.0
    bench.run(0.01)
    assert not bench.module.energised
    bench.order(CLEAR)
    bench.run(0.11)
    assert bench.beats(5)[-1][:6] == bytes.fromhex("40000000 01 89")  # its cause persists
    bench.module.dials.bus_voltage = 24.0
    bench.run(0.11)
    assert error(bench) == 0x40
    bench.order(CLEAR)
    bench.run(0.11)
    assert error(bench) == 0


@pytest.mark.parametrize(("dial", "axis"), [("encoder_error", 0x100), ("motor_error", 0x40)])
def test_a_fault_from_outside_disarms(bench, dial, axis):
    bench.enable(2, 1)
    bench.order(VEL, 5.0, 0.0)
    bench.run(0.1)
    setattr(bench.module.dials, dial, 4)
    bench.run(0.11)
    assert error(bench) == axis
    assert not bench.module.energised
    bench.must_be_smooth()


def test_heat_and_a_frozen_encoder(bench):
    bench.enable(2, 1)
    bench.order(VEL, 5.0, 0.0)
    bench.module.dials.encoder_frozen = True
    bench.run(0.2)
    first = bench.floats(ESTIMATES)
    bench.run(0.1)
    assert bench.floats(ESTIMATES) == first
    assert bench.module.shaft.speed > 4.0
    bench.module.dials.temperature = 120.0
    bench.run(0.11)
    assert error(bench) == 0x40040
    bench.module.dials.dead = True
    bench.heard.clear()
    bench.run(0.5)
    assert bench.heard == []


# -- endpoints --------------------------------------------------------------------------------------------------------------------


def read(bench: Bench, number: int) -> list[bytes]:
    return [frame.data for frame in bench.send(bench.node << 5 | RX_SDO, struct.pack("<BHxI", 0, number, 0))]


def write(bench: Bench, number: int, form: str, value: float, command: int = RX_SDO) -> None:
    assert (
        bench.send(bench.node << 5 | command, struct.pack("<BHx" + form, 1, number, value).ljust(8, b"\0"))
        == []
    )


def test_endpoints_are_read_on_one_command_and_written_on_both(bench):
    write(bench, 73, "H", 250)
    assert read(bench, 73) == [bytes.fromhex("00 4900 00 FA000000")]
    write(bench, 288, "f", 12.5, TX_SDO)  # vel_limit in the list of 0.5.13
    assert bench.module.parameters["axis0.controller.config.vel_limit"] == 12.5
    bench.module.dials.endpoint_answer = TX_SDO
    (answer,) = bench.send(0xA4, struct.pack("<BHxI", 0, 288, 0))
    assert answer == (bench.now, 0xA5, struct.pack("<BHxf", 0, 288, 12.5))
    assert read(bench, 999) == []
    assert bench.send(0xA4, bytes(7)) == []


def test_many_modules_answer_no_endpoint_and_execute_no_endpoint_write(bench):
    bench.module.dials.endpoints = False
    write(bench, 73, "H", 250)
    assert read(bench, 73) == []
    assert bench.module.parameters[BREAK] == 0


def test_the_list_names_every_endpoint_once_and_differs_between_versions():
    numbers = {}
    for firmware in ("0.5.13", "0.6.0", "0.6.5"):
        text = json.dumps(Module(1, firmware=Firmware.read(firmware)).json())
        found: list[int] = []
        json.loads(
            text, object_hook=lambda one, found=found: found.append(one["id"]) if "id" in one else None
        )
        assert len(found) == len(set(found)) == len(rows()) + 2  # the root and an argument
        numbers[firmware] = found
    assert numbers["0.5.13"] != numbers["0.6.0"] != numbers["0.6.5"]
    published = {
        "0.5.13": (134, 139, 176, 288, 352),
        "0.6.0": (137, 142, 179, 297, 366),
        "v8": (138, 143, 180, 301, 390),
    }
    for name, wanted in published.items():
        assert tuple(number_in(name, number) for number in published["v8"]) == wanted
    assert [number_in("0.6.0", number) for number in (507, 509, 510)] == [478, 480, 481]


def test_a_number_of_another_list_may_erase_the_calibration():
    bench = Bench(Module(5, firmware=Firmware(0, 6, 0)))
    bench.run(0.01)
    write(bench, 480, "I", 0)  # erase_configuration here
    bench.run(2.0)
    wire = bench.module
    wire.axis.request(CLOSED_LOOP)
    assert not wire.energised
    assert wire.axis.error == 1


def test_a_function_takes_its_argument_from_the_number_behind_it(bench):
    number = bench.module.endpoints.number("axis0.encoder.set_linear_count")
    write(bench, number + 1, "i", -16384)
    write(bench, number, "I", 0)
    assert bench.module.usb_read("axis0.encoder.pos_estimate") == -1.0


# -- protocols --------------------------------------------------------------------------------------------------------------------


def test_a_module_becomes_a_canopen_drive_on_the_same_motor_and_changes_back():
    bench = Bench(Module(0, eds=gim_eds()))
    bench.run(0.01)
    bench.order(SET_ID, 5)
    bench.module.motor.position = 16384 * 1.5
    write(bench, 70, "B", 2)
    bench.run(0.1)
    assert bench.beats(5)  # not before it was saved
    bench.order(SAVE)
    since = bench.now
    bench.run(2.0)
    new = [frame for frame in bench.heard if frame.time > since]
    assert (new[0].can_id, new[0].data) == (0x705, b"\0")
    assert all(frame.can_id & 0x7F == 5 for frame in new)
    bench.send(0x605, bytes.fromhex("40 64 60 00 00000000"))
    bench.run(0.02)
    answers = [frame.data for frame in bench.heard if frame.can_id == 0x585]
    assert answers == [bytes.fromhex("43 64 60 00") + (24576).to_bytes(4, "little")]
    assert bench.module.position == 1.5
    bench.module.usb_write(PROTOCOL, 1)
    bench.module.usb_call("save_configuration")
    since = bench.now
    bench.run(2.0)
    assert bench.beats(5, since)
    assert bench.module.device is None
    bench.enable()
    assert bench.module.position == 1.5


def test_with_node_id_0_it_is_silent_in_canopen_until_usb_helps():
    bench = Bench(Module(0, eds=gim_eds(), protocol=2))
    bench.run(1.0)
    assert bench.heard == bench.send(0x600, bytes(8)) == []
    bench.module.usb_write("axis0.config.can.node_id", 3)
    bench.module.usb_call("save_configuration")
    bench.run(2.0)
    assert bench.heard[0].can_id == 0x703


def test_the_protocol_may_be_writable_by_usb_alone(bench):
    bench.module.dials.protocol_by_usb = True
    write(bench, 70, "B", 2)
    assert read(bench, 70)[0][4] == 1
    bench.module.usb_write(PROTOCOL, 2)
    assert read(bench, 70)[0][4] == 2


def test_a_module_of_the_29_bit_protocol_only_sends_its_heartbeat_and_ignores_all_frames():
    wire = Wire([Module(1, firmware=Firmware(0, 6, 8)), Module(0, firmware=Firmware(0, 6, 9))])
    wire.run(1.0)
    assert {frame.can_id for frame in wire.heard} == {0x1920_0404}
    assert (0x1920_0404 >> 18) & 0xFF == 0x48
    assert 9 <= len(wire.heard) <= 11
    assert wire.command(1, SET_STATE, CLOSED_LOOP) == []
    assert not any(module.energised for module in wire.modules)
