"""Torque control: its slope, its limit, protection against a runaway, and its stop."""

from __future__ import annotations

from dataclasses import replace

import pytest

from axisbus.cia402.port import ValueTransport
from axisbus.errors import ArgumentError, DriveError, LimitError, MotionTimeout, Stopped
from axisbus.motion.parameters import AxisLimits, Defaults, HoldsLoad, Units
from axisbus.motion.states import AxisState
from axisbus.sim.motor import MotorParams
from axisbus.units import Scale
from kit.motion.plant_recorder import Watch
from kit.motion.rig import rig

# Rated torque is 10 N·m; friction 2 % of it, and viscous friction that stops the axis in some seconds.
FREE = MotorParams(friction=20.0, rated_acceleration=200_000.0, coasting=1.0)


def torques(watch: Watch) -> list[float]:
    return [row.torque for row in watch.rows]


def test_a_torque_rises_on_its_slope_and_is_kept():
    r = rig(motor=FREE, limits=AxisLimits()).enabled()
    watch = Watch(r)
    r.axis.torque_control(2.0, slope=4.0).wait(3)
    r.run(0.5)
    values = torques(watch)
    began = next(number for number, value in enumerate(values) if value > 1.0)
    reached = next(number for number, value in enumerate(values) if value >= 199.0)
    # 2 N·m at 4 N·m/s: 0.5 s
    assert watch.rows[reached].t - watch.rows[began].t == pytest.approx(0.5, abs=0.03)
    assert values[-1] == pytest.approx(200.0)  # 20 % of rated torque
    assert watch.writes == [(0x6087, 0, 400)]
    assert r.axis.state is AxisState.CONTINUOUS_MOTION
    assert r.axis.torque == pytest.approx(2.0, rel=0.02)


def test_the_handle_is_done_when_the_torque_is_there():
    r = rig(motor=FREE, limits=AxisLimits()).enabled()
    start = r.now
    r.axis.torque_control(-1.0, slope=2.0).wait(3)
    assert 0.45 <= r.now - start <= 0.7
    assert r.drive.torque == pytest.approx(-100, abs=11)


def test_a_small_torque_is_not_there_before_it_acts():
    """0.08 N·m are 8 per mille: within the tolerance of nothing at all."""
    r = rig(motor=FREE, limits=AxisLimits()).enabled()
    r.axis.torque_control(0.08, slope=0.1).wait(3)
    assert r.drive.torque >= 5


def test_without_a_slope_the_default_counts_and_without_that_the_drive_s_own():
    r = rig(motor=FREE, limits=AxisLimits(), defaults=Defaults(torque_slope=3.0)).enabled()
    watch = Watch(r)
    r.axis.torque_control(0.5).wait(3)
    assert watch.writes == [(0x6087, 0, 300)]
    r = rig(motor=FREE, limits=AxisLimits(), defaults=Defaults()).enabled()
    watch = Watch(r)
    r.axis.torque_control(0.5)
    r.run(0.5)
    assert watch.writes == []


def test_a_torque_is_signed_and_another_takes_over():
    r = rig(motor=FREE, limits=AxisLimits()).enabled()
    r.axis.torque_control(1.0, slope=10.0).wait(3)
    assert r.drive.axis.motor.velocity > 0
    r.axis.torque_control(-1.0, slope=10.0).wait(3)
    r.run(1.0)
    assert r.drive.axis.motor.velocity < 0
    assert r.drive.torque == -100


def test_a_torque_beyond_the_limit_or_without_a_unit_raises_at_the_call():
    r = rig(limits=AxisLimits(torque=5.0)).enabled()
    with pytest.raises(LimitError, match="max_torque is 5"):
        r.axis.torque_control(5.1)
    with pytest.raises(ArgumentError):
        r.axis.torque_control(float("nan"))
    with pytest.raises(ArgumentError):
        r.axis.torque_control(1.0, slope=-1.0)
    units = replace(r.core.parameters.units, rated_torque=None)
    with pytest.raises(ArgumentError, match="rated_torque is missing"):
        rig(units=units).axis.torque_control(1.0)
    with pytest.raises(ArgumentError, match="6071h"):
        rig(limits=AxisLimits()).axis.torque_control(400.0)  # 40 times rated: 40 000 per mille


def test_a_load_that_yields_is_stopped_at_the_velocity_limit():
    """Without the friction, 20 % of torque runs away: only max_velocity stops it."""
    r = rig(motor=FREE, limits=AxisLimits(velocity=20.0)).enabled()
    watch = Watch(r)
    r.axis.torque_control(3.0, slope=100.0)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP, 5.0)
    assert isinstance(r.axis.error, LimitError)
    assert "faster than max_velocity" in r.axis.error.message
    r.until(lambda: r.core.stop_sequence is None)
    assert watch.speed <= 20_000 * 1.5
    assert abs(r.drive.axis.motor.velocity) < 1.0


def test_a_torque_axis_is_stopped_ahead_of_its_position_limits():
    r = rig(
        motor=FREE,
        limits=AxisLimits(position=(-50.0, 50.0)),
        defaults=Defaults(velocity=10.0, acceleration=100.0),
    ).enabled()
    r.axis.torque_control(1.0, slope=100.0)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP, 5.0)
    assert "position limits" in r.axis.error.message
    assert r.axis.position < 50.0


TORQUES = {
    "tq": lambda r, torque: r.axis.torque_control(torque, slope=100.0),
    "cst": lambda r, torque: r.axis.cyclic_torque(torque, slope=100.0),
}


def pushed_out(by: str, side: float):
    """An axis at rest beyond its limit of 50 deg on one side, where a torque has moved it; and how far."""
    r = rig(
        motor=replace(FREE, start_position=side * 49_990.0, rated_acceleration=1_000_000.0),
        limits=AxisLimits(position=(-50.0, 50.0)),
        defaults=Defaults(velocity=10.0, acceleration=100.0),
    ).enabled()
    TORQUES[by](r, side * 5.0)
    r.until(lambda: r.axis.state is AxisState.ERRORSTOP, 5.0)
    r.until(lambda: r.core.stop_sequence is None and r.core.image.standstill)
    out = side * r.axis.position
    assert out > 50.1
    r.axis.reset().wait(3)
    if not r.axis.enabled:
        r.axis.enable().wait(3)
    return r, out


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("by", TORQUES)
def test_a_torque_that_has_moved_an_axis_out_of_its_limits_is_not_repeated(by, side):
    r, out = pushed_out(by, side)
    for way in TORQUES.values():
        with pytest.raises(
            LimitError, match="is beyond its position limits, and a torque has moved it there"
        ):
            way(r, side * 0.3).wait(3)
        assert r.axis.state is AxisState.STANDSTILL
    assert side * r.axis.position == pytest.approx(out, abs=0.005)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("by", TORQUES)
def test_an_axis_that_a_torque_has_moved_out_returns_by_a_torque_and_is_braked_by_one(by, side):
    r, out = pushed_out(by, side)
    TORQUES[by](r, side * -1.0)
    r.until(lambda: side * r.axis.velocity < -2.0)
    assert 50.05 < side * r.axis.position < out
    TORQUES[by](r, side * 0.1)  # brakes it
    r.run(0.02)
    assert r.axis.error is None
    TORQUES[by](r, side * -1.0)
    r.until(lambda: side * r.axis.position < 30.0)
    r.axis.halt().wait(5)
    TORQUES[by](r, side * 0.3).wait(3)  # from inside it is accepted again


def test_a_torque_that_is_not_reached_in_the_caller_s_time_fails():
    r = rig(motor=FREE, limits=AxisLimits()).enabled()
    r.device.write(0x6072, 0, 50)  # 5 % is all that the drive gives
    start = r.now
    with pytest.raises(MotionTimeout, match="has not reached 20 % of rated torque") as caught:
        r.axis.torque_control(2.0, slope=100.0, timeout=0.6).wait(5)
    assert r.now - start == pytest.approx(0.65, abs=0.1)
    assert "torque 5 %" in caught.value.observed
    assert r.axis.state is AxisState.ERRORSTOP


def test_a_drive_without_torque_feedback_reaches_its_torque_by_bit_10():
    r = rig(motor=FREE, limits=AxisLimits(), port={"inputs": {"torque": ValueTransport.NONE}}).enabled()
    r.axis.torque_control(1.0, slope=2.0).wait(3)
    assert r.drive.axis.torque_demand == pytest.approx(100.0)


def test_halt_removes_the_torque_and_the_axis_stops():
    r = rig(motor=FREE, limits=AxisLimits()).enabled()
    handle = r.axis.torque_control(1.0, slope=100.0)
    handle.wait(2)
    r.run(0.5)
    r.axis.halt().wait(5)
    assert handle.done
    assert r.drive.torque == 0
    assert abs(r.drive.axis.motor.velocity) < 1.0
    assert r.axis.state is AxisState.STANDSTILL


def test_an_axis_that_holds_a_load_is_halted_in_a_mode_that_holds():
    """A torque of 0 would drop it: 30 % of rated torque hold this load."""
    load = MotorParams(load=300.0, friction=20.0, rated_acceleration=200_000.0, coasting=1.0)
    r = rig(motor=load, limits=AxisLimits(), holds_load=HoldsLoad.TORQUE)
    r.drive.start_enabled(1)
    r.run(0.2)
    r.axis.enable().wait(2)
    handle = r.axis.torque_control(3.5, slope=1000.0)
    r.run(0.5)
    watch = Watch(r)
    r.axis.halt().wait(5)
    assert watch.modes == [1]
    here = r.drive.axis.motor.position
    r.run(2.0)
    assert r.drive.axis.motor.position == pytest.approx(here, abs=5)
    assert handle.done or isinstance(handle.exception(), Stopped)


def test_a_torque_slope_that_the_drive_refuses_fails_before_any_torque():
    r = rig(motor=FREE, limits=AxisLimits()).enabled()
    r.device.dials.sdo_write_aborts[0x6087, 0] = 0x06090030
    watch = Watch(r)
    with pytest.raises(DriveError, match="6087h"):
        r.axis.torque_control(1.0, slope=1.0).wait(3)
    assert watch.displacement < 1.0
    assert max(map(abs, torques(watch))) == 0.0


@pytest.mark.parametrize(
    ("factor", "rated", "read"),
    [(1000.0, 10.0, 3.0), (-1000.0, -10.0, -3.0), (1000.0, None, 0.3), (-1000.0, None, -0.3)],
)
def test_the_sign_of_the_actual_torque_follows_the_direction_of_the_axis(factor, rated, read):
    """300 in 6077h are 3 N·m of 10; without a rated torque, 0.3 of it: in the direction in which the axis counts."""
    units = Units(
        Scale.of(factor, "deg"),
        Scale.of(factor, "deg/s"),
        Scale.of(abs(factor), "deg/s²"),
        ratio_known=True,
        rated_torque=rated,
    )
    r = rig(units=units, motor=MotorParams(load=300.0), limits=AxisLimits())
    r.drive.start_enabled(1)
    r.run(0.3)
    assert r.core.snapshot().torque == 300
    assert r.axis.torque == pytest.approx(read)
