"""A touch probe reports the position of the axis at an edge: the latched position of its drive, never an old one."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from axisbus.cia301.nmt import NmtCommand
from axisbus.eds import builtin
from axisbus.errors import (
    ArgumentError,
    DriveError,
    LimitError,
    NodeError,
    ProbeError,
    Replaced,
    ScanError,
    StaleError,
    StateError,
    Stopped,
)
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.cell import GENERIC, MODULE, SCALE, Cell, Stage, cell_text
from kit.plant_probe import ENABLED, SWITCH_ON_DISABLED

DISARMED = 0


def mark(cell: Cell, begin: float, end: float, number: int = 1, name: str = "x") -> None:
    """Let an input be high where the motor is between two places (deg)."""
    cell.drive(name).touch_probe.put_mark(number, begin * SCALE, end * SCALE)


def flank(cell: Cell, level: bool, number: int = 1) -> float:
    """Give an input a level; return where the motor truly is."""
    cell.drive().touch_probe.set_input(number, level)
    return cell.where()


def armed(cell: Cell, *given, **options):
    return cell.x.probe(*given, **options).wait_armed(1.0)


def function(cell: Cell) -> int:
    return cell.drive().touch_probe.function


@pytest.mark.parametrize("velocity", [20.0, 133.0, 390.0])
def test_the_position_is_that_of_the_edge_and_not_of_a_cycle(scenario, velocity):
    cell = scenario.simulated().enabled()
    mark(cell, 17.31, 40.0)
    probe = armed(cell)
    move = cell.x.move_absolute(60.0, velocity=velocity, acceleration=4000.0)
    seen = probe.wait(5)
    assert seen.position == pytest.approx(17.31, abs=0.5 / SCALE)
    assert seen.result.edge == "rising"
    assert cell.where() - seen.position > 0.01 * velocity  # it was seen a cycle later, or more
    move.wait(5)
    assert len(probe.captures) == 1  # the first edge alone
    cell.run(0.1)
    assert function(cell) == DISARMED


def test_a_touch_probe_edge_is_reported_a_few_cycles_after_it(scenario):
    cell = scenario.simulated()
    probe = armed(cell)
    edge = cell.now
    flank(cell, True)
    probe.wait(1)
    assert 0.0 < probe.result.time - edge <= 0.01 + 4 * 0.01 + 1e-9


def test_a_touch_probe_energises_nothing_and_works_without_power(scenario):
    cell = scenario.simulated()
    probe = armed(cell)
    cell.drive().axis.motor.position += 12.5 * SCALE  # turned by hand
    cell.run(0.05)
    place = flank(cell, True)
    assert probe.wait(1).position == pytest.approx(place) == pytest.approx(12.5)
    assert not cell.was_energised()
    cell.must_be(SWITCH_ON_DISABLED)
    assert cell.x.state is AxisState.DISABLED


def test_a_touch_probe_works_in_fault_and_a_fault_does_not_end_it(scenario):
    cell = scenario.simulated().enabled()
    probe = armed(cell)
    cell.drive().fault(0x4310)
    cell.run(0.5)
    assert cell.x.state is AxisState.ERRORSTOP
    assert probe.active
    place = flank(cell, True)
    assert probe.wait(1).position == pytest.approx(place)
    again = armed(cell)
    flank(cell, False)
    flank(cell, True)
    again.wait(1)


def test_a_probe_of_both_edges_reports_one_of_each(scenario):
    cell = scenario.simulated().enabled()
    mark(cell, 10.0, 20.25)
    probe = armed(cell, edge="both")
    cell.x.move_absolute(40.0).wait(5)
    assert [(edge.edge, edge.position) for edge in probe.wait(1).captures] == [
        ("rising", pytest.approx(10.0)),
        ("falling", pytest.approx(20.25)),
    ]


def test_the_falling_edge_alone(scenario):
    cell = scenario.simulated().enabled()
    mark(cell, 10.0, 20.0)
    probe = armed(cell, edge="falling")
    cell.x.move_absolute(40.0).wait(5)
    assert probe.wait(1).position == pytest.approx(20.0)


def test_both_probe_inputs_are_armed_at_the_same_time_and_do_not_disturb_each_other(scenario):
    cell = scenario.simulated().enabled()
    mark(cell, 10.0, 50.0, 1)
    mark(cell, 20.0, 50.0, 2)
    first, second = cell.x.probe(1), cell.x.probe(2)
    first.wait_armed(1), second.wait_armed(1)
    cell.x.move_absolute(15.0).wait(5)
    first.wait(1)
    assert second.active
    third = armed(cell, 1, "falling")
    assert second.active
    cell.x.move_absolute(40.0).wait(5)
    assert second.wait(1).position == pytest.approx(20.0)
    assert third.active
    third.cancel().wait(1)
    assert function(cell) == DISARMED


def test_the_zero_pulse(scenario):
    cell = scenario.simulated().enabled()
    probe = armed(cell, source="zero pulse")
    flank(cell, True)  # of the input, which is not asked
    cell.x.move_absolute(150.0).wait(5)
    assert probe.wait(1).position == pytest.approx(cell.drive().params.increments_per_turn / SCALE)


def test_each_edge_of_a_continuous_probe_is_reported_and_missed_edges_are_counted(scenario):
    cell = scenario.simulated().enabled()
    probe = armed(cell, continuous=True)
    place = random.Random(1)
    told = []
    for _ in range(5):
        cell.x.move_absolute(place.uniform(-90.0, 90.0), acceleration=4000.0).wait(5)
        told.append(flank(cell, True))
        flank(cell, False)
        assert probe.next(1).position == pytest.approx(told[-1], abs=0.6 / SCALE)
    for _ in range(4):  # within a cycle
        flank(cell, True)
        flank(cell, False)
    last = probe.next(1)
    assert last.missed == 3
    assert [edge.missed for edge in probe.captures] == [0, 0, 0, 0, 0, 3]
    with pytest.raises(TimeoutError):
        probe.next(0.5)
    assert probe.active
    probe.cancel().wait(1)
    assert isinstance(probe.exception(), Stopped)
    with pytest.raises(Stopped):
        probe.next(0.5)
    assert function(cell) == DISARMED


def test_without_a_counter_an_edge_at_another_position_counts_as_new(scenario):
    cell = scenario.simulated(eds=str(without(scenario, "60D5", "60D6"))).enabled()
    probe = armed(cell, continuous=True)
    for goal in (10.0, 20.0, 30.0):
        cell.x.move_absolute(goal).wait(5)
        place = flank(cell, True)
        flank(cell, False)
        seen = probe.next(1)
        assert (seen.position, seen.missed) == (pytest.approx(place), None)
        cell.run(0.2)
    assert len(probe.captures) == 3  # none of them twice, however often it is looked at


def without(scenario: Stage, *objects: str) -> Path:
    """Write the generic EDS without some objects, and return its path."""
    text = builtin.resolve(GENERIC, Path()).read_text().replace("\r\n", "\n")
    for name in objects:
        head, rest = text.split(f"[{name}]\n", 1)
        text = head + rest[rest.index("\n[") + 1 :]
        text = "\n".join(line for line in text.split("\n") if not line.endswith(f"=0x{name}"))
    lines, number, listed = text.split("\n"), 0, False
    for at, line in enumerate(lines):
        listed = line == "[OptionalObjects]" or (listed and not line.startswith("["))
        if listed and line[:1].isdigit():
            number += 1
            lines[at] = f"{number}={line.partition('=')[2]}"
    at = lines.index("[OptionalObjects]")
    lines[at + 1] = f"SupportedObjects={number}"
    path = scenario.folder / "own.eds"
    path.write_text("\n".join(lines))
    return path


# -- stale values ----------------------------------------------------------------------------------------------------


def test_an_edge_from_before_the_arming_does_not_count(scenario):
    cell = scenario.simulated().enabled()
    drive = cell.drive().touch_probe
    drive.take(0x0011)  # another tool has armed it, and there was an edge
    flank(cell, True)
    assert drive.status == 0x0003
    cell.x.move_absolute(30.0).wait(5)
    probe = armed(cell)
    cell.run(0.5)
    assert probe.active
    assert not probe.captures
    flank(cell, False)
    place = flank(cell, True)
    assert probe.wait(1).position == pytest.approx(place) == pytest.approx(30.0)


def test_a_drive_whose_probe_bits_stay_set_is_refused(scenario, golden):
    cell = scenario.simulated()
    drive = cell.drive()
    drive.touch_probe.take(0x0011)
    flank(cell, True)
    drive.dials.probe_bits_stay = True
    probe = cell.x.probe()
    error = cell.failure_of(probe)
    assert isinstance(error, ProbeError)
    golden("probe_keeps_its_bits", error)
    assert not probe.captures
    with pytest.raises(StateError):
        probe.position  # noqa: B018


def test_a_drive_that_arms_nothing_is_named(scenario, golden):
    cell = scenario.simulated()
    cell.drive().dials.probe_deaf = True
    golden("probe_is_not_armed", cell.failure_of(cell.x.probe()))


def test_a_probe_that_another_program_switches_off_is_reported(scenario, golden):
    cell = scenario.simulated()
    probe = armed(cell)
    cell.drive().touch_probe.take(0)
    golden("probe_switched_off", cell.failure_of(probe))


def test_inputs_that_another_tool_has_armed_stay_armed(scenario):
    cell = scenario.simulated()
    cell.drive().touch_probe.take(0xD1C0)  # input 2, and bits of the maker's own
    probe = armed(cell)
    assert function(cell) == 0xD1D1
    flank(cell, True)
    probe.wait(1)
    cell.run(0.1)
    assert function(cell) == 0xD1C0
    cell.x.probe_abort(2).wait(1)
    assert function(cell) == 0xC0C0


def test_inputs_that_another_tool_arms_in_between_stay_armed(scenario):
    cell = scenario.simulated()
    armed(cell).cancel().wait(1)
    cell.drive().touch_probe.take(0x1100)
    armed(cell)
    assert function(cell) == 0x1111


def test_a_latched_position_without_a_fresh_6064h_is_not_reported(scenario):
    cell = scenario.simulated().enabled()
    probe = armed(cell)
    cell.device().dials.tpdos_stop = frozenset({1, 2, 3, 4})
    cell.run(1.0)
    flank(cell, True)
    error = cell.failure_of(probe)
    assert isinstance(error, StaleError)
    assert not probe.captures
    assert "6064h" in str(error)


# -- windows ---------------------------------------------------------------------------------------------------------


def test_an_edge_outside_of_the_window_does_not_count(scenario):
    cell = scenario.simulated().enabled()
    for begin in (5.0, 25.0, 45.0):
        mark(cell, begin, begin + 5.0)
    probe = armed(cell, window=(20.0, 40.0))
    cell.x.move_absolute(60.0).wait(5)
    assert probe.wait(1).position == pytest.approx(25.0)
    assert len(probe.captures) == 1


def test_a_window_counts_as_the_axis_does(scenario):
    cell = scenario.simulated().enabled()
    cell.x.set_position(100.0).wait(1)
    for begin in (5.0, 25.0):
        mark(cell, begin, begin + 5.0)
    probe = armed(cell, window=(120.0, 140.0))
    cell.x.move_relative(60.0).wait(5)
    assert probe.wait(1).position == pytest.approx(125.0)


def test_a_probe_window_reaches_over_the_end_of_a_turn(scenario):
    cell = scenario.simulated(axis="modulo = 360.0").enabled()
    for begin in (100.0, 355.0, 365.0):
        mark(cell, begin, begin + 2.0)
    probe = armed(cell, window=(350.0, 10.0), continuous=True)
    cell.x.move_relative(400.0, velocity=200.0).wait(10)
    assert [(edge.position, edge.unwrapped) for edge in probe.captures] == [
        (pytest.approx(355.0), pytest.approx(355.0)),
        (pytest.approx(5.0), pytest.approx(365.0)),
    ]
    probe.cancel()


# -- where the axis counts from --------------------------------------------------------------------------------------


def test_a_touch_probe_reports_positions_of_the_axis(scenario):
    cell = scenario.simulated(axis='invert = "master"').enabled()
    cell.x.set_position(100.0).wait(1)
    probe = armed(cell)
    cell.x.move_relative(25.0).wait(5)
    flank(cell, True)
    assert probe.wait(1).position == pytest.approx(cell.x.position) == pytest.approx(125.0, abs=0.1)


def test_a_touch_probe_works_beyond_the_wrap_of_the_count_of_the_drive(scenario):
    cell = scenario.simulated()
    cell.drive().axis.motor.position = 2**31 - 1000.0
    cell.run(0.1)
    cell.enabled()
    cell.x.set_position(0.0).wait(1)
    mark(cell, (2**31 + 500) / SCALE, (2**31 + 900) / SCALE)
    probe = armed(cell)
    cell.x.move_velocity(50.0)
    assert probe.wait(2).position == pytest.approx(15.0)


def test_homing_ends_a_touch_probe_and_a_probe_during_homing_is_refused(scenario, golden):
    cell = scenario.simulated().enabled()
    probe = armed(cell)
    home = cell.x.home()
    cell.until(lambda: cell.x.state is AxisState.HOMING)
    refused = cell.x.probe()
    assert isinstance(cell.failure_of(refused), StateError)
    assert isinstance(cell.failure_of(probe), Replaced)
    golden("probe_homed", probe.exception())
    home.wait(5)
    assert function(cell) == DISARMED


# -- how it ends -----------------------------------------------------------------------------------------------------


def test_a_wait_that_runs_out_leaves_it_armed_and_a_cancelled_one_leaves_nothing(scenario):
    cell = scenario.simulated()
    probe = armed(cell)
    with pytest.raises(TimeoutError):
        probe.wait(0.3)
    assert function(cell) == 0x0011
    assert probe.active
    assert probe.cancel().wait(1).done
    assert function(cell) == DISARMED
    assert probe.aborted
    assert probe.cancel().wait(1).done  # harmless when repeated
    flank(cell, True)
    cell.run(0.2)
    assert not probe.captures


def test_the_end_of_a_with_block_switches_it_off(scenario):
    cell = scenario.simulated()
    with armed(cell) as probe:
        assert function(cell) == 0x0011
    cell.end_of(probe)
    cell.run(0.1)
    assert probe.aborted
    assert function(cell) == DISARMED


@pytest.mark.parametrize("cycles", range(9))
def test_a_touch_probe_can_be_cancelled_in_any_cycle(scenario, cycles):
    cell = scenario.simulated()
    probe = cell.x.probe()
    for _ in range(cycles):
        cell.run(0.01)
    probe.cancel().wait(1)
    assert probe.aborted
    cell.run(0.2)
    assert function(cell) == DISARMED


def test_a_second_request_replaces_the_first_and_outlives_its_cancel(scenario):
    cell = scenario.simulated()
    first = armed(cell)
    second = cell.x.probe(1, "falling")
    second.wait_armed(1)
    assert isinstance(first.exception(), Replaced)
    first.cancel().wait(1)
    assert second.active
    flank(cell, True)
    flank(cell, False)
    assert second.wait(1).result.edge == "falling"
    assert not first.captures


def test_a_request_right_after_a_cancel_is_armed_and_both_are_reported(scenario):
    cell = scenario.simulated()
    first = armed(cell)
    gone, second = first.cancel(), cell.x.probe()
    second.wait_armed(1)
    assert gone.wait(1).done
    assert second.active
    assert function(cell) == 0x0011


def test_a_node_that_is_lost_ends_it(scenario, golden):
    cell = scenario.simulated()
    probe = armed(cell)
    cell.device().dials.dead = True
    error = cell.failure_of(probe)
    assert isinstance(error, NodeError)
    golden("probe_node_lost", error)
    late = cell.failure_of(cell.x.probe())
    assert isinstance(late, StateError)
    golden("probe_without_node", late)


def test_a_drive_that_restarts_ends_it(scenario):
    cell = scenario.simulated("xy")
    probe, other = armed(cell), cell["y"].probe()
    cell.nmt(NmtCommand.RESET_NODE, 1)
    assert isinstance(cell.failure_of(probe), NodeError)
    assert not other.wait_armed(1).captures


@pytest.mark.parametrize("place", ["commit", "wait"])
def test_a_scan_that_dies_ends_it(scenario, place):
    cell = scenario.simulated()
    probe = armed(cell)
    setattr(cell.faults, place, OSError("gone"))
    with pytest.raises(OSError, match="gone"):
        cell.run(0.2)
    assert isinstance(probe.exception(), ScanError)


def test_ctrl_c_ends_a_touch_probe_and_leaves_nothing_armed(scenario):
    cell = scenario.simulated().enabled()
    probe = armed(cell)
    cell.ctrl_c(5.0)
    assert isinstance(probe.exception(), Stopped)
    assert function(cell) == DISARMED


def test_an_interrupt_of_one_command_ends_it(scenario):
    cell = scenario.simulated().enabled()
    probe = armed(cell)
    cell.machine._core.scan.request_halt("Ctrl-C", 1)
    assert isinstance(cell.failure_of(probe), Stopped)
    cell.run(0.1)
    assert function(cell) == DISARMED


# -- the way to the drive --------------------------------------------------------------------------------------------


def test_a_drive_that_refuses_is_reported(scenario, golden):
    cell = scenario.simulated()
    cell.device().dials.sdo_write_aborts[0x60B8, 0] = 0x06090030
    golden("probe_refused", cell.failure_of(cell.x.probe()))


def test_a_pause_of_sdo_is_survived_and_silence_is_reported(scenario):
    cell = scenario.simulated()
    probe = armed(cell)
    dials = cell.device().dials
    dials.sdo_silent = True
    place = flank(cell, True)
    cell.run(0.5)
    dials.sdo_silent = False
    assert probe.wait(3).position == pytest.approx(place)
    dials.sdo_silent = True
    silent = cell.x.probe()
    assert "has not answered" in cell.failure_of(silent, 20.0).message


def test_slow_sdo_answers_delay_the_result_and_do_not_change_it(scenario):
    cell = scenario.simulated().enabled()
    cell.device().dials.sdo_delay = 0.04
    mark(cell, 12.34, 50.0)
    probe = cell.x.probe().wait_armed(2)
    cell.x.move_absolute(45.0).wait(5)
    assert probe.wait(1).position == pytest.approx(12.34)


def test_late_cycles_do_not_change_the_latched_position(scenario):
    cell = scenario.simulated().enabled()
    mark(cell, 12.34, 50.0)
    probe = armed(cell)
    move = cell.x.move_absolute(45.0)
    cell.faults.wait_late = 0.004
    assert probe.wait(3).position == pytest.approx(12.34)
    move.wait(5)


def test_a_probe_does_not_change_the_motion_of_an_axis_on_a_trajectory(scenario):
    ways = []
    for probed in (True, False):
        cell = scenario.simulated("x", period="4ms").enabled()
        mark(cell, 20.0, 30.0)
        probe = cell.x.probe(1, "both")
        if not probed:
            probe.cancel()
        cell.run(0.2)
        since = cell.moment()
        cell.x.follow(TrapezoidalTrajectory(0.0, 60.0, 100.0, 500.0)).wait(5)
        cell.must_be_still(within=0.5, stages=ENABLED)
        ways.append(cell.positions(since=since))
        assert [edge.position for edge in probe.captures] == pytest.approx([20.0, 30.0] if probed else [])
    assert ways[0] == ways[1]


# -- until an edge ---------------------------------------------------------------------------------------------------


def test_a_search_ends_at_standstill_beyond_the_edge_and_reports_the_position_of_the_edge(scenario):
    cell = scenario.simulated().enabled()
    mark(cell, 12.34, 40.0)
    search = cell.x.probe_move(40.0, velocity=50.0, acceleration=500.0)
    assert search.wait(5).position == pytest.approx(12.34)
    assert cell.speed() == 0.0
    assert (
        12.34 + 2.5 < cell.where() < 12.34 + 2.5 + 50.0 * 0.08
    )  # braking, and the distance until it was seen
    assert cell.x.state is AxisState.STANDSTILL
    cell.must_be_still(within=0.1, stages=ENABLED)
    assert function(cell) == DISARMED
    cell.x.move_absolute(0.0).wait(5)


def test_no_motion_before_the_input_is_armed(scenario):
    cell = scenario.simulated().enabled()
    cell.drive().dials.probe_deaf = True
    search = cell.x.probe_move(40.0)
    assert isinstance(cell.failure_of(search), DriveError)
    cell.must_be_still(within=0.1, stages=ENABLED)
    assert cell.farthest() == (0.0, 0.0)


def test_a_search_without_an_edge_reports_so_at_its_end(scenario, golden):
    cell = scenario.simulated().enabled()
    search = cell.x.probe_move(30.0)
    error = cell.failure_of(search)
    assert isinstance(error, ProbeError)
    golden("probe_move_without_edge", error)
    assert cell.where() == pytest.approx(30.0, abs=0.05)
    cell.run(0.1)
    assert function(cell) == DISARMED


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3])
def test_an_edge_at_the_very_end_is_found(scenario, delay):
    cell = scenario.simulated().enabled()
    mark(cell, 29.99, 40.0)
    search = cell.x.probe_move(30.0)
    cell.until(lambda: cell.where() > 20.0)
    cell.device().dials.sdo_delay = delay  # it has arrived before the edge is seen
    assert search.wait(5).position == pytest.approx(29.99)


@pytest.mark.parametrize("after", [0.0, 0.03, 0.1, 0.3])
@pytest.mark.parametrize("how", ["halt", "stop", "quick_stop", "disable", "cancel", "move"])
def test_another_command_ends_a_search(scenario, how, after):
    cell = scenario.simulated().enabled()
    mark(cell, 80.0, 90.0)
    search = cell.x.probe_move(100.0)
    cell.run(after)
    other = (
        cell.x.move_absolute(-10.0)
        if how == "move"
        else search.cancel()
        if how == "cancel"
        else getattr(cell.x, how)()
    )
    other.wait(5)
    assert search.aborted, search.exception()
    cell.run(0.5)
    assert cell.speed() == 0.0
    assert cell.farthest()[1] < 60.0
    assert function(cell) == DISARMED


def test_a_touch_probe_that_fails_halts_the_search(scenario):
    cell = scenario.simulated().enabled()
    search = cell.x.probe_move(100.0)
    cell.until(lambda: cell.where() > 10.0)
    cell.drive().touch_probe.take(0)
    assert isinstance(cell.failure_of(search), DriveError)
    cell.must_be_still(within=0.5, stages=ENABLED)
    assert cell.where() < 40.0


def test_another_request_for_its_input_halts_the_search(scenario):
    cell = scenario.simulated().enabled()
    search = cell.x.probe_move(100.0)
    cell.until(lambda: cell.where() > 10.0)
    probe = cell.x.probe()
    assert isinstance(cell.failure_of(search), Replaced)
    cell.must_be_still(within=0.5, stages=ENABLED)
    assert probe.active


@pytest.mark.nets("the stop sequence")
def test_a_node_that_dies_ends_a_search_and_the_others_stop(scenario):
    cell = scenario.simulated("xy").enabled()
    cell["y"].move_velocity(50.0)
    search = cell["x"].probe_move(200.0)
    cell.until(lambda: cell.where("x") > 10.0)
    cell.device("x").dials.dead = True
    cell.must_be_still("y", within=1.0, stages=ENABLED)
    assert isinstance(cell.failure_of(search), NodeError)


def test_a_fault_after_the_edge_is_reported(scenario):
    cell = scenario.simulated().enabled()
    mark(cell, 20.0, 90.0)
    search = cell.x.probe_move(100.0)
    cell.until(lambda: bool(search.captures))
    cell.drive().fault(0x4310)
    assert isinstance(cell.failure_of(search), DriveError)
    assert search.position == pytest.approx(20.0)


def test_a_search_begins_at_standstill_and_within_the_limits(scenario):
    cell = scenario.simulated(axis="position_limits = [-50.0, 50.0]")
    assert isinstance(cell.failure_of(cell.x.probe_move(10.0)), StateError)  # without power
    cell.turning(30.0)
    assert isinstance(cell.failure_of(cell.x.probe_move(10.0)), StateError)
    with pytest.raises(LimitError):
        cell.x.probe_move(60.0)
    with pytest.raises(ArgumentError):
        cell.x.probe_move(10.0, edge="both")
    assert function(cell) == DISARMED


# -- arguments -------------------------------------------------------------------------------------------------------


def test_a_drive_without_a_touch_probe_is_refused_with_object_and_file(scenario):
    cell = scenario.simulated(eds=MODULE)
    for ask in (cell.x.probe, cell.x.probe_abort):
        with pytest.raises(StateError, match="60B8h") as error:
            ask()
        assert "gim6010-8.eds" in error.value.observed


def test_a_drive_with_one_input_is_refused_the_other(scenario):
    cell = scenario.simulated(eds=str(without(scenario, "60BC", "60BD")))
    with pytest.raises(StateError, match="60BCh"):
        cell.x.probe(2)
    armed(cell, 1, "both")


@pytest.mark.parametrize(
    ("given", "options"),
    [
        ((3,), {}),
        ((True,), {}),
        (("1",), {}),
        ((1, "up"), {}),
        ((1, None), {}),
        ((1, "falling"), {"source": "zero pulse"}),
        ((1,), {"source": "60D0h"}),
        ((1,), {"window": 5.0}),
        ((1,), {"window": (1.0,)}),
        ((1,), {"window": (1.0, float("nan"))}),
        ((1,), {"window": (2.0, 1.0)}),
    ],
)
def test_invalid_arguments_of_a_probe_are_refused_at_the_call(scenario, given, options):
    cell = scenario.simulated()
    with pytest.raises(ArgumentError):
        cell.x.probe(*given, **options)
    cell.run(0.1)
    assert function(cell) == DISARMED


def test_a_window_needs_a_homed_axis(scenario):
    text = cell_text(axis="position_limits = [-180.0, 180.0]").replace("required = false", "required = true")
    cell = scenario.simulated(text=text)
    with pytest.raises(ArgumentError, match="not homed"):
        cell.x.probe(window=(0.0, 1.0))
