"""The stop sequence of a module on Modbus, fed with readings only."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.drives.gim6010.modbus.module import StatusRead
from axisbus.drives.gim6010.modbus.motion.ladder import (
    HaltInputs,
    ModbusStopSequence,
    ModbusStopStep,
    RampHalt,
    Send,
    TrapezoidHalt,
    ramped,
    trapezoid_time,
)

STEP = 0.05


class Motor:
    """A module as the stop sequence sees it: it brakes by ``ramp`` under BRAKE, goes to idle on request, or does not obey."""

    def __init__(
        self,
        velocity=10.0,
        ramp=20.0,
        *,
        obeys=(Send.SETPOINT, Send.BRAKE, Send.IDLE, Send.ESTOP),
        heard=True,
        state=8,
    ):
        self.velocity, self.ramp, self.obeys, self.heard = velocity, ramp, obeys, heard
        self.position, self.state = 0.0, state
        self.braking = 0.0
        self.sent: list[Send] = []

    def take(self, send, ladder):
        if send is Send.NOTHING:
            return
        self.sent.append(send)
        if send not in self.obeys:
            return
        if send in (Send.IDLE, Send.ESTOP):
            self.state, self.braking = 1, 0.5
        elif send is Send.BRAKE:
            self.braking = self.ramp
        elif ladder.halting.register == "velocity_setpoint":
            self.velocity = ladder.value
        else:
            self.braking = abs(self.velocity * self.velocity / (2 * (ladder.value - self.position)))

    def step(self, dt):
        self.velocity = ramped(self.velocity, 0.0, self.braking, dt)
        self.position += self.velocity * dt

    def look(self, now):
        if not self.heard:
            return None
        alive = self.state == 8
        return StatusRead(
            now, self.state, 0, self.position if alive else None, self.velocity if alive else None
        )


def descend(motor, ladder, escalate=()):
    now = 100.0
    for number in range(6000):
        if number in escalate:
            ladder.escalate()
        send = ladder.step(now, motor.look(now) if number else None, held=send_held(motor, number))
        motor.take(send, ladder)
        if ladder.outcome is not None:
            return now - 100.0
        motor.step(STEP)
        now += STEP
    return pytest.fail("it does not end")


def send_held(motor, number):
    return bool(motor.sent) and motor.sent[-1] in motor.obeys


def test_the_stop_sequence_brakes_and_then_switches_the_power_off():
    motor, ladder = Motor(), ModbusStopSequence(None)
    time = descend(motor, ladder)
    assert ladder.outcome.ok
    assert "it stood, and is in idle" in ladder.outcome.text
    assert (motor.sent, ladder.outcome.rung) == ([Send.BRAKE, Send.IDLE], ModbusStopStep.IDLE)
    assert motor.velocity == 0.0
    assert time < 1.2


def test_the_stop_sequence_holds_the_axis_if_requested():
    motor, ladder = Motor(), ModbusStopSequence(None, hold=True)
    descend(motor, ladder)
    assert (ladder.outcome.ok, ladder.outcome.rung, motor.state) == (True, ModbusStopStep.BRAKE, 8)


@pytest.mark.parametrize("velocity", [10.0, -10.0])
def test_a_trapezoid_is_halted_at_the_position_at_which_it_can_stop(velocity):
    motor, ladder = Motor(velocity), ModbusStopSequence(TrapezoidHalt(25.0, 9.0 * velocity), hold=True)
    descend(motor, ladder)
    assert ladder.outcome.ok
    assert motor.sent == [Send.SETPOINT]
    assert motor.position == pytest.approx(
        math.copysign(100.0 / 50.0 + 0.2, velocity) + velocity * STEP, abs=0.6
    )


def test_a_halt_is_not_over_before_its_set_point_is_confirmed():
    """It is at standstill, since it has not begun to move: the target, the velocity would still move it."""
    for halting, values in ((TrapezoidHalt(25.0, 99.0), [0.0]), (RampHalt(5.0, 1.0), None)):
        ladder, sent, now = ModbusStopSequence(halting, hold=True), [], 0.0
        while ladder.outcome is None and now < 5.0:
            if ladder.step(now, StatusRead(now, 8, 0, 0.0, 0.0), held=now > 0.6) is Send.SETPOINT:
                sent.append(ladder.value)
            now += STEP
        assert ladder.outcome.ok
        assert now > 0.6
        assert sent[-1] == 0.0
        assert values is None or set(sent) == set(values)


def test_a_brake_is_not_over_before_it_is_confirmed():
    ladder, now = ModbusStopSequence(None, hold=True), 0.0
    while now < 0.6:
        ladder.step(now, StatusRead(now, 8, 0, 0.0, 0.0), held=False)
        now += STEP
    assert ladder.outcome is None
    ladder.step(now, StatusRead(now, 8, 0, 0.0, 0.0), held=True)
    assert ladder.outcome.ok


def test_an_axis_at_standstill_at_its_target_is_left_alone_and_never_moved_beyond_it():
    moment = HaltInputs(StatusRead(0.0, 8, 0, 5.0, 0.01), 0.0, 0.0, None)
    assert TrapezoidHalt(25.0, 5.01).setpoint(moment) is None
    fast = HaltInputs(StatusRead(0.0, 8, 0, 4.9, 10.0), 0.0, 0.0, None)
    assert TrapezoidHalt(25.0, 5.0).setpoint(fast) == 5.0
    assert TrapezoidHalt(25.0, 4.0).setpoint(fast) == pytest.approx(
        4.9 + 0.2 + 2.0
    )  # it was there, and is thrown beyond


def test_a_ramp_goes_down_in_steps_that_are_never_harder():
    motor, ladder = Motor(10.0), ModbusStopSequence(RampHalt(5.0, 10.0), hold=True)
    time = descend(motor, ladder)
    assert ladder.outcome.ok
    assert set(motor.sent) == {Send.SETPOINT}
    assert 2.0 <= time < 2.6


@pytest.mark.parametrize(
    ("obeys", "rung", "ok"),
    [
        ((Send.BRAKE, Send.IDLE, Send.ESTOP), ModbusStopStep.IDLE, True),  # HALT is not obeyed
        ((Send.IDLE, Send.ESTOP), ModbusStopStep.IDLE, False),
        ((Send.ESTOP,), ModbusStopStep.ESTOP, False),
        ((), ModbusStopStep.ESTOP, False),
    ],
)
def test_a_step_that_is_not_obeyed_is_left_downwards(obeys, rung, ok):
    motor, ladder = Motor(obeys=obeys), ModbusStopSequence(TrapezoidHalt(25.0, 99.0))
    time = descend(motor, ladder)
    assert (ladder.outcome.rung, ladder.outcome.ok) == (rung, ok)
    assert [each for each, _ in itertools.groupby(motor.sent)][: rung + 1] == list(
        (Send.SETPOINT, Send.BRAKE, Send.IDLE, Send.ESTOP)[: rung + 1]
    )
    assert time < 8.0
    assert ok or "NOT" in ladder.outcome.text


def test_a_module_that_answers_nothing_is_still_sent_every_step():
    motor, ladder = Motor(heard=False), ModbusStopSequence(None)
    time = descend(motor, ladder)
    assert "NOT CONFIRMED" in ladder.outcome.text
    assert "it is not heard" in ladder.outcome.text
    assert {Send.BRAKE, Send.IDLE, Send.ESTOP} == set(motor.sent)
    assert (motor.state, time < 5.0) == (1, True)


def test_a_slow_ramp_is_waited_for_as_long_as_it_brakes():
    motor, ladder = Motor(5.0, ramp=0.5), ModbusStopSequence(None)
    assert 10.0 < descend(motor, ladder) < 11.0
    assert ladder.outcome.ok
    motor, ladder = Motor(50.0, ramp=0.5), ModbusStopSequence(None)
    assert 30.0 < descend(motor, ladder) < 33.0
    assert not ladder.outcome.ok


def test_idle_without_a_command_does_not_prove_standstill():
    motor, ladder = Motor(), ModbusStopSequence(None)
    motor.state = 1
    descend(motor, ladder)
    assert not ladder.outcome.ok
    assert "it went to idle without a command" in ladder.outcome.text
    never = ModbusStopSequence(None, was_closed=False)
    descend(motor, never)
    assert never.outcome.ok
    assert "was not seen in closed loop" in never.outcome.text


@pytest.mark.parametrize("state", [3, 4, 7, 11, 99])
def test_a_state_without_set_points_is_switched_off_at_once(state):
    motor, ladder = Motor(state=state), ModbusStopSequence(TrapezoidHalt(25.0, 99.0))
    assert descend(motor, ladder) < 0.5
    assert motor.sent == [Send.IDLE]


def test_each_escalation_goes_to_the_next_stop_step():
    motor, ladder = Motor(ramp=0.01, obeys=(Send.ESTOP,)), ModbusStopSequence(TrapezoidHalt(0.001, 99.0))
    time = descend(motor, ladder, escalate=(2, 4, 6))
    assert time < 1.0
    assert ladder.outcome.rung is ModbusStopStep.ESTOP


def test_a_motor_that_creeps_or_swings_is_not_at_standstill():
    for places in ([0.0, 0.03, 0.06, 0.09, 0.12, 0.15], [0.0, 0.1, 0.0, 0.1, 0.0, 0.1]):
        ladder = ModbusStopSequence(None, hold=True)
        for number, place in enumerate(places):
            ladder.step(number * STEP, StatusRead(number * STEP, 8, 0, place, 0.0), held=True)
        assert ladder.outcome is None


def test_an_idle_state_read_before_idle_was_commanded_does_not_count():
    ladder = ModbusStopSequence(None)
    ladder.escalate()
    assert ladder.step(10.0, StatusRead(9.9, 1, 0), held=False) is Send.IDLE
    assert ladder.outcome is None
    ladder.step(10.1, StatusRead(10.05, 1, 0), held=False)
    assert ladder.outcome is not None


def test_positions_from_before_the_step_are_no_standstill():
    ladder = ModbusStopSequence(None, hold=True)
    for number in range(10):
        ladder.step(10.0 + number * STEP, StatusRead(9.0 + number * STEP, 8, 0, 0.0, 0.0), held=True)
    assert ladder.outcome is None


@given(
    st.floats(-60, 60),
    st.floats(0.1, 100.0),
    st.sets(st.sampled_from([Send.SETPOINT, Send.BRAKE, Send.IDLE, Send.ESTOP])),
    st.booleans(),
    st.sampled_from([None, TrapezoidHalt(10.0, 99.0), RampHalt(10.0, 5.0)]),
    st.sets(st.integers(0, 40)),
    st.sampled_from([1, 3, 8]),
)
def test_the_sequence_always_ends_and_never_reports_a_stop_that_did_not_happen(
    velocity, ramp, obeys, heard, halting, escalate, state
):
    motor, ladder = Motor(velocity, ramp, obeys=obeys, heard=heard, state=state), ModbusStopSequence(halting)
    assert descend(motor, ladder, escalate) < 80.0
    if ladder.outcome.ok:
        assert motor.state == 1
        assert abs(motor.velocity) <= 0.5
    if not heard:
        assert not ladder.outcome.ok
        assert Send.ESTOP in motor.sent


@given(st.floats(-100, 100), st.floats(-100, 100), st.floats(0.001, 1000), st.floats(0, 1))
def test_a_ramp_is_never_steeper_and_never_beyond(value, target, rate, dt):
    found = ramped(value, target, rate, dt)
    assert abs(found - value) <= rate * dt * (1 + 1e-9) + 1e-9
    assert min(value, target) <= found <= max(value, target)


@given(st.floats(-100, 100), st.floats(0.1, 50), st.floats(0.1, 100), st.floats(0.1, 100))
def test_the_time_of_a_trapezoid_is_that_of_its_integral(distance, velocity, acceleration, deceleration):
    time = trapezoid_time(distance, velocity, acceleration, deceleration)
    # by the area under the profile: the highest velocity that this time allows covers the distance
    peak = min(velocity, math.sqrt(2 * abs(distance) / (1 / acceleration + 1 / deceleration)))
    cruise = time - peak / acceleration - peak / deceleration
    assert cruise >= -1e-6
    assert peak * peak / 2 * (1 / acceleration + 1 / deceleration) + peak * cruise == pytest.approx(
        abs(distance), rel=1e-6, abs=1e-6
    )
