"""Paths, paces, remedies and stops by numbers worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from axisbus.cia402 import objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import PowerState
from axisbus.core.lateness import Lateness
from axisbus.core.scan import Scan
from axisbus.errors import DriveError, LimitError, StateError
from axisbus.machine import handle as handles
from axisbus.machine.handle import Handle
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.group.path_builder import plan_line
from axisbus.motion.moves.adopt_enabled_drive import DriveAdoption, resting_target
from axisbus.motion.moves.profile import braking_distance, duration
from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed, Start
from axisbus.motion.numbers import number, short_repr
from axisbus.motion.parameters import AxisLimits, Defaults, HoldsLoad
from axisbus.motion.path_limit_check import PathLimitCheck, PathSample, brakes_smoothly, limit_check_of
from axisbus.motion.position_limits import excess, widened
from axisbus.motion.stop.active_stop import StopKind, Stopping, stop_error
from axisbus.motion.stop.diagnosis import remedy
from axisbus.motion.stop.stop_sequence import AfterStop, StopLevel
from axisbus.motion.stop.velocity_following import VelocityRampTracker
from axisbus.motion.trajectory import SampledTrajectory, TrapezoidalTrajectory
from axisbus.motion.velocity_estimator import VelocityEstimator
from kit.direct.waiting import PumpWaiter
from kit.motion.rig import GENERIC, dictionary_of, parameters, rig
from kit.motion.steps import Drive, T

# The report of a stop.


def stop_sequence(**changes) -> SimpleNamespace:
    """A stop sequence that has ended as requested."""
    base = {
        "confirmed": True,
        "late": [],
        "on_its_path": False,
        "statusword_missing": False,
        "power_left_on": False,
        "blocked": False,
        "removes_power": False,
        "seen": PowerState.OPERATION_ENABLED,
        "path": [StopLevel.HALT],
        "missing_condition": "",
        "coasting_text": "",
    }
    made = SimpleNamespace(**(base | changes))
    made.escalated = bool(made.late) or made.statusword_missing or made.power_left_on or made.blocked
    return made


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, None),
        ({"statusword_missing": True}, None),
        ({"confirmed": False}, "the stop of the axis could not be confirmed"),
        ({"confirmed": False, "late": ["halt_time"]}, "the stop of the axis could not be confirmed"),
        ({"late": ["halt_time"]}, "the axis stopped only by a harder stop than was commanded"),
        ({"power_left_on": True}, "the axis is at standstill, but its drive did not execute the quick stop"),
        ({"blocked": True}, "the axis was blocked during a move"),
        (
            {"blocked": True, "power_left_on": True},
            "the axis is at standstill, but its drive did not execute the quick stop",
        ),
        (
            {"late": ["disable_time"], "removes_power": True},
            "the axis is at standstill, but its drive could not be switched off",
        ),
        (
            {"late": ["disable_time"], "removes_power": True, "seen": PowerState.UNKNOWN},
            "the axis is at standstill, but its drive could not be switched off",
        ),
        (
            {"late": ["disable_time"], "removes_power": True, "seen": PowerState.SWITCHED_ON},
            "the axis stopped only by a harder stop than was commanded",
        ),
        ({"removes_power": True, "seen": PowerState.SWITCH_ON_DISABLED}, None),
    ],
)
def test_the_report_of_a_stop(changes, message):
    error = stop_error(stop_sequence(**changes), "x")
    assert (None if error is None else error.message.removeprefix("x: ")) == message


def test_observations_of_a_stop_are_reported_in_order():
    made = stop_sequence(
        confirmed=False,
        late=["halt_time", "quick_stop_time"],
        path=[StopLevel.HALT, StopLevel.QUICK_STOP, StopLevel.NMT_STOP],
        missing_condition="a",
        coasting_text="b",
        power_left_on=True,
        seen=PowerState.FAULT,
    )
    assert stop_error(made, "x").observed == (
        "stop sequence: halt > quick stop > NMT stop; passed: halt_time, quick_stop_time; a; b; its power remains on because "
        "it holds a load; state 'fault', standstill not observed"
    )
    late = stop_error(stop_sequence(late=["halt_time", "quick_stop_time"]), "x")
    assert "halt in time (605Dh, 6084h) and did not" in late.remedy
    assert "raise halt_time and quick_stop_time in [axes.x.stop]" in late.remedy


def test_a_halt_that_brakes_too_slowly_along_its_path_names_the_path_and_not_the_drive():
    remedy = stop_error(stop_sequence(late=["halt_time"], on_its_path=True), "x").remedy
    assert remedy.startswith("braking along its path took longer than halt_time")
    assert remedy.endswith("raise halt_time in [axes.x.stop]")
    both = stop_error(stop_sequence(late=["halt_time", "quick_stop_time"], on_its_path=True), "x")
    assert "find out why the drive" in both.remedy


def test_a_repeated_stop_keeps_the_harder_kind_and_its_lock():
    stopping = Stopping(Drive().parameters)
    assert stopping.interruptible
    first, second = (CommandStatus(name) for name in ("a", "b"))
    stopping.ask(StopKind.STOP, AfterStop.HOLD, StopLevel.HALT, "first", first, None)
    assert (stopping.locks, stopping.interruptible, stopping.name, first.status) == (
        True,
        False,
        "a",
        Status.ACTIVE,
    )
    stopping.ask(StopKind.HALT, AfterStop.HOLD, StopLevel.HALT, "second", second, None)
    assert (stopping.kind, stopping.reason, stopping.locks) == (StopKind.STOP, "first", True)
    stopping.ask(StopKind.STOP, AfterStop.DISABLE, StopLevel.QUICK_STOP, "third", None, None)
    assert (stopping.reason, stopping.stop_sequence.level, stopping.stop_sequence.removes_power) == (
        "third",
        StopLevel.QUICK_STOP,
        True,
    )
    assert stopping.drop() == [first, second]
    assert (stopping.stop_sequence, stopping.locks, stopping.interruptible) == (None, False, True)
    assert stopping.drop() == []
    stopping.ask(StopKind.HALT, AfterStop.HOLD, StopLevel.HALT, "again", None, None)
    assert stopping.interruptible
    assert not stopping.locks
    assert stopping.name == "x's stop"


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (None, "error history (1003h)"),
        (0, "error history (1003h)"),
        (0x2310, "short circuit"),
        (0x3210, "measure the supply"),
        (0x4310, "cool down"),
        (0x5100, "hardware fault"),
        (0x6320, "drive's parameters"),
        (0x7305, "motor, encoder and brake"),
        (0x8000, "load, tuning and limits"),
        (0x9000, "external fault input"),
        (0xF000, "drive's manual for this error code"),
        (0x1000, "drive's manual for this error code"),
        (0x8130, "missed the master's heartbeat"),
        (0x8140, "the bus was off"),
        (0x8611, "does not follow its demand"),
        (0x8612, "limit switch or software limit"),
        (0x7121, "the motor is blocked"),
    ],
)
def test_each_error_code_has_its_remedy(code, words):
    assert words in remedy(code)


# Targets of a drive that is taken over.


@pytest.mark.parametrize(
    ("found", "offset", "position", "demand", "target"),
    [
        (1000, 0, 1000, 1000, 1000),
        (1000, 500, 1500, 1500, 1000),
        (1000, 500, 1520, None, 1000),
        (1000, 500, 1521, None, 1021),
        (1000, 500, 3000, 1520, 1000),
        (1000, 500, 3000, 1521, 2500),
        (1000, 500, 1450, 1000, 1000),  # a demand that leaves the offset out
        (1000, 500, 1250, 1000, 750),  # halted half-way: undecidable
        (1000, 500, 1251, 1000, 1000),
        (1000, 500, 1249, 1000, 749),
        (1000, 500, 1450, 1021, 950),
        (None, 500, 1450, 1021, 950),
        (None, 0, 1450, 1021, 1021),
        (5000, 0, 1450, 1021, 1021),
        (5000, 0, 1450, None, 1450),
        (1000, 500, None, None, None),
    ],
)
def test_the_target_that_holds_a_drive_which_adds_an_offset(found, offset, position, demand, target):
    drive = Drive()
    drive.cycle(statusword=0x0237, mode=8, position=position, demand=demand)
    assert resting_target(drive.image, found, offset) == target


M = ModeOfOperation


@pytest.mark.parametrize(
    ("mode", "offset", "moving", "candidates", "chosen"),
    [
        (M.CYCLIC_SYNC_POSITION, 0, False, [M.PROFILE_POSITION], [M.CYCLIC_SYNC_POSITION]),
        (M.CYCLIC_SYNC_VELOCITY, 0, False, [M.PROFILE_VELOCITY], [M.CYCLIC_SYNC_VELOCITY]),
        (
            M.CYCLIC_SYNC_POSITION,
            5,
            False,
            [M.PROFILE_VELOCITY, M.CYCLIC_SYNC_POSITION],
            [M.PROFILE_VELOCITY],
        ),
        (M.CYCLIC_SYNC_POSITION, 5, False, [M.CYCLIC_SYNC_POSITION, M.PROFILE_TORQUE], None),
        (M.CYCLIC_SYNC_VELOCITY, 0, True, [M.PROFILE_VELOCITY, M.CYCLIC_SYNC_POSITION], [M.PROFILE_VELOCITY]),
        (M.CYCLIC_SYNC_VELOCITY, 0, True, [M.CYCLIC_SYNC_POSITION], [M.CYCLIC_SYNC_VELOCITY]),
        (M.CYCLIC_SYNC_VELOCITY, 5, True, [M.CYCLIC_SYNC_POSITION], None),
        (M.CYCLIC_SYNC_VELOCITY, 5, False, [M.CYCLIC_SYNC_POSITION], None),
        (M.PROFILE_TORQUE, 0, False, [M.CYCLIC_SYNC_POSITION, M.PROFILE_TORQUE], [M.CYCLIC_SYNC_POSITION]),
        (M.PROFILE_TORQUE, 0, False, [M.PROFILE_TORQUE], [M.PROFILE_TORQUE]),
        (M.PROFILE_TORQUE, 5, True, [M.PROFILE_TORQUE], [M.PROFILE_TORQUE]),
        (M.CYCLIC_SYNC_TORQUE, 0, True, [M.PROFILE_TORQUE], None),
        (M.CYCLIC_SYNC_TORQUE, 5, False, [M.CYCLIC_SYNC_POSITION, M.PROFILE_POSITION], [M.PROFILE_POSITION]),
    ],
)
def test_the_modes_into_which_an_adopted_drive_can_be_switched_without_a_jump(
    mode, offset, moving, candidates, chosen
):
    taken = DriveAdoption(mode, Drive().parameters)
    taken._read.values[objects.TORQUE_OFFSET, 0] = offset
    image = SimpleNamespace(standstill=not moving)
    if chosen is None:
        with pytest.raises(StateError, match="without a jump"):
            taken.choose(image, candidates)
    else:
        assert taken.choose(image, candidates) == chosen


@pytest.mark.parametrize(
    ("found", "asked", "holds", "held"),
    [
        (M.CYCLIC_SYNC_VELOCITY, None, HoldsLoad.NO, True),
        (M.CYCLIC_SYNC_VELOCITY, M.PROFILE_VELOCITY, HoldsLoad.NO, True),
        (M.CYCLIC_SYNC_VELOCITY, M.CYCLIC_SYNC_VELOCITY, HoldsLoad.NO, False),
        (M.CYCLIC_SYNC_VELOCITY, M.CYCLIC_SYNC_VELOCITY, HoldsLoad.TORQUE, False),
        (M.CYCLIC_SYNC_POSITION, M.CYCLIC_SYNC_POSITION, HoldsLoad.NO, True),
        (M.PROFILE_TORQUE, M.PROFILE_TORQUE, HoldsLoad.NO, False),
        (M.PROFILE_TORQUE, M.PROFILE_TORQUE, HoldsLoad.BRAKE, True),
    ],
)
def test_how_long_the_targets_of_a_drive_that_is_taken_over_are_held(found, asked, holds, held):
    assert DriveAdoption(found, Drive(holds_load=holds).parameters).holds_until(asked) is held


@pytest.mark.parametrize(
    ("mode", "standstill", "torque", "targets"),
    [
        (M.CYCLIC_SYNC_POSITION, True, 70, (900, 0, 0)),
        (M.CYCLIC_SYNC_VELOCITY, True, 70, (500, -30, 0)),
        (M.CYCLIC_SYNC_VELOCITY, False, 70, (500, 40, 0)),
        (M.CYCLIC_SYNC_TORQUE, True, 70, (500, 0, 65)),
        (M.CYCLIC_SYNC_TORQUE, True, None, (500, 0, 50)),
        (M.PROFILE_TORQUE, True, 70, (500, 0, 70)),
        (M.PROFILE_TORQUE, True, None, (500, 0, 50)),
    ],
)
def test_a_drive_that_is_taken_over_gets_the_targets_of_its_present_motion(mode, standstill, torque, targets):
    taken = DriveAdoption(mode, Drive().parameters)
    taken._read.values.update(
        {
            (objects.TARGET_POSITION, 0): 900,
            (objects.TARGET_VELOCITY, 0): 40,
            (objects.TARGET_TORQUE, 0): 50,
            (objects.VELOCITY_OFFSET, 0): 30,
            (objects.TORQUE_OFFSET, 0): 5,
        }
    )
    image = SimpleNamespace(
        reference=500, standstill=standstill, torque=torque, position=900, demand=900, unwrapped=int
    )
    order = SimpleNamespace()
    taken.hold(image, order)
    assert (order.target_position, order.target_velocity, order.target_torque) == targets


# Distances, durations, and moves from a present speed.


@pytest.mark.parametrize(
    ("distance", "speed", "ramp", "seconds"),
    [
        (8.0, 4.0, 2.0, 4.0),
        (-8.0, 4.0, 2.0, 4.0),
        (12.0, 4.0, 2.0, 5.0),
        (2.0, 4.0, 2.0, 2.0),
        (0.0, 4.0, 2.0, 0.0),
    ],
)
def test_the_seconds_of_a_trapezoid(distance, speed, ramp, seconds):
    assert duration(distance, speed, ramp) == seconds
    assert braking_distance(4.0, 2.0) == 4.0


@pytest.mark.parametrize(
    ("velocity", "end", "top", "up", "down", "times", "positions"),
    [
        # from rest: 1 s up, 1 s at 4, 2 s down
        (0.0, 10.0, 4.0, 4.0, 2.0, [0.5, 1.0, 1.5, 2.0, 3.0, 4.0], [0.5, 2.0, 4.0, 6.0, 9.0, 10.0]),
        # already at 4
        (4.0, 12.0, 4.0, 4.0, 2.0, [1.0, 2.0, 3.0, 4.0], [4.0, 8.0, 11.0, 12.0]),
        # faster than it may be: 1 s down to 2, then on
        (4.0, 9.0, 2.0, 4.0, 2.0, [1.0, 2.0, 3.0, 4.0, 4.5], [3.0, 5.0, 7.0, 8.75, 9.0]),
        # too fast to stop at the end: 2 s to rest at 4, and 1 back
        (
            4.0,
            3.0,
            4.0,
            2.0,
            2.0,
            [2.0, 2.5, 3.0, 2.0 + math.sqrt(2.0)],
            [4.0, 3.75, 3.1715728752538097, 3.0],
        ),
        # the other direction
        (-4.0, -4.0, 4.0, 4.0, 2.0, [1.0, 2.0, 9.0], [-3.0, -4.0, -4.0]),
        (-4.0, 4.0, 4.0, 4.0, 2.0, [2.0, 2.5], [-4.0, -3.5]),
    ],
)
def test_a_move_continues_from_the_speed_that_the_axis_has(velocity, end, top, up, down, times, positions):
    way = ProfileFromSpeed(Start(0.0, velocity), end, top, up, down)
    assert [way.position(t) for t in times] == pytest.approx(positions)
    assert way.position(-1.0) == 0.0
    assert way.position(way.duration) == end
    assert way.span == (min(0.0, end, *positions), max(0.0, end, *positions))
    assert way.top_acceleration == max(up, down)


def test_a_move_to_the_present_position_takes_no_time():
    way = ProfileFromSpeed(Start(5.0, 0.0), 5.0, 1.0, 1.0, 1.0)
    assert (way.duration, way.position(0.0), way.position(1.0), way.span) == (0.0, 5.0, 5.0, (5.0, 5.0))


# The pace of a path.

PACE = PathLimitCheck("deg", 4.0, 8.0, "max_acceleration", 0.5, 0.0)


@pytest.mark.parametrize(
    ("before", "position", "told"),
    [
        (PathSample(0.0, 4.0), 2.0, None),
        (PathSample(0.0, 4.0), 2.001, "faster than max_velocity"),
        (PathSample(0.0, -4.0), -2.001, "faster than max_velocity"),
        (PathSample(0.0, 0.0), 2.0, None),
        (PathSample(0.0, -0.01), 2.0, "harder than max_acceleration"),
        (PathSample(0.0, 4.0), 0.0, None),
        (PathSample(0.0, 4.0), -0.01, "harder than max_acceleration"),
    ],
)
def test_a_step_is_checked_against_velocity_and_acceleration(before, position, told):
    found = PACE.excess(before, PACE.next(before, position))
    assert (None if found is None else found.what) == told


def test_a_velocity_within_the_rounding_error_is_allowed():
    most = 4.0 * (1.0 + 1e-6) + 8.0 * math.ulp(2.0) / 0.5
    before = PathSample(2.0, 4.0)
    assert PACE.excess(before, PathSample(2.0, most)) is None
    assert PACE.excess(before, PathSample(2.0, math.nextafter(most, 5.0))).what == "faster than max_velocity"


def test_a_path_may_always_brake_and_round():
    before = PathSample(0.0, 4.0)
    after = PACE.next(before, -1.0)
    assert PACE.excess(before, after, 11.0).what == "harder than max_acceleration"
    assert PACE.excess(before, after, 12.0) is None
    assert replace(PACE, acceleration=None).excess(before, after) is None
    assert replace(PACE, velocity=None).excess(before, PACE.next(before, 3.5)) is None
    # an increment of rounding in a period: 0.25 / 0.5 / 0.5
    coarse = replace(PACE, increment=0.25)
    assert coarse.excess(before, PACE.next(before, -0.25)) is None
    assert coarse.excess(before, PACE.next(before, -0.26)) is not None


def test_numbers_far_from_0_are_as_exact_as_they_can_be():
    far = 2.0**40  # its last place is 2**-12: 8 of them in half a second are 1/256 per s
    before = PathSample(far, 4.0)
    assert PACE.excess(before, PACE.next(before, far + 2.0 + 1 / 1024)) is None
    assert PACE.excess(before, PACE.next(before, far + 2.0 + 1 / 256)) is not None


def test_the_source_of_a_limit_is_not_in_its_repr():
    assert (
        repr(AxisLimits(velocity=4.0))
        == "AxisLimits(position=None, velocity=4.0, acceleration=None, torque=None)"
    )


@pytest.mark.parametrize(
    ("limits", "defaults", "trajectory", "expected"),
    [
        (
            AxisLimits(velocity=4.0, acceleration=8.0),
            Defaults(acceleration=5.0),
            SampledTrajectory([0.0, 1.0], 1.0),
            (4.0, 8.0),
        ),
        (
            AxisLimits(velocity=4.0),
            Defaults(acceleration=5.0),
            SampledTrajectory([0.0, 1.0], 1.0),
            (4.0, None),
        ),
        (AxisLimits(), Defaults(acceleration=5.0), SampledTrajectory([0.0, 1.0], 1.0), (None, 5.0)),
        (AxisLimits(), Defaults(acceleration=5.0), TrapezoidalTrajectory(0.0, 1.0, 1.0, 3.0), (None, 3.0)),
        (AxisLimits(), Defaults(), SampledTrajectory([0.0, 1.0], 1.0), (None, None)),
        (
            AxisLimits(acceleration=8.0),
            Defaults(acceleration=5.0),
            TrapezoidalTrajectory(0.0, 1.0, 1.0, 3.0),
            (None, 8.0),
        ),
    ],
)
def test_the_pace_of_a_path_comes_from_limits_defaults_and_trajectory(limits, defaults, trajectory, expected):
    base = parameters("x", dictionary_of(GENERIC), limits=limits, defaults=defaults)
    found = limit_check_of(base, trajectory)
    assert (found.velocity, found.acceleration) == expected
    assert (found.unit, found.period, found.increment) == ("deg", 0.01, 0.001)


@pytest.mark.parametrize(
    ("path", "speed", "deceleration", "smooth"),
    [
        (lambda t: 4.0 * t, 4.0, 2.0, True),
        (lambda t: -4.0 * t, -4.0, 2.0, True),
        (lambda t: 4.0 * t, 0.0, 2.0, True),
        (lambda _: 7.0, 4.0, 2.0, False),  # it stops dead
        (lambda t: -4.0 * t, 4.0, 2.0, False),  # it turns round
        (lambda t: 4.0 * t, 0.5, 2.0, True),  # slower than one period brakes
        (lambda t: 2.5 * t, 4.0, 2.0, True),  # half of the allowed deceleration is still no jolt
        (lambda t: 2.4 * t, 4.0, 2.0, False),
    ],
)
def test_a_path_brakes_smoothly_if_its_deceleration_suffices(path, speed, deceleration, smooth):
    assert brakes_smoothly(path, 1.0, 0.5, speed, deceleration) is smooth


@pytest.mark.parametrize(
    ("start", "speed", "found"),
    [
        (0.0, 4.0, None),  # 2 in the period and 4 to brake
        (4.0, 4.0, None),
        (4.25, 4.0, (4.25, 4.0, 10.25, 10.25, 1.5)),
        (-4.0, -4.0, None),
        (-4.25, -4.0, (-4.25, 4.0, -10.25, -10.25, 1.5)),
        (9.0, 4.0, (9.0, 4.0, 15.0, 11.0, 0.5)),
        (9.0, 0.0, None),
    ],
)
def test_a_path_is_checked_as_far_ahead_as_braking_takes(start, speed, found):
    seen = excess(lambda t: start + speed * t, 0.0, 0.5, (-10.0, 10.0), 2.0)
    assert (None if seen is None else tuple(seen)) == found


def test_a_position_outside_the_limits_widens_them_up_to_itself():
    assert widened((-1.0, 1.0), 0.0, 0.5) == (-1.5, 1.5)
    assert widened((-1.0, 1.0), 3.0, 0.5) == (-1.5, 3.5)
    assert widened((-1.0, 1.0), -3.0, 0.5) == (-3.5, 1.5)


# Straight lines.


def line(ends: dict[str, float], velocity: float = 5.0, acceleration: float = 10.0, **limits):
    axes = {
        name: parameters(name, dictionary_of(GENERIC), limits=limits.get(name, AxisLimits())) for name in ends
    }
    return plan_line(dict.fromkeys(ends, 0.0), ends, axes, velocity, acceleration)


def test_a_line_has_the_speed_of_its_length_and_no_axis_is_faster_than_it_may_be():
    way, speed = line({"x": 30.0, "y": -40.0})
    assert speed * 50.0 == pytest.approx(5.0)
    assert way.accelerations == pytest.approx((6.0, 8.0))
    assert (way.at(0.0), way.at(way.length)) == ((0.0, 0.0), (30.0, -40.0))
    assert tuple(speed * share for share in way.speed_ratios) == pytest.approx((3.0, 4.0))
    assert (way.lowest, way.highest) == ((0.0, -40.0), (30.0, 0.0))
    slow, _ = line({"x": 30.0, "y": -40.0}, y=AxisLimits(velocity=2.0))
    assert slow.speeds == pytest.approx((1.5, 2.0))
    soft, _ = line({"x": 30.0, "y": -40.0}, x=AxisLimits(acceleration=3.0))
    assert soft.accelerations == pytest.approx((3.0, 4.0))


def test_a_line_of_more_than_a_year_was_not_meant():
    year = 366 * 86_400.0
    line({"x": 1.0}, velocity=1.0 / (year - 1.0), acceleration=1.0)
    with pytest.raises(LimitError):
        line({"x": 1.0}, velocity=1.0 / (year + 1.0), acceleration=1.0)


# Numbers, tracks, profiles.


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (1, 1.0),
        (0.5, 0.5),
        (True, None),
        (math.nan, None),
        (-math.inf, None),
        ("1", None),
        (None, None),
        (10**400, None),
        (1 + 0j, None),
    ],
)
def test_numeric_values_are_converted_and_others_are_none(value, found):
    assert number(value) == found


def test_a_value_is_reported_in_a_line():
    assert short_repr("a" * 38) == "'" + "a" * 38 + "'"
    assert short_repr("a" * 39) == "'" + "a" * 39 + "... (41 characters)"


def test_three_speeds_have_a_median_already():
    speeds = VelocityEstimator()
    for stamp, value in ((0.0, 0), (1.0, 10), (2.0, 40), (3.0, 60)):
        speeds.take(value, stamp)
    assert speeds.motion == (20.0, 0.0)


def test_a_deviation_from_the_ramp_decays_within_a_minute():
    drive = Drive(ages={"position": 10.0, "velocity": 10.0})
    way = VelocityRampTracker(0, 1.0, 1.0, 1.0, 1.0)
    way.step(drive.cycle(position=0, velocity=0)[0])
    way.step(drive.cycle(position=-6000)[0])
    assert way.behind == 6000.0
    way.step(drive.later(1.0 - T).cycle(position=-6000)[0])
    assert way.behind == pytest.approx(5900.0)


# The grid of the scan, and waiting for several.


class Grid:
    """A cycle that begins at a given time; ``sync``: the time of another device's SYNC if that is the grid."""

    def __init__(self) -> None:
        self.time, self.late, self.came = 10.0, 0.0, None
        self.asked: list[float] = []

    def now(self) -> float:
        return self.time

    def wait_until(self, t: float) -> float | None:
        self.asked.append(t)
        self.time = max(self.time, t) + self.late
        self.late = 0.0
        return self.came

    def receive(self) -> None:
        pass


@pytest.mark.parametrize(
    ("late", "next_", "skipped"),
    [
        (0.0, 11.0, 0),
        (0.125, 11.0, 0),
        (0.1875, 11.0, 0),
        (0.25, 11.5, 1),
        (0.5, 11.5, 1),
        (0.6875, 11.5, 1),
        (0.75, 12.0, 2),
        (1.5, 12.5, 3),
    ],
)
def test_a_late_cycle_skips_the_points_that_have_passed_or_are_less_than_half_a_period_ahead(
    late, next_, skipped
):
    cycle = Grid()
    scan = Scan(cycle, {}, {}, 0.5, {})
    scan._wait(cycle)
    assert cycle.asked == [10.0]
    cycle.late = late
    scan._wait(cycle)
    scan._wait(cycle)
    assert cycle.asked == [10.0, 10.5, next_]
    assert scan.lateness.skipped == skipped
    assert scan.starvation.missing(cycle.time) == (0.0 if not skipped else min(late, 2.0))


@pytest.mark.parametrize(("came", "skipped"), [(10.5, 0), (10.6875, 0), (10.75, 1), (11.5, 2)])
def test_if_another_device_sends_sync_its_time_is_the_grid(came, skipped):
    cycle = Grid()
    scan = Scan(cycle, {}, {}, 0.5, {})
    scan._wait(cycle)
    cycle.came, cycle.time = came, came
    scan._wait(cycle)
    cycle.came = None
    scan._wait(cycle)
    assert scan.lateness.skipped == skipped
    assert cycle.asked[-1] == came + 0.5


def test_after_the_supervisor_takes_over_nothing_is_sent_behind_a_stuck_frame():
    cycle = Grid()
    done = []
    scan = Scan(cycle, {}, {}, 0.5, {})
    cycle.commit = lambda: (done.append("commit"), setattr(scan, "ended", len(done) > 3))
    cycle.sync, cycle.heartbeat = lambda: done.append("sync"), lambda: done.append("heartbeat")
    scan.observers.append(lambda *_: done.append("seen"))
    scan.once()
    scan.once()
    assert done == ["sync", "commit", "heartbeat", "seen", "sync", "commit"]


def test_after_the_supervisor_takes_over_between_two_cycles_nothing_is_sent():
    cycle = Grid()
    done = []
    scan = Scan(cycle, {}, {}, 0.5, {})
    cycle.wait_until = lambda _: setattr(scan, "ended", True)
    cycle.commit = cycle.sync = cycle.heartbeat = lambda: done.append("sent")
    scan.once()
    assert done == []


def test_several_waiters_share_the_time_of_a_wait(monkeypatch):
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(handles, "time", SimpleNamespace(monotonic=lambda: clock.now))

    class Waiter:
        def __init__(self, takes: float) -> None:
            self.takes, self.given = takes, []

        def wait(self, done, timeout):
            self.given.append(timeout)
            clock.now += self.takes
            return done()

    first, second, third = Waiter(0.25), Waiter(1.0), Waiter(0.0)
    waiting = [Handle(f"h{n}", waiter) for n, waiter in enumerate((first, first, second, third))]
    with pytest.raises(TimeoutError, match=r"h0, h1, h2, h3: not ended after 1 s"):
        handles.wait(waiting, timeout=1.0)
    assert (first.given, second.given, third.given) == ([1.0], [0.75], [0.0])
    for each in waiting:
        each._finish(Status.DONE, None)
    assert handles.wait(waiting[:2], waiting[2]) == waiting[:3]
    assert first.given[-1] is None


# On the plant.


def test_a_drive_that_falls_out_of_a_velocity_mode_does_not_go_to_an_old_target():
    r = rig().enabled()
    r.axis.move_velocity(50.0).wait(3)
    r.run(1.0)
    before = r.drive.axis.motor.position
    r.drive.dials.spontaneous_mode = 1
    r.run(2.0)
    assert abs(r.drive.axis.motor.position - before) < 20_000
    assert r.axis.error is not None


@pytest.mark.parametrize(
    ("distance", "fits"),
    [(5.0, True), (5.004, True), (5.005, False), (-5.0, True), (-5.004, True), (-5.005, False)],
)
def test_a_relative_move_may_end_at_its_limit(distance, fits):
    """It counts from a measured position, which may be off by 4 increments: an end beyond by that is at the limit."""
    r = rig(limits=AxisLimits(position=(-5.0, 5.0), velocity=400.0)).enabled()
    r.axis.home(37).wait(3)
    moved = r.axis.move_relative(distance)
    r.run(1.0)
    assert (moved.exception() is None) is fits
    assert r.axis.position == pytest.approx(max(-5.0, min(distance, 5.0)) if fits else 0.0, abs=0.0011)


def test_a_snapshot_reports_when_its_position_was_received():
    r = rig()
    r.run(0.2)
    snapshot = r.axis.snapshot
    assert snapshot.position_stamp == pytest.approx(snapshot.now, abs=0.02)


def test_how_late_the_cycles_were():
    late = Lateness()
    for seconds in (0.25, 0.5, 0.125):
        late.note(seconds)
    assert (late.cycles, late.last, late.worst, late.report().mean, late.skipped) == (
        3,
        0.125,
        0.5,
        0.875 / 3,
        0,
    )


@pytest.mark.parametrize(
    ("period", "age", "stale"),
    [(0.01, 0.25, False), (0.01, 0.3125, True), (0.125, 1.25, False), (0.125, 1.5, True)],
)
def test_an_old_value_is_not_current_after_ten_periods_and_a_quarter_of_a_second(period, age, stale):
    cycle = Grid()
    scan = Scan(cycle, {}, {}, period, {})
    scan.snapshots["x"] = SimpleNamespace(now=10.0)
    cycle.time = 10.0 + age
    assert (scan.silent is not None) is stale
    scan.ended = True
    assert "the machine is closed" in scan.silent
    scan.failure = DriveError("broken")
    assert "the scan of the bus has failed: " in scan.silent
    scan.failure = None
    assert scan.dead is None
    scan.disown()
    assert "forked" in scan.dead
    with pytest.raises(StateError):
        scan.submit("x", None, CommandStatus("h"))


def test_a_pump_waits_in_virtual_time():
    cycle = Grid()
    scan = Scan(cycle, {}, {}, 0.5, {})
    cycle.commit = cycle.sync = cycle.heartbeat = lambda: None
    seen = []
    waiter = PumpWaiter(scan, seen.append)
    assert not waiter.wait(lambda: False, 2.0)
    assert seen == [10.0, 10.5, 11.0, 11.5, 12.0]
    assert waiter.wait(lambda: len(seen) == 7, None)
    assert not waiter.is_in_cycle()
    scan.observers.append(lambda *_: seen.append(waiter.is_in_cycle()))
    waiter.run_cycle()
    assert seen[-2] is True
    scan.ended = True
    assert not waiter.wait(lambda: False, None)
    waiter.run_cycle()
    assert len(seen) == 9


@pytest.mark.parametrize("look", ["exception", "done", "aborted", "wait", None])
def test_a_failure_that_the_program_never_read_is_logged(look, caplog):
    handle = Handle("x.stop()", SimpleNamespace(wait=lambda *_: True))
    handle._finish(Status.ERROR, DriveError("broken"))
    if look == "wait":
        with pytest.raises(DriveError):
            handle.wait()
    elif look is not None:
        found = getattr(handle, look)
        assert (found() if look == "exception" else found) in (handle.error, False)
    with caplog.at_level("ERROR", logger="axisbus"):
        handle.__del__()
    assert ("x.stop() failed, and its handle was not read" in caplog.text) is (look is None)
    handle.exception()


@pytest.mark.parametrize(
    ("at", "deceleration", "fits"),
    [
        (80.0, 500.0, True),
        (80.0, 20.0, False),
        (20.0, 20.0, True),
        (80.0, 600.0, True),
        (80.0, 80.0, True),
        (90.0, 80.0, False),
    ],
)
def test_a_deceleration_too_weak_to_stop_within_the_limits_is_refused(at, deceleration, fits):
    """From 50 deg/s: 2.5 deg with 500 deg/s², 15.6 with 80, 62.5 with 20."""
    r = rig(limits=AxisLimits(position=(-100.0, 100.0), velocity=400.0)).enabled()
    r.axis.home(37).wait(3)
    r.axis.move_velocity(50.0).wait(3)
    r.until(lambda: r.axis.position > at)
    handle = r.axis.move_velocity(49.0, acceleration=500.0, deceleration=deceleration)
    r.run(0.05)
    error = handle.exception()
    assert (error is None) is fits
    assert r.drive.axis.motor.velocity == pytest.approx(49_000 if fits else 50_000, abs=1200)
    r.until(lambda: abs(r.drive.axis.motor.velocity) < 1.0)
    assert r.axis.position <= 100.0


@pytest.mark.parametrize("deceleration", [500.0, 20.0])
def test_a_move_to_a_target_never_uses_a_deceleration_that_is_too_weak(deceleration):
    r = rig(limits=AxisLimits(position=(-100.0, 100.0), velocity=400.0)).enabled()
    r.axis.home(37).wait(3)
    r.axis.move_velocity(50.0).wait(3)
    r.until(lambda: r.axis.position > 80.0)
    handle = r.axis.move_absolute(0.0, acceleration=500.0, deceleration=deceleration)
    r.run(0.05)
    assert (handle.exception() is None) is (deceleration == 500.0)
    r.run(2.0)
    assert r.axis.position <= 100.0
