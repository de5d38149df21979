"""A simulated module as the manual says: each command of CAN Simple, each answer, each heartbeat, in virtual time."""

from __future__ import annotations

import math
import struct
from itertools import pairwise

import pytest

from axisbus.drives.gim6010.sim import protocol
from axisbus.drives.gim6010.sim.constants import Firmware
from axisbus.drives.gim6010.sim.module import Module
from kit.sim.can_simple_module import (
    BUS,
    CLEAR,
    CLOSED_LOOP,
    COUNT,
    ESTIMATES,
    ESTOP,
    GET_ERROR,
    HEARTBEAT,
    IDLE,
    IQ,
    LIMITS,
    LINEAR,
    POS,
    POS_GAIN,
    POWERS,
    REBOOT,
    SET_ID,
    SET_MODE,
    SET_STATE,
    TORQUE,
    TORQUES,
    TRAJ_ACCEL,
    TRAJ_INERTIA,
    TRAJ_VEL,
    VEL,
    VEL_GAINS,
    Bench,
    Wire,
)  # fmt: skip

CONTROLLER = "axis0.controller.config."


@pytest.fixture
def bench() -> Bench:
    made = Bench()
    made.run(0.01)
    return made


# -- messages sent unasked --------------------------------------------------------------------------------------------------------


def test_a_module_sends_its_heartbeat_and_position_with_the_periods_of_the_factory(bench):
    bench.run(1.0)
    beats = [frame.time for frame in bench.heard if frame.can_id == 0x0A1]
    estimates = [frame.time for frame in bench.heard if frame.can_id == 0x0A9]
    assert len(beats) in (10, 11)
    assert [after - before for before, after in pairwise(beats)] == pytest.approx([0.1] * (len(beats) - 1))
    assert len(estimates) in (100, 101, 102)
    assert {frame.command for frame in bench.heard} == {HEARTBEAT, ESTIMATES}


def test_other_messages_are_sent_at_their_configured_periods():
    bench = Bench(
        heartbeat_rate_ms=0, encoder_rate_ms=0, iq_rate_ms=20, bus_vi_rate_ms=50, encoder_count_rate_ms=10,
        motor_error_rate_ms=100, encoder_error_rate_ms=100, controller_error_rate_ms=100,
    )  # fmt: skip
    bench.run(0.2)
    count = {
        command: sum(f.command == command for f in bench.heard)
        for command in {f.command for f in bench.heard}
    }
    assert count == {IQ: 10, BUS: 4, COUNT: 20, GET_ERROR: 6}
    assert [len(f.data) for f in bench.heard if f.command == GET_ERROR][:3] == [8, 4, 4]


# Layouts of the heartbeat, byte for byte: firmware, then the frame with errors of motor, encoder, controller and system.
@pytest.mark.parametrize(
    ("firmware", "fine", "faulty"),
    [
        ("0.5.11", "00000000 01 00 00 80", "00000000 01 01 01 81"),
        ("0.5.12", "00000000 01 80 00 00", "00000000 01 87 00 00"),
        ("0.5.13", "00000000 01 80 00 00", "00000000 01 8F 00 00"),
        ("0.6.5", "00000000 01 80 00 00", "00000000 01 8F 00 00"),
    ],
)
def test_the_heartbeat_has_three_layouts(firmware, fine, faulty):
    for frame, broken in ((fine, False), (faulty, True)):
        bench = Bench(Module(5, firmware=Firmware.read(firmware)))
        if broken:
            axis = bench.module.axis
            axis.motor_error, axis.encoder_error = type(axis.motor_error)(1), type(axis.encoder_error)(1)
            axis.controller_error, axis.system_error = (
                type(axis.controller_error)(1),
                type(axis.system_error)(2),
            )
        bench.run(0.001)
        beat = bytearray(bench.beats(5)[0])
        beat[:4] = bytes(4)
        assert beat == bytes.fromhex(frame)


def test_the_life_counter_counts_heartbeats_and_begins_again(bench):
    bench.module.parameters["axis0.config.can.heartbeat_rate_ms"] = 1
    bench.run(0.6)
    lives = [beat[7] for beat in bench.beats(5)]
    assert lives[:260] == [number % 256 for number in range(260)]


def test_the_old_layout_may_have_its_done_bit_elsewhere_and_flags_may_be_turned_round():
    bench = Bench(Module(5, firmware=Firmware(0, 5, 11)))
    bench.module.dials.done_bit = 3
    bench.module.dials.flags_inverted = True
    bench.run(0.001)
    assert bench.beats(5)[0] == bytes.fromhex("00000000 01 01 01 09")


# -- requests ---------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", [ESTIMATES, COUNT, IQ, BUS, TORQUES, POWERS])
def test_a_request_is_a_remote_frame_or_eight_bytes_and_nothing_else(bench, command):
    by_remote = bench.send(0xA0 | command, remote=True)
    assert [(f.can_id, len(f.data)) for f in by_remote] == [(0xA0 | command, 8)]
    assert bench.send(0xA0 | command, bytes(8)) == by_remote
    assert bench.send(0xA0 | command, bytes(7)) == bench.send(0xA0 | command) == []
    assert bench.send(0xC0 | command, remote=True) == []  # another node's


@pytest.mark.parametrize(("kind", "size"), [(0, 8), (1, 4), (3, 4), (4, 4)])
def test_get_error_needs_its_type(bench, kind, size):
    axis = bench.module.axis
    words = {0: "motor_error", 1: "encoder_error", 3: "controller_error", 4: "system_error"}
    setattr(axis, words[kind], type(getattr(axis, words[kind]))(2))
    (answer,) = bench.send(0xA3, bytes([kind, *bytes(7)]))
    assert answer == (bench.now, 0xA3, (2).to_bytes(size, "little"))
    assert bench.send(0xA3, remote=True) == bench.send(0xA3) == bench.send(0xA3, bytes([2, *bytes(7)])) == []
    bench.module.dials.get_error_answered = False
    assert bench.send(0xA3, bytes([kind, *bytes(7)])) == []


def test_the_supply_is_reported(bench):
    bench.module.dials.bus_voltage = 36.5
    assert bench.floats(BUS) == (36.5, 0.0)


def test_current_torque_and_power_of_a_turning_motor_are_reported(bench):
    bench.enable(2, 1)
    bench.order(VEL, 10.0, 0.0)
    bench.run(0.4)
    setpoint, measured = bench.floats(IQ)
    asked, torque = bench.floats(TORQUES)
    electrical, mechanical = bench.floats(POWERS)
    voltage, current = bench.floats(BUS)
    assert [asked, measured * 0.097] == pytest.approx([torque, torque], rel=1e-5)
    assert setpoint == pytest.approx(measured)
    assert measured > 0.0
    assert mechanical == pytest.approx(torque * 10.0 * 2 * math.pi, rel=1e-3)
    assert electrical > mechanical
    assert voltage * current == pytest.approx(electrical, rel=1e-5)


def test_the_reported_position_is_0_in_idle_and_the_count_is_not(bench):
    bench.module.motor.position = 16384 * 2.25
    assert bench.floats(ESTIMATES) == (0.0, 0.0)
    shadow, in_turn = struct.unpack("<ii", bench.ask(5, COUNT))
    assert in_turn == 4096
    assert shadow == 16384 * 2.25 + bench.module.dials.shadow_offset  # it is no position, as owners found
    bench.order(SET_STATE, CLOSED_LOOP)
    assert bench.floats(ESTIMATES)[0] == 2.25
    bench.order(SET_STATE, IDLE)
    assert bench.floats(ESTIMATES)[0] == 0.0
    bench.module.dials.dead_in_idle = False
    assert bench.floats(ESTIMATES)[0] == 2.25


# -- states -----------------------------------------------------------------------------------------------------------------------


def test_closed_loop_holds_the_present_position_and_idle_switches_the_power_off(bench):
    bench.order(POS, 50.0, 0, 0)  # taken in silence, and forgotten on enabling
    assert not bench.module.energised
    bench.enable()
    bench.run(0.3)
    assert bench.module.position == 0.0
    assert bench.state == CLOSED_LOOP
    bench.order(SET_STATE, IDLE)
    assert not bench.module.energised
    assert bench.state == IDLE


def test_an_unknown_state_is_an_error_and_takes_the_power_away(bench):
    bench.enable()
    bench.order(SET_STATE, 0)  # undefined: nothing
    assert bench.module.energised
    bench.order(SET_STATE, 99)
    assert bench.state == IDLE
    assert bench.beats(5)[-1][:4] == bytes([1, 0, 0, 0])


def test_a_calibration_shows_its_parts_turns_the_motor_and_never_shows_state_3(bench):
    bench.order(SET_STATE, 3)
    bench.run(12.0, 0.005)
    states = [beat[4] for beat in bench.beats(5)]
    assert list(dict.fromkeys(states)) == [1, 4, 7]
    assert states[-1] == IDLE
    assert max(plant.position for plant in bench.plant) == pytest.approx(1.0, abs=0.01)
    assert bench.module.position == pytest.approx(0.0, abs=0.01)


def test_the_emergency_stop_is_latched_until_errors_are_cleared(bench):
    bench.enable()
    bench.order(ESTOP)
    assert not bench.module.energised
    bench.order(SET_STATE, CLOSED_LOOP)
    assert bench.state == IDLE  # refused in silence
    assert bench.beats(5)[-1][:4] == bytes.fromhex("00400000")
    bench.order(CLEAR)
    bench.order(SET_STATE, CLOSED_LOOP)
    assert bench.state == CLOSED_LOOP


def test_a_module_can_be_made_to_ignore_the_command_for_closed_loop(bench):
    bench.module.dials.wont_start = True
    bench.order(SET_STATE, CLOSED_LOOP)
    assert bench.state == IDLE
    assert bench.beats(5)[-1][:4] == bytes(4)


# -- motion -----------------------------------------------------------------------------------------------------------------------


def test_the_manuals_example_of_velocity_control():
    bench = Bench(Module(0))
    bench.run(0.01)
    for can_id, data in (
        (0x00B, "0200000002000000"),
        (0x007, "0800000000000000"),
        (0x00D, "0000204100000000"),
    ):
        bench.send(can_id, bytes.fromhex(data))
    bench.run(2.0)
    assert bench.module.shaft.speed == pytest.approx(2.0, abs=0.01)  # 1 turn/s² from the factory
    bench.run(8.5)
    assert bench.module.shaft.speed == pytest.approx(10.0, abs=0.01)
    bench.must_be_smooth()


def test_the_manuals_example_of_position_control():
    bench = Bench(Module(0))
    bench.run(0.01)
    for can_id, data in (
        (0x00B, "0300000003000000"),
        (0x007, "0800000000000000"),
        (0x00C, "CDCC0C4000000000"),
    ):
        bench.send(can_id, bytes.fromhex(data))
    bench.run(8.0)
    assert bench.module.position == pytest.approx(2.2, abs=1e-4)
    assert max(plant.position for plant in bench.plant) < 2.2001  # the filter does not overshoot
    bench.must_be_smooth()


def test_a_trapezoid_keeps_its_limits_and_reports_its_end(bench):
    bench.order(TRAJ_VEL, 4.0)
    bench.order(TRAJ_ACCEL, 8.0, 16.0)
    bench.order(TRAJ_INERTIA, 0.001)
    bench.enable(3, 5)
    bench.order(POS, 6.0, 0, 0)
    bench.run(0.2)
    assert bench.module.shaft.speed == pytest.approx(8.0 * 0.2, rel=0.03)
    bench.run(0.4)
    assert bench.module.shaft.speed == pytest.approx(4.0, rel=1e-3)
    assert not bench.beats(5)[-1][5] & 0x80
    bench.run(6.0 / 4.0 + 0.25 + 0.125 - 0.6 + 0.02)
    assert bench.module.position == pytest.approx(6.0, abs=1e-3)
    bench.run(0.11)
    assert bench.beats(5)[-1][5] & 0x80
    assert bench.module.parameters[CONTROLLER + "inertia"] == pytest.approx(0.001)


def test_a_trapezoid_with_a_limit_of_0_moves_nothing_and_is_never_done(bench):
    bench.order(TRAJ_ACCEL, 0.0, 1.0)
    bench.enable(3, 5)
    bench.order(POS, 6.0, 0, 0)
    bench.run(0.5)
    assert bench.module.position == 0.0
    assert not bench.beats(5)[-1][5] & 0x80


def test_the_global_velocity_limit_holds_in_position_and_velocity_control(bench):
    bench.order(LIMITS, 3.0, 20.0)
    bench.enable(3, 1)
    bench.module.dials.runaway_after = None
    bench.order(POS, 6.0, 0, 0)
    bench.run(3.0)
    assert bench.module.position == pytest.approx(6.0, abs=1e-3)
    bench.order(SET_MODE, 2, 1)
    bench.order(VEL, -20.0, 0.0)
    bench.run(0.5)
    assert bench.module.shaft.speed == pytest.approx(-3.0)
    assert max(abs(plant.velocity) for plant in bench.plant) < 3.0001
    assert bench.module.axis.error == 0


def test_the_current_limit_is_that_of_the_torque(bench):
    bench.order(LIMITS, 30.0, 2.0)
    bench.module.dials.blocked = True
    bench.enable(1, 1)
    bench.order(TORQUE, 5.0)
    bench.run(0.1)
    assert bench.floats(IQ)[0] == pytest.approx(2.0)


def test_torque_turns_the_motor_and_too_fast_is_an_error(bench):
    bench.order(LIMITS, 5.0, 20.0)
    bench.enable(1, 1)
    bench.order(TORQUE, 0.2)
    bench.run(0.05)
    assert 0.0 < bench.module.shaft.speed < 5.0
    bench.run(0.4)
    assert bench.state == IDLE
    assert bench.beats(5)[-1][:6] == bytes.fromhex("00020000 01 84")
    assert bench.send(0xA3, bytes([3, *bytes(7)]))[0].data == bytes([1, 0, 0, 0])


def test_torque_mode_with_its_velocity_limit_does_not_run_away(bench):
    bench.module.usb_write(CONTROLLER + "enable_torque_mode_vel_limit", 1)
    bench.module.dials.runaway_after = None
    bench.order(LIMITS, 5.0, 20.0)
    bench.enable(1, 1)
    bench.order(TORQUE, 0.2)
    bench.run(1.0)
    assert 3.0 < bench.module.shaft.speed < 5.0
    assert bench.module.axis.error == 0


def test_a_torque_ramp_rises_evenly(bench):
    bench.module.usb_write(CONTROLLER + "torque_ramp_rate", 0.5)
    bench.module.dials.blocked = True
    bench.enable(1, 6)
    bench.order(TORQUE, 0.3)
    bench.run(0.2)
    assert bench.floats(TORQUES)[0] == pytest.approx(0.1, rel=0.02)
    bench.run(0.6)
    assert bench.floats(TORQUES)[0] == pytest.approx(0.3)


def test_gains_are_taken_and_without_them_there_is_no_force(bench):
    bench.order(POS_GAIN, 0.0)
    bench.enable(3, 1)
    bench.order(POS, 1.0, 0, 0)
    bench.run(0.3)
    assert bench.module.position == 0.0
    bench.order(SET_STATE, IDLE)
    bench.order(POS_GAIN, 20.0)
    bench.order(VEL_GAINS, 0.0, 0.0)
    bench.enable(3, 1)
    bench.order(POS, 1.0, 0, 0)
    bench.run(0.3)
    assert bench.module.position == 0.0
    bench.order(VEL_GAINS, 0.1, 0.0)
    bench.order(POS, 1.0, 0, 0)
    bench.run(0.4)
    assert bench.module.position == pytest.approx(1.0, abs=0.01)


def test_a_held_rotor_that_is_released_does_not_exceed_its_velocity(bench):
    bench.order(LIMITS, 4.0, 20.0)
    bench.order(TRAJ_VEL, 4.0)
    bench.order(TRAJ_ACCEL, 50.0, 50.0)
    bench.enable(3, 5)
    bench.module.dials.blocked = True
    bench.order(POS, 5.0, 0, 0)
    bench.run(3.0)
    assert bench.module.position == 0.0
    assert bench.floats(IQ)[0] > 5.0
    bench.module.dials.blocked = False
    bench.run(3.0)
    assert bench.module.position == pytest.approx(5.0, abs=1e-3)
    assert max(plant.velocity for plant in bench.plant) < 4.2


def test_a_mode_that_changes_during_a_move_does_not_jolt(bench):
    bench.enable(2, 1)
    bench.order(VEL, 10.0, 0.0)
    bench.run(0.4)
    before = bench.module.position
    bench.order(SET_MODE, 3, 1)
    bench.run(1.0)
    # It holds where the mode changed, but for the velocity of before, which is a feed-forward now: 10 turns/s by a gain of 20.
    assert bench.module.position == pytest.approx(before + 10.0 / 20.0, abs=0.01)
    assert bench.module.shaft.speed == pytest.approx(0.0, abs=1e-3)
    bench.must_be_smooth()


def test_an_invalid_mode_is_an_error_only_in_closed_loop(bench):
    bench.order(SET_MODE, 3, 4)
    bench.run(0.01)
    assert bench.module.axis.error == 0
    bench.order(SET_STATE, CLOSED_LOOP)
    bench.run(0.01)
    assert bench.send(0xA3, bytes([3, *bytes(7)]))[0].data == bytes([2, 0, 0, 0])
    assert not bench.module.energised


def test_a_set_point_that_is_no_number_disarms(bench):
    bench.enable(3, 3)
    bench.order(POS, math.nan, 0, 0)
    bench.run(0.01)
    assert not bench.module.energised
    assert bench.send(0xA3, bytes(8))[0].data == (0x10000).to_bytes(8, "little")


def test_a_linear_count_shifts_the_position(bench):
    bench.order(LINEAR, 16384 * 3)
    assert struct.unpack("<ii", bench.ask(5, COUNT)) == (16384 * 3, 0)
    bench.enable()
    assert bench.floats(ESTIMATES)[0] == 3.0
    assert bench.module.position == 0.0
    bench.must_be_smooth()


# -- MIT --------------------------------------------------------------------------------------------------------------------------

NEUTRAL = bytes.fromhex("80 00 80 00 00 00 08 00")


def test_a_mit_frame_changes_the_mode_but_does_not_enable(bench):
    (answer,) = bench.send(0xA8, NEUTRAL)
    assert answer.can_id == 0xA8
    assert answer.data == bytes.fromhex("05 7FFF 7FF 7FF 0000".replace(" ", ""))  # 0 is packed downwards
    assert (
        bench.module.parameters[CONTROLLER + "control_mode"],
        bench.module.parameters[CONTROLLER + "input_mode"],
    ) == (3, 9)
    bench.run(0.1)
    assert not bench.module.energised


def test_mit_control_moves_to_its_position_at_the_output_shaft(bench):
    bench.enable(3, 9)
    position, kp, kd = round((1.0 + 12.5) * 65535 / 25), round(100 * 4095 / 500), round(2.0 * 4095 / 5)
    bits = position << 48 | 2047 << 36 | kp << 24 | kd << 12 | 2047
    for _ in range(300):
        (answer,) = bench.send(0xA8, bits.to_bytes(8, "big"))
        bench.run(0.01)
    assert bench.module.position == pytest.approx(8.0 / (2 * math.pi), abs=0.1)
    assert struct.unpack(">H", answer.data[1:3])[0] * 25 / 65535 - 12.5 == pytest.approx(1.0, abs=0.08)
    bench.must_be_smooth()


def test_the_frame_of_zeros_is_full_negative_torque(bench):
    bench.enable(3, 9)
    bench.send(0xA8, bytes(8))
    bench.run(0.02)
    assert bench.floats(TORQUES)[0] == pytest.approx(
        -45 * 0.097
    )  # of -50/8 N·m, the part that the current limit allows
    assert bench.module.position < 0.0


def test_the_answer_wraps_as_the_firmware_does():
    def told(position: float, torque: float) -> tuple[float, float]:
        data = protocol.pack_answer(0, position, 0.0, torque, protocol.MitValues())
        raw = int.from_bytes(data[1:6], "big")
        return (raw >> 24) * 25 / 65535 - 12.5, (raw & 0xFFF) * 100 / 4095 - 50

    assert told(12.625, 50.5) == (pytest.approx(-12.376, abs=1e-3), pytest.approx(-49.5, abs=0.04))
    assert told(0.0, 0.0)[0] == pytest.approx(0.0, abs=1e-3)


def test_ranges_of_mit_are_parameters_from_060_on():
    full = (0xFFFF << 48 | 2048 << 36).to_bytes(8, "big")
    for firmware, target in (("0.5.13", 12.5), ("0.6.5", 3.0)):
        bench = Bench(Module(5, firmware=Firmware.read(firmware), mit_max_pos=3.0))
        bench.send(0xA8, full)
        assert bench.module.axis.controller.input_pos == pytest.approx(target * 8 / (2 * math.pi))


# -- node IDs ---------------------------------------------------------------------------------------------------------------------


def test_a_node_id_holds_at_once_and_until_it_is_saved_in_ram_alone(bench):
    bench.order(SET_ID, 64)
    assert bench.module.node_id == 5
    bench.order(SET_ID, 1)
    assert bench.module.node_id == 1
    assert bench.send(0xA9, remote=True) == []
    assert len(bench.ask(1, ESTIMATES)) == 8
    bench.order(REBOOT)
    bench.run(2.0)
    assert bench.module.node_id == 5


def test_two_with_one_node_id_both_answer_and_both_obey():
    wire = Wire([Module(0), Module(0)])
    wire.run(0.2)
    assert len(wire.beats(0)) == 4
    assert len(wire.send(0x009, remote=True)) == 2
    wire.command(0, SET_STATE, CLOSED_LOOP)
    assert all(module.energised for module in wire.modules)
    wire.command(0, SET_ID, 7)
    assert [module.node_id for module in wire.modules] == [7, 7]
