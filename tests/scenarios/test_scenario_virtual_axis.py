"""A virtual axis is commanded, limited, halted and stopped as any axis; and it never jumps, because other axes may follow it."""

from __future__ import annotations

import math
import os
import re
import signal
import time

import pytest

from axisbus import Machine
from axisbus.cia402.state import PowerState
from axisbus.errors import ArgumentError, AxisbusError, LimitError, StaleError, StateError
from axisbus.motion.states import AxisState
from kit.cell import cell_file, cell_text
from kit.plant_probe import ENABLED
from kit.scenarios.core_process import OWN_PROCESS
from kit.stop_report import STOPPED
from kit.virtual_axis import HARDEST, Trail, virtual


def alone(scenario, axis="max_velocity = 400.0", stop="", more=""):
    """A cell of one virtual axis and nothing else, enabled, with its trail."""
    text = cell_text("", more=virtual(axis, stop) + more)
    cell = scenario.simulated(text=text)
    trail = Trail(cell)
    cell["v"].enable().wait(5)
    return cell, cell["v"], trail


def beside(scenario, axis="max_velocity = 400.0", **changes):
    """A virtual axis beside a drive, both enabled."""
    cell = scenario.simulated("x", more=virtual(axis), **changes)
    trail = Trail(cell)
    return cell.enabled(), cell["v"], trail


# -- moves -------------------------------------------------------------------------------------------------------------


def test_a_virtual_axis_begins_at_0_without_power_and_moves_only_once_it_is_enabled(scenario):
    cell = scenario.simulated("x", more=virtual())
    v = cell["v"]
    assert (v.position, v.homed, v.state) == (0.0, True, AxisState.DISABLED)
    assert v.snapshot.power_state is PowerState.SWITCH_ON_DISABLED
    error = cell.failure_of(v.move_absolute(10.0))
    assert isinstance(error, StateError)
    cell.run(0.2)
    assert v.position == 0.0
    assert cell.end_of(v.enable()) is None
    assert (v.state, v.snapshot.power_state) == (AxisState.STANDSTILL, PowerState.OPERATION_ENABLED)
    assert cell["x"].state is AxisState.DISABLED


def test_a_move_ends_exactly_at_its_target_and_takes_the_time_of_its_ramps(scenario):
    cell, v, trail = alone(scenario)
    began = cell.now
    v.move_absolute(90.0).wait(5)
    assert v.position == 90.0
    assert cell.now - began == pytest.approx(90 / 100 + 100 / 500, abs=0.1)
    v.move_relative(-45.5, velocity=30.0).wait(5)
    assert v.position == 44.5
    v.move_additive(0.25).wait(5)
    assert v.position == 44.75
    assert max(trail.speeds) == pytest.approx(100.0, rel=1e-3)
    assert min(trail.speeds) == pytest.approx(-30.0, rel=1e-3)
    trail.must_be_smooth()


@pytest.mark.parametrize("after", [0.02, 0.1, 0.4, 0.8, 1.05])
@pytest.mark.parametrize("target", [-50.0, 0.0, 40.0, 90.0, 300.0])
def test_a_move_may_be_replaced_at_any_moment_and_nothing_jumps(scenario, after, target):
    cell, v, trail = alone(scenario)
    first = v.move_absolute(90.0)
    cell.run(after)
    second = v.move_absolute(target, velocity=60.0, acceleration=400.0, deceleration=300.0)
    assert cell.end_of(second) is None
    assert not first.busy
    cell.run(0.2)
    assert v.position == target
    trail.must_be_smooth()


def test_a_virtual_axis_moves_at_a_velocity_until_the_next_command(scenario):
    cell, v, trail = alone(scenario)
    v.move_velocity(80.0).wait(5)
    start, began = v.position, cell.now
    cell.run(2.0)
    assert v.position - start == pytest.approx(80.0 * (cell.now - began), rel=1e-6)
    v.move_velocity(-120.0).wait(5)
    cell.run(0.1)  # it is reached within 5 %
    assert (v.velocity, v.state) == (-120.0, AxisState.CONTINUOUS_MOTION)
    v.halt().wait(5)
    assert (v.velocity, v.state) == (0.0, AxisState.STANDSTILL)
    trail.must_be_smooth()


def test_a_jog_ends_if_it_is_not_renewed(scenario):
    cell, v, trail = alone(scenario)
    for _ in range(5):
        v.jog(50.0)
        cell.run(0.1)
    assert v.velocity == 50.0
    cell.run(0.6)
    assert (v.velocity, v.state) == (0.0, AxisState.STANDSTILL)
    trail.must_be_smooth()


def test_a_virtual_axis_moves_past_the_wrap_of_its_count(scenario):
    cell, v, _ = alone(scenario, "max_velocity = 400.0\nscale = 5_000_000\nmodulo = 360.0")
    v.move_velocity(200.0).wait(5)
    cell.run(4.0)  # 4e9 increments: more than INTEGER32 can hold
    assert v.unwrapped_position > 700.0
    v.halt().wait(5)
    here = v.unwrapped_position
    v.move_relative(-90.0).wait(5)
    assert v.unwrapped_position == pytest.approx(here - 90.0, abs=1e-6)
    v.move_absolute(0.0).wait(5)
    assert math.cos(math.radians(v.position)) == pytest.approx(1.0)


def test_a_late_scan_makes_it_late_and_it_neither_jumps_nor_counts_as_held(scenario):
    cell, v, trail = alone(scenario)
    v.move_velocity(300.0).wait(5)
    cell.run(0.2)
    start, cycles = v.position, len(trail.positions)
    for late in (0.2, 0.12, 0.2, 0.2, 0.05, 0.2, 0.2):  # a busy computer, for more than a second
        cell.faults.wait_late = late
        cell.machine.sleep(0.01)
        cell.faults.wait_late = 0.0
        cell.machine.sleep(0.02)
    cell.run(0.5)
    assert v.velocity == 300.0
    assert v.position - start == pytest.approx(3.0 * (len(trail.positions) - cycles), rel=1e-6)
    v.move_absolute(v.position + 300.0).wait(10)
    trail.must_be_smooth()


def test_set_position_of_a_virtual_axis_sets_its_position_and_moves_nothing(scenario):
    _, v, trail = alone(scenario)
    v.move_absolute(30.0).wait(5)
    v.set_position(-7.5).wait(5)
    assert (v.position, v.velocity) == (-7.5, 0.0)
    v.move_absolute(0.0).wait(5)
    assert v.position == 0.0
    assert sum(trail.speeds) * 0.01 == pytest.approx(
        0.0, abs=1e-6
    )  # 30 there, 37.5 back by another name, 7.5 on


# -- stopping ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("verb", "state", "power"),
    [
        ("halt", AxisState.STANDSTILL, PowerState.OPERATION_ENABLED),
        ("stop", AxisState.STOPPING, PowerState.OPERATION_ENABLED),
        ("quick_stop", AxisState.DISABLED, PowerState.SWITCH_ON_DISABLED),
        ("disable", AxisState.DISABLED, PowerState.SWITCH_ON_DISABLED),
    ],
)
@pytest.mark.parametrize("how", ["move", "turn", "follow"])
def test_every_kind_of_stop_works_in_every_kind_of_motion(scenario, verb, state, power, how):
    cell, v, trail = alone(scenario, stop="deceleration = 500.0")
    {
        "move": lambda: v.move_absolute(500.0),
        "turn": lambda: v.move_velocity(100.0),
        "follow": lambda: v.follow(lambda t: 50.0 * (1 - math.cos(t)), duration=20.0),
    }[how]()
    cell.run(0.7)
    assert v.velocity > 20.0
    assert cell.end_of(getattr(v, verb)()) is None
    stood = v.position
    cell.run(1.0)
    assert (v.position, v.velocity, v.state, v.snapshot.power_state) == (stood, 0.0, state, power)
    trail.must_be_smooth()


def test_stop_locks_a_virtual_axis_until_it_is_released(scenario):
    cell, v, _ = alone(scenario)
    v.move_velocity(100.0).wait(5)
    with v.held_stopped(5):
        error = cell.failure_of(v.move_absolute(0.0))
        assert isinstance(error, StateError)
    assert cell.end_of(v.move_absolute(0.0)) is None


@pytest.mark.parametrize(
    ("more", "hardest"),
    [("deceleration = 2000.0", 2000.0), ("", HARDEST)],
    ids=["by its stop options", "by its defaults"],
)
def test_a_quick_stop_has_its_own_ramp(scenario, more, hardest):
    _, v, trail = alone(scenario, stop=more)
    v.move_velocity(200.0).wait(5)
    v.quick_stop().wait(5)
    assert trail.hardest == pytest.approx(hardest, rel=0.02)


def test_a_virtual_axis_without_power_stops_on_a_ramp(scenario):
    cell, v, trail = alone(scenario, stop="deceleration = 500.0")
    v.move_velocity(100.0).wait(5)
    v.disable(coast=True).wait(5)
    assert v.snapshot.power_state is PowerState.SWITCH_ON_DISABLED
    cell.run(0.5)
    assert (v.velocity, v.state) == (0.0, AxisState.DISABLED)
    trail.must_be_smooth()
    assert cell.end_of(v.enable()) is None
    cell.run(0.3)
    assert v.velocity == 0.0


def test_a_halted_virtual_axis_does_not_continue_to_its_target(scenario):
    cell, v, _ = alone(scenario)
    v.move_absolute(300.0)
    cell.run(0.5)
    v.halt().wait(5)
    stood = v.position
    cell.run(2.0)
    assert v.position == stood
    v.disable().wait(5)
    v.enable().wait(5)
    cell.run(2.0)
    assert v.position == stood


def test_a_cyclic_target_of_long_ago_does_not_act_when_it_is_enabled_again(scenario):
    _, v, trail = alone(scenario)
    v.follow([(0.0, 0.0), (1.0, 20.0), (2.0, 0.0)]).wait(5)
    v.disable().wait(5)
    v.enable().wait(5)
    v.move_absolute(50.0).wait(5)
    v.follow([(0.0, 50.0), (1.0, 60.0), (2.0, 50.0)]).wait(5)
    assert v.position == 50.0
    trail.must_be_smooth()


def test_the_end_of_the_program_stops_and_disables_it(scenario):
    cell, v, trail = alone(scenario)
    v.move_velocity(100.0).wait(5)
    assert cell.ctrl_c(5.0) == []
    assert (v.velocity, v.snapshot.power_state) == (0.0, PowerState.SWITCH_ON_DISABLED)
    trail.must_be_smooth()


def test_leaving_the_block_stops_it(tmp_path):
    path = cell_file(tmp_path, "x", more=virtual())
    with Machine.simulated(path) as machine:
        v = machine["v"]
        v.enable().wait(5)
        v.move_velocity(100.0).wait(5)
    assert (v.snapshot.velocity, v.snapshot.power_state) == (0, PowerState.SWITCH_ON_DISABLED)


def test_a_dead_scan_leaves_no_virtual_axis_to_be_rescued(scenario):
    cell, v, _ = beside(scenario)
    v.move_velocity(50.0).wait(5)
    cell["x"].move_velocity(50.0).wait(5)
    cell.faults.wait = RuntimeError("planted")
    with pytest.raises(RuntimeError):
        cell.machine.sleep(0.1)
    with pytest.raises(AxisbusError, match="scan") as told:
        cell.machine.close()
    assert "x: stopped, power is off" in str(told.value)
    assert "v: " not in str(told.value)  # an axis of the scan alone has stopped with it


# -- limits ------------------------------------------------------------------------------------------------------------

LIMITED = "max_velocity = 400.0\nmax_acceleration = 2000.0\nposition_limits = [-100.0, 200.0]"


def test_a_motion_beyond_its_limits_is_refused_at_the_call(scenario):
    _, v, _ = alone(scenario, LIMITED)
    with pytest.raises(LimitError, match="position limits"):
        v.move_absolute(201.0)
    with pytest.raises(LimitError, match="velocity 401"):
        v.move_velocity(401.0)
    with pytest.raises(LimitError, match="acceleration"):
        v.move_absolute(10.0, acceleration=2001.0)
    with pytest.raises(LimitError, match="position limits"):
        v.follow([(0.0, 0.0), (1.0, 250.0), (2.0, 0.0)])
    with pytest.raises(LimitError, match="does not fit"):
        alone(scenario)[1].move_absolute(300_000.0)


def test_a_virtual_axis_at_a_velocity_stops_within_its_limits(scenario):
    cell, v, trail = alone(scenario, LIMITED)
    v.move_velocity(300.0).wait(5)
    cell.until(lambda: v.state is AxisState.ERRORSTOP, 5)
    cell.run(2.0)
    assert v.velocity == 0.0
    assert max(trail.positions) <= 200.0
    trail.must_be_smooth()
    assert cell.end_of(v.reset()) is None
    assert cell.end_of(v.move_absolute(0.0)) is None


def test_limits_hold_from_the_beginning_and_by_the_name_that_set_position_gives(scenario):
    cell, v, _ = alone(scenario, LIMITED)
    error = cell.failure_of(v.move_relative(-150.0))
    assert isinstance(error, LimitError)
    v.set_position(190.0).wait(5)
    error = cell.failure_of(v.move_relative(20.0))
    assert isinstance(error, LimitError)
    assert cell.end_of(v.move_relative(-20.0)) is None


def test_a_virtual_axis_whose_limits_exclude_0_reports_the_first_command(scenario):
    cell, v, _ = alone(scenario, "max_velocity = 400.0\nposition_limits = [50.0, 100.0]")
    assert cell.failure_of(v.move_velocity(-50.0)) is not None
    cell.run(0.5)
    v.reset().wait(5)
    v.set_position(60.0).wait(5)
    assert cell.end_of(v.move_absolute(90.0)) is None
    with pytest.raises(LimitError):
        v.move_absolute(10.0)


def test_a_trajectory_that_jumps_is_braked_before_it(scenario):
    cell, v, trail = alone(scenario, "max_velocity = 400.0\nmax_acceleration = 500.0")
    handle = v.follow(lambda t: 10.0 * (1 - math.cos(t)) + (100.0 if t > 2.0 else 0.0), duration=5.0)
    assert cell.failure_of(handle) is not None
    cell.run(1.0)
    assert v.velocity == 0.0
    assert max(trail.positions) < 30.0
    trail.must_be_smooth(1000.0)


# -- with others -------------------------------------------------------------------------------------------------------


def test_a_virtual_axis_moves_along_a_straight_line_with_a_drive(scenario):
    cell, v, trail = beside(scenario)
    x, group = cell["x"], cell.machine.group("x", "v")
    places = []
    cell.each_cycle(lambda *_: places.append((x.position, v.position)))
    assert cell.end_of(group.move_linear((45.0, -90.0), velocity=100.0)) is None
    cell.run(0.2)
    assert (cell.where("x"), v.position) == (pytest.approx(45.0, abs=0.1), -90.0)
    assert (
        max(abs(2 * a + b) for a, b in places) < 6.0
    )  # a drive is a cycle or two behind; an ideal axis is not
    assert cell.end_of(group.move_direct((0.0, 0.0))) is None
    assert v.position == 0.0
    trail.must_be_smooth()


def test_a_fault_of_the_drive_stops_it_on_its_ramp(scenario):
    cell, v, trail = beside(scenario)
    group = cell.machine.group("x", "v")
    line = group.move_linear((200.0, 200.0), velocity=100.0)
    cell.run(1.0)
    cell.drive("x").fault(0x2310)
    assert cell.failure_of(line) is not None
    cell.run(1.0)
    assert v.velocity == 0.0
    assert v.position < 180.0
    trail.must_be_smooth()


def test_a_lost_node_stops_it_too_and_its_own_is_never_lost(scenario):
    cell, v, trail = beside(scenario)
    cell["x"].move_velocity(50.0).wait(5)
    v.move_velocity(50.0).wait(5)
    cell.device("x").dials.dead = True
    cell.until(lambda: v.state is AxisState.STANDSTILL, 5)
    assert cell["x"].state is AxisState.ERRORSTOP
    assert v.velocity == 0.0
    trail.must_be_smooth()
    assert cell.end_of(v.move_absolute(0.0)) is None


def test_an_error_of_the_virtual_axis_stops_the_drive_of_its_cell(scenario):
    cell, v, _ = beside(scenario, LIMITED)
    cell["x"].move_velocity(50.0).wait(5)
    v.move_velocity(300.0).wait(5)
    cell.until(lambda: v.state is AxisState.ERRORSTOP, 5)
    cell.must_be_still("x", within=1.0, stages=ENABLED)


# -- missing functions -------------------------------------------------------------------------------------------------


def test_commands_that_need_a_drive_are_refused_with_the_reason(scenario):
    _, v, _ = alone(scenario)
    with pytest.raises(ArgumentError, match=r"virtual.*no drive that could be homed"):
        v.home(35)
    with pytest.raises(ArgumentError, match=r"virtual.*no torque"):
        v.torque_control(1.0)
    for name in ("temperature", "voltage", "current"):
        with pytest.raises(StateError, match=rf"virtual.*no {name}"):
            getattr(v, name)


# -- in real time ------------------------------------------------------------------------------------------------------


@OWN_PROCESS
@pytest.mark.parametrize("names", ["x", ""], ids=["beside a drive", "alone"])
@pytest.mark.parametrize("process", ["own", "thread"])
def test_on_a_bus_a_virtual_axis_is_moved_by_the_core_in_every_process(
    tmp_path, names, process, core_in_threads
):
    path = cell_file(tmp_path, names, bus=f'process = "{process}"', more=virtual())
    with Machine.open(path) as machine:
        v = machine["v"]
        assert v.homed
        v.enable().wait(5)
        v.move_absolute(30.0).wait(5)
        assert v.position == 30.0
        v.follow(lambda t: 30.0 + 5.0 * (1 - math.cos(t)), duration=2.0).wait(5)
        for axis in machine:
            axis.enable().wait(5)
        machine.group(*(axis.name for axis in machine)).move_linear(
            [10.0] * len(machine), velocity=50.0
        ).wait(5)
        assert v.position == 10.0
        v.move_velocity(50.0).wait(5)
        with pytest.raises(StateError, match="virtual"):
            _ = v.temperature
    assert (v.snapshot.velocity, v.snapshot.power_state) == (0, PowerState.SWITCH_ON_DISABLED)


@OWN_PROCESS
def test_if_the_core_is_killed_a_virtual_axis_is_not_reported(tmp_path):
    path = cell_file(tmp_path, "x", bus='process = "own"', more=virtual())
    machine = Machine.open(path)
    for axis in machine:
        axis.enable().wait(5)
        axis.move_velocity(50.0).wait(5)
    os.kill(machine._core.process, signal.SIGKILL)
    with pytest.raises(StaleError):
        for _ in range(100):
            _ = machine["v"].state
            time.sleep(0.05)
    with pytest.raises(AxisbusError) as told:
        machine.close()
    assert re.search(STOPPED, str(told.value))
    assert "v: " not in str(told.value)
