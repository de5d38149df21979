"""Limits hold in every mode: whatever moves an axis towards them, its motor stops within them."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from axisbus import eds
from axisbus.cia402.port import ValueTransport
from axisbus.eds import builtin
from axisbus.errors import LimitError, MotionTimeout, Replaced, StaleError, StateError
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.build import device_from_eds, motor_from_eds
from axisbus.sim.device import Device
from axisbus.testing import simulate
from kit.cell import Cell, cell_text
from kit.plant_probe import ENABLED, OFF

# With a rated torque of 5 N·m, so that few N·m are much; its value in 6076h belongs to another scenario.
JOINTS = (
    (Path(__file__).parents[2] / "examples" / "cell.toml")
    .read_text(encoding="utf-8")
    .replace("rated_torque = 10.0", "rated_torque = 5.0")
)


def joints(scenario, lag: float = 0.002, **port) -> Cell:
    """The cell of the examples: x within ±180, y within ±90 deg, 360 deg/s, 3600 deg/s²; ``lag`` of the motors in s."""
    cell = scenario.simulated(text=JOINTS, port=port or None, devices=lambda: devices(lag))
    for name in "xy":
        cell[name].enable().wait(5)
        cell[name].home().wait(5)
    return cell


def devices(lag: float) -> dict[int, Device]:
    """The modules of the example, with motors that follow their demand by ``lag`` seconds."""
    dictionary = eds.load(builtin.resolve("builtin:gim6010-8", Path()))
    params = replace(motor_from_eds(dictionary), lag=lag)
    return {node: device_from_eds(dictionary, node, params) for node in (1, 2, 3)}


def must_end_within(cell: Cell, name: str, low: float, high: float) -> None:
    """Let time pass until the axis is in ErrorStop and at standstill; it has never been beyond its limits."""
    cell.until(lambda: cell[name].state is AxisState.ERRORSTOP and cell.core(name).stop_sequence is None, 10)
    cell.run(0.5)
    assert cell.speed(name) == pytest.approx(0.0, abs=0.01)
    lowest, highest = cell.farthest(name)
    assert low <= lowest
    assert highest <= high


# At a velocity.


@pytest.mark.parametrize("lag", [0.002, 0.05])
@pytest.mark.parametrize(
    ("velocity", "acceleration"),
    [(360, 3600), (-360, 2000), (360, 720), (-360, 300), (90, 720), (-30, 100), (200, 3600)],
)
def test_a_turning_axis_stops_within_its_position_limits(scenario, velocity, acceleration, lag):
    """The reaction distance counts the command's acceleration, the delay of feedback and the real ramp of a halt."""
    cell = joints(scenario, lag)
    cell["y"].move_velocity(velocity, acceleration=acceleration)
    must_end_within(cell, "y", -90.0, 90.0)
    assert isinstance(cell["y"].error, LimitError)
    assert max(map(abs, cell.farthest("y"))) > 60.0  # and not long before


@pytest.mark.parametrize("deceleration", [100.0, 720.0, 3600.0])
def test_the_braking_distance_uses_the_deceleration_of_the_command(scenario, deceleration):
    cell = joints(scenario)
    cell["y"].move_velocity(150.0, acceleration=500, deceleration=deceleration)
    must_end_within(cell, "y", -90.0, 90.0)
    assert cell.farthest("y")[1] > 70.0


@pytest.mark.parametrize(("halt", "beyond"), [("ramp", 85.0), ("slow-ramp", 60.0)])
def test_the_braking_distance_uses_the_ramp_that_a_halt_has_by_605dh(scenario, halt, beyond):
    """A halt on the quick-stop ramp (1440 deg/s²) needs a fifth of the distance that one on 6084h (300 deg/s²) needs."""
    cell = scenario.simulated(text=JOINTS.replace('halt = "slow-ramp"', f'halt = "{halt}"'))
    cell["y"].enable().wait(5)
    cell["y"].home().wait(5)
    cell["y"].move_velocity(100.0, acceleration=3600, deceleration=300)
    must_end_within(cell, "y", -90.0, 90.0)
    assert cell.farthest("y")[1] > beyond


def test_a_weaker_deceleration_close_to_a_limit_is_refused_and_the_motion_before_continues_in_safety(
    scenario,
):
    cell = joints(scenario)
    first = cell["y"].move_velocity(200.0, acceleration=3600, deceleration=3600)
    cell.until(lambda: cell.where("y") > 40.0)
    error = cell.failure_of(cell["y"].move_velocity(150.0, deceleration=200))
    assert isinstance(error, LimitError)
    assert "with that deceleration" in error.message
    assert first.done
    error = cell.failure_of(cell["y"].move_absolute(85.0, velocity=200, deceleration=100))
    assert "with that deceleration" in error.message
    must_end_within(cell, "y", -90.0, 90.0)


def test_a_slow_move_continues_close_to_its_limit(scenario):
    """The reaction distance is that of the command, so that jogging near an end of the axis is possible."""
    cell = joints(scenario)
    cell["y"].move_absolute(89.0, velocity=360, acceleration=3600).wait(5)
    cell["y"].move_velocity(2.0)
    cell.run(0.3)
    assert cell["y"].state is AxisState.CONTINUOUS_MOTION
    assert cell.where("y") > 89.5
    must_end_within(cell, "y", -90.0, 90.0)


def test_an_axis_at_standstill_at_its_limit_does_not_move_beyond_it_by_an_increment(scenario):
    cell = joints(scenario)
    cell["y"].move_absolute(90.0, velocity=360, acceleration=3600).wait(5)
    cell["y"].move_velocity(360.0, acceleration=3600)
    must_end_within(cell, "y", -90.0, 90.003)


@pytest.mark.parametrize("source", [ValueTransport.SDO, ValueTransport.EVENT_PDO])
def test_the_braking_distance_counts_the_age_of_late_feedback(scenario, source):
    """A position that is polled each 100 ms is up to 100 ms old: at 360 deg/s that is 36 deg."""
    port = {"inputs": {"position": source, "demand": ValueTransport.NONE}, "event_timer": 0.05}
    cell = joints(scenario, **port)
    cell["y"].move_velocity(360, acceleration=3600)
    must_end_within(cell, "y", -90.0, 90.0)


def test_a_missing_position_stops_an_axis_that_must_keep_its_limits(scenario):
    cell = joints(scenario, max_age={"position": 0.05})
    cell["y"].move_velocity(30.0).wait(5)
    read = cell.port("y").read
    cell.port("y").read = lambda now: read(now)._replace(position=None, demand=None)
    cell.until(lambda: cell["y"].state is AxisState.ERRORSTOP)
    assert isinstance(cell["y"].error, StaleError)
    cell.run(1.0)
    assert cell.speed("y") == 0.0
    assert cell.farthest("y")[1] < 90.0


@pytest.mark.parametrize("velocity", [300.0, -150.0])
def test_in_real_time_on_a_bus_a_turning_axis_stops_within_its_limits(scenario, velocity):
    cell = scenario.real("x", axis="position_limits = [-90.0, 90.0]").enabled()
    cell.x.move_velocity(velocity, acceleration=3000, deceleration=1500)
    must_end_within(cell, "x", -90.0, 90.0)
    assert max(map(abs, cell.farthest())) > 30.0


# Under torque.


@pytest.mark.parametrize("lag", [0.002, 0.02])
@pytest.mark.parametrize("slope", [0.5, 5.0, 50.0])
@pytest.mark.parametrize("torque", [0.2, -0.5, 1.0, -3.0, 5.0])
def test_an_axis_under_torque_keeps_its_limits_of_position_and_velocity(scenario, torque, slope, lag):
    """A halt in profile torque mode lets the motor coast: the quick stop brakes it, and its braking distance is counted."""
    cell = joints(scenario, lag)
    cell["x"].torque_control(torque, slope=slope)
    must_end_within(cell, "x", -180.0, 180.0)
    assert cell.top_speed("x") <= 360.0


def test_a_torque_that_friction_balances_is_not_stopped(scenario):
    cell = joints(scenario)
    cell["x"].torque_control(0.15, slope=5.0)
    cell.run(4.0)
    assert cell["x"].state is AxisState.CONTINUOUS_MOTION
    assert 10.0 < cell.speed("x") < 60.0


def test_an_axis_under_torque_whose_quick_stop_coasts_is_braked_in_profile_velocity_mode(scenario):
    text = JOINTS.replace('quick_stop = "ramp"', 'quick_stop = "coast"')
    cell = scenario.simulated(text=text)
    cell["x"].enable().wait(5)
    cell["x"].home().wait(5)
    cell["x"].torque_control(1.0, slope=5.0)
    must_end_within(cell, "x", -180.0, 180.0)
    assert cell.stage("x") == ENABLED


def test_a_halt_under_torque_that_would_coast_beyond_a_limit_becomes_a_quick_stop(scenario):
    cell = joints(scenario)
    cell["x"].torque_control(1.0, slope=5.0)
    cell.until(lambda: cell.where("x") > 90.0)
    assert cell.speed("x") > 200.0
    cell["x"].halt()
    must_end_within(cell, "x", -180.0, 180.0)


HARD = {  # motions to +170 deg whose own ramps are much harder than the quick stop
    "csp": lambda x: x.follow(TrapezoidalTrajectory(x.position, 170.0, 340.0, 3600.0)),
    "pp": lambda x: x.move_absolute(170.0, velocity=340.0, acceleration=3600.0, deceleration=3600.0),
    "pv": lambda x: x.move_velocity(340.0, acceleration=3600.0, deceleration=3600.0),
}


@pytest.mark.parametrize("after", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
@pytest.mark.parametrize("torque", [0.05, 1.0])
@pytest.mark.parametrize("begin", HARD.values(), ids=list(HARD))
def test_a_torque_that_replaces_a_motion_keeps_the_limits_with_a_quick_stop_that_brakes_less(
    scenario, begin, torque, after
):
    text = JOINTS.replace('quick_stop = "ramp"', 'quick_stop = "slow-ramp"')
    cell = scenario.simulated(text=text.replace("deceleration = 720.0", "deceleration = 360.0"))
    cell["x"].enable().wait(5)
    cell["x"].home().wait(5)
    begin(cell["x"])
    cell.run(after)
    with contextlib.suppress(LimitError):
        cell["x"].torque_control(torque, slope=5.0)
    cell.run(3.0)
    lowest, highest = cell.farthest("x")
    assert lowest >= -180.0
    assert highest <= 180.0


@pytest.mark.parametrize("load", ["brake", "torque"])
def test_an_axis_with_a_load_under_torque_is_braked_by_a_mode_that_holds(scenario, load):
    text = JOINTS.replace("rated_torque = 5.0", f'rated_torque = 5.0\nholds_load = "{load}"')
    text = text.replace('quick_stop = "ramp"', 'quick_stop = "ramp-hold"')
    cell = scenario.simulated(text=text)
    cell["x"].enable().wait(5)
    cell["x"].home().wait(5)
    cell["x"].torque_control(1.0, slope=5.0)
    must_end_within(cell, "x", -180.0, 180.0)
    assert cell.stage("x") == ENABLED


# On a trajectory.


class Own:
    """A path of the program without properties in advance."""

    def __init__(self, duration: float, way: Callable[[float], float]) -> None:
        self.duration = duration
        self.position = way


@pytest.mark.parametrize(
    ("told", "missing", "way"),
    [
        ("harder than max_acceleration", "nothing", lambda t: 359.0 * min(t, 0.2)),
        ("harder than max_acceleration", "max_velocity", lambda t: 0.0 if t < 0.5 else 90.0),
        ("harder than the default", "max_(velocity|acceleration)", lambda t: 0.0 if t < 0.5 else 90.0),
        ("faster than max_velocity", "max_acceleration", lambda t: 400.0 * max(0.0, t - 0.5)),
    ],
    ids=["a step of velocity", "a jump without max_velocity", "a jump without limits", "too fast at once"],
)
def test_no_step_of_a_trajectory_that_the_axis_cannot_make_reaches_its_motor(scenario, told, missing, way):
    cell = scenario.simulated(text=re.sub(f"{missing} = .*", "", JOINTS))
    cell["x"].enable().wait(5)
    cell["x"].home().wait(5)
    since = cell.moment("x")
    error = cell.failure_of(cell["x"].follow(Own(1.0, way)))
    assert told in error.message
    cell.run(1.0)
    cell.must_not_leap("x", since=since, way=0.01, speed=0.1)


def test_half_the_count_of_the_drive_is_no_step(scenario):
    text = re.sub(r"(max_(velocity|acceleration)|position_limits) = .*", "", JOINTS)
    cell = scenario.simulated(text=text)
    cell["x"].enable().wait(5)
    cell["x"].home().wait(5)
    since = cell.moment("x")
    cell.failure_of(cell["x"].follow(Own(1.0, lambda t: 0.0 if t < 0.5 else 2**31 * 360 / 131072)))
    cell.must_not_leap("x", since=since, way=0.01, speed=0.1)


def test_a_trajectory_that_gets_too_fast_is_braked_along_its_path(scenario, golden):
    cell = joints(scenario)
    since = cell.moment("x")
    error = cell.failure_of(
        cell["x"].follow(Own(2.0, lambda t: 500.0 * t * t))
    )  # 1000 deg/s²: 360 deg/s after 0.36 s
    golden("limits_path_too_fast", error)
    must_end_within(cell, "x", -180.0, 180.0)
    assert 355.0 < cell.top_speed("x") <= 360.1
    assert cell.hardest_change("x", since) <= 1300.0  # the path itself, and whole increments
    assert cell.stage("x") == ENABLED


def test_a_trajectory_at_all_its_limits_is_followed_to_its_end(scenario):
    cell = joints(scenario)
    for end in (170.0, -170.0, -169.0, 0.1):
        for velocity in (360.0, 77.7):
            cell["x"].follow(TrapezoidalTrajectory(cell["x"].position, end, velocity, 3600.0)).wait(5)
            assert cell.where("x") == pytest.approx(end, abs=0.01)
            own = TrapezoidalTrajectory(cell["x"].position, -end, velocity, 3600.0)
            cell["x"].follow(Own(own.duration, own.position)).wait(5)
            assert cell.where("x") == pytest.approx(-end, abs=0.01)
    assert cell.top_speed("x") <= 361.0


def test_a_straight_line_at_all_its_limits_is_followed_to_its_end(scenario):
    cell = joints(scenario)
    cell["z"].enable().wait(5)
    cell["z"].home().wait(5)
    for ends in ((170.0, -80.0, 400.0), (-170.0, 80.0, 0.0), (0.0, 0.3, 0.0)):
        cell.machine.group("x", "y", "z").move_linear(ends, velocity=5000.0, acceleration=50000.0).wait(10)
        for name, end in zip("xyz", ends, strict=True):
            assert cell.where(name) == pytest.approx(end, abs=0.02)


# Commands.


def test_a_torque_beyond_6072h_is_refused_if_the_cell_file_gives_no_limit(scenario):
    """6072h of this drive is 3000: three times its rated torque."""
    cell = scenario.simulated("x", axis="rated_torque = 1.27").enabled()
    with pytest.raises(LimitError, match="beyond the limit") as caught:
        cell.x.torque_control(3.9)
    assert "the drive's 6072h is 3.81" in caught.value.observed
    cell.x.torque_control(0.1)
    cell.run(0.2)
    less = scenario.simulated(
        "x", axis="rated_torque = 1.27", more='[axes.x.objects]\n"6072" = 500\n'
    ).enabled()
    with pytest.raises(LimitError, match="beyond the limit"):
        less.x.torque_control(0.64)
    less.x.torque_control(0.63)
    less.run(0.1)
    assert 0.0 < max(sample.torque for sample in less.record().samples) <= 500.0


def test_max_torque_of_the_cell_file_is_the_one_that_holds(scenario):
    cell = scenario.simulated("x", axis="rated_torque = 1.27\nmax_torque = 0.5").enabled()
    with pytest.raises(LimitError, match="beyond the limit") as caught:
        cell.x.torque_control(0.51)
    assert "max_torque is 0.5" in caught.value.observed


def test_a_rated_torque_that_the_drive_does_not_share_is_reported_at_boot(scenario):
    told = scenario.simulated("x", axis="rated_torque = 2.54").machine.reports[0]
    assert any("rated_torque 2.54 N·m, but 6076h has 1.27 N·m" in warning for warning in told.warnings)
    assert "0.5 times the commanded torque" in told.text()
    same = scenario.simulated("x", axis="rated_torque = 1.27").machine.reports[0]
    assert not any("rated_torque" in warning for warning in same.warnings)
    assert same.as_json()["axes"][0]["rated_torque"]["agrees"] is True


# An endless axis.


def beyond_the_count(scenario, more: str = "") -> Cell:
    """An endless axis (36 000 increments per turn) that was just below the end of INTEGER32, turning past it."""
    dictionary = eds.load(builtin.resolve("builtin:generic-cia402", Path()))
    params = replace(motor_from_eds(dictionary), start_position=2.0**31 - 3_000)
    cell = scenario.simulated(
        "x", axis=f"modulo = 360.0\n{more}", devices=lambda: {1: device_from_eds(dictionary, 1, params)}
    )
    cell.turning(90.0)
    cell.run(1.0)
    assert cell.where() * 100 > 2**31
    return cell


def test_an_endless_axis_past_int32_loses_neither_a_cycle_nor_its_angle(scenario):
    cell = beyond_the_count(scenario)
    cell.x.halt().wait(5)
    cell.x.set_position(cell.where() % 360.0).wait(1)
    read, lost = cell.port().read, [True]
    cell.port().read = lambda now: read(now)._replace(position=None) if lost[0] else read(now)
    cell.run(0.1)
    assert cell.core().image.position is None
    lost[0] = False
    cell.run(0.1)
    assert cell.x.homed
    assert cell.x.position == pytest.approx(cell.where() % 360.0, abs=0.02)
    cell.x.move_absolute(90.0).wait(5)
    cell.run(0.3)
    assert cell.where() % 360.0 == pytest.approx(90.0, abs=0.02)


def test_an_endless_axis_without_feedback_for_half_the_count_is_no_longer_homed(scenario):
    """At 400 000 000 deg/s the half of INTEGER32 passes within 54 ms."""
    text = cell_text("x", axis="modulo = 360.0").replace("max_velocity = 400.0", "max_velocity = 4e8")
    cell = scenario.simulated(text=text).enabled()
    cell.x.set_position(0.0).wait(1)
    read, lost = cell.port().read, [True]
    cell.port().read = lambda now: read(now)._replace(position=None) if lost[0] else read(now)
    cell.run(0.1)
    assert cell.x.homed
    lost[0] = False
    cell.run(0.05)
    assert not cell.x.homed


# From a trajectory to a position.


@pytest.mark.parametrize("mode_delay", [0.0, 0.05])
@pytest.mark.parametrize("target", [170.0, 60.0, 20.0, -100.0])
def test_a_move_out_of_a_trajectory_begins_from_the_present_velocity(scenario, target, mode_delay):
    """A drive that changes to profile position mode has no set-point for a cycle or more, and brakes as it sees fit."""
    cell = joints(scenario)
    cell.drive("x").dials.mode_delay = mode_delay
    handle = cell["x"].follow(TrapezoidalTrajectory(0.0, 150.0, 90.0, 720.0))
    cell.until(lambda: cell.where("x") > 40.0)
    since = cell.moment("x")
    move = cell["x"].move_absolute(target, velocity=90)
    move.wait(10)
    assert isinstance(handle.exception(), Replaced)
    assert (
        cell.hardest_change("x", since) <= 720.0 + 300.0
    )  # whole increments of a position over 4 ms: 172 deg/s²
    assert cell.top_speed("x", since) <= 91.0
    assert cell.where("x") == pytest.approx(target, abs=0.01)
    cell["x"].move_absolute(0.0).wait(10)  # and from rest in profile position mode, as ever
    assert cell.drive("x").mode_display == 1


def test_a_move_out_of_a_halt_on_a_trajectory_and_a_halt_of_that_move_do_not_jolt(scenario):
    cell = joints(scenario)
    cell["x"].follow(TrapezoidalTrajectory(0.0, 150.0, 90.0, 720.0))
    cell.until(lambda: cell.where("x") > 40.0)
    since = cell.moment("x")
    cell["x"].halt()
    cell.run(0.05)
    cell["x"].move_absolute(160.0, velocity=180)
    cell.run(0.2)
    cell["x"].move_absolute(170.0, velocity=60)
    cell.run(0.3)
    cell["x"].halt().wait(5)
    assert cell.hardest_change("x", since) <= 720.0 + 300.0
    assert cell["x"].state is AxisState.STANDSTILL
    cell.must_be_still("x", within=0.1, stages=ENABLED)


def test_a_move_out_of_a_trajectory_that_could_not_brake_within_the_limits_is_refused(scenario):
    cell = joints(scenario)
    cell["y"].follow(TrapezoidalTrajectory(0.0, 88.0, 300.0, 3600.0))
    cell.until(lambda: cell.where("y") > 40.0)
    error = cell.failure_of(cell["y"].move_absolute(80.0, velocity=300, deceleration=300))
    assert "could not stop within the position limits" in error.message
    cell.until(lambda: cell["y"].state is AxisState.STANDSTILL)
    assert cell.where("y") == pytest.approx(88.0, abs=0.01)
    assert cell.farthest("y")[1] <= 88.1


def test_a_group_changes_over_from_its_trajectories_in_one_cycle_without_a_jolt(scenario):
    cell = joints(scenario)
    cell["z"].enable().wait(5)
    cell["z"].home().wait(5)
    for name, end in (("x", 150.0), ("y", 80.0)):
        cell[name].follow(TrapezoidalTrajectory(0.0, end, 60.0, 720.0))
    cell.until(lambda: cell.where("x") > 30.0)
    since = cell.moment("x")
    cell.machine.group("x", "y", "z").move_direct((20.0, -10.0, 30.0), velocity=60.0).wait(10)
    for name, end in (("x", 20.0), ("y", -10.0), ("z", 30.0)):
        cell.run(0.2)
        assert cell.where(name) == pytest.approx(end, abs=0.02)
        assert cell.hardest_change(name, since) <= 720.0 + 300.0


def test_a_move_out_of_a_trajectory_ends_at_the_caller_s_timeout(scenario):
    cell = joints(scenario)
    cell["x"].follow(TrapezoidalTrajectory(0.0, 150.0, 90.0, 720.0))
    cell.until(lambda: cell.where("x") > 40.0)
    error = cell.failure_of(cell["x"].move_absolute(170.0, velocity=10, timeout=0.5))
    assert isinstance(error, MotionTimeout)
    cell.must_be_still("x", within=2.0, stages=(ENABLED, *OFF))


# Limits in the drive.

IN_DRIVE = """\
position_limits = [-90.05, 90.0]
max_torque = 2.0
rated_torque = 4.0
limits_in_drive = true
"""


def test_limits_in_the_drive_hold_without_a_master(scenario):
    """The master dies, the drive does not detect it, and another tool commands a target that the master would have refused."""
    cell = scenario.simulated("x", axis=IN_DRIVE, heartbeat="off").enabled()
    device, drive = cell.device(), cell.drive()
    assert "objects written and read back" in cell.machine.reports[0].configured
    assert [device.read(0x607D, sub) for sub in (1, 2)] == [-9005, 9000]
    assert (device.read(0x607F, 0), device.read(0x6072, 0)) == (40_000, 500)
    cell.machine._core.scan.ended = True
    cell.run(0.02)  # frames in transit arrive
    device.write(0x1400, 5, 0)  # the deadline of its RPDO, which would notice
    drive.mode, drive.target_position, drive.controlword = 1, 20_000, 0x0F
    device.write(0x6081, 0, 100_000)
    device.write(0x6083, 0, 200_000)
    device.write(0x6084, 0, 200_000)
    cell.run(0.1)
    drive.controlword = 0x1F
    cell.run(3.0)
    assert 350.0 < cell.top_speed() <= 400.1
    assert cell.farthest()[1] == pytest.approx(90.0, abs=0.01)


def test_the_speed_of_the_motor_is_limited_if_the_drive_defines_its_unit(scenario):
    text = JOINTS.replace("max_acceleration = 3600.0", "max_acceleration = 3600.0\nlimits_in_drive = true")
    cell = scenario.simulated(text=text)
    device = cell.device("y")
    assert device.read(0x6080, 0) == 480  # 360 deg/s at the output, 8 turns of the motor each
    assert [device.read(0x607D, sub) for sub in (1, 2)] == [-32768, 32768]
    for name in "xy":
        cell[name].enable().wait(5)
        cell[name].home().wait(5)
    cell["y"].move_absolute(90.0, velocity=360, acceleration=3600).wait(5)
    cell["y"].move_absolute(-90.0, velocity=360, acceleration=3600).wait(5)
    assert cell.top_speed("y") == pytest.approx(360.0, abs=0.1)  # its own limits do not slow it down


def test_limits_in_the_drive_do_not_allow_another_position(scenario):
    """They would stay where they are: in csp the drive would leap from a position beyond them to the limit."""
    cell = scenario.simulated("x", axis=IN_DRIVE).enabled()
    error = cell.failure_of(cell.x.set_position(45.0))
    assert isinstance(error, StateError)
    assert "limits_in_drive" in str(error)
    assert cell.x.position == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("place", [120.0, -120.0])
@pytest.mark.parametrize("required", [True, False])
def test_an_axis_beyond_the_limits_in_its_drive_is_not_moved_by_csp(scenario, required, place):
    def beyond():
        dictionary = eds.load(builtin.resolve("builtin:gim6010-8", Path()))
        scale = 131072 / 360
        return {
            node: Device(
                dictionary, node, params=replace(motor_from_eds(dictionary), start_position=place * scale)
            )
            for node in (1, 2, 3)
        }

    text = JOINTS.replace("max_acceleration = 3600.0", "max_acceleration = 3600.0\nlimits_in_drive = true")
    text = text.replace("method = 35 ", f"required = {str(required).lower()}\nmethod = 35 ")
    text = text.replace("position_limits = [-180.0, 180.0]", "position_limits = [-90.0, 90.0]")
    cell = scenario.simulated(text=text, devices=beyond)
    x = cell["x"]
    x.enable().wait(5)
    moment = cell.moment("x")
    error = cell.failure_of(
        x.move_relative(-place / 240, velocity=1.0, acceleration=10.0, jerk=500.0)
    )  # by csp
    assert isinstance(error, StateError)
    assert "607Dh" in str(error)
    cell.run(0.5)
    low, high = cell.farthest("x", since=moment)
    assert high - low < 0.1
    x.move_relative(-place).wait(10)  # in pp, where the drive plans the motion
    x.move_relative(place / 240, velocity=1.0, acceleration=10.0, jerk=500.0).wait(5)


def test_an_axis_that_the_master_turns_has_its_limits_turned_in_the_drive(scenario):
    turned = IN_DRIVE.replace("-90.05, 90.0", "-30.0, 90.0") + 'invert = "master"'
    cell = scenario.simulated("x", axis=turned).enabled()
    assert [cell.device().read(0x607D, sub) for sub in (1, 2)] == [-9000, 3000]
    cell.x.home().wait(5)
    cell.x.move_absolute(90.0, velocity=300).wait(5)
    cell.run(0.3)
    assert cell.where() == pytest.approx(90.0, abs=0.02)
    assert cell.drive().position == -9000


@pytest.mark.parametrize("pause", [0.0, 0.025, 0.05])
def test_an_axis_that_has_just_arrived_at_its_limit_may_move_away_at_once(tmp_path, pause):
    """Its last increments towards the limit are still among the newest positions, and the new command leads away."""
    axis = "position_limits = [0.0, 40.0]\nvelocity_scale = 100.0"
    text = cell_text("x", period="25ms", axis=axis).replace(
        "acceleration = 500.0", "acceleration = 400.0\njerk = 4000.0"
    )
    (tmp_path / "cell.toml").write_text(text, encoding="utf-8")
    with simulate(tmp_path / "cell.toml") as simulation:
        x = simulation.machine["x"]
        x.enable().wait(5)
        for start in (39.2, 39.1, 39.0, 38.5):
            x.move_absolute(start, velocity=40.0).wait(10)
            x.move_absolute(40.0, velocity=40.0).wait(10)
            simulation.machine.sleep(pause)
            x.move_velocity(-20.0).wait(5)
            x.halt().wait(5)
        assert x.error is None


@pytest.mark.parametrize("stop", ["halt", "stop", "disable", "hold"])
def test_a_halt_with_a_weaker_ramp_than_that_of_the_move_ends_within_the_limits(tmp_path, stop):
    """The move ends at the limit; the drive halts with 6085h, which is weaker than the deceleration of the move."""
    text = cell_text(
        "x",
        axis="position_limits = [0.0, 100.0]\nvelocity_scale = 100.0",
        stop='halt = "ramp"',
    )
    text = text.replace("deceleration = 1000.0", "deceleration = 300.0")
    (tmp_path / "cell.toml").write_text(text, encoding="utf-8")
    with simulate(tmp_path / "cell.toml") as simulation:
        x, machine = simulation.machine["x"], simulation.machine
        x.enable().wait(5)
        x.move_absolute(100.0, velocity=150.0, deceleration=600.0)
        while simulation.position("x") < 82.0:
            machine.sleep(0.01)
        if stop == "hold":
            x.set_override(0.0)
            machine.sleep(2.0)
        else:
            getattr(x, stop)().wait(5)
        assert simulation.position("x") <= 100.01
        assert x.error is None
