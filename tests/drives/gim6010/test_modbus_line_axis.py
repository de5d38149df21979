"""A module on RS485 as an axis, in virtual time over its registers: its three modes, their limits, and every way to stop."""

from __future__ import annotations

import struct
from contextlib import suppress
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.drives.gim6010.modbus import requests
from axisbus.drives.gim6010.modbus.registers import named
from axisbus.drives.gim6010.sim.modbus.station import framed
from axisbus.errors import AxisbusError, LimitError, ModeError, NodeError, StateError, UncommandedMotion
from axisbus.motion.parameters import AxisLimits
from axisbus.motion.states import AxisState
from kit.modbus.line_rig import PERIOD, POSITION, TORQUE, TURN, VELOCITY, line_rig

STATE, CONTROL, INPUT, POSITION_SET, VELOCITY_SET, TORQUE_SET = 0x63, 0x64, 0x65, 0x66, 0x68, 0x6A
RAMPS = {"velocity": 180.0, "acceleration": 720.0}
MODES = {POSITION: (3, 5), VELOCITY: (2, 2), TORQUE: (1, 6)}  # typed off the manual, 4.3.3


def floats(rig, address):
    return [struct.unpack(">f", data)[0] for where, data in rig.written if where == address]


def modes(rig):
    """The control and input modes that were written, each with the state of the module's motor at that time: not known here."""
    return [(where, data[1]) for where, data in rig.written if where in (CONTROL, INPUT)]


def moving(mode, **changes):
    """An enabled axis in motion, and what moves it."""
    rig = line_rig(mode, **changes).enabled()
    if mode is POSITION:
        rig.axis.move_absolute(rig.axis.position + 720.0, **RAMPS)
    elif mode is VELOCITY:
        rig.axis.move_velocity(180.0, acceleration=720.0)
    else:
        rig.axis.torque_control(0.5, slope=5.0)
    rig.until(lambda: rig.velocity > 30.0)
    return rig


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_the_modes_are_set_and_read_back_in_idle_before_closed_loop_is_requested(mode):
    rig = line_rig(mode, turns=3.25)
    assert rig.written == []
    assert rig.axis.state is AxisState.DISABLED
    rig.enabled()
    control, inputs = MODES[mode]
    on = [data for where, data in rig.written].index(b"\0\x08")
    before = dict(rig.written[:on])
    assert (before[CONTROL][1], before[INPUT][1]) == (control, inputs)
    assert before[VELOCITY_SET] == before[TORQUE_SET] == bytes(4)
    assert POSITION_SET not in before
    assert [where for where, _ in rig.written].count(STATE) == 1
    assert not {where for where, _ in rig.written[on:]} & {CONTROL, INPUT}
    rig.run(1.0)
    assert abs(rig.velocity) < 0.1
    assert rig.degrees == pytest.approx(3.25 * TURN, abs=0.5)
    assert rig.cycle.failure is None


def test_a_mode_that_another_program_changes_in_idle_is_written_again_when_the_axis_is_enabled():
    rig = line_rig(VELOCITY).enabled()
    rig.axis.disable().wait(5)
    rig.module.usb_write("axis0.controller.config.control_mode", 3)
    rig.axis.enable().wait(5)
    assert rig.module.usb_read("axis0.controller.config.control_mode") == 2


def test_a_brake_whose_writes_are_lost_in_idle_does_not_lead_to_closed_loop_in_another_mode():
    rig = line_rig(VELOCITY)
    rig.module.usb_write("axis0.controller.config.control_mode", 3)
    lost = []

    def lose(request):
        if request.writes and request.address in (CONTROL, INPUT) and len(lost) < 2:
            lost.append(request)
            rig.station.dials.deaf = 1

    rig.cycle.wire.before = lose
    rig.axis.enable().wait(10)
    assert len(lost) == 2
    assert rig.module.usb_read("axis0.controller.config.control_mode") == 2


@pytest.mark.parametrize("velocity", [90.0, -180.0])
def test_a_velocity_is_ramped_by_the_master_and_kept_without_starving_the_readings(velocity):
    rig = line_rig(VELOCITY).enabled()
    rig.axis.move_velocity(velocity, acceleration=360.0).wait(10)
    assert rig.axis.state is AxisState.CONTINUOUS_MOTION
    rig.run(5.0)
    assert rig.velocity == pytest.approx(velocity, abs=0.5)
    assert rig.axis.velocity == pytest.approx(velocity, abs=2.0)
    steps = [(b - a) * TURN for a, b in pairwise(floats(rig, VELOCITY_SET))]
    assert max(map(abs, steps)) <= 360.0 * 2 * PERIOD + 0.01
    assert rig.port.hearing.missed == 0
    rig.axis.halt().wait(5)
    assert abs(rig.velocity) < 0.1
    assert not rig.is_off
    rig.axis.move_velocity(-velocity, acceleration=360.0).wait(10)
    assert rig.velocity * velocity < 0.0
    rig.axis.disable().wait(10)
    assert rig.is_off
    assert rig.cycle.failure is None


def test_a_velocity_beyond_the_limit_of_the_axis_is_refused_before_anything_is_sent():
    rig = line_rig(VELOCITY).enabled()
    rig.station.frames.clear()
    with pytest.raises(LimitError):
        rig.axis.move_velocity(801.0, acceleration=360.0)
    rig.run(0.2)
    assert not any(floats(rig, VELOCITY_SET))


def test_a_torque_is_ramped_and_its_current_is_read():
    rig = line_rig(TORQUE).enabled()
    rig.module.dials.blocked = True
    rig.axis.torque_control(1.0, slope=5.0).wait(10)  # 1 N·m of 5 at the output are 0.125 at the rotor
    rig.run(0.5)
    sent = floats(rig, TORQUE_SET)
    assert sent[-1] == pytest.approx(0.125, abs=1e-4)
    assert max(b - a for a, b in pairwise(sent)) <= 5.0 * 2 * PERIOD * 0.125 + 1e-4
    assert rig.axis.torque == pytest.approx(1.0, abs=0.05)
    assert rig.axis.state is AxisState.CONTINUOUS_MOTION


def test_a_torque_beyond_the_rated_one_is_refused_before_anything_is_sent():
    rig = line_rig(TORQUE, changes={"limits": AxisLimits(torque=5.0)}).enabled()
    with pytest.raises(LimitError):
        rig.axis.torque_control(5.1, slope=5.0)
    assert not any(floats(rig, TORQUE_SET))


def test_the_master_stops_an_axis_that_a_torque_makes_faster_than_its_limit():
    rig = line_rig(TORQUE, changes={"limits": AxisLimits(velocity=60.0)}).enabled()
    rig.axis.torque_control(1.0, slope=10.0)
    rig.until(lambda: rig.axis.state is AxisState.ERRORSTOP)
    assert rig.velocity < 120.0
    rig.until(lambda: rig.is_off)
    assert abs(rig.velocity) < 30.0
    assert "60" in str(rig.axis.error)


def test_a_torque_is_braked_by_velocity_0_and_taken_again_only_after_the_axis_was_disabled():
    rig = moving(TORQUE)
    rig.axis.halt().wait(5)
    assert abs(rig.velocity) < 0.1
    rig.run(2.0)
    assert rig.axis.state is AxisState.STANDSTILL
    assert not rig.is_off
    rig.station.frames.clear()
    with pytest.raises(ModeError, match="disable and enable the axis"):
        rig.axis.torque_control(0.5, slope=5.0).wait(10)
    assert not any(floats(rig, TORQUE_SET))
    assert {data[1] for where, data in rig.written if where == CONTROL} <= {2}
    rig.run(1.0)
    assert abs(rig.velocity) < 0.1
    rig.axis.reset().wait(10)
    rig.axis.disable().wait(10)
    rig.axis.enable().wait(10)
    rig.axis.torque_control(0.5, slope=5.0).wait(10)
    rig.until(lambda: rig.velocity > 10.0)
    assert rig.cycle.failure is None


def test_an_axis_with_torques_is_homed_in_place_without_leaving_torque_control():
    rig = line_rig(TORQUE).enabled()
    rig.axis.home(method=35).wait(10)
    rig.axis.torque_control(0.5, slope=5.0).wait(10)
    rig.until(lambda: rig.velocity > 10.0)
    assert rig.cycle.failure is None


def test_an_axis_with_velocities_is_homed_in_place():
    rig = line_rig(VELOCITY).enabled()
    rig.axis.home(method=35).wait(10)
    rig.axis.move_velocity(45.0, acceleration=360.0).wait(10)
    assert rig.cycle.failure is None


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_commands_of_another_mode_are_refused_before_anything_is_sent(mode):
    rig = line_rig(mode).enabled()
    rig.station.frames.clear()
    commands = {
        POSITION: lambda: rig.axis.move_relative(10.0, **RAMPS),
        VELOCITY: lambda: rig.axis.move_velocity(10.0, acceleration=100.0),
        TORQUE: lambda: rig.axis.torque_control(0.1, slope=1.0),
    }
    for other, command in commands.items():
        if other is not mode:
            with pytest.raises(AxisbusError, match=r"does not have (?s:.)*name it in modes = \[\.\.\.\]"):
                command().wait(5)
    rig.run(0.5)
    assert not {POSITION_SET, CONTROL, INPUT} & {where for where, _ in rig.written}
    assert not any(floats(rig, VELOCITY_SET) + floats(rig, TORQUE_SET))


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_a_quick_stop_brakes_on_the_module_s_ramp_and_then_switches_it_off(mode):
    rig = moving(mode)
    rig.axis.quick_stop().wait(10)
    rig.until(lambda: rig.is_off)
    assert abs(rig.velocity) < 5.0
    rig.axis.enable().wait(10)
    assert rig.cycle.failure is None


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_a_disable_brakes_and_switches_the_module_off(mode):
    rig = moving(mode)
    rig.axis.disable().wait(10)
    assert rig.is_off
    assert abs(rig.velocity) < 5.0


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_a_line_that_falls_silent_stops_the_axis_and_is_stopped_blind_when_it_is_heard_again(mode):
    rig = moving(mode)
    rig.station.dials.deaf = -1
    rig.until(lambda: rig.axis.state is AxisState.ERRORSTOP)
    assert isinstance(rig.axis.error, NodeError)
    rig.station.dials.deaf = 0
    rig.until(lambda: rig.is_off, 15.0)


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_a_module_whose_answers_are_lost_during_a_motion_is_still_stopped(mode):
    rig = moving(mode)
    rig.station.dials.silent = -1
    rig.until(lambda: rig.axis.state is AxisState.ERRORSTOP)
    rig.until(lambda: rig.is_off, 15.0)


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
@pytest.mark.parametrize("lost", [1, 2])
def test_some_lost_answers_do_not_end_a_motion(mode, lost):
    rig = moving(mode)
    for _ in range(3):
        rig.station.dials.silent = lost
        rig.run(1.5)
    assert rig.axis.state is not AxisState.ERRORSTOP


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_a_module_that_was_found_enabled_is_left_so_and_braked_and_switched_off_when_it_is_enabled(mode):
    rig = line_rig(mode)
    rig.module.usb_write("axis0.controller.config.control_mode", 2)
    rig.module.usb_write("axis0.controller.config.input_mode", 2)
    rig.module.usb_write("axis0.requested_state", 8)
    rig.run(0.3)
    rig.module.usb_write("axis0.controller.input_vel", 3.0)
    rig.until(lambda: rig.velocity > 100.0)
    rig.run(1.0)
    assert rig.written == []
    rig.axis.enable()
    rig.until(lambda: rig.is_off)
    assert abs(rig.velocity) < 5.0
    rig.until(lambda: rig.axis.state is AxisState.ERRORSTOP)
    rig.axis.reset().wait(10)
    rig.axis.enable().wait(10)
    assert rig.cycle.failure is None


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_a_module_that_was_found_enabled_is_braked_and_switched_off_by_a_quick_stop(mode):
    rig = line_rig(mode)
    for path, value in (("config.control_mode", 2), ("config.input_mode", 2)):
        rig.module.usb_write(f"axis0.controller.{path}", value)
    rig.module.usb_write("axis0.requested_state", 8)
    rig.run(0.3)
    rig.module.usb_write("axis0.controller.input_vel", 3.0)
    rig.until(lambda: rig.velocity > 100.0)
    rig.axis.quick_stop().wait(10)
    rig.until(lambda: rig.is_off)
    assert abs(rig.velocity) < 5.0


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_a_module_that_another_program_switches_off_is_not_enabled_again(mode):
    rig = moving(mode)
    rig.module.usb_write("axis0.requested_state", 1)
    rig.until(lambda: rig.axis.state is AxisState.ERRORSTOP)
    rig.run(1.0)
    assert rig.is_off
    with pytest.raises(StateError):
        rig.axis.enable().wait(5)


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_a_fault_of_the_module_is_reported_by_its_bits(mode):
    rig = moving(mode)
    rig.module.dials.encoder_error = 0x10
    rig.until(lambda: rig.axis.state is AxisState.ERRORSTOP)
    assert "encoder" in str(rig.axis.error)
    assert rig.is_off


def test_a_module_that_does_not_enable_is_reported():
    rig = line_rig(POSITION)
    rig.module.dials.wont_start = True
    with pytest.raises(AxisbusError):
        rig.axis.enable().wait(20)
    assert rig.is_off


def test_a_module_that_moves_to_an_old_set_point_when_it_is_enabled_is_stopped():
    rig = line_rig(POSITION, keeps_target=True)
    foreign = requests.write(named("position_setpoint"), 30.0)  # of another program, before this one
    rig.station.take(framed(foreign.frame(1)), rig.now)
    rig.axis.enable()
    rig.until(lambda: rig.cycle.failure is not None)
    assert isinstance(rig.cycle.failure, UncommandedMotion)
    assert "its set-point 30" in str(rig.cycle.failure)
    rig.until(lambda: rig.is_off)
    assert abs(rig.degrees) < 45.0


@pytest.mark.parametrize("mode", [POSITION, VELOCITY], ids=lambda mode: mode.name)
def test_a_blocked_motor_is_reported_and_stopped(mode):
    rig = line_rig(mode).enabled()
    rig.module.dials.blocked = True
    if mode is POSITION:
        rig.axis.move_relative(90.0, **RAMPS)
    else:
        rig.axis.move_velocity(180.0, acceleration=720.0)
    rig.until(lambda: rig.axis.state is AxisState.ERRORSTOP, 20.0)
    assert isinstance(rig.axis.error, AxisbusError)
    with suppress(AxisbusError):
        rig.axis.reset().wait(10)
    rig.axis.disable()
    rig.until(lambda: rig.is_off)


def test_a_position_that_is_no_number_ends_a_motion():
    rig = moving(POSITION)
    rig.module.endpoints._live["axis0.encoder.pos_estimate"] = lambda: float("nan")
    rig.until(lambda: rig.axis.state is AxisState.ERRORSTOP)
    rig.until(lambda: rig.is_off)


def test_a_module_that_another_master_moves_away_is_reported():
    rig = line_rig(POSITION).enabled()
    rig.axis.move_relative(45.0, **RAMPS).wait(10)
    rig.module.usb_write("axis0.controller.input_pos", 30.0)
    rig.until(lambda: rig.axis.state is AxisState.ERRORSTOP)
    assert "without" in str(rig.axis.error)
    assert abs(rig.degrees) < 360.0


def test_a_dead_master_is_noticed_by_nothing():
    """The statement of the page, on the simulated module: without a master, a velocity continues."""
    rig = moving(VELOCITY)
    rig.run(1.0)
    rig.cycle.wire.sleep(20.0)
    assert rig.velocity == pytest.approx(180.0, rel=0.02)


def scenario(rig, mode):
    """Enable the axis, move it, halt it, and disable it."""
    rig.axis.enable().wait(5)
    if mode is POSITION:
        rig.axis.move_relative(90.0, **RAMPS)
    elif mode is VELOCITY:
        rig.axis.move_velocity(180.0, acceleration=720.0)
    else:
        rig.axis.torque_control(0.3, slope=5.0)
    rig.run(0.4)
    rig.axis.halt().wait(5)
    rig.axis.disable().wait(5)


def ended(rig, mode):
    """Whether a scenario ran to its end; if it did not, the axis is stopped: see that it has no power then."""
    try:
        scenario(rig, mode)
    except AxisbusError:
        rig.until(lambda: rig.is_off, 20.0)
        return False
    assert rig.is_off
    assert rig.cycle.failure is None
    return True


@pytest.mark.parametrize("fault", ["silent", "deaf", "wrong_checksum", "short", "late"])
@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_a_lost_or_broken_answer_at_any_request_is_lived_through_or_ends_without_power(mode, fault):
    lived, steps = 0, range(0, 220, 22)
    for step in steps:
        rig = line_rig(mode)
        asked = [0]

        def spoil(_, rig=rig, asked=asked, step=step):
            asked[0] += 1
            if asked[0] == step:
                if fault == "late":
                    rig.station.dials.late[len(rig.station.frames)] = 0.31
                else:
                    setattr(rig.station.dials, fault, 1)

        rig.cycle.wire.before = spoil
        lived += ended(rig, mode)
        assert sum(where == STATE and data[1] == 8 for where, data in rig.written) <= 1
    assert lived > 0.7 * len(steps)


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_an_exception_code_at_any_request_ends_without_power(mode):
    for step in range(1, 220, 22):
        rig = line_rig(mode)
        asked = [0]

        def refuse(request, rig=rig, asked=asked, step=step):
            asked[0] += 1
            rig.station.dials.exceptions.clear()
            if asked[0] == step:
                rig.station.dials.exceptions[request.address, request.writes] = 4

        rig.cycle.wire.before = refuse
        ended(rig, mode)


@settings(max_examples=15, deadline=None)
@given(st.data())
def test_random_commands_never_exceed_the_commanded_speed_and_end_without_power(data):
    mode = data.draw(st.sampled_from([POSITION, VELOCITY]))
    rig = line_rig(mode, turns=data.draw(st.floats(-20, 20)))
    asked = [0.0]

    def note(_):
        assert abs(rig.velocity) <= 1.1 * asked[0] + 15.0

    rig.cycle.wire.before = note
    speeds = st.floats(20.0, 700.0)
    with suppress(AxisbusError):
        rig.axis.enable().wait(5)
        for _ in range(data.draw(st.integers(1, 4))):
            velocity = data.draw(speeds)
            if data.draw(st.integers(0, 4)) == 0:
                name = data.draw(st.sampled_from(["silent", "deaf", "wrong_checksum"]))
                setattr(rig.station.dials, name, data.draw(st.integers(1, 4)))
            asked[0] = max(asked[0], velocity)
            match data.draw(st.sampled_from(["go", "halt", "run"])):
                case "go" if mode is POSITION:
                    rig.axis.move_relative(
                        data.draw(st.floats(-400, 400)), velocity=velocity, acceleration=1000.0
                    )
                case "go":
                    rig.axis.move_velocity(
                        data.draw(st.sampled_from([-1, 1])) * velocity, acceleration=1000.0
                    )
                case "halt":
                    rig.axis.halt().wait(5)
                    assert abs(rig.velocity) < 9.0
            rig.run(0.4)
        rig.axis.disable().wait(10)
    rig.until(lambda: rig.is_off, 20.0)


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_an_adapter_that_holds_its_bytes_slows_the_readings_and_loses_nothing(mode):
    rig = moving(mode, delay=0.03)
    rig.run(3.0)
    assert rig.axis.state is not AxisState.ERRORSTOP
    rig.axis.halt().wait(10)
    assert abs(rig.velocity) < 0.1
    rig.axis.disable().wait(10)
    assert rig.is_off
    assert rig.cycle.failure is None
