"""Profile position mode of the simulated drive: the handshake of CiA 402-2 10 and where the motor goes."""

from __future__ import annotations

import itertools
import math

import pytest

from axisbus.sim.drive import Drive
from axisbus.sim.fault_injection import NEVER
from axisbus.sim.motor import MotorParams
from kit.sim.eds import drive_eds
from kit.sim.rig import BIT_10, BIT_12, LIMIT, PP, PV, Rig

IMMEDIATELY, RELATIVE, HALT, ON_SET_POINT = 0x20, 0x40, 0x100, 0x200


@pytest.mark.parametrize("dt", [0.0001, 0.001, 0.004, 0.01, 0.02])
def test_a_move_lands_on_its_target_to_the_increment_and_stays(dt):
    rig = Rig(dt=dt).enable(PP)
    rig.present(100_000)
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == 100_000
    assert rig.drive.position_demand == 100_000
    assert rig.drive.velocity == 0


def test_a_move_takes_the_time_of_its_trapezoid():
    # 100 000 increments at 20 000/s, up at 100 000/s² (0.2 s), down at 50 000/s² (0.4 s): 5 s + 0.1 s + 0.2 s.
    rig = Rig(x6067=0).enable(PP)
    rig.present(100_000)
    start = rig.time - 2 * rig.dt
    rig.arrive()
    assert rig.time - start == pytest.approx(5.3, abs=0.03)


def test_a_short_move_is_a_triangle():
    # 1000 increments: peak = sqrt(2·1000·a·d/(a+d)) = 8165/s; up 81.6 ms, down 163.3 ms.
    rig = Rig(x6067=0).enable(PP)
    rig.present(-1000)
    start, peak = rig.time - 2 * rig.dt, 0
    while not rig.has(BIT_10):
        rig.run(rig.dt)
        peak = min(peak, rig.drive.velocity)
    assert peak == pytest.approx(-math.sqrt(2 * 1000 * 1e5 * 5e4 / 1.5e5), rel=0.05)
    assert rig.time - start == pytest.approx(0.245, abs=0.03)


def test_the_handshake_in_its_phases():
    rig = Rig().enable(PP)
    rig.drive.target_position = 50_000
    rig.word(0x0F)
    assert not rig.has(BIT_12)
    rig.word(0x1F)
    assert rig.has(BIT_12)
    assert not rig.has(BIT_10)  # still moving
    rig.run(0.1)
    assert rig.has(BIT_12)  # as long as bit 4 is set
    rig.word(0x0F)
    assert not rig.has(BIT_12)
    rig.arrive()
    assert rig.drive.position == pytest.approx(50_000, abs=10)


def test_a_constant_bit_4_is_no_second_set_point():
    rig = Rig().enable(PP)
    rig.drive.target_position = 1000
    rig.word(0x1F)
    rig.drive.target_position = 9000
    rig.run(1.0)
    assert rig.drive.position == 1000


def test_the_target_is_latched_with_the_edge():
    rig = Rig().enable(PP)
    rig.drive.target_position = 1000
    rig.word(0x1F)
    rig.drive.target_position = -5000
    rig.word(0x0F)
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == 1000


def test_a_second_set_point_waits_for_the_first():
    rig = Rig().enable(PP)
    rig.present(20_000)
    rig.run(0.2)
    rig.drive.target_position = 5_000
    rig.word(0x1F)
    assert rig.has(BIT_12)
    rig.word(0x0F)
    assert rig.has(BIT_12)  # the buffer is full: no further set-point is taken
    highest = 0
    while rig.has(BIT_12):
        rig.run(rig.dt)
        highest = max(highest, rig.drive.position)
    assert highest == pytest.approx(20_000, abs=10)
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == 5_000


def test_a_third_set_point_is_not_taken_while_the_buffer_is_full():
    rig = Rig().enable(PP)
    rig.present(20_000)
    rig.drive.target_position = 10_000
    rig.word(0x1F)
    rig.word(0x0F)
    rig.drive.target_position = 99_000
    rig.word(0x1F)
    rig.word(0x0F)
    rig.until(lambda: not rig.has(BIT_12))
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == 10_000


def test_change_immediately_reverses_during_the_motion():
    rig = Rig().enable(PP)
    rig.present(100_000)
    rig.run(1.0)
    highest = rig.drive.position
    rig.present(-1_000, IMMEDIATELY)
    assert not rig.has(BIT_12)
    while rig.drive.velocity > 0:
        rig.run(rig.dt)
        highest = max(highest, rig.drive.position)
    assert highest < 100_000 / 2
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == -1_000


def test_a_set_point_too_near_to_stop_is_overrun_and_then_reached():
    rig = Rig().enable(PP)
    rig.present(100_000)
    rig.run(1.0)
    near = rig.drive.position + 100  # stopping from 20 000/s takes 4 000
    rig.present(near, IMMEDIATELY)
    rig.run(0.5)
    assert rig.drive.position > near + 2_000
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == near


def test_change_on_set_point_passes_the_first_target_at_speed():
    rig = Rig().enable(PP)
    rig.present(20_000)
    rig.run(0.5)
    rig.drive.target_position = 40_000
    rig.word(0x1F | ON_SET_POINT)
    rig.word(0x0F)
    rig.until(lambda: rig.drive.position >= 20_000)
    assert rig.drive.velocity == pytest.approx(20_000, rel=0.02)
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == 40_000


@pytest.mark.parametrize(("option", "expected"), [(0, 3_000), (1, None), (2, None)])
def test_relative_counts_from_the_base_selected_by_60f2h(option, expected):
    rig = Rig(x60F2=option).enable(PP)
    rig.present(2_000)
    rig.run(0.1)
    demand, actual = rig.drive.position_demand, rig.drive.position
    rig.present(1_000, IMMEDIATELY | RELATIVE)
    rig.arrive()
    rig.run(0.2)
    base = {1: demand, 2: actual}.get(option)
    assert rig.drive.position == pytest.approx(expected if base is None else base + 1_000, abs=30)


def test_halt_brakes_and_the_move_continues_after_it():
    rig = Rig().enable(PP)
    rig.present(100_000)
    rig.run(1.0)
    before = rig.drive.position
    rig.word(0x0F | HALT)
    assert not rig.has(BIT_10)
    time = rig.until(lambda: rig.has(BIT_10))
    assert time == pytest.approx(0.4, abs=0.05)  # 20 000/s at 50 000/s²
    assert rig.drive.position - before == pytest.approx(4_000, rel=0.03)
    stands = rig.drive.position
    rig.run(0.5)
    assert rig.drive.position == stands
    rig.word(0x0F)
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == 100_000


@pytest.mark.parametrize(("option", "time"), [(1, 0.4), (2, 0.05), (3, 0.01)])
def test_halt_options_choose_the_ramp(option, time):
    rig = Rig(x605D=option).enable(PP)
    rig.present(100_000)
    rig.run(1.0)
    rig.word(0x0F | HALT)
    assert rig.until(lambda: rig.drive.axis.velocity == 0.0) == pytest.approx(time, abs=0.01)


def test_halt_option_0_lets_the_motor_coast():
    rig = Rig(x605D=0).enable(PP)
    rig.present(1_000_000)
    rig.run(1.0)
    rig.word(0x0F | HALT)
    rig.run(0.1)
    assert rig.drive.torque == 0
    assert 0 < rig.drive.velocity < 20_000


def test_a_target_beyond_the_software_limit_is_clamped_and_sets_the_limit_bit():
    rig = Rig(x607D_1=-10_000, x607D_2=15_000).enable(PP)
    rig.present(50_000)
    assert rig.has(LIMIT)
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == 15_000
    rig.present(0)
    assert not rig.has(LIMIT)


def test_the_window_and_its_time_hold_target_reached_back():
    rig = Rig(x6067=50, x6068=200).enable(PP)
    rig.present(5_000)
    rig.until(lambda: abs(rig.drive.position - 5_000) <= 50)
    assert not rig.has(BIT_10)
    assert rig.until(lambda: rig.has(BIT_10)) == pytest.approx(0.2, abs=0.01)


def test_a_move_of_no_length_is_reached_at_once():
    rig = Rig().enable(PP)
    rig.drive.target_position = 0
    rig.word(0x1F)
    assert rig.has(BIT_12)
    assert rig.has(BIT_10)


@pytest.mark.parametrize("changes", [{"x6081": 0}, {"x6083": 0, "x6084": 0}])
def test_a_velocity_or_acceleration_of_0_does_not_get_on_until_it_is_set(changes):
    rig = Rig(**changes).enable(PP)
    rig.drive.target_position = 1_000
    rig.word(0x1F)
    rig.word(0x0F)
    rig.run(1.0)
    assert rig.drive.position == 0
    assert not rig.has(BIT_10)
    rig.write(0x6081, 20_000)
    rig.write(0x6083, 100_000)
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == 1_000


def test_without_a_deceleration_the_acceleration_serves():
    rig = Rig(x6084=0, x6067=0).enable(PP)
    rig.present(20_000)
    start = rig.time - 2 * rig.dt
    rig.arrive()
    assert rig.time - start == pytest.approx(1.0 + 0.2, abs=0.03)


@pytest.mark.parametrize(("index", "value"), [(0x607F, 5_000), (0x6080, 60)])
def test_speed_limits_hold(index, value):
    # 6080h is in rpm of a motor with 16 384 increments per turn: 60 rpm is 16 384/s.
    limit = {0x607F: 5_000, 0x6080: 16_384}[index]
    rig = Rig(params=MotorParams(increments_per_turn=16_384)).enable(PP)
    rig.write(index, value)
    rig.present(100_000)
    rig.run(1.0)
    assert rig.drive.velocity == pytest.approx(limit, rel=0.001)


def test_acceleration_limits_hold():
    # up at 20 000/s² instead of 100 000 (1 s), down at 10 000/s² instead of 50 000 (2 s)
    rig = Rig(x60C5=20_000, x60C6=10_000).enable(PP)
    rig.present(200_000)
    assert rig.until(lambda: rig.drive.axis.velocity == 20_000.0) == pytest.approx(1.0, abs=0.01)
    rig.word(0x0F | HALT)
    assert rig.until(lambda: rig.drive.axis.velocity == 0.0) == pytest.approx(2.0, abs=0.01)


def test_an_end_velocity_is_kept_beyond_the_target_when_nothing_follows():
    rig = Rig(x6082=5_000).enable(PP)
    rig.present(20_000)
    rig.until(lambda: rig.drive.position_demand >= 20_000)
    assert rig.drive.axis.velocity == pytest.approx(5_000, rel=0.01)


def test_the_encoders_noise_is_the_same_for_the_same_seed():
    def positions(seed):
        drive = Drive(drive_eds(), params=MotorParams(noise=5), seed=seed)
        found = []
        for _ in range(50):
            drive.step(0.01)
            found.append(drive.position)
        return found

    assert positions(1) == positions(1) != positions(2)
    assert max(map(abs, positions(1))) in range(2, 6)


def test_polarity_turns_position_and_target():
    rig = Rig(x607E=0x80).enable(PP)
    rig.present(3_000)
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == 3_000
    assert rig.drive.axis.motor.position == pytest.approx(-3_000, abs=0.5)


def test_the_dials_of_the_handshake():
    rig = Rig().enable(PP)
    rig.dials.acknowledge_delay = 0.3
    rig.drive.target_position = 1_000
    rig.word(0x1F)
    assert rig.until(lambda: rig.has(BIT_12)) == pytest.approx(0.3, abs=0.01)
    rig.dials.acknowledge_stays = True
    rig.word(0x0F)
    rig.run(0.5)
    assert rig.has(BIT_12)
    rig.dials.acknowledge_stays = False
    rig.word(0x2F)
    rig.dials.acknowledge_delay = NEVER
    rig.drive.target_position = 5_000
    rig.word(0x1F)
    rig.run(1.0)
    assert not rig.has(BIT_12)
    assert rig.drive.position == 1_000


def test_target_reached_may_stay_set_or_never_be_set():
    rig = Rig().enable(PP)
    rig.present(100)
    rig.arrive()
    rig.run(0.1)
    rig.dials.target_reached_late = 0.05
    rig.present(50_000)
    assert rig.has(BIT_10)
    rig.run(0.06)
    assert not rig.has(BIT_10)
    rig.dials.target_reached_never = True
    rig.run(5.0)
    assert rig.drive.position == 50_000
    assert not rig.has(BIT_10)


def test_an_ignored_halt_changes_nothing():
    rig = Rig().enable(PP)
    rig.present(100_000)
    rig.run(0.5)
    rig.dials.ignore_halt = True
    rig.word(0x0F | HALT)
    rig.run(0.5)
    assert rig.drive.velocity == pytest.approx(20_000, rel=0.001)


def test_changing_the_mode_during_the_motion_does_not_jump():
    rig = Rig(x6065=200).enable(PP)
    rig.present(100_000)
    rig.run(0.5)
    rig.drive.target_velocity = 20_000
    rig.drive.mode = PV
    positions = []
    rig.run(0.2, lambda: positions.append(rig.drive.position))
    steps = [after - before for before, after in itertools.pairwise(positions)]
    assert rig.drive.mode_display == PV
    assert all(step == pytest.approx(20, abs=1) for step in steps)
    rig.drive.mode = PP  # no set-point: it brakes, and holds
    rig.run(1.0)
    assert rig.drive.velocity == 0
    assert rig.state == "operation enabled"


def test_positions_run_on_across_the_wrap_of_integer32():
    rig = Rig(params=MotorParams(start_position=2**31 - 1_000)).enable(PP)
    rig.present(-(2**31) + 1_000)
    rig.arrive()
    rig.run(0.2)
    assert rig.drive.position == -(2**31) + 1_000
    assert rig.drive.axis.motor.position == pytest.approx(2**31 + 1_000)


def test_a_drive_whose_count_does_not_wrap_moves_in_the_long_direction():
    rig = Rig(params=MotorParams(start_position=2**31 - 1_000, wraps=False)).enable(PP)
    rig.present(-(2**31) + 1_000)
    rig.run(0.5)
    assert rig.drive.axis.motor.position < 2**31 - 1_500
