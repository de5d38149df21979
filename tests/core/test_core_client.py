"""A core that a program speaks with: moves, groups, objects, faults, recordings and closing are as with a core in the program."""

from __future__ import annotations

import threading
import time

import pytest

from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.errors import ArgumentError, ConfigError, DriveFault, ScanError, SdoAbort, StateError
from axisbus.machine.handle import wait
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.record.recorder import Recorder
from kit.cell import cell_text
from kit.core_in_threads import core_in_threads
from kit.scenarios.core_process import OWN_PROCESS, own_cell
from kit.scenarios.simulated_bus import until

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]
MORE = '\n[groups.xy]\naxes = ["x", "y"]\n'


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return own_cell(tmp_path_factory.mktemp("own"), more=MORE)


@pytest.fixture(scope="module")
def opened(file):
    with core_in_threads(), Machine.open(file) as machine:
        yield machine


def test_groups_and_several_handles_at_once(machine):
    group = machine.groups["xy"]
    group.move_linear([10.0, -10.0], velocity=100.0, acceleration=500.0).wait(20)
    assert [axis.position for axis in machine] == pytest.approx([10.0, -10.0], abs=0.1)
    wait([axis.move_absolute(0.0) for axis in machine], timeout=20)
    chosen = machine.group("y", "x")
    chosen.move_linear([3.0, 4.0], velocity=100.0, acceleration=500.0).wait(20)
    assert machine["y"].position == pytest.approx(3.0, abs=0.1)


def test_an_invalid_command_ends_with_the_same_error_as_in_the_program(machine):
    machine["x"].disable().wait(10)
    with pytest.raises(StateError, match=r"x\.move_absolute\(1 deg\)"):
        machine["x"].move_absolute(1.0).wait(10)
    with pytest.raises(ArgumentError):
        machine["x"].move_absolute(float("nan"))


def test_a_jog_that_is_given_again_and_again_is_one_motion_and_all_its_handles_end(machine):
    handles = []
    for _ in range(40):
        handles.append(machine["x"].jog(20.0))
        time.sleep(0.01)
    until(lambda: not any(handle.busy for handle in handles), 10.0)
    until(lambda: machine["x"].state is AxisState.STANDSTILL, 10.0)


def test_objects_nmt_and_error_history_are_the_nodes_own(machine):
    node = machine.node(1)
    node.sdo["Profile velocity"] = 4321
    assert node.sdo[0x6081] == 4321
    with pytest.raises(SdoAbort) as caught:
        node.sdo[0x1000] = 1
    assert caught.value.index == 0x1000
    assert node.nmt is NmtState.OPERATIONAL
    assert node.pdos()
    assert node.pdo_events == ()
    assert node.events == []
    assert isinstance(node.format_error_history(), list)
    with pytest.raises(StateError, match="process"):
        node.canopen  # noqa: B018


def test_a_fault_is_reported_with_its_code_and_its_emergencies(machine):
    x, heard = machine["x"], []
    machine.simulated_node(1).fault(0x4310)
    until(lambda: x.state is AxisState.ERRORSTOP and x.error is not None and "4310" in str(x.error), 10.0)
    assert isinstance(x.error, DriveFault)
    assert x.error.code == 0x4310
    until(lambda: len(machine.node(1).emcy) > 0, 10.0)
    assert machine.node(1).emcy[-1].code == 0x4310
    assert any("4310" in line for line in machine.node(1).format_incident(machine.node(1).incidents[-1]))
    machine.node(1).on_event(heard.append)


def test_callbacks_run_in_a_thread_of_this_program(machine):
    threads: list[str] = []
    handle = machine["x"].move_relative(1.0)
    handle.add_done_callback(lambda: threads.append(threading.current_thread().name))
    handle.wait(10)
    until(lambda: bool(threads), 10.0)
    assert threads == ["axisbus events"]


def test_a_callback_that_waits_or_exits_is_refused_and_the_ends_of_later_commands_are_still_reported(machine):
    errors = []

    def wait_in_callback() -> None:
        try:
            machine["y"].halt().wait(5.0)
        except StateError as error:
            errors.append(error.message)
        raise SystemExit

    handle = machine["x"].move_relative(1.0)
    handle.add_done_callback(wait_in_callback)
    handle.wait(10)
    until(lambda: bool(errors), 10.0)
    assert errors == ["a callback cannot wait for a command"]
    machine["x"].move_relative(1.0).wait(10)


def test_a_recording_has_every_cycle_in_order(machine):
    with Recorder(machine) as recorder:
        machine["x"].move_relative(5.0).wait(20)
        time.sleep(0.2)
    times = [row[0] for row in recorder.rows()]
    assert len(times) > 10
    assert times == sorted(times)


def test_the_lateness_of_the_cycles_is_read_from_the_core_in_its_own_process(machine):
    first = machine.cycle_jitter.cycles
    time.sleep(0.2)
    assert machine.cycle_jitter.cycles > first
    assert "in a process of its own" in machine.real_time_status
    assert machine.bus_events == []
    assert machine.bus_time is None
    assert machine.dropped_frames == ()


def test_simulated_drives_are_read_and_set_from_this_program(machine):
    drive = machine.simulated_node(1).drive()
    assert drive.dials.blocked is False
    drive.dials.blocked = True
    assert machine.simulated_node(1).drive().dials.blocked is True
    drive.dials.blocked = False
    with pytest.raises(AttributeError):
        drive._private  # noqa: B018
    with pytest.raises(StateError, match="AttributeError"):
        drive.no_such_thing  # noqa: B018
    with pytest.raises(StateError):
        machine.simulated_node(9)


def test_an_invalid_cell_is_refused_before_anything_is_started(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(
        cell_text("x", bus='process = "own"').replace("scale = 100", "scale = 0"), encoding="utf-8"
    )
    with pytest.raises(ConfigError, match="scale"):
        Machine.open(path)


def test_a_callback_may_close_the_machine(file):
    with Machine.open(file) as machine:
        machine["x"].enable().wait(20)
        handle = machine["x"].move_relative(1.0)
        handle.add_done_callback(machine.close)
        handle.wait(10)
        until(lambda: machine.session.ended, 10.0)
    assert machine.simulated_node(1).drive().statusword & 0x6F != 0x27


def test_two_machines_at_once_do_not_know_of_each_other(file, machine):
    with Machine.open(file) as other:
        other["x"].enable().wait(20)
        other["x"].move_relative(3.0).wait(10)
        motor = machine.simulated_node(1).drive().axis.motor
        before = motor.position
        other["x"].move_relative(3.0).wait(10)
        assert motor.position == pytest.approx(before, abs=10)
    machine["x"].move_relative(1.0).wait(10)


def test_events_of_a_node_are_reported_in_a_thread_of_this_program(file):
    with Machine.open(file) as machine:
        heard = []
        machine.node(2).on_event(lambda event: heard.append((event.node, threading.current_thread().name)))
        machine.node(2).command(NmtCommand.ENTER_PRE_OPERATIONAL)
        until(lambda: bool(heard), 10.0)
        assert heard[0] == (2, "axisbus events")
        assert machine.node(2).nmt is NmtState.PRE_OPERATIONAL
        assert [event.node for event in machine.node(2).events] == [2]
        assert machine.events


def test_a_command_and_a_request_after_closing_end_because_the_machine_was_closed(file):
    """The end of the core is no failure: it has reported that it has left every node."""
    with core_in_threads(), Machine.open(file) as machine:
        machine["x"].enable().wait(20)
    until(lambda: machine._core._rpc.over, 10.0)
    with pytest.raises(ScanError, match=r"x\.move_relative\(1 deg\) was ended: the machine was closed"):
        machine["x"].move_relative(1.0).wait(10)
    with pytest.raises(ScanError, match="read was asked: the machine was closed"):
        machine.node(1).sdo[0x1000]
