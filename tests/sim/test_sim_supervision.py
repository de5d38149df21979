"""Stopping, faults, brake and load of the simulated drive."""

from __future__ import annotations

import math

import pytest

from axisbus.sim.motor import Motor, MotorParams
from axisbus.sim.ramp import plan_move, ramp_velocity
from kit.sim.rig import BIT_10, BIT_13, LIMIT, PP, PV, REMOTE, VOLTAGE, WARNING, Rig


def running(velocity: int = 40_000, params: MotorParams | None = None, **changes: int) -> Rig:
    """A drive in profile velocity mode at speed."""
    rig = Rig(params=params, **changes).enable(PV)
    rig.drive.target_velocity = velocity
    rig.until(lambda: rig.drive.velocity == velocity)
    return rig


# Quick stop: 40 000/s at 6084h = 50 000/s² is 0.8 s, at 6085h = 400 000/s² 0.1 s.


@pytest.mark.parametrize(
    ("option", "time", "ends_in"),
    [
        (1, 0.8, "switch on disabled"),
        (2, 0.1, "switch on disabled"),
        (3, 0.02, "switch on disabled"),
        (4, 0.02, "switch on disabled"),
        (5, 0.8, "quick stop active"),
        (6, 0.1, "quick stop active"),
        (7, 0.02, "quick stop active"),
        (8, 0.02, "quick stop active"),
    ],
)
def test_quick_stop_by_each_option(option, time, ends_in):
    rig = running(x605A=option)
    rig.word(0x0002)
    assert rig.state == "quick stop active"
    assert rig.until(lambda: rig.drive.axis.velocity == 0.0) == pytest.approx(time, abs=0.012)
    rig.run(0.1)
    assert rig.state == ends_in
    if option >= 5:
        assert rig.has(BIT_10)  # at standstill, energised
        rig.word(0x000F)
        assert rig.state == "operation enabled"


def test_quick_stop_option_0_lets_the_motor_coast():
    rig = running(x605A=0)
    rig.word(0x0002)
    assert rig.state == "switch on disabled"
    rig.run(0.1)
    # friction 20 ‰ · 2000/s² is 40 000/s², viscous 1/0.5 s: v = (v0 + 20 000)·e^(-0.2) - 20 000
    assert rig.drive.velocity == pytest.approx(60_000 * math.exp(-0.2) - 20_000, rel=0.01)
    assert rig.drive.torque == 0


def test_an_ignored_quick_stop_keeps_running():
    rig = running()
    rig.dials.ignore_quick_stop = True
    rig.word(0x0002)
    rig.run(0.5)
    assert rig.drive.velocity == 40_000
    assert rig.state == "operation enabled"


@pytest.mark.parametrize(("option", "brakes"), [(0, False), (1, True)])
def test_disable_operation_by_605c(option, brakes):
    rig = running(x605C=option)
    rig.word(0x0007)
    if brakes:
        assert rig.until(lambda: rig.state == "switched on") == pytest.approx(0.8, abs=0.05)
        assert rig.drive.velocity == 0
    else:
        assert rig.state == "switched on"
        assert rig.drive.velocity > 39_000


@pytest.mark.parametrize(("option", "brakes"), [(0, False), (1, True)])
def test_shutdown_by_605b(option, brakes):
    rig = running(x605B=option)
    rig.word(0x0006)
    time = rig.until(lambda: rig.state == "ready to switch on")
    assert time == pytest.approx(0.8 if brakes else 0.0, abs=0.05)
    assert (rig.drive.velocity == 0) is brakes


def test_without_any_deceleration_a_ramp_still_brakes():
    rig = running(x6084=0, x6085=0)
    rig.write(0x6083, 0)
    rig.word(0x0002)
    assert rig.until(lambda: rig.state == "switch on disabled") < 0.1


def test_disable_voltage_lets_the_motor_coast_at_once_unless_ignored():
    rig = running()
    rig.dials.ignore_disable_voltage = True
    rig.word(0x0000)
    assert rig.state == "operation enabled"
    rig.dials.ignore_disable_voltage = False
    rig.word(0x0000)
    assert rig.state == "switch on disabled"
    assert rig.drive.velocity > 39_000


# Faults.


def test_a_fault_brakes_according_to_605eh_and_is_reset_by_an_edge():
    rig = running(x605E=2)
    rig.drive.fault(0x2310, maker_bits=0x1_0000_0002)
    assert rig.state == "fault reaction active"
    assert rig.until(lambda: rig.state == "fault") == pytest.approx(0.1, abs=0.05)
    assert rig.drive.velocity == 0
    assert rig.read(0x603F) == 0x2310
    code, register, data = rig.drive.errors.take()[0]
    assert (code, register, data.hex()) == (0x2310, 0x03, "0200000001")
    rig.word(0x0000)
    rig.word(0x0080)
    assert rig.state == "switch on disabled"
    assert rig.read(0x603F) == 0
    assert rig.drive.errors.take() == [(0x0000, 0x00, bytes(5))]


def test_a_fault_with_option_0_coasts():
    rig = running(x605E=0)
    rig.drive.fault(0x3220)
    rig.run(0.01)
    assert rig.state == "fault"
    assert rig.drive.velocity > 35_000


def test_a_fault_that_persists_is_not_reset():
    rig = Rig()
    rig.run(0.05)
    rig.drive.fault(0x4310)
    rig.run(0.01)
    rig.dials.fault_persists = True
    rig.word(0x0080)
    assert rig.state == "fault"
    rig.dials.fault_persists = False
    rig.word(0x0080)
    assert rig.state == "fault"  # no edge
    rig.word(0x0000)
    rig.word(0x0080)
    assert rig.state == "switch on disabled"


def test_a_blocked_rotor_ends_in_a_following_error():
    rig = Rig().enable(PP)
    rig.present(50_000)
    rig.run(0.5)
    rig.dials.blocked = True
    stuck = rig.drive.position
    rig.until(lambda: rig.has(BIT_13), 1.0)
    assert rig.until(lambda: rig.state.startswith("fault"), 1.0) == pytest.approx(0.02, abs=0.005)  # 6066h
    assert rig.read(0x603F) == 0x8611
    assert rig.drive.position == pytest.approx(stuck, abs=1)
    rig.run(0.2)
    rig.dials.blocked = False
    rig.word(0x0080)
    rig.enable(PP)
    rig.present(20_000)
    rig.arrive()


def test_an_encoder_that_jumps_is_a_following_error():
    rig = Rig().enable(PP)
    rig.dials.encoder_jump = 2_000_000
    rig.run(0.1)
    assert rig.drive.error_code == 0x8611
    assert rig.dials.encoder_jump == 0


def test_a_fault_on_enabling_is_caused_by_the_fault_setting():
    rig = Rig()
    rig.dials.fault_on_enable = 0x7122
    rig.run(0.05)
    for word in (6, 7, 15):
        rig.drive.controlword = word
        rig.run(0.02)
    assert rig.state == "fault"
    assert rig.read(0x603F) == 0x7122


# The bits of the statusword beside the state.


def test_the_common_bits_of_the_statusword():
    rig = Rig()
    rig.run(0.05)
    assert rig.drive.statusword == 0x0040 | VOLTAGE | REMOTE
    rig.drive.warning = True
    rig.run(0.01)
    assert rig.has(WARNING)
    rig.dials.no_voltage = True
    rig.drive.controlword = 6
    rig.run(0.01)
    assert not rig.has(VOLTAGE)
    rig.drive.controlword = 7
    rig.run(0.1)
    assert rig.state == "ready to switch on"  # it does not switch on without voltage
    rig.dials.no_voltage = False
    rig.run(0.1)
    assert rig.state == "switched on"


def test_local_control_and_a_frozen_statusword():
    rig = Rig()
    rig.run(0.05)
    rig.dials.local_control = True
    rig.drive.controlword = 6
    rig.run(0.1)
    assert rig.drive.statusword == 0x0040 | VOLTAGE
    rig.dials.local_control = False
    rig.drive.controlword = 0
    rig.run(0.01)
    rig.dials.statusword_frozen = True
    for word in (6, 7, 15):
        rig.drive.controlword = word
        rig.run(0.05)
    assert rig.state == "switch on disabled"
    assert rig.drive.power.stage.name == "ENABLED"


def test_a_drive_may_be_found_enabled():
    rig = Rig()
    rig.drive.start_enabled(PV)
    rig.run(0.1)
    assert rig.state == "operation enabled"
    assert rig.read(0x6061) == PV
    assert rig.read(0x6040) == 0x000F


# A vertical axis.


def test_a_loaded_axis_sags_without_torque_and_holds_with_it():
    params = MotorParams(load=300)
    rig = Rig(params=params)
    rig.run(0.1)
    assert rig.drive.position < -1_000
    rig.enable(PP)  # it takes over a falling load, brakes it on 6084h, and holds
    rig.run(3.0)
    holds = rig.drive.position
    rig.run(1.0)
    assert rig.drive.position == holds
    assert rig.drive.torque == 300
    rig.word(0x0000)
    rig.run(0.1)
    assert rig.drive.position < holds - 1_000


def test_a_brake_holds_a_disabled_axis_and_closes_before_the_torque_ends():
    rig = Rig(params=MotorParams(load=300, brake=True, brake_opens=0.05, brake_closes=0.05))
    rig.run(0.5)
    assert rig.drive.position == 0
    rig.enable(PP)
    rig.present(1_000)
    rig.arrive()
    rig.run(0.2)
    rig.drive.controlword = 7
    assert rig.until(lambda: rig.state == "switched on") == pytest.approx(0.05, abs=0.01)
    rig.run(1.0)
    assert rig.drive.position == 1_000


def test_a_brake_after_coasting_catches_the_load_late():
    rig = Rig(params=MotorParams(load=300, brake=True, brake_closes=0.05)).enable(PP)
    rig.word(0x0000)
    rig.run(1.0)
    fallen = rig.drive.position
    # (300 - 20) ‰ · 2000/s² for 50 ms: 700 increments, and a little until it holds
    assert -900 < fallen < -600
    rig.run(1.0)
    assert rig.drive.position == fallen


def test_a_brake_is_late_when_a_held_quick_stop_is_cut_off():
    rig = Rig(params=MotorParams(load=300, brake=True, brake_closes=0.05), x605A=6).enable(PP)
    rig.word(0x0002)
    rig.run(0.5)
    assert rig.state == "quick stop active"
    held = rig.drive.position
    rig.word(0x0000)
    rig.run(1.0)
    assert held - 900 < rig.drive.position < held - 600


def test_torque_mode_drops_a_load_that_position_mode_holds():
    rig = Rig(params=MotorParams(load=300)).enable(4)
    rig.drive.target_torque = 0
    rig.run(1.0)
    assert rig.drive.position < -10_000


def test_an_end_stop_holds_the_motor():
    rig = Rig(params=MotorParams(end_stops=(None, 3_000))).enable(PP)
    rig.present(6_000)
    rig.run(1.0)
    assert rig.drive.position == 3_000
    assert rig.has(LIMIT)


# The parts alone.


@pytest.mark.parametrize("dt", [0.0001, 0.0005, 0.002, 0.01, 0.02])
def test_coasting_is_the_same_for_every_step_width(dt):
    motor = Motor(MotorParams(friction=20, coasting=0.5, load=0))
    motor.velocity = 40_000.0
    for _ in range(round(0.2 / dt)):
        motor.push(0.0, dt)
    assert motor.velocity == pytest.approx(60_000 * math.exp(-0.4) - 20_000, rel=1e-6)
    for _ in range(round(1.0 / dt)):
        motor.push(0.0, dt)
    assert motor.velocity == 0.0
    # integral of (v0 + 20 000)·e^(-2t) - 20 000 until standstill, at t = ln(3)/2
    stop = math.log(3) / 2
    assert motor.position == pytest.approx(60_000 / 2 * (1 - math.exp(-2 * stop)) - 20_000 * stop, rel=1e-6)


@pytest.mark.parametrize("dt", [0.0001, 0.001, 0.01, 0.02])
def test_the_tracking_error_is_speed_times_lag(dt):
    motor = Motor(MotorParams(lag=0.005))
    demand = 0.0
    for _ in range(round(0.5 / dt)):
        demand += 10_000 * dt
        motor.track(demand, dt, 3_000)
    assert motor.error == pytest.approx(50.0, rel=1e-3)
    assert motor.velocity == pytest.approx(10_000, rel=1e-3)


@pytest.mark.parametrize("dt", [0.0005, 0.002, 0.01, 0.02])
def test_a_step_of_the_demand_is_run_after_at_the_torque_limit_without_oscillating(dt):
    motor = Motor(MotorParams(rated_acceleration=1e5))
    highest = 0.0
    for _ in range(round(3.0 / dt)):
        motor.track(20_000.0, dt, 1_000)
        assert abs(motor.torque) <= 1_000
        highest = max(highest, motor.position)
    assert motor.position == pytest.approx(20_000, abs=0.1)
    assert highest < 20_000 + 300


@pytest.mark.parametrize(
    ("start", "velocity", "target", "limit"),
    [
        (0, 0, 1_000, 500),
        (0, 0, -1_000, 500),
        (0, 400, 1_000, 500),
        (0, 900, 1_000, 500),
        (0, -300, 1_000, 500),
        (0, 400, 10, 500),
        (0, 0, 3, 500),
        (5.5, 123.4, 5.5, 500),
        (0, 0, 0, 500),
    ],
)
def test_a_planned_move_is_smooth_within_its_limits_and_exact(start, velocity, target, limit):
    profile = plan_move(start, velocity, target, limit, 1_000, 2_000)
    position, speed, dt = float(start), float(velocity), 0.001
    while not profile.done:
        before, speed_before = position, speed
        position, speed = profile.advance(dt)
        assert abs(speed - speed_before) <= 2_000 * dt * 1.01
        assert abs(position - before) <= max(limit, abs(velocity)) * dt * 1.01
    assert position == target
    assert speed == 0.0


def test_a_velocity_ramp_through_zero_uses_both_rates():
    # from 100 down at 50/s² (2 s), up to -100 at 200/s² (0.5 s)
    velocity, way = ramp_velocity(100.0, -100.0, 200.0, 50.0, 2.5)
    assert velocity == pytest.approx(-100.0)
    assert way == pytest.approx(100 * 2 / 2 - 100 * 0.5 / 2)
    assert ramp_velocity(0.0, 100.0, 0.0, 50.0, 1.0) == (0.0, 0.0)
