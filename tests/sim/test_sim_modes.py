"""Velocity, torque, homing and the cyclic modes of the simulated drive, with times and places worked out by hand."""

from __future__ import annotations

import pytest

from axisbus.errors import SdoAbort
from axisbus.sim.motor import MotorParams
from kit.sim.rig import BIT_10, BIT_12, BIT_13, CSP, CST, CSV, HM, LIMIT, PP, PV, TQ, Rig

HALT = 0x100


# Profile velocity.


def test_velocity_ramps_with_6083_and_6084_within_one_percent():
    rig = Rig(x606D=0, x606E=0).enable(PV)
    rig.drive.target_velocity = 50_000
    assert rig.until(lambda: rig.drive.axis.velocity == 50_000.0) == pytest.approx(0.5, rel=0.01)
    rig.drive.target_velocity = 10_000
    assert rig.until(lambda: rig.drive.axis.velocity == 10_000.0) == pytest.approx(0.8, rel=0.01)
    rig.drive.target_velocity = -10_000  # down with 6084h, up again with 6083h
    assert rig.until(lambda: rig.drive.axis.velocity == -10_000.0) == pytest.approx(0.2 + 0.1, rel=0.01)


def test_velocity_bits_10_and_12_by_their_windows():
    rig = Rig(x606D=500, x606E=100, x606F=1_000, x6070=50).enable(PV)
    rig.run(0.2)
    assert rig.has(BIT_12)  # speed is zero
    rig.drive.target_velocity = 20_000
    assert rig.until(lambda: not rig.has(BIT_12)) == pytest.approx(0.01 + 0.05, abs=0.01)
    rig.until(lambda: rig.drive.velocity >= 19_500)
    assert not rig.has(BIT_10)
    assert rig.until(lambda: rig.has(BIT_10)) == pytest.approx(0.1, abs=0.01)
    rig.drive.target_velocity = 0
    rig.run(0.05)
    assert not rig.has(BIT_10)
    rig.until(lambda: rig.has(BIT_12))
    assert abs(rig.drive.velocity) <= 1_000


def test_a_halt_stops_a_velocity_and_the_motion_continues_after_it():
    rig = Rig().enable(PV)
    rig.drive.target_velocity = 20_000
    rig.run(0.5)
    rig.word(0x0F | HALT)
    assert rig.until(lambda: rig.drive.axis.velocity == 0.0) == pytest.approx(0.4, abs=0.01)
    rig.run(0.1)
    assert rig.has(BIT_10)
    rig.word(0x0F)
    rig.run(0.5)
    assert rig.drive.velocity == 20_000


def test_velocity_without_acceleration_does_not_get_on():
    rig = Rig(x6083=0, x6084=0).enable(PV)
    rig.drive.target_velocity = 20_000
    rig.run(0.5)
    assert rig.drive.position == 0


def test_velocity_beyond_607fh_saturates_and_sets_the_limit_bit():
    rig = Rig(x607F=15_000).enable(PV)
    rig.drive.target_velocity = 50_000
    rig.run(1.0)
    assert rig.drive.velocity == 15_000
    assert rig.has(LIMIT)


def test_velocity_polarity_turns_the_direction():
    rig = Rig(x607E=0x40).enable(PV)
    rig.drive.target_velocity = 10_000
    rig.run(1.0)
    assert rig.drive.velocity == 10_000
    assert rig.drive.position < 0


def test_a_limit_switch_stops_the_motion_towards_it_only():
    rig = Rig(params=MotorParams(limit_switches=(-5_000, 5_000))).enable(PV)
    rig.drive.target_velocity = 10_000
    rig.run(2.0)
    assert 5_000 <= rig.drive.position < 5_400  # stopped on the quick-stop ramp
    assert rig.has(LIMIT)
    assert rig.read(0x60FD) == 0b010
    rig.drive.target_velocity = -10_000
    rig.run(0.3)
    assert rig.drive.position < 5_000
    assert not rig.has(LIMIT)


def test_a_motor_held_in_velocity_mode_does_not_catch_up():
    rig = Rig().enable(PV)
    rig.drive.target_velocity = 10_000
    rig.run(0.5)
    rig.dials.blocked = True
    rig.run(2.0)
    assert rig.drive.velocity == 0
    assert rig.drive.torque == 2_000  # at its limit
    assert rig.has(LIMIT)
    rig.dials.blocked = False
    fastest = 0
    for _ in range(500):
        rig.run(rig.dt)
        fastest = max(fastest, rig.drive.velocity)
    assert fastest < 10_500
    assert rig.drive.velocity == pytest.approx(10_000, rel=0.01)


def test_velocity_units_are_the_drives_own():
    # velocity in rpm of a motor with 4096 increments per turn
    rig = Rig(params=MotorParams(velocity_unit=60 / 4096, acceleration_unit=60 / 4096), x6083=6_000).enable(
        PV
    )
    rig.drive.target_velocity = 300
    rig.run(0.5)
    assert rig.drive.velocity == 300
    before = rig.drive.position
    rig.run(1.0)
    assert rig.drive.position - before == pytest.approx(5 * 4096, abs=2)


# Torque.


def test_torque_rises_on_its_slope_and_drives_the_motor():
    rig = Rig(params=MotorParams(friction=0, coasting=0.1)).enable(TQ)
    rig.drive.target_torque = 200
    assert rig.until(lambda: rig.drive.torque == 200) == pytest.approx(0.2, rel=0.01)  # 1000 ‰/s
    assert rig.has(BIT_10)
    rig.run(1.0)
    # without acceleration, viscous friction: v = torque · gain · time constant = 200 · 2000/s² · 0.1 s
    assert rig.drive.velocity == pytest.approx(40_000, rel=0.01)


def test_torque_is_limited_by_6072():
    rig = Rig(x6072=150).enable(TQ)
    rig.drive.target_torque = 900
    rig.run(1.0)
    assert rig.drive.torque == 150
    assert rig.has(LIMIT)
    assert not rig.has(BIT_10)


@pytest.mark.parametrize("limit", [150, -150])
def test_torque_is_limited_by_60e1_with_either_sign(limit):
    rig = Rig(x6087=100_000).enable(TQ)
    rig.drive.axis.settings.negative_torque_limit = limit
    rig.drive.target_torque = -900
    rig.run(0.5)
    assert rig.drive.torque == -150
    rig.drive.target_torque = 0
    rig.run(0.5)
    assert rig.drive.torque == 0


def test_torque_slope_0_does_not_get_on_and_halt_takes_the_torque_away():
    rig = Rig(x6087=0).enable(TQ)
    rig.drive.target_torque = 100
    rig.run(0.2)
    assert rig.drive.torque == 0
    rig.write(0x6087, 1_000)
    rig.run(0.2)
    assert rig.drive.torque == 100
    rig.word(0x0F | HALT)
    rig.run(0.2)
    assert rig.drive.torque == 0


@pytest.mark.parametrize("leave", ["mode", "quick stop"])
def test_leaving_a_torque_mode_takes_the_motor_over_as_it_is(leave):
    rig = Rig(x605A=6, params=MotorParams(friction=0, coasting=0.1)).enable(TQ)
    rig.drive.target_torque = 100
    rig.run(1.0)
    speed = rig.drive.velocity
    assert speed == pytest.approx(20_000, rel=0.01)
    if leave == "mode":
        rig.drive.target_velocity = speed
        rig.drive.mode = PV
    else:
        rig.drive.controlword = 0x0002
    changes = []

    def note():
        changes.append(abs(rig.drive.velocity - (note.last if changes else speed)))
        note.last = rig.drive.velocity

    rig.run(0.02, note)
    assert max(changes) <= 420  # 400 000/s² of the quick-stop ramp, 1 ms steps
    assert not rig.drive.axis.motor.saturated


def test_torque_mode_begins_with_the_torque_that_holds_the_load():
    rig = Rig(params=MotorParams(load=300)).enable(PP)
    rig.run(3.0)
    stands = rig.drive.position
    rig.drive.target_torque = 300
    rig.drive.mode = TQ
    rig.run(1.0)
    assert rig.drive.position == stands


def test_friction_holds_a_small_torque():
    rig = Rig(params=MotorParams(friction=50)).enable(TQ)
    rig.drive.target_torque = 40
    rig.run(0.5)
    assert rig.drive.position == 0
    rig.drive.target_torque = 60
    rig.run(0.5)
    assert rig.drive.position > 0


# Homing.


def home(rig: Rig, method: int, limit: float = 20.0) -> float:
    rig.write(0x6098, method)
    rig.word(0x0F)
    rig.word(0x1F)
    assert rig.drive.statusword & (BIT_12 | BIT_13 | BIT_10) != BIT_12 | BIT_10 or method in (35, 37)
    return rig.until(lambda: rig.has(BIT_12) and rig.has(BIT_10), limit)


@pytest.mark.parametrize(("method", "switch"), [(17, -20_000), (18, 30_000)])
def test_home_on_a_limit_switch(method, switch):
    params = MotorParams(limit_switches=(-20_000, 30_000))
    rig = Rig(params=params, x607C=500).enable(HM)
    home(rig, method)
    # the switch's edge reads as the home offset; the axis came to rest on its free side
    assert rig.drive.position == pytest.approx(500 + rig.drive.axis.motor.position - switch, abs=1)
    assert (rig.drive.axis.motor.position - switch) * (1 if method == 17 else -1) > 0
    assert abs(rig.drive.axis.motor.position - switch) < 100
    assert abs(rig.drive.velocity) <= 1


def test_homing_on_a_limit_switch_from_on_top_of_it_moves_off_first():
    rig = Rig(params=MotorParams(start_position=-25_000, limit_switches=(-24_000, None))).enable(HM)
    lowest = 0
    rig.write(0x6098, 17)
    rig.word(0x1F)
    while not rig.has(BIT_12):
        rig.run(rig.dt)
        lowest = min(lowest, rig.drive.axis.motor.position)
    assert lowest == pytest.approx(-25_000, abs=1)


@pytest.mark.parametrize(("method", "index"), [(33, -4_096 + 100), (34, 100)])
def test_home_on_the_next_index_pulse(method, index):
    rig = Rig(params=MotorParams(increments_per_turn=4_096, index_offset=100)).enable(HM)
    home(rig, method)
    assert rig.drive.position == pytest.approx(rig.drive.axis.motor.position - index, abs=1)
    assert 0 < (rig.drive.axis.motor.position - index) * (1 if method == 34 else -1) < 100


@pytest.mark.parametrize("method", [35, 37])
def test_home_in_place_defines_the_position_without_motion(method):
    rig = Rig(params=MotorParams(start_position=1_234), x607C=-77).enable(HM)
    assert rig.drive.position == 1_234
    home(rig, method)
    assert rig.drive.position == -77
    assert rig.drive.axis.motor.position == 1_234
    rig.word(0x0F)
    rig.drive.mode = PP
    rig.run(0.01)
    rig.present(1_000)
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == 1_000


def test_homing_bits_from_start_to_end():
    rig = Rig(params=MotorParams(limit_switches=(-5_000, None))).enable(HM)
    bits = lambda: rig.drive.statusword & (BIT_10 | BIT_12 | BIT_13)  # noqa: E731
    assert bits() == BIT_10  # not started
    rig.write(0x6098, 17)
    rig.word(0x1F)
    rig.run(0.05)
    assert bits() == 0  # in progress
    rig.until(lambda: bits() == BIT_12)  # attained, still braking
    rig.until(lambda: bits() == BIT_12 | BIT_10)
    rig.word(0x0F)
    assert bits() == BIT_12 | BIT_10


def test_homing_is_interrupted_by_bit_4_and_by_halt():
    rig = Rig(params=MotorParams(limit_switches=(-100_000, None))).enable(HM)
    rig.write(0x6098, 17)
    rig.word(0x1F)
    rig.run(0.5)
    rig.word(0x0F)
    rig.run(0.5)
    assert rig.drive.velocity == 0
    assert rig.drive.statusword & (BIT_10 | BIT_12 | BIT_13) == BIT_10
    rig.word(0x1F)
    rig.run(0.5)
    assert rig.drive.velocity < 0
    rig.word(0x1F | HALT)
    rig.run(0.5)
    assert rig.drive.velocity == 0
    assert not rig.has(BIT_12)


@pytest.mark.parametrize("method", [1, 7, 19, 23, 36, -3])
def test_a_method_that_it_does_not_have_is_a_homing_error(method):
    rig = Rig().enable(HM)
    rig.write(0x6098, method)
    rig.word(0x1F)
    assert rig.has(BIT_13)


def test_a_switch_that_is_not_there_and_the_dial_are_homing_errors():
    rig = Rig().enable(HM)
    rig.write(0x6098, 18)
    rig.word(0x1F)
    assert rig.has(BIT_13)
    rig.word(0x0F)
    rig.dials.homing_fails = True
    rig.write(0x6098, 37)
    rig.word(0x1F)
    assert rig.has(BIT_13)


def test_homing_speed_0_does_not_get_on():
    rig = Rig(x6099_2=0).enable(HM)
    rig.write(0x6098, 34)
    rig.word(0x1F)
    rig.run(1.0)
    assert rig.drive.position == 0
    assert not rig.has(BIT_12)


# Cyclic modes. 60C2h is 10 ms in the test dictionary.


def cycles(rig: Rig, count: int, target, period: float = 0.01) -> None:
    """A master: every period a new target and a SYNC."""
    for number in range(count):
        rig.run(period)
        target(number)
        rig.drive.sync()


def test_csp_follows_a_ramp_and_runs_straight_between_two_syncs():
    rig = Rig().enable(CSP)

    def target(number):
        rig.drive.target_position = 100 * number

    cycles(rig, 50, target)
    positions = []
    rig.run(0.01, lambda: positions.append(rig.drive.position_demand))
    assert positions == [4_800 + 10 * step for step in range(1, 11)]
    assert rig.drive.velocity == pytest.approx(10_000, rel=0.01)
    assert rig.drive.position_demand - rig.drive.position == pytest.approx(20, abs=2)  # 2 ms of lag
    assert rig.has(BIT_12)


def test_a_drive_in_csp_holds_its_position_when_sync_stops():
    rig = Rig().enable(CSP)

    def target(number):
        rig.drive.target_position = 100 * number

    cycles(rig, 50, target)
    rig.drive.target_position = 999_999  # without SYNC this means nothing
    rig.run(0.5)
    assert rig.drive.position == 4_900
    assert rig.state == "operation enabled"


def test_csp_with_a_far_target_runs_into_a_following_error():
    rig = Rig(x6065=2_000, x6066=10).enable(CSP)
    rig.drive.target_position = 500_000
    rig.drive.sync()
    rig.until(lambda: rig.state.startswith("fault"), 1.0)
    assert rig.drive.error_code == 0x8611


def test_csp_is_limited_by_the_motors_speed():
    rig = Rig(x6080=60).enable(CSP)  # 16 384 increments/s
    rig.drive.target_position = 16_384
    rig.drive.sync()
    rig.run(0.5)
    assert rig.drive.position == pytest.approx(8_192, rel=0.02)
    assert rig.has(LIMIT)
    rig.run(0.6)
    assert rig.drive.position == 16_384


def test_csp_adds_the_offset_and_keeps_the_software_limits():
    rig = Rig(x607D_1=-1_000, x607D_2=1_000).enable(CSP)
    rig.write(0x60B0, 300)
    cycles(rig, 20, lambda number: setattr(rig.drive, "target_position", 10 * number))
    rig.run(0.05)
    assert rig.drive.position == 490
    rig.drive.target_position = 5_000
    rig.drive.sync()
    rig.run(0.1)
    assert rig.drive.position == 1_000
    assert rig.has(LIMIT)


def test_csp_halts_in_place_and_waits_for_the_next_target():
    rig = Rig().enable(CSP)
    cycles(rig, 50, lambda number: setattr(rig.drive, "target_position", 100 * number))
    rig.drive.controlword = 0x0F | HALT
    cycles(rig, 100, lambda _: setattr(rig.drive, "target_position", 4_900))
    assert rig.drive.velocity == 0
    assert not rig.has(BIT_12)
    assert rig.has(BIT_10)


def test_without_60c2_the_time_between_two_syncs_counts():
    rig = Rig(x60C2_1=0).enable(CSP)
    cycles(rig, 5, lambda number: setattr(rig.drive, "target_position", 80 * number), 0.008)
    rig.run(0.004)
    assert rig.drive.position_demand == 280


def test_csv_holds_the_last_velocity_and_cst_the_last_torque():
    rig = Rig().enable(CSV)
    cycles(rig, 20, lambda number: setattr(rig.drive, "target_velocity", 500 * number))
    rig.run(0.5)
    assert rig.drive.velocity == 9_500
    rig.drive.mode = CST
    rig.run(rig.dt)
    rig.drive.target_torque = 120
    rig.drive.sync()
    rig.run(0.5)
    assert rig.drive.torque == 120
    assert rig.drive.velocity > 9_500


def test_profile_and_cyclic_modes_are_taken_over_from_the_demand():
    rig = Rig(x6065=100, x6066=5).enable(PV)
    rig.drive.target_velocity = 20_000
    rig.run(0.5)
    rig.drive.mode = CSP
    last = rig.drive.position_demand
    for _ in range(20):
        rig.run(0.01)
        last += 200
        rig.drive.target_position = last
        rig.drive.sync()
    assert rig.state == "operation enabled"
    assert rig.drive.velocity == pytest.approx(20_000, rel=0.02)


# Choosing the mode.


def test_a_mode_that_6502_does_not_have_is_refused_by_sdo():
    rig = Rig().enable(PP)
    with pytest.raises(SdoAbort) as refused:
        rig.write(0x6060, 2)
    assert refused.value.code == 0x06090030
    rig.drive.mode = 2  # by PDO it is not followed
    rig.run(0.1)
    assert rig.read(0x6061) == PP


def test_the_mode_display_follows_late_or_never_according_to_the_fault_settings():
    rig = Rig().enable(PP)
    rig.dials.mode_delay = 0.2
    rig.write(0x6060, PV)
    assert rig.until(lambda: rig.drive.mode_display == PV) == pytest.approx(0.2, abs=0.01)
    rig.dials.modes_refused = frozenset({HM})
    rig.write(0x6060, HM)
    rig.run(1.0)
    assert rig.read(0x6060) == HM
    assert rig.read(0x6061) == PV


def test_a_drive_that_ignores_6060_during_halt_needs_it_again():
    rig = Rig(x606D=0, x606E=0).enable(PV)
    rig.dials.ignore_mode_during_halt = True
    rig.drive.controlword |= HALT
    rig.run(0.01)
    rig.drive.write_mode(PP)
    rig.run(0.05)
    assert rig.drive.mode_display == PV
    rig.drive.controlword &= ~HALT
    rig.run(0.05)
    assert rig.drive.mode_display == PV  # the value that was written is lost
    rig.drive.write_mode(PP)
    rig.run(0.01)
    assert rig.drive.mode_display == PP
    rig.dials.ignore_mode_during_halt = False
    rig.drive.controlword |= HALT
    rig.drive.write_mode(PV)
    rig.run(0.01)
    assert rig.drive.mode_display == PV
