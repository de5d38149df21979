"""MIT control of a simulated module in virtual time: no jump, idle after every end, and never a frame of zeros."""

from __future__ import annotations

import json
import math
import re
import struct
from itertools import pairwise

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.mit import MitCommand, MitFeedback, MitRanges
from axisbus.drives.gim6010.mit_control import MitLeader, MitSettings, PositionCrossCheck, ranges_of
from axisbus.drives.gim6010.sim.constants import Firmware
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import ArgumentError
from axisbus.sim.motor import MotorParams
from kit.plain_parameters import PlainParameters
from kit.sim.can_simple_module import ESTOP, IDLE, MIT, POS, SET_MODE, SET_STATE, Bench

MANUAL = MitRanges(12.5, 65.0, 500.0, 5.0, 50.0)
SETTINGS = MitSettings(5, MANUAL, gear=8.0, damping=1.0, period=0.005, command_timeout=0.05)
TURN = math.tau / 8.0  # rad of the output in one turn of the rotor
SPIN = MitCommand(0.0, 6.0, 0.0, 3.0, 0.0)
DAMPING = bytes.fromhex("80 00 80 00 00 33 38 00")  # kd 1 of 5: 819 = 333h, by the manual's formula


class ControllerBench:
    """A controller on a wire; ``sent`` holds its frames, as (time, command, data)."""

    def __init__(self, bench=None, settings=SETTINGS, lose=lambda *_: False, step=0.001):
        self.bench = bench or made()
        self.leader = MitLeader(settings)
        self.sent, self.taken, self.lose, self.step = [], len(self.bench.heard), lose, step

    def run(self, seconds, until=lambda: False, program=lambda: None):
        end = self.bench.now + seconds
        while self.bench.now < end and not until():
            self.bench.run(self.step, self.step)
            for frame in self.bench.heard[self.taken :]:
                if not self.lose("module", frame.command, frame.time):
                    self.leader.note(CanFrame(frame.time, frame.can_id, frame.data))
            self.taken = len(self.bench.heard)
            program()
            frame = self.leader.step(self.bench.now)
            if frame is not None:
                self.sent.append((self.bench.now, frame.can_id & 0x1F, frame.data))
                if not self.lose("master", frame.can_id & 0x1F, self.bench.now):
                    self.bench.send(frame.can_id, frame.data, remote=frame.remote)
        return self

    def enabled(self):
        self.run(5.0, lambda: self.leader.is_running or self.leader.done)
        assert self.leader.is_running, self.leader.why
        return self

    def lead(self, seconds, command):
        """As a program does that gives its command every 10 ms."""
        due = [self.bench.now]

        def program():
            if self.bench.now >= due[0]:
                due[0] += 0.01
                self.leader.command(command, self.bench.now)

        return self.run(seconds, lambda: self.leader.done, program)

    def left(self):
        return self.run(20.0, lambda: self.leader.done)

    def states(self):
        return [int.from_bytes(data[:4], "little") for _, command, data in self.sent if command == SET_STATE]

    def commands(self):
        return [command for _, command, _ in self.sent]

    @property
    def output(self):
        """Where the output truly is, in rad."""
        return self.bench.module.position * TURN


def made(params=None, **more):
    dials = {name: more.pop(name) for name in list(more) if hasattr(ModuleFaults(), name)}
    one = Bench(Module(5, dials=ModuleFaults(**dials), params=params, **more))
    one.run(0.3)
    return one


def judge(led):
    """Check the invariants of all sent frames."""
    zeros = [data for _, command, data in led.sent if command == MIT and not any(data)]
    assert zeros == []
    assert set(led.commands()) <= {MIT, SET_MODE, SET_STATE, ESTOP}
    assert set(led.states()) <= {1, 8}
    assert led.states().count(8) <= 1
    if 8 in led.states():  # idle is asked for after it, and never closed loop again
        after = led.states()[led.states().index(8) + 1 :]
        assert not led.leader.done or (after and set(after) == {1})


# -- enabling --------------------------------------------------------------------------------------------------------------------


def test_a_module_is_enabled_for_mit_control_without_a_jump_for_any_earlier_inputs():
    one = made()
    one.order(SET_MODE, 3, 9)
    one.order(POS, 50.0, 3000, 500)
    one.module.axis.controller.kp, one.module.axis.controller.kd = 400.0, 0.0
    led = ControllerBench(one).enabled()
    led.run(0.5)
    assert abs(led.output) < 0.02  # half a step of torque and of velocity, under damping
    one.must_be_smooth()
    assert led.leader.feedback.position == pytest.approx(led.output, abs=0.01)
    judge(led)


def test_the_frames_that_are_sent_and_their_order():
    led = ControllerBench().enabled()
    begin = led.sent[0][0]
    assert begin >= 1.8  # after listening
    assert led.commands()[:2] == [SET_MODE, MIT]
    assert led.sent[0][2] == bytes.fromhex("03 00 00 00 09 00 00 00")
    before = led.commands().index(SET_STATE)
    assert led.commands()[1:before].count(MIT) >= 3
    assert {data for _, command, data in led.sent if command == MIT} == {DAMPING}
    times = [time for time, command, _ in led.sent if command == MIT]
    steps = {round(b - a, 4) for a, b in pairwise(times)}
    assert max(steps) <= 0.007


@pytest.mark.parametrize(
    ("dials", "before", "why"),
    [
        ({}, lambda one: one.order(SET_STATE, 8), "closed loop"),
        ({"encoder_error": 4}, lambda _: None, "ENCODER_FAILED"),
        ({"dead": True}, lambda _: None, "no heartbeat"),
        ({"heartbeat_stops": True}, lambda _: None, "no heartbeat"),
    ],
    ids=["enabled", "faulty", "dead", "without heartbeats"],
)
def test_reasons_that_prevent_mit_control(dials, before, why):
    one = made(**dials)
    before(one)
    led = ControllerBench(one).left()
    assert led.sent == []
    assert re.search(why, led.leader.why)
    assert led.leader.left == "nothing was sent that moves it"


def test_a_module_that_another_program_commands_is_not_enabled_for_mit_control():
    led = ControllerBench()
    led.run(0.5)
    led.leader.note(CanFrame(led.bench.now, 5 << 5 | SET_STATE, bytes([8, *bytes(7)])))
    led.left()
    assert (led.sent, led.leader.left) == ([], "nothing was sent that moves it")
    assert "another program commands the module" in led.leader.why


def test_a_module_that_does_not_answer_is_not_enabled():
    led = ControllerBench(lose=lambda side, command, _: (side, command) == ("module", MIT)).left()
    assert led.leader.why == "the module does not answer MIT control"
    assert 8 not in led.states()
    assert led.states() == [1] * len(led.states())
    assert not led.bench.module.energised


def test_a_module_that_does_not_start_mit_control_is_set_to_idle():
    led = ControllerBench(made(wont_start=True)).left()
    assert "does not go into closed loop" in led.leader.why
    judge(led)
    assert led.leader.confirmed


# -- control ---------------------------------------------------------------------------------------------------------------------


def test_under_mit_control_a_stiff_command_moves_the_output_to_its_position():
    led = ControllerBench().enabled()
    led.lead(3.0, MitCommand(1.0, 0.0, 20.0, 2.0, 0.0))
    assert led.output == pytest.approx(1.0, abs=0.1)
    cycle = led.leader.answered
    assert (cycle.exact, cycle.saturated) == (True, ())
    assert cycle.feedback.position == pytest.approx(led.output, abs=0.01)
    led.leader.interrupt("over")
    led.left()
    judge(led)
    assert (led.leader.confirmed, led.bench.module.energised) == (True, False)
    led.bench.must_be_smooth()


def test_stiffness_at_the_output_is_converted_by_the_gear():
    """A load of 100 ‰ (0.0625 N·m at the rotor, 0.5 N·m at the output) turns the spring by load over stiffness.

    The wire has no exact 0: half a step of torque (50/4095 N·m) and of velocity (65/4095 rad/s, times kd) carry some of it.
    """
    led = ControllerBench(made(MotorParams(load=100.0, friction=0.0))).enabled()
    here = led.output
    led.lead(4.0, MitCommand(here, 0.0, 20.0, 1.0, 0.0))
    carried = 50.0 / 4095.0 + 65.0 / 4095.0 * SETTINGS.output_damping(1.0)
    assert here - led.output == pytest.approx((0.5 - carried) / SETTINGS.stiffness(20.0), rel=0.03)
    assert SETTINGS.stiffness(20.0) == pytest.approx(20.0 * 8.0 / math.tau)
    assert SETTINGS.kp_for(SETTINGS.stiffness(7.5)) == pytest.approx(7.5)
    assert SETTINGS.output_damping(2.0) == pytest.approx(2.0 * 8.0 / math.tau)
    assert SETTINGS.stiffness(1.0) == pytest.approx(1.273, abs=5e-4)
    assert SETTINGS.output_damping(2.0) == pytest.approx(2.546, abs=1e-3)


def test_a_value_beyond_its_range_is_limited_and_reported():
    led = ControllerBench().enabled()
    led.lead(0.05, MitCommand(20.0, 0.0, 0.0, 5.0, -60.0))
    assert [(each.name, each.sent) for each in led.leader.answered.saturated] == [
        ("position", 12.5),
        ("torque", -50.0),
    ]
    assert not led.leader.answered.exact


def test_a_program_that_waits_for_an_answer_is_not_dead():
    """Answers stay away for longer than its patience, and for less than makes the module lost."""
    since = []
    led = ControllerBench(
        lose=lambda side, command, now: (
            side == "module" and command == MIT and since and now < since[0] + 0.08
        )
    )
    led.enabled()
    led.lead(0.05, SPIN)
    since.append(led.bench.now)
    number = led.leader.command(SPIN, led.bench.now)
    led.run(0.5, lambda: led.leader.answered_number == number or led.leader.why)
    assert (led.leader.why, led.leader.answered_number) == ("", number)
    assert led.bench.now - since[0] >= 0.08


def test_late_frames_are_not_made_up_for():
    led = ControllerBench().enabled()
    led.lead(0.05, MitCommand(0.0, 0.0, 0.0, 1.0, 0.0))
    led.leader.command(MitCommand(0.0, 0.0, 0.0, 1.0, 0.0), led.bench.now)
    led.bench.run(0.04)
    before = len(led.sent)
    led.lead(0.02, MitCommand(0.0, 0.0, 0.0, 1.0, 0.0))
    assert len(led.sent) - before <= 5
    times = [time for time, command, _ in led.sent if command == MIT]
    assert min(b - a for a, b in pairwise(times)) > 0.0039


# -- ends ------------------------------------------------------------------------------------------------------------------------


def spinning(led):
    """At some 6 rad/s."""
    return led.lead(0.3, MitCommand(0.0, 6.0, 0.0, 3.0, 0.0))


def test_a_module_is_braked_by_damping_and_then_set_to_idle():
    led = spinning(ControllerBench().enabled())
    assert led.bench.module.shaft.speed * TURN > 3.0
    led.leader.interrupt("the program has ended it")
    at, since = led.bench.now, len(led.sent)
    led.left()
    frames = led.sent[since:]
    braking = [data for _, command, data in frames if command == MIT]
    assert braking
    assert set(braking) == {DAMPING}
    idle = next(time for time, command, _ in frames if command == SET_STATE)
    assert max(time for time, command, _ in frames if command == MIT) < idle
    slow = next(each for each in led.bench.plant if each.time >= idle)
    assert abs(slow.velocity) * TURN < 0.2
    assert 0.1 < idle - at < 2.1
    assert ESTOP not in led.commands()
    judge(led)


@pytest.mark.parametrize(
    ("act", "why"),
    [
        (lambda _: None, "the program gave no command for 0.05"),
        (lambda led: led.bench.module.axis.estop(), "ESTOP_REQUESTED"),
        (lambda led: setattr(led.bench.module.dials, "encoder_error", 4), "ENCODER_FAILED"),
        (lambda led: setattr(led.bench.module.dials, "dead", True), "not answered"),
        (lambda led: setattr(led.bench.module.dials, "heartbeat_stops", True), "no longer heard"),
        (lambda led: led.bench.order(SET_STATE, IDLE), "is in idle"),
        (lambda led: led.bench.module.restart(), "not answered|restarted"),
        (lambda led: led.leader.note(CanFrame(led.bench.now, 5 << 5 | POS, bytes(8))), "another program"),
        (lambda led: led.leader.interrupt("Ctrl-C"), "Ctrl-C"),
    ],
    ids=["no command", "estop", "error", "dead", "silent", "idle", "restart", "another master", "asked for"],
)
def test_every_end_of_mit_control_leaves_the_module_in_idle(act, why):
    led = spinning(ControllerBench().enabled())
    act(led)
    if why.startswith("the program"):
        led.left()
    else:
        led.lead(15.0, MitCommand(0.0, 6.0, 0.0, 3.0, 0.0))
    assert led.leader.done
    assert re.search(why, led.leader.why), led.leader.why
    judge(led)
    lost = led.bench.module.dials.dead or led.bench.module.dials.heartbeat_stops
    assert led.leader.confirmed is not lost
    assert lost == ("NOT CONFIRMED" in led.leader.left)
    if not led.bench.module.dials.dead:
        assert not led.bench.module.energised


def test_a_module_that_stops_sending_is_braked_for_a_moment_only():
    led = spinning(ControllerBench().enabled())
    led.bench.module.dials.dead = True
    at = led.bench.now
    led.lead(15.0, SPIN)
    idle = next(time for time, command, data in led.sent if command == SET_STATE and data[0] == 1)
    assert 0.3 < idle - at < 0.6


def test_two_sources_of_the_position_that_disagree_stop_the_module():
    feedback = MitFeedback(5, 1.0, 0.0, 0.0)

    def said(turns, closed_at, count=10, age=0.01, speed=0.0):
        agreement = PositionCrossCheck(SETTINGS)
        frames = [
            CanFrame(1.0 + n / 100, 5 << 5 | 9, struct.pack("<ff", turns, speed / TURN)) for n in range(count)
        ]
        return [agreement.take(frame, feedback, frame.time - age, closed_at) for frame in frames][-1]

    assert said(1.0 / TURN, 9.0) == ""
    assert said(1.04 / TURN, 9.0) == ""
    assert "not the module's" in said(1.06 / TURN, 9.0)
    assert "not the module's" in said(2.0 / TURN, 9.0, 5)
    assert said(2.0 / TURN, 9.0, 4) == ""
    assert said(2.0 / TURN, 0.99) == ""  # no heartbeat has shown closed loop since
    assert said(0.0, 9.0) == ""  # dead
    assert said(2.0 / TURN, 9.0, age=0.02) == ""  # it may have turned meanwhile
    assert said(1.3 / TURN, 9.0, speed=-10.0) == ""
    assert "not the module's" in said(1.4 / TURN, 9.0, speed=-10.0)


def test_a_second_interrupt_leads_to_estop():
    led = spinning(ControllerBench().enabled())
    led.leader.interrupt("Ctrl-C")
    led.run(0.01)
    led.leader.interrupt("again")  # this alone changes nothing
    led.run(0.01)
    assert ESTOP not in led.commands()
    led.leader.escalate()
    led.left()
    assert ESTOP in led.commands()
    assert "ESTOP" in led.leader.left
    assert led.leader.why == "Ctrl-C"
    assert not led.bench.module.energised


def test_commands_during_the_stop_are_not_sent():
    led = spinning(ControllerBench().enabled())
    led.leader.interrupt("over")
    since = len(led.sent)
    led.lead(10.0, MitCommand(0.0, 60.0, 0.0, 5.0, 40.0))
    assert {data for _, command, data in led.sent[since:] if command == MIT} == {DAMPING}


def test_at_the_end_of_the_position_s_range_it_is_left():
    led = ControllerBench().enabled()
    led.lead(6.0, MitCommand(0.0, 6.0, 0.0, 3.0, 0.0))
    assert "at the end of its range" in led.leader.why
    assert led.output > 12.0
    assert led.leader.answered.feedback.position < 12.375  # before anything wraps
    assert not led.bench.module.energised


def test_a_position_that_wraps_is_left():
    led = ControllerBench().enabled()
    for position in ("FF 00", "01 00"):
        led.leader.note(CanFrame(led.bench.now, 5 << 5 | MIT, bytes.fromhex(f"05 {position} 80 08 00")))
    assert "may wrap" in led.leader.why


def test_mit_ranges_that_the_module_does_not_have_are_detected():
    one = Bench(Module(5, firmware=Firmware(0, 6, 0), mit_max_pos=25.0))
    one.run(0.3)
    one.module.motor.position = 0.9 * 16384
    led = ControllerBench(one).enabled()
    led.lead(1.0, MitCommand(0.0, 0.0, 0.0, 1.0, 0.0))
    assert "the ranges or the gear" in led.leader.why
    assert not one.module.energised


def test_right_ranges_of_another_firmware_are_not():
    one = Bench(Module(5, firmware=Firmware(0, 6, 0), mit_max_pos=25.0))
    one.run(0.3)
    one.module.motor.position = 0.9 * 16384
    ranges = ranges_of(PlainParameters(one.module))
    assert ranges == MitRanges(25.0, 65.0, 500.0, 5.0, 50.0)
    led = ControllerBench(one, MitSettings(5, ranges, 8.0, 1.0, 0.005, 0.05)).enabled()
    spinning(led)
    assert led.leader.why == ""


def test_ranges_are_fixed_in_older_firmware():
    assert ranges_of(PlainParameters(Module(5, mit_max_pos=25.0))) == MANUAL


# -- whatever comes ----------------------------------------------------------------------------------------------------------------

number = st.floats(allow_nan=False, allow_infinity=False)
near = st.sampled_from([0.0, -12.5, -65.0, -50.0, -1e300, 1e300, 12.5, 500.0, 5.0])
values = number | near
moves = st.builds(MitCommand, values, values, values, values, values)
kinds = st.builds(MitRanges, *[st.floats(1e-3, 1e4)] * 5) | st.just(MANUAL)


@settings(max_examples=25, deadline=None)
@given(st.lists(moves, min_size=1, max_size=6), st.integers(0, 200), st.randoms(use_true_random=False))
@example([MitCommand(-12.5, -65.0, 0.0, 0.0, -50.0)], 200, None)
def test_no_play_sends_a_frame_of_zeros_or_leaves_it_enabled(commands, leave_at, random):
    """Any commands, frames lost on both sides, and an end at any moment."""
    lose = (lambda *_: False) if random is None else (lambda *_: random.random() < 0.05)
    led = ControllerBench(made(), lose=lose, step=0.002)
    led.run(6.0, lambda: led.leader.is_running or led.leader.done)
    for count in range(leave_at):
        led.run(0.002, lambda: led.leader.done)
        led.leader.command(commands[count % len(commands)], led.bench.now)
    led.leader.interrupt("over")
    led.left()
    judge(led)
    assert led.leader.done
    assert not led.leader.confirmed or not led.bench.module.energised


@given(moves, kinds, st.data())
def test_mit_frames_are_never_zeros_for_any_ranges(command, ranges, data):
    damping = data.draw(st.floats(ranges.kd / 4000.0, ranges.kd))
    leader = MitLeader(MitSettings(7, ranges, 8.0, damping, 0.005, 0.05))
    for frame in leader.parting:
        assert any(frame.data)
    kd = int.from_bytes(leader.parting[0].data, "big") >> 12 & 0xFFF
    assert kd >= 1  # it brakes
    assert int.from_bytes(leader.parting[0].data, "big") >> 24 & 0xFFF == 0  # and pulls nowhere
    leader.command(command, 0.0)
    assert any(leader._pack(command).frame.data)


@pytest.mark.parametrize(
    "wrong",
    [
        {"node": 64}, {"node": True}, {"ranges": None}, {"gear": 0.0}, {"gear": math.nan}, {"gear": -8.0},
        {"damping": 0.0}, {"damping": 5.1}, {"damping": math.inf}, {"damping": 0.001}, {"period": 0.0}, {"period": 0.2},
        {"command_timeout": 0.009}, {"command_timeout": 2.0}, {"command_timeout": math.nan}, {"period": "5ms"},
    ],
)  # fmt: skip
def test_invalid_settings_are_refused(wrong):
    given = {
        "node": 5,
        "ranges": MANUAL,
        "gear": 8.0,
        "damping": 1.0,
        "period": 0.005,
        "command_timeout": 0.05,
    }
    with pytest.raises(ArgumentError) as caught:
        MitSettings(**{**given, **wrong})
    assert caught.value.remedy


def test_no_setting_has_a_default():
    with pytest.raises(TypeError):
        MitSettings(5)
    assert json.dumps(sorted(MitSettings.__dataclass_fields__)) == json.dumps(
        ["command_timeout", "damping", "gear", "node", "period", "ranges"]
    )
