"""A core in a process of its own on the kernel's CAN: its watchdog process opens the link again when the core is dead."""

from __future__ import annotations

import os
import re
import signal
import time

import pytest

from axisbus.errors import ScanError, SecondMasterError
from kit.socketcan_cell import schedule, until
from kit.stop_report import STOPPED

pytestmark = pytest.mark.timeout(180)  # in a user-mode Linux a second process takes long to begin


@pytest.fixture(autouse=True)
def own(monkeypatch):
    monkeypatch.setenv("AXISBUS_PROCESS", "own")


def core_of(machine):
    """The process ID of a machine's core."""
    return machine._core.process


@pytest.fixture
def make_stage(make_stage):
    """Stages whose simulated drives have a core's priority, as in a simulated cell: in a user-mode Linux all share one processor,
    on which they would receive everything late. Processes that are made later are usual ones.
    """

    def make(ours, theirs):
        made = make_stage(ours, theirs)
        schedule(os.SCHED_RR | os.SCHED_RESET_ON_FORK, 10)
        return made

    yield make
    schedule(os.SCHED_OTHER)


def test_a_cell_boots_moves_and_stops_and_its_link_is_exclusive(stage):
    with stage.open() as machine:
        assert "in a process of its own" in machine.real_time_status
        stage.travelling(machine)
        with pytest.raises(SecondMasterError) as caught:
            stage.open()
        assert f"process {os.getpid()} (" in caught.value.observed
        assert min(stage.speeds()) > 1000
    assert stage.speeds() == [0.0, 0.0]
    assert stage.energised() == [False, False]
    with stage.open() as machine:
        assert len(machine) == 2


def test_the_drives_of_a_core_that_is_killed_are_stopped_by_its_watchdog_process(stage):
    machine = stage.open()
    handles = stage.travelling(machine)
    os.kill(core_of(machine), signal.SIGKILL)
    until(lambda: max(stage.speeds()) == 0.0, 3.0)
    for handle in handles:
        with pytest.raises(ScanError, match="it was ended by SIGKILL") as caught:
            handle.wait(10)
        assert re.search(STOPPED, caught.value.observed)
    with pytest.raises(ScanError):
        machine.close()


def test_a_link_that_is_taken_down_ends_the_core_as_it_ends_a_scan(ends, make_stage):
    stage = make_stage(ends.ours, ends.theirs)
    machine = stage.open()
    handles = stage.travelling(machine)
    ends.down(ends.ours)
    for handle in handles:
        with pytest.raises(ScanError, match="was ended"):
            handle.wait(10)
    assert machine["x"].error is not None
    until(lambda: max(stage.speeds()) == 0.0, 5.0)
    with pytest.raises(ScanError):
        machine.close()


def test_a_link_that_was_down_is_opened_again_by_the_same_core(ends, make_stage):
    stage = make_stage(ends.ours, ends.theirs)
    with stage.open() as machine:
        core = core_of(machine)
        handles = stage.travelling(machine)
        ends.down(ends.ours)
        for handle in handles:
            with pytest.raises(ScanError, match="was ended"):
                handle.wait(10)
        until(lambda: max(stage.speeds()) == 0.0, 5.0)
        time.sleep(2.0)  # longer than a core without a cycle may live
        ends.up(ends.ours)
        machine.reconnect()
        assert core_of(machine) == core
        os.kill(core, 0)
        assert stage.energised() == [False, False]
        for node, axis in enumerate(machine, start=1):
            assert machine.node(node).boot().ok
            axis.reset().wait(10)
        stage.travelling(machine)
        os.kill(core, signal.SIGKILL)  # the watchdog process still stops what the core moves
        until(lambda: max(stage.speeds()) == 0.0, 3.0)
        with pytest.raises(ScanError):
            machine.close()
