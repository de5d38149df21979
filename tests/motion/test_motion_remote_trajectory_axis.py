"""An axis on a streamed trajectory: as on the trajectory itself, and braked along it if samples are late."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import accumulate

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from axisbus.errors import ArgumentError, CommandError, Replaced, Stopped
from axisbus.motion.parameters import AxisLimits, Defaults, StopTimes
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import SampledTrajectory, TrapezoidalTrajectory
from kit.motion.plant_recorder import Watch
from kit.motion.rig import PERIOD, rig
from kit.motion.sample_wire import NEVER, Wire


@dataclass(frozen=True)
class Waves:
    """Sums of sines, swelling from rest and back to it: a path of a program's own."""

    duration: float
    waves: tuple[tuple[float, float], ...] = ((20.0, 3.0), (4.0, 9.0))
    speed: float = 1.0

    def position(self, t: float) -> float:
        swell = math.sin(math.pi * t / self.duration) ** 2
        return swell * sum(way * math.sin(rate * t * self.speed) for way, rate in self.waves)


class Own:
    """A known one, without properties in advance."""

    def __init__(self, path: TrapezoidalTrajectory | SampledTrajectory) -> None:
        self.path = path
        self.duration = path.duration

    def position(self, t: float) -> float:
        return self.path.position(t)


PATHS = {
    "trapezoid": TrapezoidalTrajectory(0.0, 300.0, 100.0, 500.0),
    "short trapezoid": TrapezoidalTrajectory(0.0, -1.2345, 100.0, 500.0),
    "sampled": SampledTrajectory([0.0, 0.0, 1.0, 3.0, 6.0, 9.0, 11.0, 12.0, 12.0, 9.0, 6.0, 6.0], 0.137),
    "own": Waves(4.0),
    "own trapezoid": Own(TrapezoidalTrajectory(0.0, 200.0, 87.0, 500.0)),
    "nowhere": TrapezoidalTrajectory(0.0, 0.0, 100.0, 500.0),
}
each_path = pytest.mark.parametrize("path", PATHS.values(), ids=list(PATHS))


def nothing(r, _cycle: int) -> None:
    """Let it continue."""


def blocked(r, cycle: int) -> None:
    """A cycle that takes three and a half periods, now and then."""
    if cycle % 23 == 17:
        r.cycle.dials.send_blocks = 0.036


def asked(when: int, what: str, *values):
    def ask(r, cycle: int) -> None:
        if cycle == when:
            getattr(r.axis, what)(*values)

    return ask


MISHAPS = {
    "nothing": nothing,
    "late cycles": blocked,
    "halt": asked(120, "halt"),
    "stop": asked(64, "stop"),
    "quick stop": asked(100, "quick_stop"),
    "disable": asked(80, "disable"),
    "another move": asked(90, "move_absolute", 42.0),
    "turning": asked(90, "move_velocity", 20.0),
}


def sent(r, mishap, follow, cycles: int = 520) -> tuple[list, list[float], AxisState]:
    """The outputs to the drive in each cycle, and its positions."""
    watch = Watch(r)
    handle = follow()
    for cycle in range(cycles):
        mishap(r, cycle)
        r.run(PERIOD * 0.5)
    assert not handle.busy
    outputs = [(item.outputs.controlword, item.outputs.target_position) for item in watch.sent]
    return outputs, [row.position for row in watch.rows], r.axis.state


def hardest(path) -> float:
    """The highest acceleration from cycle to cycle, in increments per s²."""
    cycles = range(-1, int(path.duration / PERIOD) + 3)
    places = [path.position(min(max(cycle * PERIOD, 0.0), path.duration)) for cycle in cycles]
    return (
        max(abs(a - 2 * b + c) for a, b, c in zip(places, places[1:], places[2:], strict=False))
        / PERIOD**2
        * 1000
    )


def late_at(moment: float):
    """Requests after that time are not answered."""
    return lambda t: NEVER if t >= moment else 0.0


def must_lie_on(path, watch: Watch, until: float, tolerance: float = 5.0) -> None:
    """All targets lie on the path, in its order, no farther than it was known."""
    t, step = 0.0, PERIOD / 50
    for target in watch.targets:
        while t <= until and abs(path.position(t) * 1000 - target) > tolerance:
            t += step
        assert t <= until + step, f"{target} is not on the path, or not where it comes next"


# As the trajectory itself.


@each_path
@pytest.mark.parametrize("mishap", list(MISHAPS))
@pytest.mark.parametrize("late", [0.0, 0.3])
def test_a_streamed_trajectory_gives_the_same_targets_in_each_cycle(path, mishap, late):
    direct = rig().enabled()
    there = sent(direct, MISHAPS[mishap], lambda: direct.axis.follow(path))
    streamed = rig().enabled()
    here = sent(streamed, MISHAPS[mishap], Wire(streamed, path, first=1.6, delay=lambda _: late).follow)
    assert here == there


RANDOM = st.one_of(
    st.builds(
        TrapezoidalTrajectory,
        st.just(0.0),
        st.floats(-200.0, 200.0),
        st.floats(5.0, 200.0),
        st.floats(50.0, 2000.0),
    ),
    st.builds(
        Waves, st.floats(1.0, 4.0), st.lists(st.tuples(st.floats(1.0, 30.0), st.floats(0.3, 6.0))).map(tuple)
    ),
    st.builds(
        lambda ways, step: SampledTrajectory((0.0, 0.0, *accumulate(ways)), step),
        st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=20),
        st.floats(0.05, 0.3),
    ),
)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    RANDOM,
    st.sampled_from([0.0, 0.1, 0.5]),
    st.sampled_from(["halt", "stop", "disable"]),
    st.integers(5, 300),
    st.booleans(),
)
def test_up_to_a_stop_they_are_the_same_and_then_as_near_as_its_corners_are_sharp(
    path, late, what, when, blocks
):
    def mishap(r, cycle: int) -> None:
        if blocks:
            blocked(r, cycle)
        asked(when, what)(r, cycle)

    limits = AxisLimits(velocity=2000.0)
    direct = rig(limits=limits).enabled()
    there = sent(direct, mishap, lambda: direct.axis.follow(path), 900)
    streamed = rig(limits=limits).enabled()
    here = sent(streamed, mishap, Wire(streamed, path, delay=lambda t: late if t else 0.0).follow, 900)
    assert here[0][: when - 1] == there[0][: when - 1]
    assert here[2] is there[2]
    corner = hardest(path) * PERIOD**2 if path.duration > 3 * PERIOD else 1.0
    both = [(a, b) for (_, a), (_, b) in zip(here[0], there[0], strict=False) if None not in (a, b)]
    assert max(abs(a - b) for a, b in both) <= 2 + corner
    counts = [sum(target is not None for _, target in outputs) for outputs in (here[0], there[0])]
    assert abs(counts[0] - counts[1]) <= 1  # a stop of one may be seen a cycle earlier, by an increment


def test_limits_refuse_a_streamed_path_as_they_refuse_a_direct_one():
    """Those of position, looked at ahead; of velocity and acceleration; and of a path that jumps."""
    jump = SampledTrajectory([0.0, 0.0, 50.0, 50.0], PERIOD)
    for limits, path in (
        (
            AxisLimits(position=(-10.0, 10.0), velocity=400.0),
            Own(TrapezoidalTrajectory(0.0, 20.0, 50.0, 500.0)),
        ),
        (
            AxisLimits(position=(-10.0, 10.0), velocity=400.0),
            Own(TrapezoidalTrajectory(0.0, -20.0, 400.0, 500.0)),
        ),
        (
            AxisLimits(position=(-10.0, 10.0), velocity=400.0),
            Own(TrapezoidalTrajectory(0.0, 10.0, 100.0, 2000.0)),
        ),
        (AxisLimits(velocity=80.0), Own(TrapezoidalTrajectory(0.0, 90.0, 100.0, 500.0))),
        (AxisLimits(velocity=80.0), Own(jump)),
        (AxisLimits(acceleration=400.0), Own(TrapezoidalTrajectory(0.0, 90.0, 100.0, 500.0))),
        (AxisLimits(), TrapezoidalTrajectory(0.0, 50.0, 100.0, 3000.0)),  # which names its own acceleration
    ):
        ends = []
        for streams in (False, True):
            r = rig(limits=limits).enabled()
            watch = Watch(r)
            handle = Wire(r, path).follow() if streams else r.axis.follow(path)
            r.until(lambda: not handle.busy and r.core.stop_sequence is None)  # noqa: B023
            error = handle.exception()
            ends.append(
                (r.drive.position, watch.targets, error and (error.message, error.observed, error.remedy))
            )
        (place, targets, told), (streamed_place, streamed, streamed_told) = ends
        assert streamed_place == pytest.approx(place, abs=5)
        assert len(streamed) == len(targets)
        assert all(abs(a - b) <= 12 for a, b in zip(targets, streamed, strict=True))
        assert streamed_told == told


TEN = AxisLimits(position=(-10.0, 10.0), velocity=400.0)


@pytest.mark.parametrize("when", range(100, 112))
def test_a_corner_at_the_limit_is_not_rounded_beyond_it(when):
    """Where the axis is braked over it, between the samples."""
    r = rig(limits=TEN, defaults=Defaults(velocity=100.0, acceleration=20.0)).enabled()
    watch = Watch(r)
    path = SampledTrajectory([0.0, 0.0, 10.0, 8.0, 8.0], 1.0)
    handle = Wire(r, path).follow()
    r.until(lambda: watch.targets and watch.targets[-1] >= 9_000 + (when - 100) * 70)
    r.axis.halt().wait(5)
    assert isinstance(handle.exception(), Stopped)
    assert r.axis.state is AxisState.STANDSTILL
    assert max(watch.targets) <= 10_000
    must_lie_on(path, watch, path.duration, tolerance=hardest(path) * PERIOD**2)


# Late samples.


LONG = TrapezoidalTrajectory(0.0, 700.0, 100.0, 500.0)


@pytest.mark.parametrize("moment", [0.01, 0.2, 1.0])
@pytest.mark.parametrize(
    "path", [LONG, Waves(6.0), Waves(6.0, speed=1.7)], ids=["trapezoid", "own", "harder"]
)
def test_an_axis_whose_program_sends_nothing_more_is_braked_along_the_known_part(path, moment):
    r = rig(limits=AxisLimits(velocity=1000.0)).enabled()
    watch = Watch(r)
    wire = Wire(r, path, delay=late_at(moment))
    handle = wire.follow()
    r.until(lambda: not handle.busy)
    error = handle.exception()
    assert isinstance(error, CommandError)
    r.until(lambda: r.core.stop_sequence is None)
    assert r.axis.state is AxisState.ERRORSTOP
    assert watch.transitions == []  # along the path: no quick stop
    assert watch.acceleration() <= max(500_000, hardest(path)) * 1.1
    assert abs(r.drive.axis.motor.velocity) < 1.0
    must_lie_on(path, watch, wire.stream.known_until)
    r.axis.reset().wait(1)
    r.axis.move_absolute(0.0).wait(10)


def test_the_error_of_a_silent_program_gives_the_known_part_of_the_trajectory():
    r = rig().enabled()
    wire = Wire(r, LONG, delay=late_at(0.01))
    handle = wire.follow()
    with pytest.raises(CommandError, match=r"^x: the program did not send its trajectory in time") as caught:
        handle.wait(10)
    assert "the axis is at 2.23" in caught.value.observed
    assert f"to {wire.stream.known_until:.3f} s of 7.200 s" in caught.value.observed
    assert "make position(t) faster" in caught.value.remedy
    assert caught.value.remedy.endswith("the axis was braked along it")


def test_a_stream_that_is_not_continued_is_braked_neither_too_early_nor_too_late():
    r = rig().enabled()
    wire = Wire(r, LONG, delay=late_at(0.1))
    handle = wire.follow()
    r.until(lambda: not handle.busy)
    left = wire.stream.known_until - wire.stream.reached
    assert 100.0 / 500.0 <= left <= 100.0 / 500.0 + 7 * PERIOD


def test_an_axis_does_not_begin_before_enough_is_known_and_not_at_all_if_it_never_is():
    r = rig().enabled()
    watch = Watch(r)
    handle = Wire(r, PATHS["trapezoid"], first=0.1, delay=lambda _: 0.7).follow()
    r.run(0.6)
    assert watch.displacement < 1
    handle.wait(10)
    assert r.drive.position == 300_000
    never = rig().enabled()
    watch = Watch(never)
    handle = Wire(never, PATHS["trapezoid"], first=0.1, delay=late_at(0.0)).follow()
    with pytest.raises(CommandError, match="in time") as caught:
        handle.wait(10)
    assert "it has not begun, known of it are 0.000 to 0.080 s" in caught.value.observed
    assert caught.value.remedy.endswith("nothing has moved")
    never.run(0.5)
    assert watch.displacement < 1
    assert watch.transitions == []


def test_a_slow_deceleration_requires_the_path_as_far_ahead_as_braking_takes():
    """Five seconds from full speed: more than any program is given to be busy."""
    slow = Defaults(velocity=100.0, acceleration=500.0, deceleration=20.0)
    r = rig(defaults=slow, stop_times=StopTimes(halt=10.0)).enabled()
    watch = Watch(r)
    path = TrapezoidalTrajectory(0.0, 1500.0, 100.0, 500.0)
    wire = Wire(r, path, delay=late_at(4.0))
    handle = wire.follow()
    r.until(lambda: not handle.busy, 20)
    r.until(lambda: r.core.stop_sequence is None)
    assert isinstance(handle.exception(), CommandError)
    assert watch.acceleration() <= 500_000 * 1.05  # at its beginning
    must_lie_on(path, watch, wire.stream.known_until)


def test_without_a_known_deceleration_the_drive_stops_it_before_its_targets_end():
    r = rig(defaults=Defaults(velocity=100.0)).enabled()
    watch = Watch(r)
    wire = Wire(r, LONG, delay=late_at(0.5))
    handle = wire.follow()
    r.until(lambda: not handle.busy and r.core.stop_sequence is None)
    assert isinstance(handle.exception(), CommandError)
    assert handle.exception().remedy.endswith("the axis was stopped")
    assert 11 in watch.transitions
    assert abs(r.drive.axis.motor.velocity) < 1.0


class Fails(Waves):
    """From a moment on it raises."""

    def position(self, t: float) -> float:
        if t > 3.0:
            raise RuntimeError("no more")
        return super().position(t)


def test_an_exception_of_the_program_ends_the_command_and_brakes_the_axis_along_the_known_part():
    r = rig().enabled()
    watch = Watch(r)
    path = Fails(8.0)
    handle = Wire(r, path).follow()
    r.until(lambda: not handle.busy)
    with pytest.raises(ArgumentError, match=r"^x: the trajectory returned no position at 3.0\d0 s") as caught:
        handle.wait(1)
    assert isinstance(caught.value.__cause__, RuntimeError)
    r.until(lambda: r.core.stop_sequence is None)
    assert watch.displacement > 100
    assert watch.transitions == []
    must_lie_on(path, watch, 3.0)


def test_a_trajectory_that_is_broken_before_it_begins_moves_nothing():
    r = rig().enabled()
    watch = Watch(r)
    wire = Wire(r, PATHS["trapezoid"])
    error = ArgumentError("x: the trajectory returned no position")
    wire.stream.fail(error)
    wire.stream.fail(ArgumentError("another"))
    with pytest.raises(ArgumentError, match="returned no position"):
        wire.follow().wait(5)
    r.run(0.5)
    assert watch.displacement < 1


def test_samples_that_are_not_of_the_scan_s_period_are_refused():
    r = rig(scan_period=0.02).enabled()
    with pytest.raises(ArgumentError, match="do not match the scan"):
        Wire(r, PATHS["trapezoid"]).follow().wait(5)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    st.lists(st.tuples(st.floats(0.5, 40.0), st.floats(0.3, 8.0)), min_size=1, max_size=3),
    st.floats(50.0, 800.0),
    st.lists(st.sampled_from([0.0, 0.0, 0.02, 0.3, 1.0, 1.9, 3.0, NEVER]), min_size=1, max_size=6),
    st.sampled_from([None, None, "halt", "stop", "disable"]),
    st.integers(10, 500),
)
def test_whichever_samples_are_late_the_axis_stops_on_its_path(waves, deceleration, delays, what, when):
    path = Waves(5.0, tuple(waves))
    fastest = max(abs(path.position(t / 100 + 0.01) - path.position(t / 100)) for t in range(500)) / 0.01
    assume(
        fastest < 480.0
    )  # the motor turns no faster than 500 deg/s, and then jolts where the path slows down
    limits, defaults = AxisLimits(velocity=fastest + 1.0), Defaults(velocity=100.0, acceleration=deceleration)
    r = rig(limits=limits, defaults=defaults).enabled()
    watch = Watch(r)
    turns = iter(delays)
    wire = Wire(r, path, delay=lambda _: next(turns, 0.0))
    handle = wire.follow()
    for cycle in range(1400):
        if what is not None and cycle == when and handle.busy:
            getattr(r.axis, what)()
        r.run(PERIOD * 0.5)
    error = handle.exception()
    assert error is None or isinstance(error, (CommandError, Stopped))
    assert abs(r.drive.axis.motor.velocity) < 1.0
    assert watch.acceleration() <= max(deceleration * 1000, hardest(path)) * 1.1 + 20_000
    assert not {9, 11} & set(watch.transitions)
    must_lie_on(path, watch, wire.stream.known_until, tolerance=8.0)


# Another command takes over.


@pytest.mark.parametrize("mode_delay", [0.0, 0.1])
def test_a_command_takes_over_from_it_without_a_jolt(mode_delay):
    r = rig().enabled()
    handle = Wire(r, TrapezoidalTrajectory(0.0, 250.0, 100.0, 500.0)).follow()
    r.until(lambda: r.drive.position > 50_000)
    r.drive.dials.mode_delay = mode_delay
    watch = Watch(r)
    r.axis.move_velocity(100.0)
    r.run(0.3)
    assert isinstance(handle.exception(), Replaced)
    assert watch.acceleration() <= 500_000 * 1.6


def test_a_waiting_group_is_braked_along_the_known_part_too():
    """Its own move waits for the other axis, and it follows the trajectory until then."""
    r = rig("xy").enabled()
    r.axes["y"].follow(TrapezoidalTrajectory(0.0, 5.0, 100.0, 500.0)).wait(
        5
    )  # so that its mode has to change
    wire = Wire(r, LONG, delay=late_at(0.01))
    wire.follow()
    r.until(lambda: wire.stream.reached > 2.0)
    r.drive_of("y").dials.mode_delay = 0.8
    watch = Watch(r)
    handle = r.group("x", "y").move_direct((400.0, 20.0))
    r.until(lambda: not handle.busy)
    assert "did not send its trajectory in time" in str(handle.exception())
    r.until(lambda: all(core.stop_sequence is None for core in r.scan.axes.values()))
    assert watch.acceleration() <= 500_000 * 1.1
    assert watch.transitions == []
    assert watch.travel[1] <= LONG.position(wire.stream.known_until) * 1000


def test_the_other_axes_of_a_group_are_stopped_with_one_whose_program_stops_sending():
    r = rig("xy").enabled()
    first = Wire(r, LONG, delay=late_at(0.01)).follow()
    second = r.axes["y"].follow(TrapezoidalTrajectory(0.0, -400.0, 80.0, 500.0))
    r.until(lambda: not first.busy and not second.busy)
    assert isinstance(second.exception(), Stopped)
    r.until(lambda: all(core.stop_sequence is None for core in r.scan.axes.values()))
    assert all(abs(device.drives[0].axis.motor.velocity) < 1.0 for device in r.devices)
