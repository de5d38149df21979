"""The ramps of csv and cst alone, and their arguments."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from axisbus.cia402.controlword import HALT
from axisbus.errors import ArgumentError, LimitError, StateError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.cyclic.ramps import TorqueRamp, VelocityRamp, next_velocity
from axisbus.motion.parameters import AxisLimits, Units
from axisbus.motion.stop.limits import stop_of
from axisbus.motion.stop.stop_sequence import StopLevel
from axisbus.motion.stop_deceleration import Braking, CommandedMotion
from axisbus.sim.motor import MotorParams
from axisbus.units import Scale
from kit.motion.plant_recorder import Watch
from kit.motion.rig import rig

VELOCITIES = st.floats(-1e6, 1e6)
RATES = st.floats(1.0, 1e7)
IMAGE = SimpleNamespace()  # a ramp asks nothing of it


@given(VELOCITIES, VELOCITIES, RATES, RATES, st.floats(0.001, 0.1))
@example(10.0, -10.0, 1000.0, 100.0, 0.05)
def test_a_step_never_exceeds_its_ramps_and_never_passes_the_target(before, target, up, down, dt):
    after = next_velocity(before, target, up, down, dt)
    assert abs(after - before) <= max(up, down) * dt * 1.000001 + 1e-9
    assert min(before, target) - 1e-6 <= after <= max(before, target) + 1e-6
    if before * target >= 0 and abs(target) <= abs(before):  # it only brakes
        assert abs(after - before) <= down * dt * 1.000001 + 1e-9
    if before * target >= 0 and abs(target) >= abs(before):  # it only speeds up
        assert abs(after - before) <= up * dt * 1.000001 + 1e-9


@given(VELOCITIES, VELOCITIES, st.floats(1e3, 1e6), st.floats(1e3, 1e6))
def test_many_short_steps_sum_up_to_one_long_step(before, target, up, down):
    value = before
    for _ in range(50):
        value = next_velocity(value, target, up, down, 0.002)
    assert value == pytest.approx(next_velocity(before, target, up, down, 0.1), abs=1e-3)


def test_a_turn_brakes_with_the_deceleration_and_speeds_up_with_the_acceleration():
    # 100 to 0 in 0.1 s with 1000, then 0.1 s with 200
    assert next_velocity(100.0, -50.0, 200.0, 1000.0, 0.2) == pytest.approx(-20.0)


def test_the_ramp_of_a_halt_ends_at_0_and_stays_there():
    ramp, order = VelocityRamp(1000.0, 500.0, 20_000.0, 0.01), CycleOutputs()
    assert not ramp.at_rest
    assert ramp.begin_braking()
    sent = []
    while not ramp.at_rest:
        ramp.begin_braking()  # repeatedly, as a stop sequence does
        ramp.hold()  # which would be for another mode: a braking ramp keeps braking
        ramp.step(IMAGE, order)
        sent.append(order.target_velocity)
    assert sent == [800, 600, 400, 200, 0]


def test_a_hold_keeps_the_present_velocity():
    ramp, order = VelocityRamp(0.0, 10_000.0, 10_000.0, 0.01), CycleOutputs()
    ramp.aim(1000, 10_000.0, 10_000.0)
    ramp.step(IMAGE, order)
    ramp.hold()
    for _ in range(3):
        assert ramp.step(IMAGE, order)
        assert order.target_velocity == 100
    ramp.aim(-50, 10_000.0, 10_000.0)
    assert not ramp.step(IMAGE, order)


@given(st.integers(-3000, 3000), st.integers(-3000, 3000), st.integers(1, 10_000))
def test_a_torque_reaches_its_target_by_its_slope_and_does_not_exceed_it(start, target, slope):
    ramp, order = TorqueRamp(float(start), slope, 0.01, halt_removes_torque=True), CycleOutputs()
    ramp.aim(target, slope)
    before = float(start)
    for _ in range(40):
        ramp.step(IMAGE, order)
        assert abs(ramp.torque - before) <= slope * 0.01 + 1e-9
        assert min(start, target) <= ramp.torque <= max(start, target)
        before = ramp.torque
    assert (
        ramp.at_target == (abs(target - start) <= slope * 0.4 + 1e-6)
        or abs(abs(target - start) - slope * 0.4) < 1e-3
    )


def test_a_torque_that_holds_a_load_is_kept_by_a_halt():
    ramp, order = TorqueRamp(300.0, 1000, 0.01, halt_removes_torque=False), CycleOutputs()
    assert not ramp.begin_braking()
    ramp.step(IMAGE, order)
    assert order.target_torque == 300


def test_a_velocity_streamed_by_the_master_is_braked_by_its_own_ramp_for_any_605dh(dictionary_parameters):
    for halt in (0, 1, 2):
        parameters = dictionary_parameters(halt)
        commanded = CommandedMotion(1000.0, 500.0, 800.0, by_core=True)
        assert stop_of(parameters, commanded) == (StopLevel.HALT, 800.0)


@pytest.fixture
def dictionary_parameters():
    from axisbus.cia402.options import Ramp

    ramps = (Ramp.COAST, Ramp.SLOW, Ramp.QUICK)
    return lambda halt: rig(braking=Braking(ramps[halt], Ramp.QUICK, 5000.0)).core.parameters


# -- arguments -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("own", [None, 0])
def test_an_unknown_torque_slope_is_never_guessed(own):
    r = rig(torque_slope=own).enabled()
    with pytest.raises(ArgumentError, match="slope is missing"):
        r.axis.cyclic_torque(0.1)


def test_the_drives_own_slope_serves_and_one_too_flat_is_refused():
    r = rig(torque_slope=2000).enabled()  # ‰ of 10 N·m per s
    watch = Watch(r)
    r.axis.cyclic_torque(0.3).wait(3)
    sent = [item.outputs.target_torque for item in watch.sent if item.outputs.target_torque is not None]
    assert sent[-1] == 30
    assert 20 in sent  # 20 ‰ per cycle
    with pytest.raises(LimitError, match="slope"):
        r.axis.cyclic_torque(0.1, slope=0.001)


def test_an_axis_whose_velocities_cannot_be_compared_is_refused_at_the_call():
    scale = Scale.of(1, "increments")
    units = Units(scale, scale, scale, ratio_known=False)
    r = rig(units=units, limits=AxisLimits()).enabled()
    with pytest.raises(ArgumentError, match="velocity_scale"):
        r.axis.cyclic_velocity(10.0)


@pytest.mark.parametrize(
    ("index", "command"),
    [
        (0x606C, lambda axis: axis.cyclic_velocity(5.0)),
        (0x6077, lambda axis: axis.cyclic_torque(0.5, slope=1.0)),
    ],
)
def test_the_error_names_the_objects_that_a_drive_lacks(index, command):
    r = rig().enabled()
    object.__setattr__(r.core.parameters, "objects", r.core.parameters.objects - {index})
    with pytest.raises(StateError, match=r"cannot run cs[vt]") as error:
        command(r.axis).wait(1)
    assert f"{index:04X}h" in error.value.observed


def test_an_inverted_axis_turns_in_the_requested_direction():
    scale = Scale.of(-1000.0, "deg")
    units = Units(
        scale, Scale.of(-1000.0, "deg/s"), Scale.of(1000.0, "deg/s²"), ratio_known=True, rated_torque=-10.0
    )
    r = rig(units=units).enabled()
    r.axis.cyclic_velocity(50.0).wait(3)
    assert r.axis.velocity == pytest.approx(50.0, rel=0.01)
    assert r.drive.velocity < 0
    r.run(0.5)
    assert r.axis.error is None
    r.axis.halt().wait(3)
    r.axis.cyclic_torque(0.5, slope=10.0).wait(3)
    assert r.drive.target_torque == -50


def test_velocities_in_coarse_units_are_sent_as_whole_numbers():
    """A drive that counts in rpm: 1 rpm is 6 deg/s; the ramp goes by steps of that, and never past the target."""
    rpm = Scale.of(1 / 6, "deg/s")
    scale = Scale.of(1000.0, "deg")
    units = Units(scale, rpm, Scale.of(1000.0, "deg/s²"), ratio_known=True)
    r = rig(units=units, motor=MotorParams(velocity_unit=1 / 6000.0)).enabled()
    watch = Watch(r)
    r.axis.cyclic_velocity(60.0, acceleration=100.0)
    r.run(1.0)
    sent = [item.outputs.target_velocity for item in watch.sent if item.outputs.target_velocity is not None]
    assert sent == sorted(sent)
    assert sent[-1] == 10
    assert r.drive.axis.motor.velocity == pytest.approx(60_000.0)
    assert r.axis.error is None


def test_the_first_target_is_sent_after_the_halt_was_released():
    r = rig().enabled()
    r.axis.halt().wait(5)
    r.axis.cyclic_velocity(100.0)
    words = []
    while r.drive.target_velocity == 0:
        words.append(r.drive.controlword)
        r.run(0.001)
    assert words[0] & HALT
    assert not words[-1] & HALT  # in a cycle before
