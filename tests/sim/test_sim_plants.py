"""Plants that resist, and drives that deviate from their objects: each plant parameter and fault setting alone."""

from __future__ import annotations

import math

import pytest

from axisbus.sim.compliant import CompliantMotor, make_motor
from axisbus.sim.motor import Motor, MotorParams
from kit.sim.rig import BIT_10, CSP, PP, PV, TQ, Rig

SOFT = MotorParams(stiffness=0.5, damping=0.2)  # 0.5 ‰ per increment: about 32 rad/s
LOADED = MotorParams(stiffness=0.5, damping=0.2, load=100.0)  # it droops by 200 increments
STEPS = [0.0001, 0.001, 0.007, 0.02]


def ramp_and_hold(motor: Motor, dt: float, seconds: float = 1.4) -> list[tuple[float, float]]:
    """Move a motor at 20 000 increments/s for 0.7 s, then hold; return time and position at every 0.14 s."""
    seen, time, demand = [], 0.0, motor.restart_tracking()
    begin = demand
    for number in range(1, round(seconds / dt) + 1):
        time = number * dt
        motor.track(begin + 20_000.0 * min(time, 0.7), dt, 3000.0)
        if math.isclose(time / 0.14, round(time / 0.14), abs_tol=1e-6):
            seen.append((round(time, 6), motor.position))
    return seen


# -- a motor on a spring -------------------------------------------------------------------------------------------------


def test_a_motor_without_stiffness_is_the_usual_one():
    assert type(make_motor(MotorParams())) is Motor
    assert type(make_motor(SOFT)) is CompliantMotor


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("params", [SOFT, LOADED], ids=["free", "loaded"])
def test_the_step_width_does_not_matter(params, dt):
    fine = dict(ramp_and_hold(make_motor(params), 0.0005))
    seen = ramp_and_hold(make_motor(params), dt)
    assert len(seen) >= 9
    for time, position in seen:
        assert position == pytest.approx(fine[time], abs=1.0)


@pytest.mark.parametrize("dt", STEPS)
def test_a_loaded_motor_droops_by_load_over_stiffness(dt):
    motor = make_motor(LOADED)
    demand = motor.restart_tracking()
    for _ in range(round(3.0 / dt)):
        motor.track(demand, dt, 3000.0)
    assert motor.position == pytest.approx(-200.0, abs=1e-6)
    assert motor.velocity == 0.0
    assert motor.torque == pytest.approx(100.0)
    assert motor.error == pytest.approx(200.0)


def test_a_soft_motor_oscillates_when_its_demand_stops():
    motor = make_motor(SOFT)
    ramp_and_hold(motor, 0.001, 0.7)
    place, speeds = 14_000.0, []
    for _ in range(300):
        motor.track(place, 0.001, 3000.0)
        speeds.append(motor.velocity)
    assert max(speeds) > 100.0
    assert min(speeds) < -100.0
    for _ in range(3000):
        motor.track(place, 0.001, 3000.0)
    assert (motor.position, motor.velocity) == (pytest.approx(place), 0.0)


def test_a_jammed_motor_pulls_with_the_force_of_its_spring_up_to_the_limit():
    motor = make_motor(SOFT)
    motor.restart_tracking()
    motor.blocked = True
    for _ in range(2):
        motor.track(1000.0, 0.01, 3000.0)
    assert (motor.velocity, motor.torque, motor.saturated) == (0.0, 500.0, False)
    motor.track(100_000.0, 0.01, 3000.0)
    assert (motor.position, motor.torque, motor.saturated) == (0.0, 3000.0, True)


@pytest.mark.parametrize("dt", STEPS)
def test_a_motor_with_little_torque_still_stops_at_its_target(dt):
    motor = make_motor(SOFT)
    motor.restart_tracking()
    for _ in range(round(20.0 / dt)):
        motor.track(5000.0, dt, 300.0)
    assert motor.position == pytest.approx(5000.0, abs=1.0)
    assert abs(motor.velocity) < 1.0


def test_an_enabled_drive_sags_and_shows_that_demand_and_actual_differ():
    rig = Rig(params=LOADED, x6065=0xFFFF_FFFF)
    rig.dials.blocked = True  # it is held by hand
    rig.enable(PP)
    rig.dials.blocked = False
    rig.run(2.0)
    assert (rig.read(0x6062), rig.read(0x6064)) == (0, -200)
    rig.present(10_000)
    rig.run(3.0)
    assert (rig.read(0x6062), rig.read(0x6064)) == (10_000, 9_800)


# -- forces that hold a motor --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("params", [MotorParams(), SOFT], ids=["stiff", "compliant"])
def test_a_motor_that_sticks_increases_its_torque_and_then_moves(params, dt):
    motor = make_motor(params)
    motor.sticks = 400.0
    way = motor.restart_tracking()
    while motor.velocity == 0.0:
        way += 1000.0 * dt
        motor.track(way, dt, 3000.0)
        assert way < 2000.0
    given = 787.0 if params.stiffness else 3.2  # the damper takes a little of it
    assert way == pytest.approx(given, abs=1.0 + 1000.0 * dt)
    for _ in range(round(3.0 / dt)):
        motor.track(way, dt, 3000.0)
    assert abs(motor.velocity) < 1.0
    assert motor.position == pytest.approx(way, abs=820.0)  # it may stick again, as far away as before


def test_a_motor_that_sticks_harder_than_its_torque_limit_never_moves():
    for params in (MotorParams(), SOFT):
        motor = make_motor(params)
        motor.sticks = 5000.0
        motor.restart_tracking()
        for _ in range(100):
            motor.track(100_000.0, 0.01, 3000.0)
        assert (motor.position, motor.velocity, motor.torque) == (0.0, 0.0, 3000.0)
        motor.push(2900.0, 0.1)
        assert motor.position == 0.0


def test_a_sticking_drive_does_not_slide_when_it_is_pushed():
    rig = Rig().enable(TQ)
    rig.dials.sticks = 300.0
    rig.drive.target_torque = 250
    rig.run(1.0)
    assert rig.drive.velocity == 0
    rig.drive.target_torque = 350
    rig.run(1.0)
    assert rig.drive.velocity > 0


# -- feedback ------------------------------------------------------------------------------------------------------------


def test_delayed_feedback_shows_an_earlier_position_of_the_motor():
    rig = Rig().enable(PV)
    rig.dials.feedback_delay = 0.1
    rig.drive.target_velocity = 10_000
    rig.run(2.0)
    behind = rig.drive.axis.motor.position - rig.drive.position
    assert behind == pytest.approx(1000.0, abs=2.0)
    rig.drive.target_velocity = 0
    rig.until(lambda: rig.drive.axis.motor.velocity == 0.0)
    assert rig.drive.velocity > 0
    rig.run(0.11)
    assert rig.drive.velocity == 0
    assert rig.drive.position == pytest.approx(rig.drive.axis.motor.position, abs=1)


@pytest.mark.parametrize(
    ("dial", "shown"), [("demand_frozen", 0), ("demand_is_actual", 5000), (None, 20_000)]
)
def test_the_value_of_6062h_of_a_jammed_drive(dial, shown):
    rig = Rig(x6065=0xFFFF_FFFF).enable(PP)
    if dial is not None:
        setattr(rig.dials, dial, True)
    rig.present(20_000)
    rig.until(lambda: rig.drive.axis.motor.position > 5000.0)
    rig.dials.blocked = True
    rig.run(3.0)
    assert rig.read(0x6062) == pytest.approx(shown, abs=200)


@pytest.mark.parametrize("shown", [False, True], ids=["hidden", "shown"])
@pytest.mark.parametrize("mode", [PP, PV, CSP])
def test_a_drive_that_creeps_moves_without_a_command_while_it_is_energised(mode, shown):
    rig = Rig(x6065=0xFFFF_FFFF).enable(mode)
    rig.dials.drift_velocity, rig.dials.creep_shown = 50.0, shown
    rig.run(2.0)
    assert rig.read(0x6064) == pytest.approx(100, abs=2)
    assert rig.read(0x6062) == pytest.approx(100 if shown else 0, abs=2)
    rig.drive.controlword = 0
    rig.run(2.0)
    rest = rig.drive.position
    rig.run(1.0)
    assert rig.drive.position == rest
    rig.dials.drift_velocity = 0.0
    rig.enable(mode)
    rig.run(1.0)
    assert rig.drive.position == rest  # it is enabled where it is


def test_bit_10_can_be_made_to_be_set_all_the_time():
    rig = Rig().enable(PP)
    rig.dials.target_reached_always = True
    rig.present(100_000)
    rig.run(0.5)
    assert rig.drive.velocity > 0
    assert rig.has(BIT_10)


# -- a will of its own ---------------------------------------------------------------------------------------------------


def test_a_drive_that_changes_its_mode_spontaneously_stays_there_until_the_fault_ends():
    rig = Rig().enable(PV)
    rig.drive.target_velocity = 10_000
    rig.run(1.0)
    rig.dials.spontaneous_mode = PP
    rig.run(0.002)
    assert (rig.drive.mode, rig.drive.mode_display) == (PV, PP)
    rig.drive.mode = CSP
    rig.run(1.0)
    assert rig.drive.mode_display == PP
    rig.dials.spontaneous_mode = None
    rig.run(0.01)
    assert rig.drive.mode_display == CSP


def test_a_drive_that_resumes_continues_to_its_last_set_point_when_enabled_again():
    rig = Rig().enable(PP)
    rig.present(100_000)
    rig.run(0.5)
    rig.drive.controlword = 0x07  # disable operation: it brakes first
    rig.until(lambda: rig.state == "switched on")
    rest = rig.drive.position
    rig.enable(PP)
    rig.run(1.0)
    assert rig.drive.position == rest  # as it should be
    rig.drive.controlword = 0x07
    rig.until(lambda: rig.state == "switched on")
    rig.dials.resumes_on_enable = True
    rig.enable(PP)
    rig.run(10.0)
    assert rig.drive.position == 100_000


def test_a_drive_that_resumes_turns_at_its_former_velocity_until_another_is_written():
    rig = Rig().enable(PV)
    rig.drive.target_velocity = 10_000
    rig.run(1.0)
    rig.drive.target_velocity = 0
    rig.run(1.0)
    rig.drive.controlword = 0x07
    rig.until(lambda: rig.state == "switched on")
    rig.dials.resumes_on_enable = True
    rig.enable(PV)
    rig.run(1.0)
    assert rig.drive.velocity == 10_000
    rig.drive.target_velocity = 1
    rig.run(0.01)
    rig.drive.target_velocity = 0
    rig.run(1.0)
    assert rig.drive.velocity == 0


# -- initial states: off and moving --------------------------------------------------------------------------------------


def test_a_drive_with_little_friction_coasts_far_when_its_power_is_cut():
    rig = Rig(params=MotorParams(friction=0.5, coasting=30.0)).enable(PV)
    rig.drive.target_velocity = 20_000
    rig.run(1.0)
    rig.drive.controlword = 0
    rig.run(2.0)
    assert rig.state == "switch on disabled"
    assert rig.drive.velocity > 15_000


def test_a_hanging_load_without_a_brake_falls_when_its_power_is_cut():
    rig = Rig(params=MotorParams(load=300.0))
    rig.dials.blocked = True
    rig.enable(PP)
    rig.dials.blocked = False
    rig.run(1.0)
    assert abs(rig.drive.position) < 2
    rig.drive.controlword = 0
    rig.run(0.5)
    assert rig.drive.position < -10_000
