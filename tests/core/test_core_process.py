"""A machine whose core is a process of its own is used as any other."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from axisbus.cia301.nmt import NmtState
from axisbus.core.process import launch
from axisbus.core.process.client import RemoteCore
from axisbus.core.process.rescue import state_of
from axisbus.errors import ArgumentError, ScanError, StateError, Stopped
from axisbus.ipc.image import size_of
from axisbus.ipc.messages import Leave
from axisbus.ipc.rescue_memory import CoreStage, stage_of
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.cell import SCALE
from kit.scenarios.core_process import OWN_PROCESS, own_cell
from kit.scenarios.simulated_bus import until
from kit.stop_report import STOPPED

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]
opening = RemoteCore._open


def children(process: int) -> dict[str, int]:
    """The children of a process, by name."""
    found = {}
    for each in Path(f"/proc/{process}/task/{process}/children").read_text().split():
        with suppress(OSError):
            found[Path(f"/proc/{each}/comm").read_text().strip()] = int(each)
    return found


MORE = '\n[groups.xy]\naxes = ["x", "y"]\n'


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return own_cell(tmp_path_factory.mktemp("own"), more=MORE)


@pytest.fixture(scope="module")
def opened(file):
    with Machine.open(file) as machine:
        yield machine


def test_a_move_ends_at_its_target_and_later_values_are_from_after_the_move(machine):
    x = machine["x"]
    for goal in (20.0, -5.0):
        handle = x.move_absolute(goal)
        assert not handle.done
        handle.wait(20)
        assert x.position == pytest.approx(goal, abs=0.1)
        assert machine.simulated_node(1).drive().axis.motor.position / SCALE == pytest.approx(goal, abs=0.2)
    assert x.state is AxisState.STANDSTILL


class Wave:
    """A trajectory of a user's own, in a process unknown to the core."""

    duration = 5.0

    def position(self, t):
        return 5.0 * (1.0 - math.cos(2.0 * math.pi * t / self.duration))


def test_a_trajectory_of_the_programs_own_is_followed_to_its_end(machine):
    x = machine["x"]
    x.set_position(0.0).wait(10)
    reached = []
    handle = x.follow(Wave())
    while handle.busy:
        reached.append(x.position)
        time.sleep(0.02)
    handle.wait(1)
    assert max(reached) == pytest.approx(10.0, abs=0.5)
    assert x.position == pytest.approx(0.0, abs=0.2)
    x.follow(TrapezoidalTrajectory(0.0, 3.0, 10.0, 50.0)).wait(10)
    assert x.position == pytest.approx(3.0, abs=0.1)


def test_a_trajectory_that_fails_ends_with_its_own_error_and_the_axis_stops(machine):
    class Failing(Wave):
        def position(self, t):
            if t > 3.0:
                raise ValueError("a mistake of its own")
            return super().position(t)

    x = machine["x"]
    x.set_position(0.0).wait(10)
    with pytest.raises(ArgumentError, match="returned no position at 3") as caught:
        x.follow(Failing()).wait(20)
    assert "a mistake of its own" in caught.value.observed
    until(lambda: machine.simulated_node(1).drive().axis.motor.velocity == 0.0, 10.0)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="POSIX")
def test_a_forked_child_can_do_nothing_and_takes_nothing_away(machine):
    if (child := os.fork()) == 0:
        try:
            machine["x"].move_relative(1.0)
        except StateError:
            os._exit(7)
        os._exit(1)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 7
    machine["x"].move_relative(1.0).wait(10)


# -- opening and closing --------------------------------------------------------------------------------------------------------


def test_a_closed_machine_is_at_standstill_and_refuses_commands(file):
    with Machine.open(file) as machine:
        x = machine["x"]
        x.enable().wait(20)
        handle = x.move_velocity(50.0)
        handle.wait(10)
        motion = x.move_relative(1e6, velocity=50.0)
        until(lambda: motion.active, 10.0)
        simulated_node = machine.simulated_node(1)
    with pytest.raises(Stopped):
        motion.wait(1)
    assert simulated_node.drive().axis.motor.velocity == 0.0
    assert machine.cycle_jitter.cycles > 10
    assert machine.node(1).nmt in (NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL)  # as it was received last
    assert not machine.node(1).emcy
    assert machine.events[-1].reason == "the with block ended"
    with pytest.raises((ScanError, StateError)):
        x.move_relative(1.0).wait(5)
    machine.close()


def test_a_program_that_closes_when_its_core_dies_gets_the_state_of_its_drives(file):
    machine = Machine.open(file)
    machine["x"].enable().wait(20)
    machine["x"].move_velocity(50.0).wait(10)
    os.kill(machine._core.process, signal.SIGKILL)
    with pytest.raises(ScanError, match="it was ended by SIGKILL") as caught:
        machine.close()
    assert re.search(STOPPED, caught.value.observed)
    assert machine.simulated_node(1).drive().axis.motor.velocity == 0.0
    assert "ended by SIGKILL" in machine.session.dead


def test_a_core_that_hangs_while_its_machine_is_closed_is_replaced_and_none_of_its_processes_remains(file):
    machine = Machine.open(file)
    core, watchdog = machine._core.process, machine._core._process._watchdog.pid
    machine["x"].enable().wait(20)
    machine["x"].move_velocity(50.0).wait(10)
    leave = machine._core._rpc.send

    def hang(message):
        leave(message)
        if isinstance(message, Leave):
            until(lambda: stage_of(machine._core._process.memory, size_of(2)) is CoreStage.LEAVING, 10.0)
            os.kill(core, signal.SIGSTOP)

    machine._core._rpc.send = hang
    began = time.monotonic()
    with pytest.raises(ScanError, match="and was killed") as caught:
        machine.close()
    assert time.monotonic() - began < 10.0
    assert re.search(STOPPED, caught.value.observed)
    for process in (core, watchdog):
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_a_core_that_is_killed_while_it_opens_a_machine_is_reported_with_the_cause(file, monkeypatch):
    """Its watchdog process has to stop no drive, and reports how it ended."""
    started = []

    def kill(watchdog: int) -> None:
        until(lambda: any(name == "axisbus core" for name in children(watchdog)), 20.0)
        os.kill(children(watchdog)["axisbus core"], signal.SIGKILL)

    start = launch._start

    def note(startup_args):
        started.append(start(startup_args))
        return started[-1]

    monkeypatch.setattr(launch, "_start", note)
    monkeypatch.setattr(RemoteCore, "_open", lambda core: (kill(started[0].pid), opening(core)))
    with pytest.raises(
        ScanError, match=r"was being opened, and the core .* has ended: it was ended by SIGKILL"
    ):
        Machine.open(file)
    assert started[0].returncode == 0


def test_a_core_that_hangs_without_its_watchdog_process_does_not_remain(file):
    machine = Machine.open(file)
    process = machine._core._process
    os.kill(machine._core.process, signal.SIGSTOP)
    process._watchdog.kill()
    began = time.monotonic()
    process.end()
    assert time.monotonic() - began < 30.0
    with pytest.raises(ScanError):
        machine.close()
    assert state_of(machine._core.process) in ("", "Z")


CLOSED = """
import os, sys
from axisbus.machine.machine import Machine

found = os.dup(1)
for number in (0, 1, 2):
    os.close(number)
with Machine.open(sys.argv[1]) as machine:
    machine["x"].enable().wait(20)
    machine["x"].move_relative(1.0).wait(20)
os.write(found, b"moved and closed")
"""


def test_a_program_without_standard_streams_opens_a_machine(file):
    """Their numbers are those of its connections: the new processes must not take these for their own streams."""
    path = {"PYTHONPATH": os.pathsep.join(sys.path)}
    ended = subprocess.run(
        [sys.executable, "-c", CLOSED, str(file)],
        capture_output=True,
        timeout=100,
        env={**os.environ, **path},
    )
    assert ended.stdout == b"moved and closed"
