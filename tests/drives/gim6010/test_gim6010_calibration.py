"""A calibration on simulated modules in virtual time: followed to its end, judged, and ended by whatever comes between."""

from __future__ import annotations

import re
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010 import calibration
from axisbus.drives.gim6010.calibration import (
    Calibration,
    CalibrationKind,
    RotorRotation,
)
from axisbus.drives.gim6010.sim import axis
from axisbus.drives.gim6010.sim.constants import Firmware
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import ArgumentError
from kit.module_dialogue import play
from kit.sim.can_simple_module import COUNT, ESTOP, GET_ERROR, IDLE, SET_STATE, Bench

FULL, MOTOR, ENCODER = 3, 4, 7  # the manual's
STEP = 0.002


def bench(**more):
    dials = {name: more.pop(name) for name in list(more) if hasattr(ModuleFaults(), name)}
    one = Bench(Module(5, dials=ModuleFaults(**{"calibration_time": 0.25, **dials}), **more))
    one.run(0.3)
    return one


def calibrated(kind, one=None, **more):
    one = one or bench()
    found = Calibration(5, kind)
    sent = play(found, one, step=STEP, **more)
    return found, one, sent


def states(sent):
    return [int.from_bytes(each.data[:4], "little") for each in sent if each.command == SET_STATE]


@pytest.mark.parametrize(
    ("kind", "number", "news", "turns"),
    [
        (CalibrationKind.MOTOR, MOTOR, ["motor calibration"], 0.0),
        (CalibrationKind.ENCODER, ENCODER, ["encoder calibration"], 1.0),
        (CalibrationKind.FULL, FULL, ["motor calibration", "encoder calibration"], 1.0),
    ],
)
def test_a_calibration_is_commanded_once_and_observed_until_its_end(kind, number, news, turns):
    found, one, sent = calibrated(kind)
    assert states(sent) == [number]
    assert found.verdict.good, found.verdict
    assert [line.split(",")[0] for line in list(found.news)[1:]] == news
    assert found.turned.high == pytest.approx(turns, abs=0.05)
    assert max(each.position for each in one.plant) == pytest.approx(turns, abs=0.05)
    assert abs(one.module.position) < 0.02
    assert (one.module.energised, found.confirmed, found.why) == (False, True, "")
    assert "idle according to its heartbeat" in found.left
    assert {each.command for each in sent} == {SET_STATE, COUNT, GET_ERROR}
    one.must_be_smooth()


def test_nothing_is_sent_while_it_listens_to_the_bus():
    _, _, sent = calibrated(CalibrationKind.MOTOR)
    assert sent[0].time >= 1.5
    assert sent[0].command == SET_STATE


def test_a_module_that_refused_closed_loop_uncalibrated_can_be_calibrated_afterwards():
    one = bench(**{"axis0.motor.config.pre_calibrated": 0, "axis0.encoder.config.pre_calibrated": 0})
    one.order(SET_STATE, 8)
    one.run(0.1)
    assert one.module.axis.error == 1
    one.module.axis.clear()
    one.run(0.2)
    calibrated(CalibrationKind.FULL, one)
    one.order(SET_STATE, 8)
    one.run(0.1)
    assert one.module.energised


# -- conditions that prevent its begin -----------------------------------------------------------------------------------------


def enabled(one):
    one.order(SET_STATE, 8)


@pytest.mark.parametrize(
    ("dials", "before", "why"),
    [
        ({}, enabled, "closed loop"),
        ({"encoder_error": 4}, lambda _: None, "NO_RESPONSE|does not answer|ENCODER_FAILED"),
        ({"heartbeat_stops": True}, lambda _: None, "no heartbeat"),
        ({"dead": True}, lambda _: None, "no heartbeat"),
    ],
    ids=["enabled", "faulty", "without heartbeats", "dead"],
)
def test_reasons_that_prevent_a_calibration(dials, before, why):
    one = bench(**dials)
    before(one)
    found, _, sent = calibrated(CalibrationKind.FULL, one)
    assert sent == []
    assert found.verdict is None
    assert re.search(why, found.why), found.why
    assert "nothing was sent" in found.left


def test_two_of_one_node_id_are_not_calibrated():
    one = bench()
    one.modules.append(Module(5, heartbeat_rate_ms=90))
    one.plants.append([])
    found, _, sent = calibrated(CalibrationKind.FULL, one)
    assert (sent, found.verdict) == ([], None)
    assert "several modules" in found.why


def test_an_invalid_node_id_is_refused():
    with pytest.raises(ArgumentError):
        Calibration(64, CalibrationKind.FULL)


# -- that fail -------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dials", "wrong"),
    [
        ({"calibration_motor_error": 1}, "PHASE_RESISTANCE_OUT_OF_RANGE"),
        ({"calibration_encoder_error": 2}, "CPR_POLEPAIRS_MISMATCH"),
        ({"blocked": True}, "not seen to turn"),
        ({"calibration_one_way": True}, "did not come back"),
    ],
)
def test_a_calibration_that_fails_is_reported_with_the_reason(dials, wrong):
    found, one, _ = calibrated(CalibrationKind.FULL, bench(**dials))
    assert not found.verdict.good
    assert wrong in "\n".join(found.verdict.wrong)
    assert not one.module.energised


def test_after_a_motor_that_failed_the_encoder_is_not_turned():
    found, one, _ = calibrated(CalibrationKind.FULL, bench(calibration_motor_error=1))
    assert max(abs(each.position) for each in one.plant) < 0.01
    assert "encoder calibration was not seen among its states" in found.verdict.wrong


def test_without_error_words_the_heartbeat_decides_the_verdict():
    found, _, _ = calibrated(CalibrationKind.FULL, bench(get_error_answered=False))
    assert found.verdict.good
    assert "its error words are not available over CAN: only its heartbeat was checked" in found.verdict.notes
    found, _, _ = calibrated(
        CalibrationKind.FULL, bench(get_error_answered=False, calibration_encoder_error=2)
    )
    assert not found.verdict.good
    assert "encoder: its heartbeat reports a fault" in found.verdict.wrong


def test_a_calibration_that_does_not_begin_is_ended_by_idle():
    found, one, sent = calibrated(
        CalibrationKind.FULL, lose=lambda side, command, _: (side, command) == ("master", SET_STATE)
    )
    assert "does not begin" in found.why
    assert states(sent)[0] == FULL
    assert set(states(sent)[1:]) == {IDLE}
    assert found.verdict is None
    assert not one.module.energised


# -- that are ended ----------------------------------------------------------------------------------------------------------------


def when(moment, act):
    """Do something once, so many seconds after the start."""
    done = []

    def look(one):
        if one.now >= moment and not done:
            done.append(True)
            act(one)

    return look


@settings(max_examples=12, deadline=None)
@given(st.floats(0.3, 5.5), st.integers(0, 3), st.sampled_from(list(CalibrationKind)))
def test_interrupted_at_any_moment_it_ends_idle(moment, more, kind):
    one = bench()
    found = Calibration(5, kind)

    def interrupt(_):
        for _ in range(1 + more):
            found.interrupt("Ctrl-C")

    sent = play(found, one, at=when(moment, interrupt), step=STEP)
    assert not one.module.energised
    one.run(6.0, 0.02)
    assert not one.module.energised
    if found.why:
        assert found.why == "Ctrl-C"
        assert found.verdict is None
        begun = kind.value in states(sent)
        assert states(sent).count(kind.value) == begun
        assert (ESTOP in [each.command for each in sent]) <= (begun and more > 0)
        assert ("idle according to its heartbeat" in found.left) == begun
    else:
        assert found.verdict.good


@pytest.mark.parametrize(
    ("act", "why"),
    [
        (lambda one: setattr(one.module.dials, "dead", True), "no longer heard"),
        (lambda one: setattr(one.module.dials, "heartbeat_stops", True), "no longer heard"),
        (lambda one: one.module.restart(), "no longer heard|restarted"),
        (lambda one: one.order(SET_STATE, 8), "closed loop"),
    ],
    ids=["dead", "silent", "restart", "another master"],
)
@pytest.mark.parametrize("moment", [1.9, 2.8, 3.5])
def test_any_event_during_the_calibration_aborts_it(act, why, moment):
    one = bench()
    found = Calibration(5, CalibrationKind.FULL)
    sent = play(found, one, at=when(moment, act), step=STEP)
    assert re.search(why, found.why), found.why
    assert found.verdict is None
    assert IDLE in states(sent)
    assert states(sent).count(FULL) == 1
    lost = one.module.dials.dead or one.module.dials.heartbeat_stops
    assert found.confirmed is not lost
    assert ("NOT CONFIRMED" in found.left) == lost
    assert (ESTOP in [each.command for each in sent]) == lost
    one.module.dials.dead = False
    one.run(5.0, 0.02)
    assert not one.module.energised


@pytest.mark.parametrize("way", [20.0, -20.0])
def test_a_rotor_that_turns_too_far_is_stopped(monkeypatch, way):
    monkeypatch.setattr(axis, "_TURNED", way)
    found, one, sent = calibrated(CalibrationKind.ENCODER, bench(calibration_time=2.0))
    assert "farther than a calibration may turn it" in found.why
    assert 8.0 < abs(one.module.position) < 10.5  # it coasts
    assert 8.0 < found.turned.farthest < 10.5
    assert states(sent)[-1] == IDLE
    assert not one.module.energised


def test_a_calibration_that_is_not_acknowledged_ends():
    one = bench()
    found = Calibration(5, CalibrationKind.FULL)
    play(found, one, at=when(2.5, lambda _: found.trouble("no acknowledge")), step=STEP)
    assert found.why == "the bus: no acknowledge"
    assert not one.module.energised


@pytest.mark.parametrize("moment", [2.5, 3.2, 4.2])
def test_a_restart_of_the_module_during_the_calibration_is_reported(moment):
    """Also in the encoder's part, where idle could be mistaken for its end."""
    one = bench(restart_time=0.0)
    found = Calibration(5, CalibrationKind.FULL)
    sent = play(found, one, at=when(moment, lambda each: each.module.restart()), step=STEP)
    assert found.why == "the module restarted meanwhile"
    assert states(sent)[-1] == IDLE


def test_a_calibration_commanded_again_by_another_master_while_errors_are_read_is_reported():
    one = bench(get_error_answered=False)
    found = Calibration(5, CalibrationKind.MOTOR)
    sent = play(found, one, at=when(3.3, lambda each: each.order(SET_STATE, MOTOR)), step=STEP)
    assert "does not stay idle" in found.why
    assert found.verdict is None
    assert states(sent)[-1] == IDLE
    assert not one.module.energised


def test_a_second_interrupt_continues_to_estop_at_once():
    found, one = Calibration(5, CalibrationKind.FULL), bench()

    def twice(_):
        found.interrupt("Ctrl-C")
        found.interrupt("Ctrl-C")

    sent = play(found, one, at=when(2.5, twice), step=STEP)
    assert 2.5 <= next(each.time for each in sent if each.command == ESTOP) < 2.52
    assert "after ESTOP" in found.left


def test_the_first_reason_is_reported():
    one = bench()
    found = Calibration(5, CalibrationKind.FULL)

    def twice(_):
        found.trouble("no acknowledge")
        found.trouble("bus-off")

    play(found, one, at=when(2.5, twice), step=STEP)
    assert found.why == "the bus: no acknowledge"


def test_a_heartbeat_from_before_the_command_does_not_count_as_its_answer():
    one = bench()
    found = Calibration(5, CalibrationKind.FULL)

    def late(_):
        found.note(CanFrame(1.795, 0x0A1, one.beats(5)[-1][:4] + bytes([8]) + one.beats(5)[-1][5:]))

    play(found, one, at=when(1.81, late), step=STEP)
    assert (found.why, found.verdict.good) == ("", True)


def test_a_calibration_that_never_ends_is_ended_by_the_time_limit(monkeypatch):
    assert calibration.LONGEST == 300.0  # five minutes (manual v2.2, 3.1.4)
    monkeypatch.setattr(calibration, "LONGEST", 5.0)
    found, one, sent = calibrated(CalibrationKind.MOTOR, bench(calibration_time=1e6))
    assert "not ended within 5 s" in found.why
    assert states(sent)[-1] == IDLE
    assert not one.module.energised


def test_a_module_that_ignores_idle_gets_estop():
    one = bench()
    found = Calibration(5, CalibrationKind.FULL)
    deaf = lambda side, command, time: side == "master" and command == SET_STATE and time > 2.0  # noqa: E731
    sent = play(found, one, at=when(2.5, lambda _: found.interrupt("Ctrl-C")), lose=deaf, step=STEP)
    assert [each.command for each in sent][-1] == ESTOP
    assert "after ESTOP" in found.left
    assert (found.confirmed, one.module.energised, one.module.axis.error) == (True, False, 0x4000)


@pytest.mark.parametrize("firmware", [Firmware(0, 5, 11), Firmware(0, 5, 12), Firmware(0, 6, 5)])
def test_every_layout_of_the_heartbeat_is_followed(firmware):
    one = Bench(Module(5, firmware=firmware, dials=ModuleFaults(calibration_time=0.25)))
    one.run(0.3)
    assert calibrated(CalibrationKind.FULL, one)[0].verdict.good


def test_slow_heartbeats_are_waited_for():
    one = Bench(Module(5, heartbeat_rate_ms=500, dials=ModuleFaults(calibration_time=0.5)))
    one.run(0.3)
    assert calibrated(CalibrationKind.FULL, one)[0].verdict.good


def test_foreign_and_short_frames_are_ignored():
    found = Calibration(5, CalibrationKind.FULL)
    for can_id in (0x0A1, 0x0AA, 0x0A3, 0x0C1, 0x7FF):
        for size in range(9):
            found.note(CanFrame(0.0, can_id, bytes(size)))
    found.note(CanFrame(0.0, 0x0A1, struct.pack("<IBBBB", 0, 8, 0, 0, 1), True))
    assert found.step(0.0) is None


# -- the parts ---------------------------------------------------------------------------------------------------------------------


@given(st.lists(st.integers(-8000, 8000), max_size=40), st.integers(0, 16383))
def test_turns_are_counted_over_the_end_of_a_turn(steps, first):
    turning, place = RotorRotation(), first
    turning.take(first)
    places = [0.0]
    for step in steps:
        place += step
        turning.take(place % 16384)
        places.append((place - first) / 16384)
    assert turning.now == pytest.approx(places[-1], abs=1e-9)
    assert (turning.low, turning.high) == pytest.approx((min(places), max(places)), abs=1e-9)


def test_the_explanation_names_the_motion_and_its_limit():
    for kind, words in (
        (CalibrationKind.MOTOR, "twitch"),
        (CalibrationKind.ENCODER, "more than one turn"),
        (CalibrationKind.FULL, "more than one turn"),
    ):
        text = "\n".join(calibration.explanation(kind, 5))
        assert words in text
        assert "module 5" in text
        assert "take every load off" in text
    assert "turns slowly" not in "\n".join(calibration.explanation(CalibrationKind.MOTOR, 5))
