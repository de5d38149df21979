"""Position limits in every kind of motion: back from beyond them, never farther out, braked hard enough, and the end of a count."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from axisbus.errors import AxisbusError, LimitError, MotionTimeout
from axisbus.motion.moves.profile import braking_distance
from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed, Start
from axisbus.motion.parameters import AxisLimits, Defaults, HomingParameters
from axisbus.motion.pathclock import PathClock
from axisbus.motion.position_limits import (
    PositionRange,
    allowed_end,
    braking,
    count_range,
    narrowed,
    path_range,
    rest_position,
    steps_to_rest,
    widened,
)
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.motor import MotorParams
from kit.motion.plant_recorder import HALT, Watch
from kit.motion.rig import GENERIC, PERIOD, rig

LIMITS = (0.0, 60.0)
NOISE = MotorParams(noise=2.0)  # ±2 increments, of 1000 in a degree
SLACK = 0.006  # deg: noise and rounding of a position
MODULE = GENERIC.with_name("gim6010-8.eds")  # without a profile jerk


# The arithmetic.

places = st.floats(-100.0, 100.0)
windows = st.floats(0.0, 1.0)


@given(places, places)
def test_a_motion_ends_within_the_limits_or_no_farther_out_than_it_began(start, end):
    found = allowed_end(LIMITS, start, end)
    if LIMITS[0] <= end <= LIMITS[1] or start <= end < LIMITS[0] or LIMITS[1] < end <= start:
        assert found == end
    else:
        assert found is None


@given(places, windows, windows)
def test_an_end_beyond_the_limit_by_no_more_than_the_window_becomes_the_limit(start, window, beyond):
    assume(LIMITS[0] <= start <= LIMITS[1])
    for limit, end in ((LIMITS[0], LIMITS[0] - beyond), (LIMITS[1], LIMITS[1] + beyond)):
        inside = LIMITS[0] <= end <= LIMITS[1]
        near = LIMITS[0] - window <= end <= LIMITS[1] + window
        assert allowed_end(LIMITS, start, end, window) == (end if inside else limit if near else None)


@given(places, st.lists(places, max_size=8), windows)
def test_a_room_that_follows_a_motion_never_becomes_wider_and_never_smaller_than_its_limits(
    start, way, window
):
    room = widened(LIMITS, start, 0.0)
    for position in way:
        after = narrowed(room, LIMITS, position, window)
        assert after.low >= room.low
        assert after.high <= room.high
        assert after.low <= LIMITS[0]
        assert after.high >= LIMITS[1]
        assert after.low >= min(LIMITS[0], position) - window or after.low == room.low
        room = after


@given(st.floats(0.0, 60.0), st.floats(-200.0, 200.0), st.floats(10.0, 500.0), st.floats(0.0, 5000.0))
def test_a_brake_is_no_harder_than_its_room_needs_and_than_it_may_be(position, velocity, usual, more):
    room, hardest = PositionRange(*LIMITS), usual + more
    found = braking(room, position, velocity, usual, hardest, PERIOD)
    assert usual <= found <= hardest
    stop = steps_to_rest(position, velocity, found, PERIOD)[-1]
    if found < hardest:
        assert room.low - 1e-6 <= stop <= room.high + 1e-6
    if usual < found < hardest:
        assert min(abs(stop - room.low), abs(stop - room.high)) < 1e-6  # it needs all of it


@given(st.floats(-200.0, 200.0), st.floats(10.0, 5000.0))
def test_the_velocity_of_a_brake_falls_by_its_deceleration_in_each_cycle(velocity, deceleration):
    places = steps_to_rest(5.0, velocity, deceleration, PERIOD)
    speeds = [velocity, *((b - a) / PERIOD for a, b in pairwise(places))]
    falls = [(a - b) / PERIOD for a, b in pairwise(speeds)]
    assert speeds[-1] == 0.0
    assert all(fall == pytest.approx(math.copysign(deceleration, velocity), abs=1e-6) for fall in falls[:-1])
    assert abs(falls[-1]) <= deceleration + 1e-6


def test_a_path_that_begins_at_a_limit_may_return_to_it():
    assert path_range(LIMITS, 30.0, 0.004, 0.001) == LIMITS
    assert path_range(LIMITS, -0.002, 0.004, 0.001) == pytest.approx((-0.003, 60.001))
    assert path_range(LIMITS, -0.005, 0.004, 0.001) == LIMITS


@pytest.mark.parametrize("lap", [0, 1, -3])
def test_the_range_of_the_count_ends_just_before_the_wrap_of_the_drive(lap):
    room, low, high = count_range(lap * 2**32 + 17), lap * 2**32 - 2**31, lap * 2**32 + 2**31 - 1
    assert room == (low + 10, high - 10)
    assert count_range(int(room.low)) == count_range(int(room.high)) == room
    # An axis that is nearer to an end may stay there, and return.
    assert count_range(low + 3) == (low + 3, room.high)
    assert count_range(high) == (room.low, high)
    assert count_range(high + 1) == (high + 1, room.high + 2**32)


# Back into the limits, from a position that wanders at a limit, and from beyond it.


def bounded(names: str = "x", *, seed: int = 0, place: float | None = None, motor=NOISE, **changes):
    """An axis from 0 to 60 deg at ``place``, with a noisy encoder."""
    limits = AxisLimits(position=LIMITS, velocity=400.0, acceleration=2000.0)
    r = rig(names, motor=motor, limits=changes.pop("limits", limits), **changes).enabled()
    for number, device in enumerate(r.devices):
        device.drives[0]._feedback._random.seed(seed + number)
    for name, axis in r.axes.items():
        axis.home(37).wait(3)
        if place is not None and name == r.axis.name:
            axis.set_position(place).wait(2)
    return r


def out_of(r) -> float:
    """How far the motor is beyond a limit, in degrees."""
    here = r.drive.axis.motor.position / 1000.0 - r.core.image.origin / 1000.0
    return max(LIMITS[0] - here, here - LIMITS[1])


def inward(r) -> float:
    return 1.0 if r.axis.position < 30.0 else -1.0


def _follow(r, to):
    return r.axis.follow(TrapezoidalTrajectory(r.axis.position, to, 50.0, 300.0))


def _gear(r, speed):
    master = r.axes["y"]
    handle = r.axis.gear_in(master, 1.0)
    master.move_velocity(speed)
    return handle


WAYS = {
    "move_absolute": lambda r: r.axis.move_absolute(30.0),
    "move_relative": lambda r: r.axis.move_relative(inward(r) * 5.0),
    "move_additive": lambda r: r.axis.move_additive(inward(r) * 5.0),
    "blending": lambda r: r.axis.move_absolute(30.0, buffer="blending_low"),
    "blending, jerk": lambda r: r.axis.move_relative(inward(r) * 5.0, buffer="blending_low", jerk=20_000.0),
    "jerk": lambda r: r.axis.move_absolute(30.0, jerk=20_000.0),
    "move_velocity": lambda r: r.axis.move_velocity(inward(r) * 5.0),
    "velocity, jerk": lambda r: r.axis.move_velocity(inward(r) * 5.0, jerk=20_000.0),
    "jog": lambda r: r.axis.jog(inward(r) * 5.0),
    "csv": lambda r: r.axis.cyclic_velocity(inward(r) * 5.0),
    "torque": lambda r: r.axis.torque_control(inward(r) * 0.2, slope=10.0),
    "follow": lambda r: _follow(r, 30.0),
    "line": lambda r: r.group("x", "y").move_linear((30.0, 10.0), velocity=20.0),
    "path": lambda r: r.group("x", "y").move_path([(30.0, 10.0), (30.0, 20.0)], velocity=20.0),
    "direct": lambda r: r.group("x", "y").move_direct((30.0, 10.0)),
    "gear": lambda r: _gear(r, inward(r) * 5.0),
}
PLACES = (None, -0.002, -0.03, -5.0, 60.0, 60.002, 60.03, 65.0)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("way", WAYS)
def test_an_axis_moves_back_from_a_limit_and_from_beyond_it(way, place, seed):
    r = bounded("xy", seed=seed, place=place, each={"y": {"limits": AxisLimits(velocity=400.0)}})
    farthest = out_of(r)
    handle = WAYS[way](r)
    for _ in range(40):
        r.run(PERIOD)
        farthest = max(farthest, out_of(r)) if farthest > out_of(r) + 1.0 else farthest
        assert out_of(r) <= farthest + SLACK
        assert r.axis.state is not AxisState.ERRORSTOP
    if way != "torque":  # which takes its own time
        assert out_of(r) < max(farthest, 0.0) - 0.2
    assert handle.busy or handle.exception() is None


OUT = {
    "move_absolute": lambda r: r.axis.move_absolute(-inward(r) * 100.0),
    "move_relative": lambda r: r.axis.move_relative(-inward(r) * 1.0),
    "jerk": lambda r: r.axis.move_relative(-inward(r) * 1.0, jerk=20_000.0),
    "move_velocity": lambda r: r.axis.move_velocity(-inward(r) * 5.0),
    "velocity, jerk": lambda r: r.axis.move_velocity(-inward(r) * 5.0, jerk=20_000.0),
    "jog": lambda r: r.axis.jog(-inward(r) * 5.0),
    "csv": lambda r: r.axis.cyclic_velocity(-inward(r) * 5.0),
    "follow": lambda r: _follow(r, r.axis.position - inward(r)),
    "gear": lambda r: _gear(r, -inward(r) * 5.0),
    "line": lambda r: r.group("x", "y").move_linear((r.axis.position - inward(r), 10.0), velocity=20.0),
}


@pytest.mark.parametrize("place", [-5.0, -0.03, 60.03, 65.0])
@pytest.mark.parametrize("way", OUT)
def test_no_motion_takes_an_axis_beyond_a_limit_farther_out(way, place):
    r = bounded("xy", place=place, each={"y": {"limits": AxisLimits(velocity=400.0)}})
    begun = out_of(r)
    try:
        handle = OUT[way](r)
    except LimitError:
        handle = None
    for _ in range(60):
        r.run(PERIOD)
        assert out_of(r) <= begun + SLACK
    assert handle is None or handle.busy or isinstance(handle.exception(), AxisbusError)
    r.until(lambda: r.core.stop_sequence is None)
    if r.axis.state is AxisState.ERRORSTOP:
        r.axis.reset().wait(3)
        r.axis.enable().wait(3)
    r.axis.move_absolute(30.0).wait(5)


@pytest.mark.parametrize("place", [0.0, -0.002, 60.0, 60.002])
def test_an_arc_may_begin_at_a_limit_with_a_noisy_position(place):
    r = bounded("xy", place=place, each={"y": {"limits": AxisLimits(velocity=400.0)}})
    here, begun = (r.axis.commanded_position, r.axes["y"].commanded_position), out_of(r)
    centre, end = ((here[0] + inward(r) * way, here[1]) for way in (10.0, 20.0))
    arc = r.group("x", "y").move_circular(end, centre=centre, velocity=40.0, acceleration=300.0)
    while arc.busy:
        r.run(PERIOD)
        assert out_of(r) <= max(begun, 0.0) + SLACK
    assert arc.exception() is None


@pytest.mark.parametrize("place", [-5.0, 65.0])
def test_a_circle_does_not_begin_beyond_a_limit(place):
    r = bounded("xy", place=place, each={"y": {"limits": AxisLimits(velocity=400.0)}})
    with pytest.raises(LimitError, match="circle leaves"):
        r.group("x", "y").move_circular((30.0, 20.0), via=(30.0, 0.0), velocity=40.0)


def test_a_relative_move_from_beyond_a_limit_may_end_beyond_it_nearer_to_the_limit():
    r = bounded(place=-5.0)
    r.axis.move_relative(2.0).wait(5)
    assert r.axis.position == pytest.approx(-3.0, abs=0.06)
    for distance in (-1.0, 70.0):
        refused = r.axis.move_relative(distance)
        r.run(0.1)
        assert isinstance(refused.exception(), LimitError)
    r.axis.move_relative(10.0).wait(5)


@pytest.mark.parametrize("seed", range(4))
def test_relative_moves_over_the_whole_stroke_are_allowed_with_a_noisy_position(seed):
    r = bounded(seed=seed)
    for _ in range(3):
        for distance in (60.0, -60.0):
            r.axis.move_relative(distance).wait(5)
            assert out_of(r) <= 0.06  # the position window of its drive


class InAndOut:
    """In by 10 deg and out again."""

    duration = 4.0

    def position(self, t: float) -> float:
        return -5.0 + 5.0 * (1.0 - math.cos(math.tau * t / self.duration))


class KnownInAdvance(InAndOut):
    """The same, with all properties known in advance."""

    span = (-5.0, 5.0)
    top_speed = 10.0


@pytest.mark.parametrize("path", [InAndOut, KnownInAdvance])
def test_a_trajectory_that_enters_from_beyond_a_limit_does_not_leave_again(path):
    r = bounded(place=-5.0, motor=None)
    watch = Watch(r)
    handle = r.axis.follow(path())
    r.until(lambda: not handle.busy)
    assert isinstance(handle.exception(), LimitError)
    r.run(1.0)
    assert -0.01 <= r.drive.axis.motor.position / 1000.0 - r.core.image.origin / 1000.0 < 1.0
    assert watch.transitions == []  # it was braked along its path


def test_a_slave_axis_that_returned_from_beyond_a_limit_is_not_moved_out_again():
    r = bounded("xy", place=-5.0, motor=None, each={"y": {"limits": AxisLimits(velocity=400.0)}})
    handle = _gear(r, 10.0)
    r.until(lambda: r.axis.position > 2.0)
    r.axes["y"].move_velocity(-10.0)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP)
    r.run(1.0)
    assert not handle.busy
    assert isinstance(r.axis.error, LimitError)
    assert out_of(r) <= SLACK


# A stop brakes as hard as its room needs.


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.sampled_from(["halt", "stop", "disable"]),
    st.floats(0.0, 1.0),
    st.floats(20.0, 200.0),
    st.floats(1.0, 4.0),
    st.sampled_from([None, 30_000.0]),
    st.booleans(),
)
def test_the_stop_of_a_move_that_ends_at_its_limit_ends_within_the_limit(
    how, share, velocity, harder, jerk, limited
):
    """The move brakes harder than the axis does by default; the motor shows the stopping position and the deceleration."""
    own = 300.0 * harder
    limits = AxisLimits(position=(-1.0, 60.0), velocity=400.0, acceleration=own if limited else None)
    r = bounded(
        motor=None, limits=limits, defaults=Defaults(velocity=100.0, acceleration=300.0, deceleration=300.0)
    )
    handle = r.axis.move_absolute(
        60.0, velocity=velocity, acceleration=own, deceleration=own, jerk=jerk, buffer="blending_next"
    )
    begin = max(0.0, 60.0 - braking_distance(velocity, own) * 1.5)
    r.until(
        lambda: r.drive.axis.motor.position >= 1000.0 * (begin + share * (59.9 - begin)) or not handle.busy
    )
    watch = Watch(r)
    stop = getattr(r.axis, how)()
    r.until(lambda: not stop.busy)
    assert stop.exception() is None
    assert watch.travel[1] <= 60_001.5
    targets = watch.targets
    speeds = [(b - a) / PERIOD for a, b in pairwise(targets)]
    hardest = max((abs(b - a) / PERIOD for a, b in pairwise(speeds)), default=0.0) / 1000.0
    assert hardest <= 1.01 * own + 2.0 / 1000.0 / PERIOD**2  # the rounding of targets


@pytest.mark.parametrize("jerk", [None, 30_000.0])
@pytest.mark.parametrize("buffer", [False, "blending_low"])
def test_a_move_that_does_not_arrive_in_time_is_halted_whether_drive_or_master_controls_it(jerk, buffer):
    r = bounded(motor=None)
    watch = Watch(r)
    move = r.axis.move_absolute(
        50.0, velocity=20.0, acceleration=300.0, timeout=1.0, jerk=jerk, buffer=buffer
    )
    r.until(lambda: not move.busy)
    r.run(1.0)
    assert isinstance(move.exception(), MotionTimeout)
    assert r.axis.state is AxisState.ERRORSTOP
    assert watch.transitions == []
    assert "quick stop" not in r.axis.error.observed
    assert watch.speed < 21_000
    assert max(abs(b.velocity - a.velocity) for a, b in pairwise(watch.rows)) / PERIOD <= 520_000
    r.axis.reset().wait(3)
    r.axis.move_absolute(50.0).wait(5)


@pytest.mark.parametrize("buffer", ["blending_low", False])
@pytest.mark.parametrize("jerk", [None, 5_000.0])
def test_a_deadline_that_passes_during_a_halt_does_not_change_the_halt(jerk, buffer):
    defaults = Defaults(velocity=100.0, acceleration=100.0)
    without = frozenset(rig().core.parameters.objects - {0x60A4, 0x6086})
    r = bounded(motor=None, defaults=defaults, objects=without)
    move = r.axis.move_absolute(50.0, velocity=100.0, timeout=0.75, jerk=jerk, buffer=buffer)
    r.run(0.7)
    watch = Watch(r)
    halt = r.axis.halt()
    r.until(lambda: not halt.busy)
    assert halt.exception() is None
    assert move.exception() is not None
    led_by_master = r.core.image.mode == 8
    assert any(word & HALT for word in watch.words) is not led_by_master  # else it is braked along its path
    assert r.axis.state is AxisState.STANDSTILL


# The time of a path that is braked.


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    st.sampled_from([0.002, 0.004, 0.01, 0.025, 0.05]),
    st.floats(0.02, 1.0),
    st.floats(100.0, 3600.0),
    st.floats(0.1, 1.5),
)
def test_a_path_that_is_braked_is_no_harder_than_its_deceleration(period, after, ramp, rate):
    path = TrapezoidalTrajectory(0.0, 3000.0, 350.0, ramp)
    clock, seen = PathClock(), [0.0]
    while clock.t < after:
        clock.aim(rate, path.position, 3600.0)
        clock.advance(period)
        seen.append(path.position(clock.t))
    first = len(seen)
    clock.brake(path.position, 3600.0)
    while not clock.stopped and clock.t < path.duration:
        clock.advance(period)
        seen.append(path.position(clock.t))
    speeds = [(b - a) / period for a, b in pairwise(seen)]
    changes = [(b - a) / period for a, b in pairwise(speeds)]
    assert min(changes[first - 2 :]) >= -3600.0 * 1.001
    assert max(changes[first - 2 :]) <= ramp * 1.001


@given(st.floats(1.0, 300.0), st.floats(10.0, 3000.0), st.floats(-100.0, 100.0))
def test_the_computed_stop_is_the_end_of_the_braked_path(velocity, deceleration, position):
    stop = rest_position(position, velocity, deceleration)
    path = ProfileFromSpeed(Start(position, velocity), stop, velocity, deceleration, deceleration)
    assert path.position(path.duration + 1.0) == stop
    assert path.span[1] == pytest.approx(stop)


# The end of a drive's count.

TOP = 2**31


def at_the_top(names: str = "x", *, below: float = 20_000.0, **changes):
    """An axis near the end of INTEGER32, on a drive that continues with its other end."""
    r = rig(names, motor=MotorParams(start_position=TOP - below), **changes)
    for device in r.devices:
        device.write(0x607D, 1, 0)
        device.write(0x607D, 2, 0)
    return r.enabled()


TOO_FAR = {
    "move_relative": lambda r: r.axis.move_relative(30.0),
    "move_additive": lambda r: r.axis.move_additive(30.0),
    "jerk": lambda r: r.axis.move_relative(30.0, jerk=20_000.0, buffer="blending_low"),
    "velocity, jerk": lambda r: r.axis.move_velocity(20.0, jerk=20_000.0),
    "follow": lambda r: _follow(r, r.axis.position + 30.0),
    "follow, not known": lambda r: r.axis.follow(Unknown(r.axis.position)),
    "gear": lambda r: _gear(r, 20.0),
    "superimposed": lambda r: _superimposed(r),
}


class Unknown:
    """An endless motion of unknown distance."""

    duration = 10.0

    def __init__(self, start: float) -> None:
        self.start = start

    def position(self, t: float) -> float:
        return self.start + 30.0 * (1.0 - math.cos(0.5 * t))


def _superimposed(r):
    r.axis.follow(TrapezoidalTrajectory(r.axis.position, r.axis.position + 15.0, 5.0, 300.0))
    r.run(0.5)
    return r.axis.move_superimposed(20.0)


@pytest.mark.parametrize("origin", [False, True])
@pytest.mark.parametrize("way", TOO_FAR)
def test_no_target_of_an_axis_that_is_not_endless_wraps(way, origin):
    led = {"objects": frozenset(set(rig().core.parameters.objects) - {0x60A4, 0x6086})}
    r = at_the_top("xy", **led)
    for axis in r.axes.values():
        if origin:
            axis.set_position(0.0).wait(2)
    watch = Watch(r)
    try:
        handle = TOO_FAR[way](r)
    except LimitError:
        handle = None
    r.run(6.0)
    assert all(target > 0 for target in watch.targets)
    assert watch.travel[1] < TOP
    assert handle is None or isinstance(handle.exception() or r.axis.error, LimitError)
    r.run(1.0)
    if r.axis.state is AxisState.ERRORSTOP:
        assert "INTEGER32" in r.axis.error.message
        r.axis.reset().wait(3)
        r.axis.enable().wait(3)
    if r.axis.state is AxisState.STANDSTILL:
        r.axis.move_relative(-5.0).wait(5)


def test_an_absolute_target_that_its_origin_puts_beyond_the_count_is_refused():
    r = at_the_top()
    r.axis.set_position(0.0).wait(2)
    watch = Watch(r)
    refused = r.axis.move_absolute(30.0)
    r.run(1.0)
    assert isinstance(refused.exception(), LimitError)
    assert "INTEGER32" in refused.exception().message
    assert watch.targets == []
    r.axis.move_absolute(19.0).wait(5)


def test_an_endless_axis_continues_past_the_end_of_the_count():
    units = replace(rig().core.parameters.units, modulo=360.0)
    r = at_the_top(units=units)
    r.axis.move_relative(30.0).wait(5)
    assert r.drive.axis.motor.position == pytest.approx(TOP + 10_000, abs=60)


def test_a_velocity_of_the_drive_continues_past_the_end_of_the_count_and_its_moves_stay_there():
    r = at_the_top()
    r.axis.move_velocity(50.0).wait(5)
    r.until(lambda: r.drive.axis.motor.position > TOP + 10_000)
    r.axis.halt().wait(5)
    here = r.drive.axis.motor.position
    r.axis.move_relative(5.0).wait(5)
    assert r.drive.axis.motor.position == pytest.approx(here + 5_000, abs=60)
    refused = r.axis.move_relative(-60.0)
    r.run(0.1)
    assert isinstance(refused.exception(), LimitError)


@pytest.mark.parametrize("way", ["move_relative", "follow", "follow, not known", "line"])
def test_position_limits_farther_away_do_not_hide_the_end_of_the_count(way):
    ways = TOO_FAR | {"line": lambda r: r.group("x").move_linear((30.0,), velocity=20.0)}
    r = at_the_top(limits=AxisLimits(position=(-1000.0, 1000.0), velocity=400.0, acceleration=2000.0))
    r.axis.set_position(0.0).wait(2)
    watch = Watch(r)
    handle = ways[way](r)
    r.run(6.0)
    assert isinstance(handle.exception(), LimitError)
    assert all(target > 0 for target in watch.targets)
    assert watch.transitions == []


@pytest.mark.parametrize("start", [59.5, 90.0])  # it would leave the limits, or is beyond them
@pytest.mark.parametrize("buffer", [False, "blending_low"])
@pytest.mark.parametrize("jerk", [None, 5_000.0])
@pytest.mark.parametrize("file", [GENERIC, MODULE], ids=["drive limits the jerk", "master limits the jerk"])
def test_before_the_homing_that_an_axis_needs_no_kind_of_move_is_bound_by_the_limits(
    file, jerk, buffer, start
):
    homing = HomingParameters(method=37, required=True)
    motor = MotorParams(start_position=1_000 * start)
    r = rig(file=file, motor=motor, homing=homing, limits=AxisLimits(position=LIMITS)).enabled()
    r.axis.move_relative(2.0, jerk=jerk, buffer=buffer).wait(5)
    assert r.drive.axis.motor.position == pytest.approx(1_000 * (start + 2.0), abs=50)
