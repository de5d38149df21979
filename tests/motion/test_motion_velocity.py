"""Moves at a velocity and jogging: sign, ramps, the condition of reached, limits during the move, and the short life of a jog."""

from __future__ import annotations

from dataclasses import replace

import pytest

from axisbus.cia402.port import ValueTransport
from axisbus.errors import (
    ArgumentError,
    FollowingError,
    LimitError,
    MotionTimeout,
    Replaced,
    StateError,
    Stopped,
)
from axisbus.motion.parameters import AxisLimits, HomingParameters, Units
from axisbus.motion.states import AxisState
from axisbus.sim.motor import MotorParams
from axisbus.units import Scale
from kit.motion.plant_recorder import HALT, Watch
from kit.motion.rig import BLIND, PERIOD, rig

DEGREES = Units(Scale.of(1000, "deg"), Scale.of(1000, "deg/s"), Scale.of(1000, "deg/s²"), ratio_known=True)
RPM = MotorParams(velocity_unit=60 / 360_000, acceleration_unit=1.0)  # 360 000 increments per turn
IN_RPM = Units(Scale.of(1000, "deg"), Scale.of(60 / 360, "deg/s"), Scale.of(1000, "deg/s²"), ratio_known=True)


def speed(r) -> float:
    """The motor's velocity in degrees per second."""
    return r.drive.axis.motor.velocity / 1000


def ramp_time(watch: Watch, goal: float) -> float:
    """Seconds from the last row at the first velocity to the first row within 1 % of the goal (increments/s)."""
    first = watch.rows[0].velocity
    began = (
        next(row.t for row in watch.rows if abs(row.velocity - first) > 0.002 * abs(goal - first)) - PERIOD
    )
    return next(row.t for row in watch.rows if abs(row.velocity - goal) <= 0.01 * abs(goal - first)) - began


# Moving at a velocity.


@pytest.mark.parametrize("by", [ValueTransport.SYNC_PDO, ValueTransport.SDO])
@pytest.mark.parametrize("ramping", [True, False])
def test_an_override_of_0_holds_a_turning_axis_and_ends_nothing(ramping, by):
    """The drive takes the new velocity some cycles after the command; its distance in them is no following error."""
    r = rig(port={"outputs": {"target_velocity": by}, "sdo_time": 0.05}, standstill_window=500).enabled()
    r.axis.move_velocity(30.0).wait(5)
    r.axis.move_velocity(200.0, acceleration=300.0)
    r.run(0.3 if ramping else 2.0)
    r.core.set_override(cell=0.0)
    r.run(4.0)
    assert r.axis.error is None
    assert r.core.image.standstill
    r.core.set_override(cell=1.0)
    r.run(2.0)
    assert speed(r) == pytest.approx(200.0, rel=0.01)
    r.drive.dials.blocked = True
    r.run(1.0)
    assert isinstance(r.axis.error, FollowingError)


@pytest.mark.parametrize("velocity", [200.0, -200.0])
def test_the_velocity_is_reached_after_the_time_of_its_ramp_and_kept(velocity):
    r = rig().enabled()
    watch = Watch(r)
    r.axis.move_velocity(velocity, acceleration=100.0).wait(5)
    assert r.axis.state is AxisState.CONTINUOUS_MOTION
    r.run(1.0)
    # 200 / 100 = 2 s; rows are a period apart, and the goal is met at 99 %
    assert ramp_time(watch, velocity * 1000) == pytest.approx(2.0, rel=0.02)
    assert watch.acceleration(5) == pytest.approx(100_000, rel=0.02)
    r.run(5.0)
    assert speed(r) == pytest.approx(velocity, rel=0.001)
    assert r.axis.velocity == pytest.approx(velocity, rel=0.001)
    assert watch.words == [0x0F]
    assert watch.modes[-1] == 3


def test_the_handle_is_done_when_the_velocity_is_reached_not_before():
    r = rig().enabled()
    handle = r.axis.move_velocity(200.0, acceleration=100.0)
    r.until(lambda: speed(r) > 150.0)
    assert handle.active
    handle.wait(2)
    assert speed(r) >= 0.95 * 200.0


def test_objects_written_before_a_velocity_move():
    r = rig().enabled()
    watch = Watch(r)
    r.axis.move_velocity(-70.0, acceleration=300.0, deceleration=200.0).wait(5)
    assert watch.writes == [(0x6083, 0, 300_000), (0x6084, 0, 200_000)]
    assert {item.outputs.target_velocity for item in watch.sent} == {0, -70_000}


def test_a_new_velocity_takes_over_on_its_own_ramp_through_zero():
    r = rig().enabled()
    first = r.axis.move_velocity(100.0)
    first.wait(2)
    watch = Watch(r)
    r.axis.move_velocity(-100.0, acceleration=250.0).wait(5)
    # 6084h down to zero, 6083h up again: both 250 deg/s², 200 / 250 = 0.8 s
    assert ramp_time(watch, -100_000) == pytest.approx(0.8, rel=0.03)
    assert watch.acceleration() <= 250_000 * 1.05
    assert first.done


def test_a_running_velocity_is_replaced_and_its_handle_names_the_new_command():
    r = rig().enabled()
    first = r.axis.move_velocity(300.0, acceleration=100.0)
    r.run(0.3)
    r.axis.move_velocity(10.0).wait(5)
    with pytest.raises(Replaced, match=r"move_velocity\(10 deg/s\)"):
        first.wait()


def test_a_move_to_a_position_takes_over_from_a_velocity_without_a_jolt():
    r = rig().enabled()
    r.axis.move_velocity(100.0).wait(2)
    watch = Watch(r)
    r.axis.move_absolute(200.0).wait(5)
    r.run(0.2)
    assert r.drive.position == 200_000
    assert watch.acceleration() <= 500_000 * 1.05


def test_velocity_zero_brakes_and_stays_in_continuous_motion():
    r = rig().enabled()
    r.axis.move_velocity(100.0).wait(2)
    r.axis.move_velocity(0.0).wait(2)
    r.run(0.2)
    assert speed(r) == 0.0
    assert r.axis.state is AxisState.CONTINUOUS_MOTION


def test_halt_brakes_with_the_move_s_deceleration_and_a_new_velocity_continues_from_there():
    r = rig().enabled()
    r.axis.move_velocity(100.0, deceleration=200.0).wait(2)
    watch = Watch(r)
    r.axis.halt().wait(3)
    begin, end = watch.moving()
    assert end - begin == pytest.approx(100 / 200, abs=0.05)
    assert r.axis.state is AxisState.STANDSTILL
    assert watch.words[-1] == 0x0F | HALT
    r.run(0.5)
    watch.forget()
    r.axis.move_velocity(50.0).wait(2)
    assert watch.words[-1] == 0x0F
    assert watch.travel[0] >= watch.rows[0].position  # not a moment backwards, nor at the old velocity
    assert watch.speed <= 50_000 * 1.01


# The condition of reached.


def test_a_drive_that_counts_in_rpm_is_not_at_its_velocity_before_it_turns():
    """At 2 rpm a tolerance of some increments of velocity would be the whole of it."""
    r = rig(units=IN_RPM, motor=RPM).enabled()
    handle = r.axis.move_velocity(12.0, acceleration=10.0)  # 2 rpm, in 1.2 s
    r.until(lambda: not handle.busy)
    assert speed(r) >= 5.0


def test_a_noisy_velocity_is_reached_when_the_drive_reports_it():
    r = rig().enabled()
    read = r.ports["x"].read
    noise = [0, 70, -80, 90, -60, 75]

    def noisy(now):
        inputs = read(now)
        wrong = noise[round(now / PERIOD) % len(noise)]
        if inputs.velocity is None:
            return inputs
        return inputs._replace(velocity=inputs.velocity._replace(value=inputs.velocity.value + wrong))

    r.ports["x"].read = noisy
    r.axis.move_velocity(0.2).wait(1)  # 200 increments/s, and up to 90 of noise
    assert speed(r) == pytest.approx(0.2, abs=0.05)


def test_a_bit_10_from_the_velocity_before_does_not_count():
    r = rig(port={"inputs": {"velocity": ValueTransport.NONE}}).enabled()
    r.axis.move_velocity(100.0).wait(3)
    r.device.write(0x606E, 0, 0)
    r.axis.move_velocity(300.0, acceleration=200.0).wait(3)
    assert speed(r) > 250.0


def test_a_bit_10_without_motion_does_not_confirm_a_velocity():
    r = rig(following_error=BLIND).enabled()
    r.device.write(0x606D, 0, 0xFFFF)  # a window as wide as the velocity
    r.drive.dials.blocked = True
    with pytest.raises(MotionTimeout):
        r.axis.move_velocity(50.0).wait(10)


def test_a_blocked_motor_misses_its_velocity_in_time_and_the_axis_is_halted():
    r = rig(following_error=BLIND).enabled()
    r.drive.dials.blocked = True
    start = r.now
    with pytest.raises(MotionTimeout, match="has not reached 100 deg/s") as caught:
        r.axis.move_velocity(100.0).wait(10)
    # four times its ramp of 0.2 s, and 2 s
    assert r.now - start == pytest.approx(2.8, abs=0.1)
    assert "velocity 0 deg/s" in caught.value.observed
    assert r.axis.state is AxisState.ERRORSTOP
    r.run(0.3)
    assert r.drive.controlword & HALT


@pytest.mark.parametrize("velocity", [10.0, -10.0, 0.0])
def test_the_ramp_from_the_velocity_before_counts_into_the_deadline(velocity):
    """From 400 deg/s at 100 deg/s² it takes four seconds, however slow the new velocity is."""
    r = rig().enabled()
    r.axis.move_velocity(400.0).wait(5)
    r.axis.move_velocity(velocity, acceleration=100.0).wait(20)
    assert speed(r) == pytest.approx(velocity, abs=0.6)


def test_the_caller_s_timeout_replaces_the_deadline():
    r = rig().enabled()
    start = r.now
    with pytest.raises(MotionTimeout):
        r.axis.move_velocity(100.0, acceleration=10.0, timeout=0.5).wait(10)
    assert r.now - start == pytest.approx(0.5, abs=0.1)


# Limits during a move.


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_turning_axis_brakes_in_time_before_its_position_limits(direction):
    r = rig(limits=AxisLimits(position=(-90.0, 90.0), velocity=400.0)).enabled()
    watch = Watch(r)
    r.axis.move_velocity(direction * 200.0).wait(2)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP)
    r.until(lambda: r.core.stop_sequence is None)
    farthest = max(abs(side) for side in watch.travel) / 1000
    assert 70.0 < farthest <= 90.0
    assert isinstance(r.axis.error, LimitError)
    assert "about to leave its position limits" in str(r.axis.error)
    r.axis.reset().wait(1)
    r.axis.move_velocity(direction * -50.0).wait(2)  # away from the limit: allowed
    r.run(0.5)
    assert r.axis.state is AxisState.CONTINUOUS_MOTION


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("move", ["move_velocity", "cyclic_velocity"])
def test_an_override_that_would_exceed_a_limit_is_an_error_before_it_is_sent(move, direction):
    r = rig(limits=AxisLimits(position=(-90.0, 90.0), velocity=400.0)).enabled()
    r.core.set_override(cell=0.05)
    getattr(r.axis, move)(direction * 200.0)
    r.until(lambda: abs(r.drive.axis.motor.position) > 88_500.0)
    asked = abs(r.drive.target_velocity)
    r.core.set_override(cell=1.0)
    r.run(PERIOD)
    assert isinstance(r.axis.error, LimitError)
    assert abs(r.drive.target_velocity) <= asked


def test_a_lag_that_no_demand_shows_is_braked_for_in_time():
    lags = MotorParams(lag=0.12)
    r = rig(limits=AxisLimits(position=(-90.0, 90.0), velocity=400.0), motor=lags)
    r.drive.dials.demand_frozen = True
    r.enabled()
    watch = Watch(r)
    r.axis.move_velocity(100.0)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP)
    r.until(lambda: r.core.stop_sequence is None)
    assert isinstance(r.axis.error, LimitError)
    assert 80.0 < watch.travel[1] / 1000 <= 90.2


def test_a_gentle_ramp_is_counted_as_gentle_as_it_is():
    """200 deg/s at 100 deg/s² need 200 deg, whatever the defaults of the axis say (500 deg/s²)."""
    r = rig(limits=AxisLimits(position=(-600.0, 600.0), velocity=400.0)).enabled()
    watch = Watch(r)
    r.axis.move_velocity(200.0, acceleration=100.0).wait(5)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP)
    r.until(lambda: r.core.stop_sequence is None)
    assert 580.0 < watch.travel[1] / 1000 <= 600.0


@pytest.mark.parametrize("late", [0.5, 0.8, 3.2])
def test_a_frame_that_was_taken_late_from_the_adapter_is_no_overspeed(late):
    """Late by ``late`` periods, with SYNCs left out meanwhile: the next position comes a moment later and far away."""
    r = rig(limits=AxisLimits(position=(-1000.0, 1000.0), velocity=120.0)).enabled()
    r.axis.move_velocity(100.0).wait(3)
    port = r.ports["x"]
    read, frozen = port.read, []

    def jittery(now):
        inputs = read(now)
        number = round(now / PERIOD) % 20
        if number < 1 + int(late):  # nothing new: the receive thread does not run
            return inputs._replace(position=frozen[-1])
        sample = inputs.position
        if number == 1 + int(late):  # and now it stamps an old position with the present time
            sample = frozen[-1]._replace(
                value=frozen[-1].value + 1_000, stamp=sample.stamp + (late % 1) * PERIOD
            )
        frozen.append(sample)
        return inputs._replace(position=sample)

    for _ in range(40):
        frozen.append(read(r.now).position)
        if round(r.now / PERIOD) % 20 == 10:
            break
        r.run(PERIOD)
    port.read = jittery
    r.run(3.0)
    assert r.axis.error is None
    assert r.axis.state is AxisState.CONTINUOUS_MOTION


def test_an_axis_outside_its_limits_may_turn_back_but_not_farther_out():
    r = rig(
        limits=AxisLimits(position=(-90.0, 90.0), velocity=400.0), motor=MotorParams(start_position=120_000.0)
    ).enabled()
    r.axis.move_velocity(-20.0).wait(2)
    r.run(0.5)
    assert r.axis.state is AxisState.CONTINUOUS_MOTION
    r.axis.move_velocity(20.0)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP)


def test_a_velocity_that_is_no_number_or_has_no_ramp_raises_at_the_call():
    r = rig().enabled()
    for wrong in (float("nan"), float("inf"), "fast"):
        with pytest.raises(ArgumentError):
            r.axis.move_velocity(wrong)
    with pytest.raises(ArgumentError):
        r.axis.move_velocity(10.0, acceleration=0.0)
    with pytest.raises(LimitError):
        r.axis.move_velocity(400.1)
    huge = rig(limits=AxisLimits()).enabled()
    with pytest.raises(ArgumentError, match="60FFh"):
        huge.axis.move_velocity(3e6)  # 3e9 increments/s: more than INTEGER32


def test_a_disabled_axis_takes_no_velocity():
    r = rig()
    with pytest.raises(StateError, match="Disabled"):
        r.axis.move_velocity(10.0).wait(1)
    assert r.drive.target_velocity == 0


# Jogging.


def test_a_jog_lasts_200_ms_and_then_halts():
    r = rig().enabled()
    watch = Watch(r)
    handle = r.axis.jog(50.0, acceleration=2000.0)
    start = r.now
    r.until(lambda: r.core.stop_sequence is not None)
    assert r.now - start == pytest.approx(0.2, abs=3 * PERIOD)
    r.until(lambda: r.axis.state is AxisState.STANDSTILL)
    assert handle.done
    assert r.axis.error is None
    # at most 0.2 s at 50 deg/s, and the ramps
    assert 4_000 < watch.displacement < 11_000
    assert watch.words[-1] == 0x0F | HALT
    r.run(1.0)
    assert speed(r) == 0.0


def test_a_jog_that_is_renewed_continues_without_being_sent_again():
    r = rig().enabled()
    r.axis.jog(50.0)
    r.run(0.1)
    watch = Watch(r)
    for _ in range(20):
        assert r.axis.jog(50.0) is not None
        r.run(0.1)
    assert speed(r) == pytest.approx(50.0, rel=0.01)
    assert watch.words == [0x0F]
    assert watch.writes == []
    r.until(lambda: r.axis.state is AxisState.STANDSTILL, 1.0)
    assert speed(r) == 0.0


def test_a_jog_with_another_velocity_takes_over():
    r = rig().enabled()
    r.axis.jog(50.0)
    r.run(0.1)
    watch = Watch(r)
    for _ in range(8):
        r.axis.jog(-30.0)
        r.run(0.1)
    assert speed(r) == pytest.approx(-30.0, rel=0.01)
    assert watch.acceleration() <= 500_000 * 1.05
    r.until(lambda: r.axis.state is AxisState.STANDSTILL, 1.0)


def test_a_jog_that_has_ended_begins_again_and_each_renewal_ends_well():
    r = rig().enabled()
    r.axis.jog(50.0)
    r.until(lambda: r.axis.state is AxisState.STANDSTILL, 2.0)
    handle = r.axis.jog(50.0)
    r.run(0.1)
    again = r.axis.jog(50.0)
    r.run(PERIOD)
    assert again.done
    r.run(0.1)
    assert handle.done
    assert speed(r) == pytest.approx(50.0, rel=0.01)


def test_a_jog_too_short_to_reach_its_velocity_ends_as_stopped_by_its_own_rule():
    r = rig().enabled()
    handle = r.axis.jog(400.0, acceleration=100.0)
    with pytest.raises(Stopped, match="jog was not renewed"):
        handle.wait(2)
    assert handle.aborted
    r.until(lambda: r.axis.state is AxisState.STANDSTILL, 3.0)
    assert r.axis.error is None


def test_a_jog_may_interrupt_a_halt_and_a_halt_a_jog():
    r = rig().enabled()
    r.axis.move_velocity(200.0).wait(2)
    halt = r.axis.halt()
    r.run(0.05)
    r.axis.jog(50.0)
    r.run(0.1)
    assert isinstance(halt.exception(), Replaced)
    r.axis.halt().wait(2)
    assert r.axis.state is AxisState.STANDSTILL
    r.run(0.5)
    assert speed(r) == 0.0


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("speed", [50.0, 300.0])
def test_a_jog_stops_ahead_of_a_position_limit_and_the_axis_can_be_jogged_back(way, speed):
    r = rig(limits=AxisLimits(position=(-90.0, 90.0), velocity=400.0)).enabled()
    seen = Watch(r)
    for _ in range(60):
        r.axis.jog(way * speed)
        r.run(0.1)
        assert r.axis.state in (AxisState.CONTINUOUS_MOTION, AxisState.STANDSTILL)
    r.until(lambda: r.axis.state is AxisState.STANDSTILL, 1.0)
    assert r.axis.error is None
    assert 80.0 < way * r.axis.position <= 90.0
    assert max(abs(row.position) for row in seen.rows) <= 90_000
    r.axis.jog(-way * speed)
    r.run(0.15)
    assert way * r.axis.position < 89.0
    r.until(lambda: r.axis.state is AxisState.STANDSTILL, 1.0)


def test_a_jog_that_ends_at_a_limit_before_it_has_its_velocity_gives_the_reason():
    r = rig(limits=AxisLimits(position=(-90.0, 90.0), velocity=400.0)).enabled()
    r.axis.move_absolute(85.0).wait(3)
    handle = r.axis.jog(390.0)
    r.run(0.15)
    assert isinstance(handle.exception(), LimitError)
    assert r.axis.error is None
    assert r.axis.position <= 90.0


def test_before_homing_an_axis_can_be_jogged_and_its_limits_promise_nothing():
    """An incremental encoder counts from wherever it woke up: limits around that number would lock the axis in."""
    r = rig(
        limits=AxisLimits(position=(-10.0, 10.0), velocity=400.0),
        homing=HomingParameters(method=37, required=True),
        motor=MotorParams(start_position=500_000.0),
    ).enabled()
    for _ in range(5):
        r.axis.jog(50.0)
        r.run(0.1)
    assert speed(r) == pytest.approx(50.0, rel=0.01)
    r.until(lambda: r.axis.state is AxisState.STANDSTILL, 1.0)
    r.axis.move_relative(5.0).wait(2)
    r.axis.home().wait(2)
    with pytest.raises(LimitError):
        r.axis.move_relative(11.0).wait(2)  # from here on they hold
    r.axis.move_velocity(50.0).wait(2)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP, 2.0)


def test_the_velocity_limit_holds_before_homing_too():
    r = rig(
        limits=AxisLimits(position=(-10.0, 10.0), velocity=40.0),
        homing=HomingParameters(method=37, required=True),
    )
    r.enabled()
    with pytest.raises(LimitError):
        r.axis.jog(50.0)


def test_an_endless_axis_turns_without_end():
    r = rig(units=replace(DEGREES, modulo=360.0)).enabled()
    r.axis.move_velocity(400.0).wait(3)
    r.run(10.0)
    assert 0.0 <= r.axis.position < 360.0
    assert r.drive.axis.motor.position > 3_600_000
