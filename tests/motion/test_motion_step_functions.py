"""The pure parts one by one, step by step: their outputs and their ends, by the clock and by the reports of the drive."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.options import Ramp
from axisbus.cia402.port import Sample
from axisbus.cia402.state import PowerState
from axisbus.errors import (
    ArgumentError,
    DriveError,
    HomingError,
    LimitError,
    ModeError,
    SetPointError,
    StaleError,
    TransitionError,
)
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.activity import SdoTransfers, age_text, object_text, require_position, where_text
from axisbus.motion.moves.coast_and_reset import Coast, ResetActivity
from axisbus.motion.moves.homing import HomingJob, HomingRun
from axisbus.motion.moves.interpolation import CyclicSetup, interpolation_period
from axisbus.motion.moves.mode_switch import ModeSwitch
from axisbus.motion.moves.prepare import Prepare, RampTransfers, profile_writes, slow_ramp_writes
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.moves.setpoint import HandshakePhase, SetPoint
from axisbus.motion.parameters import NOISE, AxisLimits, Defaults, HoldsLoad, pull_window
from axisbus.motion.pathclock import PathClock
from axisbus.motion.stop.diagnosis import THEN, chained
from axisbus.motion.stop.sdo_path import SdoPath
from axisbus.motion.stop.settled_value import SettledValue
from axisbus.motion.stop.standstill import StandstillCheck, StandstillWaiters
from axisbus.motion.stop.velocity_following import VelocityRampTracker, drive_ramp_tracker
from axisbus.motion.stop_deceleration import Braking
from axisbus.motion.trajectory import SampledTrajectory, TrapezoidalTrajectory
from axisbus.motion.velocity_estimator import VelocityEstimator
from axisbus.units import Scale
from kit.motion.steps import TIMING, Drive, T

ENABLED, READY, FAULT = 0x0237, 0x0231, 0x0218
NO_TIME = 0x05040000


# The set-point handshake.


def set_point(drive: Drive, timeout: float = 1.0) -> SetPoint:
    return SetPoint(5000, drive.parameters.name, timeout)


def test_a_set_point_is_offered_when_bit_12_is_low_and_taken_when_it_has_fallen_again():
    drive = Drive()
    point = set_point(drive)
    sent = []
    for word, phase in [
        (ENABLED | 0x1000, HandshakePhase.CLEAR),  # the acknowledge of a former one
        (None, HandshakePhase.CLEAR),
        (ENABLED, HandshakePhase.OFFER),
        (ENABLED, HandshakePhase.OFFER),
        (ENABLED | 0x1000, HandshakePhase.RELEASE),
        (ENABLED | 0x1000, HandshakePhase.RELEASE),
        (ENABLED, HandshakePhase.TAKEN),
        (ENABLED | 0x1000, HandshakePhase.TAKEN),
    ]:
        taken = point.step(*drive.cycle(statusword=word))
        assert (point.phase, taken) == (phase, phase is HandshakePhase.TAKEN)
        assert point.begun == (phase in (HandshakePhase.OFFER, HandshakePhase.RELEASE))
        sent.append((drive.order.target_position, drive.order.bits))
    nothing, offer = (None, 0), (5000, 0x30)
    assert sent == [nothing, nothing, offer, offer, nothing, nothing, nothing, nothing]


def test_a_word_received_before_bit_4_fell_does_not_end_the_handshake():
    drive = Drive()
    point = set_point(drive)
    point.step(*drive.cycle(statusword=ENABLED))
    point.step(*drive.cycle(statusword=ENABLED | 0x1000))
    released = drive.now
    drive._samples["statusword"] = Sample(ENABLED, released)  # came in the very cycle in which bit 4 fell
    assert not point.step(*drive.cycle())
    assert point.step(*drive.cycle(statusword=ENABLED))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([ENABLED | 0x1000], "does not end the set-point handshake"),
        ([ENABLED], "does not accept the set-point"),
        ([ENABLED, ENABLED | 0x1000], "does not end the set-point handshake"),
    ],
)
def test_each_wait_of_the_handshake_has_the_whole_time(words, message):
    drive = Drive()
    point = set_point(drive, 0.5)
    for word in words:
        drive.later(0.4)
        point.step(*drive.cycle(statusword=word))
    began = point.since or drive.now
    drive.later(began + 0.5 - drive.now - T)
    point.step(*drive.cycle())
    with pytest.raises(SetPointError, match=message) as caught:
        point.step(*drive.cycle())
    bit = 1 if "accept" in message else 0
    assert f"bit 4 (new set-point) was {bit} for 0.5 s" in caught.value.observed
    assert f"acknowledge) stayed {1 - bit}" in caught.value.observed


# Homing.

JOB = HomingJob(17, 500, 100, 2000, 5.0)
IN_PLACE = replace(JOB, method=35)


def searching(drive: Drive, job: HomingJob = JOB) -> HomingRun:
    """A homing whose edge has been given."""
    run = HomingRun(job, drive.parameters)
    run.step(*drive.cycle(statusword=ENABLED, mode=6))
    for request in drive.order.sdo:
        drive.answers(request.id)
    run.step(*drive.cycle())
    for _ in range(3):
        run.step(*drive.cycle(statusword=ENABLED))
        if drive.order.bits:
            return run
    raise AssertionError("no edge")


def test_homing_writes_its_given_values_and_only_objects_that_the_drive_has():
    drive = Drive()
    assert JOB.writes(drive.parameters) == [
        (0x6098, 0, 17),
        (0x6099, 1, 500),
        (0x6099, 2, 100),
        (0x609A, 0, 2000),
    ]
    assert replace(JOB, speed_zero=None).writes(drive.parameters) == [
        (0x6098, 0, 17),
        (0x6099, 1, 500),
        (0x609A, 0, 2000),
    ]
    few = replace(drive.parameters, objects=frozenset({0x6098}))
    assert JOB.writes(few) == [(0x6098, 0, 17)]


def test_bit_4_rises_two_cycles_after_the_mode_is_shown_and_stays():
    drive = Drive()
    run = HomingRun(JOB, drive.parameters)
    bits = []
    for number in range(10):
        assert not run.step(*drive.cycle(statusword=ENABLED, mode=1 if number < 5 else 6))
        bits.append(drive.order.bits)
        for request in drive.order.sdo:
            drive.answers(request.id)
        assert not (drive.order.bits and drive.order.halt)
    assert bits == [0] * 7 + [0x10] * 3


@pytest.mark.parametrize("last", ["mode", "objects"])
def test_bit_4_waits_for_the_mode_and_the_written_objects(last):
    drive = Drive()
    run = HomingRun(JOB, drive.parameters)
    requests = []
    for _ in range(10):
        assert not run.step(*drive.cycle(statusword=ENABLED, mode=1 if last == "mode" else 6))
        requests += drive.order.sdo
        if last == "mode":
            for request in drive.order.sdo:
                drive.answers(request.id)
        assert not drive.order.bits
    assert [request.index for request in requests] == [0x6098, 0x6099, 0x6099, 0x609A]
    if last == "objects":
        for request in requests:
            drive.answers(request.id)
    bits = []
    for _ in range(4):
        assert not run.step(*drive.cycle(statusword=ENABLED, mode=6))
        bits.append(drive.order.bits)
    assert bits == [0, 0, 0x10, 0x10]


@pytest.mark.parametrize(
    ("word", "done"),
    [(0x1400, True), (0x1000, False), (0x0400, False), (0x0000, False)],
)
def test_home_is_found_if_attained_and_reached_are_set_after_attained_was_low(word, done):
    drive = Drive()
    run = searching(drive)
    assert not run.step(*drive.cycle(statusword=ENABLED))
    assert run.step(*drive.cycle(statusword=ENABLED | word)) is done


def test_a_homing_error_that_was_low_since_the_edge_counts_at_once():
    drive = Drive()
    run = searching(drive)
    run.step(*drive.cycle(statusword=ENABLED))
    with pytest.raises(HomingError, match=r"method 17 \(negative limit switch\)") as caught:
        run.step(*drive.cycle(statusword=ENABLED | 0x3000))
    assert "bit 13" in caught.value.observed
    assert "attained (bit 12) 1, reached (bit 10) 0" in caught.value.observed


@pytest.mark.parametrize(("method", "time"), [(35, 0.125), (17, 1.0), (-1, 1.0)])
@pytest.mark.parametrize("word", [0x1400, 0x2000])
def test_bits_left_from_a_former_homing_count_only_after_a_time(word, method, time):
    """Attained may never be seen low; then a second word, received well after the edge, confirms it. A search may begin late."""
    drive = Drive()
    run = HomingRun(replace(JOB, method=method), drive.parameters)
    edge = None
    for _ in range(200):
        for request in drive.order.sdo:
            drive.answers(request.id)
        try:
            done = run.step(*drive.cycle(statusword=ENABLED | word, mode=6))
        except HomingError:
            done = True
        edge = drive.now if edge is None and drive.order.bits else edge
        if done:
            break
    assert drive.now - edge == time + T


def test_one_late_statusword_alone_does_not_confirm_home():
    """It may have been in transit when the drive saw the edge."""
    drive = Drive()
    run = HomingRun(IN_PLACE, drive.parameters)
    while not drive.order.bits:
        for request in drive.order.sdo:
            drive.answers(request.id)
        run.step(*drive.cycle(statusword=ENABLED | 0x1400, mode=6))
    drive.later(0.2)
    assert not run.step(*drive.cycle(statusword=ENABLED | 0x1400))
    assert not run.step(*drive.cycle())  # the same word seen again is no second one
    assert run.step(*drive.cycle(statusword=ENABLED | 0x1400))


def test_a_drive_that_sends_its_word_on_change_needs_no_second_one():
    drive = Drive(by_event=True)
    run = HomingRun(IN_PLACE, drive.parameters)
    while not drive.order.bits:
        for request in drive.order.sdo:
            drive.answers(request.id)
        run.step(*drive.cycle(statusword=ENABLED | 0x1400, mode=6))
    edge = drive.now
    assert not run.step(*drive.cycle(statusword=ENABLED | 0x1400))
    while not run.step(*drive.cycle()):
        assert drive.now < edge + 1.0
    assert drive.now - edge == 0.125 + T


def test_a_statusword_from_before_the_edge_does_not_confirm_this_search():
    drive = Drive()
    run = searching(drive)
    for _ in range(2):
        assert not run.step(*drive.cycle())  # the word that was low is still that of before
    assert not run.step(*drive.cycle(statusword=ENABLED | 0x1400))
    assert not run.step(*drive.cycle(statusword=None))
    assert not run.step(*drive.cycle(statusword=ENABLED | 0x1400))


def test_statuswords_from_within_the_settling_time_do_not_confirm_home():
    drive = Drive()
    run = searching(drive)
    edge = drive.now
    for _ in range(2):
        assert not run.step(*drive.cycle(statusword=ENABLED | 0x1400))
    while drive.now < edge + 1.0:
        assert not run.step(*drive.cycle())  # nothing new is received
    assert run.step(*drive.cycle(statusword=ENABLED | 0x1400))


def test_homing_has_a_time_limit():
    drive = Drive()
    run = searching(drive)
    edge = drive.now
    drive.later(5.0 - 2 * T)
    assert not run.step(*drive.cycle(statusword=ENABLED))
    drive.later(edge + 5.0 - drive.now - T)
    assert not run.step(*drive.cycle(statusword=ENABLED))
    with pytest.raises(HomingError) as caught:
        run.step(*drive.cycle())  # whether its word is received again or not
    assert "not found within 5 s" in caught.value.observed


def test_an_interrupted_homing_takes_its_transfers_back():
    drive = Drive()
    run = HomingRun(JOB, drive.parameters)
    run.step(*drive.cycle(statusword=ENABLED, mode=6))
    asked = [request.id for request in drive.order.sdo]
    assert len(asked) == 4
    run.cancel(drive.order)
    assert sorted(drive.order.cancel) == sorted(asked)


def test_an_interrupted_homing_takes_back_the_mode_that_the_drive_has_not_taken_yet():
    drive = Drive()
    run = HomingRun(JOB, drive.parameters)
    run.step(*drive.cycle(statusword=ENABLED, mode=1))
    assert drive.order.mode == 6
    run.cancel(drive.order)
    assert drive.order.mode == 1


# Observation by SDO.


def test_a_drive_without_pdos_is_polled_ten_times_a_second_until_two_positions_are_the_same():
    drive = Drive()
    path = SdoPath(drive.parameters)
    path.look(*drive.cycle(statusword=None))
    assert [(request.index, request.value) for request in drive.order.sdo] == [(0x6041, None), (0x6064, None)]
    assert (path.state, path.at_standstill, path.may_turn) == (None, False, True)
    asked = [request.id for request in drive.order.sdo]
    drive.later(0.5)
    path.look(*drive.cycle())
    assert drive.order.sdo == []  # the answers are still out
    drive.answers(asked[0], 0x0237).answers(asked[1], 1000)
    path.look(*drive.cycle())
    assert (path.state, path.at_standstill) == (PowerState.OPERATION_ENABLED, False)
    first = drive.now
    for position, at_standstill in [
        (1003, False),
        (1005, True),
        (1005, True),
        (1002, False),
        (None, False),
        (1002, False),
        (1001, True),
    ]:
        assert [request.index for request in drive.order.sdo] == [0x6041, 0x6064, 0x6061, 0x6062]
        asked = [request.id for request in drive.order.sdo]
        drive.answers(asked[0], 0x0007).answers(asked[1], position).answers(asked[2], 1)
        path.look(*drive.answers(asked[3], 1000).cycle())
        assert (path.state, path.at_standstill) == (PowerState.QUICK_STOP_ACTIVE, at_standstill), position
        assert path.may_turn is not at_standstill
        assert drive.order.sdo == []
        while not drive.order.sdo:
            path.look(*drive.cycle())
            assert drive.now < first + 0.2
        assert drive.now - first == 7 * T  # the first cycle after 0.1 s
        first = drive.now
    path.look(*drive.cycle(statusword=READY))
    assert (path.state, path.at_standstill, path.may_turn) == (None, False, True)
    near = Drive()
    once = SdoPath(near.parameters)
    once.look(*near.cycle(statusword=None))
    status, position = (request.id for request in near.order.sdo)
    once.look(*near.answers(status, 0x0237).answers(position, 1).cycle())
    assert not once.at_standstill  # one position does not prove standstill


@pytest.mark.parametrize(
    ("mode", "demand", "before", "at_standstill"),
    [
        (1, 5000, None, True),  # the window is of 4000
        (1, 5001, None, False),
        (1, -3001, None, False),
        (1, None, None, True),  # unknown
        (3, 9000, 9000, True),  # in pv it is of long ago
        (3, 9000, 8000, False),  # unless it has moved in this mode
    ],
)
def test_a_drive_that_pulls_is_not_at_standstill_by_sdo(mode, demand, before, at_standstill):
    drive = Drive()
    drive.cycle(statusword=ENABLED, position=1000, demand=before, mode=mode)
    drive.image.reference_tracker.note(drive.now, mode, before, None, False)
    path = SdoPath(drive.parameters)
    for _ in range(3):
        path.look(*drive.cycle(statusword=None, mode=None, position=None, demand=None))
        while not drive.order.sdo:
            path.look(*drive.cycle())
        values = {0x6041: 0x0007, 0x6064: 1000, 0x6061: mode, 0x6062: demand}
        for request in drive.order.sdo:
            drive.answers(request.id, values[request.index])
    path.look(*drive.cycle())
    assert path.state is PowerState.QUICK_STOP_ACTIVE
    assert path.at_standstill is at_standstill
    assert not path.may_turn


def test_a_running_observation_is_cancelled():
    drive = Drive()
    path = SdoPath(drive.parameters)
    path.look(*drive.cycle(statusword=None))
    asked = [request.id for request in drive.order.sdo]
    path.cancel(drive.order)
    assert drive.order.cancel == asked
    drive.cycle()
    path.cancel(drive.order)
    assert drive.order.cancel == []


def test_a_controlword_is_sent_by_sdo_once_and_only_if_no_pdo_carries_it():
    drive = Drive()
    path = SdoPath(drive.parameters)
    for operational, word, command, sent in [
        (True, ENABLED, 2, []),
        (False, ENABLED, 2, [(0x6040, 0, 2)]),
        (False, ENABLED, 2, []),
        (False, ENABLED, 0, [(0x6040, 0, 0)]),
        (True, None, 0, []),
        (True, None, 2, [(0x6040, 0, 2)]),
    ]:
        drive.operational = operational
        drive.cycle(statusword=word)
        path.send(command, drive.image, drive.order)
        assert [(r.index, r.subindex, r.value) for r in drive.order.sdo] == sent


def test_a_drive_without_a_position_is_not_reported_as_turning():
    drive = Drive(objects=frozenset({0x6040, 0x6041}))
    path = SdoPath(drive.parameters)
    path.look(*drive.cycle(statusword=None))
    assert [request.index for request in drive.order.sdo] == [0x6041]
    assert not path.may_turn


# Transfers.


def test_sdo_transfers_are_requested_together_and_end_with_the_last_answer():
    drive = Drive()
    both = SdoTransfers([(0x6081, 0, 500), (0x6083, 0, None)], drive.parameters)
    assert not both.step(*drive.cycle())
    first, second = drive.order.sdo
    assert (first.index, first.value, second.index, second.value) == (0x6081, 500, 0x6083, None)
    assert not both.step(*drive.answers(second.id, 77).cycle())
    assert drive.order.sdo == []
    assert both.step(*drive.answers(first.id).cycle())
    assert both.values == {(0x6083, 0): 77}
    assert both.step(*drive.cycle())


def test_an_empty_list_of_transfers_has_ended():
    assert SdoTransfers([], Drive().parameters).step(*Drive().cycle())


@pytest.mark.parametrize(
    ("optional", "code", "passes"),
    [
        (True, 0x06020000, True),
        (True, 0x06090011, True),
        (True, 0x06010002, True),
        (False, 0x06020000, False),
        (True, 0x06090030, False),
        (True, NO_TIME, False),
    ],
)
def test_only_an_object_that_is_not_needed_may_be_refused(optional, code, passes):
    drive = Drive()
    items = frozenset({0x6084}) if optional else frozenset()
    one = SdoTransfers([(0x6084, 0, 5)], drive.parameters, items)
    one.step(*drive.cycle())
    drive.answers(drive.order.sdo[0].id, abort=code)
    if passes:
        assert one.step(*drive.cycle())
        return
    with pytest.raises(DriveError, match="6084h profile deceleration") as caught:
        one.step(*drive.cycle())
    assert ("broke off" in caught.value.message) == (code == NO_TIME)
    assert f"{code:08X}" in caught.value.observed.upper()


def test_transfers_have_three_seconds_and_are_taken_back_after_that():
    drive = Drive()
    two = SdoTransfers([(0x6099, 2, 5), (0x6084, 0, 5)], drive.parameters)
    two.step(*drive.cycle())
    asked = [request.id for request in drive.order.sdo]
    drive.later(3.0 - 2 * T)
    assert not two.step(*drive.cycle())
    assert not two.step(*drive.cycle())
    with pytest.raises(DriveError, match=r"6099h:02 .*did not answer"):
        two.step(*drive.cycle())
    assert drive.order.cancel == asked


# A change of mode.


def test_a_mode_is_commanded_with_targets_that_move_nothing_until_it_is_displayed():
    drive = Drive()
    switch = ModeSwitch(ModeOfOperation.PROFILE_VELOCITY, drive.parameters)
    assert switch.reference is None
    assert not switch.step(*drive.cycle(statusword=ENABLED, mode=1, position=400, demand=410))
    order = drive.order
    assert (order.mode, order.target_position, order.target_velocity, order.target_torque) == (3, 410, 0, 0)
    assert not switch.step(*drive.cycle(position=420, demand=430))
    assert (drive.order.target_position, switch.reference) == (
        410,
        410,
    )  # its commanded position when the change began
    assert [switch.step(*drive.cycle(mode=3)) for _ in range(3)] == [
        False,
        False,
        True,
    ]  # three and a half cycles later
    assert drive.order.mode is None


@pytest.mark.parametrize("mode", [2, 3, 4, 6, 9, 10, 11])
def test_when_leaving_a_mode_without_positions_the_target_is_the_present_position(mode):
    drive = Drive()
    switch = ModeSwitch(ModeOfOperation.PROFILE_POSITION, drive.parameters)
    for position in (400, 450):
        switch.step(*drive.cycle(statusword=ENABLED, mode=mode, position=position, demand=7))
        assert drive.order.target_position == position


def test_a_load_is_held_by_the_torque_that_holds_it_now():
    drive = Drive(holds_load=HoldsLoad.TORQUE)
    switch = ModeSwitch(ModeOfOperation.CYCLIC_SYNC_TORQUE, drive.parameters)
    switch.step(*drive.cycle(statusword=ENABLED, mode=1, position=0, torque=-123))
    assert drive.order.target_torque == -123
    free = Drive()
    ModeSwitch(ModeOfOperation.CYCLIC_SYNC_TORQUE, free.parameters).step(
        *free.cycle(statusword=ENABLED, mode=1, position=0, torque=-123)
    )
    assert free.order.target_torque == 0


def test_a_displayed_mode_counts_only_after_the_drive_received_the_change_of_mode_and_back():
    drive = Drive()
    drive.cycle(statusword=ENABLED, mode=1, position=0)
    drive.order.mode = ModeOfOperation.PROFILE_VELOCITY  # a change that is given up
    switch = ModeSwitch(ModeOfOperation.PROFILE_POSITION, drive.parameters)
    steps = [switch.step(*drive.cycle()) for _ in range(8)]
    # called back with the first cycle; after three and a half more it is sure
    assert steps == [False] * 4 + [True] * 4


def test_a_mode_that_is_not_taken_in_time_is_withdrawn():
    drive = Drive()
    switch = ModeSwitch(ModeOfOperation.PROFILE_VELOCITY, drive.parameters)
    switch.step(*drive.cycle(statusword=ENABLED, mode=1, position=0))
    drive.later(1.0 - 2 * T)
    switch.step(*drive.cycle())
    switch.step(*drive.cycle())
    with pytest.raises(ModeError, match=r"does not enter mode 3 \(pv\)") as caught:
        switch.step(*drive.cycle())
    assert drive.order.mode == 1
    assert "stays at 1 (pp) after 1 s" in caught.value.observed


def test_a_drive_without_6061h_has_one_mode():
    drive = Drive(objects=frozenset({0x6060}))
    assert ModeSwitch(ModeOfOperation.PROFILE_VELOCITY, drive.parameters).step(*drive.cycle())


# Reset and coast.


def test_a_fault_is_reset_by_a_rising_edge_and_by_a_second_one_if_it_persists():
    drive, words = Drive(), []
    reset = ResetActivity(drive.parameters, "too hot")

    def cycles() -> None:
        while not reset.step(*drive.cycle(statusword=FAULT)):
            words.append(drive.order.controlword(PowerState.FAULT))

    with pytest.raises(TransitionError, match="does not clear the fault") as caught:
        cycles()
    assert "too hot" in caught.value.observed
    assert words[:5] == [0x00, 0x00, 0x80, 0x80, 0x80]
    edges = [number for number, pair in enumerate(pairwise(words), 1) if pair == (0, 0x80)]
    # one second high (half the time of a transition), the cycle in which it is left, two cycles low
    assert edges == [2, 2 + 64 + 3]
    assert words.count(0x80) == 128 - 5 + 1
    assert len(words) == 128 + 1  # two seconds


def test_a_reset_without_a_fault_sends_nothing_and_a_successful_one_does_not_enable():
    drive = Drive()
    assert ResetActivity(drive.parameters).step(*drive.cycle(statusword=ENABLED))
    assert drive.order.goal is None
    reset = ResetActivity(drive.parameters)
    for _ in range(4):
        reset.step(*drive.cycle(statusword=FAULT))
    assert reset.step(*drive.cycle(statusword=0x0250))
    assert drive.order.goal is PowerState.SWITCH_ON_DISABLED


def test_a_drive_without_a_statusword_cannot_be_reset():
    drive = Drive()
    reset = ResetActivity(drive.parameters)
    reset.step(*drive.cycle(statusword=None))
    drive.later(2.0)
    with pytest.raises(StaleError, match="statusword is unknown"):
        reset.step(*drive.cycle())


@pytest.mark.parametrize(
    ("word", "done", "sent"),
    [
        (0x0237, False, 0x00),
        (0x0217, False, 0x00),
        (0x0233, False, 0x06),
        (0x0231, False, 0x00),
        (0x0250, True, 0x00),
        (0x0218, True, 0x00),
    ],
)
def test_coasting_removes_the_power_at_once_if_there_is_any(word, done, sent):
    drive = Drive()
    coast = Coast(drive.parameters)
    assert coast.step(*drive.cycle(statusword=word)) is done
    assert drive.order.controlword(drive.image.state) == sent
    assert drive.order.goal is PowerState.SWITCH_ON_DISABLED


# Standing still.


def test_a_value_is_settled_if_it_stays_within_a_span_for_the_window():
    still = SettledValue(2.0, 0.5)
    feeds = [
        (0.0, 98, False),
        (0.25, 102, False),
        (0.5, 98, True),
        (0.75, 103, False),
        (1.0, 105, False),
        (1.25, 101, True),
        (1.5, 100, False),
    ]
    for stamp, value, expected in feeds:
        assert still.feed(value, stamp) is expected, stamp
        assert still.feed(value + 50, stamp) is expected  # the same stamp says nothing new
        assert still.feed(value + 50, stamp - 0.1) is expected
    assert still.rested_since == 1.5


def test_a_slow_motion_within_the_noise_is_not_still():
    still = SettledValue(2.0, 0.5)
    moving = [0, 0, 1, 2, 3, 4, 5, 6, 7]
    assert not any(still.feed(value, 0.125 * number) for number, value in enumerate(moving))
    resting = [still.feed(9.0, 0.125 * number) for number in range(9, 16)]
    assert (
        resting == [False] * 4 + [True] * 3
    )  # a window after the first value within the tolerance of the last


def test_still_since_a_moment_needs_a_whole_window_after_it():
    still = SettledValue(2.0, 0.5)
    for stamp in (0.0, 0.5, 1.0):
        still.feed(0.0, stamp)
    assert [still.since(moment) for moment in (-1.0, 0.0, 0.5, 0.51, 1.0)] == [True, True, True, False, False]
    still.forget()
    assert not still.still
    assert not still.since(0.0)
    assert not still.feed(0.0, 1.5)
    assert still.rested_since == 1.5


def test_a_settled_value_since_a_moment_ignores_earlier_samples():
    still = SettledValue(0.0, 0.5, since=1.0)
    assert not still.feed(7.0, 1.0)
    assert still.rested_since == -math.inf
    assert not still.feed(7.0, 1.25)
    assert not still.feed(7.0, 1.5)
    assert still.feed(7.0, 1.75)


def test_two_equal_values_on_both_sides_of_a_turning_point_are_not_still():
    still = SettledValue(2.0, 0.05)
    assert not any(still.feed(value, 0.05 * number) for number, value in enumerate([0, 30, 40, 40, 30, 0]))


# Speed and acceleration of a count.


def track(*samples: tuple[float, int | None]) -> VelocityEstimator:
    made = VelocityEstimator()
    for stamp, value in samples:
        made.take(value, stamp)
    return made


def test_a_speed_is_known_from_the_third_sample_on():
    assert not track((0.0, 0), (0.5, 10)).is_known
    three = track((0.0, 0), (0.5, 10), (1.0, 25))
    assert three.is_known
    assert (three.mean, three.value, three.spacing) == (25.0, 25, 0.5)
    assert three.motion == (20.0, 0.0)  # the slower one of two


def test_a_sample_seen_again_or_older_changes_nothing():
    seen = track((0.0, 0), (0.5, 10), (1.0, 20))
    for stamp in (1.0, 0.75):
        seen.take(500, stamp)
        assert (seen.value, seen.motion) == (20, (20.0, 0.0))


def test_one_late_sample_does_not_count_as_speed():
    speeds = track((0.0, 0), (1.0, 10), (2.0, 20), (2.5, 30), (4.0, 40))
    assert speeds.motion == (10.0, 0.0)


def test_speed_and_acceleration_are_medians_of_the_newer_and_the_older_three():
    squares = track(*((0.5 * k, k * k) for k in range(7)))  # speeds 2, 6, 10, 14, 18, 22
    assert squares.motion == (18.0, (18.0 - 6.0) / 1.5)
    squares.take(49, 3.5)  # only the last seven count
    assert squares.motion == (22.0, 8.0)
    assert (squares.mean, squares.spacing) == (16.0, 0.5)
    assert track(*((0.5 * k, k * k) for k in range(6))).motion == (14.0, 0.0)


def test_the_lowest_speed_allows_for_noise_and_for_stamps_that_are_not_exact():
    even = track(*((0.004 * k, 400 * k) for k in range(7)))
    assert even.least == pytest.approx((1200 - NOISE) / 0.012)
    late = track(*((0.004 * k + 0.0004 * (k == 3), 400 * k) for k in range(7)))  # 96.7 % of the speed
    assert late.motion[0] == pytest.approx(100_000)
    assert late.least == pytest.approx((1200 - NOISE) / (0.012 - 0.0004 + 2 * 0.0004))


def test_an_unknown_value_ends_the_track():
    gone = track((0.0, 0), (0.5, 10), (1.0, 20), (1.5, None))
    assert not gone.is_known
    for stamp, value in ((2.0, 100), (2.5, 101), (3.0, 102)):
        gone.take(value, stamp)
    assert gone.motion == (2.0, 0.0)


# The way of a velocity on ramps.


def ramped(drive: Drive, target: int, up: float = 640.0, down: float = 320.0) -> VelocityRampTracker:
    way = VelocityRampTracker(target, 2.0, up, down, 100.0)
    way.step(drive.cycle(position=0, velocity=0)[0])
    return way


def test_a_ramp_goes_up_by_the_acceleration_and_down_by_the_deceleration():
    drive = Drive(ages={"position": 10.0, "velocity": 10.0})
    way = ramped(drive, 100)
    assert (way.speed, way.behind) == (0.0, 0.0)
    speeds = []
    for _ in range(22):
        way.step(drive.cycle(position=0)[0])
        speeds.append(round(way.speed, 6))
    assert speeds == [min(10.0 * (k + 1), 200.0) for k in range(22)]
    down = VelocityRampTracker(50, 2.0, 640.0, 320.0, 100.0)
    down.step(drive.cycle(position=0, velocity=100)[0])
    assert down.speed == 200.0
    for expected in (195.0, 190.0, 185.0):
        down.step(drive.cycle(position=0)[0])
        assert down.speed == pytest.approx(expected)
    turns = VelocityRampTracker(-50, 2.0, 640.0, 320.0, 100.0)
    turns.step(drive.cycle(position=0, velocity=5)[0])
    for expected in (5.0, 0.0, -10.0, -20.0):
        turns.step(drive.cycle(position=0)[0])
        assert turns.speed == pytest.approx(expected)


def test_after_a_lost_position_a_ramp_has_the_accelerations_of_the_last_command():
    drive = Drive()
    way = ramped(drive, 100)
    way.continue_with(200, 1280.0, 320.0)
    drive.image.position = None
    way.step(drive.image)
    assert way.behind is None
    for _ in range(3):
        drive.cycle(statusword=0x0237, position=0, velocity=0)
        way.step(drive.image)
    assert way.speed == pytest.approx(2 * 1280.0 * T)  # two cycles after its restart


def test_a_ramp_begins_at_the_speed_of_the_positions_if_the_last_velocity_is_older():
    drive = Drive(ages={"position": 10.0, "velocity": 10.0})
    drive.cycle(position=0, velocity=-100)
    drive.cycle(position=0)
    drive.cycle(position=0)
    at_standstill, goes = (VelocityRampTracker(100, 2.0, 640.0, 320.0, 100.0) for _ in range(2))
    at_standstill.step(drive.cycle(position=0)[0])
    assert at_standstill.speed == 0.0
    goes.step(drive.cycle(position=5)[0])
    assert goes.speed == pytest.approx(5.0 / T)


@pytest.mark.parametrize("cycles", [1, 5, 10])  # less than the 0.4 s after which it counts as settled
def test_an_axis_that_gets_another_velocity_while_it_settles_has_no_following_error(cycles):
    """Its motor came to rest later than the ramp, by its lag; this distance does not count for the next velocity."""
    drive = Drive(ages={"position": 10.0, "velocity": 10.0})
    way, place = VelocityRampTracker(0, 1.0, 10_000.0, 10_000.0, 100.0), 0.0
    way.step(drive.cycle(position=0, velocity=2000)[0])
    for cycle in range(20 + cycles):  # the ramp takes 20 cycles; the motor is 0.1 s late
        place += T * min(2000.0, max(0.0, 2000.0 - 10_000.0 * T * (cycle - 10)))
        way.step(drive.cycle(position=round(place))[0])
    assert way.behind < -150.0
    way.aim(200)
    for _ in range(3):
        way.step(drive.cycle(position=round(place))[0])
    assert abs(way.behind) < 10.0


def test_what_a_held_axis_has_missed_counts_for_the_next_velocity_as_well():
    drive = Drive(ages={"position": 10.0, "velocity": 10.0})
    way = ramped(drive, 100, up=6400.0, down=6400.0)
    for target in (100, 0, 100, 0, 100):
        way.aim(target)
        missed = way.behind
        for _ in range(8):
            way.step(drive.cycle(position=0)[0])
        assert way.behind > 0.9 * missed + (10.0 if target else 0.0)


def test_a_moving_axis_does_not_lag_and_a_held_one_does():
    drive = Drive(ages={"position": 10.0, "velocity": 10.0})
    way, position, speed = ramped(drive, 1000, up=6400.0), 0.0, 0.0
    for _ in range(100):
        before, speed = speed, min(speed + 100.0, 2000.0)
        position += 0.5 * (before + speed) * T
        way.step(drive.cycle(position=math.floor(position))[0])
        assert abs(way.behind) <= 1.0
    held = math.floor(position)
    for cycles in range(1, 11):
        way.step(drive.cycle(position=held)[0])
        lost = 2000.0 * T * cycles
        assert 0.75 * lost < way.behind <= lost + 1.0  # it is forgotten within 2 * (100 / 2000 + 0.25) s
    assert way.behind == pytest.approx(2000.0 * T * sum((1 - T / 0.6) ** k for k in range(10)), abs=1.0)


@pytest.mark.parametrize("late", range(1, 5))
def test_a_new_velocity_may_be_taken_in_any_of_some_cycles_without_a_lag(late):
    """The axis goes at 2000, is asked to stop at once, and does so up to four cycles later: it is not behind, then or for good."""
    drive = Drive(ages={"position": 1e9, "velocity": 1e9})
    way = VelocityRampTracker(1000, 2.0, math.inf, math.inf, 100.0, delay=4 * T)
    way.step(drive.cycle(position=0, velocity=1000)[0])
    position = 0.0
    for cycle in range(400):
        if cycle == 20:
            way.aim(0)
        position += 2000.0 * T if cycle < 20 + late else 0.0
        way.step(drive.cycle(position=round(position))[0])
        assert abs(way.behind) <= 1.0
    way.aim(1000)
    for _ in range(12):
        way.step(drive.cycle(position=round(position))[0])
    assert way.behind > 5 * 2000.0 * T  # and one that is held is


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("first", range(1, 5))
@pytest.mark.parametrize("second", range(1, 5))
def test_two_velocities_in_a_row_may_each_be_taken_in_any_of_some_cycles(sign, first, second):
    """The axis reaches 2000 at once, is slowed to 200 two cycles later, and slows down weakly: every delay of each is followed."""
    drive = Drive(ages={"position": 1e9, "velocity": 1e9})
    way = VelocityRampTracker(sign * 1000, 2.0, math.inf, 100.0, 10.0, delay=4 * T)
    way.step(drive.cycle(position=0, velocity=0)[0])
    position = speed = 0.0
    for cycle in range(200):
        if cycle == 2:
            way.aim(sign * 100)
        target = 200.0 if cycle >= 2 + second else 2000.0 if cycle >= first else 0.0
        before, speed = speed, target if target > speed else max(target, speed - 100.0 * T)
        position += 0.5 * (before + speed) * T if before else speed * T
        way.step(drive.cycle(position=sign * round(position))[0])
        assert abs(way.behind) <= 2.0, cycle


@pytest.mark.parametrize("sign", [1, -1])
def test_the_distance_of_settling_after_a_stop_decays_and_creeping_does_not(sign):
    drive = Drive(ages={"position": 1e9, "velocity": 1e9})
    way = VelocityRampTracker(sign * 1000, 2.0, math.inf, math.inf, 100.0)
    way.step(drive.cycle(position=0, velocity=sign * 1000)[0])
    way.aim(0)
    behind = []
    for cycle in range(30):  # it lags by 0.1 s
        position = sign * round(200.0 * (1.0 - math.exp(-cycle * T / 0.1)))
        way.step(drive.cycle(position=position)[0])
        behind.append(way.behind)
    assert min(sign * each for each in behind[:24]) < -120.0
    assert abs(behind[-1]) < 5.0
    for cycle in range(1, 20):
        way.step(drive.cycle(position=position + sign * 10 * cycle)[0])
    assert sign * way.behind < -180.0


@pytest.mark.parametrize("late", [0, 4, 6, 10])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_lag_on_a_ramp_from_standstill_is_measured_beyond_the_delay_of_a_command(late, sign):
    drive = Drive(ages={"position": 1e9, "velocity": 1e9})
    for _ in range(100):
        drive.cycle(position=0, velocity=0)
    way = VelocityRampTracker(sign * 5000, 2.0, 40_000.0, 40_000.0, 100.0, delay=4 * T)
    way.step(drive.cycle(position=0, velocity=0)[0])
    assert drive.image.standstill
    assert way.lag is None
    commanded, position = [0.0] * (late + 1), 0.0
    for _ in range(
        400
    ):  # the ramp is over after a quarter of a second, and its drive goes 1 % faster than it should
        commanded.append(min(commanded[-1] + 40_000.0 * T, 10_000.0))
        position += 0.505 * (commanded[-2 - late] + commanded[-1 - late]) * T
        way.step(drive.cycle(position=sign * round(position))[0])
    # the decay between command and motion looks like a longer lag: by half of it, with a memory of 0.52 s
    least, most = (late - 4) * T, late * T * math.exp(late * T / 2 / 0.52) - 4 * T
    assert max(0.0, least - 0.002) <= way.lag <= max(0.0, most + 0.004)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_lag_of_the_first_order_is_seen_while_the_ramp_still_rises(sign):
    """A motor that approaches its velocity with a time constant: its gain is smaller than that of the ramp."""
    drive, lag, acceleration = Drive(ages={"position": 1e9, "velocity": 1e9}), 0.05, 40_000.0
    for _ in range(100):
        drive.cycle(position=0, velocity=0)
    way = VelocityRampTracker(sign * 50_000, 2.0, acceleration, acceleration, 100.0)
    way.step(drive.cycle(position=0, velocity=0)[0])
    for cycle in range(1, 33):  # 0.5 s
        time = cycle * T
        rises = 1.0 - math.exp(-time / lag)
        position = acceleration * (0.5 * time * time - lag * time + lag * lag * rises)
        way.step(drive.cycle(position=sign * round(position))[0])
        if time > 3.0 * lag:
            assert way.speed == pytest.approx(sign * acceleration * time)
            assert way.lag == pytest.approx(lag, rel=0.15)


def test_a_velocity_given_on_a_ramp_keeps_the_measured_lag():
    drive, lag = Drive(ages={"position": 1e9, "velocity": 1e9}), 10
    for _ in range(100):
        drive.cycle(position=0, velocity=0)
    way = VelocityRampTracker(2000, 2.0, 40_000.0, 40_000.0, 100.0)
    commanded, position = [0.0] * (lag + 1), 0.0
    for cycle in range(60):
        if cycle == 5:  # the axis has hardly moved by then
            assert way.began_at_rest
            way.continue_with(8000, 40_000.0, 40_000.0)
        way.step(drive.cycle(position=round(position), velocity=round(commanded[-1 - lag] / 2))[0])
        commanded.append(min(commanded[-1] + 40_000.0 * T, 4000.0 if cycle < 4 else 16_000.0))
        position += 0.5 * (commanded[-2 - lag] + commanded[-1 - lag]) * T
    assert way.lag == pytest.approx(lag * T, rel=0.3)


def test_a_velocity_given_on_a_ramp_that_began_in_motion_knows_no_lag_either():
    drive = Drive(ages={"position": 1e9, "velocity": 1e9})
    profile = MoveProfile(1000, 1000, 1000, 2000.0, 4000.0, up=4000.0, down=4000.0)
    parameters = drive.parameters
    first = way = drive_ramp_tracker(profile, parameters)
    for cycle in range(60):
        image = drive.cycle(position=20 * cycle, velocity=640)[0]
        if cycle == 5:
            way = drive_ramp_tracker(profile._replace(velocity=2000), parameters, first)
            assert way is not first
        way.step(image)
    assert way.behind > 0.0
    assert way.lag is None


def test_a_path_that_begins_in_motion_shows_no_lag():
    drive = Drive(ages={"position": 1e9, "velocity": 1e9})
    way = VelocityRampTracker(1000, 2.0, 4000.0, 4000.0, 100.0, delay=4 * T)
    for cycle in range(60):
        way.step(drive.cycle(position=20 * cycle, velocity=640)[0])
    assert way.behind > 0.0
    assert way.lag is None


def test_without_a_position_the_progress_is_unknown():
    drive = Drive(ages={"position": 10.0, "velocity": 10.0})
    way = ramped(drive, 100)
    way.step(drive.cycle(position=-50)[0])
    behind = way.behind
    assert behind > 49.0
    way.step(drive.cycle()[0])
    assert way.behind == behind  # a position that is seen again says nothing new
    way.step(drive.cycle(position=None)[0])
    assert way.behind is None
    way.step(drive.cycle(position=500, velocity=30)[0])
    assert (way.behind, way.speed) == (0.0, 60.0)
    unknown = VelocityRampTracker(100, 2.0, 1.0, 1.0, 1.0)
    unknown.step(Drive().cycle(position=5)[0])
    assert unknown.behind is None


# The time along a path.


def test_a_path_is_slowed_by_its_deceleration_and_ends_at_the_computed_times():
    clock = PathClock()
    for _ in range(10):
        clock.advance(0.5)
    assert (clock.t, clock.rate, clock.braking, clock.stopped) == (5.0, 1.0, False, False)
    clock.brake(lambda t: 8.0 * t, 4.0)
    times = []
    while not clock.stopped:
        clock.advance(0.5)
        times.append(clock.t)
    # speeds 6, 4, 2 and 0 of 8: three cycles of 0.5 s at 3/4, 1/2 and 1/4 of the time
    assert times == [5.375, 5.625, 5.75, 5.75]
    clock.advance(0.5)
    assert (clock.t, clock.rate) == (5.75, 0.0)


def test_a_second_brake_changes_nothing_and_one_at_standstill_stops_at_once():
    clock = PathClock()
    clock.advance(0.5)
    clock.brake(lambda t: 8.0 * t, 4.0)
    clock.brake(lambda t: 8.0 * t, 400.0)
    clock.advance(0.5)
    assert clock.rate == 0.75
    fresh, resting = PathClock(), PathClock()
    resting.advance(0.5)
    fresh.brake(lambda t: 8.0 * t, 4.0)
    resting.brake(lambda _: 3.0, 4.0)
    assert fresh.stopped
    assert resting.stopped


def test_a_path_that_brakes_as_hard_itself_is_not_slowed_further():
    clock = PathClock()
    clock.advance(0.5)
    clock.brake(lambda t: 8.0 * min(t, 1.0) - 2.0 * max(0.0, t - 1.0), 100.0)
    clock.advance(0.5)
    assert clock.stopped
    gentle = PathClock()
    gentle.advance(0.5)
    gentle.brake(lambda t: 8.0 * t - t * t, 2.0)  # brakes by 2 itself
    for _ in range(4):
        gentle.advance(0.5)
        assert gentle.rate == pytest.approx(1.0, abs=0.1)


# Standstill without a position.


def test_standstill_needs_positions_of_a_whole_window_after_the_beginning():
    drive = Drive()
    for _ in range(20):
        drive.cycle(statusword=ENABLED, position=0)
    began = drive.now
    look = StandstillCheck(drive.parameters, began)
    while not look.seen(drive.cycle(position=1)[0]):
        assert drive.now < began + 1.0
    assert drive.now - began == 0.0625 + T
    assert look.weaker_evidence == ""


@pytest.mark.parametrize(
    ("demand", "pulls"), [(100, False), (4000, False), (4001, True), (-4000, False), (-4001, True)]
)
def test_an_axis_with_a_demand_beyond_its_window_is_not_at_standstill(demand, pulls):
    drive = Drive()  # 10 ms at 400 deg/s of 1000 increments
    look = StandstillCheck(drive.parameters, drive.now)
    for _ in range(12):
        drive.cycle(statusword=ENABLED, mode=1, position=0, demand=demand)
        seen = look.seen(drive.image)
    assert seen is not pulls
    assert look.pulls(drive.image) is pulls
    assert look.is_blocked(drive.image) is pulls
    assert ("jumps" in look.why_not(drive.image)) is pulls


def test_without_a_position_standstill_is_judged_by_velocity_or_else_by_bit_10():
    drive = Drive()
    look = StandstillCheck(drive.parameters, drive.now)
    began = drive.now
    while not look.seen(drive.cycle(statusword=ENABLED, velocity=0)[0]):
        assert drive.now < began + 1.0
    assert drive.now - began == 0.0625 + T
    assert "606Ch" in look.weaker_evidence
    assert not look.seen(drive.cycle(velocity=1)[0])
    silent = Drive()
    look = StandstillCheck(silent.parameters, silent.now)
    began = silent.now
    assert not look.seen(silent.cycle(statusword=ENABLED)[0])
    while not look.seen(silent.cycle(statusword=ENABLED | 0x0400)[0]):
        assert silent.now < began + 1.0
    assert silent.now - began == 0.125 + T
    assert "bit 10" in look.weaker_evidence
    assert look.why_not(silent.image) == "its position (6064h) is not known"
    assert not look.seen(silent.cycle(statusword=None)[0])


def test_the_reason_why_an_axis_is_not_at_standstill_is_reported():
    drive = Drive()
    drive.cycle(statusword=ENABLED, position=12_500)
    look = StandstillCheck(drive.parameters, drive.now)
    drive.later(0.25 - T)
    drive.cycle()
    assert look.why_not(drive.image) == ("at 12.5 deg when its last position came, 0.25 s ago")
    drive.cycle(position=20_000, velocity=3000)
    look.seen(drive.image)
    assert look.why_not(drive.image) == "at 20 deg and still moving at 3 deg/s"


# Texts and windows.


def test_objects_ages_and_positions_are_worded_for_messages():
    assert object_text(0x6081) == "6081h profile velocity"
    assert object_text(0x6099, 2).startswith("6099h:02 ")
    assert object_text(0x2000) == "2000h"
    assert age_text(0.25) == "the last one is 0.25 s old"
    assert age_text(math.inf) == "it was never received"
    drive = Drive()
    assert where_text(drive.cycle()[0], drive.parameters) == "unknown"
    drive.cycle(position=12_500)
    drive.image.origin = 2500
    assert where_text(drive.image, drive.parameters) == "10 deg"


def test_a_position_that_is_needed_and_not_known_is_refused_with_its_age():
    drive = Drive(ages={"position": 0.1})
    with pytest.raises(StaleError, match="enabling needs it") as caught:
        require_position(drive.cycle()[0], "x", "enabling")
    assert "never received" in caught.value.observed
    assert "map 6064h" in caught.value.remedy
    drive.cycle(position=7)
    assert require_position(drive.image, "x", "enabling") == 7
    drive.cycle()
    for _ in range(12):
        drive.cycle()
    with pytest.raises(StaleError) as caught:
        require_position(drive.image, "x", "enabling")
    assert "0.203 s old" in caught.value.observed
    assert "check cable" in caught.value.remedy
    drive.image.lag = 0.1
    with pytest.raises(StaleError) as caught:
        require_position(drive.image, "x", "enabling")
    assert "check cable" in caught.value.remedy


def test_a_position_that_is_unknown_because_the_link_is_slow_names_the_delay():
    """Cable and TPDO are well then."""
    drive = Drive(ages={"position": 0.1})
    drive.cycle(position=7)
    for _ in range(13):
        drive.cycle()
    drive.image.lag = 0.3
    with pytest.raises(StaleError, match="enabling needs it: the process data come too late") as caught:
        require_position(drive.image, "x", "enabling")
    assert caught.value.observed.startswith("0.3 s late, although none is missing; the last one is 0.2")
    assert "gateway" in caught.value.remedy
    assert "check cable" not in caught.value.remedy


@pytest.mark.parametrize(
    ("own", "position_window", "speed", "expected"),
    [
        (7, 500.0, 9e9, 7.0),
        (0, None, 0.0, 0.0),
        (None, 1.0, 9e9, 20.0),
        (None, 3.0, 9e9, 30.0),
        (None, None, 100.0, 20.0),
        (None, None, 5000.0, 50.0),
    ],
)
def test_the_window_of_the_pull(own, position_window, speed, expected):
    assert pull_window(own, position_window, speed) == expected


def test_values_derived_from_the_parameters():
    base = Drive().parameters
    assert base.pull_window == 4000.0  # 10 ms at 400 deg/s
    assert replace(base, limits=AxisLimits()).pull_window == 1000.0  # at the default velocity
    fine = replace(base.units, position=Scale.of(1e7, "deg"))
    bare = replace(base, units=fine, limits=AxisLimits(), defaults=Defaults())
    assert bare.pull_window == 20.0  # without a known velocity: no more than the noise of a quiet encoder
    assert base.standstill_tolerance == 2.0
    assert replace(base, standstill_speed=160.0).standstill_tolerance == 10.0
    assert base.lag_allowed(1000.0) == 4250.0
    assert replace(base, following_error=10).lag_allowed(1000.0) == 4010.0
    theirs = replace(base, drive_following_error=30)
    assert theirs.lag_allowed(1000.0) == 4030.0
    assert theirs.lag_allowed(1000.0, by_position=False) == 4250.0
    assert replace(theirs, following_error=10).lag_allowed(0.0) == 4010.0
    assert base.path_deceleration == 500.0
    assert base.slow_ramp == 500_000.0
    assert base.halts_torque_by_mode  # its velocity is limited, and nothing is known of its quick stop
    assert not replace(base, limits=AxisLimits()).halts_torque_by_mode
    assert not replace(base, modes=frozenset()).halts_torque_by_mode
    assert replace(base, limits=AxisLimits(position=(0.0, 1.0))).halts_torque_by_mode
    assert not replace(base, braking=Braking(quick_stop=Ramp.QUICK)).halts_torque_by_mode
    assert replace(
        base, holds_load=HoldsLoad.BRAKE, limits=AxisLimits(), modes=frozenset()
    ).halts_torque_by_mode
    assert base.units.torque(-250) == -2.5
    assert replace(base.units, rated_torque=None).torque(-250) == -0.25


def test_invalid_numbers_make_no_trapezoid():
    for values in (
        (0.0, 1.0, 0.0, 1.0),
        (0.0, 1.0, 1.0, 0.0),
        (0.0, math.nan, 1.0, 1.0),
        (0.0, 1.0, -1.0, 1.0),
    ):
        with pytest.raises(ArgumentError, match="trapezoid"):
            TrapezoidalTrajectory(*values)
    for positions, step in (([0.0], 1.0), ([0.0, 1.0], 0.0), ([0.0, math.inf], 1.0), ([0.0, 1.0], math.nan)):
        with pytest.raises(ArgumentError, match="sampled"):
            SampledTrajectory(positions, step)


def test_the_positions_of_a_trapezoid_by_hand():
    long = TrapezoidalTrajectory(2.0, -10.0, 4.0, 2.0)  # 2 s up, 1 s, 2 s down
    assert long.duration == 5.0
    assert [long.position(t) for t in (-1.0, 0.0, 1.0, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0)] == [
        *(2.0, 2.0, 1.0, -2.0, -4.0, -6.0, -9.0, -10.0, -10.0)
    ]
    assert (long.span, long.top_speed, long.top_acceleration) == ((-10.0, 2.0), 4.0, 2.0)
    short = TrapezoidalTrajectory(0.0, 2.0, 4.0, 2.0)  # 1 s up, 1 s down
    assert [short.position(t) for t in (0.5, 1.0, 1.5, 2.0)] == [0.25, 1.0, 1.75, 2.0]
    assert (short.duration, short.top_speed) == (2.0, 2.0)
    assert (
        TrapezoidalTrajectory(3.0, 3.0, 1.0, 1.0).top_acceleration,
        TrapezoidalTrajectory(3.0, 3.0, 1.0, 1.0).position(1.0),
    ) == (
        0.0,
        3.0,
    )
    points = SampledTrajectory([1.0, 3.0, -1.0], 0.5)
    assert (points.duration, points.span, points.top_speed) == (1.0, (-1.0, 3.0), 8.0)
    assert [points.position(t) for t in (-1.0, 0.0, 0.25, 0.5, 0.75, 1.0, 2.0)] == [
        1.0,
        1.0,
        2.0,
        3.0,
        1.0,
        -1.0,
        -1.0,
    ]


# The interpolation time and the objects of a profile.


@pytest.mark.parametrize(
    ("period", "said"),
    [
        (0.001, (1, -3)),
        (0.01, (10, -3)),
        (0.255, (255, -3)),
        (0.0025, (25, -4)),
        (0.0001, (1, -4)),
        (0.000125, (125, -6)),
        (0.26, (26, -2)),
        (1.0, (100, -2)),
        (0.002, (2, -3)),
    ],
)
def test_a_period_as_value_and_power_of_ten(period, said):
    assert interpolation_period(period) == said


@pytest.mark.parametrize("period", [1 / 64, 0.0123456, 1e-9])
def test_a_period_that_60c2h_cannot_hold_is_refused(period):
    with pytest.raises(LimitError, match="cannot be written into 60C2h"):
        interpolation_period(period)


def test_objects_written_before_a_move():
    profile = MoveProfile(7, 8, 9, None, None)
    base = Drive().parameters
    position = [(0x6081, 0, 7), (0x6083, 0, 8), (0x6084, 0, 9), (0x6082, 0, 0)]
    assert profile_writes(profile, base, ModeOfOperation.PROFILE_POSITION) == [
        one for one in position if base.has(one[0])
    ]
    whole = replace(base, objects=base.objects | {0x6082})
    assert profile_writes(profile, whole, ModeOfOperation.PROFILE_POSITION) == position
    assert profile_writes(profile, whole, ModeOfOperation.PROFILE_VELOCITY) == [
        (0x6083, 0, 8),
        (0x6084, 0, 9),
    ]
    few = replace(base, objects=frozenset({0x6083}))
    assert profile_writes(profile, few, ModeOfOperation.PROFILE_POSITION) == [(0x6083, 0, 8)]


@pytest.mark.parametrize(
    ("changes", "written"),
    [
        ({}, [(0x6084, 0, 500_000)]),
        ({"limits": AxisLimits()}, []),
        ({"limits": AxisLimits(), "braking": Braking(quick_stop=Ramp.SLOW)}, [(0x6084, 0, 500_000)]),
        ({"braking": Braking(quick_stop=Ramp.QUICK)}, []),
        ({"defaults": Defaults()}, []),
        ({"defaults": Defaults(acceleration=5.0, deceleration=0.0001)}, [(0x6084, 0, 1)]),
        ({"defaults": Defaults(acceleration=5.0, deceleration=2.0)}, [(0x6084, 0, 2000)]),
        ({"objects": frozenset()}, []),
    ],
)
def test_the_ramp_that_brakes_an_axis_under_torque_is_written_before(changes, written):
    assert slow_ramp_writes(Drive(**changes).parameters, by_torque=True) == written


@pytest.mark.parametrize(
    ("changes", "written"),
    [
        ({}, []),  # the quick stop has no option code
        ({"braking": Braking(quick_stop=Ramp.SLOW)}, [(0x6084, 0, 500_000)]),
        ({"braking": Braking(quick_stop=Ramp.QUICK)}, []),
    ],
)
def test_before_set_points_the_slow_down_ramp_is_written_only_if_the_quick_stop_brakes_on_it(
    changes, written
):
    assert slow_ramp_writes(Drive(**changes).parameters) == written


def test_a_move_begins_when_its_mode_is_shown_its_objects_written_and_the_others_ready():
    drive, gate = Drive(), StartBarrier()
    mode = ModeSwitch(ModeOfOperation.PROFILE_POSITION, drive.parameters)
    prepare = Prepare(mode, *2 * [RampTransfers([(0x6081, 0, 7)], drive.parameters)], gate)
    assert not prepare.step(*drive.cycle(statusword=ENABLED, mode=3, position=0))
    [request] = drive.order.sdo
    assert not prepare.step(*drive.cycle(mode=1))
    assert not prepare.step(*drive.answers(request.id).cycle())
    assert not prepare.step(*drive.cycle())  # the mode may be one of before
    assert not prepare.step(*drive.cycle())
    gate.update(1)
    assert prepare.step(*drive.cycle())
    other = Prepare(mode, *2 * [RampTransfers([(0x6081, 0, 7)], drive.parameters)], gate)
    other.step(*drive.cycle())
    [request] = drive.order.sdo
    other.cancel(drive.order)
    assert drive.order.cancel == [request.id]


@pytest.mark.parametrize(
    ("read", "told"),
    [
        ((10, -3), None),
        ((100, -4), None),
        ((1, -2), None),
        ((10, -4), "reads 10 x 10^-4 s"),
        ((9, -3), "reads 9 x 10^-3 s"),
    ],
)
def test_the_scan_period_is_written_into_60c2h_and_read_back(read, told):
    drive = Drive(scan_period=0.01)
    setup = CyclicSetup(drive.parameters)
    answers = dict(zip(((0x60C2, 1), (0x60C2, 2)), read, strict=True))
    sent = []

    def run() -> bool:
        done = False
        while not done:
            for request in drive.order.sdo:
                sent.append((f"{request.index:04X}:{request.subindex}", request.value))
                drive.answers(
                    request.id,
                    answers.get((request.index, request.subindex)) if request.value is None else None,
                )
            done = setup.step(*drive.cycle())
            assert drive.now < 12.0
        return done

    if told is None:
        assert run()
    else:
        with pytest.raises(DriveError, match="does not accept the scan period") as caught:
            run()
        assert told in caught.value.observed
    offsets = [("60B0:0", 0), ("60B1:0", 0), ("60B2:0", 0)]
    assert sent == [*offsets, ("60C2:1", 10), ("60C2:2", -3), ("60C2:1", None), ("60C2:2", None)]


def test_a_drive_without_60c2h_has_its_own_time_and_one_that_refuses_it_is_reported():
    plain = Drive(scan_period=0.01, objects=frozenset({0x6064}))
    assert CyclicSetup(plain.parameters).step(*plain.cycle())
    drive = Drive(scan_period=0.01)
    setup = CyclicSetup(drive.parameters)
    with pytest.raises(DriveError, match="does not accept the scan period") as caught:
        for _ in range(10):
            for request in drive.order.sdo:
                drive.answers(request.id, abort=0x06090030 if request.index == 0x60C2 else None)
            setup.step(*drive.cycle())
    assert caught.value.observed.startswith("60C2h:01 ")
    waits = Drive(scan_period=0.01)
    setup = CyclicSetup(waits.parameters)
    setup.step(*waits.cycle())
    asked = [request.id for request in waits.order.sdo]
    setup.cancel(waits.order)
    assert sorted(waits.order.cancel) == sorted(asked)


def test_a_demand_received_as_often_as_the_position_must_be_constant_too():
    drive = Drive(ages={"demand": 10.0})
    drive.cycle(statusword=ENABLED, mode=1, position=0, demand=0)
    look = StandstillCheck(drive.parameters, drive.now)
    for number in range(20):
        assert not look.seen(drive.cycle(position=0, demand=10 * number)[0])
    since = drive.now
    while not look.seen(drive.cycle(position=0, demand=190)[0]):
        assert drive.now < since + 1.0
    assert drive.now - since == 0.0625


def test_an_axis_that_pushes_against_something_is_not_at_standstill():
    for holds_load, torque, at_standstill in (
        (HoldsLoad.NO, 50, True),
        (HoldsLoad.NO, 51, False),
        (HoldsLoad.NO, -51, False),
        (HoldsLoad.TORQUE, 51, True),
    ):
        drive = Drive(holds_load=holds_load)
        look = StandstillCheck(drive.parameters, drive.now)
        for _ in range(12):
            seen = look.seen(drive.cycle(statusword=ENABLED, mode=4, position=0, torque=torque)[0])
        assert seen is at_standstill
        assert look.is_blocked(drive.image) is not at_standstill
        if torque == -51:
            assert not look.pulls(drive.cycle(statusword=0x0250)[0])  # without power nothing pushes any more
            continue
        assert ("pushes with 5.1 % of its rated torque" in look.why_not(drive.image)) is not at_standstill


def test_in_a_torque_mode_without_a_torque_value_standstill_is_judged_by_position():
    drive = Drive()
    look = StandstillCheck(drive.parameters, drive.now)
    for _ in range(12):
        seen = look.seen(drive.cycle(statusword=ENABLED, mode=4, position=0)[0])
    assert seen


def test_without_power_the_demand_is_ignored():
    drive = Drive(ages={"demand": 10.0})
    look = StandstillCheck(drive.parameters, drive.now)
    for number in range(12):
        seen = look.seen(drive.cycle(statusword=0x0250, mode=1, position=0, demand=100 * number)[0])
    assert seen


def test_by_velocity_standstill_needs_a_whole_window_from_the_beginning_of_the_observation():
    drive = Drive()
    drive.cycle(statusword=ENABLED, velocity=0)
    look = StandstillCheck(drive.parameters, drive.now)
    began = drive.now
    assert not look.seen(drive.image)
    while not look.seen(drive.cycle(velocity=0)[0]):
        assert drive.now < began + 1.0
    assert drive.now - began == 0.0625 + T
    moving = drive.now + 4 * T
    while drive.now < moving:
        assert not look.seen(drive.cycle(velocity=1)[0])
    while not look.seen(drive.cycle(velocity=0)[0]):
        assert drive.now < moving + 1.0
    assert drive.now - moving == 0.0625 + T


def test_bit_10_confirms_standstill_after_settling_time_and_window():
    timing = replace(TIMING, settle=0.03125)
    silent = Drive(timing=timing)
    look = StandstillCheck(silent.parameters, silent.now)
    began = silent.now
    while not look.seen(silent.cycle(statusword=ENABLED | 0x0400)[0]):
        assert silent.now < began + 1.0
    assert silent.now - began == 0.0625 + T
    assert not look.seen(silent.cycle(statusword=ENABLED & ~0x0400)[0])


def test_an_axis_of_unknown_position_does_not_count_as_held():
    drive = Drive()
    look = StandstillCheck(drive.parameters, drive.now)
    for _ in range(12):
        look.seen(drive.cycle(statusword=ENABLED, mode=4, position=0, torque=51)[0])
    assert look.is_blocked(drive.image)
    assert not look.is_blocked(drive.cycle(position=None)[0])


@pytest.mark.parametrize(
    ("velocity", "at_standstill"), [(100, True), (-100, True), (101, False), (-101, False)]
)
def test_by_velocity_an_axis_is_at_standstill_below_the_speed_of_the_cell_file(velocity, at_standstill):
    drive = Drive(standstill_speed=100.0)
    look = StandstillCheck(drive.parameters, drive.now)
    for _ in range(12):
        seen = look.seen(drive.cycle(statusword=ENABLED, velocity=velocity)[0])
    assert seen is at_standstill


# Commands that take effect at standstill.


def waiting(*names: str) -> tuple[Drive, StandstillWaiters, list[tuple[str, str]]]:
    """Commands of these names that wait for standstill; their ends are noted."""
    drive, ends = Drive(), []
    waits = StandstillWaiters(drive.parameters)
    for name in names:
        ticket = CommandStatus(name)
        waits.add(ticket, lambda name=name: ends.append((name, "done")))
        assert ticket.status is Status.ACTIVE
    return drive, waits, ends


def standstill_step(waits: StandstillWaiters, drive: Drive, ends: list[tuple[str, str]]) -> None:
    waits.step(drive.image, lambda ticket, error: ends.append((ticket.name, error and error.message)))


def test_a_command_that_waits_for_standstill_is_done_after_the_standstill_window():
    drive, waits, ends = waiting("a", "b")
    for _ in range(8):
        standstill_step(waits, drive.cycle(statusword=ENABLED, position=0) and drive, ends)
        if ends:
            break
    assert ends == [("a", "done"), ("a", None), ("b", "done"), ("b", None)]
    assert not waits.waiting
    assert drive.now - 10.0 == 2 * T + 0.0625


def test_an_axis_not_at_standstill_after_two_seconds_refuses_the_waiting_commands():
    drive, waits, ends = waiting("a")
    for number in range(200):
        drive.cycle(statusword=ENABLED, position=100 * number)
        standstill_step(waits, drive, ends)
        if ends:
            break
    assert ends == [("a", "a: the axis is not at standstill")]
    assert drive.now - 10.0 == 2.0 + 2 * T
    assert not waits.waiting


def test_a_polled_demand_counts_from_the_beginning_of_standstill():
    drive = Drive(ages={"demand": 10.0})
    drive.cycle(statusword=ENABLED, mode=1, position=0, demand=0)
    look = StandstillCheck(drive.parameters, drive.now)
    for position in (100, 200):
        assert not look.seen(drive.cycle(position=position, demand=0)[0])
    for _ in range(20):
        assert not look.seen(drive.cycle(position=300)[0])  # that demand is of when it still moved
    drive.says(demand=300)
    assert look.seen(drive.cycle(position=300)[0])
    other = Drive()  # one that comes on change says by its silence that it is the same
    other.cycle(statusword=ENABLED, mode=1, position=0, demand=0)
    look = StandstillCheck(other.parameters, other.now)
    seen = [look.seen(other.cycle(position=0)[0]) for _ in range(6)]
    assert seen == [False] * 4 + [True] * 2


@pytest.mark.parametrize(
    ("defaults", "limit", "expected"),
    [
        (Defaults(acceleration=5.0, deceleration=3.0), 7.0, 3.0),
        (Defaults(acceleration=5.0), 7.0, 5.0),
        (Defaults(deceleration=3.0), None, 3.0),
        (Defaults(), 7.0, 7.0),
        (Defaults(), None, None),
    ],
)
def test_the_deceleration_of_a_path(defaults, limit, expected):
    base = Drive(defaults=defaults, limits=AxisLimits(acceleration=limit)).parameters
    assert base.path_deceleration == expected
    assert base.slow_ramp == (None if expected is None else expected * 1000.0)
    unknown = replace(base, units=replace(base.units, ratio_known=False))
    assert unknown.slow_ramp is None


def test_the_edge_of_a_reset_stays_high_for_four_cycles_for_any_transition_time():
    drive = Drive(timing=replace(TIMING, transition=6 * T))
    reset = ResetActivity(drive.parameters)
    words = []
    for _ in range(7):
        reset.step(*drive.cycle(statusword=FAULT))
        words.append(drive.order.controlword(PowerState.FAULT))
    assert words[:6] == [0x00, 0x00, 0x80, 0x80, 0x80, 0x80]
    assert words[6] == 0x00


def test_a_long_chain_of_errors_keeps_its_beginning_and_its_end():
    told = "0"
    for number in range(1, 20):
        told = chained(told, str(number))
    assert told.split(THEN) == ["0", "1", "2", "3", "16", "17", "18", "19"]
    assert chained(THEN.join("0123456"), "7").split(THEN) == list("01234567")
