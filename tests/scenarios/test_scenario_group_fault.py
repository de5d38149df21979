"""How the fault of one axis of a group stops the others: on their path, each by its own ramp, or by quick stop."""

from __future__ import annotations

import pytest

from axisbus.errors import DriveError, DriveFault, Stopped
from axisbus.motion.states import AxisState
from kit.cell import Cell
from kit.plant_probe import ENABLED, OFF, QUICK_STOP

AXIS = "max_acceleration = 2000.0"
CYCLE = 0.01


def group(scenario, on_fault: str) -> Cell:
    more = f'[groups.xyz]\naxes = ["x", "y", "z"]\non_fault = "{on_fault}"\n'
    return scenario.simulated("xyz", axis=AXIS, more=more).enabled()


def braked(cell: Cell, name: str, since: float) -> tuple[float, float]:
    """When the motor began to brake after ``since``, and how hard it braked, by the plant."""
    samples = cell.record(name).since(since)
    top = abs(samples[0].velocity)
    begin = next(sample for sample in samples if abs(sample.velocity) < 0.98 * top)
    end = next(sample for sample in samples if abs(sample.velocity) < 0.3 * top)
    return begin.time - since, (abs(begin.velocity) - abs(end.velocity)) / (end.time - begin.time)


@pytest.mark.parametrize(("on_fault", "ramp"), [("path", 250.0), ("each", 500.0), ("quick", 1000.0)])
def test_a_fault_brakes_the_other_axes_on_a_line_as_on_fault_of_their_group_requires(
    scenario, on_fault, ramp
):
    cell = group(scenario, on_fault)
    xyz = cell.machine.group("xyz")
    line = xyz.move_linear((300.0, 150.0, 300.0), velocity=120.0, acceleration=375.0)
    cell.run(1.0)
    since = cell.moment()
    cell.machine.simulated_node(3).fault(0x2310)
    assert isinstance(cell.failure_of(line), DriveFault)
    cell.run(1.5)
    for name in "xy":
        begun, hard = braked(cell, name, since)
        # The fault is received at a SYNC; two cycles later, the first target that brakes, which is executed two cycles later.
        assert begun < 7 * CYCLE + 0.02 * abs(cell.record(name).since(since)[0].velocity) / hard
        share = {"x": 1.0, "y": 0.5}[name] if on_fault == "path" else 1.0
        assert hard == pytest.approx(share * ramp, rel=0.15)
        assert cell.speed(name) == 0.0
        assert cell.stage(name) in ((*OFF, QUICK_STOP) if on_fault == "quick" else (ENABLED,))
    off_line = abs(cell.where("x") - 2.0 * cell.where("y"))
    assert off_line < 0.1 if on_fault == "path" else off_line > 0.5
    if on_fault != "quick":
        assert cell["x"].state is AxisState.STANDSTILL


def test_a_fault_brakes_the_other_axes_in_profile_moves_as_on_fault_of_their_group_requires(scenario):
    cell = group(scenario, "quick")
    for name in "xy":
        cell[name].move_velocity(90.0)
    cell.run(0.6)
    since = cell.moment()
    cell.machine.simulated_node(3).fault(0x2310)
    cell.run(1.0)
    for name in "xy":
        assert braked(cell, name, since)[1] == pytest.approx(1000.0, rel=0.15)
        assert cell.speed(name) == 0.0


@pytest.mark.parametrize("on_fault", ["path", "each", "quick"])
def test_a_reset_right_after_a_fault_waits_until_all_axes_are_at_standstill(scenario, on_fault):
    cell = group(scenario, on_fault)
    xyz = cell.machine.group("xyz")
    line = xyz.move_linear((300.0, 150.0, 300.0), velocity=120.0)
    cell.run(1.0)
    cell.machine.simulated_node(3).fault(0x2310)
    assert isinstance(cell.failure_of(line), DriveFault)
    cell.must_move("x")
    xyz.reset().wait(5)
    for name in "xyz":
        assert cell.speed(name) == pytest.approx(0.0, abs=0.1)
        assert cell[name].state in (AxisState.STANDSTILL, AxisState.DISABLED)
        assert cell[name].error is None
    xyz.enable().wait(5)
    xyz.move_linear((0.0, 0.0, 0.0), velocity=120.0).wait(10)


def test_a_reset_waits_for_a_slow_fault_reaction(scenario):
    cell = scenario.simulated("x", stop='fault = "slow-ramp"\nquick_stop_time = "8s"').enabled()
    cell.x.move_velocity(300.0, deceleration=90.0).wait(5)
    cell.drive().fault(0x2310)
    cell.run(0.1)
    cell.must_move("x")
    cell.x.reset().wait(10)
    assert cell.speed() == pytest.approx(0.0, abs=0.1)
    assert cell.x.state is AxisState.DISABLED


def halting(scenario, **changes) -> Cell:
    cell = scenario.simulated("x", **changes).enabled()
    cell.x.move_velocity(300.0).wait(5)
    cell.x.halt()
    cell.run(0.1)
    cell.must_move("x")
    return cell


@pytest.mark.parametrize("stop", ["stop", "quick_stop"])
def test_a_reset_that_waits_does_not_release_a_later_stop(scenario, stop):
    cell = halting(scenario)
    reset = cell.x.reset()
    getattr(cell.x, stop)().wait(5)
    assert isinstance(reset.exception(), Stopped)
    assert cell.x.state is (AxisState.STOPPING if stop == "stop" else AxisState.DISABLED)


def test_a_waiting_reset_ends_with_a_later_fault(scenario):
    cell = halting(scenario)
    resets = [cell.x.reset(), cell.x.reset()]
    cell.drive().fault(0x2310)
    for reset in resets:
        assert isinstance(cell.failure_of(reset), DriveFault)
    assert cell.x.state is AxisState.ERRORSTOP
    cell.run(1.0)
    assert cell.x.state is AxisState.ERRORSTOP
    cell.x.reset().wait(5)


def test_a_reset_does_not_hide_that_the_stop_it_waits_for_has_failed(scenario):
    cell = halting(scenario)
    reset = cell.x.reset()
    cell.device().dials.dead = True
    failed = cell.failure_of(reset)
    assert isinstance(failed, DriveError) or "lost" in str(failed)
    assert cell.x.state is AxisState.ERRORSTOP


def test_a_reset_that_waits_is_done_when_a_move_takes_the_halt_over(scenario):
    cell = halting(scenario)
    reset = cell.x.reset()
    move = cell.x.move_velocity(100.0)
    reset.wait(2)
    move.wait(2)
    assert cell.x.state is AxisState.CONTINUOUS_MOTION
