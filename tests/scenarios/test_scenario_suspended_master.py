"""The master's process is suspended, or killed, while its drives, in this one, continue: nothing jumps, and no motion continues."""

from __future__ import annotations

import itertools
import pickle
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from axisbus.errors import AxisbusError, NodeError, StaleError
from kit.cell import SCALE
from kit.plant_probe import ENABLED, OFF
from kit.scenarios.golden import full_text
from kit.scenarios.program import Program
from kit.scenarios.simulated_bus import Line, until
from kit.scenarios.socket_bridge import Bridge

if sys.platform == "win32":
    pytest.skip("suspending a process is a matter of POSIX", allow_module_level=True)

from signal import SIGCONT, SIGKILL, SIGSTOP

SPEED = 90.0
PERIOD = 0.1  # seconds: a slow scan, for which a busy computer's own delays are no silence of the drive
STEP = SPEED * PERIOD  # degrees from one cycle to the next
SLOW_HEARTBEAT = "1s"  # the drive waits for three of them: longer than the suspension


class Master:
    """A master in its own process, the line with its drives here, and the targets that the drive of x gets with each SYNC."""

    def __init__(self, line: Line, program: Program, folder: Path) -> None:
        self.line = line
        self.targets: list[float] = []
        self._program = program
        self._folder = folder
        device = line.devices["x"]
        sync = device.sync

        def watched() -> None:
            self.targets.append(device.read(0x607A) / SCALE)
            sync()

        device.sync = watched

    @property
    def largest_step(self) -> float:
        """The largest step from one target to the next, in degrees."""
        return max(abs(then - first) for first, then in itertools.pairwise(self.targets))

    def suspend(self, seconds: float) -> None:
        """Suspend it for a while."""
        self._program.send(SIGSTOP)
        time.sleep(seconds)
        self._program.send(SIGCONT)

    def kill(self) -> None:
        """End it so that it can do nothing about it."""
        self._program.send(SIGKILL)

    def wait_for_the_end(self) -> None:
        """Wait until its command has ended."""
        self._program.hear("ended")

    def leave(self) -> list[AxisbusError | None]:
        """Let it leave its block; return the errors of its command and of leaving."""
        stdin = self._program.process.stdin
        assert stdin is not None
        stdin.write("go on\n")
        stdin.flush()
        code, errors = self._program.end()
        assert code == 0, errors
        return pickle.loads((self._folder / "told.pickle").read_bytes())


@contextmanager
def master(
    folder: Path, nets: Sequence[str], motion: str, heartbeat: str = SLOW_HEARTBEAT
) -> Iterator[Master]:
    """Start a master and wait until it moves its axis."""
    here, there = socket.socketpair()
    with Line(folder, heartbeat=heartbeat, period="100ms", stop='halt_time = "5s"') as line:
        bridge = Bridge(line.channel, here)
        arguments = (str(folder), "there", str(there.fileno()), ";".join(nets), motion)
        text = line.file.read_text(encoding="utf-8").replace(line.channel, "there")
        line.file.write_text(text, encoding="utf-8")
        try:
            with Program(
                "master_process", *arguments, stdin=subprocess.PIPE, pass_fds=(there.fileno(),)
            ) as program:
                there.close()
                program.hear("moving")
                until(lambda: line.speed() > 0.9 * SPEED, 20.0)
                yield Master(line, program, folder)
        finally:
            bridge.close()


def test_short_suspensions_make_a_trajectory_late_and_nothing_jumps(tmp_path):
    with master(tmp_path, (), "following") as cell:
        for _ in range(4):
            cell.suspend(0.15)
            time.sleep(0.25)
        cell.wait_for_the_end()
        place = cell.line.where()
        told = cell.leave()
        assert told == [None], list(map(full_text, told))
    assert abs(place - 180.0) < 0.05
    assert cell.largest_step < 1.2 * STEP


@pytest.mark.nets("the stop sequence")
def test_after_a_long_suspension_the_axis_is_stopped_and_the_reason_named(tmp_path, nets_cut, golden):
    with master(tmp_path, nets_cut, "turning") as cell:
        cell.suspend(1.5)
        cell.line.must_be_still(stages=ENABLED)
        cell.wait_for_the_end()
        told = cell.leave()
    assert [type(error) for error in told] == [StaleError]
    golden("program_suspended", *told, volatile=True)


def test_after_a_long_suspension_a_trajectory_does_not_continue_and_does_not_jump(tmp_path):
    with master(tmp_path, (), "following") as cell:
        cell.suspend(1.5)
        cell.wait_for_the_end()
        place = cell.line.where()
        cell.line.must_be_still(stages=(ENABLED, *OFF))
        assert abs(cell.line.where() - place) < 2.0
        assert place < 150.0  # 0.3 s at 90 deg/s and a stop
        told = cell.leave()
    assert isinstance(told[0], StaleError)
    assert cell.largest_step < 1.2 * STEP


@pytest.mark.nets("the drive's watchdog")
def test_a_master_suspended_for_longer_than_its_heartbeat_finds_its_drive_stopped(tmp_path, nets_cut):
    with master(tmp_path, nets_cut, "turning", heartbeat="500ms") as cell:
        cell._program.send(SIGSTOP)
        cell.line.must_be_still(stages=OFF, for_good=0.1)
        cell._program.send(SIGCONT)
        cell.wait_for_the_end()
        told = cell.leave()
    (error,) = told
    assert isinstance(error, (StaleError, NodeError))  # whichever is seen first; both say why
    assert "did not run for" in str(error)


@pytest.mark.nets("the drive's watchdog")
def test_the_drive_of_a_killed_master_stops(tmp_path, nets_cut):
    with master(tmp_path, nets_cut, "turning", heartbeat="500ms") as cell:
        cell.kill()
        cell.line.must_be_still(stages=OFF)
