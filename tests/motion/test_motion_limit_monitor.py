"""Danger seen in time to brake, by numbers that can be added up by hand: limits of position and velocity, and lag."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from axisbus.cia402.options import Ramp
from axisbus.errors import LimitError, StaleError
from axisbus.motion.parameters import AxisLimits, Defaults, HoldsLoad
from axisbus.motion.states import AxisState
from axisbus.motion.stop.following_error import FollowingErrorMonitor, RecentPeak
from axisbus.motion.stop.limits import LimitMonitor, stop_of
from axisbus.motion.stop.stop_sequence import StopLevel
from axisbus.motion.stop_deceleration import Braking, CommandedMotion
from kit.motion.steps import Drive, T

FREE, MOVE = AxisState.CONTINUOUS_MOTION, AxisState.DISCRETE_MOTION
LIMITS = AxisLimits(position=(0.0, 100.0), velocity=400.0)  # deg of 1000 increments
DOWN = 640_000.0  # increments per s²


class Bounded:
    """A guard over an axis between 0 and 100 deg that goes so many increments in each cycle, by default without a lag."""

    def __init__(self, step: float, limits: AxisLimits = LIMITS, **changes) -> None:
        self.drive = Drive(limits=limits, **changes)
        self.guard = LimitMonitor(self.drive.parameters)
        self.guard._lag = 0.0  # as measured before
        self.step = step

    def to(self, last: float, *, demand: float | None = None, cycles: int = 8, **values) -> Bounded:
        """Go on until ``last``, with the demand so far ahead."""
        for left in range(cycles - 1, -1, -1):
            here = last - left * self.step
            ahead = None if demand is None else round(here + demand)
            self.drive.cycle(statusword=0x0237, position=round(here), demand=ahead, **values)
            self.guard.look(self.drive.image)
        return self

    def rest(
        self, state: AxisState = FREE, commanded: CommandedMotion | None = None, **options
    ) -> float | None:
        """Return the possible stopping position, by the error's text; None without a danger."""
        error = self.guard.danger(self.drive.image, state, commanded=commanded, **options)
        return None if error is None else float(error.observed.split("stop at ")[1].split(";")[0])


def turning(step: float, down: float = DOWN) -> CommandedMotion:
    return CommandedMotion(speed=step / T, up=1.0, down=down)


# 1000 increments per cycle are 64 000 per s: 4000 pass in four cycles before a stop acts, and 3200 on its ramp.


@pytest.mark.parametrize(
    ("step", "last", "rest"),
    [
        (1000, 92_800, None),
        (1000, 92_801, 100.001),
        (1000, 99_000, 106.2),
        (-1000, 7200, None),
        (-1000, 7199, -0.001),
        (-1000, 92_801, None),  # moving back from there
        (1000, 7199, None),
        (0, 100_000, None),
    ],
)
def test_a_free_motion_is_stopped_if_its_stop_would_end_beyond_the_limits(step, last, rest):
    assert Bounded(step).to(last).rest(commanded=turning(step)) == rest


def test_an_older_position_counts_with_the_distance_moved_since():
    late = Bounded(1000).to(91_801)
    assert late.rest(commanded=turning(1000)) is None
    late.drive.cycle()
    late.guard.look(late.drive.image)
    assert late.rest(commanded=turning(1000)) == 100.001


def test_a_drive_that_cannot_brake_counts_with_its_travel_until_a_stop_acts():
    unknown = CommandedMotion(speed=64_000.0, up=1.0)
    parameters = {"defaults": replace(Drive().parameters.defaults, acceleration=None)}
    assert Bounded(1000, **parameters).to(96_000).rest(commanded=unknown) is None
    assert Bounded(1000, **parameters).to(96_001).rest(commanded=unknown) == 100.001


def test_without_active_limits_no_motion_is_stopped():
    assert Bounded(1000).to(99_000).rest(commanded=turning(1000), bounded=False) is None
    assert Bounded(1000, limits=AxisLimits()).to(999_000).guard.danger(Bounded(0).drive.image, FREE) is None
    for state in (
        AxisState.STANDSTILL,
        AxisState.STOPPING,
        AxisState.ERRORSTOP,
        AxisState.SYNCHRONIZED_MOTION,
    ):
        assert Bounded(1000).to(99_000).rest(state, commanded=turning(1000)) is None


def test_the_limits_count_from_the_zero_that_the_user_has_set():
    moved = Bounded(1000).to(92_801)
    moved.drive.image.origin = 1
    assert moved.rest(commanded=turning(1000)) is None
    moved.drive.image.origin = -1
    assert moved.rest(commanded=turning(1000)) == 100.002


def test_a_command_that_accelerates_counts_with_the_velocity_it_may_reach_until_the_stop_acts():
    """From 64 000/s with 64 000/s² for 5.5 cycles: 69 500/s."""
    faster = CommandedMotion(speed=128_000.0, up=64_000.0, down=DOWN)
    # 4343.75 until a stop acts and 3773.6328 on the ramp
    assert Bounded(1000).to(100_000 - 8118).rest(commanded=faster) is None
    assert Bounded(1000).to(100_000 - 8117).rest(commanded=faster) == pytest.approx(100.0, abs=0.002)
    slower = CommandedMotion(speed=64_000.0, up=64_000.0, down=DOWN)
    assert Bounded(1000).to(100_000 - 8117).rest(commanded=slower) is None


def test_an_axis_that_is_turned_back_counts_with_both_of_its_rates():
    """From -20 480/s at rest after 2.048 of 5.5 cycles, by 640 000/s²; then 64 000/s² for 3.452 cycles: 3452/s."""
    back = CommandedMotion(speed=64_000.0, up=64_000.0, down=DOWN)
    rest = Bounded(-320).to(99_900).rest(commanded=back)
    assert rest == pytest.approx(99.9 + 3452 * 4 / 64_000 + 3452**2 / (2 * DOWN) / 1000, abs=0.001)
    weak = CommandedMotion(speed=64_000.0, up=64_000.0, down=64_000.0)
    assert Bounded(-320).to(99_900).rest(commanded=weak) is None  # it cannot turn before a stop acts
    assert Bounded(-320).to(99_900).rest(commanded=weak._replace(up=DOWN)) is not None
    assert Bounded(-320).to(99_000).rest(commanded=back) is None


def test_an_axis_at_standstill_that_may_move_counts_from_the_command_on():
    still = Bounded(0).to(99_999)
    for _ in range(20):
        still.drive.cycle()  # it sends on change
        still.guard.look(still.drive.image)
    commanded = CommandedMotion(speed=64_000.0, up=640_000.0, down=DOWN)
    # from now on: 4 cycles until a stop acts, 5.5 to speed up: 55 000/s, 3437 and 2363 increments
    assert still.rest(commanded=commanded) == pytest.approx(99.999 + 3.437 + 2.363, abs=0.01)
    still.drive.cycle()
    still.guard.look(still.drive.image)
    # a cycle later: 5 and 6.5, but 64 000/s at most, 5000 and 3200
    assert still.rest(commanded=commanded) == pytest.approx(99.999 + 5.0 + 3.2, abs=0.01)


def test_without_a_command_the_acceleration_that_is_seen_counts():
    """Positions 16 k²: 131 072/s², seen at 1024 (2 n - 3) per s; 704 * 16 more until a stop acts."""
    drive = Drive(limits=LIMITS)
    guard = LimitMonitor(drive.parameters)
    guard._lag = 0.0
    for k in range(20):
        drive.cycle(statusword=0x0237, position=91_000 + 16 * k * k)
        guard.look(drive.image)
    speed = 1024 * (2 * 19 - 3) + 704 * 16
    rest = 91_000 + 16 * 19 * 19 + speed * 4 / 64 + speed**2 / (2 * 500_000)
    error = guard.danger(drive.image, FREE)
    assert isinstance(error, LimitError)
    assert float(error.observed.split("stop at ")[1].split(";")[0]) == pytest.approx(rest / 1000, abs=0.001)
    assert "the allowed range is 0 to 100" in error.observed


def test_a_demand_ahead_of_the_position_counts_if_it_belongs_to_this_motion():
    commanded = turning(1000)
    assert Bounded(1000).to(90_000, demand=3000).rest(commanded=commanded) == 100.2
    assert Bounded(1000).to(90_000, demand=2800).rest(commanded=commanded) is None
    # more than a quarter of a second ahead is no demand of this motion
    assert Bounded(1000).to(80_000, demand=16_000).rest(commanded=commanded) == 103.2
    assert Bounded(1000).to(80_000, demand=16_001).rest(commanded=commanded) is None
    assert Bounded(1000).to(92_000, demand=0).rest(commanded=commanded) is None


def test_a_drive_that_limits_jerk_may_begin_to_brake_again():
    axis = Bounded(1000).to(90_000)
    assert axis.guard.overrun(axis.drive.image, DOWN) is None
    assert axis.guard.overrun(axis.drive.image, DOWN, soft=2.0 * 2.8 * T) is None
    assert axis.guard.overrun(axis.drive.image, DOWN, soft=2.0 * 3.0 * T) == 100.2


def test_without_a_demand_the_lag_that_was_seen_last_counts():
    axis, commanded = Bounded(1000).to(90_000), turning(1000)
    assert axis.rest(commanded=commanded) is None
    assert axis.rest(commanded=commanded, lag=2.8 * T) is None
    assert axis.rest(commanded=commanded, lag=3.0 * T) == 100.2
    assert axis.guard.overrun(axis.drive.image, DOWN) == 100.2
    assert axis.rest(MOVE, commanded=commanded) is None
    assert axis.rest(commanded=commanded) == 100.2  # it is one of the drive
    # the motor of an axis that is pushed lags as much
    assert axis.rest(commanded=CommandedMotion(by_torque=True, down=DOWN), lag=9.0) == axis.rest(
        commanded=commanded, lag=9.0
    )
    assert axis.rest(commanded=commanded, lag=0.0) is None
    # a demand of this motion knows better
    assert Bounded(1000).to(90_000, demand=2800).rest(commanded=commanded, lag=3.0 * T) is None


def test_before_any_lag_was_seen_a_usual_one_counts():
    axis, commanded = Bounded(1000).to(100_000 - 8480), turning(1000)  # 1280 in 0.02 s
    assert axis.rest(commanded=commanded) is None
    axis.guard._lag = None
    assert axis.rest(commanded=commanded) is None
    assert axis.to(100_000 - 8479).rest(commanded=commanded) == 100.001


def test_without_a_demand_the_lag_is_measured_from_streamed_targets():
    axis, commanded = Bounded(1000), turning(1000)
    for number in range(1, 9):
        # 7 periods behind: the stop itself allows for 4 of them
        axis.drive.image.reference_tracker.note(axis.drive.now, 8, None, 1000 * (number + 7), False)
        axis.to(1000 * number, cycles=1).rest(commanded=commanded)
    assert axis.guard._lag == pytest.approx(3.0 * T)
    axis.drive.image.reference_tracker.note(axis.drive.now, 3, None, None, False)  # in pv there is no target
    assert axis.to(90_000).rest(commanded=commanded) == 100.2


def test_until_weaker_ramps_are_written_an_axis_speeds_up_by_those_that_it_has():
    axis = Bounded(1000).to(90_000)
    before = CommandedMotion(speed=100_000.0, up=DOWN, down=2 * DOWN, by_target=True)
    assert axis.guard.overrun(axis.drive.image, DOWN) is None
    # 100 000/s for nine periods, and 7812.5 to brake from them
    assert axis.guard.overrun(axis.drive.image, DOWN, before) == pytest.approx(111.875)
    # 64 000/s go on as long: 9000, and 3200 to brake
    assert axis.guard.overrun(axis.drive.image, DOWN, before._replace(up=0.0)) == pytest.approx(102.2)


@pytest.mark.parametrize("sign", [1, -1])
def test_until_weaker_ramps_are_written_an_axis_speeds_up_to_its_commanded_velocity(sign):
    axis = Bounded(sign * 1000).to(50_000 + sign * 40_000)
    before = CommandedMotion(speed=sign * 100_000.0, up=DOWN, down=2 * DOWN)
    outside = {1: 100.0, -1: 0.0}[sign]
    assert axis.guard.overrun(axis.drive.image, DOWN) is None
    assert axis.guard.overrun(axis.drive.image, DOWN, before) == pytest.approx(outside + sign * 11.875)
    # at the velocity that was commanded it keeps that: 4000 until a stop acts, and 3200 to brake
    for speed, at in ((64_000.0, 92_800), (1_000.0, 92_800)):
        reached = before._replace(speed=sign * speed)
        axis = Bounded(sign * 1000).to(50_000 + sign * (at - 50_000))
        assert axis.guard.overrun(axis.drive.image, DOWN, reached) is None
        axis.to(50_000 + sign * (at - 50_000 + 1))
        assert axis.guard.overrun(axis.drive.image, DOWN, reached) == pytest.approx(outside + sign * 0.001)
    axis = Bounded(sign * 1000).to(50_000 + sign * 40_000)
    back = before._replace(speed=-sign * 100_000.0)
    assert axis.guard.overrun(axis.drive.image, DOWN, back) == pytest.approx(outside + sign * 2.2)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("late", "found_at"), [(1, 90), (4, 86), (8, 81)])
def test_a_demand_received_seldom_gives_only_the_lag(sign, late, found_at):
    """The axis gets faster all the time, and its demand, which comes with every 8th position, is some cycles ahead of it."""
    axis, first = Bounded(0, ages={"position": 1.0, "demand": 1.0}), 0 if sign > 0 else 100_000
    commanded = CommandedMotion(speed=sign * 3000 / T, up=20 / T / T, down=DOWN)
    for cycle in range(110):
        demand = {} if cycle % 8 else {"demand": first + sign * 10 * (cycle + late) ** 2}
        axis.drive.cycle(statusword=0x0237, position=first + sign * 10 * cycle**2, **demand)
        axis.guard.look(axis.drive.image)
        if axis.rest(commanded=commanded) is not None:
            break
    assert cycle == found_at
    # The commanded position when the stop acts, four cycles later, and the stopping position from there, are just at the limit.
    led = cycle + 1 + late + 4
    assert 10 * led**2 + (20 * led / T) ** 2 / (2 * DOWN) == pytest.approx(100_000, rel=0.05)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("demands", [1, 2, 3])
def test_the_first_demands_received_seldom_give_the_lag_already(sign, demands):
    axis = Bounded(sign * 1000, ages={"position": 1.0, "demand": 9.0})
    found, place = None, 50_000 - sign * 50_000
    for cycle in range(100):
        demand = {"demand": place + sign * 5000} if cycle % 20 == 10 and cycle <= 20 * demands else {}
        axis.drive.cycle(statusword=0x0237, position=place, **demand)
        axis.guard.look(axis.drive.image)
        if axis.rest(commanded=turning(sign * 1000)) is not None:
            found = cycle
            break
        place += sign * 1000
    assert found is not None
    # Five cycles of lag besides the four until the stop acts, and the braking distance.
    assert 1000 * (found + 4 + 5) + (1000 / T) ** 2 / (2 * DOWN) == pytest.approx(100_000, abs=1500)


def test_a_demand_ahead_counts_for_the_braking_distance():
    axis = Bounded(1000).to(90_000, demand=3000)
    assert axis.guard.overrun(axis.drive.image, DOWN) == 100.2
    axis = Bounded(1000).to(90_000, demand=2800)
    assert axis.guard.overrun(axis.drive.image, DOWN) is None


def test_a_demand_received_just_now_is_not_used_yet():
    axis = Bounded(1000).to(80_000)
    for left in (2, 1):
        assert (
            axis.to(81_000 + 1000 * (2 - left), demand=15_000, cycles=1).rest(commanded=turning(1000)) is None
        )


def test_two_positions_are_too_few():
    assert Bounded(1000).to(99_900, cycles=2).rest(commanded=turning(1000)) is None
    assert Bounded(1000).to(99_900, cycles=3).rest(commanded=turning(1000)) is not None


def test_an_unknown_position_is_a_danger_if_position_limits_hold():
    for limits, bounded, told in (
        (LIMITS, True, True),
        (LIMITS, False, False),
        (AxisLimits(velocity=400.0), True, False),
    ):
        blind = Bounded(1000, limits=limits).to(50_000)
        blind.drive.cycle(position=None)
        blind.guard.look(blind.drive.image)
        error = blind.guard.danger(blind.drive.image, FREE, bounded=bounded)
        assert isinstance(error, StaleError) is told


# Velocity: 10 % more than the limit, and three increments in a cycle.


@pytest.mark.parametrize(("step", "told"), [(6877, False), (6879, True), (-6877, False), (-6879, True)])
def test_a_free_motion_more_than_a_tenth_too_fast_is_stopped(step, told):
    fast = Bounded(step, limits=AxisLimits(velocity=400.0)).to(0)
    error = fast.guard.danger(fast.drive.image, FREE, commanded=turning(step))
    assert (error is not None) is told
    assert not told or error.message == "x: faster than max_velocity"


@pytest.mark.parametrize(("count", "told"), [(191, False), (192, True)])
@pytest.mark.parametrize("sign", [1, -1])
def test_an_axis_that_is_pushed_is_stopped_before_it_is_too_fast(count, told, sign):
    """16 k²: 1024 (2 n - 3) + 11 264 per s by the time that a stop acts; 400 192 are allowed."""
    drive = Drive(limits=AxisLimits(velocity=400.0))
    guard = LimitMonitor(drive.parameters)
    for k in range(count - 8, count + 1):
        drive.cycle(statusword=0x0237, position=sign * 16 * k * k)
        guard.look(drive.image)
    error = guard.danger(drive.image, FREE, commanded=CommandedMotion(by_torque=True))
    assert (error is not None) is told
    assert not told or error.message == "x: about to be faster than max_velocity"
    braking = guard.danger(drive.image, FREE, commanded=CommandedMotion())
    assert braking is None


# Moves to a position.


def test_encoder_noise_does_not_look_like_a_speed_too_high_to_brake():
    """64 per cycle need 8389 increments to brake; 68, as ±2 make of it, 9470."""
    commanded = CommandedMotion(down=1000.0, by_target=True)
    drive = Drive(limits=LIMITS)
    guard = LimitMonitor(drive.parameters)
    end = 100_000 - 8700
    for number, noise in enumerate((0, 0, 0, -2, 2, -2, 2)):
        drive.cycle(statusword=0x0237, position=end + 64 * (number - 6) + noise)
        guard.look(drive.image)
    assert guard.danger(drive.image, MOVE, commanded=commanded) is None


def test_a_move_that_begins_too_fast_for_its_ramp_is_stopped():
    commanded = CommandedMotion(down=DOWN, by_target=True)
    # 64 000/s, less 85 for a position that wanders: 3191.5 to brake, less 20 and 2000 that it may be off
    assert Bounded(1000).to(98_828).rest(MOVE, commanded=commanded) is None
    assert Bounded(1000).to(98_829).rest(MOVE, commanded=commanded) == 100.0
    assert Bounded(-1000).to(1172).rest(MOVE, commanded=commanded) is None
    assert Bounded(-1000).to(1170).rest(MOVE, commanded=commanded) == pytest.approx(-0.0015, abs=1e-4)
    assert Bounded(1000).to(98_829).rest(MOVE, commanded=commanded, bounded=False) is None
    assert Bounded(1000).to(98_829).rest(MOVE) is None
    assert Bounded(1000).to(98_829).rest(MOVE, commanded=CommandedMotion(by_target=True)) is None
    assert Bounded(1000, position_window=21).to(98_829).rest(MOVE, commanded=commanded) is None
    assert Bounded(1000, position_window=19).to(98_829).rest(MOVE, commanded=commanded) == 100.0


def test_the_braking_distance_beyond_the_limits():
    over = Bounded(1000).to(93_000)
    assert over.guard.overrun(over.drive.image, DOWN) == 100.2
    assert Bounded(1000).to(92_000).guard.overrun(over.drive.image, DOWN) is None
    pushed = Bounded(1000).to(93_000)
    # a motor that is pushed is seized 20 ms later
    assert pushed.guard.overrun(pushed.drive.image, DOWN, CommandedMotion(by_torque=True)) == pytest.approx(
        101.48
    )
    assert Bounded(1000).to(93_000, cycles=2).guard.overrun(over.drive.image, DOWN) is None


# The braking stop.

QUICK = Braking(quick_stop=Ramp.QUICK, quick=2000.0)


@pytest.mark.parametrize(
    ("changes", "commanded", "expected"),
    [
        ({}, CommandedMotion(), (StopLevel.HALT, 500_000.0)),
        ({}, CommandedMotion(down=7.0), (StopLevel.HALT, 7.0)),
        ({"braking": Braking(halt=Ramp.QUICK, quick=9.0)}, CommandedMotion(down=7.0), (StopLevel.HALT, 9.0)),
        ({"braking": Braking(halt=Ramp.QUICK)}, CommandedMotion(down=7.0), (StopLevel.HALT, None)),
        ({"braking": Braking(halt=Ramp.LIMIT, quick=9.0)}, CommandedMotion(down=7.0), (StopLevel.HALT, 7.0)),
        (
            {"braking": replace(QUICK, halt=Ramp.COAST)},
            CommandedMotion(down=7.0),
            (StopLevel.QUICK_STOP, 2000.0),
        ),
        ({"braking": Braking(halt=Ramp.COAST)}, CommandedMotion(down=7.0), (StopLevel.HALT, None)),
        # the drive does not permit writing, or limits the value (60C6h)
        ({"fixed_ramps": ((0x6084, 40),)}, CommandedMotion(), (StopLevel.HALT, 40.0)),
        ({"fixed_ramps": ((0x6084, 0),)}, CommandedMotion(), (StopLevel.HALT, None)),
        ({"fixed_ramps": ((0x6084, None),)}, CommandedMotion(), (StopLevel.HALT, None)),
        ({}, CommandedMotion(unknown=True), (StopLevel.HALT, None)),
        ({"braking": Braking(most_down=5.0)}, CommandedMotion(down=7.0), (StopLevel.HALT, 5.0)),
        (
            {"braking": replace(QUICK, most_down=5.0)},
            CommandedMotion(by_torque=True),
            (StopLevel.QUICK_STOP, 5.0),
        ),
        (
            {"braking": Braking(halt=Ramp.COAST, most_down=5.0)},
            CommandedMotion(down=7.0),
            (StopLevel.HALT, None),
        ),
        ({"braking": QUICK}, CommandedMotion(down=7.0), (StopLevel.HALT, 7.0)),
        # a move to a target: the harder of both
        ({"braking": QUICK}, CommandedMotion(down=7.0, by_target=True), (StopLevel.QUICK_STOP, 2000.0)),
        ({"braking": QUICK}, CommandedMotion(down=2000.0, by_target=True), (StopLevel.HALT, 2000.0)),
        ({"braking": QUICK}, CommandedMotion(down=3000.0, by_target=True), (StopLevel.HALT, 3000.0)),
        (
            {"braking": Braking(quick_stop=Ramp.COAST, quick=2000.0)},
            CommandedMotion(down=7.0, by_target=True),
            (StopLevel.HALT, 7.0),
        ),
        (
            {"braking": replace(QUICK, quick=0.5), "defaults": Defaults()},
            CommandedMotion(by_target=True),
            (StopLevel.QUICK_STOP, 0.5),
        ),
        (
            {"braking": replace(QUICK, quick=None), "defaults": Defaults()},
            CommandedMotion(by_target=True),
            (StopLevel.HALT, None),
        ),
        # a torque: a halt would only let it go
        ({"braking": QUICK}, CommandedMotion(down=7.0, by_torque=True), (StopLevel.QUICK_STOP, 2000.0)),
        (
            {"braking": QUICK, "holds_load": HoldsLoad.BRAKE},
            CommandedMotion(down=7.0, by_torque=True),
            (StopLevel.HALT, 7.0),
        ),
        ({}, CommandedMotion(down=7.0, by_torque=True), (StopLevel.HALT, 7.0)),
    ],
)
def test_kind_and_deceleration_of_the_stop_that_brakes(changes, commanded, expected):
    assert stop_of(Drive(**changes).parameters, commanded) == expected


# Lag.


@pytest.mark.parametrize("begin", [0.0, 1000.0])
def test_the_highest_speed_of_the_last_half_to_whole_second(begin):
    peak = RecentPeak()
    seen = [
        peak.note(value, begin + now)
        for now, value in [
            (0.0, 5.0),
            (0.25, 9.0),
            (0.5, 2.0),
            (0.75, 1.0),
            (1.0, 1.0),
            (1.25, 0.0),
            (2.0, 0.5),
            (4.0, 0.25),
        ]
    ]
    assert seen == [5.0, 9.0, 9.0, 9.0, 2.0, 2.0, 0.5, 0.25]


def test_a_motion_that_begins_in_another_one_may_lag_as_that_did_for_up_to_a_second():
    drive = Drive()
    watch = FollowingErrorMonitor(drive.parameters)
    before, after = (SimpleNamespace(behind=0.0, commanded_speed=speed, mode=3) for speed in (1000.0, 0.0))

    def fails(activity, behind: float) -> bool:
        activity.behind = behind
        return watch.error(drive.cycle(statusword=0x0237, mode=3, position=0)[0], activity) is not None

    assert not fails(before, 0.0)
    assert [fails(after, 4250.0) for _ in range(30)] == [False] * 30
    assert any(fails(after, 4250.0) for _ in range(40))
    watch.forget()  # its power was off meanwhile
    assert [fails(after, 4250.0) for _ in range(2)] == [False, True]


def lag(behind: list[float], speed: float = 0.0, **changes) -> list[bool]:
    """Return in which cycles an axis that is so far behind is given up."""
    drive = Drive(**changes)
    watch = FollowingErrorMonitor(drive.parameters)
    activity = SimpleNamespace(behind=None, commanded_speed=speed, mode=3)
    told = []
    for number, way in enumerate(behind):
        activity.behind = way
        drive.cycle(statusword=0x0237, mode=3, position=number)
        told.append(watch.error(drive.image, activity) is not None)
    return told


@pytest.mark.parametrize(
    ("behind", "speed", "changes", "told"),
    [
        ([4000.0] * 4, 0.0, {}, [False] * 4),  # the window: 10 ms at 400 deg/s
        ([4001.0] * 3, 0.0, {}, [False, True, True]),  # two positions in a row
        ([-4001.0] * 2, 0.0, {}, [False, True]),
        ([4001.0, 0.0, 4001.0, 4001.0], 0.0, {}, [False, False, False, True]),
        ([4250.0] * 3, 1000.0, {}, [False] * 3),  # a quarter of a second at the commanded speed
        ([4251.0] * 2, 1000.0, {}, [False, True]),
        ([4001.0, 4001.0], 0.0, {"following_error": 1}, [False, False]),
        ([4002.0, 4002.0], 0.0, {"following_error": 1}, [False, True]),
        ([4002.0, 4002.0], 0.0, {"drive_following_error": 9}, [False, True]),  # no streamed positions
        ([4001.0] * 6, 0.0, {"drive_following_time": 4 * T}, [False] * 4 + [True, True]),
        (
            [4001.0, 4001.0, 0.0, 4001.0, 4001.0, 4001.0, 4001.0],
            0.0,
            {"drive_following_time": 3 * T},
            [False] * 6 + [True],
        ),
    ],
)
def test_an_axis_that_is_too_far_behind_is_given_up(behind, speed, changes, told):
    assert lag(behind, speed, **changes) == told


def test_only_positions_that_are_new_count_for_the_lag():
    drive = Drive()
    watch = FollowingErrorMonitor(drive.parameters)
    activity = SimpleNamespace(behind=5000.0, commanded_speed=0.0, mode=3)
    assert watch.error(drive.cycle(mode=3, position=0)[0], activity) is None
    for _ in range(5):
        assert watch.error(drive.cycle()[0], activity) is None
    drive.image.origin = -2000
    error = watch.error(drive.cycle(position=0)[0], activity)
    assert "at 2 deg it is 5 deg from its expected position; 4 are allowed" in error.observed
    other = SimpleNamespace(behind=5000.0, commanded_speed=0.0, mode=3)
    assert watch.error(drive.cycle(position=1)[0], other) is None  # another command restarts it
    assert watch.error(drive.cycle(position=2)[0], None) is None
    assert watch.error(drive.cycle(position=None)[0], other) is None


def test_an_old_position_counts_once_however_often_it_is_read():
    drive = Drive()
    watch = FollowingErrorMonitor(drive.parameters)
    activity = SimpleNamespace(behind=5000.0, commanded_speed=0.0, mode=3)
    drive.cycle(mode=3, position=0)
    for _ in range(4):
        assert watch.error(drive.cycle()[0], activity) is None
    assert watch.error(drive.cycle(position=0)[0], activity) is not None


def test_a_lost_position_is_not_used_for_the_following_error():
    drive = Drive()
    watch = FollowingErrorMonitor(drive.parameters)
    activity = SimpleNamespace(behind=5000.0, commanded_speed=0.0, mode=3)
    drive.cycle(mode=3, position=0)
    drive.cycle(position=None)
    assert watch.error(drive.image, activity) is None
    assert watch.error(drive.cycle(position=1)[0], activity) is None
    assert watch.error(drive.cycle(position=2)[0], activity) is not None


@pytest.mark.parametrize("every", [1, 5])
def test_a_lag_is_allowed_by_the_speed_of_the_last_second_for_any_position_interval(every):
    """By the cycle's clock: 64 cycles of 1/64 s, and the next position."""
    drive = Drive()
    watch = FollowingErrorMonitor(drive.parameters)
    activity = SimpleNamespace(behind=4100.0, commanded_speed=1000.0, mode=3)
    for number in range(100):
        fresh = {"position": number} if number % every == 0 else {}
        if watch.error(drive.cycle(mode=3, **fresh)[0], activity) is not None:
            break
        activity.commanded_speed = 0.0
    assert number == 65


def led(pairs: list[tuple[int, int | None]], mode: int = 1, shown: int | None = 1, **changes) -> list[bool]:
    """The same for a position mode: positions with the demand."""
    drive = Drive(**changes)
    watch = FollowingErrorMonitor(drive.parameters)
    activity = SimpleNamespace(behind=None, commanded_speed=0.0, mode=mode)
    told = []
    for position, demand in pairs:
        drive.cycle(statusword=0x0237, mode=shown, position=position, demand=demand)
        told.append(watch.error(drive.image, activity) is not None)
    return told


def test_in_a_position_mode_the_demand_is_the_reference():
    assert led([(0, 4000)] * 3) == [False] * 3
    assert led([(0, 4001)] * 3) == [False, True, True]
    assert led([(0, 9000)] * 3, shown=3) == [False] * 3  # the drive is not there yet
    assert led([(0, 9000)] * 3, mode=3, shown=3) == [False] * 3
    assert led([(0, 9000)] * 3, shown=6) == [False] * 3  # nor in another mode that goes by positions
    assert led([(0, 9000)] * 3, mode=3, shown=None) == [False] * 3
    assert led([(0, 4001)] * 2, drive_following_error=1) == [False, False]
    assert led([(0, 4002)] * 2, drive_following_error=1) == [False, True]
    # 64 per cycle are 4096 per s: 1024 more
    moving = [(64 * k, 64 * k + 5024) for k in range(8)]
    assert led(moving) == [False] + [False] * 7
    assert led([(a, b + 1) for a, b in moving])[2:] == [True] * 6


@pytest.mark.parametrize("between", [{"mode": 6}, {"demand": None}])
def test_a_gap_between_two_positions_restarts_the_count_of_the_following_error(between):
    drive = Drive()
    watch = FollowingErrorMonitor(drive.parameters)
    activity = SimpleNamespace(behind=None, commanded_speed=0.0, mode=1)
    told = []
    for changes in ({}, between, {}, {}):
        drive.cycle(statusword=0x0237, **({"mode": 1, "position": 0, "demand": 9000} | changes))
        told.append(watch.error(drive.image, activity) is not None)
    assert told == [False, False, False, True]


def test_commands_monitored_by_the_lag_behind_their_demand():
    drive = Drive()
    watch = FollowingErrorMonitor(drive.parameters)
    for behind, mode, used in ((None, 8, True), (None, 1, True), (None, 3, False), (0.0, 8, False)):
        activity = SimpleNamespace(behind=behind, commanded_speed=0.0, mode=mode)
        assert not watch.is_used_to(activity)
        watch.error(drive.cycle(statusword=0x0237, mode=mode, position=0)[0], activity)
        assert watch.is_used_to(activity) is used


@pytest.mark.parametrize(("behind", "gives_up"), [(5024, False), (5025, True), (-5024, False), (-5025, True)])
def test_a_demand_slower_than_the_position_has_the_velocity_of_its_own_stamps(behind, gives_up):
    """4096 increments per s excuse 1024 beyond the window of 4000, as of the time of the demand, however old it is by now."""
    drive = Drive()
    watch = FollowingErrorMonitor(drive.parameters)
    activity = SimpleNamespace(behind=None, commanded_speed=0.0, mode=1, commanded=None)
    told = []
    for number in range(12):
        fresh = {"demand": 64 * number} if number % 3 == 0 else {}
        place = 64 * number - (behind if number >= 6 else 0)
        drive.cycle(statusword=0x0237, mode=1, position=place, **fresh)
        told.append(watch.error(drive.image, activity) is not None)
    assert any(told) is gives_up


@pytest.mark.parametrize(
    ("bits", "told"),
    [
        ("0011111", [False] * 6 + [True]),  # for the time of 6066h, too: some drives set the bit before
        ("0011011", [False] * 7),
        ("1111111", [False] * 7),  # it was set for another motion, or is always set
    ],
)
def test_without_a_demand_bit_13_reports_a_following_error(bits, told):
    drive = Drive(drive_following_error=500, drive_following_time=4 * T)
    watch = FollowingErrorMonitor(drive.parameters)
    activity = SimpleNamespace(behind=None, commanded_speed=0.0, mode=1, commanded=None)
    words = [0x0237 | (0x2000 if bit == "1" else 0) for bit in bits]
    seen = [
        watch.error(drive.cycle(statusword=word, mode=1, position=0)[0], activity) is not None
        for word in words
    ]
    assert seen == told


def targets(*, closely: bool = False) -> tuple[Drive, FollowingErrorMonitor, SimpleNamespace]:
    """An axis in csp that is commanded by 64 increments in each of seven cycles, after some at standstill, and has arrived."""
    drive = Drive()
    watch = FollowingErrorMonitor(drive.parameters)
    activity = SimpleNamespace(behind=None, commanded_speed=0.0, mode=8)
    for number in range(-4, 8):
        target = 64 * max(0, number)
        drive.cycle(statusword=0x0237, mode=8, position=target)
        drive.image.reference_tracker.note(drive.now, 8, None, target, False)
        if closely and number > -4:
            watch.close(target, drive.now)
        else:
            assert watch.error(drive.image, activity) is None
    return drive, watch, activity


@pytest.mark.parametrize("closely", [False, True])
@pytest.mark.parametrize(("lag", "told"), [(5024, [False] * 3), (5025, [False, True, True])])
def test_a_target_that_is_only_noted_as_near_counts_for_the_lag_as_any_other(closely, lag, told):
    """4096 increments per s excuse 1024 beyond the window of 4000."""
    drive, watch, activity = targets(closely=closely)
    seen = [watch.error(drive.cycle(position=64 * 7 - lag)[0], activity) is not None for _ in told]
    assert seen == told


def test_with_streamed_targets_an_old_demand_allows_no_lag():
    drive, watch, activity = targets()
    drive.image.demand, drive.image.demand_stamp = 0, 0.0
    seen = []
    for _ in range(2):
        drive.cycle(position=64 * 7 - 5025)
        drive.image.demand, drive.image.demand_stamp = 64 * 7, 0.0
        seen.append(watch.error(drive.image, activity) is not None)
    assert seen == [False, True]
