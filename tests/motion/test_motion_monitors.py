"""The monitors and the moves, step by step: their reports, their waits, and their outputs to the drive."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from axisbus.cia301 import emcy
from axisbus.cia301.emcy import Emcy, parse
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.options import Ramp
from axisbus.cia402.state import PowerState
from axisbus.errors import (
    AdapterError,
    BusOff,
    DriveError,
    MotionTimeout,
    NodeError,
    StaleError,
    Stopped,
    UncommandedMotion,
)
from axisbus.motion.axis.reference import ReferenceTracker
from axisbus.motion.commands import MoveVelocity
from axisbus.motion.moves.arrival import ArrivalCheck
from axisbus.motion.moves.continuous_motion import Jog, TorqueMove, VelocityMove
from axisbus.motion.moves.modewatch import ModeWatch
from axisbus.motion.moves.position import PositionMove
from axisbus.motion.moves.prepare import RampTransfers
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.moves.setpoint import HandshakePhase, SetPoint
from axisbus.motion.parameters import AxisLimits, DriveTimeouts
from axisbus.motion.states import AxisState
from axisbus.motion.stop.coast_down import CoastDown, FaultReaction
from axisbus.motion.stop.diagnosis import (
    DriveHistory,
    FaultDiagnosis,
    enrich,
    join_remedies,
    nmt_text,
    not_to_be_reset,
)
from axisbus.motion.stop.hold_setpoint import HoldSetPoint, is_target_unknown, needs_relief
from axisbus.motion.stop.standstill_monitor import StandstillMonitor
from axisbus.motion.stop.stop_sequence import StopLevel
from axisbus.motion.stop.supervision import Supervision, silence
from axisbus.motion.stop_deceleration import Braking, CommandedMotion
from kit.motion.steps import Drive, T

ENABLED, DISABLED, READY, QUICK, FAULT, REACTION = 0x0237, 0x0250, 0x0231, 0x0217, 0x0218, 0x021F
MODE = ModeOfOperation
ACTIVITY = SimpleNamespace(
    mode=1, commanded=None, behind=None, lag=None, commanded_speed=0.0, set_point_source=None, in_effect=True
)


def ready() -> SimpleNamespace:
    """The first wait of a move, done at once; notes if it was cancelled."""
    made = SimpleNamespace(
        cancelled=0,
        done=True,
        ramps=RampTransfers((), Drive().parameters),
        set_point_source=None,
        pending_mode_switch=None,
    )

    def cancel(_) -> None:
        made.cancelled += 1

    made.step, made.cancel = lambda _, __: made.done, cancel
    return made


# Supervision: the node.


def watched(**changes) -> tuple[Drive, Supervision]:
    drive = Drive(**changes)
    supervision = Supervision(drive.parameters, SimpleNamespace(max_age={"statusword": 0.5}))
    drive.cycle()  # the first one comes after no other
    return drive, supervision


def node(drive: Drive, supervision: Supervision, operational: bool = True, nmt: int = 5, bus=None, **values):
    drive.operational, drive.nmt, drive.bus = operational, nmt, bus
    return supervision.node(drive.cycle(**values)[0])


def test_a_node_that_was_never_operational_is_not_lost_and_one_that_was_is_reported_once():
    drive, supervision = watched()
    assert node(drive, supervision, False, 127) is None
    assert node(drive, supervision) is None
    finding = node(drive, supervision, False, 127)
    assert (finding.level, supervision.lost) == (StopLevel.QUICK_STOP, True)
    assert "pre-operational, not operational" in finding.error.message
    assert "still reports itself" in finding.error.observed
    assert node(drive, supervision, False, 127) is None
    supervision.lost = False
    assert node(drive, supervision, False, 0).error.observed == "it has restarted"


@pytest.mark.parametrize(
    ("nmt", "message"),
    [(5, "its heartbeat stopped"), (-1, "its heartbeat stopped"), (4, "its NMT state is stopped")],
)
def test_how_a_node_is_lost_is_reported(nmt, message):
    drive, supervision = watched()
    node(drive, supervision)
    finding = node(drive, supervision, False, nmt)
    assert isinstance(finding.error, NodeError)
    assert message in finding.error.message


def test_a_guarded_node_is_lost_by_the_answers_that_stay_away():
    drive, supervision = watched()
    node(drive, supervision)
    drive.image.guarded = True
    error = node(drive, supervision, False, 5).error
    assert "does not answer node guarding" in error.message
    assert f"{0x700 + drive.parameters.node:03X}h" in error.observed
    assert "heartbeat" not in str(error)
    assert nmt_text(drive.image) == "it does not answer node guarding"
    refused = not_to_be_reset(
        "x", 1, SimpleNamespace(bus=None, overdue=True, nmt=5, guarded=True, restarted=False), stopping=False
    )
    assert "it does not answer node guarding" in refused.observed


def test_a_node_is_lost_with_its_bus_in_any_last_state():
    drive, supervision = watched()
    node(drive, supervision)
    finding = node(
        drive,
        supervision,
        False,
        5,
        BusOff("the bus is off", observed="255 errors", remedy="look at the cable"),
    )
    assert isinstance(finding.error, BusOff)
    assert "the bus is off" in finding.error.message
    assert "make sure that the axis is at standstill" in finding.error.remedy


def test_silence_after_a_long_gap_of_our_own_is_excused_for_a_time():
    """Twice as long as the statusword may be old is waited for, but not where the node says itself that it is not operational."""
    drive, supervision = watched()
    node(drive, supervision)
    drive.later(0.5)
    gap = drive.now + T
    assert node(drive, supervision, False) is None
    drive.later(1.0 - 2 * T)
    supervision.node(drive.image)  # the gap is not one of those that are excused
    assert drive.image.now == gap
    assert node(drive, supervision, False) is None
    while node(drive, supervision, False) is None:
        assert drive.now < gap + 2.0
    assert supervision.lost
    for nmt, bus in ((127, None), (5, AdapterError("gone"))):
        drive, supervision = watched()
        node(drive, supervision)
        drive.later(0.5)
        assert node(drive, supervision, False, nmt, bus) is not None


@pytest.mark.parametrize(("gap", "told"), [(0.5 - T, False), (0.5, True)])
def test_a_gap_longer_than_the_statusword_may_be_old_stops_the_axis(gap, told):
    drive, supervision = watched()
    drive.cycle(statusword=ENABLED, position=0)
    drive.later(gap)
    drive.cycle(statusword=ENABLED, position=0)
    finding = supervision.power(drive.image, AxisState.STANDSTILL)
    assert (finding is not None) is told
    assert not told or (
        finding.level is StopLevel.HALT and "did not run for 0.516 s" in finding.error.message
    )


@pytest.mark.parametrize(
    ("age", "period", "longest"),
    [
        (0.5, T, 0.5),
        (math.inf, T, 1.0),  # a statusword that may be of any age
        (None, T, 1.0),
        (0.125, T, 0.25),  # shorter ones are a busy computer's
        (0.5, 0.125, 1.25),  # ten cycles
    ],
)
def test_how_long_this_program_may_not_have_run(age, period, longest):
    told = []
    for gap in (longest, longest + 2**-10):
        drive = Drive(scan_period=period)
        ages = {} if age is None else {"statusword": age}
        supervision = Supervision(drive.parameters, SimpleNamespace(max_age=ages))
        drive.cycle(statusword=ENABLED, position=0)
        drive.later(gap - T).cycle(statusword=ENABLED, position=0)
        told.append(supervision.power(drive.image, AxisState.STANDSTILL) is not None)
    assert told == [False, True]


@pytest.mark.parametrize(
    ("nmt", "operational", "restarted"),
    [
        (0, False, True),
        (127, False, True),
        (5, False, False),
        (4, False, False),
        (-1, False, False),
    ],
)
def test_nmt_states_after_which_a_node_may_have_another_position(nmt, operational, restarted):
    drive, supervision = watched()
    node(drive, supervision, operational, nmt)
    assert supervision.has_restarted(drive.image) is restarted


# Supervision: the power.


@pytest.mark.parametrize(
    ("state", "word", "told"),
    [
        (AxisState.STANDSTILL, ENABLED, None),
        (AxisState.STANDSTILL, READY, "left operation enabled"),
        (AxisState.STANDSTILL, QUICK, "left operation enabled"),
        (AxisState.STOPPING, QUICK, None),
        (AxisState.STOPPING, READY, "left operation enabled"),
        (AxisState.DISCRETE_MOTION, READY, "left operation enabled"),
        (AxisState.HOMING, QUICK, "left operation enabled"),
        (AxisState.STANDSTILL, None, "statusword (6041h) of node 1 is unknown"),
        (AxisState.ERRORSTOP, None, "statusword (6041h) of node 1 is unknown"),
        (AxisState.ERRORSTOP, READY, None),
        (AxisState.DISABLED, None, None),
        (AxisState.DISABLED, READY, None),
    ],
)
def test_an_axis_with_power_in_a_wrong_state_is_stopped_by_quick_stop(state, word, told):
    drive, supervision = watched()
    drive.cycle(statusword=ENABLED, position=0)
    drive.cycle(statusword=word, position=0)
    finding = supervision.power(drive.image, state)
    assert (finding is None) if told is None else told in finding.error.message
    assert finding is None or finding.level is StopLevel.QUICK_STOP


def test_a_drive_without_any_fresh_value_is_lost():
    drive, supervision = watched()
    drive.cycle()
    assert (
        "no longer sends process data" in supervision.power(drive.image, AxisState.STANDSTILL).error.message
    )
    drive.cycle(velocity=0)
    error = supervision.power(drive.image, AxisState.STANDSTILL).error
    assert isinstance(error, StaleError)
    assert error.observed.startswith("it was never received")
    assert "shorter than its mapping" in error.observed
    drive.cycle(statusword=ENABLED)
    for _ in range(16):
        drive.cycle(statusword=None)
    assert supervision.power(drive.image, AxisState.STANDSTILL).error.observed == "the last one is 0.25 s old"
    drive.later(0.25)
    starved = supervision.power(drive.cycle()[0], AxisState.ERRORSTOP).error
    assert "this program did not run for 0.25 s" in starved.message
    assert "the last one is 0.516 s old" in starved.observed


@pytest.mark.parametrize(
    ("age", "told"), [(1e6, "the last one is 1e+06 s old"), (1e6 + 1.0, "it was never received")]
)
def test_a_statusword_that_is_very_old_was_never_received(age, told):
    image = Drive(start=2e6).image
    image.now = 2e6
    image.statusword_stamp = image.now - age
    assert f"statusword (6041h): {told}" in silence(Drive().parameters, image).observed


def test_uncommanded_motion_at_standstill_is_stopped_and_commanded_motion_is_not():
    drive, supervision = watched()
    for position in (0, 4001):
        drive.cycle(statusword=ENABLED, mode=1, position=position)
        assert supervision.power(drive.image, AxisState.STANDSTILL) is None
    drive.cycle(position=4001)
    finding = supervision.power(drive.image, AxisState.STANDSTILL)
    assert isinstance(finding.error, UncommandedMotion)
    assert finding.level is StopLevel.QUICK_STOP
    supervision.at_work()
    for position in (4001, 4001):
        assert supervision.power(drive.cycle(position=position)[0], AxisState.STANDSTILL) is None
    assert supervision.power(drive.cycle(position=9000)[0], AxisState.STANDSTILL, ACTIVITY) is None
    for _ in range(2):  # its standstill restarts
        assert supervision.power(drive.cycle(position=9000)[0], AxisState.STANDSTILL) is None


def test_a_drive_that_leaves_its_mode_in_a_motion_is_stopped_hard():
    drive, supervision = watched()
    activity = replace_mode(3)
    state = AxisState.CONTINUOUS_MOTION
    for mode in (3, 1):
        assert (
            supervision.power(drive.cycle(statusword=ENABLED, mode=mode, position=0)[0], state, activity)
            is None
        )
    finding = supervision.power(drive.cycle(mode=1, position=0)[0], state, activity)
    assert "has left mode 3 (pv) without a command" in finding.error.message
    assert finding.level is StopLevel.QUICK_STOP


def replace_mode(mode: int, commanded: CommandedMotion | None = None) -> SimpleNamespace:
    return SimpleNamespace(
        mode=MODE(mode),
        commanded=commanded,
        behind=None,
        lag=None,
        commanded_speed=0.0,
        set_point_source=None,
        in_effect=True,
    )


@pytest.mark.parametrize(
    ("braking", "mode", "word", "level", "told"),
    [
        (Braking(quick_stop=Ramp.QUICK), 4, ENABLED, StopLevel.HALT, True),
        (Braking(quick_stop=Ramp.QUICK), 10, ENABLED, StopLevel.HALT, True),
        (Braking(quick_stop=Ramp.QUICK), 4, ENABLED, StopLevel.QUICK_STOP, False),
        (Braking(quick_stop=Ramp.QUICK), 3, ENABLED, StopLevel.HALT, False),
        (Braking(quick_stop=Ramp.QUICK), 4, QUICK, StopLevel.HALT, False),
        (Braking(), 4, ENABLED, StopLevel.HALT, False),  # it is halted by another mode
    ],
)
def test_an_axis_that_coasts_out_of_a_torque_is_stopped_harder_if_it_gets_too_fast(
    braking, mode, word, level, told
):
    drive, supervision = watched(braking=braking, limits=AxisLimits(velocity=400.0))
    for step in range(8):
        node(drive, supervision, statusword=word, mode=mode, position=7000 * step)
    finding = supervision.coasting(drive.image, level, bounded=True)
    assert (finding is not None) is told
    assert not told or finding.level is StopLevel.QUICK_STOP


# Rest.


@pytest.mark.parametrize(
    ("positions", "demand", "told"),
    [
        ([0, 4000, 4000], None, None),
        ([0, 4001, 4001], None, "moves without a command"),
        ([0, -4001, -4001], None, "moves without a command"),
        ([0, 4001, 0, 4001], None, None),  # two in a row
        ([0, 0, 0], 4000, None),
        ([0, 0], 4001, "pulls it to another position"),
        ([0, 0], -4001, "pulls it to another position"),
    ],
)
def test_an_axis_at_standstill_must_keep_its_position_and_its_demand(positions, demand, told):
    drive = Drive()
    resting = StandstillMonitor(drive.parameters)
    errors = [
        resting.error(drive.cycle(statusword=ENABLED, mode=1, position=place, demand=demand)[0])
        for place in positions
    ]
    assert errors[:-1] == [None] * (len(positions) - 1)
    assert (errors[-1] is None) if told is None else told in errors[-1].message


def test_standstill_is_judged_by_new_positions_and_restarts_after_a_reset():
    drive = Drive()
    resting = StandstillMonitor(drive.parameters)
    resting.error(drive.cycle(statusword=ENABLED, mode=1, position=0)[0])
    for position in (5000, None):
        drive.cycle(position=position)
        assert resting.error(drive.image) is None
    drive.cycle(position=5000)
    assert "from 0 to 5 deg; it shows mode 1 (pp)" in resting.error(drive.image).observed
    assert resting.error(drive.image) is None  # the same position again
    resting.forget()
    for _ in range(3):
        assert resting.error(drive.cycle(position=5000, velocity=7)[0]) is None
    resting.error(drive.cycle(position=0)[0])
    assert "now at 0.007 deg/s" in resting.error(drive.cycle(position=0)[0]).observed


@pytest.mark.parametrize(
    ("place", "message"),
    [
        (14_000, "pulls it to another position"),
        (14_001, "moves without a command"),
        (6000, "pulls it to another position"),
    ],
)
def test_a_pulled_axis_that_yields_within_the_window_is_at_standstill(place, message):
    drive = Drive()
    resting = StandstillMonitor(drive.parameters)
    for position in (10_000, place):
        drive.cycle(
            statusword=ENABLED, mode=1, position=position, demand=20_000 if position == place else 10_000
        )
        assert resting.error(drive.image) is None
    assert message in resting.error(drive.cycle(position=place, demand=20_000)[0]).message


def test_a_velocity_that_is_read_again_does_not_count():
    drive = Drive()
    resting = StandstillMonitor(drive.parameters)
    for _ in range(2):
        assert resting.error(drive.cycle(statusword=ENABLED, mode=1, velocity=500_000)[0]) is None
    for _ in range(3):
        assert resting.error(drive.cycle()[0]) is None
    assert resting.error(drive.cycle(velocity=500_000)[0]) is not None


@pytest.mark.parametrize(
    ("velocities", "told"),
    [
        ([0, 0, 0, 0], False),
        ([7999] * 1000, False),  # about 4000 within the time that counts
        ([8100] * 1000, True),
        ([-8100] * 1000, True),
        ([200_000, -200_000] * 500, False),  # noise
        ([500_000] * 3, True),
        ([500_000] * 2 + [0], False),  # two in a row
        ([0, 500_000, *[10] * 50], False),
        ([256_000] * 3, False),  # 4000 in each cycle of 1/64 s, and the first one counts from nowhere
        ([256_001] * 3, True),
        (
            [0, 500_000, *[8000] * 50],
            False,
        ),  # the following motion is no more than the allowance of that time
        ([0, 500_000, 8001], True),
        ([0, 500_000, *[0] * 64, *[8100] * 4], False),  # long ago
    ],
)
def test_standstill_without_a_position_is_watched_by_velocity(velocities, told):
    drive = Drive()
    resting = StandstillMonitor(drive.parameters)
    errors = [resting.error(drive.cycle(statusword=ENABLED, mode=1, velocity=each)[0]) for each in velocities]
    found = [error for error in errors if error is not None]
    assert bool(found) == told
    if told:
        assert "moves without a command" in found[0].message
        assert "it moved by about " in found[0].observed


def test_by_velocity_standstill_restarts_too_and_unknown_time_does_not_count():
    drive = Drive()
    resting = StandstillMonitor(drive.parameters)
    for _ in range(2):
        assert resting.error(drive.cycle(statusword=ENABLED, mode=1, velocity=500_000)[0]) is None
    resting.forget()
    assert resting.error(drive.cycle(velocity=500_000)[0]) is None
    drive.now += 10.0
    assert resting.error(drive.cycle(velocity=500_000)[0]) is None
    unscaled = replace(drive.parameters, units=replace(drive.parameters.units, ratio_known=False))
    blind = StandstillMonitor(unscaled)
    assert [blind.error(drive.cycle(velocity=500_000)[0]) for _ in range(50)] == [None] * 50


# The mode of a motion.


def test_a_mode_counts_as_left_after_it_was_shown_and_two_others_in_a_row():
    drive = Drive()
    watch = ModeWatch("x")
    first, second = replace_mode(3), replace_mode(3)
    seen = [(1, None), (1, None), (3, None), (1, None), (3, None), (1, None), (None, None), (1, "left")]
    for mode, told in seen:
        error = watch.error(drive.cycle(statusword=ENABLED, mode=mode)[0], first)
        assert (error is not None) is (told is not None), mode
    assert watch.error(drive.cycle()[0], first) is None  # the same word says nothing new
    for mode in (1, 1, 1):
        assert watch.error(drive.cycle(mode=mode)[0], second) is None
    for activity in (None, SimpleNamespace(mode=None)):
        assert watch.error(drive.cycle(mode=7)[0], activity) is None


def test_a_command_that_keeps_the_mode_must_find_the_drive_in_it():
    """It asks for no mode: one that was left in the cycle in which it takes over would never be missed."""
    drive = Drive()
    watch = ModeWatch("x")
    first, second, other = replace_mode(8), replace_mode(8), replace_mode(1)
    second.set_point_source = SimpleNamespace(at_rest=False)
    for mode in (8, 8, 3):
        assert watch.error(drive.cycle(statusword=ENABLED, mode=mode)[0], first) is None
    assert watch.error(drive.cycle(mode=3)[0], second) is not None
    assert watch.error(drive.cycle(mode=3)[0], other) is None  # it has to ask for its own
    assert watch.error(drive.cycle(mode=3)[0], other) is None


# Coming to rest.

AT_ONCE = SimpleNamespace(mode=1, ends_at_rest=False)


def at_rest(rests_from: float = -math.inf) -> SimpleNamespace:
    return SimpleNamespace(mode=1, ends_at_rest=True, rests_from=rests_from, settling=0.0)


def test_standstill_from_before_the_axis_could_start_is_no_arrival():
    drive = Drive()
    arrival, move = ArrivalCheck(drive.parameters), at_rest()
    arrival.begin(move, drive.now)
    for _ in range(6):
        drive.cycle(statusword=ENABLED, mode=1, position=0)
        arrival.complete(move, False, drive.image)
    move.rests_from = drive.now
    assert not arrival.complete(move, True, drive.image)
    ends = [arrival.complete(move, True, drive.cycle(position=0)[0]) for _ in range(7)]
    assert (
        ends == [False] * 4 + [True] * 3
    )  # four periods of standing, from the first position after that moment


@pytest.mark.parametrize("rests_from", [-math.inf, 10.0])
def test_standstill_from_before_the_command_is_no_arrival(rests_from):
    drive = Drive()
    arrival, move = ArrivalCheck(drive.parameters), at_rest(rests_from)
    for _ in range(20):
        drive.cycle(statusword=ENABLED, mode=1, position=0)
    arrival.begin(move, drive.now)
    assert not arrival.complete(move, True, drive.image)
    ends = [arrival.complete(move, True, drive.cycle(position=0)[0]) for _ in range(6)]
    assert ends == [False] * 4 + [True] * 2


@pytest.mark.parametrize(("mode", "arrives"), [(1, False), (6, True)])
def test_only_a_homing_may_end_with_a_demand_elsewhere(mode, arrives):
    """Its position has another name since, and 6062h may still have the old one."""
    drive = Drive()
    arrival, command = ArrivalCheck(drive.parameters), at_rest()
    command.mode = ModeOfOperation(mode)
    arrival.begin(command, drive.now)
    for _ in range(8):
        drive.cycle(statusword=ENABLED, mode=mode, position=0, demand=9000)
        ended = arrival.complete(command, True, drive.image)
    assert ended is arrives


@pytest.mark.parametrize("settling", [0.0, 0.5])
def test_a_command_that_ends_at_standstill_waits_for_it_two_seconds_longer_than_its_motion_takes(settling):
    drive = Drive()
    arrival = ArrivalCheck(drive.parameters)
    drive.cycle(statusword=ENABLED, mode=1, position=0)
    arrival.begin(AT_ONCE, drive.now)
    assert arrival.complete(AT_ONCE, True, drive.image)
    move = at_rest()
    move.settling = settling
    arrival.begin(move, drive.now)
    assert not arrival.complete(move, False, drive.image)
    position = 0
    began = drive.now + T
    with pytest.raises(MotionTimeout, match="does not come to standstill"):
        for _ in range(200):
            position += 10
            assert not arrival.complete(move, True, drive.cycle(position=position)[0])
    assert drive.now - began == 2.0 + settling + T
    arrival.begin(move, drive.now)
    for _ in range(4):
        assert not arrival.complete(move, True, drive.cycle(position=position)[0])
    assert not arrival.complete(move, False, drive.cycle(position=position)[0])
    assert arrival.complete(move, True, drive.cycle(position=position)[0])


# After a fault, and without power.


def test_a_drive_in_fault_that_does_not_stop_is_reported_once_after_its_time():
    drive = Drive()  # one second for the quick stop, three to disable
    aftermath, coast_down = FaultReaction(drive.parameters), CoastDown(drive.parameters)
    began = drive.now + T
    told = []
    for _ in range(300):
        drive.cycle(statusword=REACTION, mode=1, position=0)
        error = aftermath.error(drive.image, coast_down, True)
        if error is not None:
            told.append((drive.now - began, error))
    [(after, error)] = told
    assert after == 4.0 + T
    assert "which brakes the motor and has not ended" in error.observed
    aftermath.error(drive.cycle(statusword=READY)[0], coast_down, True)
    for _ in range(256):
        assert aftermath.error(drive.cycle(statusword=REACTION)[0], coast_down, True) is None
    told += [aftermath.error(drive.cycle(statusword=REACTION)[0], coast_down, True) for _ in range(2)]
    assert told[-1] is not None


@pytest.mark.parametrize(
    ("word", "driven", "moves", "told"),
    [
        (FAULT, True, True, True),
        (FAULT, True, False, False),
        (REACTION, False, True, False),
        (FAULT, False, True, False),
    ],
)
def test_a_drive_in_fault_that_may_still_move_is_reported(word, driven, moves, told):
    drive = Drive()
    aftermath, coast_down = FaultReaction(drive.parameters), CoastDown(drive.parameters)
    coast_down.look(drive.cycle(statusword=ENABLED, position=0)[0], True)
    errors = []
    for number in range(300):
        coast_down.look(drive.cycle(statusword=word, position=100 * number if moves else 0)[0], True)
        errors.append(aftermath.error(drive.image, coast_down, driven))
    found = [error for error in errors if error is not None]
    assert bool(found) is told
    assert not told or "its power is off, at" in found[0].observed


def test_a_motor_without_power_runs_down_until_standstill_is_seen():
    drive = Drive()
    coast_down = CoastDown(drive.parameters)
    coast_down.look(drive.cycle(statusword=READY, position=0)[0], True)
    assert not coast_down.under_way  # it was never driven
    coast_down.look(drive.cycle(statusword=ENABLED, position=0)[0], False)
    coast_down.look(drive.cycle(statusword=READY, position=0)[0], False)
    assert not coast_down.under_way
    coast_down.look(drive.cycle(statusword=ENABLED, position=0)[0], True)
    assert (coast_down.under_way, coast_down.why_not(drive.image)) == (False, "")
    for position in (100, 200, 300):
        coast_down.look(drive.cycle(statusword=READY, position=position)[0], True)
        assert coast_down.under_way
    assert "still moving" in coast_down.why_not(drive.image)
    coast_down.look(drive.cycle(statusword=None, position=300)[0], True)
    assert coast_down.under_way
    while coast_down.under_way:
        coast_down.look(drive.cycle(statusword=READY, position=300)[0], True)
        assert drive.now < 12.0
    for position in (400, 500, 600):  # turned by hand
        coast_down.look(drive.cycle(position=position)[0], True)
        assert not coast_down.under_way
    coast_down.look(drive.cycle(statusword=ENABLED)[0], False)
    coast_down.look(drive.cycle(statusword=READY)[0], False)
    assert not coast_down.under_way
    silent = Drive(objects=frozenset({0x6040, 0x6041}))
    blind = CoastDown(silent.parameters)
    blind.look(silent.cycle(statusword=ENABLED)[0], True)
    blind.look(silent.cycle(statusword=READY)[0], True)
    assert not blind.under_way  # undecidable


# Moves to a position.

# 10 000 increments per s, 100 000 per s² up and 50 000 down
PROFILE = MoveProfile(10_000, 100, 50, 10_000.0, 50_000.0, None, 100_000.0, 50_000.0)


def moving(
    drive: Drive, target: int, profile: MoveProfile = PROFILE, before: SetPoint | None = None
) -> PositionMove:
    return PositionMove(target, profile, drive.parameters, ready(), before)


def handshake(drive: Drive, move: PositionMove, **values: int) -> None:
    """Let the drive take the set-point."""
    for word in (ENABLED, ENABLED | 0x1000, ENABLED):
        move.step(*drive.cycle(statusword=word, mode=1, **values))
    assert move.set_point.phase is HandshakePhase.TAKEN


@pytest.mark.parametrize(
    ("window", "distance", "off", "arrived"),
    [
        (None, 100_000, 2000, True),  # 2 % of the velocity
        (None, 100_000, 2001, False),
        (None, 500, 20, True),  # and never less than 20
        (None, 500, 21, False),
        (7, 100_000, 7, True),
        (7, 100_000, -7, True),
        (7, 100_000, 8, False),
    ],
)
def test_a_move_has_arrived_with_bit_10_within_its_window(window, distance, off, arrived):
    drive = Drive(position_window=window)
    move = moving(drive, distance)
    handshake(drive, move, position=0)
    assert not move.step(*drive.cycle(statusword=ENABLED, position=distance - off))
    assert not move.step(*drive.cycle(statusword=None, position=distance - off))
    assert move.step(*drive.cycle(statusword=ENABLED | 0x0400, position=distance - off)) is arrived


def test_without_a_position_bit_10_is_enough():
    drive = Drive()
    move = moving(drive, 500, PROFILE._replace(timeout=9.0))
    handshake(drive, move)
    assert move.step(*drive.cycle(statusword=ENABLED | 0x0400))
    with pytest.raises(StaleError, match="the time that a move may take"):
        moving(Drive(), 500).step(*drive.cycle())


@pytest.mark.parametrize(
    ("profile", "velocity", "seconds"),
    [
        (PROFILE, None, 2 * (5.0 + 0.2) + 2),  # 50 000 increments; twice that and two seconds
        (
            PROFILE,
            -5000,
            2 * (0.1 + 5.0 + 0.025 + 0.2) + 2,
        ),  # it moves in the other direction first: 250 increments to brake
        (PROFILE._replace(timeout=3.0), None, 3.0),
    ],
)
def test_a_move_has_twice_the_time_of_its_profile_or_the_time_out_of_the_call(profile, velocity, seconds):
    drive = Drive()
    move = moving(drive, 50_000, profile)
    values = {} if velocity is None else {"velocity": velocity}
    handshake(drive, move, position=0, **values)
    began = drive.now - 2 * T
    drive.later(began + seconds - drive.now - 2 * T)
    move.step(*drive.cycle(statusword=ENABLED, position=100))
    with pytest.raises(MotionTimeout, match="has not arrived at 50 deg") as caught:
        for _ in range(3):
            move.step(*drive.cycle(statusword=ENABLED, position=100))
    assert "position 0.1 deg" in caught.value.observed
    assert drive.now - began == pytest.approx(seconds, abs=1.01 * T)


def test_a_move_of_unknown_duration_must_make_progress():
    drive = Drive()
    move = moving(drive, 50_000, PROFILE._replace(speed=None, ramp=None))
    handshake(drive, move, position=0)
    for position in (100, 200, 300):
        drive.later(2.0 - T)
        assert not move.step(*drive.cycle(statusword=ENABLED, position=position))
    last = drive.now
    with pytest.raises(MotionTimeout) as caught:
        for _ in range(200):
            move.step(*drive.cycle(statusword=ENABLED, position=300))
    assert "6064h has not changed for 2 s" in caught.value.observed
    assert drive.now - last == 2.0 + T


def test_a_halt_stays_until_the_drive_has_the_new_target_or_half_of_the_time_has_passed():
    drive = Drive()
    move = moving(drive, 5000)
    halts = []
    for number in range(40):
        drive.cycle(statusword=ENABLED | (0x1000 if number < 2 else 0), mode=1, position=0)
        drive.order.halt = True
        move.step(drive.image, drive.order)
        halts.append(drive.order.halt)
    assert halts == [True] * 2 + [True] * 32 + [False] * 6
    free = moving(drive, 5000)
    drive.cycle(statusword=ENABLED)
    free.step(drive.image, drive.order)
    assert not drive.order.halt
    taken = moving(drive, 5000)
    for word in (ENABLED, ENABLED | 0x1000):
        drive.cycle(statusword=word)
        drive.order.halt = True
        taken.step(drive.image, drive.order)
    assert not drive.order.halt


def test_a_handshake_that_another_move_has_begun_is_finished_first():
    drive = Drive()
    old = SetPoint(111, "x", 1.0)
    old.step(*drive.cycle(statusword=ENABLED, mode=1, position=0))
    move = moving(drive, 222, before=old)
    targets = []
    for word in (ENABLED, ENABLED | 0x1000, ENABLED, ENABLED, ENABLED | 0x1000, ENABLED):
        move.step(*drive.cycle(statusword=word, position=0))
        targets.append(drive.order.target_position)
    assert targets == [111, None, None, 222, None, None]
    assert move.in_flight is None
    fresh = moving(drive, 333, before=SetPoint(1, "x", 1.0))
    assert fresh.in_flight is None
    fresh.step(*drive.cycle(statusword=ENABLED, position=0))
    assert fresh.in_flight is fresh.set_point
    begun = SetPoint(9, "x", 1.0)
    begun.step(*drive.cycle(statusword=ENABLED, position=0))
    assert moving(drive, 5, before=begun).in_flight is begun


# Moves that go on.


def velocity_move(drive: Drive, velocity: int, **changes) -> VelocityMove:
    profile = PROFILE._replace(velocity=velocity, speed=float(abs(velocity)), **changes)
    return VelocityMove(profile, drive.parameters, ready())


def test_a_velocity_that_is_reached_at_the_next_check_is_not_late():
    drive = Drive()
    move = velocity_move(drive, 1000)
    assert not move.step(*drive.cycle(statusword=ENABLED, velocity=0))
    drive.later(1000.0)
    assert move.step(*drive.cycle(statusword=ENABLED, velocity=1000))


@pytest.mark.parametrize(
    ("target", "velocity", "word", "reached"),
    [
        (1000, 950, ENABLED, True),  # 5 %
        (1000, 949, ENABLED, False),
        (-1000, -1050, ENABLED, True),
        (-1000, 1000, ENABLED, False),
        (1000, 501, ENABLED | 0x0400, True),
        (1000, 500, ENABLED | 0x0400, False),  # a drive may set it although it is blocked
        (10, 8, ENABLED, True),  # and never less than two increments
        (10, 7, ENABLED, False),
        (2, 1, ENABLED, False),
        (0, 2, ENABLED, True),
        (0, -3, ENABLED, False),
    ],
)
def test_a_velocity_is_reached_when_it_is_there(target, velocity, word, reached):
    drive = Drive()
    move = velocity_move(drive, target)
    move.step(*drive.cycle(statusword=ENABLED, mode=3, position=0, velocity=20_000))
    drive.later(0.125)
    assert move.step(*drive.cycle(statusword=word, position=50, velocity=velocity)) is reached
    assert drive.order.target_velocity == target


@pytest.mark.parametrize(("after", "reached"), [(0.125 - T, False), (0.125, True)])
def test_bit_10_counts_for_the_new_velocity_only_some_time_after_that_was_sent(after, reached):
    drive = Drive()
    move = velocity_move(drive, 1000)
    assert not move.step(*drive.cycle(statusword=ENABLED | 0x0400, mode=3))
    drive.later(after - T)
    assert move.step(*drive.cycle(statusword=ENABLED | 0x0400)) is reached
    assert move.step(*drive.cycle(statusword=ENABLED)) is reached  # once reached it stays so


@pytest.mark.parametrize(
    ("changes", "velocity", "seconds"),
    [
        ({}, 0, 4 * 10_000 / 50_000 + 2),
        ({}, -5000, 4 * 15_000 / 50_000 + 2),
        ({"timeout": 1.0}, 0, 1.0),
        ({"ramp": None}, 0, 10.0),
    ],
)
def test_a_velocity_has_four_times_its_ramp_or_the_time_of_the_caller(changes, velocity, seconds):
    drive = Drive()
    move = velocity_move(drive, 10_000, **changes)
    move.step(*drive.cycle(statusword=ENABLED, mode=3, velocity=velocity))
    began = drive.now
    with pytest.raises(MotionTimeout, match="has not reached 10 deg/s") as caught:
        for _ in range(700):
            move.step(*drive.cycle(statusword=ENABLED, velocity=0))
    assert drive.now - began == math.floor(seconds / T + 1) * T
    assert "velocity 0 deg/s, statusword 0x0237" in caught.value.observed


@pytest.mark.parametrize(
    ("torque", "measured", "word", "reached"),
    [
        (400, 380, ENABLED, True),  # 5 %
        (400, 379, ENABLED, False),
        (-400, -420, ENABLED, True),
        (400, -400, ENABLED, False),
        (100, 90, ENABLED, True),  # and never less than 1 %
        (100, 89, ENABLED, False),
        (19, 9, ENABLED, False),  # not more than half of it
        (19, 10, ENABLED, True),
        (10, 0, ENABLED, False),
        (10, 0, ENABLED | 0x0400, True),
        (100, 0, ENABLED | 0x0400, False),
        (0, 10, ENABLED, True),
        (0, 11, ENABLED, False),
    ],
)
def test_a_torque_is_reached_when_it_is_there(torque, measured, word, reached):
    drive = Drive()
    move = TorqueMove(torque, None, drive.parameters, ready())
    assert not move.step(*drive.cycle(statusword=word, mode=4, torque=measured))
    assert (drive.order.target_torque, drive.order.halt) == (torque, False)
    drive.later(0.125 - 2 * T)
    assert not move.step(*drive.cycle(statusword=word, torque=measured))
    assert move.step(*drive.cycle(statusword=word, torque=measured)) is reached


def test_a_torque_has_the_time_that_the_caller_gives_and_else_ten_seconds():
    drive = Drive()
    patient, hasty = (TorqueMove(400, timeout, drive.parameters, ready()) for timeout in (None, 1.0))
    drive.cycle(statusword=ENABLED, mode=4, torque=5)
    began = drive.now
    hasty.step(drive.image, drive.order)
    with pytest.raises(MotionTimeout, match="has not reached 40 % of rated torque") as caught:
        for _ in range(100):
            drive.cycle(statusword=ENABLED, torque=5)
            assert not patient.step(drive.image, drive.order)
            assert not hasty.step(drive.image, drive.order)
    assert "torque 0.5 % of rated torque" in caught.value.observed
    assert drive.now - began == 1.0 + T
    assert not patient.step(*drive.later(began + 10.0 - drive.now - T).cycle(statusword=ENABLED, torque=5))
    with pytest.raises(MotionTimeout, match="has not reached 40 % of rated torque"):
        for _ in range(3):
            patient.step(*drive.cycle(statusword=ENABLED, torque=5))


def test_a_torque_with_a_slope_has_four_times_its_ramp_and_two_seconds():
    drive = Drive()
    move = TorqueMove(400, None, drive.parameters, ready(), 100)
    began = drive.now
    assert not move.step(*drive.cycle(statusword=ENABLED, mode=4, torque=-100))
    assert not move.step(*drive.later(21.9).cycle(statusword=ENABLED, torque=5))
    with pytest.raises(MotionTimeout):
        move.step(*drive.later(0.2).cycle(statusword=ENABLED, torque=5))
    assert drive.now - began > 22.0


def test_a_move_that_waits_sends_nothing_and_can_be_cancelled():
    drive = Drive()
    wait = ready()
    wait.done = False
    moves = [
        PositionMove(5, PROFILE, drive.parameters, wait, None),
        VelocityMove(PROFILE, drive.parameters, wait),
        TorqueMove(5, None, drive.parameters, wait),
    ]
    moves.append(Jog(VelocityMove(PROFILE, drive.parameters, wait), MoveVelocity(PROFILE, 0.25), drive.image))
    for number, move in enumerate(moves, 1):
        drive.image.now = drive.now
        if number < 4:
            assert not move.step(*drive.cycle(statusword=ENABLED, mode=1, position=0))
        assert (drive.order.target_position, drive.order.target_velocity, drive.order.target_torque) == (
            None,
            None,
            None,
        )
        move.cancel(drive.order)
        assert wait.cancelled == number


def test_a_velocity_counts_with_the_weaker_ramp_until_its_own_is_written():
    drive = Drive()
    for before, down in (
        (None, 50_000.0),
        (CommandedMotion(down=7.0), 7.0),
        (CommandedMotion(down=90_000.0), 50_000.0),
        (CommandedMotion(), 50_000.0),
    ):
        move = VelocityMove(PROFILE._replace(velocity=-5), drive.parameters, ready(), before)
        assert move.commanded == CommandedMotion(-10_000.0, 100_000.0, down)
        move.step(*drive.cycle(statusword=ENABLED, mode=3, velocity=0))
        assert move.commanded.down == 50_000.0
    assert VelocityMove(PROFILE._replace(speed=None), drive.parameters, ready()).commanded.speed is None
    assert TorqueMove(5, None, drive.parameters, ready()).commanded == CommandedMotion(by_torque=True)
    assert moving(drive, 5).commanded == CommandedMotion(10_000.0, 100_000.0, 50_000.0, by_target=True)


def test_a_jog_lasts_as_long_as_it_is_renewed():
    drive = Drive()
    drive.cycle(statusword=ENABLED, mode=3, velocity=0)
    command = MoveVelocity(PROFILE, 0.25)
    jog = Jog(velocity_move(drive, 10_000), command, drive.image)
    began = drive.now
    for _ in range(8):
        jog.step(*drive.cycle(velocity=0))
    assert jog.renew(command, drive.image)
    assert not jog.renew(MoveVelocity(PROFILE._replace(velocity=7), 0.25), drive.image)
    assert not jog.renew(MoveVelocity(PROFILE, None), drive.image)
    with pytest.raises(Stopped, match="not renewed"):
        for _ in range(50):
            jog.step(*drive.cycle(velocity=0))
            assert drive.order.target_velocity == 10_000
    assert drive.now - began == 8 * T + 0.25 + T
    assert not jog.renew(command, drive.image)


# A disabled axis whose drive is enabled from outside.


@pytest.mark.parametrize(
    ("off", "told"),
    [
        (0, 16),  # a quarter of a second after the first
        (15, 16),
        (16, 33),  # after a longer time off it restarts
    ],
)
def test_a_drive_that_is_enabled_again_and_again_for_a_quarter_of_a_second_is_reported(off, told):
    drive, supervision = watched()
    errors = []
    for cycle in range(told + 1):
        word = DISABLED if 0 < cycle <= off else ENABLED
        errors.append(supervision.energised(drive.cycle(statusword=word)[0], at_work=False))
    assert [error is not None for error in errors] == [False] * told + [True]
    assert errors[-1].message == "x: its drive was enabled, but not by this program"


def test_while_a_command_is_at_work_its_drive_may_be_enabled():
    drive, supervision = watched()
    for _ in range(100):
        assert supervision.energised(drive.cycle(statusword=ENABLED)[0], at_work=True) is None
    told = [supervision.energised(drive.cycle()[0], at_work=False) is not None for _ in range(17)]
    assert told == [False] * 16 + [True]


# Reports of a drive about its fault.


def history(drive: Drive, *words: int) -> DriveHistory:
    made = DriveHistory()
    for word in words:
        made.note(drive.cycle(statusword=word)[0])
    return made


def test_the_path_of_a_drive_is_its_last_four_states():
    drive = Drive()
    made = history(drive, DISABLED, DISABLED, READY, 0x0233, ENABLED, FAULT)
    assert made.path() == "ready to switch on > switched on > operation enabled > fault"
    assert not made.began_in_fault
    assert history(Drive(), FAULT).began_in_fault
    assert not history(Drive(), READY, FAULT).began_in_fault


def test_a_fault_is_explained_by_its_code_and_its_previous_state():
    drive = Drive(fault_objects=((0x603F, 0),))
    told = FaultDiagnosis(drive.parameters, drive.now)
    assert told.fault_error(drive.image, DriveHistory()).observed.startswith(
        "its error code is being read (603Fh); "
    )
    assert not told.step(*drive.cycle(statusword=FAULT))
    for request in drive.order.sdo:
        assert request.index == 0x603F
        drive.answers(request.id, 0x2310)
    assert told.step(*drive.cycle())
    error = told.fault_error(drive.image, history(drive, FAULT))
    assert (error.message, error.code) == ("x: the drive was found in fault", 0x2310)
    assert "2310" in error.observed
    told.doing = " during x.home()"
    assert (
        told.fault_error(drive.image, history(drive, ENABLED, FAULT)).message
        == "x: the drive went into fault during x.home()"
    )


@pytest.mark.parametrize(
    ("read", "emergencies", "code"),
    [
        (0x2310, [(0x8611, 0.0)], 0x2310),  # the value that it answers is current
        (0, [(0x8611, 0.0)], 0x8611),
        (None, [(0x8611, 0.0)], 0x8611),
        (0, [(0x7121, 1.0), (0x8611, 0.5)], 0x8611),  # the newest
        (0, [(0x8611, 0.5), (0x0000, 0.0)], 0x8611),  # not the error reset
        (0, [(0x8611, 5.0)], 0),
        (None, [], None),
    ],
)
def test_the_code_of_a_fault_is_603fh_and_else_the_newest_emergency_of_the_last_seconds(
    read, emergencies, code
):
    drive = Drive()
    told = FaultDiagnosis(drive.parameters, drive.now)
    told.step(*drive.cycle(statusword=FAULT))
    for request in drive.order.sdo:
        drive.answers(request.id, read, None if read is not None else 0x06020000)
    assert told.step(*drive.cycle())
    made = history(drive, FAULT)
    made.emcy.extend(Emcy(each, 0x01, bytes(5), drive.now - age) for each, age in emergencies)
    error = told.fault_error(drive.image, made)
    assert error.code == code
    texts = [f"EMCY {emcy.describe(each)} (error register: generic error)" for each, age in emergencies]
    shown = [text for text, (each, age) in zip(texts, emergencies, strict=True) if each and age < 5.0]
    assert error.observed.split("; ")[1:] == [*shown, "path: fault"]


def test_the_explanation_of_the_make_is_in_the_report_of_a_fault():
    drive = Drive(
        explain_fault=lambda code, values: [f"{code:04X}h and {values}"], fault_objects=((0x6041, 0),)
    )
    told = FaultDiagnosis(drive.parameters, drive.now)
    assert "; 0000h and {}; " in told.fault_error(drive.image, DriveHistory()).observed
    told.step(*drive.cycle(statusword=FAULT))
    for request in drive.order.sdo:
        drive.answers(request.id, 0x2310 if request.index == 0x603F else 7)
    assert told.step(*drive.cycle())
    assert f"; 2310h and { ({(0x6041, 0): 7}) }; " in told.fault_error(drive.image, DriveHistory()).observed


def test_a_fault_is_reported_with_its_last_two_emergencies():
    drive = Drive()
    made = history(drive, FAULT)
    made.emcy.extend(Emcy(code, 0, bytes(5), drive.now) for code in (0x2310, 0x3210, 0x8611))
    error = FaultDiagnosis(drive.parameters, drive.now).fault_error(drive.image, made)
    assert error.observed.split("; ")[1:] == [
        *(f"EMCY {emcy.describe(code)}" for code in (0x3210, 0x8611)),
        "path: fault",
    ]


@pytest.mark.parametrize(
    ("ages", "told"),
    [([5.5, 5.0], []), ([5.5, 5.0, 4.9], [2]), ([5.0, 4.0], [1]), ([4.0, 3.0, 2.0], [1, 2])],
)
def test_the_last_two_emergencies_of_the_five_seconds_before_now_are_reported(ages, told):
    """By this cycle's clock, however old the last statusword is."""
    drive = Drive()
    made = history(drive, FAULT)
    codes = (0x2310, 0x3210, 0x8611)
    made.emcy.extend(Emcy(code, 0, bytes(5), drive.now - age) for code, age in zip(codes, ages, strict=False))
    drive.image.statusword_stamp = drive.now - 4.0
    texts = [f"EMCY {emcy.describe(codes[number])}" for number in told]
    assert enrich(DriveError("no"), drive.image, made).observed.split("; ") == [
        *("drive: fault", *texts, "last statusword 4 s ago")
    ]


def test_an_error_code_that_arrives_at_the_last_moment_is_reported():
    drive = Drive(timing=DriveTimeouts(diagnosis=4 * T))
    silent = FaultDiagnosis(drive.parameters, drive.now)
    assert [silent.step(*drive.cycle(statusword=FAULT)) for _ in range(5)] == [False] * 4 + [True]


def test_a_drive_that_does_not_explain_its_fault_has_its_time():
    drive = Drive()
    silent = FaultDiagnosis(drive.parameters, drive.now)
    began = drive.now
    while not silent.step(*drive.cycle(statusword=FAULT)):
        assert drive.now < began + 2.0
    assert drive.now - began == 45 * T  # the first cycle after 0.7 s
    assert drive.order.cancel
    assert "no error code could be read (603Fh)" in silent.fault_error(drive.image, DriveHistory()).observed
    refused = FaultDiagnosis(drive.parameters, drive.now)
    refused.step(*drive.cycle())
    for request in drive.order.sdo:
        drive.answers(request.id, abort=0x06020000)
    assert refused.step(*drive.cycle())


def test_an_error_is_reported_with_the_observed_states_of_the_drive():
    drive = Drive()
    made = history(drive, READY, ENABLED)
    drive.cycle(mode=3)
    drive.image.statusword_stamp = drive.image.now - 0.5
    error = enrich(DriveError("no", observed="seen"), drive.image, made)
    assert error.observed == "seen; drive: ready to switch on > operation enabled; mode 3 (pv)"
    drive.image.statusword_stamp = drive.image.now - 0.75
    drive.operational, drive.nmt = False, 127
    drive.cycle()
    drive.image.statusword_stamp = drive.image.now - 0.75
    error = enrich(DriveError("no"), drive.image, made)
    assert error.observed == (
        "drive: ready to switch on > operation enabled; mode 3 (pv); NMT state pre-operational; last statusword 0.75 s ago"
    )
    assert "NMT" not in enrich(NodeError("no", node=1), drive.image, made).observed
    assert [nmt_text(SimpleNamespace(nmt=nmt, overdue=False, guarded=False)) for nmt in (5, -1, 4)] == [
        *("its heartbeat has stopped", "its heartbeat has stopped", "NMT state stopped")
    ]


def test_only_emergencies_of_the_last_seconds_that_are_no_resets_are_reported():
    drive = Drive()
    made = DriveHistory()
    drive.cycle(statusword=ENABLED)
    codes = [(0x2310, 1.0), (0x0000, 9.5), (0x3210, 9.5), (0x4210, 9.75), (0x5210, 10.0)]
    drive.image.emcy = tuple(parse(code.to_bytes(2, "little") + bytes(6), stamp) for code, stamp in codes)
    made.note(drive.image)
    assert [entry.code for entry in made.recent_emcy(10.0)] == [0x3210, 0x4210, 0x5210]


def test_the_last_sixteen_emergencies_of_a_drive_are_kept():
    drive = Drive()
    made = DriveHistory()

    def hears(code: int, times: int) -> list[int]:
        drive.image.emcy = tuple(parse(code.to_bytes(2, "little") + bytes(6), 9.0) for _ in range(times))
        made.note(drive.image)
        return [entry.code for entry in made.recent_emcy(10.0)]

    drive.cycle(statusword=ENABLED)
    assert hears(0x2310, 1) == [0x2310]
    assert hears(0x0000, 15) == [0x2310]
    assert hears(0x0000, 1) == []


def test_of_the_states_of_a_drive_the_last_eight_are_kept():
    drive = Drive()
    assert not history(drive, READY, *[REACTION, FAULT] * 3, REACTION).began_in_fault
    assert history(drive, READY, *[REACTION, FAULT] * 4).began_in_fault


def test_remedies_are_reported_once_each_the_first_first():
    line = join_remedies("a", "b").removeprefix("a").removesuffix("b")
    assert join_remedies("a", f"b{line}a") == f"a{line}b"
    assert join_remedies("", "b") == "b"
    assert join_remedies("a", "") == "a"


# The reference of the axis.


def test_the_last_set_point_sent_is_the_reference():
    reference_tracker = ReferenceTracker()
    reference_tracker.note(1.0, 1, None, 500, True)
    assert (reference_tracker.set_point, reference_tracker.set_point_at, reference_tracker.target) == (
        500,
        1.0,
        None,
    )
    reference_tracker.note(2.0, 1, None, 500, True)
    assert reference_tracker.set_point_at == 1.0  # the same one again
    reference_tracker.note(3.0, 1, None, 600, False)
    assert reference_tracker.set_point == 500
    reference_tracker.note(4.0, 8, None, 700, False)
    assert reference_tracker.target == 700
    reference_tracker.note(5.0, 8, None, None, False)
    assert reference_tracker.target == 700
    reference_tracker.note(6.0, 3, None, 800, False)
    assert reference_tracker.target is None
    reference_tracker.note(7.0, 6, None, None, True)
    reference_tracker.note(8.0, 6, None, None, True)
    assert reference_tracker.homing_since == 7.0
    reference_tracker.note(9.0, 6, None, None, False)
    assert reference_tracker.homing_since == float("inf")
    reference_tracker.forget(10.0)
    assert (reference_tracker.target, reference_tracker.set_point, reference_tracker.since) == (
        None,
        None,
        10.0,
    )


@pytest.mark.parametrize(
    ("mode", "target", "lead", "position", "state", "pull"),
    [
        (1, None, 20, 10, PowerState.OPERATION_ENABLED, 20),
        (1, None, None, 10, PowerState.OPERATION_ENABLED, None),
        (1, None, 20, None, PowerState.OPERATION_ENABLED, None),
        (1, None, 20, 10, PowerState.SWITCHED_ON, None),
        (1, None, 20, 10, PowerState.QUICK_STOP_ACTIVE, 20),
        (8, 50, None, 10, PowerState.OPERATION_ENABLED, 40),
        (8, 50, 20, 10, PowerState.OPERATION_ENABLED, 40),
        (8, 50, 80, 10, PowerState.OPERATION_ENABLED, 80),
        (8, -50, 20, 10, PowerState.OPERATION_ENABLED, -60),
    ],
)
def test_the_pull_of_the_demand_on_an_axis(mode, target, lead, position, state, pull):
    reference_tracker = ReferenceTracker()
    reference_tracker.note(0.0, mode, None, target, False)
    assert reference_tracker.pull(lead, position, state) == pull


@pytest.mark.parametrize(
    ("step", "quick", "position", "lead", "pull"),
    [
        (100, 10.0, 1500, None, None),  # 500 past the target: the braking distance v² / 2a
        (100, 10.0, 1500, 0, 0),
        (-100, 10.0, 500, None, None),
        (100, 5.0, 1601, None, None),  # a little harder than by its ramp, and two cycles earlier
        (100, 5.0, 1599, None, -599),  # held while it braked
        (100, 20.0, 1512, None, None),  # a little more gently
        (100, 20.0, 1513, None, -513),  # pushed on from where the brake ended
        (100, 5.0, 1400, 0, 0),  # 6062h says where the brake ended
        (100, 10.0, 900, None, 100),  # held before the target
        (100, 10.0, 900, 0, 100),  # the same, and 6062h has stuck
        (100, 10.0, 1500, 200, 200),  # held while it braked, and 6062h moves further
        (100, 10.0, 500, None, 500),  # went back
        (100, 10.0, 500, 0, 500),
        (0, 10.0, 1500, 0, -500),
        (0, 10.0, 1500, None, -500),  # it was not moving when the quick stop began
        (100, None, 1500, 0, 0),
        (100, None, 1500, None, -500),  # the deceleration of its quick stop is unknown
        (100, 0.0, 1500, None, -500),
    ],
)
def test_after_a_quick_stop_the_last_target_does_not_pull_an_axis_that_has_braked(
    step, quick, position, lead, pull
):
    reference_tracker = ReferenceTracker(quick=quick)
    for number, target in enumerate((1000 - step, 1000)):
        reference_tracker.note(float(number), 8, None, target, False)
    reference_tracker.note(2.0, 8, None, None, False)  # the quick stop sends no target
    assert reference_tracker.pull(lead, position, PowerState.QUICK_STOP_ACTIVE) == pull
    if pull != 200:  # in operation enabled the drive follows its target
        assert reference_tracker.pull(lead, position, PowerState.OPERATION_ENABLED) == 1000 - position


@pytest.mark.parametrize(
    ("step", "position", "rests", "pull"),
    [
        (100, 1500, 12.0, 0),  # 500 in 10 cycles from 100 per cycle: it has braked evenly
        (-100, 500, 12.0, 0),
        (100, 1500, 7.0, 0),  # the quick stop began up to two cycles later
        (100, 1500, 25.0, -500),  # it took too long: something held it
        (100, 1990, 12.0, -990),  # it went too far: it did not brake
        (100, 1500, 2.0, -500),
        (100, 1500, 1.0, -500),  # it was at rest before the targets ended
        (100, 1500, math.inf, -500),
        (100, 1500, -math.inf, -500),
        (100, 500, 12.0, 500),  # went back
        (0, 1500, 12.0, -500),
    ],
)
def test_the_time_of_a_quick_stop_with_an_unknown_ramp_shows_that_the_axis_has_braked(
    step, position, rests, pull
):
    reference_tracker = ReferenceTracker(period=1.0)
    for number, target in enumerate((1000 - step, 1000)):
        reference_tracker.note(float(number), 8, None, target, False)
    for number in range(2, 5):  # the quick stop sends no target
        reference_tracker.note(float(number), 8, None, None, False)
    seen = reference_tracker.pull(None, position, PowerState.QUICK_STOP_ACTIVE, rests)
    assert seen == (pull or None)
    reference_tracker.note(5.0, 8, None, 1000, False)  # a new target pulls again
    assert reference_tracker.pull(None, position, PowerState.OPERATION_ENABLED, rests) == 1000 - position


def test_in_a_velocity_mode_6062h_counts_once_it_has_moved():
    reference_tracker = ReferenceTracker()
    reference_tracker.note(0.0, 3, 100, None, False)
    shown = [reference_tracker.counts(demand, 3) for demand in (100, 120, 121, 80, 79)]
    assert shown == [False, False, True, False, True]
    assert not reference_tracker.counts(500, 4)  # it is not in that mode
    assert reference_tracker.counts(500, 1)
    assert not reference_tracker.counts(None, 1)


# The end of a stop without 6062h.


@pytest.mark.parametrize(
    ("mode", "set_point", "demand", "needed"),
    [
        (1, 4001, None, True),
        (1, 4000, None, False),
        (1, -4001, None, True),
        (1, 4001, 0, False),
        (3, 4001, None, False),
        (1, None, None, False),
    ],
)
def test_when_an_old_target_may_still_pull(mode, set_point, demand, needed):
    drive = Drive()
    drive.cycle(statusword=ENABLED, mode=mode, position=0, demand=demand)
    if set_point is not None:
        drive.image.reference_tracker.note(drive.now, 1, None, set_point, True)
    assert needs_relief(drive.image, drive.parameters) is needed
    assert is_target_unknown(drive.image, drive.parameters) is needed


def test_a_homing_search_is_blind_without_a_demand():
    drive = Drive()
    drive.cycle(statusword=ENABLED, mode=6, position=0)
    assert not is_target_unknown(drive.image, drive.parameters)
    drive.image.reference_tracker.note(drive.now, 6, None, None, True)
    assert not is_target_unknown(drive.image, drive.parameters)  # it begins in this cycle
    drive.cycle(position=0)
    assert is_target_unknown(drive.image, drive.parameters)


def test_a_relief_is_a_slow_set_point_under_halt():
    drive = Drive()
    relief = HoldSetPoint(700, drive.parameters)
    seen = []
    for word in (ENABLED, ENABLED, ENABLED, ENABLED | 0x1000, ENABLED):
        for request in drive.order.sdo:
            assert (request.index, request.value) == (0x6081, 1)
            drive.answers(request.id)
        done = relief.step(*drive.cycle(statusword=word, mode=1, position=700))
        assert drive.order.halt
        seen.append((done, drive.order.target_position, drive.order.bits))
    assert seen == [
        (False, None, 0),
        (False, 700, 0x30),
        (False, 700, 0x30),
        (False, None, 0),
        (True, None, 0),
    ]
    refused = HoldSetPoint(700, drive.parameters)
    refused.step(*drive.cycle(statusword=ENABLED))
    drive.answers(drive.order.sdo[0].id, abort=0x06090030)
    for word in (ENABLED, ENABLED, ENABLED | 0x1000, ENABLED, ENABLED):  # as if it took one all the same
        assert not refused.step(*drive.cycle(statusword=word))
        assert (drive.order.halt, drive.order.bits) == (True, 0)
    under_way = HoldSetPoint(700, drive.parameters)
    under_way.step(*drive.cycle())
    [asked] = drive.order.sdo
    under_way.cancel(drive.order)
    assert drive.order.cancel == [asked.id]


def test_that_this_program_did_not_run_is_reported_first():
    drive = Drive()
    made = history(drive, ENABLED)
    drive.later(0.5).cycle()
    error = enrich(DriveError("no", observed="seen", remedy="look"), drive.image, made)
    assert error is not None
    assert error.observed.startswith("this program did not run for 0.5 s of the last 2 s; seen; ")
    assert error.remedy.startswith("give this program enough processor time")
    assert error.remedy.endswith("look")
    alarm = enrich(DriveError("no", remedy="TREAT IT AS MOVING"), drive.image, made)
    assert alarm.remedy.startswith("TREAT IT AS MOVING")
    once = enrich(DriveError("this program did not run", remedy="look"), drive.image, made)
    assert once.remedy == "look"
