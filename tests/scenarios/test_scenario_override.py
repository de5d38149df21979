"""An override slows, holds and speeds up whatever moves, its drive's own moves as well; it lifts no limit, and scales no stop."""

from __future__ import annotations

import math

import pytest

from axisbus import TrapezoidalTrajectory
from axisbus.errors import ArgumentError, DriveError, StateError
from axisbus.motion.states import AxisState
from axisbus.sim.modes.profile_position import ProfilePosition
from kit.cell import cell_text
from kit.virtual_axis import virtual

NEAR = 0.3  # degrees

# -- moves that a drive plans -------------------------------------------------------------------------------------------


def moving(scenario, distance=200.0, **changes):
    """A cell of one axis that moves at 100 deg/s."""
    cell = scenario.simulated("x", **changes).enabled()
    handle = cell.x.move_absolute(distance, velocity=100.0)
    cell.run(0.6)
    assert cell.x.velocity == pytest.approx(100.0, abs=2.0)
    return cell, handle


def test_an_override_changes_the_speed_of_a_move_of_the_drive_at_once_and_not_its_target(scenario):
    cell, handle = moving(scenario, 300.0)
    for factor, speed in ((0.3, 30.0), (1.5, 150.0), (0.05, 5.0), (1.0, 100.0)):
        assert cell.end_of(cell.x.set_override(factor)) is None
        assert cell.x.override == factor
        cell.run(0.6)
        assert cell.x.velocity == pytest.approx(speed, abs=2.0)
    assert cell.end_of(handle) is None
    assert cell.where("x") == pytest.approx(300.0, abs=NEAR)


def test_an_override_of_0_holds_a_move_which_continues_when_the_override_rises(scenario):
    cell, handle = moving(scenario)
    cell.x.set_override(0.0).wait()
    cell.run(0.5)
    held = cell.where("x")
    cell.run(60.0)
    assert cell.where("x") == pytest.approx(held, abs=0.01)
    assert handle.active
    assert cell.x.state is AxisState.DISCRETE_MOTION
    assert held < 200.0 - 50.0
    cell.x.set_override(0.5).wait()
    cell.run(0.6)
    assert cell.x.velocity == pytest.approx(50.0, abs=2.0)
    assert cell.end_of(handle) is None
    assert cell.where("x") == pytest.approx(200.0, abs=NEAR)


def test_a_held_move_can_be_halted_and_replaced(scenario):
    cell, handle = moving(scenario)
    cell.x.set_override(0.0).wait()
    cell.run(0.5)
    other = cell.x.move_absolute(0.0)
    cell.run(0.5)
    assert handle.status.name == "ABORTED"
    assert other.active
    assert cell.end_of(cell.x.halt()) is None
    assert cell.x.state is AxisState.STANDSTILL
    cell.x.set_override(1.0).wait()
    held = cell.where("x")
    cell.run(1.0)
    assert cell.where("x") == pytest.approx(held, abs=0.01)


@pytest.mark.parametrize("way", ["halt", "stop"])
@pytest.mark.parametrize("rises", [False, True], ids=["held", "released just before"])
def test_a_held_axis_does_not_count_as_jammed_without_a_usable_6062h(scenario, way, rises):
    cell, _ = moving(scenario, axis='demand = "ignore"')
    cell.x.set_override(0.0).wait()
    cell.run(1.0)
    if rises:
        cell.x.set_override(0.1)
    assert cell.end_of(getattr(cell.x, way)()) is None
    assert cell.x.error is None


def test_a_move_commanded_with_an_override_of_zero_begins_when_the_override_rises(scenario):
    cell = scenario.simulated("x").enabled()
    cell.machine.set_override(0.0).wait()
    handle = cell.x.move_absolute(50.0)
    cell.run(5.0)
    assert handle.active
    assert cell.where("x") == pytest.approx(0.0, abs=0.01)
    cell.machine.set_override(1.0).wait()
    assert cell.end_of(handle) is None
    assert cell.where("x") == pytest.approx(50.0, abs=NEAR)


def test_no_override_lifts_max_velocity(scenario):
    cell = scenario.simulated("x", axis="").enabled()
    cell.x.set_override(1.5).wait()
    fast = cell.x.move_absolute(1500.0, velocity=390.0)
    cell.run(2.5)
    assert cell.x.velocity == pytest.approx(400.0, abs=2.0)
    assert cell.end_of(fast) is None
    turning = cell.x.move_velocity(-390.0)
    assert cell.end_of(turning) is None
    cell.run(0.5)
    assert cell.x.velocity == pytest.approx(-400.0, abs=2.0)


def test_an_override_changed_faster_than_the_handshake_ends_at_its_last_value(scenario):
    cell, handle = moving(scenario, 400.0)
    for number in range(200):
        cell.x.set_override((number * 7 % 16) / 10)
        cell.run(0.01)
    cell.x.set_override(0.2).wait()
    cell.run(1.0)
    assert cell.x.velocity == pytest.approx(20.0, abs=2.0)
    cell.x.set_override(1.0).wait()
    assert cell.end_of(handle) is None
    assert cell.where("x") == pytest.approx(400.0, abs=NEAR)


def test_an_axis_that_reverses_for_its_target_takes_another_velocity_during_the_move(scenario):
    cell = scenario.simulated("x").enabled()
    cell.x.move_velocity(-100.0, acceleration=50.0)
    cell.run(3.0)
    handle = cell.x.move_absolute(200.0, velocity=100.0, acceleration=50.0)
    cell.run(1.5)
    assert cell.x.velocity == pytest.approx(-25.0, abs=5.0)
    cell.x.set_override(1.2).wait()
    assert cell.end_of(handle) is None
    assert cell.where("x") == pytest.approx(200.0, abs=NEAR)


@pytest.mark.parametrize("factor", [0.4, 1.4])
def test_a_drive_that_keeps_its_velocity_is_reported_and_stops(scenario, monkeypatch, factor):
    cell, handle = moving(scenario, 1500.0)
    plain = ProfilePosition._set_point

    def stubborn(self, axis, word):
        point = plain(self, axis, word)
        return point if self._active is None else point._replace(speed=self._active.speed)

    monkeypatch.setattr(ProfilePosition, "_set_point", stubborn)
    cell.x.set_override(factor).wait()
    error = cell.failure_of(handle)
    assert isinstance(error, DriveError)
    assert "does not accept another velocity during a move" in str(error)
    cell.run(1.0)
    assert cell.x.state is AxisState.ERRORSTOP
    held = cell.where("x")
    cell.run(0.5)
    assert cell.where("x") == pytest.approx(held, abs=0.01)


def test_an_override_of_zero_fails_the_move_of_a_drive_whose_halt_coasts(scenario):
    cell, handle = moving(scenario, 1500.0)
    core = cell.core()
    from dataclasses import replace

    from axisbus.cia402.options import Ramp

    handle_move = core.activity
    handle_move._set_point_update._parameters = replace(
        core.parameters, braking=replace(core.parameters.braking, halt=Ramp.COAST)
    )
    cell.x.set_override(0.0).wait()
    error = cell.failure_of(handle)
    assert isinstance(error, StateError)
    assert "605Dh is 0" in str(error)


def test_a_drive_without_the_acknowledge_has_an_override_as_well(scenario):
    cell, handle = moving(scenario, axis='handshake = "on-change"')
    for factor in (0.3, 0.0, 1.2):
        cell.x.set_override(factor).wait()
        cell.run(0.8)
        assert cell.x.velocity == pytest.approx(100.0 * factor, abs=2.0)
    assert cell.end_of(handle) is None
    assert cell.where("x") == pytest.approx(200.0, abs=NEAR)


def test_a_deadline_runs_as_slowly_as_its_move(scenario):
    cell = scenario.simulated("x").enabled()
    handle = cell.x.move_absolute(100.0, velocity=100.0, timeout=2.0)
    cell.run(0.6)
    cell.x.set_override(0.0).wait()
    cell.run(30.0)
    cell.x.set_override(0.5).wait()
    assert cell.end_of(handle) is None


@pytest.mark.parametrize("call", ["move_velocity", "cyclic_velocity"])
def test_a_velocity_follows_its_override_and_is_not_reached_while_it_is_held(scenario, call):
    cell = scenario.simulated("x").enabled()
    cell.machine.set_override(0.0).wait()
    handle = getattr(cell.x, call)(100.0)
    cell.run(5.0)
    assert handle.active
    assert cell.x.velocity == pytest.approx(0.0, abs=0.1)
    for factor in (0.5, 1.5, 0.0, 1.0):
        cell.x.set_override(factor).wait()
        cell.machine.set_override(1.0).wait()
        cell.run(0.8)
        assert cell.x.velocity == pytest.approx(100.0 * factor, abs=2.0)
    assert handle.done
    assert cell.end_of(cell.x.halt()) is None


def test_a_jog_that_is_held_does_not_move_and_ends_in_time(scenario):
    cell = scenario.simulated("x").enabled()
    cell.x.set_override(0.0).wait()
    cell.x.jog(50.0)
    cell.run(0.5)
    assert cell.where("x") == pytest.approx(0.0, abs=0.01)
    assert cell.x.state is AxisState.STANDSTILL


def test_a_torque_and_a_homing_are_not_scaled(scenario):
    cell = scenario.simulated("x", axis="rated_torque = 2.0\nmax_torque = 1.0").enabled()
    cell.x.set_override(0.0).wait()
    assert cell.end_of(cell.x.home()) is None
    assert cell.end_of(cell.x.torque_control(0.1, slope=5.0)) is None


# -- motions streamed by the master -------------------------------------------------------------------------------------


def test_a_trajectory_is_slowed_held_and_continued_with_on_its_path(scenario):
    cell = scenario.simulated("x", axis="max_acceleration = 2000.0").enabled()
    handle = cell.x.follow(TrapezoidalTrajectory(0.0, 200.0, 100.0, 500.0))
    cell.run(0.6)
    for factor in (0.3, 0.0, 1.5):
        cell.x.set_override(factor).wait()
        cell.run(0.7)
        assert cell.x.velocity == pytest.approx(100.0 * factor, abs=2.0)
        assert handle.active
    assert cell.end_of(handle) is None
    assert cell.where("x") == pytest.approx(200.0, abs=NEAR)


def test_a_trajectory_that_reports_nothing_in_advance_is_not_made_faster(scenario):
    cell = scenario.simulated("x").enabled()
    cell.x.set_override(1.5).wait()
    handle = cell.x.follow(lambda t: 50.0 - 50.0 * math.cos(t), duration=math.pi)
    cell.run(math.pi / 2)
    assert cell.x.velocity == pytest.approx(50.0, abs=2.0)
    assert cell.end_of(handle) is None


def test_a_line_is_as_slow_as_its_slowest_axis_times_its_group_override(scenario):
    cell = scenario.simulated("xy").enabled()
    group = cell.machine.group("x", "y")
    line = group.move_linear((300.0, 300.0), velocity=math.hypot(100.0, 100.0))
    cell.run(0.6)
    cell["y"].set_override(0.5).wait()
    cell.run(0.5)
    assert [cell[name].velocity for name in "xy"] == pytest.approx([50.0, 50.0], abs=2.0)
    group.set_override(0.5).wait()
    cell.run(0.5)
    assert [cell[name].velocity for name in "xy"] == pytest.approx([25.0, 25.0], abs=2.0)
    cell.machine.set_override(0.0).wait()
    cell.run(0.5)
    assert line.active
    assert [cell[name].velocity for name in "xy"] == pytest.approx([0.0, 0.0], abs=0.5)
    cell.machine.set_override(1.5).wait()
    for factor in (group, cell["y"]):
        factor.set_override(1.0).wait()
    cell.run(0.5)
    assert [cell[name].velocity for name in "xy"] == pytest.approx([150.0, 150.0], abs=3.0)
    assert cell.end_of(line) is None


def test_a_move_out_of_a_trajectory_is_planned_again_and_held(scenario):
    cell = scenario.simulated("x", axis="max_acceleration = 2000.0").enabled()
    cell.x.follow(TrapezoidalTrajectory(0.0, 200.0, 100.0, 500.0))
    cell.run(0.6)
    handle = cell.x.move_absolute(-200.0, velocity=100.0)
    cell.run(1.0)
    for factor in (0.3, 0.0, 1.5):
        cell.x.set_override(factor).wait()
        cell.run(0.6)
        assert cell.x.velocity == pytest.approx(-100.0 * factor, abs=2.0)
    assert cell.end_of(handle) is None
    assert cell.where("x") == pytest.approx(-200.0, abs=NEAR)


def test_a_gear_follows_its_master_and_not_its_own_override(scenario):
    cell = scenario.simulated("xy").enabled()
    x, y = cell["x"], cell["y"]
    assert cell.end_of(y.gear_in(x, 0.5)) is None
    y.set_override(0.1).wait()
    x.move_absolute(200.0, velocity=100.0)
    cell.run(0.8)
    assert y.velocity == pytest.approx(50.0, abs=2.0)
    x.set_override(0.5).wait()
    cell.run(0.8)
    assert y.velocity == pytest.approx(25.0, abs=2.0)
    cell.machine.set_override(0.0).wait()
    cell.run(0.8)
    assert y.velocity == pytest.approx(0.0, abs=0.5)


def test_the_override_of_the_cell_applies_to_an_axis_after_gear_out(scenario):
    cell = scenario.simulated("xy").enabled()
    x, y = cell["x"], cell["y"]
    cell.end_of(y.gear_in(x, 0.5))
    cell.end_of(x.move_velocity(100.0))
    cell.run(0.5)
    assert cell.end_of(y.gear_out()) is None
    cell.machine.set_override(0.0).wait()
    cell.run(0.8)
    assert y.velocity == pytest.approx(0.0, abs=0.5)


def test_an_axis_with_an_override_slows_down_gradually_after_gear_out(scenario):
    """The override does not apply to a slave. After gear_out it does, and the axis has the velocity of its master until then."""
    cell = scenario.simulated("xy").enabled()
    x, y = cell["x"], cell["y"]
    cell.end_of(x.move_velocity(100.0))
    cell.end_of(y.gear_in(x, 1.0))
    y.set_override(0.3).wait()
    cell.run(0.3)
    assert y.velocity == pytest.approx(100.0, abs=2.0)
    assert cell.end_of(y.gear_out()) is None
    cell.run(0.8)
    assert y.velocity == pytest.approx(30.0, abs=1.0)
    assert y.error is None
    assert cell.hardest_change("y") < 600.0


def test_a_virtual_axis_is_overridden_as_any_other(scenario):
    cell = scenario.simulated(text=cell_text("", more=virtual("max_velocity = 400.0")))
    v = cell["v"]
    v.enable().wait(5)
    handle = v.move_absolute(200.0, velocity=100.0)
    cell.run(0.6)
    for factor in (0.3, 0.0, 1.5):
        v.set_override(factor).wait()
        cell.run(0.6)
        assert v.velocity == pytest.approx(100.0 * factor, abs=2.0)
    assert cell.end_of(handle) is None
    assert v.position == 200.0


# -- stops and refusals --------------------------------------------------------------------------------------------------


def test_no_stop_is_scaled(scenario):
    ways = []
    for factor in (1.0, 0.5):
        cell = scenario.simulated("x").enabled()
        handle = cell.x.move_absolute(400.0, velocity=50.0 / factor)
        cell.x.set_override(factor).wait()
        cell.run(1.5)
        assert cell.x.velocity == pytest.approx(50.0, abs=2.0)
        begun = cell.where("x")
        assert cell.end_of(cell.x.halt()) is None
        assert not handle.busy
        ways.append(cell.where("x") - begun)
    assert ways[1] == pytest.approx(ways[0], abs=0.6)


@pytest.mark.parametrize("value", [-0.1, 1.51, math.nan, "1", None])
def test_an_invalid_override_is_refused_at_the_call(scenario, value):
    cell = scenario.simulated("x")
    for who in (cell.x, cell.machine):
        with pytest.raises(ArgumentError, match=r"from 0 to 1\.5"):
            who.set_override(value)


def test_the_cell_multiplies_and_the_product_is_no_more_than_the_most(scenario):
    cell = scenario.simulated("xy")
    cell.machine.set_override(0.5).wait()
    cell["x"].set_override(0.5).wait()
    assert (cell.machine.override, cell["x"].override, cell["y"].override) == (0.5, 0.5, 1.0)
    assert [cell.core(name).override.factor for name in "xy"] == [0.25, 0.5]
    cell.machine.set_override(1.5).wait()
    cell["x"].set_override(1.5).wait()
    assert cell.core("x").override.factor == 1.5
