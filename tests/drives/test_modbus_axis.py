"""A module that is enabled and moved over Modbus, in virtual time, checked by its motor; and every way in which a command ends."""

from __future__ import annotations

import itertools
import signal
import struct
from contextlib import nullcontext

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.drives.gim6010.modbus.motion import power
from axisbus.drives.gim6010.modbus.motion.axis import ModbusAxis
from axisbus.drives.gim6010.modbus.motion.course import ModbusControlMode
from axisbus.errors import (
    ArgumentError,
    AxisbusError,
    CommandError,
    DriveError,
    DriveFault,
    LimitError,
    MotionTimeout,
    NodeError,
    StaleError,
    StateError,
    TransitionError,
    UncommandedMotion,
)
from kit.modbus.rig import Rig

MOVE = {"velocity": 4.0, "acceleration": 10.0, "deceleration": 10.0}
P, V, T = ModbusControlMode.POSITION, ModbusControlMode.VELOCITY, ModbusControlMode.TORQUE


def within(rig, body):
    """Let a play have an axis, in a block of its own."""
    with rig.axis as axis:
        body(axis)


def is_off(rig, window=0.1):
    """Whether it truly has no power and is at standstill, half a second later."""
    rig.wire.before = lambda _: None
    rig.rest()
    return not rig.plant.energised and abs(rig.velocity) < window


def test_opening_enables_nothing_and_reports_that_nothing_notices_a_dead_master():
    rig = Rig()
    with rig.axis:
        assert "nothing in this module is known to notice a dead master" in rig.said[0]
    assert rig.written == []
    assert len(rig.said) == 1
    assert not rig.plant.energised


def test_enabling_is_modes_then_closed_loop_then_nothing():
    rig = Rig(3.25)
    with rig.axis as axis:
        axis.enable(P)
        assert rig.written == [
            "10 00 68 00 02 04 00 00 00 00",
            "10 00 6A 00 02 04 00 00 00 00",
            "06 00 64 00 03",
            "06 00 65 00 05",
            "06 00 63 00 08",
        ]
        assert rig.plant.energised
        assert rig.plant.position == pytest.approx(3.25, abs=0.001)
        assert axis.control is P
    assert is_off(rig)
    assert "it stood, and is in idle" in rig.said[-1]


@pytest.mark.parametrize("target", [5.0, -2.5, 3.25])
def test_a_move_arrives_by_the_trapezoid(target):
    rig = Rig(3.25)
    fastest = 0.0
    with rig.axis as axis:
        axis.enable(P)
        begin = rig.wire.time

        def note(_):
            nonlocal fastest
            fastest = max(fastest, abs(rig.velocity))

        rig.wire.before = note
        assert axis.move(target, **MOVE) == pytest.approx(target, abs=0.02)
        assert fastest <= 4.0 * 1.05
        assert rig.wire.time - begin < 3.0
        axis.watch(0.3)
    assert is_off(rig)
    assert rig.plant.position == pytest.approx(target, abs=0.05)
    assert not [
        each for each in rig.written if each.startswith("10 00 68") and not each.endswith("00 00 00 00")
    ]


def test_a_relative_move_counts_from_the_actual_position():
    rig = Rig(3.25)
    with rig.axis as axis:
        axis.enable(P)
        axis.move(1.5, relative=True, **MOVE)
        axis.move(-0.5, relative=True, **MOVE)
    assert rig.plant.position == pytest.approx(4.25, abs=0.05)


@pytest.mark.parametrize("velocity", [5.0, -5.0])
def test_a_velocity_is_ramped_from_the_present_one(velocity):
    rig = Rig()
    with rig.axis as axis:
        axis.enable(V)
        begin = rig.wire.time
        axis.turn(velocity, acceleration=10.0)
        assert 0.45 < rig.wire.time - begin < 1.2
        assert rig.velocity == pytest.approx(velocity, rel=0.03)
        axis.watch(0.5)
        axis.turn(-velocity, acceleration=10.0)
        assert rig.velocity == pytest.approx(-velocity, rel=0.03)
        begin = rig.wire.time
        axis.halt()
        assert 0.45 < rig.wire.time - begin < 1.0
        assert rig.plant.energised
        assert abs(rig.velocity) < 0.05
        axis.turn(1.0, acceleration=10.0)
    assert is_off(rig)


def test_a_velocity_does_not_make_up_in_one_step_for_answers_that_were_lost():
    rig = Rig()
    with rig.axis as axis:
        axis.enable(V)
        rig.at(30, lambda _: setattr(rig.station.dials, "deaf", 1))
        axis.turn(5.0, acceleration=10.0)
    velocities = [
        struct.unpack(">f", bytes.fromhex(each[18:]))[0]
        for each in rig.written
        if each.startswith("10 00 68")
    ]
    assert max(velocities) == 5.0
    assert max(after - before for before, after in itertools.pairwise(velocities)) <= 1.0 + 1e-6


def test_a_torque_is_ramped_and_its_velocity_is_monitored():
    rig = Rig()

    def body(axis):
        axis.enable(T)
        axis.push(0.05, slope=0.2, most=0.1, max_velocity=3.0)
        assert rig.plant.usb_read("axis0.controller.input_torque") == pytest.approx(0.05)
        axis.watch(10.0)

    with pytest.raises(UncommandedMotion, match="faster than commanded"):
        within(rig, body)
    assert abs(rig.velocity) < 0.1
    assert is_off(rig)


def test_a_blocked_motor_is_pushed_for_its_time():
    rig = Rig()
    rig.plant.dials.blocked = True
    with rig.axis as axis:
        axis.enable(T)
        axis.push(0.05, slope=0.2, most=0.1, max_velocity=3.0)
        axis.watch(1.0)
        assert rig.plant.axis.controller.torque_setpoint == pytest.approx(0.05, abs=0.001)
    assert is_off(rig)


def test_a_halt_during_a_move_leaves_the_axis_enabled_and_another_move_continues():
    rig = Rig()
    with rig.axis as axis:
        axis.enable(P)
        rig.at(60, lambda _: signal.raise_signal(signal.SIGINT))
        with pytest.raises(KeyboardInterrupt):
            axis.move(20.0, **MOVE)
        assert rig.velocity > 2.0
        where = rig.plant.position
        axis.halt()
        assert abs(rig.velocity) < 0.05
        assert rig.plant.position - where < 4.0 * 4.0 / 20.0 + 1.0
        assert axis.control is P
        axis.watch(0.5)
        assert axis.move(2.0, **MOVE) == pytest.approx(2.0, abs=0.02)
    assert is_off(rig)


def test_disable_may_be_repeated_and_enabling_works_again():
    rig = Rig()
    with rig.axis as axis:
        axis.disable()
        axis.enable(V)
        axis.turn(2.0, acceleration=10.0)
        axis.disable()
        axis.disable()
        assert is_off(rig)
        axis.enable(P)
        axis.move(1.0, relative=True, **MOVE)
    assert is_off(rig)


# -- refusals ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda axis: axis.move(1.0, **{**MOVE, "velocity": 0.0}), ArgumentError),
        (lambda axis: axis.move(1.0, **{**MOVE, "acceleration": -1.0}), ArgumentError),
        (lambda axis: axis.move(1.0, **{**MOVE, "deceleration": float("inf")}), ArgumentError),
        (lambda axis: axis.move(float("nan"), **MOVE), ArgumentError),
        (lambda axis: axis.move(1e39, **MOVE), LimitError),
        (lambda axis: axis.move(1.0, **{**MOVE, "velocity": 31.0}), LimitError),
        (lambda axis: axis.turn(1.0, acceleration=5.0), StateError),
        (lambda axis: axis.push(1.0, slope=1.0, most=1.0, max_velocity=1.0), StateError),
        (lambda axis: axis.watch(0.0), ArgumentError),
        (lambda axis: axis.enable(V), StateError),
    ],
)
def test_invalid_commands_are_refused_before_anything_is_sent(call, error):
    rig = Rig()
    with rig.axis as axis:
        axis.enable(P)
        before = len(rig.written)
        with pytest.raises(error):
            call(axis)
        assert len(rig.written) == before
        assert rig.velocity == pytest.approx(0.0, abs=0.01)


def test_commands_outside_the_block_or_without_power_are_refused():
    rig = Rig()
    axis = rig.axis
    for call in (
        lambda: axis.enable(P),
        axis.halt,
        axis.disable,
        axis.quick_stop,
        lambda: axis.move(1.0, **MOVE),
    ):
        with pytest.raises(StateError):
            call()
    with axis:
        for call in (axis.halt, lambda: axis.move(1.0, **MOVE), lambda: axis.watch(1.0)):
            with pytest.raises(StateError, match="not enabled"):
                call()
    assert rig.written == []


def test_torques_and_velocities_beyond_the_limits_are_refused():
    rig = Rig()
    with rig.axis as axis:
        axis.enable(T)
        with pytest.raises(LimitError, match="beyond the limit"):
            axis.push(0.2, slope=1.0, most=0.1, max_velocity=1.0)
    with rig.axis as axis:
        axis.enable(V)
        with pytest.raises(LimitError, match="velocity_limit"):
            axis.turn(-30.5, acceleration=1.0)


def test_a_module_with_errors_in_another_state_or_without_limits_is_not_enabled():
    rig = Rig()
    rig.plant.axis.estop()
    with rig.axis as axis:
        with pytest.raises(DriveFault, match="with errors") as caught:
            axis.enable(P)
        assert "ESTOP_REQUESTED" in caught.value.observed
        rig.module.clear_errors()
        for limit in ("velocity_limit", "current_limit"):
            rig.module.write(limit, 0.0)
            with pytest.raises(StateError, match=f"its {limit} is 0"):
                axis.enable(P)
            rig.module.write(limit, 10.0)
        rig.plant.usb_write("axis0.requested_state", 3)
        with pytest.raises(StateError, match="motor calibration"):
            axis.enable(P)
    assert "06 00 63 00 08" not in rig.written


def test_a_module_that_was_found_enabled_is_left_so_and_reported():
    rig = Rig()
    rig.plant.usb_write("axis0.requested_state", 8)
    with rig.axis as axis:
        assert "it is in closed loop, and stays in this state" in rig.said[-1]
        with pytest.raises(StateError):
            axis.enable(P)
    assert rig.plant.energised
    assert rig.written == []


# -- faults during a motion --------------------------------------------------------------------------------------------


def test_a_module_that_does_not_enable_is_reported_and_commanded_once():
    rig = Rig()
    rig.plant.dials.wont_start = True
    with pytest.raises(TransitionError, match="does not go to closed loop") as caught, rig.axis as axis:
        axis.enable(P)
    assert "state 8 was written and taken" in caught.value.observed
    assert rig.written.count("06 00 63 00 08") == 1
    assert is_off(rig)
    assert "was not seen in closed loop" in rig.said[-1]


def test_a_module_that_moves_to_an_old_set_point_when_enabled_is_stopped_at_once():
    rig = Rig(keeps_target=True)
    with rig.axis as axis:
        axis.enable(P)
        axis.move(3.0, **MOVE)
    rig.plant.motor.position -= 30.0 * 16384  # it is turned back by hand while it has no power
    with pytest.raises(UncommandedMotion, match="with a set-point of 3"), rig.axis as axis:
        axis.enable(P)
    assert is_off(rig)
    assert rig.plant.position < -26.0


def test_a_module_that_another_master_moves_away_is_reported():
    rig = Rig()

    def body(axis):
        axis.enable(P)
        axis.move(1.0, **MOVE)
        rig.plant.usb_write("axis0.controller.input_pos", 3.0)  # another master
        axis.watch(5.0)

    with pytest.raises((UncommandedMotion, MotionTimeout)):
        within(rig, body)
    assert is_off(rig)


def test_a_blocked_motor_does_not_arrive_and_is_switched_off():
    rig = Rig()

    def body(axis):
        axis.enable(P)
        rig.plant.dials.blocked = True
        axis.move(5.0, **MOVE)

    with pytest.raises(MotionTimeout, match="has not arrived in time"):
        within(rig, body)
    assert is_off(rig)

    def body(axis):
        axis.enable(V)
        axis.turn(5.0, acceleration=10.0)

    with pytest.raises(MotionTimeout):
        within(rig, body)
    assert is_off(rig)


def test_an_error_of_the_module_is_reported_by_its_bits():
    rig = Rig()

    def body(axis):
        axis.enable(V)
        axis.turn(5.0, acceleration=10.0)
        rig.plant.dials.encoder_error = 4
        axis.watch(5.0)

    with pytest.raises(DriveFault) as caught:
        within(rig, body)
    assert "encoder NO_RESPONSE" in caught.value.observed
    assert "whether it is at standstill is NOT known" in str(caught.value)
    assert not rig.plant.energised


def test_a_count_that_jumps_when_it_is_enabled_is_reported():
    rig = Rig()

    def jump(_):
        rig.plant.shaft.origin -= 0.5

    rig.at(LENGTHS[play] // 3, jump)
    with pytest.raises(UncommandedMotion, match="moves without a command"):
        within(rig, lambda axis: axis.enable(V))
    assert is_off(rig)


def test_a_module_that_another_program_switches_off_is_reported():
    rig = Rig()

    def body(axis):
        axis.enable(P)
        rig.plant.usb_write("axis0.requested_state", 1)
        axis.move(1.0, **MOVE)

    with pytest.raises(DriveFault, match="is in idle") as caught:
        within(rig, body)
    assert "another program" in caught.value.observed


def test_a_position_that_is_no_number_ends_a_motion():
    rig = Rig()

    def body(axis):
        axis.enable(P)
        rig.plant.endpoints._live["axis0.encoder.pos_estimate"] = lambda: float("nan")
        axis.move(1.0, **MOVE)

    with pytest.raises(StaleError):
        within(rig, body)
    assert not rig.plant.energised


def test_a_module_that_turns_uncommanded_when_enabled_is_reported():
    rig = Rig()
    rig.plant.usb_write("axis0.controller.config.input_mode", 2)
    original = rig.plant.axis.controller.start

    def start():
        original()
        rig.plant.axis.controller.input_vel = 6.0

    rig.plant.axis.controller.start = start
    with pytest.raises(UncommandedMotion), rig.axis as axis:
        axis.enable(V)
    assert is_off(rig)


# -- every end ---------------------------------------------------------------------------------------------------------


def play(axis):
    axis.enable(P)
    axis.move(1.5, velocity=4.0, acceleration=40.0, deceleration=40.0)
    axis.watch(0.1)


def turning(axis):
    axis.enable(V)
    axis.turn(3.0, acceleration=20.0)
    axis.watch(0.1)


def pushing(axis):
    axis.enable(T)
    axis.push(0.02, slope=0.2, most=0.1, max_velocity=20.0)
    axis.watch(0.1)


PLAYS = (play, turning, pushing)


def length(what):
    """The number of requests of a run, before the stop sequence sends its own."""
    rig, asked = Rig(), []

    def body(axis):
        what(axis)
        asked.append(len(rig.wire.asked))

    within(rig, body)
    return asked[0]


LENGTHS = {what: length(what) for what in PLAYS}
# The requests at which a fault occurs: each of those that open and enable, and some of those during the motion.
SPREAD = {what: [*range(36), *range(36, LENGTHS[what], 17)] for what in PLAYS}


SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGTSTP") if hasattr(signal, name)
]


@pytest.mark.parametrize("what", PLAYS)
@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_at_any_request_leaves_it_at_standstill_without_power(what, number):
    before = signal.getsignal(number)
    for step in SPREAD[what][number % 4 :: 6]:
        rig = Rig()
        rig.at(
            step + 4, lambda _: signal.raise_signal(number)
        )  # before, opening asks, and signals are not ours
        keys = number.name in ("SIGINT", "SIGTSTP")
        wanted = KeyboardInterrupt if keys else SystemExit
        with pytest.raises(wanted) as caught, rig.axis as axis:
            what(axis)
        assert keys or caught.value.code == 128 + number
        assert is_off(rig), step
        assert signal.getsignal(number) is before


@pytest.mark.parametrize("what", PLAYS)
def test_a_signal_between_our_calls_ends_the_program_s_own_work(what):
    rig = Rig()

    def body(axis):
        what(axis)
        signal.raise_signal(signal.SIGINT)
        pytest.fail("it was not interrupted")

    with pytest.raises(KeyboardInterrupt):
        within(rig, body)
    assert is_off(rig)


def test_a_second_signal_goes_to_the_next_stop_step():
    rig = Rig()
    rig.plant.usb_write("axis0.controller.config.vel_ramp_rate", 0.5)
    begin = []

    def body(axis):
        axis.enable(V)
        rig.plant.usb_write("axis0.controller.config.vel_ramp_rate", 50.0)
        axis.turn(10.0, acceleration=20.0)
        rig.plant.usb_write("axis0.controller.config.vel_ramp_rate", 0.1)
        begin.append(rig.wire.time)
        rig.at(10, lambda _: signal.raise_signal(signal.SIGINT))
        rest = rig.wire.before

        def twice(request):
            rest(request)
            if len(rig.wire.asked) % 9 == 0:
                signal.raise_signal(signal.SIGINT)

        rig.wire.before = twice
        axis.disable()

    with pytest.raises(DriveError, match="NOT known"):
        within(rig, body)
    assert rig.wire.time - begin[0] < 2.0
    assert not rig.plant.energised


def test_a_program_whose_output_fails_still_stops_the_module():
    rig = Rig()
    axis = ModbusAxis(rig.module, tell=lambda text: None if "dead master" in text else 1 / 0)
    with pytest.raises(ZeroDivisionError), axis:
        turning(axis)
    assert is_off(rig)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_torque_is_taken_back_when_it_brakes():
    rig = Rig()
    with rig.axis as axis:
        pushing(axis)
        assert rig.plant.usb_read("axis0.controller.input_torque") > 0.0
    assert rig.plant.usb_read("axis0.controller.input_torque") == 0.0
    assert is_off(rig)


def test_a_motion_ends_when_its_watchdog_process_ends():
    rig = Rig()
    there = [True]
    axis = ModbusAxis(rig.module, tell=rig.said.append, guarded=lambda: there[0])

    def body(axis):
        turning(axis)
        there.clear()
        there.append(False)
        axis.watch(10.0)

    with pytest.raises(CommandError, match="watchdog process of this motion has ended"), axis:
        body(axis)
    assert is_off(rig)


def test_after_the_block_no_exit_handler_is_registered(monkeypatch):
    left = []
    monkeypatch.setattr(power.atexit, "register", left.append)
    monkeypatch.setattr(power.atexit, "unregister", left.remove)
    rig = Rig()
    with rig.axis as axis:
        turning(axis)
        assert len(left) == 1
    assert left == []


class Own(Exception):
    pass


@pytest.mark.parametrize("what", PLAYS)
def test_an_error_of_the_program_stops_it_and_continues(what):
    rig = Rig()

    def body(axis):
        what(axis)
        raise Own

    with pytest.raises(Own):
        within(rig, body)
    assert is_off(rig)


@pytest.mark.parametrize("what", PLAYS)
@pytest.mark.parametrize("first", [0, 1])
def test_a_lost_or_broken_answer_at_any_question_is_lived_through_or_ends_safely(what, first):
    lived, faults = 0, itertools.cycle(("silent", "deaf", "wrong_checksum", "short", "late"))
    for step in SPREAD[what][first::3]:
        rig = Rig()

        fault = next(faults)

        def spoil(_, rig=rig, fault=fault):
            if fault == "late":
                rig.station.dials.late[len(rig.station.frames)] = 0.31
            else:
                setattr(rig.station.dials, fault, 1)

        rig.at(step, spoil)
        try:
            with rig.axis as axis:
                what(axis)
            lived += 1
        except AxisbusError:
            pass
        assert is_off(rig), step
        assert rig.written.count("06 00 63 00 08") <= 1, "closed loop is asked for once"
    assert lived > 0.8 * len(SPREAD[what][first::3])


@pytest.mark.parametrize("what", PLAYS)
def test_an_exception_code_at_any_question_ends_safely(what):
    for step in SPREAD[what][::2]:
        rig = Rig()

        def refuse(request, rig=rig):
            rig.station.dials.exceptions[request.address, request.writes] = 4
            rig.at(0, lambda _: rig.station.dials.exceptions.clear())

        rig.at(step, refuse)
        with pytest.raises(NodeError, match="refuses"), rig.axis as axis:
            what(axis)
        assert is_off(rig), step


@pytest.mark.parametrize("what", PLAYS)
def test_if_answers_are_lost_for_good_it_is_stopped_blind_and_reported_as_not_confirmed(what):
    for step in SPREAD[what][::7]:
        rig = Rig()
        rig.at(step, lambda _, rig=rig: setattr(rig.wire, "mute", True))
        with pytest.raises(NodeError) as caught, rig.axis as axis:
            what(axis)
        notes = str(caught.value)
        if "06 00 63 00 08" in rig.written:
            assert "NOT CONFIRMED" in notes
            assert "NOT CONFIRMED" in rig.said[-1]
        assert is_off(rig, 3.5), step  # it coasts where the line was lost under torque


@pytest.mark.parametrize("what", PLAYS)
def test_a_cable_that_is_pulled_is_reported_in_bounded_time(what):
    for step in SPREAD[what][::15]:
        rig = Rig()
        rig.at(step, lambda _, rig=rig: setattr(rig.wire, "broken", True))
        with pytest.raises(NodeError), rig.axis as axis:
            what(axis)
        assert rig.wire.time < 30.0


@pytest.mark.parametrize("what", PLAYS)
def test_faults_during_the_stop_sequence_end_safely_and_are_reported(what):
    faults = itertools.cycle(("silent", "deaf", "wrong_checksum", "short"))
    for step, fault in zip(range(0, 30, 5), faults, strict=False):
        rig = Rig()
        rig.at(LENGTHS[what] + step, lambda _, rig=rig, fault=fault: setattr(rig.station.dials, fault, 2))
        told = "it stood, and is in idle"
        try:
            within(rig, what)
        except DriveError:
            told = "NOT"
        assert told in rig.said[-1]
        assert is_off(rig), step


@pytest.mark.parametrize("what", PLAYS)
def test_a_refused_request_of_the_stop_sequence_does_not_prevent_the_next_step(what):
    rig = Rig()
    refused = {(register, True): 4 for register in (0x63, 0x64, 0x65, 0x66, 0x68, 0x6A)}
    rig.at(LENGTHS[what], lambda _: rig.station.dials.exceptions.update(refused))
    with (
        nullcontext()
        if what is play
        else pytest.raises(DriveError, match="whether it is at standstill is NOT known")
    ):
        within(rig, what)  # standstill before was seen
    assert "emergency stop latches" in rig.said[-1]
    assert not rig.plant.energised
    assert "06 00 61 00 01" in rig.written


def test_a_brake_that_is_taken_and_does_not_hold_is_sent_again_and_given_up():
    rig = Rig()

    def body(axis):
        axis.enable(V)
        axis.turn(-3.0, acceleration=20.0)
        rig.station.dials.clamps[0x68] = -3.0  # whatever velocity is written, it keeps this one

    with pytest.raises(DriveError, match="whether it is at standstill is NOT known"):
        within(rig, body)
    assert rig.written.count("06 00 64 00 02") > 2
    assert not rig.plant.energised


def test_a_cable_reconnected_during_the_stop_sequence_is_used():
    rig = Rig()

    def body(axis):
        axis.enable(V)
        axis.turn(5.0, acceleration=20.0)
        rig.wire.broken = True
        rig.at(8, lambda _: setattr(rig.wire, "broken", False))
        axis.watch(5.0)

    with pytest.raises(NodeError):
        within(rig, body)
    assert is_off(rig)


def test_a_dead_master_is_noticed_by_nothing():
    """The statement of ``DEAD_MASTER``, on the simulated module: a velocity continues, and a position is held."""
    rig = Rig()
    axis = rig.axis
    axis.__enter__()
    axis.enable(V)
    axis.turn(3.0, acceleration=20.0)
    rig.rest(20.0)  # no request any more
    assert rig.velocity == pytest.approx(3.0, rel=0.02)
    axis.__exit__(None, None, None)
    assert is_off(rig)


def test_the_end_of_the_interpreter_stops_an_open_block():
    rig = Rig()
    axis = rig.axis
    axis.__enter__()
    axis.enable(V)
    axis.turn(3.0, acceleration=20.0)
    axis._last_resort()
    assert is_off(rig)
    axis.__exit__(None, None, None)


def test_a_module_that_another_program_enabled_is_only_stopped_by_a_quick_stop():
    rig = Rig()
    for path, value in (("config.control_mode", 2), ("config.input_mode", 2)):
        rig.plant.usb_write(f"axis0.controller.{path}", value)
    rig.plant.usb_write("axis0.requested_state", 8)
    rig.plant.usb_write("axis0.controller.input_vel", 8.0)
    rig.rest(1.0)
    assert rig.velocity > 7.0
    with rig.axis as axis:
        axis.quick_stop()
    assert is_off(rig)
    assert "it stood, and is in idle" in rig.said[-1]
    with rig.axis as axis:
        axis.quick_stop()
    assert "there is no power to be stopped" in rig.said[-1]


@settings(max_examples=8, deadline=None)
@given(st.data())
def test_random_sequences_end_without_power_and_never_exceed_the_commanded_speed(data):
    rig = Rig(data.draw(st.floats(-20, 20)))
    control = data.draw(st.sampled_from([P, V]))
    fastest = [0.0]
    asked = [0.0]

    def note(_):
        fastest[0] = max(fastest[0], abs(rig.velocity))
        assert fastest[0] <= 1.1 * asked[0] + 0.3

    rig.wire.before = note
    speeds = st.floats(0.5, 20.0)
    try:
        with rig.axis as axis:
            axis.enable(control)
            for _ in range(data.draw(st.integers(1, 4))):
                velocity = data.draw(speeds)
                asked[0] = max(asked[0], velocity)
                if data.draw(st.integers(0, 4)) == 0:
                    setattr(
                        rig.station.dials,
                        data.draw(st.sampled_from(["silent", "deaf", "wrong_checksum"])),
                        data.draw(st.integers(1, 4)),
                    )
                match data.draw(st.sampled_from(["go", "halt", "watch"])):
                    case "go" if control is P:
                        axis.move(
                            data.draw(st.floats(-10, 10)),
                            velocity=velocity,
                            acceleration=30.0,
                            deceleration=15.0,
                            relative=True,
                        )
                    case "go":
                        axis.turn(data.draw(st.sampled_from([-1, 1])) * velocity, acceleration=30.0)
                    case "halt":
                        axis.halt()
                        assert abs(rig.velocity) < 0.2
                        control = axis.control
                    case "watch":
                        axis.watch(0.2)
    except AxisbusError:
        pass
    assert is_off(rig)


def test_the_tested_class_is_the_public_one():
    assert isinstance(Rig().axis, ModbusAxis)
