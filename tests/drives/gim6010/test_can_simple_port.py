"""A module that speaks CAN Simple as an axis, in virtual time: enabled, moved and stopped as every other, and nothing jumps."""

from __future__ import annotations

import struct
from dataclasses import replace
from itertools import pairwise

import pytest

from axisbus.bus.pdo.tpdo_timeout import Reception
from axisbus.drives.gim6010.sim.constants import FACTORY, Firmware
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import (
    DriveError,
    DriveFault,
    ModeError,
    MotionTimeout,
    NodeError,
    StateError,
    TransitionError,
)
from axisbus.motion.parameters import HoldsLoad, HomingParameters
from axisbus.motion.states import AxisState
from axisbus.sim.motor import MotorParams
from kit.can_simple.rig import COUNTS, OWN, PERIOD, SETTINGS, judge, rig

# Typed off the manual 4.1.2.
ESTOP, GET_ERROR, SET_STATE, ESTIMATES, COUNT, MODE, POS, VEL, TORQUE, LIMITS = (
    2,
    3,
    7,
    9,
    10,
    11,
    12,
    13,
    14,
    15,
)
TRAJ_VEL, TRAJ_ACCEL, CLEAR = 0x11, 0x12, 0x18
SET_POINTS = {POS, VEL, TORQUE}
HARDEST = 150.0  # turns/s²: all that is asked for in these tests is softer


@pytest.fixture
def made():
    """Rigs whose frames are judged at the end, and whose plants must have been smooth."""
    rigs = []

    def make(*args, **kwargs):
        rigs.append(rig(*args, **kwargs))
        return rigs[-1]

    yield make
    for each in rigs:
        judge(each)
        if not each.rough:
            each.must_be_smooth(HARDEST)


def module(*, firmware: Firmware = FACTORY, motor: MotorParams | None = None, **dials) -> Module:
    return Module(5, firmware=firmware, params=motor, dials=ModuleFaults(**dials), **OWN)


def homed(r):
    r.enabled()
    for axis in r.axes.values():
        axis.home().wait(5)
    return r


# -- power -----------------------------------------------------------------------------------------------------------------------


def test_only_requests_are_sent_before_a_command(made):
    r = made()
    r.run(1.0)
    assert r.commands() == []
    assert set(r.commands(questions=True)) == {COUNT, 0x14}


def test_enable_sends_limits_and_mode_and_then_commands_closed_loop(made):
    r = made()
    r.axis.enable().wait(5)
    assert r.commands() == [LIMITS, VEL, MODE, SET_STATE]
    limits, _, mode, state = [each.data for each in r.cycle.sent if not each.remote]
    assert struct.unpack("<ff", limits) == (20.0, 20.0)
    assert struct.unpack("<II", mode) == (3, 5)
    assert struct.unpack("<Ixxxx", state) == (8,)
    assert r.module.energised


def test_operation_enabled_is_shown_by_the_heartbeat_alone(made):
    r = made()
    r.axis.enable()
    r.until(lambda: r.module.energised)
    begun = r.now
    while r.core.image.state.value != "operation enabled":
        assert not any(state == 8 for time, state in r.cycle.states if time < r.now - PERIOD)
        r.run(PERIOD)
    assert any(state == 8 for time, state in r.cycle.states if time > begun)


def test_a_module_that_does_not_go_to_closed_loop_is_reported_and_switched_off(made):
    r = made(module=module(wont_start=True))
    with pytest.raises(TransitionError, match="does not change from 'switched on'"):
        r.axis.enable().wait(5)
    assert (
        sum(each.command == SET_STATE and each.data[0] == 8 for each in r.cycle.sent if not each.remote) > 1
    )
    assert r.commands()[-1] == SET_STATE
    assert r.cycle.sent[-1].remote or r.cycle.sent[-1].data[0] == 1
    r.run(1.0)
    since = r.now
    r.run(1.0)
    assert r.commands(since) == []


@pytest.mark.parametrize("load", [0.0, 300.0, -300.0])
def test_a_loaded_axis_is_held_at_the_position_at_which_it_was_enabled(made, load):
    """Without power the load moves it; it is held at that position, and not moved back or on."""
    r = made(module=module(motor=MotorParams(load=load)), warm=0.12, holds_load=HoldsLoad.TORQUE)
    r.rough = bool(load)  # the module catches it as hard as it can
    r.axis.enable(allow_moving=True).wait(5)
    caught = r.module.position
    r.run(1.0)
    assert r.module.position == pytest.approx(caught, abs=0.01)
    assert r.core.image.position == pytest.approx(r.module.position * COUNTS, abs=3)


def test_a_motor_turning_without_power_is_not_enabled_unless_allowed(made):
    r = made(module=module(motor=MotorParams(load=300.0)), warm=0.12)
    with pytest.raises(StateError, match="because it moves"):
        r.axis.enable().wait(5)
    assert SET_STATE not in r.commands()


def test_disable_removes_the_power_and_is_done_only_when_that_is_seen(made):
    r = made().enabled()
    handle = r.axis.disable()
    r.until(lambda: not r.module.energised)
    assert not handle.done
    handle.wait(5)
    assert r.cycle.states[-1][1] == 1
    assert r.core.state is AxisState.DISABLED


def test_a_module_that_left_closed_loop_is_not_enabled_again(made):
    r = made().enabled()
    r.module.axis.request(1)  # another tool
    since = r.now
    r.run(2.0)
    assert isinstance(r.core.error, DriveError)
    assert not r.module.energised
    assert [each.data[0] for each in r.cycle.sent if each.time > since and each.command == SET_STATE] in (
        [],
        [1],
    )


def test_a_module_found_in_closed_loop_is_left_alone_and_can_be_taken_over(made):
    found = module()
    found.axis.request(8)
    r = made(module=found)
    with pytest.raises(StateError, match="found enabled, not by this program"):
        r.axis.move_relative(5.0).wait(2)
    r.run(0.5)
    assert r.commands() == []
    r.axis.enable().wait(5)
    assert SET_STATE not in r.commands()
    r.axis.move_relative(10.0).wait(5)
    assert r.degrees == pytest.approx(10.0, abs=0.02)


def test_a_module_found_turning_is_braked_along_a_trajectory_when_taken_over(made):
    found = module()
    found.parameters["axis0.controller.config.control_mode"] = 2
    found.parameters["axis0.controller.config.input_mode"] = 2
    found.axis.request(8)
    found.axis.controller.take(vel=5.0)
    r = made(module=found)
    r.axis.enable().wait(5)
    assert abs(r.module.shaft.speed) < 0.01
    assert r.module.energised


# -- moves -----------------------------------------------------------------------------------------------------------------------


def test_a_move_is_a_trapezoid_of_the_module_with_the_values_of_the_call(made):
    r = homed(made())
    since = r.now
    r.axis.move_absolute(90.0, velocity=90.0, acceleration=360.0, deceleration=180.0).wait(5)
    assert r.commands(since) == [TRAJ_VEL, TRAJ_ACCEL, POS]
    frames = {each.command: each.data for each in r.cycle.sent if each.time >= since}
    assert struct.unpack("<fxxxx", frames[TRAJ_VEL]) == (
        2.0,
    )  # 90 deg/s of the output are 2 turns/s of the rotor
    assert struct.unpack("<ff", frames[TRAJ_ACCEL]) == (8.0, 4.0)
    assert struct.unpack("<fhh", frames[POS]) == (2.0, 0, 0)
    assert r.degrees == pytest.approx(90.0, abs=0.01)
    assert r.now - since == pytest.approx(1.0 + 0.125 + 0.25, abs=0.35)


@pytest.mark.parametrize(
    "firmware", [Firmware(0, 5, 11), Firmware(0, 5, 12), Firmware(0, 5, 13), Firmware(0, 6, 5)]
)
@pytest.mark.parametrize("start", [0.0, 0.3, 7.8, -3.4])
def test_moves_are_relative_to_home_for_any_counting_origin_of_the_module(made, firmware, start):
    one = module(firmware=firmware, motor=MotorParams(start_position=start * COUNTS))
    r = homed(made(module=one))
    home = r.module.position
    for target in (30.0, -200.0, 0.0):
        r.axis.move_absolute(target).wait(10)
        assert (r.module.position - home) * 45.0 == pytest.approx(target, abs=0.01)


def test_a_new_target_in_motion_replaces_the_old_one(made):
    r = homed(made())
    first = r.axis.move_absolute(360.0)
    r.run(0.5)
    r.axis.move_absolute(-30.0).wait(10)
    assert first.aborted
    assert r.degrees == pytest.approx(-30.0, abs=0.01)


@pytest.mark.parametrize("way", [90.0, -90.0])
@pytest.mark.parametrize("after", [0.02, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.62, 0.7])
def test_a_halt_at_any_moment_stops_without_reversing_or_overshooting(made, after, way):
    r = homed(made())
    sign = 1.0 if way > 0 else -1.0
    r.axis.move_absolute(way)
    r.run(after)
    begun, speed = r.module.position, r.module.shaft.speed
    r.axis.halt().wait(5)
    assert r.core.state is AxisState.STANDSTILL
    assert r.module.energised
    places = [sign * position for time, position, _ in r.cycle.plants[0]]
    assert max(places) - places[-1] < 0.01
    assert sign * r.degrees <= 90.01
    most = speed * speed / (2.0 * 16.0)  # 720 deg/s² of the output
    assert abs(r.module.position - begun) <= 1.15 * most + 0.05 * abs(speed) + 0.05
    r.run(0.5)
    assert sign * r.module.position == pytest.approx(places[-1], abs=0.01)
    r.axis.move_absolute(45.0).wait(5)
    assert r.degrees == pytest.approx(45.0, abs=0.01)


def test_a_velocity_is_ramped_here_within_the_modules_own_ramp(made):
    r = made().enabled()
    r.axis.move_velocity(180.0, acceleration=360.0).wait(5)
    assert r.module.shaft.speed == pytest.approx(4.0, abs=0.2)
    speeds = [speed for _, _, speed in r.cycle.plants[0]]
    hardest = max(b - a for a, b in zip(speeds, speeds[10:], strict=False)) / 0.01
    assert hardest == pytest.approx(8.0, rel=0.6)
    r.axis.move_velocity(-180.0).wait(5)
    assert r.module.shaft.speed == pytest.approx(-4.0, abs=0.2)
    r.axis.move_velocity(0.1, acceleration=720.0, deceleration=90.0)
    r.run(1.0)
    assert r.module.shaft.speed == pytest.approx(-2.0, abs=0.3)  # it brakes with 2 turns/s²
    r.axis.halt().wait(5)
    assert abs(r.module.shaft.speed) < 0.01


@pytest.mark.parametrize("velocity", [180.0, -360.0])
def test_from_a_velocity_to_a_position_nothing_jumps(made, velocity):
    r = made().enabled()
    r.axis.move_velocity(velocity).wait(5)
    r.axis.move_absolute(10.0).wait(10)
    assert r.degrees == pytest.approx(10.0, abs=0.02)
    r.axis.move_velocity(velocity).wait(5)


def test_a_torque_pushes_and_its_halt_brakes(made):
    r = made().enabled()
    r.axis.torque_control(0.6).wait(5)
    assert r.module.shaft.torque == pytest.approx(0.6 / 8.0, rel=0.05)
    r.run(0.3)
    assert r.module.shaft.speed > 1.0
    r.axis.halt().wait(5)
    assert abs(r.module.shaft.speed) < 0.02
    assert r.module.energised


def test_without_a_torque_constant_there_are_no_torques(made):
    r = made(settings=replace(SETTINGS, torque=None)).enabled()
    assert r.core.image.torque is None
    with pytest.raises((StateError, ModeError)):
        r.axis.torque_control(0.1, timeout=1.0).wait(5)
    assert TORQUE not in r.commands()


def test_homing_sends_nothing_to_the_module_and_moves_nothing(made):
    r = made(module=module(motor=MotorParams(start_position=5000.0))).enabled()
    r.axis.move_relative(20.0).wait(5)
    since = r.now
    r.axis.home().wait(5)
    assert r.commands(since) == []
    assert r.core.homed
    assert r.core.image.position == pytest.approx(0, abs=2)


def test_another_homing_method_is_refused(made):
    speeds = HomingParameters(method=33, speed_switch=10.0, speed_zero=10.0, acceleration=100.0, timeout=2.0)
    r = made(homing=speeds).enabled()
    with pytest.raises(StateError, match="6099h"):
        r.axis.home().wait(5)
    assert r.module.shaft.speed == 0.0


@pytest.mark.parametrize("bandwidth", [None, 60.0])
def test_a_module_moves_on_a_line_with_canopen_axes(made, bandwidth):
    settings = replace(SETTINGS, filter_bandwidth=bandwidth)
    one = Module(5, **OWN, input_filter_bandwidth=60.0)
    r = homed(made("ab", settings=settings, module=one, groups={"all": ["m", "a", "b"]}))
    r.groups["all"].move_linear((90.0, 45.0, -45.0), velocity=60.0).wait(10)
    assert r.degrees == pytest.approx(90.0, abs=0.02)
    assert r.devices[0].drive.position == pytest.approx(45_000, abs=5)
    assert max(position for _, position, _ in r.cycle.plants[0]) * 45.0 <= 90.02
    r.groups["all"].move_direct((0.0, 0.0, 0.0)).wait(10)
    assert r.degrees == pytest.approx(0.0, abs=0.02)
    r.groups["all"].move_linear((90.0, 45.0, -45.0), velocity=60.0)
    r.run(0.7)
    r.groups["all"].halt().wait(5)
    assert 5.0 < r.degrees < 85.0
    assert r.core.state is AxisState.STANDSTILL


# -- stops -----------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("holds", [False, True])
def test_a_quick_stop_is_velocity_0_on_the_modules_ramp(made, holds):
    r = made(settings=replace(SETTINGS, quick_stop_holds=holds), quick_stop_holds=holds).enabled()
    r.axis.move_velocity(360.0).wait(5)
    since = r.now
    r.axis.quick_stop().wait(5)
    sent = r.commands(since)
    assert sent[0] == VEL  # it is in velocity control already
    assert r.module.energised is holds
    assert r.core.state is (AxisState.STOPPING if holds else AxisState.DISABLED)
    slowing = [(time, speed) for time, _, speed in r.cycle.plants[0] if time >= since and 1.0 < speed < 7.0]
    (t0, v0), (t1, v1) = slowing[0], slowing[-1]
    assert (v0 - v1) / (t1 - t0) == pytest.approx(40.0, rel=0.1)  # vel_ramp_rate


def test_after_a_quick_stop_that_holds_it_continues_when_enabled(made):
    r = made(settings=replace(SETTINGS, quick_stop_holds=True), quick_stop_holds=True).enabled()
    r.axis.move_relative(90.0)
    r.run(0.4)
    r.axis.quick_stop().wait(5)
    place = r.module.position
    r.run(0.5)
    assert r.module.position == pytest.approx(place, abs=0.02)
    r.axis.enable().wait(5)
    assert SET_STATE not in r.commands(r.now - 0.3)
    r.axis.move_relative(10.0).wait(5)


def test_the_last_step_is_estop_which_latches_until_a_reset(made):
    r = made().enabled()
    r.axis.move_velocity(45.0).wait(5)
    r.cycle.lose = lambda side, command, _: side == "master" and command in (VEL, MODE, SET_STATE)
    r.axis.quick_stop()
    r.until(lambda: ESTOP in r.commands(), 20.0)
    r.cycle.lose = lambda *_: False
    r.run(1.0)
    assert not r.module.energised
    assert r.core.image.state.value == "fault"
    assert "ESTOP_REQUESTED" in str(r.core.error)
    r.axis.reset().wait(5)
    assert CLEAR in r.commands()
    r.axis.enable().wait(5)
    r.axis.move_relative(10.0).wait(5)


@pytest.mark.parametrize("doing", ["pp", "pv", "csp", "tq"])
def test_the_frames_sent_when_the_scan_dies_brake_the_module(made, doing):
    r = homed(made("a", groups={"all": ["m", "a"]}))
    if doing == "pp":
        r.axis.move_absolute(900.0)
    elif doing == "pv":
        r.axis.move_velocity(180.0)
    elif doing == "csp":
        r.groups["all"].move_linear((360.0, 10.0), velocity=180.0)
    else:
        r.axis.torque_control(0.3)
    r.run(0.6)
    assert abs(r.module.shaft.speed) > 1.0
    r.cycle.quick_stop_all()
    r.cycle.wait_until(r.now + 1.0)  # no scan any more
    assert abs(r.module.shaft.speed) < 0.01
    place = r.module.position
    r.cycle.wait_until(r.now + 5.0)
    assert r.module.position == pytest.approx(place, abs=0.01)


def test_when_the_scan_dies_nothing_is_sent_to_a_module_that_was_not_commanded(made):
    r = made()
    assert r.port.stop_frames() == []
    r.axis.enable()
    r.until(lambda: SET_STATE in r.commands())
    (frame,) = r.port.stop_frames()
    assert (frame.can_id & 0x1F, frame.data[0]) == (SET_STATE, 1)  # else it would be enabled without a master
    r.run(1.0)
    assert [each.can_id & 0x1F for each in r.port.stop_frames()] == [MODE, VEL]
    r.axis.disable().wait(5)
    assert r.port.stop_frames() == []


@pytest.mark.parametrize("doing", ["pp", "csp", "pv"])
def test_without_a_master_positions_hold_and_a_velocity_continues(made, doing):
    """The state after a master's death; the velocity is why ``break_timeout`` should be armed, and why stop frames are sent."""
    r = homed(made("a", groups={"all": ["m", "a"]}))
    if doing == "pp":
        r.axis.move_absolute(180.0)
    elif doing == "pv":
        r.axis.move_velocity(90.0)
    else:
        r.groups["all"].move_linear((180.0, 10.0), velocity=90.0)
    r.run(0.6)
    r.cycle.wait_until(r.now + 10.0)
    expected = 2.0 if doing == "pv" else 0.0
    assert r.module.shaft.speed == pytest.approx(expected, abs=0.02)
    assert doing == "pv" or r.degrees <= 180.01


@pytest.mark.parametrize("timeout", [0.2, 4 * PERIOD])
def test_a_confirmed_break_timeout_is_fed_and_trips_when_the_master_dies(made, timeout):
    one = Module(5, break_timeout=round(timeout * 1000), **OWN)
    r = rig(module=one, warm=0.1)
    r.port.feed_within(timeout)
    r.until(lambda: r.core.image.state.value != "unknown")
    r.run(0.5)
    assert (
        r.core.image.state.value == "fault"
    )  # no master commanded it: it has tripped, as it would before any start
    assert not set(r.commands()) & SET_POINTS
    r.axis.reset().wait(5)
    r.run(2.0)
    assert r.core.error is None
    r.axis.enable().wait(5)
    enabled = r.now
    r.run(5.0)
    sent = [each.time for each in r.cycle.sent if each.time > enabled and each.command in SET_POINTS]
    assert max(after - before for before, after in pairwise(sent)) <= timeout / 4 + 1e-6
    assert r.core.state is AxisState.STANDSTILL
    r.axis.move_velocity(90.0).wait(5)
    r.run(1.0)
    assert r.module.energised
    r.axis.move_absolute(10.0).wait(5)
    r.run(2.0)
    assert r.module.energised
    judge(r)
    r.axis.move_velocity(90.0).wait(5)
    r.cycle.wait_until(r.now + 0.5)  # the master is dead
    assert not r.module.energised


def test_a_time_out_is_fed_again_after_a_set_point_that_was_lost(made):
    """A quarter of the time-out is five cycles: in whichever of them the frames are lost, the next one feeds."""
    one = Module(5, break_timeout=200, **OWN)
    r = made(module=one, warm=0.6)
    r.port.feed_within(0.2)
    r.axis.reset().wait(5)
    r.axis.enable().wait(5)
    for cycle in range(5):
        r.run(0.2 + cycle * PERIOD)
        r.port.forget()
        lost = r.now
        r.run(PERIOD / 2)
        assert set(r.commands(lost + PERIOD / 4)) & SET_POINTS


def test_an_expired_time_out_is_fed_before_its_error_is_cleared(made):
    """In the other order the module would trip again at once."""
    r = made(module=Module(5, break_timeout=200, **OWN), warm=0.6)
    r.port.feed_within(0.2)
    r.port.objects.write(0x6040, 0, 0x80)
    assert [each.can_id & 0x1F for each in r.port.take_frames()] == [VEL, CLEAR]


def test_a_module_that_we_did_not_enable_gets_no_set_points(made):
    one = Module(5, **OWN)
    one.axis.request(8)
    r = made(module=one)
    r.port.feed_within(0.2)
    r.run(1.0)
    assert not set(r.commands()) & SET_POINTS


# -- faults and losses -----------------------------------------------------------------------------------------------------------


def test_a_fault_is_reported_with_every_word_and_can_be_reset(made):
    r = homed(made())
    handle = r.axis.move_absolute(720.0)
    r.run(0.6)
    r.module.dials.encoder_error = 0x80
    with pytest.raises(DriveFault) as caught:
        handle.wait(5)
    assert caught.value.code == 0x7305
    assert "ABS_SPI_COM_FAIL" in caught.value.observed
    assert "ENCODER_FAILED" in caught.value.observed
    assert "EMCY 0x7305" in caught.value.observed
    assert [each.command for each in r.cycle.sent].count(GET_ERROR) == 4
    r.module.dials.encoder_error = 0
    r.run(2.0)
    place = r.module.position
    r.axis.reset().wait(5)
    assert not r.module.energised
    r.axis.enable().wait(5)
    assert r.core.homed
    assert r.core.image.position == pytest.approx(r.module.position * COUNTS, abs=10)
    r.run(0.5)
    assert r.module.position == pytest.approx(place, abs=0.01)


def test_a_fault_whose_cause_persists_is_not_reset(made):
    r = made().enabled()
    r.module.dials.bus_voltage = 8.0
    r.run(1.0)
    assert "DC_BUS_UNDER_VOLTAGE" in str(r.core.error)
    with pytest.raises(TransitionError, match="does not clear the fault"):
        r.axis.reset().wait(10)
    r.module.dials.bus_voltage = 24.0
    r.axis.reset().wait(5)


def test_error_words_without_an_answer_are_reported_as_such(made):
    r = made(module=module(get_error_answered=False)).enabled()
    r.module.dials.motor_error = 0x10000
    r.run(1.5)
    assert "MOTOR_FAILED" in str(r.core.error)
    assert "motor, encoder, controller, system are not answered by this firmware" in str(r.core.error)


def test_zeros_of_a_module_that_switches_itself_off_are_not_used_as_positions(made):
    """Its estimates are 0 at once, and its heartbeat says why up to 0.1 s later."""
    r = homed(made())
    r.axis.move_absolute(300.0).wait(10)
    r.module.dials.motor_error = 0x10000
    shown = []
    for _ in range(60):
        r.run(PERIOD)
        shown.append(r.core.image.position)
    assert all(each is None or abs(each - 300.0 * COUNTS * 8 / 360) < 200 for each in shown)


@pytest.mark.parametrize("turn", [0.2, -0.3, 3.3, -7.9])
def test_a_rotor_turned_by_hand_without_power_is_counted(made, turn):
    r = homed(made())
    r.axis.move_absolute(100.0).wait(5)
    r.axis.disable().wait(5)
    motor, r.rough = r.module.motor, True
    for _ in range(100):
        motor.position += turn * COUNTS / 100
        r.run(PERIOD)
    r.run(2 * PERIOD)  # until the last position has arrived
    assert r.core.image.position == pytest.approx(r.module.position * COUNTS, abs=5)
    r.run(0.3)
    r.axis.enable().wait(5)
    assert r.core.homed
    r.axis.move_absolute(0.0).wait(10)
    assert r.degrees == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("on", [False, True])
@pytest.mark.parametrize("firmware", [Firmware(0, 5, 11), Firmware(0, 5, 13)])
def test_a_restart_takes_home_away_and_waits_for_a_new_boot(made, on, firmware):
    r = homed(made(module=module(firmware=firmware)))
    if not on:
        r.axis.disable().wait(5)
    r.module.restart()
    r.run(3.0)
    assert not r.core.homed
    assert not r.core.image.operational
    assert r.port.hearing.bootups == 1
    with pytest.raises(StateError):
        r.axis.enable().wait(2)
    with pytest.raises((StateError, NodeError, DriveError)):
        r.axis.reset().wait(2)
    assert not r.module.energised


def test_a_position_that_differs_after_a_restart_does_not_keep_the_homing(made):
    """Owners saw 0.14 turns between two ways of counting after a restart; here the restart itself went unseen."""
    r = homed(made())
    r.axis.disable().wait(5)
    r.module.shaft.origin += 0.1425
    with pytest.raises((DriveError, NodeError)):
        r.axis.enable().wait(5)
    r.run(3.0)
    assert not r.core.homed
    assert not r.core.image.operational
    assert not r.module.energised


def test_a_heartbeat_that_stops_is_a_lost_node_and_the_axis_is_stopped(made):
    r = made().enabled()
    r.axis.move_velocity(90.0).wait(5)
    r.module.dials.heartbeat_stops = True
    r.run(2.0)
    assert isinstance(r.core.error, NodeError)
    assert abs(r.module.shaft.speed) < 0.01
    assert not r.module.energised
    r.module.dials.heartbeat_stops = False
    r.run(0.5)
    (told,) = [each for each in r.port.hearing.missing if each.pdo == "Heartbeat"]
    assert told.what is Reception.RETURNED
    assert told.age > 2.0
    assert r.port.hearing.missed > 10
    r.axis.reset().wait(5)
    r.axis.enable().wait(5)


def test_single_heartbeats_that_are_lost_are_reported_and_harm_nothing(made):
    r = homed(made())
    lost = iter([True, False, False] * 100)
    r.cycle.lose = lambda side, command, _: side == "module" and command == 1 and next(lost)
    r.axis.move_absolute(180.0).wait(10)
    assert r.degrees == pytest.approx(180.0, abs=0.02)
    told = [each for each in r.port.hearing.missing if each.pdo == "Heartbeat"]
    assert told
    assert all(each.age == pytest.approx(0.2, abs=2 * PERIOD) for each in told)


@pytest.mark.parametrize("answers", [ESTIMATES, COUNT, 0x14])
def test_a_message_that_a_firmware_does_not_answer_is_reported_once(made, answers):
    r = made(warm=0.0)
    r.cycle.lose = lambda side, command, _: side == "master" and command == answers
    r.module.dials.estimates_stop = answers == ESTIMATES
    r.run(1.5)
    if answers == ESTIMATES:
        with pytest.raises(TransitionError):
            r.axis.enable().wait(5)  # its position in closed loop is never sent
    (told,) = r.port.hearing.missing
    assert told.what is Reception.MISSING
    assert (told.cob_id & 0x1F, told.never) == (answers, True)
    since = r.now
    r.run(3.0)
    asked = [each for each in r.cycle.sent if each.time > since and each.command == answers]
    assert len(asked) <= 4
    assert r.core.image.operational
    r.cycle.lose, r.module.dials.estimates_stop = lambda *_: False, False
    r.run(1.5)
    assert [each.what for each in r.port.hearing.missing] == [Reception.MISSING, Reception.RETURNED]


def test_a_value_that_is_only_answered_to_eight_zeros_is_requested_in_that_form():
    r = rig(warm=0.0)
    taken = r.module.on_frame
    r.module.on_frame = lambda can_id, data, now, remote=False: None if remote else taken(can_id, data, now)
    r.run(1.0)
    assert r.core.image.position is not None
    assert not r.port.hearing.missing


def test_a_blocked_axis_ends_its_move_and_does_not_leap(made):
    r = homed(made())
    handle = r.axis.move_absolute(90.0)
    r.run(0.3)
    r.module.dials.blocked = r.rough = True
    with pytest.raises(MotionTimeout):
        handle.wait(10)
    r.run(5.0)
    r.module.dials.blocked = False
    place = r.module.position
    r.run(1.0)
    assert r.module.position == pytest.approx(place, abs=0.05)
