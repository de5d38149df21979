"""The death of any process stops the axes: program, core and watchdog process are killed, suspended or terminated during motion.

The plant is read from a history of the simulated drives, in a process of its own. Each scenario runs
once more with its safety net removed, and must then find the motor turning.
"""

from __future__ import annotations

import csv
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import pytest

from kit.cell import SCALE, cell_text
from kit.plant_probe import ENABLED, OFF, QUICK_STOP
from kit.scenarios.core_process import OWN_PROCESS
from kit.scenarios.moving_program import LOSSES
from kit.scenarios.program import TESTS
from kit.stop_report import STOPPED

pytestmark = [OWN_PROCESS, pytest.mark.timeout(120)]
CUTTING = Path(__file__).parents[1] / "kit" / "scenarios" / "safety_net_removal"
# Long heartbeats: the drives' own watch over them is another net, which would hide that one of these is missing.
HEARTBEAT = "1s"  # the drives wait for three of them
# seconds on a busy computer; the ramps take a tenth, a hung core is found after half a second
STOPS_WITHIN = 2.5
SPEED = 90.0  # deg/s


BEAM = '[gantries.b]\naxes = ["x", "y"]\nmax_skew = 8.0\n'


class Row(NamedTuple):
    """One motor at a time: deg/s, and the number of its power stage."""

    time: float
    velocity: float
    stage: int


class Doomed:
    """A program with its core and watchdog process, whose axes turn; the remaining processes are killed at the end."""

    def __init__(self, folder: Path, scene: str, cut: str, axes: str, more: str = "") -> None:
        self.folder = folder
        text = cell_text(
            axes, heartbeat=HEARTBEAT, bus='process = "own"\noptions = { history = "plant.csv" }', more=more
        )
        (folder / "cell.toml").write_text(text, encoding="utf-8")
        path = os.pathsep.join([str(CUTTING), str(TESTS), *filter(None, [os.environ.get("PYTHONPATH")])])
        errors = (folder / "errors.txt").open("w")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "kit.scenarios.moving_program", str(folder), scene],
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            env={**os.environ, "PYTHONPATH": path, "AXISBUS_CUT": cut, "XDG_STATE_HOME": str(folder)},
        )
        errors.close()
        assert self.process.stdout is not None
        with self.process.stdout as out:
            words = out.readline().split()
        assert words[:1] == ["ready"], (folder / "errors.txt").read_text()
        self.program, self.watchdog, self.core = map(int, words[1:])

    def strike(self, who: str, number: int) -> float:
        """Send a signal to one of them; return when, by the clock of the plant."""
        at = time.monotonic()
        os.kill(getattr(self, who), number)
        return at

    def plant(self) -> list[Row]:
        """The motions of the motors until now."""
        with (self.folder / "plant.csv").open(encoding="utf-8") as file:
            whole = [row for row in csv.DictReader(file) if row["stage"]]
        return [Row(float(row["time"]), float(row["velocity"]) / SCALE, int(row["stage"])) for row in whole]

    def places(self) -> list[float]:
        """Where each motor was last, in deg, in the order of their nodes."""
        with (self.folder / "plant.csv").open(encoding="utf-8") as file:
            last = {
                row["node"]: float(row["position"]) / SCALE for row in csv.DictReader(file) if row["stage"]
            }
        return [last[node] for node in sorted(last)]

    def journal(self) -> str:
        """The journal of core and watchdog process."""
        (file,) = (self.folder / "axisbus").glob("cell-*.log")
        return file.read_text(encoding="utf-8")

    def turns(self, at: float) -> bool:
        """Whether the motors turned as commanded just before a time."""
        before = [row for row in self.plant() if at - 0.1 <= row.time <= at]
        return bool(before) and all(abs(row.velocity - SPEED) < 1.0 for row in before)

    def moves(self, at: float) -> bool:
        """Whether a motor moved in the half second before a time; a late program may let its points run out for a moment."""
        before = [row for row in self.plant() if at - 0.5 <= row.time <= at]
        return any(row.velocity > 0.3 * SPEED for row in before)

    def standstill_after(
        self, at: float, stages: tuple[int, ...], within: float = STOPS_WITHIN
    ) -> float | None:
        """Return how many seconds after a time all motors stay at standstill in these stages; None if not in time."""
        until = time.monotonic() + within
        while time.monotonic() < until:
            time.sleep(0.1)
            rows = self.plant()
            still = [row.time for row in rows if abs(row.velocity) > 0.05 or row.stage not in stages]
            if still and rows[-1].time - still[-1] > 0.3:
                return still[-1] - at
        return None

    def ends(self, who: str, within: float) -> bool:
        """Whether one of them ends in time."""
        until = time.monotonic() + within
        while time.monotonic() < until:
            if not _lives(getattr(self, who)):
                return True
            time.sleep(0.02)
        return False


def _lives(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@contextmanager
def doomed(folder: Path, scene: str, cut: str = "", axes: str = "x", more: str = "") -> Iterator[Doomed]:
    """Let a program play its scene."""
    one = Doomed(folder, scene, cut, axes, more)
    try:
        yield one
    finally:
        for process in (one.program, one.watchdog, one.core):
            with suppress(OSError):
                os.kill(process, signal.SIGKILL)
        one.process.wait()


REST = (*OFF, QUICK_STOP)
NO_PROGRAM, NO_WATCHDOG = "the core's eye on its program", "the core's check of its watchdog process"

# The scene, the process, the signal, and the safety net that is removed in the second run.
DEATHS = {
    "the program is killed": ("sleeping", "program", signal.SIGKILL, NO_PROGRAM),
    "the program is killed, and a child that it has forked lives on": (
        "forking",
        "program",
        signal.SIGKILL,
        NO_PROGRAM,
    ),
    "the program is killed, and another has its descriptors": (
        "hoarding",
        "program",
        signal.SIGKILL,
        "the core's eye on the process of its program",
    ),
    "the program's terminal is gone": ("sleeping", "program", signal.SIGHUP, NO_PROGRAM),
    "the core is killed": ("sleeping", "core", signal.SIGKILL, "the rescue"),
    "the core crashes": ("sleeping", "core", signal.SIGSEGV, "the rescue"),
    "the core is killed while the program computes": ("computing", "core", signal.SIGKILL, "the rescue"),
    "the core hangs": ("sleeping", "core", signal.SIGSTOP, "the watchdog process's patience"),
    "the core is told to end": ("sleeping", "core", signal.SIGTERM, NO_PROGRAM),
    "Ctrl-C while the program computes": (
        "computing",
        "program",
        signal.SIGINT,
        "the core's ear for its program",
    ),
    "the program is told to end while it computes": (
        "computing",
        "program",
        signal.SIGTERM,
        "the core's ear for its program",
    ),
    "the core's terminal is gone": ("sleeping", "core", signal.SIGHUP, NO_PROGRAM),
    "the watchdog process is killed": ("sleeping", "watchdog", signal.SIGKILL, NO_WATCHDOG),
    "the watchdog process is stopped": ("sleeping", "watchdog", signal.SIGSTOP, NO_WATCHDOG),
}


@pytest.mark.parametrize("whole", [True, False], ids=["whole", "without the safety net"])
@pytest.mark.parametrize("death", DEATHS)
def test_a_motor_stops_whichever_process_dies(tmp_path, death, whole):
    scene, who, number, net = DEATHS[death]
    with doomed(tmp_path, scene, "" if whole else net) as one:
        time.sleep(0.3)
        at = one.strike(who, number)
        took = one.standstill_after(at, REST, STOPS_WITHIN if whole else 2.0)
        assert one.turns(at)
        assert (took is not None) is whole, took


LOST = "the eyes on the program's descriptors"


@pytest.mark.parametrize("whole", [True, False], ids=["whole", "without the safety net"])
@pytest.mark.parametrize("loss", [loss for loss in LOSSES if loss != "closing-in-a-child"])
def test_a_motor_stops_when_its_program_has_lost_the_descriptor_to_the_core(tmp_path, loss, whole):
    with doomed(tmp_path, loss, "" if whole else LOST) as one:
        at = one.strike("program", signal.SIGUSR1)
        took = one.standstill_after(at, REST, STOPS_WITHIN if whole else 2.0)
        assert one.turns(at)
        assert (took is not None) is whole, took


def test_descriptors_that_a_forked_child_closes_are_its_own_affair(tmp_path):
    with doomed(tmp_path, "closing-in-a-child") as one:
        at = one.strike("program", signal.SIGUSR1)
        time.sleep(1.5)
        assert one.turns(at + 1.4)


@pytest.mark.parametrize(
    ("who", "number"),
    [
        ("program", signal.SIGKILL),
        ("core", signal.SIGKILL),
        ("core", signal.SIGSTOP),
        ("watchdog", signal.SIGKILL),
        ("program", signal.SIGINT),
    ],
)
def test_both_motors_of_a_beam_stop_together_when_any_process_dies(tmp_path, who, number):
    with doomed(tmp_path, "carrying", axes="xy", more=BEAM) as one:
        at = one.strike(who, number)
        took = one.standstill_after(at, REST)
        assert one.moves(at)
        assert took is not None
        x, y = one.places()
        assert x > 20.0
        assert abs(x - y) < 1.0


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_the_motors_of_a_core_with_many_axes_stop_as_soon(tmp_path, number):
    with doomed(tmp_path, "sleeping", axes="abcdefghijkl") as one:
        at = one.strike("core", number)
        took = one.standstill_after(at, REST)
        assert one.turns(at)
        assert took is not None


@pytest.mark.parametrize(("scene", "code"), [("returning", 0), ("raising", 1)])
def test_a_program_that_ends_leaves_its_motor_at_standstill_and_off(tmp_path, scene, code):
    with doomed(tmp_path, scene) as one:
        assert one.process.wait(30) == code
        rows = one.plant()
        assert max(row.velocity for row in rows) > SPEED - 1.0
        assert abs(rows[-1].velocity) < 0.05
        assert rows[-1].stage in OFF
        assert one.ends("core", 2.0)


def test_a_suspended_program_ends_nothing_and_its_motor_continues(tmp_path):
    with doomed(tmp_path, "waiting") as one:
        at = one.strike("program", signal.SIGSTOP)
        time.sleep(2.0)
        assert one.turns(at + 1.9)
        one.strike("program", signal.SIGCONT)
        time.sleep(0.5)
        assert one.process.poll() is None
        at = one.strike("program", signal.SIGINT)
        assert one.standstill_after(at, REST) is not None


def test_the_stream_of_a_suspended_program_runs_out_and_continues_with_the_program(tmp_path):
    with doomed(tmp_path, "streaming", axes="xy") as one:
        at = one.strike("program", signal.SIGSTOP)
        took = one.standstill_after(at, (ENABLED,))
        assert one.moves(at)
        assert took is not None
        assert took > 0.2  # there were points ahead
        at = one.strike("program", signal.SIGCONT)
        time.sleep(1.5)
        assert one.moves(at + 1.0)
        at = one.strike("program", signal.SIGINT)
        assert one.standstill_after(at, REST) is not None


@pytest.mark.parametrize("whole", [True, False], ids=["whole", "without the safety net"])
def test_the_motors_of_a_stream_stop_and_are_off_when_its_program_is_killed(tmp_path, whole):
    with doomed(tmp_path, "streaming", "" if whole else NO_PROGRAM, axes="xy") as one:
        at = one.strike("program", signal.SIGKILL)
        took = one.standstill_after(at, REST, STOPS_WITHIN if whole else 1.5)
        assert one.moves(at)
        assert (took is not None) is whole, took
        if not whole:  # its points have run out all the same, and they are held there
            assert one.standstill_after(at, (ENABLED,)) is not None


def test_a_program_gets_the_reason_of_the_end_of_its_core_and_the_state_of_its_drives(tmp_path):
    with doomed(tmp_path, "waiting") as one:
        one.strike("core", signal.SIGKILL)
        told = tmp_path / "told.txt"
        until = time.monotonic() + 10.0
        while not told.exists() and time.monotonic() < until:
            time.sleep(0.05)
        text = told.read_text(encoding="utf-8")
        assert one.ends("watchdog", 2.0)
    assert text.startswith("ScanError: x.move_relative(1e+06 deg) was ended")
    assert "it was ended by SIGKILL" in text
    assert re.search(STOPPED, text)
    assert "ERROR the core had ended: it was ended by SIGKILL; so its drives were stopped\n" in one.journal()
    assert re.search(f"ERROR {STOPPED}", one.journal())


def test_a_suspended_watchdog_process_is_reported_and_all_processes_end(tmp_path):
    with doomed(tmp_path, "waiting") as one:
        at = one.strike("watchdog", signal.SIGSTOP)
        assert one.standstill_after(at, REST) is not None
        told = tmp_path / "told.txt"
        assert one.ends("core", 6.0)
        assert one.ends("watchdog", 2.0)
        assert "the watchdog process of the core has not answered for 0." in told.read_text(encoding="utf-8")
        assert one.process.wait(10) == 0
    assert "INFO leaving: the watchdog process of the core has not answered for 0." in one.journal()


def test_a_watchdog_process_that_is_suspended_for_a_moment_ends_nothing(tmp_path):
    with doomed(tmp_path, "sleeping") as one:
        for _ in range(5):
            one.strike("watchdog", signal.SIGSTOP)
            time.sleep(0.2)
            at = one.strike("watchdog", signal.SIGCONT)
            time.sleep(0.3)
        assert one.turns(at + 0.2)


def test_when_the_program_is_killed_all_of_its_processes_end(tmp_path):
    with doomed(tmp_path, "sleeping") as one:
        one.strike("program", signal.SIGKILL)
        assert one.ends("core", 6.0)
        assert one.ends("watchdog", 2.0)
    rows = one.plant()
    assert rows[-1].stage in OFF
    told = one.journal()
    assert f"for process {one.program}\n" in told
    assert told.index("INFO leaving: the program has ended") < told.index("INFO the core ended\n")
