"""Programs that join a machine: one has control, all may look and halt, and none disturbs the cycle or is locked out."""

from __future__ import annotations

import itertools
import os
import socket
import time

import pytest

from axisbus.clock import REAL, poll_until
from axisbus.core.process.rpc_client import RpcClient
from axisbus.errors import OwnershipError, ScanError, StateError, Stopped
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.record.recorder import Recorder
from kit.core_in_threads import core_in_threads
from kit.scenarios.core_process import OWN_PROCESS, own_cell, turns, under_way

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return own_cell(tmp_path_factory.mktemp("joined"))


@pytest.fixture(scope="module")
def opened(file):
    with core_in_threads(), Machine.open(file) as machine:
        yield machine


def test_a_client_sees_the_values_of_the_owner_and_its_leaving_changes_nothing(machine, file):
    handle = under_way(machine["x"])
    with Machine.attach(file) as attached:
        assert attached.is_attached
        assert f"process {os.getpid()} " in attached.control_owner
        assert [each.commands for each in attached.programs] == [True, False]
        assert all(f"process {os.getpid()} " in each.who for each in attached.programs)
        assert list(attached.axes) == ["x", "y"]
        assert attached["x"].state is AxisState.DISCRETE_MOTION
        assert attached["x"].position == pytest.approx(machine["x"].position, abs=5.0)
        assert attached.node(1).sdo[0x1000] == machine.node(1).sdo[0x1000]
        assert attached.reports == machine.reports
    time.sleep(0.2)
    assert handle.active
    assert abs(turns(machine)) == pytest.approx(30.0, abs=1.0)
    assert not machine.is_attached


@pytest.mark.parametrize(
    "command",
    [
        lambda x: x.move_relative(1.0),
        lambda x: x.move_velocity(1.0),
        lambda x: x.jog(1.0),
        lambda x: x.enable(),
        lambda x: x.disable(),
        lambda x: x.disable(coast=True),
        lambda x: x.reset(),
        lambda x: x.home(),
        lambda x: x.stop(),
        lambda x: x.release(),
        lambda x: x.set_position(0.0),
        lambda x: x.follow(TrapezoidalTrajectory(0.0, 10.0, 10.0, 100.0)),
    ],
)
def test_a_client_without_control_is_refused_and_the_motion_continues(machine, file, command):
    handle = under_way(machine["y"])
    with Machine.attach(file) as attached:
        with pytest.raises(OwnershipError) as caught:
            command(attached["y"]).wait(10)
        assert f"process {os.getpid()} " in caught.value.observed
        with pytest.raises(OwnershipError):
            attached.node(2).sdo[0x6081] = 77
    assert handle.active
    assert abs(turns(machine, 2)) == pytest.approx(30.0, abs=1.0)
    assert machine.node(2).sdo[0x6081] != 77


@pytest.mark.parametrize("stop", ["halt", "quick_stop"])
def test_any_client_may_stop_an_axis_and_is_named_and_control_stays_with_its_owner(machine, file, stop):
    handle = under_way(machine["x"])
    with Machine.attach(file) as attached:
        getattr(attached["x"], stop)().wait(10)
    assert turns(machine) == pytest.approx(0.0, abs=0.1)
    with pytest.raises(Stopped, match=rf"x\.{stop}\(\) by process {os.getpid()} "):
        handle.wait(5)
    machine["x"].enable().wait(20)
    machine["x"].move_relative(1.0).wait(20)


def test_a_client_may_stop_a_whole_group_without_control(machine, file):
    handles = [under_way(axis) for axis in machine]
    with Machine.attach(file) as attached:
        attached.group("x", "y").halt().wait(10)
    assert not any(handle.active for handle in handles)


def test_control_belongs_to_one_client_and_returns_when_its_owner_leaves(machine, file):
    with pytest.raises(OwnershipError):
        Machine.attach(file, command=True)
    handle = under_way(machine["x"])
    with Machine.attach(file, command=True, force=True) as attached:
        assert turns(machine) == pytest.approx(0.0, abs=0.1)  # before another program commands
        with pytest.raises(Stopped, match="took control"):
            handle.wait(5)
        with pytest.raises(OwnershipError, match="only read"):
            machine["x"].move_relative(1.0).wait(5)
        attached["x"].move_relative(1.0).wait(20)
        left = under_way(attached["y"])
    assert not left.active
    assert turns(machine, 2) == pytest.approx(0.0, abs=0.1)
    assert machine["y"].state is AxisState.STANDSTILL
    machine["x"].move_relative(1.0).wait(20)


def test_a_joined_program_takes_control_and_the_owner_takes_it_back(machine, file):
    handle = under_way(machine["x"])
    with Machine.attach(file) as attached:
        assert (machine.has_control, attached.has_control) == (True, False)
        attached.take_control()
        assert turns(machine) == pytest.approx(0.0, abs=0.1)
        assert (machine.has_control, attached.has_control) == (False, True)
        with pytest.raises(Stopped, match="took control"):
            handle.wait(5)
        attached.take_control()  # harmless
        going = under_way(attached["y"])
        machine.take_control()
        assert turns(machine, 2) == pytest.approx(0.0, abs=0.1)
        with pytest.raises(Stopped, match="took control"):
            going.wait(5)
        assert (machine.has_control, attached.has_control) == (True, False)
        with pytest.raises(OwnershipError):
            attached["x"].move_relative(1.0).wait(5)
        machine["x"].move_relative(1.0).wait(20)
    assert machine.has_control


def test_a_program_that_was_requested_to_stop_gets_no_control(machine, file):
    with Machine.attach(file) as attached:
        attached.session.request_stop("it was told to")
        with pytest.raises(Stopped, match="not granted"):
            attached.take_control()
    assert machine.has_control


def test_hold_to_run_ends_with_control(machine, file):
    with Machine.attach(file, command=True, force=True) as attached:
        attached.hold_to_run(0.3)
        machine.take_control()
        handle = under_way(machine["y"])
        attached.hold_to_run(0.3)  # without control it has no effect
        time.sleep(0.6)
        assert handle.active
        assert abs(turns(machine, 2)) == pytest.approx(30.0, abs=1.0)


def test_a_client_records_every_cycle_as_the_owner_does(machine, file):
    with Machine.attach(file) as attached, Recorder(attached) as recorder:
        machine["x"].move_relative(1.0).wait(20)
        time.sleep(0.1)
    times = sorted({float(row[0]) for row in recorder.rows()})
    steps = [after - before for before, after in itertools.pairwise(times)]
    assert steps
    assert sorted(steps)[len(steps) // 2] == pytest.approx(0.02, abs=0.01)


def test_a_changed_cell_file_and_a_missing_machine_are_reported(machine, file, tmp_path):
    other = tmp_path / "cell.toml"
    other.write_text(file.read_text(), encoding="utf-8")
    with pytest.raises(StateError, match="no machine of "):
        Machine.attach(other)
    assert Machine.try_attach(other) is None
    before = file.read_text()
    try:
        file.write_text(before + "\n# changed\n")
        with pytest.raises(StateError, match="has changed since the machine was opened"):
            Machine.attach(file)
    finally:
        file.write_text(before)


# The acceptor.


def test_a_core_that_ends_while_a_client_joins_is_reported(machine, file, monkeypatch):
    start = RpcClient.start

    def gone(calls: RpcClient) -> None:
        calls._on_end()
        calls._stream._line.shutdown(socket.SHUT_RDWR)
        start(calls)

    monkeypatch.setattr(RpcClient, "start", gone)
    with pytest.raises(ScanError, match="the machine was being joined"):
        Machine.attach(file)


# The bytes that each of a thousand hostile connections sends to the core, and whether it sends them repeatedly.


def test_a_stop_of_a_client_that_gives_commands_without_a_pause_waits_for_none_of_them(machine, file):
    with Machine.attach(file, command=True, force=True) as attached:
        x = attached["x"]
        x.enable().wait(10)
        handles = [x.move_velocity(20.0 + number % 100 / 100) for number in range(3000)]
        began = time.monotonic()
        x.halt().wait(20)
        assert (
            time.monotonic() - began < 3.0
        )  # 6 s and more if all were sent: the core accepts 500 per second
        poll_until(REAL, lambda: not any(handle.busy for handle in handles), time.monotonic() + 10.0, 0.05)
        refused = [error for handle in handles if isinstance(error := handle.exception(), StateError)]
        assert len(refused) > 2000
        assert "this program gives commands too fast" in refused[-1].message
        assert "stops are always accepted" in refused[-1].observed
        assert x.state is AxisState.STANDSTILL
