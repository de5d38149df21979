"""Groups: no axis starts alone, a line is left by all axes or by none, and harmless events have no effect."""

from __future__ import annotations

import signal
import threading
from collections import defaultdict
from itertools import pairwise

import pytest

from axisbus.errors import ArgumentError, CommandError, Interrupted, LimitError, StateError
from axisbus.machine.groups import Group
from axisbus.motion.axis import accept_motion
from axisbus.motion.group import path_motion
from axisbus.motion.group.path_speed import PathSpeed
from axisbus.motion.group.start_barrier import StartBarrier
from kit.bounds.group_starts import starts
from kit.cell import Cell
from kit.plant_probe import ENABLED, OFF, SWITCH_ON_DISABLED

LIMIT = 1000.0  # deg/s², of every axis
JOLT = 1.2 * LIMIT  # only a quick stop or a fault may exceed it
AXIS = f"max_acceleration = {LIMIT}"

# How one axis may leave a group: a call, and an additional motion that its plant may then make.
LEAVING = {
    "halt": lambda x: x.halt(),
    "stop": lambda x: x.stop(),
    "disable": lambda x: x.disable(),
    "quick_stop": lambda x: x.quick_stop(),
    "coast": lambda x: x.disable(coast=True),
    "a move of its own": lambda x: x.move_relative(-5.0),
}
# Events and commands that must be harmless at any time.
HARMLESS = {
    "enable": lambda group: group.enable(),
    "reset": lambda group: group.reset(),
    "release": lambda group: group.release(),
}


def three(scenario, **changes: str) -> tuple[Cell, Group]:
    """Three axes in virtual time, and the group of them."""
    cell = scenario.simulated("xyz", axis=AXIS, **changes)
    return cell, cell.machine.group("x", "y", "z")


def on_a_line(scenario) -> tuple[Cell, Group, object]:
    """Three axes in the middle of a long straight line, at full speed."""
    cell, group = three(scenario)
    cell.enabled()
    handle = group.move_linear([400.0, 200.0, 400.0], velocity=300.0, acceleration=900.0)
    cell.run(1.0)
    for name in "xyz":
        cell.must_move(name)
    return cell, group, handle


def must_be_smooth(cell: Cell, since: float, names: str = "xyz") -> None:
    for name in names:
        assert cell.hardest_change(name, since) <= JOLT, name


def must_be_on_the_line(cell: Cell, since: float) -> None:
    """y goes half as far as x and z, at every moment."""
    ways = zip(*(cell.positions(name, since) for name in "xyz"), strict=True)
    assert max(max(abs(x - 2 * y), abs(x - z)) for x, y, z in ways) < 0.1


# -- the start -----------------------------------------------------------------------------------------------------------


def test_all_axes_start_in_one_sync_from_any_modes_of_their_drives(tmp_path):
    """``make bounds`` starts them a thousand times."""
    came = starts(seed=1, count=250, folder=tmp_path)
    assert came.apart == 0
    assert came.changed > 80


def test_the_search_finds_an_axis_that_starts_late(tmp_path, monkeypatch):
    """The last axis at the start barrier is held there for two cycles more."""
    passes, came = StartBarrier.pass_through, defaultdict(list)

    def pass_through(gate, comer):
        if not passes(gate, comer):
            return False
        came[gate].append(comer)
        return len(came[gate]) != 3 and came[gate].count(comer) != 2

    monkeypatch.setattr(StartBarrier, "pass_through", pass_through)
    monkeypatch.setattr("kit.bounds.group_starts._WAYS", (lambda group, goal: group.move_direct(goal),))
    assert starts(seed=1, count=1, folder=tmp_path).apart == 2


# -- a group of one axis -----------------------------------------------------------------------------------------------


def test_a_group_of_one_axis_is_a_group_and_takes_every_command(scenario):
    cell = scenario.simulated("xy", axis=AXIS)
    cell.turning(90.0, names="y")
    one = cell.machine.group("x")
    for command in (one.halt, one.reset, one.enable):
        assert cell.end_of(command()) is None
    one.move_linear([30.0], velocity=100.0).wait(5)
    one.move_direct([10.0]).wait(5)
    cell.run(0.3)
    assert cell.where("x") == pytest.approx(10.0, abs=0.1)
    one.stop().wait(5)
    one.release().wait(5)
    one.disable().wait(5)
    cell.must_be(SWITCH_ON_DISABLED, "x")
    cell.must_move("y")
    assert cell.scan_runs


def test_the_handle_of_a_group_of_one_axis_ends_in_real_time_too(scenario):
    cell = scenario.real("x", axis=AXIS)
    handle = cell.machine.group("x").enable()
    handle.wait(5)
    cell.must_be(ENABLED)
    assert cell.scan_runs


def test_an_axis_that_is_named_twice_is_refused(scenario, golden):
    cell = scenario.simulated("x")
    with pytest.raises(ArgumentError) as caught:
        cell.machine.group("x", "x")
    golden("group_named_twice", caught.value)


def test_two_threads_that_create_the_same_group_get_the_same_object(scenario):
    """A second one in the place of the first would leave the first one's line without a clock."""
    cell, group = three(scenario)
    cell.enabled()
    handle = group.move_linear([100.0, 50.0, 100.0], velocity=100.0)
    cell.run(0.5)
    cell.machine._core.scan.add_group(("x", "y", "z"), ("x", "y", "z"))  # the action of the second thread
    handle.wait(5)
    assert cell.where("x") == pytest.approx(100.0, abs=0.1)


# -- the gate ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("how", LEAVING)
def test_an_axis_that_fails_before_the_common_start_keeps_all_from_moving(scenario, how):
    cell, group = three(scenario)
    cell.enabled()
    cell.device("z").dials.sdo_delay = 0.1  # x and y wait for it
    since = cell.moment()
    handle = group.move_direct([50.0, 50.0, 50.0])
    cell.run(0.15)
    LEAVING[how](cell["x"])
    error = cell.failure_of(handle)
    cell.run(3.0)
    assert isinstance(error, Interrupted)
    for name in "yz":
        cell.must_not_leap(name, since=since, way=0.01, speed=0.1)
    if how != "a move of its own":
        cell.must_not_leap("x", since=since, way=0.01, speed=0.1)
    group.enable().wait(5) if how in ("halt", "disable", "coast") else None
    if how == "halt":
        group.move_direct([50.0, 50.0, 50.0]).wait(10)


@pytest.mark.parametrize("how", ["halt", "disable"])
@pytest.mark.parametrize("kind", ["direct", "linear"])
def test_all_axes_start_or_none_in_whichever_cycle_one_is_removed(scenario, how, kind):
    """Also in the very cycle in which the gate would open: every cycle around it is tried."""
    outcomes = set()
    for cycles in range(1, 30):
        cell, group = three(scenario)
        cell.enabled()
        cell.device("z").dials.sdo_delay = 0.02
        since = cell.moment()
        if kind == "direct":
            handle = group.move_direct([50.0, 50.0, 50.0])
        else:
            handle = group.move_linear([50.0, 50.0, 50.0], velocity=100.0)
        cell.run(cycles * 0.01)
        LEAVING[how](cell["x"])
        cell.failure_of(handle)
        cell.run(1.0)
        moved = [cell.top_speed(name, since) > 0.1 for name in "xyz"]
        assert len(set(moved)) == 1, (cycles, moved)
        must_be_smooth(cell, since)
        outcomes.add(moved[0])
    assert outcomes == {True, False}


@pytest.mark.parametrize("how", ["halt", "stop", "disable", "quick_stop", "coast"])
def test_no_axis_is_energised_by_a_group_enable_if_one_axis_leaves_it(scenario, golden, how):
    cell, group = three(scenario)
    cell.drive("z").dials.transition_delay = {2: 0.5}
    since = cell.moment()
    handle = group.enable()
    cell.run(0.2)
    LEAVING[how](cell["x"])
    error = cell.failure_of(handle)
    cell.run(2.0)
    for name in "xyz":
        assert not cell.was_energised(name, since), name
    assert isinstance(error, Interrupted)
    if how == "disable":
        golden("group_not_started", error)
    cell.drive("z").dials.transition_delay = {}
    group.reset().wait(1)
    group.enable().wait(5)
    assert {cell.stage(name) for name in "xyz"} == {ENABLED}


@pytest.mark.parametrize("how", ["disable", "coast"])
def test_all_axes_are_energised_or_none_in_whichever_cycle_one_is_disabled(scenario, how):
    outcomes = set()
    for cycles in range(1, 35):
        cell, group = three(scenario)
        cell.drive("z").dials.transition_delay = {2: 0.08}
        since = cell.moment()
        handle = group.enable()
        cell.run(cycles * 0.01)
        LEAVING[how](cell["x"])
        cell.end_of(handle)
        cell.run(1.0)
        energised = [cell.was_energised(name, since) for name in "xyz"]
        assert len(set(energised)) == 1, (cycles, energised)
        outcomes.add(energised[0])
    assert outcomes == {True, False}


def test_a_fault_before_the_common_start_keeps_all_from_moving(scenario):
    """The fault is diagnosed for a while before it is reported; no axis starts meanwhile."""
    cell, group = three(scenario, more='[groups.others]\naxes = ["y", "z"]\n')
    cell.enabled()
    cell.device("z").dials.sdo_delay = 0.1
    cell.device("x").dials.sdo_delay = 0.1
    since = cell.moment()
    handle = group.move_direct([50.0, 50.0, 50.0])
    cell.run(0.2)
    cell.drive("x").fault(0x2310)
    error = cell.failure_of(handle)
    cell.run(3.0)
    assert "2310" in str(error)
    for name in "xyz":
        cell.must_not_leap(name, since=since, way=0.01, speed=0.1)


def test_the_command_of_one_axis_survives_the_end_of_the_groups_command(scenario):
    """x is being enabled by its own command, which the group's one joins; that the group's is called off takes nothing from it."""
    cell, group = three(scenario)
    for name in "xz":
        cell.drive(name).dials.transition_delay = {2: 0.3}
    own = cell["x"].enable()
    cell.run(0.05)
    handle = group.enable()
    cell.run(0.05)
    cell["y"].disable()
    assert cell.failure_of(handle) is not None
    own.wait(5)
    cell.must_be(ENABLED, "x")
    for name in "yz":
        cell.must_be(SWITCH_ON_DISABLED, name)


def test_a_group_command_that_one_axis_refuses_leaves_no_axis_waiting_for_the_previous_one(scenario):
    cell, group = three(scenario, more="")
    cell.enabled()
    cell.device("z").dials.sdo_delay = 0.2
    first = group.move_direct([50.0, 50.0, 50.0])
    cell.run(0.1)
    cell["y"].stop()
    second = group.move_direct([60.0, 60.0, 60.0])  # y refuses
    for handle in (first, second):
        assert cell.failure_of(handle) is not None
    cell.run(2.0)
    assert {cell["x"].state.value, cell["z"].state.value} == {"Standstill"}
    for name in "xyz":
        cell.must_be(ENABLED, name)
        assert cell.where(name) == pytest.approx(0.0, abs=0.01)


# -- straight lines ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("whose", ["the group", "another group", "one axis"])
@pytest.mark.parametrize("what", HARMLESS)
def test_a_harmless_event_does_not_affect_a_running_line(scenario, what, whose):
    cell, group, handle = on_a_line(scenario)
    since = cell.moment()
    others = {"the group": group, "another group": cell.machine.group("y", "x"), "one axis": cell["y"]}
    for _ in range(3):
        assert cell.end_of(HARMLESS[what](others[whose])) is None
        cell.run(0.03)
    assert handle.active
    handle.wait(5)
    must_be_smooth(cell, since)
    must_be_on_the_line(cell, since)
    assert cell.where("x") == pytest.approx(400.0, abs=0.1)
    assert cell.where("y") == pytest.approx(200.0, abs=0.1)


@pytest.mark.parametrize("what", HARMLESS)
def test_a_halt_on_a_line_continues_braking_along_it_during_harmless_commands(scenario, what):
    cell, group, handle = on_a_line(scenario)
    since = cell.moment()
    halt = group.halt()
    cell.run(0.05)
    for _ in range(4):
        HARMLESS[what](group)
        cell.run(0.02)
    halt.wait(3)
    assert isinstance(handle.exception(), Interrupted)
    must_be_smooth(cell, since)
    must_be_on_the_line(cell, since)
    for name in "xyz":
        cell.must_be_still(name, within=0.1, stages=ENABLED, for_good=0.3)
        assert cell[name].error is None
    group.move_linear([0.0, 0.0, 0.0], velocity=200.0).wait(10)
    assert cell.where("x") == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("how", ["halt", "stop", "disable"])
def test_one_axis_that_stops_on_a_line_brakes_all_of_them_along_it(scenario, how):
    cell, _, handle = on_a_line(scenario)
    since = cell.moment()
    own = LEAVING[how](cell["x"])
    assert isinstance(cell.failure_of(handle), Interrupted)
    own.wait(5)
    for name in "yz":
        cell.must_be_still(name, within=1.0, stages=ENABLED)
    must_be_smooth(cell, since)
    must_be_on_the_line(cell, since)


def test_a_line_commanded_while_another_brakes_is_refused_and_the_braking_continues(scenario):
    cell, group, _ = on_a_line(scenario)
    since = cell.moment()
    halt = group.halt()
    cell.run(0.1)
    refused = group.move_linear([0.0, 0.0, 0.0], velocity=200.0)
    assert isinstance(cell.failure_of(refused), StateError)
    halt.wait(3)
    must_be_smooth(cell, since)
    must_be_on_the_line(cell, since)
    group.move_linear([0.0, 0.0, 0.0], velocity=200.0).wait(10)


def test_a_halt_that_a_move_interrupts_on_one_axis_brakes_the_others_to_the_end(scenario):
    cell, group, _ = on_a_line(scenario)
    since = cell.moment()
    group.halt()
    cell.run(0.1)
    cell["x"].move_absolute(0.0)
    cell.run(3.0)
    must_be_smooth(cell, since, "yz")
    for name in "yz":
        cell.must_be_still(name, within=0.1, stages=ENABLED)


# -- exceptions in the scan's thread end one command -------------------------------------------------------------------


def must_still_work(cell: Cell, names: str = "xyz") -> None:
    """The scan lives: every axis is at standstill, and takes commands again after a reset."""
    assert cell.scan_runs
    for name in names:
        cell.run(1.0)
        cell[name].reset().wait(2)
        cell[name].enable().wait(5)
        here = cell.where(name)
        cell[name].move_relative(5.0).wait(5)
        cell.run(0.3)
        assert cell.where(name) == pytest.approx(here + 5.0, abs=0.1)


def test_an_exception_while_a_command_is_taken_ends_it_alone_and_stops_its_axis(
    scenario, golden, monkeypatch
):
    cell, _ = three(scenario, more='[groups.one]\naxes = ["x"]\n[groups.two]\naxes = ["y", "z"]\n')
    cell.turning(90.0)
    since = cell.moment()
    with monkeypatch.context() as patch:
        patch.setattr(accept_motion, "_within_reach", lambda *_: 1 // 0)
        handle = cell["x"].move_absolute(10.0)
        error = cell.failure_of(handle)
    assert isinstance(error, CommandError)
    assert isinstance(error.__cause__, ZeroDivisionError)
    assert error.__cause__.__traceback__ is not None
    golden("command_broke_off", error)
    cell.must_be_still("x", within=1.0, stages=ENABLED)
    must_be_smooth(cell, since)
    cell.must_move("y")  # of another group: the fault policy leaves it alone
    must_still_work(cell, "x")


def test_the_fault_policy_acts_on_a_command_that_raises_in_the_scan(scenario, monkeypatch):
    cell, _ = three(scenario)
    cell.turning(90.0)
    with monkeypatch.context() as patch:
        patch.setattr(accept_motion, "_within_reach", lambda *_: 1 // 0)
        cell.failure_of(cell["x"].move_absolute(10.0))
    for name in "xyz":
        cell.must_be_still(name, within=1.0, stages=ENABLED)


def test_an_exception_while_a_line_is_planned_ends_it_without_a_motion(scenario, monkeypatch):
    cell, group = three(scenario)
    cell.enabled()
    since = cell.moment()
    with monkeypatch.context() as patch:
        patch.setattr(path_motion, "plan_line", lambda *_: 1 // 0)
        error = cell.failure_of(group.move_linear([50.0, 50.0, 50.0], velocity=100.0))
    assert isinstance(error, CommandError)
    assert isinstance(error.__cause__, ZeroDivisionError)
    for name in "xyz":
        cell.must_not_leap(name, since=since, way=0.01, speed=0.1)
    cell.run(0.3)
    group.move_linear([50.0, 50.0, 50.0], velocity=100.0).wait(5)


def test_an_exception_in_the_middle_of_a_line_stops_all_of_its_axes(scenario, monkeypatch):
    cell, _, handle = on_a_line(scenario)
    with monkeypatch.context() as patch:
        patch.setattr(PathSpeed, "advance", lambda *_: 1 // 0)
        error = cell.failure_of(handle)
        assert isinstance(error, CommandError)
        for name in "xyz":
            cell.must_be_still(name, within=1.5, stages=(SWITCH_ON_DISABLED, ENABLED, 5))
    must_still_work(cell)


class Path:
    """A trajectory that stays at the position of the axis, until it does something else after 0.1 s."""

    def __init__(self, then, duration: float = 1.0) -> None:
        self._then = then
        self.duration = duration

    def position(self, t: float) -> object:
        return 0.0 if t < 0.1 else self._then()


def raising(error: type[BaseException]):
    def then() -> float:
        raise error

    return then


class Numpy:
    """An array of one number, as far as this matters: it converts to a float, and is no float."""

    def __float__(self) -> float:
        return 0.0

    def __round__(self) -> int:
        raise TypeError("an array cannot be rounded")


class Duration:
    """A trajectory whose duration is something else after it has been asked for a few times."""

    def __init__(self, then) -> None:
        self._then = then
        self._asked = 0

    @property
    def duration(self) -> object:
        self._asked += 1
        return 1.0 if self._asked < 3 else self._then()

    def position(self, t: float) -> float:
        return 0.0


BROKEN = {
    "text": lambda: Path(lambda: "5"),
    "nothing": lambda: Path(lambda: None),
    "yes": lambda: Path(lambda: True),
    "an integer without end": lambda: Path(lambda: 10**5000),
    "an array of one": lambda: Path(Numpy),
    "nan": lambda: Path(lambda: float("nan")),
    "beyond every float": lambda: Path(lambda: 1e300),
    "an exception": lambda: Path(raising(RuntimeError)),
    "no memory": lambda: Path(raising(MemoryError)),
    "a duration that fails": lambda: Duration(raising(ValueError)),
    "a duration of nothing": lambda: Duration(lambda: None),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_trajectory_s_mistake_ends_its_own_command(scenario, what):
    cell = scenario.simulated("x", axis=AXIS).enabled()
    handle = cell.x.follow(BROKEN[what]())
    error = cell.failure_of(handle)
    assert isinstance(error, ArgumentError)
    assert str(error).startswith("x: the trajectory")
    must_still_work(cell, "x")


@pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit, GeneratorExit, RuntimeError])
def test_an_exception_of_a_trajectory_in_the_scan_thread_does_not_end_the_scan(scenario, kind):
    """In a thread of its own the scan is never the one that Ctrl-C is for."""
    cell = scenario.real("x", axis=AXIS).enabled()
    handle = cell.x.follow(Path(raising(kind)))
    error = cell.failure_of(handle)
    assert isinstance(error, ArgumentError)
    assert isinstance(error.__cause__, kind)
    must_still_work(cell, "x")


@pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit, GeneratorExit])
def test_an_exception_of_a_trajectory_in_virtual_time_ends_its_own_command(scenario, kind):
    """There the scan runs in the main thread; the handler of a signal has left no frame, so none has come."""
    cell = scenario.simulated("x", axis=AXIS).enabled()
    error = cell.failure_of(cell.x.follow(Path(raising(kind))))
    assert isinstance(error.__cause__, kind)
    must_still_work(cell, "x")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_a_trajectory_is_called_is_not_an_error_of_the_trajectory(scenario, number):
    """In virtual time it ends the program's wait, and all axes stop."""
    cell = scenario.simulated("xy", axis=AXIS)
    cell.turning(90.0, names="y")
    handle = cell.x.follow(Path(lambda: signal.raise_signal(number)))
    with pytest.raises((KeyboardInterrupt, SystemExit)):
        handle.wait(5)
    for name in "xy":
        cell.must_be_still(name, within=2.0, stages=OFF)


@pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit, RuntimeError])
def test_an_exception_of_a_callback_in_the_scan_thread_does_not_end_the_scan(scenario, kind, caplog):
    cell = scenario.real("x", axis=AXIS).enabled()
    handle = cell.x.move_relative(5.0)
    handle.add_done_callback(raising(kind))
    handle.wait(5)
    cell.run(0.1)
    assert "a callback of x.move_relative(5 deg) failed" in caplog.text
    must_still_work(cell, "x")


# -- absurd numbers ----------------------------------------------------------------------------------------------------


def test_a_line_of_more_than_a_year_is_refused_with_its_duration(scenario, golden):
    cell, group = three(scenario)
    cell.enabled()
    for acceleration in (1e-300, 5e-324, 1e-14):
        since = cell.moment()
        error = cell.failure_of(
            group.move_linear([5.0, 5.0, 5.0], velocity=10.0, acceleration=acceleration), limit=1.0
        )
        assert isinstance(error, LimitError)
        cell.run(0.3)
        for name in "xyz":
            cell.must_not_leap(name, since=since, way=0.001, speed=0.1)
    golden("line_of_ages", error)
    error = cell.failure_of(group.move_linear([5.0, 5.0, 5.0], velocity=5e-324))
    assert isinstance(error, LimitError)
    cell.run(0.3)
    group.move_linear([5.0, 5.0, 5.0], velocity=10.0).wait(5)


def test_the_fastest_numbers_that_there_are_keep_to_the_axes_limits(scenario):
    cell, group = three(scenario)
    cell.enabled()
    since = cell.moment()
    group.move_linear([50.0, 50.0, 50.0], velocity=1.7e308, acceleration=1.7e308).wait(5)
    must_be_smooth(cell, since)
    assert cell.top_speed("x", since) <= 400.0 * 1.05
    assert cell.where("x") == pytest.approx(50.0, abs=0.1)


def test_a_line_to_an_end_that_is_no_increment_away_ends_at_once(scenario):
    cell, group = three(scenario)
    cell.enabled()
    group.move_linear([5e-324, 1e-300, -5e-324], velocity=1.7e308, acceleration=1.7e308).wait(1)
    assert cell.where("x") == pytest.approx(0.0, abs=0.01)


def test_several_threads_that_command_one_group_at_once_leave_no_handle_open(scenario):
    cell = scenario.real("xy", axis=AXIS).enabled()
    group = cell.machine.group("x", "y")
    handles: list = []

    def command(offset: float) -> None:
        for number in range(10):
            handles.append(group.move_linear([offset + number, offset], velocity=100.0))
            handles.append(group.halt())
            handles.append(group.enable())

    threads = [threading.Thread(target=command, args=(10.0 * number,)) for number in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for handle in handles:
        cell.end_of(handle)
    assert cell.scan_runs
    for name in "xy":
        cell.must_be_still(name, within=1.0, stages=ENABLED)
    times = [sample.time for sample in cell.record("x").samples]
    assert all(b > a for a, b in pairwise(times))
