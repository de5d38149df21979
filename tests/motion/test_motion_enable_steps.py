"""Enabling step by step: the preloaded targets, the awaited states and their time limits, and actions that are never repeated."""

from __future__ import annotations

from collections import deque
from itertools import product

import pytest

from axisbus.cia402.modes import FACTS, ModeOfOperation
from axisbus.cia402.state import PowerState
from axisbus.errors import (
    AxisbusError,
    DriveError,
    ModeError,
    StaleError,
    StateError,
    TransitionError,
    UncommandedMotion,
)
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.modes import MODE_PROPERTIES, RESTING_MODES
from axisbus.motion.moves.enable import EnableActivity
from axisbus.motion.moves.power_transition import StateWalk
from axisbus.motion.parameters import StopTimes
from kit.motion.steps import Drive, T

MODE = ModeOfOperation
DISABLED, READY, SWITCHED_ON, ENABLED, QUICK, FAULT = 0x0250, 0x0231, 0x0233, 0x0237, 0x0217, 0x0218
WORDS = {0x06: READY, 0x07: SWITCHED_ON, 0x0F: ENABLED, 0x00: DISABLED}
PP, CSP, PV = MODE.PROFILE_POSITION, MODE.CYCLIC_SYNC_POSITION, MODE.PROFILE_VELOCITY


def enable(drive: Drive, modes=(PP,), **options) -> EnableActivity:
    return EnableActivity(drive.parameters, modes, **options)


def obey(
    drive: Drive, activity: EnableActivity, cycles: int = 400, word: int = DISABLED, **values: int
) -> list[tuple[int, int | None]]:
    """Let the drive take each controlword and answer each transfer at once; return the statuswords with the sent controlwords."""
    seen = []
    for _ in range(cycles):
        for request in drive.order.sdo:
            drive.answers(request.id, 0)
        ended = activity.step(*drive.cycle(statusword=word, **values))
        sent = drive.order.controlword(drive.image.state)
        seen.append((word, sent))
        if ended:
            return seen
        if drive.order.mode is not None and "mode" in values:
            values["mode"] = int(drive.order.mode)
        word = WORDS.get(sent, word)
    raise AssertionError(f"not enabled: {seen[-1]}")


def steps(seen: list[tuple[int, int | None]]) -> list[tuple[int, int | None]]:
    """Without repetitions."""
    return [pair for number, pair in enumerate(seen) if number == 0 or seen[number - 1] != pair]


def test_from_disabled_the_mode_is_set_first_and_each_state_follows_in_order():
    drive = Drive()
    seen = obey(drive, enable(drive), mode=0, position=700, demand=200)
    assert steps(seen) == [
        (DISABLED, 0x00),
        (DISABLED, 0x06),
        (READY, 0x07),
        (SWITCHED_ON, 0x0F),
        (ENABLED, 0x0F),
    ]


@pytest.mark.parametrize(
    ("word", "demand", "target"),
    [
        (DISABLED, 200, 700),  # without power 6062h is of long ago
        (READY, 200, 700),
        (SWITCHED_ON, 200, 700),
        (ENABLED, 690, 690),  # with power the axis is held there: its load does not sag
        (ENABLED, None, 700),
        (QUICK, 690, 690),
    ],
)
def test_the_position_that_is_preloaded_moves_nothing(word, demand, target):
    drive = Drive()
    for _ in range(10):
        drive.cycle(statusword=word, mode=1, position=700, demand=demand)
    activity = enable(drive)
    for _ in range(10):
        activity.step(*drive.cycle(statusword=word, position=700, demand=demand))
    order = drive.order
    assert (order.target_position, order.target_velocity, order.target_torque) == (target, 0, 0)


@pytest.mark.parametrize("word", [FAULT, 0x021F])
def test_a_drive_in_fault_is_not_enabled(word):
    drive = Drive()
    with pytest.raises(StateError, match="cannot be enabled while its drive is in state 'fault") as caught:
        enable(drive).step(*drive.cycle(statusword=word, mode=1, position=0))
    assert "reset first" in caught.value.remedy


def test_a_position_that_is_late_is_awaited_without_a_step_towards_power():
    drive = Drive()
    activity = enable(drive)
    for _ in range(128):
        assert not activity.step(*drive.cycle(statusword=SWITCHED_ON, mode=1))
        order = drive.order
        assert order.controlword(drive.image.state) == 0x07  # it stays where it is
        assert (order.target_position, order.target_velocity, order.target_torque) == (None, 0, 0)
    assert not activity.step(*drive.cycle())
    with pytest.raises(StaleError, match="enabling needs it"):
        activity.step(*drive.cycle())


def test_a_position_received_in_time_restarts_the_wait():
    drive = Drive()
    activity = enable(drive)
    activity.step(*drive.cycle(statusword=DISABLED, mode=1))
    drive.later(1.9)
    activity.step(*drive.cycle(position=5))
    for _ in range(2):
        drive.later(1.0)
        assert not activity.step(*drive.cycle(position=None))


def test_an_axis_that_moves_without_power_is_not_enabled_unless_allowed():
    drive = Drive()
    activity, position = enable(drive), 0
    with pytest.raises(StateError, match="not enabled, because it moves"):
        for _ in range(140):
            position += 10
            assert not activity.step(*drive.cycle(statusword=READY, mode=1, position=position))
            order = drive.order
            assert order.controlword(drive.image.state) == 0x06
            assert (order.target_position, order.target_velocity, order.target_torque) == (None, 0, 0)
    assert position == 10 * 130  # two seconds after the first look
    caught = Drive()
    activity = enable(caught, moving=True)
    for position in range(0, 40, 10):
        activity.step(*caught.cycle(statusword=READY, mode=1, position=position))
    assert caught.order.controlword(caught.image.state) == 0x07


def test_an_axis_that_is_enabled_and_does_not_reach_standstill_is_reported():
    drive = Drive()
    activity = enable(drive, moving=True)
    position = 0
    with pytest.raises(AxisbusError, match="the axis is enabled, but not at standstill"):
        for _ in range(140):
            position += 10
            assert not activity.step(*drive.cycle(statusword=ENABLED, mode=1, position=position))
    assert position == 10 * 130


def test_catching_an_axis_in_motion_is_not_reported_as_uncommanded_motion():
    drive = Drive()
    activity = enable(drive, moving=True)
    for position in range(0, 100_000, 1000):
        assert not activity.step(*drive.cycle(statusword=ENABLED, mode=1, position=position))
    at_rest = Drive()
    activity = enable(at_rest)
    obey_until_enabled(at_rest, activity)
    with pytest.raises(UncommandedMotion):
        for position in range(0, 100_000, 1000):
            activity.step(*at_rest.cycle(statusword=ENABLED, mode=1, position=position))


def obey_until_enabled(drive: Drive, activity: EnableActivity) -> None:
    """Let the drive take each word until it has power, at standstill."""
    word = DISABLED
    while word != ENABLED:
        activity.step(*drive.cycle(statusword=word, mode=1, position=0))
        word = WORDS[drive.order.controlword(drive.image.state)]


def test_the_first_mode_that_the_drive_takes_is_used_and_all_that_were_tried_are_named():
    drive = Drive()
    activity = enable(drive, (PP, CSP, PV))
    asked = []
    with pytest.raises(ModeError, match="accepts no mode") as caught:
        for _ in range(300):
            activity.step(*drive.cycle(statusword=DISABLED, mode=4, position=0))
            asked.append(int(drive.order.mode or 0))
    assert "6060h was set to 1 (pp), 8 (csp), 3 (pv); 6061h stays at 4 (tq)" in caught.value.observed
    assert [asked.count(mode) for mode in (1, 8, 3)] == pytest.approx([66, 66, 66], abs=5)  # a second each
    assert sorted(asked[5:]) != asked[5:]  # one after the other, as they were given


@pytest.mark.parametrize("shown", [0, None])
def test_a_drive_that_shows_its_mode_only_with_power_is_enabled_after_a_second(shown):
    drive = Drive()
    activity, word, ended, began = enable(drive), DISABLED, False, drive.now
    while word != READY:
        activity.step(*drive.cycle(statusword=word, mode=shown, position=0))
        word = WORDS[drive.order.controlword(drive.image.state)]
        assert drive.now < began + 2.0
    assert drive.now - began == pytest.approx(1.0 + 6 * T, abs=2 * T)
    while not ended:
        ended = activity.step(*drive.cycle(statusword=word, mode=1 if word == ENABLED else shown, position=0))
        word = WORDS[drive.order.controlword(drive.image.state)]
        assert drive.now < began + 9.0


def test_a_drive_that_shows_another_mode_once_it_has_power_is_reported_after_a_second():
    drive = Drive()
    activity = enable(drive)
    obeyed = 0
    word = DISABLED
    with pytest.raises(ModeError, match="accepts no mode"):
        for _ in range(300):
            assert not activity.step(
                *drive.cycle(statusword=word, mode=3 if word == ENABLED else 1, position=0)
            )
            word = WORDS[drive.order.controlword(drive.image.state)]
            obeyed += word == ENABLED
    assert obeyed * T == pytest.approx(1.0, abs=3 * T)


@pytest.mark.parametrize("fallen", [SWITCHED_ON, DISABLED, READY])
def test_power_that_is_lost_while_the_mode_is_awaited_is_not_switched_on_again(fallen):
    drive = Drive()
    activity = enable(drive)
    word = DISABLED
    while word != ENABLED:
        activity.step(*drive.cycle(statusword=word, mode=1, position=0))
        word = WORDS[drive.order.controlword(drive.image.state)]
    assert not activity.step(*drive.cycle(statusword=ENABLED, position=0))
    drive.cycle(statusword=None, position=0)
    assert not activity.step(drive.image, drive.order)  # a word that is late says nothing of the power
    with pytest.raises(DriveError, match="left operation enabled right after"):
        activity.step(*drive.cycle(statusword=fallen, position=0))


def test_after_a_quick_stop_the_axis_is_enabled_only_at_standstill():
    drive = Drive()
    activity, position = enable(drive), 0
    for _ in range(20):
        position += 10
        assert not activity.step(*drive.cycle(statusword=QUICK, mode=1, position=position))
        assert drive.order.goal is PowerState.QUICK_STOP_ACTIVE
        assert drive.order.controlword(drive.image.state) == 0x02
    while drive.order.goal is PowerState.QUICK_STOP_ACTIVE:
        activity.step(*drive.cycle(position=position))
        assert drive.now < 20.0
    assert drive.image.standstill
    assert drive.order.controlword(drive.image.state) == 0x0F  # transition 16


def test_a_quick_stop_that_does_not_reach_standstill_has_the_time_of_its_step():
    drive = Drive()
    activity, position, cycles = enable(drive), 0, 0
    with pytest.raises(StateError, match="still moves in quick stop active"):
        for _ in range(200):
            position += 10
            activity.step(*drive.cycle(statusword=QUICK, mode=1, position=position))
            cycles += 1
    assert cycles == 65  # one second


def test_a_drive_without_a_position_decides_itself_when_its_quick_stop_is_over():
    objects = frozenset({0x6040, 0x6041, 0x6060, 0x6061})
    drive = Drive(objects=objects)
    activity = enable(drive, (PV,))
    activity.step(*drive.cycle(statusword=QUICK, mode=3))
    assert drive.order.controlword(drive.image.state) == 0x0F


def test_several_wait_for_each_other_in_switched_on():
    drive, other = Drive(), Drive()
    gate = StartBarrier()
    first, second = enable(drive, gate=gate), enable(other, gate=gate)
    word = DISABLED
    for _ in range(200):  # more than the two seconds of a transition
        first.step(*drive.cycle(statusword=word, mode=1, position=0))
        gate.update(2)
        word = WORDS[drive.order.controlword(drive.image.state)]
    assert word == SWITCHED_ON
    theirs = DISABLED
    while ENABLED not in (word, theirs):
        first.step(*drive.cycle(statusword=word, mode=1, position=0))
        second.step(*other.cycle(statusword=theirs, mode=1, position=0))
        gate.update(2)
        word = WORDS[drive.order.controlword(drive.image.state)]
        theirs = WORDS[other.order.controlword(other.image.state)]
        assert drive.now < 20.0
    first.step(*drive.cycle(statusword=word, mode=1, position=0))
    assert drive.order.controlword(drive.image.state) == 0x0F


def test_a_cyclic_mode_has_its_offsets_taken_back_before_there_is_power():
    drive = Drive()
    activity = enable(drive, (CSP,))
    written, words = [], []
    word = DISABLED
    for _ in range(40):
        for request in drive.order.sdo:
            written.append((f"{request.index:04X}", request.value))
            drive.answers(request.id)
            assert word == DISABLED
        activity.step(*drive.cycle(statusword=word, mode=8, position=0))
        words.append(word)
        word = WORDS[drive.order.controlword(drive.image.state)]
    assert written == [("60B0", 0), ("60B1", 0), ("60B2", 0)]
    assert ENABLED in words


def test_the_resting_modes_are_in_order_of_safety():
    assert [int(mode) for mode in RESTING_MODES] == [1, 8, 3, 9, 4]
    assert [MODE_PROPERTIES[mode].standstill_rank for mode in RESTING_MODES] == [0, 1, 2, 3, 4]


# The walk of the power stage.


def test_each_new_state_has_its_time_limit_and_a_state_seen_before_has_none():
    drive = Drive()
    walk = StateWalk(drive.parameters)
    for word in (DISABLED, READY, SWITCHED_ON):
        drive.later(1.75)
        assert not walk.step(*drive.cycle(statusword=word), PowerState.OPERATION_ENABLED)
    since = drive.now
    for word in (READY, SWITCHED_ON, READY):
        drive.later(0.5)
        assert not walk.step(*drive.cycle(statusword=word), PowerState.OPERATION_ENABLED)
    drive.later(since + 2.0 - drive.now - T)
    assert not walk.step(*drive.cycle(), PowerState.OPERATION_ENABLED)
    with pytest.raises(
        TransitionError, match="does not change from 'ready to switch on' to 'operation enabled'"
    ) as caught:
        walk.step(*drive.cycle(), PowerState.OPERATION_ENABLED)
    assert caught.value.observed.startswith(
        "controlword 0x0007 (switch on / disable operation) was sent, statusword 0x0231 for 2 s; "
    )
    assert caught.value.observed.endswith(
        "switched on > ready to switch on > switched on > ready to switch on"
    )


def test_a_walk_that_is_held_has_its_time_again():
    drive = Drive()
    walk = StateWalk(drive.parameters)
    walk.step(*drive.cycle(statusword=READY), PowerState.SWITCHED_ON)
    drive.later(1.75)
    walk.hold(drive.cycle()[0])
    drive.later(2.0 - T)
    assert not walk.step(*drive.cycle(), PowerState.SWITCHED_ON)
    with pytest.raises(TransitionError):
        walk.step(*drive.cycle(), PowerState.SWITCHED_ON)


def test_a_walk_without_a_statusword_sends_nothing_and_fails_with_its_age():
    drive = Drive()
    walk = StateWalk(drive.parameters)
    walk.step(*drive.cycle(statusword=None), PowerState.SWITCHED_ON)
    assert drive.order.controlword(drive.image.state) is None
    drive.later(2.0)
    with pytest.raises(StaleError, match="its statusword") as caught:
        walk.step(*drive.cycle(), PowerState.SWITCHED_ON)
    assert "2 s" in caught.value.observed


def test_a_walk_with_a_late_statusword_names_the_delay_of_the_link():
    drive = Drive()
    walk = StateWalk(drive.parameters)
    walk.step(*drive.cycle(statusword=None), PowerState.SWITCHED_ON)
    drive.later(2.0)
    image, order = drive.cycle()
    image.lag = 0.3
    with pytest.raises(StaleError, match="is unknown: the process data come too late") as caught:
        walk.step(image, order, PowerState.SWITCHED_ON)
    assert caught.value.observed.startswith(
        "0.3 s late, although none is missing; no fresh statusword for 2 s"
    )
    assert "gateway" in caught.value.remedy


def test_a_drive_found_moving_is_halted_and_given_up_after_the_time_of_a_halt():
    drive = Drive(stop_times=StopTimes(halt=1.0))
    activity, position, halted = enable(drive), 0, 0
    with pytest.raises(DriveError, match="was found moving, and does not halt"):
        for _ in range(200):
            position += 100
            activity.step(*drive.cycle(statusword=ENABLED, mode=1, position=position, demand=position))
            halted += drive.order.halt
            assert drive.order.goal is PowerState.OPERATION_ENABLED
    assert halted == 65
    braked = Drive(stop_times=StopTimes(halt=1.0))
    activity = enable(braked)
    for position in range(0, 1000, 100):
        assert not activity.step(
            *braked.cycle(statusword=ENABLED, mode=1, position=position, demand=position)
        )
    for _ in range(40):
        done = activity.step(*braked.cycle(statusword=ENABLED, position=900, demand=900))
    assert done


def test_every_mode_of_the_standard_has_its_conduct():
    assert MODE_PROPERTIES.keys() == FACTS.keys()


def after(state: int, word: int) -> int:
    """Return the state of the drive after a controlword (CiA 402-2, transitions 2 to 10)."""
    if word == 0x00:
        return DISABLED
    if state == DISABLED or word == 0x06:
        return READY if word == 0x06 else DISABLED
    if word == 0x0F and state == READY:
        return READY
    return ENABLED if word == 0x0F else SWITCHED_ON


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("sent", [*product((0x00, 0x06, 0x07), repeat=3)])
def test_words_of_an_ended_command_that_are_still_on_their_way_do_not_take_the_power_again(sent, moving):
    drive = Drive()
    activity, on_the_way, states, ended = enable(drive, moving=moving), deque(sent), [DISABLED], False
    while not ended:
        states.append(after(states[-1], on_the_way.popleft()))
        ended = activity.step(*drive.cycle(statusword=states[-2], mode=1, position=700))
        on_the_way.append(drive.order.controlword(drive.image.state))
    assert set(states[states.index(ENABLED) :]) == {ENABLED}
