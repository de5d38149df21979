"""Taking over a drive that another program has left enabled, with targets and offsets that act: the plant does not notice."""

from __future__ import annotations

import pytest

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import ValueTransport
from axisbus.errors import StateError
from axisbus.motion.parameters import AxisLimits, HoldsLoad
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.motor import MotorParams
from kit.motion.plant_recorder import ENABLED, Watch
from kit.motion.rig import PERIOD, rig

PP, PV, TQ, CSP, CSV, CST = 1, 3, 4, 8, 9, 10
HERE = 7_000  # increments
OFFSETS = (0x60B0, 0x60B1, 0x60B2)
LOAD = MotorParams(load=300.0, start_position=HERE)  # 30 % of rated torque hang on it
M = ModeOfOperation


def found(mode: int, *, motor: MotorParams | None = None, offsets=(0, 0, 0), port=None, **changes):
    """An axis at standstill at ``HERE``, enabled from outside in ``mode`` with these offsets, whose targets compensate them."""
    r = rig(motor=motor or MotorParams(start_position=HERE), port=port, limits=AxisLimits(), **changes)
    drive = r.drive
    hangs = round((motor or MotorParams()).load)
    for index, value in zip(OFFSETS, offsets, strict=True):
        r.device.write(index, 0, value)
    drive.target_position = HERE - (offsets[0] if mode == CSP else 0)
    drive.target_velocity = -offsets[1] if mode == CSV else 0
    drive.target_torque = hangs - (offsets[2] if mode == CST else 0)
    drive.axis.motor.torque = float(hangs)
    drive.start_enabled(mode)
    r.run(0.3)
    assert drive.axis.motor.velocity == pytest.approx(0.0, abs=1.0)
    assert r.axis.state is AxisState.STANDSTILL
    return r


def offsets_of(r) -> list[int]:
    return [r.device.read(index, 0) for index in OFFSETS]


def take_over(r) -> Watch:
    """Enable the axis and wait a while."""
    watch = Watch(r)
    r.axis.enable().wait(5)
    r.run(0.5)
    assert r.drive.power.stage == ENABLED
    assert watch.transitions == []
    return watch


@pytest.mark.parametrize("offset", [30_000, -30_000, 21, 1])
@pytest.mark.parametrize("demand", [True, False], ids=["6062h", "no 6062h"])
def test_a_drive_in_csp_with_a_position_offset_keeps_its_position(offset, demand):
    r = found(
        CSP, offsets=(offset, 0, 0), port=None if demand else {"inputs": {"demand": ValueTransport.NONE}}
    )
    r.drive.dials.mode_delay = 0.05
    watch = take_over(r)
    assert watch.displacement <= 1.0
    assert watch.speed <= 1.0 / PERIOD
    assert r.drive.mode_display == PP  # the offset could not be taken back in csp
    assert offsets_of(r) == [0, 0, 0]
    r.axis.follow(TrapezoidalTrajectory(r.axis.position, r.axis.position + 2.0, 50.0, 500.0)).wait(5)
    r.run(0.1)
    assert r.drive.position == pytest.approx(HERE + 2_000, abs=1)
    assert watch.acceleration() <= 500_000 * 1.1


def test_no_controlword_is_sent_before_the_offsets_are_known():
    r = found(CSP, offsets=(30_000, 0, 0))
    watch = Watch(r)
    r.device.dials.sdo_delay = 0.1
    handle = r.axis.enable()
    r.until(lambda: not handle.busy)
    first = next(item.t for item in watch.sent if item.outputs.controlword is not None)
    asked = next(item.t for item in watch.sent if item.outputs.sdo)
    assert first - asked >= 0.1
    assert all(item.outputs.target_position is None for item in watch.sent if item.t < first)
    assert watch.displacement <= 1.0


def test_a_demand_that_counts_without_the_offset_is_understood():
    """Some drives show 607Ah in 6062h, others its sum with 60B0h."""
    r = found(CSP, offsets=(30_000, 0, 0))
    read = r.ports["x"].read

    def without(now):
        inputs = read(now)
        if inputs.demand is None or inputs.mode is None or inputs.mode.value != CSP:
            return inputs
        return inputs._replace(demand=inputs.demand._replace(value=inputs.demand.value - 30_000))

    r.ports["x"].read = without
    r.run(0.1)
    watch = take_over(r)
    assert watch.displacement <= 1.0


@pytest.mark.parametrize("offset", [0, 30_000])
def test_a_drive_halted_far_from_its_csp_target_does_not_move_towards_it(offset):
    r = rig(motor=MotorParams(start_position=HERE), limits=AxisLimits())
    r.device.write(0x60B0, 0, offset)
    r.drive.start_enabled(CSP)
    r.drive.controlword = 0x010F
    r.drive.evaluate_controlword()
    r.drive.target_position = 90_000
    r.run(0.3)
    assert r.drive.position == HERE
    watch = take_over(r)
    assert watch.displacement <= 1.0


def test_without_offsets_a_drive_in_csp_keeps_its_mode_and_its_target():
    r = found(CSP)
    watch = take_over(r)
    assert watch.displacement == 0.0
    assert r.drive.mode_display == CSP
    assert set(watch.targets) == {HERE}
    r.axis.follow(TrapezoidalTrajectory(7.0, 9.0, 50.0, 500.0)).wait(5)


def test_a_drive_with_csp_only_is_refused_with_its_offset_and_left_at_its_position():
    r = found(CSP, offsets=(30_000, 0, 0), modes=frozenset({M.CYCLIC_SYNC_POSITION}))
    watch = Watch(r)
    with pytest.raises(StateError, match="cannot be taken over in mode csp without a jump") as caught:
        r.axis.enable().wait(5)
    r.run(1.0)
    assert "60B0h = 30000" in caught.value.observed
    assert "axis.disable()" in caught.value.remedy
    assert watch.displacement <= 1.0
    r.axis.reset().wait(1)
    r.axis.disable().wait(3)
    r.axis.enable().wait(5)
    r.run(0.3)
    assert watch.displacement <= 1.0
    assert offsets_of(r) == [0, 0, 0]
    assert r.axis.state is AxisState.STANDSTILL


def test_a_drive_held_in_quick_stop_in_csp_loses_its_offset_before_transition_16():
    r = found(CSP, offsets=(30_000, 0, 0))
    r.device.write(0x605A, 0, 6)
    r.drive.controlword = 0x0002
    r.drive.evaluate_controlword()
    r.run(0.3)
    watch = Watch(r)
    r.axis.enable().wait(5)
    r.run(0.5)
    assert watch.transitions == [16]
    assert watch.displacement <= 1.0
    assert offsets_of(r) == [0, 0, 0]


@pytest.mark.parametrize("offsets", [(0, 20_000, 0), (0, -20_000, 0), (500, 0, 0), (0, 0, 0)])
def test_a_drive_in_csv_with_a_velocity_offset_does_not_begin_to_turn(offsets):
    r = found(CSV, offsets=offsets)
    r.drive.dials.mode_delay = 0.05
    watch = take_over(r)
    assert watch.speed <= 1.0
    assert watch.displacement <= 1.0
    if offsets[1]:
        assert r.drive.mode_display == PP
        assert offsets_of(r) == [0, 0, 0]


@pytest.mark.parametrize("offset", [0, 30_000])
@pytest.mark.parametrize("hears_halt", [True, False], ids=["obeys halt", "ignores halt in cyclic modes"])
def test_a_drive_that_turns_in_csv_is_braked_on_a_ramp(offset, hears_halt):
    r = rig(limits=AxisLimits())
    r.device.write(0x60B1, 0, offset)
    r.drive.dials.halt_in_cyclic_modes = hears_halt
    r.drive.target_velocity = 50_000 - offset
    r.drive.start_enabled(CSV)
    r.run(0.5)
    assert r.drive.velocity == 50_000
    r.drive.dials.mode_delay = 0.05
    watch = take_over(r)
    assert r.drive.velocity == 0
    assert watch.acceleration() <= 1_000_000 * 1.05  # 6084h of the drive
    assert r.axis.state is AxisState.STANDSTILL


@pytest.mark.parametrize("offset", [0, 200, -200])
@pytest.mark.parametrize("mode", [CST, TQ])
def test_a_load_that_hangs_on_a_torque_does_not_fall(mode, offset):
    r = found(mode, motor=LOAD, offsets=(0, 0, offset))
    r.drive.dials.mode_delay = 0.05
    watch = take_over(r)
    assert watch.displacement <= 60
    assert r.drive.mode_display == PP
    assert r.drive.axis.motor.torque == pytest.approx(300.0, abs=5.0)
    assert offsets_of(r) == [0, 0, 0]


def test_without_torque_feedback_the_target_that_was_found_holds_the_load():
    r = found(CST, motor=LOAD, offsets=(0, 0, 200), port={"inputs": {"torque": ValueTransport.NONE}})
    r.drive.dials.mode_delay = 0.05
    assert take_over(r).displacement <= 60


def test_a_drive_with_torque_modes_alone_keeps_the_torque_that_holds_its_load():
    only = frozenset({M.PROFILE_TORQUE})
    r = found(TQ, motor=LOAD, modes=only, holds_load=HoldsLoad.TORQUE)
    watch = take_over(r)
    assert watch.displacement <= 60
    assert r.drive.mode_display == TQ


def test_a_drive_with_cst_alone_is_refused_because_its_torque_may_hold_something():
    r = found(CST, modes=frozenset({M.CYCLIC_SYNC_TORQUE}))
    with pytest.raises(StateError, match="cannot be taken over in mode cst without a jump") as caught:
        r.axis.enable().wait(5)
    assert caught.value.observed.startswith("its torque may be holding a load")


@pytest.mark.parametrize("offsets", [(0, 0, 0), (3_000, 3_000, 300)])
@pytest.mark.parametrize("mode", [PP, PV])
def test_offsets_do_not_matter_in_a_profile_mode_and_are_taken_back_before_a_cyclic_one(mode, offsets):
    r = found(mode, offsets=offsets)
    watch = take_over(r)
    assert r.drive.mode_display == mode
    r.axis.follow(TrapezoidalTrajectory(7.0, 7.0, 50.0, 500.0)).wait(5)
    r.run(0.2)
    assert watch.displacement <= 1.0
    assert offsets_of(r) == [0, 0, 0]


def test_a_drive_that_is_switched_off_while_it_is_read_is_enabled_from_there():
    r = found(CSP, offsets=(30_000, 0, 0))
    watch = Watch(r)
    r.device.dials.sdo_delay = 0.1
    handle = r.axis.enable()
    r.run(0.05)
    r.drive.controlword = 0x0000
    r.drive.evaluate_controlword()
    handle.wait(5)
    r.run(0.3)
    assert r.drive.power.stage == ENABLED
    assert watch.displacement <= 1.0
    assert offsets_of(r) == [0, 0, 0]
