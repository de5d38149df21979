"""Following a trajectory in cyclic synchronous position mode: one target per executed cycle, limits, braking, taking over."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import pytest

from axisbus.cia402.port import ValueTransport
from axisbus.errors import ArgumentError, DriveError, LimitError, MotionTimeout, Replaced, StateError, Stopped
from axisbus.motion.parameters import AxisLimits, Defaults, HomingParameters
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import SampledTrajectory, TrapezoidalTrajectory
from axisbus.sim.motor import MotorParams
from kit.motion.plant_recorder import Watch
from kit.motion.rig import BLIND, PERIOD, rig

STEP = 100.0 * PERIOD  # degrees per period at 100 deg/s


@dataclass(frozen=True)
class Sine:
    """Half a turn of a cosine: from rest to rest, twice ``amplitude`` degrees away."""

    amplitude: float
    duration: float

    def position(self, t: float) -> float:
        return self.amplitude * (1.0 - math.cos(math.pi * t / self.duration))


@dataclass(frozen=True)
class Own:
    """A trajectory of the user: its range and highest velocity are not known in advance."""

    path: TrapezoidalTrajectory | SampledTrajectory

    @property
    def duration(self) -> float:
        return self.path.duration

    def position(self, t: float) -> float:
        return self.path.position(t)


def targets(watch: Watch) -> list[float]:
    """The targets in degrees that were sent while the drive was in csp."""
    return [target / 1000 for target in watch.targets]


# The path.


def test_a_trapezoid_is_followed_to_its_end_in_its_own_time():
    r = rig().enabled()
    watch = Watch(r)
    r.axis.follow(TrapezoidalTrajectory(0.0, 90.0, 100.0, 500.0)).wait(5)
    r.run(0.1)
    begin, end = watch.moving()
    assert end - begin == pytest.approx(90 / 100 + 100 / 500, abs=0.03)
    assert r.drive.position == 90_000
    assert watch.speed <= 100_000 * 1.01
    assert watch.acceleration() <= 500_000 * 1.05
    assert r.axis.state is AxisState.STANDSTILL
    assert watch.modes[-1] == 8


def test_there_is_one_target_in_each_cycle_and_each_lies_on_the_path():
    r = rig().enabled()
    watch = Watch(r)
    path = Sine(30.0, 2.0)
    r.axis.follow(path).wait(5)
    moving = [(item.t, item.outputs.target_position) for item in watch.sent if item.outputs.target_position]
    first = next(number for number, (_, target) in enumerate(moving) if target)
    times = [t for t, _ in moving[first : first + 190]]
    assert all(b - a == pytest.approx(PERIOD) for a, b in pairwise(times))
    wanted = [round(path.position((number + 1) * PERIOD) * 1000) for number in range(190)]
    found = [target for _, target in moving[first : first + 190]]
    offset = wanted.index(found[0])
    assert found[: 190 - offset] == wanted[offset:]


def test_sampled_positions_are_joined_by_straight_lines():
    r = rig().enabled()
    watch = Watch(r)
    r.axis.follow(SampledTrajectory([0.0, 0.0, 1.0, 3.0, 4.0, 4.0], 0.05)).wait(3)
    r.run(0.1)
    assert r.drive.position == 4_000
    steps = {round((b - a) * 1000) for a, b in pairwise(targets(watch))}
    assert steps == {0, 200, 400}  # 1 degree in 50 ms is 0.2 per period, 2 degrees 0.4


def test_rows_are_followed_on_a_smooth_curve_and_functions_as_they_are():
    r = rig().enabled()
    seen = Watch(r, "x")
    r.axis.follow([(0.0, 0.0), (0.4, 20.0), (1.0, 0.0)]).wait(5)
    places = [row.position / 1000.0 for row in seen.rows]
    assert max(places) == pytest.approx(20.7, abs=0.1)  # a little beyond the point in the middle
    bends = [
        abs(a - 2.0 * b + c) / PERIOD**2 for a, b, c in zip(places, places[1:], places[2:], strict=False)
    ]
    assert max(bends) < 1000.0  # straight lines between them would be 8000 in their middle
    r.axis.follow(lambda t: 10.0 * math.sin(math.pi * t) ** 2, duration=1.0).wait(5)
    assert r.drive.position == pytest.approx(0, abs=2)
    with pytest.raises(LimitError, match="velocity"):
        r.axis.follow([(0.0, 0.0), (0.1, 50.0), (1.0, 0.0)])


def test_a_trajectory_counts_in_the_user_s_own_count():
    r = rig().enabled()
    r.axis.move_absolute(20.0).wait(5)
    r.run(0.2)
    r.axis.set_position(500.0).wait(1)
    r.axis.follow(TrapezoidalTrajectory(r.axis.position, 490.0, 50.0, 500.0)).wait(5)
    r.run(0.1)
    assert r.drive.position == pytest.approx(10_000, abs=60)
    assert r.axis.position == pytest.approx(490.0, abs=0.002)


def test_after_the_end_the_axis_is_held_and_moves_on_in_any_mode():
    r = rig().enabled()
    r.axis.follow(TrapezoidalTrajectory(0.0, 10.0, 100.0, 500.0)).wait(5)
    watch = Watch(r)
    r.run(1.0)
    assert watch.displacement < 60
    r.axis.move_additive(5.0).wait(5)  # from the trajectory's last target
    r.run(0.2)
    assert r.drive.position == 15_000
    r.axis.follow(TrapezoidalTrajectory(15.0, 0.0, 100.0, 500.0)).wait(5)
    r.run(0.1)
    assert r.drive.position == 0


# Before the first target.


def test_the_scan_period_and_offsets_are_written_and_read_back_before_the_mode_changes():
    r = rig().enabled()
    for index in (0x60B0, 0x60B1, 0x60B2):
        if index in r.core.parameters.objects:
            r.device.write(index, 0, 30)  # another tool's offset would be a jump
    watch = Watch(r)
    r.axis.follow(TrapezoidalTrajectory(0.0, 5.0, 50.0, 500.0)).wait(5)
    assert watch.writes[-2:] == [(0x60C2, 1, 10), (0x60C2, 2, -3)]  # 10 ms
    assert {(index, value) for index, _, value in watch.writes[:-2]} <= {
        (0x60B0, 0),
        (0x60B1, 0),
        (0x60B2, 0),
    }
    reads = [item.t for item in watch.sent for request in item.outputs.sdo if request.value is None]
    mode = next(item.t for item in watch.sent if item.outputs.mode == 8)
    assert len(reads) == 2
    assert max(reads) < mode
    assert r.device.read(0x60C2, 1) == 10


def test_a_drive_that_does_not_take_the_period_is_not_moved():
    r = rig().enabled()
    r.device.dials.sdo_write_aborts[0x60C2, 1] = 0x06090030
    watch = Watch(r)
    with pytest.raises(DriveError, match="interpolation time") as caught:
        r.axis.follow(TrapezoidalTrajectory(0.0, 5.0, 50.0, 500.0)).wait(5)
    assert "60C2h" in caught.value.observed
    assert "scan_period" in caught.value.remedy
    assert watch.displacement == 0.0
    assert 8 not in watch.modes


def test_a_drive_that_rounds_the_period_is_detected_by_reading_it_back():
    r = rig().enabled()
    r.device.write(0x60C2, 1, 4)
    write = r.device.write

    def deaf(index, subindex, value):
        if (index, subindex) != (0x60C2, 1):
            write(index, subindex, value)

    r.device.write = deaf
    watch = Watch(r)
    with pytest.raises(DriveError) as caught:
        r.axis.follow(TrapezoidalTrajectory(0.0, 5.0, 50.0, 500.0)).wait(5)
    assert "must be 10 x 10^-3 s and reads 4 x 10^-3 s" in caught.value.observed
    assert watch.displacement == 0.0


def test_a_trajectory_that_begins_elsewhere_is_refused_and_nothing_moves():
    r = rig().enabled()
    watch = Watch(r)
    with pytest.raises(LimitError, match="does not begin at the position of the axis") as caught:
        r.axis.follow(TrapezoidalTrajectory(1.0, 5.0, 50.0, 500.0)).wait(5)
    r.run(0.5)
    assert "begins at 1 deg, the axis is at 0 deg" in caught.value.observed
    assert watch.displacement < 1.0


@pytest.mark.parametrize("name", ["statusword", "position"])
def test_inputs_that_do_not_travel_with_sync_refuse_a_cyclic_mode(name):
    r = rig(port={"inputs": {name: ValueTransport.EVENT_PDO}, "event_timer": 0.05}).enabled()
    with pytest.raises(StateError, match="synchronous PDOs") as caught:
        r.axis.follow(TrapezoidalTrajectory(0.0, 5.0, 50.0, 500.0)).wait(2)
    assert f"{name} is transmitted by event-driven PDO" in caught.value.observed
    assert r.axis.state is AxisState.STANDSTILL


def test_a_target_by_sdo_refuses_a_cyclic_mode():
    r = rig(port={"outputs": {"target_position": ValueTransport.SDO}}).enabled()
    with pytest.raises(StateError, match="synchronous PDOs"):
        r.axis.follow(TrapezoidalTrajectory(0.0, 5.0, 50.0, 500.0)).wait(2)


def test_an_invalid_trajectory_raises_at_the_call():
    for wrong in (
        lambda: TrapezoidalTrajectory(0.0, 1.0, 0.0, 1.0),
        lambda: TrapezoidalTrajectory(0.0, math.nan, 1.0, 1.0),
        lambda: SampledTrajectory([1.0], 0.1),
        lambda: SampledTrajectory([0.0, math.inf], 0.1),
        lambda: SampledTrajectory([0.0, 1.0], 0.0),
        lambda: rig().axis.follow(Sine(1.0, math.nan)),
    ):
        with pytest.raises(ArgumentError):
            wrong()
    required = rig(homing=HomingParameters(method=37, required=True)).enabled()
    with pytest.raises(ArgumentError, match="not homed"):
        required.axis.follow(TrapezoidalTrajectory(0.0, 1.0, 1.0, 1.0))


def test_a_trajectory_during_a_motion_is_refused():
    r = rig().enabled()
    r.axis.move_velocity(10.0).wait(2)
    with pytest.raises(StateError, match="moves"):
        r.axis.follow(TrapezoidalTrajectory(0.0, 1.0, 1.0, 1.0)).wait(1)


# Time.


def test_late_cycles_make_the_axis_late_and_never_jump():
    r = rig().enabled()
    watch = Watch(r)
    handle = r.axis.follow(TrapezoidalTrajectory(0.0, 90.0, 100.0, 500.0))
    r.run(0.4)
    for _ in range(5):
        r.cycle.dials.send_blocks = 0.036  # more than three periods and a half
        r.run(0.1)
    handle.wait(5)
    r.run(0.1)
    assert r.scan.lateness.skipped >= 15
    steps = [abs(b - a) for a, b in pairwise(targets(watch))]
    assert max(steps) <= STEP * 1.001  # the distance of one period per executed cycle, however late it is
    begin, end = watch.moving()
    assert end - begin >= 1.1 + 15 * PERIOD
    assert r.drive.position == 90_000


def test_the_number_of_targets_is_the_number_of_executed_cycles():
    r = rig().enabled()
    watch = Watch(r)
    handle = r.axis.follow(TrapezoidalTrajectory(0.0, 90.0, 100.0, 500.0))
    r.run(0.5)
    r.cycle.dials.send_blocks = 0.055
    handle.wait(5)
    inner = [target for target in targets(watch) if 0.0 < target < 90.0]
    assert len(inner) == pytest.approx(1.1 / PERIOD, abs=2)
    assert len(set(inner)) == len(inner)


# Limits in each cycle.


@pytest.mark.parametrize(
    ("path", "told"),
    [
        (TrapezoidalTrajectory(0.0, 90.0, 100.0, 500.0), "velocity 100 deg/s is beyond the limit"),
        (TrapezoidalTrajectory(0.0, -11.0, 50.0, 500.0), "leaves the position limits"),
        (SampledTrajectory([0.0, 0.0, 5.0, 5.0], 0.06), "velocity 83.3333 deg/s is beyond the limit"),
        (SampledTrajectory([0.0, 4.0, 12.0, 0.0, 0.0], 0.5), "leaves the position limits"),
    ],
)
def test_a_trajectory_that_is_known_in_advance_is_refused_at_the_call(path, told):
    r = rig(
        limits=AxisLimits(position=(-10.0, 95.0 if "velocity" in told else 10.0), velocity=80.0)
    ).enabled()
    watch = Watch(r)
    with pytest.raises(LimitError, match=told):
        r.axis.follow(path)
    r.run(0.3)
    assert watch.modes == []
    assert r.axis.state is AxisState.STANDSTILL


def test_a_short_trapezoid_that_never_gets_fast_is_taken():
    r = rig(limits=AxisLimits(velocity=80.0)).enabled()
    r.axis.follow(TrapezoidalTrajectory(0.0, 10.0, 100.0, 500.0)).wait(5)  # 70.7 deg/s at most


def test_a_trajectory_faster_than_the_limit_is_braked_along_its_path():
    r = rig(limits=AxisLimits(velocity=80.0)).enabled()
    watch = Watch(r)
    with pytest.raises(LimitError, match="faster than max_velocity"):
        r.axis.follow(Own(TrapezoidalTrajectory(0.0, 90.0, 100.0, 500.0))).wait(5)
    r.until(lambda: r.core.stop_sequence is None)
    assert watch.speed <= 80_000 * 1.001
    assert watch.acceleration() <= 500_000 * 1.1
    assert watch.transitions == []
    assert r.axis.state is AxisState.ERRORSTOP
    assert abs(r.drive.axis.motor.velocity) < 1.0


def test_a_trajectory_that_jumps_never_reaches_the_drive():
    r = rig(limits=AxisLimits(velocity=400.0)).enabled()
    watch = Watch(r)
    with pytest.raises(LimitError, match="faster than max_velocity"):
        r.axis.follow(Own(SampledTrajectory([0.0, 0.0, 50.0, 50.0], PERIOD))).wait(5)
    r.run(0.5)
    assert watch.displacement < 100
    assert max(targets(watch)) < 0.1


class Kink:
    """At standstill, then at a velocity from one cycle to the next."""

    duration = 1.0

    def __init__(self, velocity: float) -> None:
        self.velocity = velocity

    def position(self, t: float) -> float:
        return self.velocity * max(0.0, t - 0.5)


@pytest.mark.parametrize("velocity", [20.0, -20.0])
def test_no_step_of_velocity_beyond_the_limit_of_acceleration_is_sent(velocity):
    r = rig(limits=AxisLimits(velocity=400.0, acceleration=1000.0)).enabled()
    watch = Watch(r)
    with pytest.raises(LimitError, match="harder than max_acceleration") as caught:
        r.axis.follow(Kink(velocity)).wait(5)
    assert "from 0 to" in caught.value.observed
    r.run(0.5)
    assert watch.displacement < 2
    r.axis.reset().wait(1)
    r.axis.follow(Kink(0.4 * velocity)).wait(5)  # 8 deg/s within 10 ms are 800 deg/s²


@pytest.mark.parametrize(
    "limits", [AxisLimits(), AxisLimits(acceleration=500.0)], ids=["no limits", "acceleration"]
)
def test_without_max_velocity_a_jump_is_detected_by_the_acceleration_of_the_axis(limits):
    r = rig(limits=limits).enabled()
    watch = Watch(r)
    with pytest.raises(LimitError, match="harder than"):
        r.axis.follow(Own(SampledTrajectory([0.0, 0.0, 50.0, 50.0], PERIOD))).wait(5)
    r.run(0.5)
    assert watch.displacement < 2
    r.axis.reset().wait(1)
    r.axis.follow(Own(TrapezoidalTrajectory(0.0, 50.0, 100.0, 500.0))).wait(5)
    assert r.drive.position == 50_000


def test_a_trapezoid_names_its_own_acceleration():
    r = rig(limits=AxisLimits()).enabled()
    r.axis.follow(TrapezoidalTrajectory(0.0, 50.0, 100.0, 3000.0)).wait(5)
    limited = rig(limits=AxisLimits(acceleration=1000.0)).enabled()
    with pytest.raises(LimitError, match="beyond the limit"):
        limited.axis.follow(TrapezoidalTrajectory(0.0, 50.0, 100.0, 1001.0))
    limited.axis.follow(TrapezoidalTrajectory(0.0, 50.0, 100.0, 1000.0)).wait(5)


def test_without_any_limit_that_detects_a_jump_a_path_of_the_program_is_refused():
    r = rig(limits=AxisLimits(), defaults=Defaults(velocity=100.0)).enabled()
    with pytest.raises(ArgumentError, match="max_velocity is missing"):
        r.axis.follow(Own(TrapezoidalTrajectory(0.0, 50.0, 100.0, 500.0)))


def test_a_jump_in_a_trajectory_ends_in_the_drive_s_quick_stop():
    """It cannot be braked along a path that jumps."""
    r = rig(limits=AxisLimits(velocity=400.0, acceleration=600.0)).enabled()
    r.device.write(0x6085, 0, 600_000)

    class Broken:
        duration = 2.0
        path = TrapezoidalTrajectory(0.0, 200.0, 100.0, 500.0)

        def position(self, t: float) -> float:
            return self.path.position(t) + (30.0 if t > 1.0 else 0.0)

    watch = Watch(r)
    handle = r.axis.follow(Broken())
    r.until(lambda: not handle.busy and r.core.stop_sequence is None)
    assert isinstance(handle.exception(), LimitError)
    assert watch.speed <= 100_500
    assert watch.acceleration() <= 600_000 * 1.2
    assert 11 in watch.transitions


# Position limits ahead.

TEN = AxisLimits(position=(-10.0, 10.0), velocity=400.0)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("path", "braked_at"),
    [
        (TrapezoidalTrajectory(0.0, 20.0, 50.0, 500.0), 10.0 - 50.0**2 / (2 * 500)),  # in its constant part
        (
            TrapezoidalTrajectory(0.0, 20.0, 400.0, 500.0),
            5.0,
        ),  # while it accelerates, as hard as it is braked: half the distance
    ],
)
def test_a_trajectory_that_would_leave_the_position_limits_is_braked_ahead_of_them(path, braked_at, sign):
    r = rig(limits=TEN).enabled()
    watch = Watch(r)
    turned = TrapezoidalTrajectory(0.0, sign * path.end, path.velocity, path.acceleration)
    handle = r.axis.follow(Own(turned))
    r.until(lambda: not handle.busy)
    failed = r.drive.position * sign / 1000
    speed = abs(r.drive.axis.motor.velocity) / 1000
    error = handle.exception()
    assert isinstance(error, LimitError)
    assert "leaves the position limits" in error.message
    assert "the allowed range is -10 to 10" in error.observed
    assert "deg/s, it would stop at" in error.observed
    assert failed == pytest.approx(braked_at, abs=2.5 * speed * PERIOD)
    r.until(lambda: r.core.stop_sequence is None)
    low, high = watch.travel
    assert max(-low, high) <= 10_001
    assert r.drive.position * sign >= 10_000 - 2.5 * speed * 1000 * PERIOD  # not too early either
    assert watch.transitions == []  # braked along its path: no quick stop
    assert watch.acceleration() <= 500_000 * 1.1
    assert r.axis.state is AxisState.ERRORSTOP
    assert abs(r.drive.axis.motor.velocity) < 1.0
    r.axis.reset().wait(1)
    r.axis.move_absolute(0.0).wait(5)


def test_a_trajectory_that_brakes_before_the_limit_is_allowed_at_any_deceleration():
    r = rig(limits=TEN, defaults=Defaults(velocity=100.0, acceleration=100.0)).enabled()
    r.axis.follow(Own(TrapezoidalTrajectory(0.0, 10.0, 100.0, 2000.0))).wait(5)
    assert r.drive.position == 10_000
    r.axis.follow(Own(TrapezoidalTrajectory(10.0, -10.0, 100.0, 2000.0))).wait(5)
    assert r.drive.position == -10_000


@pytest.mark.parametrize(("amplitude", "leaves"), [(5.0, False), (5.2, True), (-5.0, False), (-5.2, True)])
def test_a_path_that_turns_round_at_the_limit_is_distinguished_from_one_that_goes_beyond(amplitude, leaves):
    r = rig(limits=TEN, defaults=Defaults(velocity=100.0, acceleration=20.0)).enabled()
    watch = Watch(r)

    class There:
        """And back again: a full cosine, whose turning point is twice the amplitude away."""

        duration = 2.0

        def position(self, t: float) -> float:
            return amplitude * (1.0 - math.cos(math.pi * t))

    handle = r.axis.follow(There())
    r.until(lambda: not handle.busy and r.core.stop_sequence is None)
    assert isinstance(handle.exception(), LimitError) is leaves
    assert max(abs(end) for end in watch.travel) <= 10_001


def test_a_path_that_jumps_beyond_the_limit_leaves_the_axis_at_its_position():
    r = rig(limits=AxisLimits(position=(-10.0, 10.0))).enabled()
    watch = Watch(r)
    with pytest.raises(LimitError, match="leaves the position limits"):
        r.axis.follow(Own(SampledTrajectory([0.0, 0.0, 50.0, 50.0], PERIOD))).wait(5)
    r.run(0.5)
    assert watch.displacement < 100


def test_the_limits_count_in_the_user_s_own_count():
    r = rig(limits=AxisLimits(position=(490.0, 510.0))).enabled()
    r.axis.set_position(500.0).wait(1)
    watch = Watch(r)
    handle = r.axis.follow(Own(TrapezoidalTrajectory(500.0, 520.0, 50.0, 500.0)))
    r.until(lambda: not handle.busy and r.core.stop_sequence is None)
    assert 9_000 <= watch.travel[1] <= 10_001


@pytest.mark.parametrize("own", [True, False], ids=["own", "known"])
def test_an_axis_outside_its_limits_may_return_and_not_move_farther_out(own):
    wrap = Own if own else lambda path: path
    r = rig(limits=TEN, motor=MotorParams(start_position=15_000)).enabled()
    watch = Watch(r)
    with pytest.raises(LimitError, match="leaves the position limits"):
        r.axis.follow(wrap(TrapezoidalTrajectory(15.0, 16.0, 50.0, 500.0))).wait(5)
    r.until(lambda: r.core.stop_sequence is None)
    assert watch.travel[1] <= 15_001
    r.axis.reset().wait(1)
    r.axis.follow(wrap(TrapezoidalTrajectory(r.axis.position, 5.0, 50.0, 500.0))).wait(5)
    assert r.drive.position == 5_000


def test_without_a_deceleration_a_path_of_one_s_own_is_not_begun_within_position_limits():
    r = rig(limits=TEN, defaults=Defaults(velocity=100.0)).enabled()
    with pytest.raises(ArgumentError, match="acceleration is missing") as caught:
        r.axis.follow(Own(TrapezoidalTrajectory(0.0, 5.0, 50.0, 500.0)))
    assert "[axes.x.defaults]" in caught.value.remedy
    r.axis.follow(TrapezoidalTrajectory(0.0, 5.0, 50.0, 500.0)).wait(5)  # known in advance: it is within them


def test_the_other_axis_of_the_group_is_braked_along_its_own_path():
    slow = {"defaults": Defaults(velocity=100.0, acceleration=100.0)}
    r = rig("xy", limits=TEN, each={"y": slow | {"limits": AxisLimits(velocity=400.0)}}).enabled()
    watches = {name: Watch(r, name) for name in "xy"}
    first = r.axes["x"].follow(Own(TrapezoidalTrajectory(0.0, 20.0, 50.0, 500.0)))
    second = r.axes["y"].follow(Own(TrapezoidalTrajectory(0.0, -40.0, 80.0, 500.0)))
    r.until(lambda: not first.busy)
    r.until(lambda: all(core.stop_sequence is None for core in r.scan.axes.values()))
    assert watches["x"].travel[1] <= 10_001
    assert isinstance(second.exception(), Stopped)
    assert "leaves the position limits" in str(second.exception())
    assert watches["y"].transitions == []
    assert r.axes["y"].state is AxisState.STANDSTILL
    assert all(abs(device.drives[0].axis.motor.velocity) < 1.0 for device in r.devices)


@pytest.mark.parametrize("wrong", ["raises", "nan"])
def test_a_trajectory_with_a_mistake_ends_its_command_and_not_the_scan(wrong):
    class Broken:
        duration = 2.0

        def position(self, t: float) -> float:
            if t < 0.5:
                return 0.0
            return math.nan if wrong == "nan" else 1.0 / 0.0

    r = rig().enabled()
    with pytest.raises(ArgumentError, match=r"returned no position at 0.500 s"):
        r.axis.follow(Broken()).wait(5)
    r.run(1.0)
    assert not r.scan.ended
    assert r.axis.state is AxisState.ERRORSTOP


def test_an_axis_that_does_not_reach_the_end_of_its_trajectory_fails():
    r = rig(position_window=100, following_error=BLIND).enabled()
    r.device.write(0x6065, 0, 0xFFFFFFFF)
    handle = r.axis.follow(TrapezoidalTrajectory(0.0, 10.0, 100.0, 500.0))
    r.until(lambda: r.drive.position > 5_000)
    r.drive.dials.blocked = True
    with pytest.raises(MotionTimeout, match="end of its trajectory"):
        handle.wait(5)


# Stopping on the path.


@pytest.mark.parametrize("how", ["halt", "stop", "disable"])
def test_a_stop_brakes_along_the_path_with_the_axis_s_deceleration(how):
    r = rig(defaults=Defaults(velocity=100.0, acceleration=500.0, deceleration=250.0)).enabled()
    handle = r.axis.follow(TrapezoidalTrajectory(0.0, 300.0, 100.0, 500.0))
    r.until(lambda: r.drive.position > 50_000)
    watch = Watch(r)
    getattr(r.axis, how)().wait(5)
    assert isinstance(handle.exception(), Stopped)
    begin, end = watch.moving()
    assert end - begin == pytest.approx(100 / 250, abs=0.05)
    assert watch.acceleration() <= 250_000 * 1.1
    ends = {"halt": AxisState.STANDSTILL, "stop": AxisState.STOPPING, "disable": AxisState.DISABLED}
    assert r.axis.state is ends[how]


def test_a_halt_on_a_path_that_turns_round_stays_on_it():
    r = rig(defaults=Defaults(velocity=100.0, acceleration=100.0)).enabled()
    r.axis.follow(Sine(20.0, 1.0))
    r.run(0.8)
    watch = Watch(r)
    r.axis.halt().wait(5)
    low, high = watch.travel
    assert low >= -60
    assert high <= 40_060
    assert r.axis.state is AxisState.STANDSTILL


def test_a_quick_stop_does_not_wait_for_the_path():
    r = rig().enabled()
    r.device.write(0x6085, 0, 2_000_000)
    handle = r.axis.follow(TrapezoidalTrajectory(0.0, 300.0, 100.0, 500.0))
    r.until(lambda: r.drive.position > 50_000)
    watch = Watch(r)
    r.axis.quick_stop().wait(5)
    begin, end = watch.moving()
    assert end - begin <= 100 / 2000 + 0.06
    assert 11 in watch.transitions
    assert isinstance(handle.exception(), Stopped)


# Another command takes over.


@pytest.mark.parametrize("mode_delay", [0.0, 0.03, 0.1])
@pytest.mark.parametrize(
    "command",
    [
        lambda axis: axis.move_absolute(300.0),
        lambda axis: axis.move_velocity(100.0),
        lambda axis: axis.jog(100.0),
    ],
    ids=["move_absolute", "move_velocity", "jog"],
)
def test_a_command_takes_over_from_a_trajectory_without_a_jolt(command, mode_delay):
    """Drives take up to some cycles for a mode: until then the targets continue, or the axis would stop dead on the last one."""
    r = rig().enabled()
    handle = r.axis.follow(TrapezoidalTrajectory(0.0, 250.0, 100.0, 500.0))
    r.until(lambda: r.drive.position > 50_000)
    r.drive.dials.mode_delay = mode_delay
    watch = Watch(r)
    command(r.axis)
    r.run(mode_delay + 0.08)  # within a jog's life
    assert isinstance(handle.exception(), Replaced)
    assert watch.acceleration() <= 500_000 * 1.6  # the first two cycles of the new mode brake a little
    assert min(row.velocity for row in watch.rows) > 80_000


def test_a_command_takes_over_from_a_halt_on_the_path_without_a_jolt():
    r = rig(defaults=Defaults(velocity=100.0, acceleration=200.0)).enabled()
    r.axis.follow(TrapezoidalTrajectory(0.0, 300.0, 100.0, 500.0))
    r.until(lambda: r.drive.position > 50_000)
    r.drive.dials.mode_delay = 0.05
    r.axis.halt()
    r.run(0.1)
    watch = Watch(r)
    r.axis.move_absolute(200.0).wait(5)
    r.run(0.2)
    assert r.drive.position == 200_000
    assert watch.acceleration() <= 500_000 * 1.6


def test_a_mode_that_is_refused_during_a_trajectory_stops_the_axis_by_quick_stop():
    r = rig().enabled()
    r.axis.follow(TrapezoidalTrajectory(0.0, 300.0, 100.0, 500.0))
    r.until(lambda: r.drive.position > 50_000)
    r.drive.dials.modes_refused = frozenset({3})
    watch = Watch(r)
    handle = r.axis.move_velocity(50.0)
    r.until(lambda: not handle.busy)
    assert "does not enter mode 3" in str(handle.exception())
    r.until(lambda: r.core.stop_sequence is None)
    assert 11 in watch.transitions
    assert r.axis.state is AxisState.ERRORSTOP
    assert abs(r.drive.axis.motor.velocity) < 1.0


def test_a_lost_position_during_a_trajectory_ends_in_a_quick_stop():
    r = rig(port={"max_age": {"position": 0.05}}).enabled()
    handle = r.axis.follow(TrapezoidalTrajectory(0.0, 300.0, 100.0, 500.0))
    r.until(lambda: r.drive.position > 50_000)
    read = r.ports["x"].read
    r.ports["x"].read = lambda now: read(now)._replace(position=None, demand=None)
    r.until(lambda: not handle.busy)
    assert "6064h" in str(handle.exception())
    r.run(1.0)
    assert abs(r.drive.axis.motor.velocity) < 1.0
