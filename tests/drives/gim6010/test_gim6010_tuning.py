"""A trial of gains on simulated modules in virtual time: a step there and back, measured, and ended by whatever comes between."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.drives.gim6010 import tuning as search
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from axisbus.drives.gim6010.tuning import Gains, Loop, ModuleTrial, ModuleTuning, explanation
from axisbus.errors import ArgumentError
from axisbus.sim.motor import MotorParams
from axisbus.step_response import Response, measure
from kit.module_dialogue import play
from kit.sim.can_simple_module import (
    ESTIMATES,
    ESTOP,
    IDLE,
    POS,
    POS_GAIN,
    SET_MODE,
    SET_STATE,
    TRAJ_ACCEL,
    TRAJ_VEL,
    VEL,
    VEL_GAINS,
    Bench,
)

STEP = 0.002
POSITION = ModuleTrial(5, Loop.POSITION, 2.0, 1.5, velocity=5.0, acceleration=20.0)
VELOCITY = ModuleTrial(5, Loop.VELOCITY, 4.0, 1.0)


def bench(params=None, **dials):
    one = Bench(Module(5, dials=ModuleFaults(**dials), params=params, vel_ramp_rate=20.0))
    one.run(0.3)
    return one


def tried(trial, one=None, gains=None, **more):
    one = one or bench()
    found = ModuleTuning(trial, gains or Gains())
    sent = play(found, one, step=STEP, **more)
    return found, one, sent


def states(sent):
    return [int.from_bytes(each.data[:4], "little") for each in sent if each.command == SET_STATE]


@pytest.mark.parametrize("size", [2.0, -2.0])
def test_a_step_of_position_there_and_back(size):
    found, one, sent = tried(ModuleTrial(5, Loop.POSITION, size, 1.5, velocity=5.0, acceleration=20.0))
    assert (found.ended, found.why, found.confirmed) == (True, "", True)
    turns = [each.position for each in one.plant]
    assert max(map(abs, turns)) == pytest.approx(2.0, abs=0.02)
    assert math.copysign(1.0, max(turns, key=abs)) == math.copysign(1.0, size)
    assert abs(one.module.position) < 0.02
    for response in (found.there, found.back):
        assert response.overshoot < 0.01
        assert 0.5 < response.settled < 1.0  # the trapezoid takes 0.65 s
        assert response.ripple < 0.01
        assert abs(response.left) < 0.01
    assert (states(sent)[0], set(states(sent)[1:])) == (8, {IDLE})
    assert max(abs(each.velocity) for each in one.plant) < 5.5
    assert not one.module.energised
    assert {each.command for each in sent} == {TRAJ_VEL, TRAJ_ACCEL, VEL, SET_MODE, SET_STATE, ESTIMATES, POS}
    one.must_be_smooth()


def test_a_step_begins_at_the_present_position():
    one = Bench(Module(5, params=MotorParams(start_position=5.3 * 16384)))
    one.run(0.3)
    found, _, _ = tried(POSITION, one)
    assert found.ended
    turns = [each.position for each in one.plant]
    assert (min(turns), max(turns)) == pytest.approx((5.3, 7.3), abs=0.02)
    assert one.module.position == pytest.approx(5.3, abs=0.02)
    one.must_be_smooth()


def test_a_step_of_velocity():
    found, one, sent = tried(VELOCITY)
    assert found.ended
    assert max(each.velocity for each in one.plant) == pytest.approx(4.0, abs=0.2)
    assert 0.1 < found.there.settled < 0.4  # 4 turns/s at 20 turns/s²
    assert found.back.overshoot < 0.02
    assert (one.module.energised, abs(one.module.shaft.speed) < 0.1) == (False, True)
    assert states(sent)[0] == 8
    one.must_be_smooth()


def test_no_mode_of_direct_control_is_ever_set():
    for trial in (POSITION, VELOCITY):
        modes = {each.data for each in tried(trial)[2] if each.command == SET_MODE}
        assert modes <= {bytes([3, 0, 0, 0, 5, 0, 0, 0]), bytes([2, 0, 0, 0, 2, 0, 0, 0])}


def test_a_motor_on_a_spring_overshoots_and_rings():
    soft, wild = (
        tried(POSITION, bench(MotorParams(stiffness=each, damping=0.05)))[0] for each in (0.3, 0.05)
    )
    assert soft.ended
    assert soft.there.overshoot > 0.005 > tried(POSITION)[0].there.overshoot
    assert wild.there.overshoot > 0.2
    assert wild.there.settled is None
    assert wild.there.ripple > 0.2


def test_gains_are_set_before_it_is_enabled():
    gains = Gains(11.0, 0.2, 0.0)
    _, one, sent = tried(POSITION, gains=gains)
    commands = [each.command for each in sent]
    assert max(commands.index(POS_GAIN), commands.index(VEL_GAINS)) < commands.index(SET_STATE)
    found = [
        one.module.usb_read(f"axis0.controller.config.{n}")
        for n in ("pos_gain", "vel_gain", "vel_integrator_gain")
    ]
    assert found == pytest.approx([11.0, 0.2, 0.0])
    assert one.module.restarts == 0
    assert Gains().frames(5) == ()
    assert [frame.can_id for frame in Gains(position=1.0).frames(5)] == [5 << 5 | POS_GAIN]


# -- interruptions -----------------------------------------------------------------------------------------------------------------


def when(moment, act):
    done = []

    def look(one):
        if one.now >= moment and not done:
            done.append(True)
            act(one)

    return look


@settings(max_examples=12, deadline=None)
@given(st.floats(0.3, 5.5), st.integers(0, 2), st.sampled_from([POSITION, VELOCITY]))
def test_a_trial_interrupted_at_any_moment_stops(moment, more, trial):
    one = bench()
    found = ModuleTuning(trial, Gains())

    def interrupt(_):
        for _ in range(1 + more):
            found.interrupt("Ctrl-C")

    sent = play(found, one, at=when(moment, interrupt), step=STEP)
    assert not one.module.energised
    assert found.ended or found.why == "Ctrl-C"
    assert states(sent).count(8) <= 1
    if more == 0:
        assert ESTOP not in [each.command for each in sent]
        assert abs(one.module.shaft.speed) < 0.3
    one.must_be_smooth()


@pytest.mark.parametrize(
    ("act", "why"),
    [
        (lambda one: setattr(one.module.dials, "dead", True), "(does not|no longer) reports? its position"),
        (lambda one: setattr(one.module.dials, "heartbeat_stops", True), "no longer heard"),
        (lambda one: setattr(one.module.dials, "encoder_error", 4), "ENCODER_FAILED"),
        (lambda one: one.order(SET_STATE, IDLE), "is in idle"),
        (lambda one: one.module.restart(), "(does not|no longer) reports? its position|restarted"),
        (lambda one: one.module.axis.estop(), "ESTOP_REQUESTED"),
    ],
    ids=["dead", "silent", "error", "idle", "restart", "estop"],
)
@pytest.mark.parametrize("trial", [POSITION, VELOCITY], ids=["position", "velocity"])
def test_any_event_during_a_trial_ends_it(act, why, trial):
    found, one, sent = tried(trial, at=when(2.3, act))
    assert re.search(why, found.why), found.why
    assert not found.ended
    assert IDLE in states(sent) or one.module.dials.dead
    lost = one.module.dials.dead or one.module.dials.heartbeat_stops
    assert found.confirmed is not lost
    if not one.module.dials.dead:
        assert not one.module.energised


def test_a_velocity_that_was_left_in_the_module_does_not_turn_it():
    one = bench()
    one.order(VEL, 3.0, 0.0)
    _, _, sent = tried(VELOCITY, one)
    step = next(each.time for each in sent if each.command == VEL and any(each.data))
    assert max(abs(each.velocity) for each in one.plant if each.time < step) < 0.01


def test_a_second_interrupt_does_not_wait_for_the_brake():
    found, one = ModuleTuning(VELOCITY, Gains()), bench()

    def twice(_):
        found.interrupt("Ctrl-C")
        found.interrupt("Ctrl-C")

    sent = play(found, one, at=when(2.4, twice), step=STEP)
    estop = [each.time for each in sent if each.command == ESTOP]
    assert 2.4 <= estop[0] < 2.42
    assert "ESTOP" in found.left


def test_a_module_that_switched_itself_off_gets_idle_soon():
    _, _, sent = tried(VELOCITY, at=when(2.4, lambda one: one.module.axis.estop()))
    idle = next(each.time for each in sent if each.command == SET_STATE and each.data[0] == IDLE)
    assert idle < 2.8


def test_a_tuning_move_that_goes_too_far_or_too_fast_is_stopped():
    far, _, _ = tried(POSITION, at=when(2.3, lambda one: one.order(POS, 30.0, 0, 0)))
    assert "farther than allowed" in far.why

    def rush(one):
        one.order(TRAJ_VEL, 25.0)
        one.order(TRAJ_ACCEL, 500.0, 500.0)
        one.order(POS, 3.0, 0, 0)

    fast, one, _ = tried(POSITION, at=when(2.0, rush))
    assert "faster than it may" in fast.why
    assert not one.module.energised


@pytest.mark.parametrize("lost", [SET_STATE, ESTIMATES])
def test_a_module_that_does_not_start_a_tuning_move_is_set_to_idle(lost):
    one = bench()
    one.module.parameters["axis0.config.can.encoder_rate_ms"] = 0
    found, one, _ = tried(
        POSITION, one, lose=lambda side, command, now: side == "master" and command == lost and now < 5.0
    )
    assert "does not enter closed loop, or does not report" in found.why
    assert not one.module.energised


# -- arguments and messages ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "wrong",
    [
        {"node": 64}, {"size": 0.0}, {"size": math.nan}, {"size": math.inf}, {"seconds": 0.0}, {"seconds": 31.0},
        {"velocity": 0.0}, {"acceleration": 0.0}, {"velocity": math.inf}, {"seconds": 0.6}, {"size": 1000.0},
    ],
)  # fmt: skip
def test_invalid_trials_are_refused(wrong):
    given_ = {
        "node": 5,
        "loop": Loop.POSITION,
        "size": 2.0,
        "seconds": 1.5,
        "velocity": 5.0,
        "acceleration": 20.0,
    }
    with pytest.raises(ArgumentError) as caught:
        ModuleTrial(**{**given_, **wrong})
    assert caught.value.remedy


@pytest.mark.parametrize(
    "wrong", [(-1.0, None, None), (None, 0.1, None), (None, None, 0.1), (math.nan, None, None)]
)
def test_invalid_gains_are_refused(wrong):
    with pytest.raises(ArgumentError):
        Gains(*wrong)


def test_how_long_a_trapezoid_takes():
    assert POSITION.takes == pytest.approx(2.0 / 5.0 + 5.0 / 20.0)
    assert ModuleTrial(5, Loop.POSITION, -0.2, 1.5, velocity=5.0, acceleration=20.0).takes == pytest.approx(
        0.2
    )


def test_the_explanation_names_the_step_and_its_limits():
    text = "\n".join(explanation(POSITION))
    assert "by 2 rotor turns (90 degrees of the output at 8:1) and back again" in text
    assert "farther than 3.1 rotor turns from its present position (139.5 degrees" in text
    assert "4 turns/s (180 degrees/s of the output at 8:1) for 1 s" in "\n".join(explanation(VELOCITY))


def ring(decay, overshoot):
    """1 - e^(-decay t) cos(20 t), scaled so that it begins at 0."""
    return [
        (t / 200, 1.0 - overshoot * math.exp(-decay * t / 200) * math.cos(20.0 * t / 200)) for t in range(400)
    ]


def test_a_ringing_step_is_measured():
    found = measure(ring(3.0, 1.0), 0.0, 1.0)
    peak = math.exp(-3.0 * math.pi / 20.0)
    assert found.overshoot == pytest.approx(peak, abs=0.01)
    assert found.settled == pytest.approx(math.log(1 / 0.02) / 3.0, abs=0.16)
    assert found.ripple < 0.05
    assert abs(found.left) < 0.01
    scaled = measure([(t, 5.0 - 3.0 * value) for t, value in ring(3.0, 1.0)], 5.0, 2.0)
    assert scaled.overshoot == pytest.approx(found.overshoot)
    assert scaled.settled == found.settled


def test_a_response_that_oscillates_is_reported_as_not_settled():
    found = measure(ring(0.0, 1.0), 0.0, 1.0)
    assert found.settled is None
    assert found.ripple == pytest.approx(2.0, abs=0.02)
    assert "not settled" in str(found)
    assert measure([(0.0, 0.0)] * 9, 0.0, 1.0) is None
    assert measure(ring(1.0, 1.0), 1.0, 1.0) is None


def test_a_response_that_falls_short_has_the_rest_as_its_remaining_error():
    assert measure([(t / 10, 0.9) for t in range(20)], 0.0, 1.0).left == pytest.approx(0.1)


def test_the_next_step_of_tuning_according_to_the_manual():
    calm, wild = measure([(t / 10, 1.0) for t in range(20)], 0.0, 1.0), measure(ring(0.0, 1.0), 0.0, 1.0)
    assert "30 %, to 0.26" in search.following(Loop.VELOCITY, calm, 0.2)
    assert "halved, to 0.1" in search.following(Loop.VELOCITY, wild, 0.2)
    assert "30 %, to 26" in search.following(Loop.POSITION, calm, 20.0)
    assert "lowered little by little, to 17" in search.following(Loop.POSITION, wild, 20.0)
    hunting = Response(0.0, 0.1, 0.2, 0.0, 100)  # within its band before it hunts
    over = Response(0.06, 0.1, 0.0, 0.0, 100)
    assert "is halved, to 0.1" in search.following(Loop.VELOCITY, hunting, 0.2)
    assert "raised" in search.following(Loop.VELOCITY, over, 0.2)
    assert "lowered little" in search.following(Loop.POSITION, over, 20.0)
    assert "lowered little" in search.following(Loop.POSITION, hunting, 20.0)
    assert search.following(Loop.POSITION, calm, None).endswith("30 % until it does, and lowered then")
