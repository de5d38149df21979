"""A stop counts only when standstill is seen: jams, drives that move without a command, and values older than the stop."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from axisbus import eds
from axisbus.cia402.port import ValueTransport
from axisbus.errors import FollowingError, ModeError, StateError, UncommandedMotion
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.build import motor_from_eds
from axisbus.sim.device import Device
from axisbus.sim.fault_injection import NEVER
from axisbus.testing import simulate
from kit.cell import MODULE, cell_text
from kit.plant_probe import ENABLED, OFF, QUICK_STOP, SWITCH_ON_DISABLED

FILE = Path(__file__).parents[2] / "eds" / "generic-cia402.eds"

PP, PV, TQ, CSP = 1, 3, 4, 8  # values of 6060h (CiA 402-2 8.4.9)


def slip(cell, mode: int) -> float:
    """Let the drive leave its mode without a command, and not take it again; return the time."""
    moment = cell.moment()
    cell.drive().dials.spontaneous_mode = mode
    return moment


def going(cell, what: str, velocity: float = 60.0):
    """Let x move in a mode, far from any end; return the handle."""
    starts = {
        "pp": lambda: cell.x.move_relative(1000.0, velocity=velocity),
        "pv": lambda: cell.x.move_velocity(velocity),
        "csp": lambda: cell.x.follow(
            TrapezoidalTrajectory(
                cell.x.position, cell.x.position + math.copysign(1000.0, velocity), abs(velocity), 720.0
            )
        ),
    }
    handle = starts[what]()
    cell.run(0.6)
    cell.until(lambda: cell.speed() > 0.7 * abs(velocity))  # a busy computer takes its time
    return handle


@pytest.mark.parametrize("creep", [15.0, -15.0])
def test_an_axis_at_standstill_that_creeps_is_reported_and_stopped_from_its_velocity_alone(scenario, creep):
    cell = scenario.simulated("x").enabled()
    cell.lose("position", "demand")
    cell.run(1.0)
    cell.drive().dials.drift_velocity = creep * cell.scale_of("x")
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, 0.8)
    assert "moves without a command" in str(cell.x.error)
    assert "it moved by about" in str(cell.x.error)
    cell.until(lambda: cell.speed() == 0.0 and cell.stage() in OFF)


# -- jams ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("eds", [MODULE, "builtin:generic-cia402"])
@pytest.mark.parametrize("what", ["pp", "pv", "csp"])
def test_a_jam_during_a_move_is_reported_at_once_and_its_release_causes_no_leap(scenario, golden, eds, what):
    """Once the rotor was held, the demand ran away, and it leapt with 1100 deg/s when it came free."""
    more = (
        "" if eds == MODULE else "following_error = 15.0"
    )  # instead of the drive's own, which is two hundred degrees
    cell = scenario.simulated("x", eds=eds, axis=more).enabled()
    handle = going(cell, what)
    cell.jam()
    began = cell.now
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, limit=2.0)
    assert (
        cell.now - began < 0.25 + 4.0 / 60.0 + 0.6
    )  # the allowed lag, and the part that the model of a velocity forgets
    assert isinstance(cell.x.error, FollowingError)
    if eds == MODULE:
        golden(f"jam_{what}", cell.x.error)
    cell.run(3.0)
    moment = cell.free()
    cell.run(2.0)
    cell.must_not_leap(since=moment)
    assert not handle.busy


@pytest.mark.parametrize("way", ["stop", "halt", "disable", "quick_stop"])
@pytest.mark.parametrize("what", ["pp", "csp"])
def test_a_stop_on_a_jam_ends_with_nothing_that_pulls(scenario, way, what):
    """Once stop() and halt() were done at full torque, with the demand 93 deg away."""
    cell = scenario.simulated(
        "x", eds=MODULE, axis="following_error = 1000.0"
    ).enabled()  # no monitoring reports it before
    going(cell, what)
    cell.jam()
    cell.run(1.5)
    stopped = getattr(cell.x, way)()
    error = cell.end_of(stopped)
    moment = cell.free()
    cell.run(2.0)
    cell.must_not_leap(since=moment)
    if error is not None:
        assert "pulls it to a position" in error.observed
        assert cell.stage() in OFF


HOLDS = 'quick_stop = "ramp-hold"'
UNSEEN = {"inputs": {"demand": ValueTransport.NONE}}


@pytest.mark.parametrize("velocity", [200.0, -200.0])
@pytest.mark.parametrize("port", [None, UNSEEN], ids=["6062h", "no 6062h"])
def test_a_quick_stop_that_holds_leaves_an_axis_its_power_after_a_trajectory(scenario, port, velocity):
    """It brakes over 20 deg past its last target, which the drive ignores in quick stop active."""
    cell = scenario.simulated("x", port=port, axis="standstill_window = 0.5", stop=HOLDS).enabled()
    going(cell, "csp", velocity)
    moment, place = cell.moment(), cell.where()
    cell.x.quick_stop().wait(5)
    cell.run(2.0)
    assert abs(cell.where() - place) > 15.0
    assert (cell.x.state, cell.x.error, cell.stage()) == (AxisState.STOPPING, None, QUICK_STOP)
    assert cell.moment() - moment < 3.0


@pytest.mark.parametrize("late", [-0.3, 0.03, 0.06])
@pytest.mark.parametrize("port", [None, UNSEEN], ids=["6062h", "no 6062h"])
def test_a_quick_stop_that_holds_takes_the_power_of_an_axis_that_jams(scenario, port, late):
    """It jams ``late`` s after the quick stop began, and is pulled on to where the brake ends."""
    axis = "standstill_window = 0.5\nfollowing_error = 1000.0"
    cell = scenario.simulated("x", port=port, axis=axis, stop=HOLDS).enabled()
    going(cell, "csp", 200.0)
    if late < 0.0:
        cell.jam()
        cell.run(-late)
    stopped = cell.x.quick_stop()
    if late > 0.0:
        cell.run(late)
        cell.jam()
    error = cell.failure_of(stopped)
    assert "pulls it to a position" in error.observed
    assert cell.stage() in OFF
    moment = cell.free()
    cell.run(2.0)
    cell.must_not_leap(since=moment)


def test_a_stop_on_a_jam_reports_that_something_holds_the_axis(scenario, golden):
    cell = scenario.simulated("x", eds=MODULE, axis="following_error = 1000.0").enabled()
    going(cell, "pp")
    cell.jam()
    cell.run(1.5)
    golden("stop_on_a_jam", cell.failure_of(cell.x.stop()))


def test_a_reset_after_a_jam_leaves_nothing_that_pulls(scenario):
    """Once it leapt 123 deg after the time-out of its motion and a reset()."""
    cell = scenario.simulated("x", eds=MODULE, axis="following_error = 1000.0").enabled()
    handle = cell.x.move_relative(120.0, velocity=60.0)
    cell.run(0.5)
    cell.jam()
    cell.failure_of(handle, limit=15.0)
    cell.until(lambda: cell.core().stop_sequence is None)
    cell.x.reset().wait(5)
    cell.run(1.0)
    moment = cell.free()
    cell.run(2.0)
    cell.must_not_leap(since=moment)


@pytest.mark.parametrize("unseen", [("demand",), ("position", "demand")], ids=" and ".join)
@pytest.mark.parametrize("way", ["stop", "halt"])
def test_a_jam_at_a_velocity_without_feedback_of_the_pull_ends_without_power(scenario, way, unseen):
    """Halted in profile velocity mode, a drive may brake along a position, which then pulls on whatever holds the axis."""
    cell = scenario.simulated("x", axis="following_error = 1000.0").enabled()
    cell.lose(*unseen)
    going(cell, "pv", 300.0)
    cell.jam()
    cell.run(0.6)
    error = cell.failure_of(getattr(cell.x, way)())
    assert "it is not known whether its drive still pulls it" in str(error)
    moment = cell.free()
    cell.run(2.0)
    cell.must_not_leap(since=moment)
    assert cell.stage() in OFF


def test_a_jam_of_a_jog_without_feedback_of_the_pull_ends_without_power(scenario):
    cell = scenario.simulated("x", axis="following_error = 1000.0").enabled()
    cell.lose("demand")
    for number in range(12):
        cell.x.jog(300.0)
        cell.run(0.1)
        if number == 5:
            cell.jam()
    error = cell.failure_of(cell.x.halt())
    assert "it is not known whether its drive still pulls it" in str(error)
    assert cell.stage() in OFF


@pytest.mark.parametrize("way", ["stop", "halt"])
def test_a_jam_on_a_drive_without_6062h_ends_without_power(scenario, golden, way):
    port = {"inputs": {"demand": ValueTransport.NONE}}
    cell = scenario.simulated("x", port=port, axis="following_error = 1000.0").enabled()
    going(cell, "pp")
    cell.jam()
    cell.run(0.5)
    error = cell.failure_of(getattr(cell.x, way)())
    moment = cell.free()
    cell.run(2.0)
    cell.must_not_leap(since=moment)
    assert cell.stage() in OFF
    if way == "halt":
        golden("held_without_6062h", error)


@pytest.mark.parametrize("after", [0.05 * number for number in range(2, 20)])
@pytest.mark.parametrize("acceleration", [0.5, 4.0])
def test_a_halt_of_a_move_that_has_just_begun_is_not_taken_for_a_jam(scenario, acceleration, after):
    """The drive keeps its halt bit until it has the set-point, and the motion is so gentle that it begins like a standstill."""
    port = {"inputs": {"demand": ValueTransport.NONE}}
    cell = scenario.simulated("x", port=port, period="50ms", heartbeat="200ms").enabled()
    cell.x.move_relative(1000.0, velocity=300.0, acceleration=acceleration)
    cell.run(after)
    cell.x.halt().wait(5)
    assert cell.x.state is AxisState.STANDSTILL
    assert cell.stage() == ENABLED


SLOW = {  # starts of a motion that looks like a standstill, at a velocity in deg/s
    "pp": lambda x, velocity: x.move_relative(1000.0, velocity=velocity),
    "pv": lambda x, velocity: x.move_velocity(velocity),
    "pv, gently": lambda x, velocity: x.move_velocity(velocity, acceleration=0.5),
    "csv": lambda x, velocity: x.cyclic_velocity(velocity, acceleration=0.5),
}


@pytest.mark.parametrize("after", [0.4, 3.0])
@pytest.mark.parametrize("velocity", [0.05, 0.2])
@pytest.mark.parametrize("start", SLOW.values(), ids=list(SLOW))
def test_a_halt_of_a_slow_motion_is_not_taken_for_a_jam(scenario, start, velocity, after):
    cell = scenario.simulated("x", port={"inputs": {"demand": ValueTransport.NONE}}).enabled()
    start(cell.x, velocity)
    cell.run(after)
    cell.x.halt().wait(5)
    assert cell.x.state is AxisState.STANDSTILL
    assert cell.stage() == ENABLED


@pytest.mark.parametrize("velocity", [0.2, 1.0])
@pytest.mark.parametrize("start", [SLOW["pp"], SLOW["pv"]], ids=["pp", "pv"])
def test_a_jam_of_a_slow_motion_ends_without_power(scenario, start, velocity):
    port = {"inputs": {"demand": ValueTransport.NONE}}
    cell = scenario.simulated(
        "x", port=port, axis="following_error = 1000.0\nstandstill_window = 0.1"
    ).enabled()
    start(cell.x, velocity)
    cell.run(2.0)
    cell.jam()
    cell.run(2.0)
    error = cell.failure_of(cell.x.halt())
    assert "it is not known whether its drive still pulls it" in str(error)
    assert cell.stage() in OFF


def test_a_halt_on_a_drive_without_6062h_leaves_it_no_old_target(scenario):
    cell = scenario.simulated("x", port={"inputs": {"demand": ValueTransport.NONE}}).enabled()
    going(cell, "pp")
    cell.x.halt().wait(5)
    place, moment = cell.where(), cell.moment()
    cell.drive().dials.ignore_halt = True  # which would then continue to its target
    cell.run(3.0)
    assert cell.farthest(since=moment)[1] < place + 0.5
    assert cell.x.state is AxisState.STANDSTILL


def test_a_drive_whose_6062h_is_its_target_can_be_halted_and_does_not_trip(scenario):
    cell = scenario.simulated("x")
    drive = cell.drive()
    publish = drive._publish

    def published() -> None:
        publish()
        drive.position_demand = drive.target_position if int(drive.power.stage) == ENABLED else drive.position

    drive._publish = published
    cell.device().write(0x6065, 0, 0xFFFFFFFF)
    cell.enabled()
    going(cell, "pp")
    assert cell.x.state is AxisState.DISCRETE_MOTION
    cell.x.halt().wait(5)
    cell.must_be_still(within=0.1, stages=ENABLED)


def test_a_drive_without_6062h_that_takes_no_target_under_halt_is_reported(scenario):
    cell = scenario.simulated("x", port={"inputs": {"demand": ValueTransport.NONE}}).enabled()
    going(cell, "pp")
    cell.drive().dials.acknowledge_delay = NEVER
    error = cell.failure_of(cell.x.halt())
    assert "accepts no new target while it is halted" in error.observed
    assert cell.stage() in OFF


# -- lag that a drive may have -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lag", [0.002, 0.02, 0.1, 0.2])
@pytest.mark.parametrize("velocity", [3.0, 60.0, 300.0])
def test_a_drive_that_lags_trips_nothing(scenario, lag, velocity):
    def lagging():
        dictionary = eds.load(FILE)
        return {1: Device(dictionary, 1, params=replace(motor_from_eds(dictionary), lag=lag))}

    cell = scenario.simulated("x", devices=lagging).enabled()
    cell.device().write(0x6065, 0, 0xFFFFFFFF)
    cell.x.move_relative(velocity, velocity=velocity).wait(20)
    cell.x.move_velocity(velocity).wait(10)
    cell.run(2.0)
    cell.x.move_velocity(-velocity).wait(10)
    cell.run(1.0)
    cell.x.halt().wait(10)
    cell.x.follow(TrapezoidalTrajectory(cell.x.position, cell.x.position + velocity, velocity, 300.0)).wait(
        20
    )
    assert cell.x.state is AxisState.STANDSTILL


@pytest.mark.parametrize("velocity", [0.5, 1.0, 2.0, 60.0])
def test_a_slow_move_whose_drive_reports_a_wide_window_early_ends_well(scenario, velocity):
    cell = scenario.simulated("x", axis="position_window = 2.0").enabled()
    cell.device().write(0x6067, 0, 200)
    cell.x.move_relative(4.0, velocity=velocity).wait(20)
    cell.must_be_still(within=0.1, stages=ENABLED)
    assert cell.where() == pytest.approx(4.0, abs=0.1)


# -- the drive leaves its mode -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("to", [PV, PP])
def test_a_trajectory_whose_drive_leaves_csp_is_stopped_within_its_limits(scenario, golden, to):
    """Once csp fell to pv and ended 91 deg beyond the position limit."""
    cell = scenario.simulated("x", eds=MODULE, axis="position_limits = [-180.0, 180.0]").enabled()
    cell.x.home().wait(5)
    cell.x.follow(TrapezoidalTrajectory(cell.x.position, 150.0, 60.0, 720.0))
    cell.run(0.6)
    cell.drive().target_velocity = round(60.0 * 100)
    moment = slip(cell, to)
    cell.must_be_still(within=1.0, stages=OFF, for_good=3.0)
    assert cell.farthest(since=moment)[1] < 60.0
    assert isinstance(cell.x.error, ModeError)
    if to == PV:
        golden("mode_slips", cell.x.error)


@pytest.mark.parametrize("to", [PP, CSP])
def test_a_drive_that_leaves_pv_does_not_move_to_an_old_target(scenario, to):
    """Once 607Ah was that of 3 s and 90 deg ago, and the drive went there."""
    cell = scenario.simulated("x", eds=MODULE).enabled()
    cell.x.move_velocity(30.0)
    cell.run(3.0)
    place = cell.where()
    moment = slip(cell, to)
    cell.run(2.0)
    low, high = cell.farthest(since=moment)
    assert place - 1.0 < low < high < place + 5.0
    assert isinstance(cell.x.error, ModeError)


def test_a_mode_that_the_drive_has_not_left_yet_is_no_mode_error(scenario):
    cell = scenario.simulated("x").enabled()
    cell.drive().dials.mode_delay = 0.3
    cell.x.move_velocity(50.0).wait(5)
    cell.x.move_relative(10.0).wait(5)
    assert cell.x.state is AxisState.STANDSTILL


# -- at standstill -------------------------------------------------------------------------------------------------------


def test_a_halted_drive_that_continues_to_its_old_target_is_stopped_and_reported(scenario, golden):
    """Standstill was once reported while the drive continued to 150 deg."""
    cell = scenario.simulated("x", eds=MODULE).enabled()
    cell.x.move_relative(150.0)
    cell.run(0.6)
    cell.x.halt().wait(5)
    place = cell.where()
    moment = cell.moment()
    cell.drive().dials.ignore_halt = True
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP)
    cell.must_be_still(within=1.0, stages=OFF)
    assert cell.farthest(since=moment)[1] < place + 15.0
    assert isinstance(cell.x.error, UncommandedMotion)
    golden("moves_by_itself", cell.x.error)


def test_an_axis_that_is_held_at_standstill_by_something_else_is_reported(scenario):
    """A jammed axis with a distant demand would leap when freed. A move has proven the demand, so the jam is seen at standstill."""
    cell = scenario.simulated("x", eds=MODULE).enabled()
    cell.x.move_relative(30.0).wait(10)
    cell.run(0.5)
    cell.jam()
    cell.drive().axis.position += 30.0 * 100  # the demand for the motor
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP)
    assert "pulls it to another position" in cell.x.error.message
    cell.run(2.0)
    moment = cell.free()
    cell.run(1.0)
    cell.must_not_leap(since=moment)


def test_a_disabled_axis_may_be_turned_by_hand(scenario):
    cell = scenario.simulated("x").enabled()
    cell.x.disable().wait(5)
    cell.drive().axis.motor.velocity = 5_000.0
    cell.run(0.1)
    assert cell.x.state is AxisState.DISABLED
    assert cell.x.error is None
    cell.x.halt().wait(5)  # standstill was seen since its power was lost: there is nothing to stop


# -- enabling ------------------------------------------------------------------------------------------------------------


def coasting(cell, velocity: float = 200.0) -> None:
    """Let the motor turn without power, with next to no friction."""
    cell.drive().axis.motor.velocity = velocity * 100
    cell.drive().axis.motor._viscous = 0.0
    cell.drive().axis.motor.params = type(cell.drive().params)(friction=0.0)


def test_an_axis_that_moves_is_not_enabled(scenario, golden):
    cell = scenario.simulated("x")
    coasting(cell)
    moment = cell.moment()
    failed = cell.failure_of(cell.x.enable())
    assert isinstance(failed, StateError)
    golden("enable_while_moving", failed)
    assert not cell.was_energised(since=moment)


def test_an_axis_that_reaches_standstill_in_time_is_enabled_then(scenario):
    cell = scenario.simulated("x")
    cell.drive().axis.motor.velocity = 3_000.0  # its own friction brakes it
    moment = cell.moment()
    cell.x.enable().wait(10)
    energised = [sample for sample in cell.record().since(moment) if sample.stage == ENABLED]
    assert abs(energised[0].velocity) < 1.0
    assert cell.stage() == ENABLED


def test_a_moving_axis_is_enabled_with_allow_moving(scenario):
    cell = scenario.simulated("x")
    coasting(cell, 50.0)
    cell.x.enable(allow_moving=True).wait(10)
    cell.must_be_still(within=0.1, stages=ENABLED)


def test_a_drive_that_continues_to_its_old_target_when_enabled_is_stopped(scenario, golden):
    """A real foreign slave does: it said Standstill at 50 units/s, with exit code 0."""
    cell = scenario.simulated("x", eds=MODULE)
    drive, moment = cell.drive(), cell.moment()

    def run(dt: float) -> None:
        drive.axis.follow(drive.axis.position + 5_000.0 * dt, 5_000.0, dt)

    drive._run = run
    failed = cell.failure_of(cell.x.enable())
    assert isinstance(failed, UncommandedMotion)
    golden("moves_on_enable", failed)
    cell.must_be_still(within=2.0, stages=OFF)
    assert cell.farthest(since=moment)[1] < 15.0


def test_the_position_is_not_set_while_the_axis_moves(scenario):
    cell = scenario.simulated("x")
    coasting(cell, 100.0)
    cell.run(0.1)
    failed = cell.failure_of(cell.x.set_position(0.0))
    assert isinstance(failed, StateError)
    assert "still moving" in failed.observed
    assert not cell.x.homed


# -- off, and still moving -----------------------------------------------------------------------------------------------


def test_a_motor_that_turns_on_without_power_has_not_stopped(scenario, golden):
    """Seen on a foreign slave: reported stopped at 5 m/s."""
    cell = scenario.simulated("x", stop='quick_stop = "coast"\nquick_stop_time = "300ms"').enabled()
    cell.x.move_velocity(300.0).wait(5)
    cell.drive().axis.motor._viscous = 0.0
    cell.drive().axis.motor.params = type(cell.drive().params)(friction=0.0)
    failed = cell.failure_of(cell.x.quick_stop())
    assert cell.stage() == SWITCH_ON_DISABLED
    cell.must_move()
    golden("off_and_still_moving", failed)


def test_a_motor_that_runs_down_without_power_is_awaited(scenario):
    cell = scenario.simulated("x", stop='quick_stop = "coast"').enabled()
    cell.x.move_velocity(100.0).wait(5)
    cell.x.quick_stop().wait(10)
    assert cell.speed() == 0.0
    cell.must_be_still(within=0.1, stages=OFF)


# -- values older than the stop ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("timer", [0.1, 0.5])
def test_a_position_from_before_the_stop_does_not_count(scenario, timer):
    """Once an event-driven position half a second old, from before the motion, counted as standing."""
    port = {
        "inputs": {"position": ValueTransport.EVENT_PDO, "velocity": ValueTransport.NONE},
        "event_timer": timer,
    }
    cell = scenario.simulated("x", port=port | {"max_age": {"position": 3 * timer + 0.05}}).enabled()
    silence(cell, timer)
    cell.x.move_velocity(10.0)
    cell.run(0.15)
    cell.x.halt().wait(5)
    assert cell.speed() == 0.0
    cell.must_be_still(within=0.0, stages=ENABLED)


def silence(cell, timer: float) -> None:
    """Let the position be sent by its timer alone, and wait until it has just been."""
    port = cell.port()
    read = port.read
    last = {"at": cell.now, "sample": read(cell.now).position}

    def slow(now: float):
        inputs = read(now)
        if now - last["at"] >= timer - 1e-9:
            last.update(at=now, sample=inputs.position)
        return inputs._replace(position=last["sample"])

    port.read = slow
    cell.until(lambda: cell.now - last["at"] < 0.011)
    cell.run(2 * timer)


def test_a_stop_that_was_not_seen_by_a_position_has_a_note(scenario):
    cell = scenario.simulated("x").enabled()
    cell.x.move_velocity(50.0).wait(5)
    cell.lose("position", "demand")
    handle = cell.x.halt().wait(5)
    assert "velocity (606Ch) is 0" in handle.note
    assert "not known" in repr(handle)


@pytest.mark.parametrize("way", ["stop", "halt"])
def test_a_demand_from_before_the_jam_does_not_count(scenario, way):
    """6062h polled every quarter of a second: the last one is of when the axis still went along with it."""
    cell = scenario.simulated("x", eds=MODULE, port=POLLED_DEMAND, axis="following_error = 1000.0").enabled()
    going(cell, "pp")
    cell.until(lambda: cell.now - cell.core().image.demand_stamp < 0.011)
    cell.jam()
    cell.run(0.1)
    cell.end_of(getattr(cell.x, way)())
    moment = cell.free()
    cell.run(2.0)
    cell.must_not_leap(since=moment)


POLLED_DEMAND = {"inputs": {"demand": ValueTransport.SDO}, "max_age": {"demand": 0.8}, "sdo_poll": 0.25}


# -- in real time, over a bus --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["pp", "csp"])
def test_a_jam_on_a_bus_is_reported_and_its_release_causes_no_leap(scenario, what):
    cell = scenario.real("x", eds=MODULE, period="20ms", heartbeat="200ms").enabled()
    going(cell, what)
    cell.jam()
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, limit=10.0)
    assert isinstance(cell.x.error, FollowingError), cell.x.error
    cell.run(2.0)
    moment = cell.free()
    cell.run(1.0)
    cell.must_not_leap(since=moment)


def test_a_halted_drive_on_a_bus_that_continues_is_stopped(scenario):
    cell = scenario.real("x", eds=MODULE, period="20ms", heartbeat="200ms").enabled()
    cell.x.move_relative(150.0, velocity=60.0)
    cell.run(0.6)
    cell.x.halt().wait(5)
    place, moment = cell.where(), cell.moment()
    cell.drive().dials.ignore_halt = True
    cell.until(lambda: cell.x.state is AxisState.ERRORSTOP, limit=10.0)
    cell.must_be_still(within=4.0, stages=OFF)
    assert cell.farthest(since=moment)[1] < place + 40.0
    assert isinstance(cell.x.error, UncommandedMotion), cell.x.error


@pytest.mark.parametrize("cycles", range(-2, 8))
def test_a_halt_at_the_turning_point_of_a_move_ends_well(tmp_path, cycles):
    """The axis stands for a moment in the middle of a motion, as if something held it, and no demand value shows the opposite."""
    text = cell_text("x", axis='demand = "ignore"').replace("acceleration = 500.0", "acceleration = 15.0")
    (tmp_path / "cell.toml").write_text(text, encoding="utf-8")
    with simulate(tmp_path / "cell.toml") as simulation:
        x, drive = simulation.machine["x"], simulation.drive("x")
        x.enable().wait(5)
        x.move_absolute(300.0, velocity=10.0)
        simulation.machine.sleep(2.0)
        x.move_absolute(-300.0, velocity=10.0)
        simulation.machine.sleep(0.3)
        while drive.axis.motor.velocity > -15.0 * 0.01 * cycles * 100:
            simulation.machine.sleep(0.01)
        assert x.halt().wait(10).error is None
        assert x.state is AxisState.STANDSTILL
