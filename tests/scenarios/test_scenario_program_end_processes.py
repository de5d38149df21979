"""Ends of a machine with signals and other processes: threads, forked children, workers, several machines."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time

import pytest

from axisbus.cpu_starvation import REMEDY
from axisbus.machine.machine import Machine
from axisbus.machine.signal_shutdown import EXIT
from kit.cell import cell_text
from kit.plant_probe import ENABLED, OFF, SWITCH_ON_DISABLED, PlantMoves
from kit.scenarios.program import Program
from kit.scenarios.simulated_bus import STOP, Line, turning

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="signals and forks are those of POSIX")


@POSIX
def test_a_signal_while_another_thread_closes_interrupts_the_main_thread(tmp_path):
    """It is not kept for the end of the block, which may be far away."""
    with Line(tmp_path) as line:
        with pytest.raises(KeyboardInterrupt), line.open() as machine:
            turning(machine, line, 300.0)
            closer = threading.Thread(target=machine.close)
            closer.start()
            time.sleep(0.02)
            began = time.monotonic()
            signal.raise_signal(signal.SIGINT)
            time.sleep(20.0)
        assert time.monotonic() - began < 10.0
        line.must_be_still(stages=SWITCH_ON_DISABLED, within=0.0)
        closer.join(STOP)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert not EXIT.listens


@POSIX
def test_a_thread_that_commands_after_a_signal_moves_nothing(tmp_path):
    """The main thread may be long in leaving."""
    with Line(tmp_path) as line:
        over = threading.Event()

        def command(machine: Machine) -> None:
            while not over.is_set():
                machine["x"].enable().exception()
                machine["x"].move_velocity(90.0).exception()
                time.sleep(0.01)

        with pytest.raises(SystemExit), line.open() as machine:
            turning(machine, line)
            worker = threading.Thread(target=command, args=(machine,))
            worker.start()
            try:
                signal.raise_signal(signal.SIGTERM)
            finally:
                line.must_be_still(stages=SWITCH_ON_DISABLED, for_good=1.0)
                over.set()
                worker.join(STOP)


class Scene:
    """The output of the processes of a scene."""

    def __init__(self, folder, name: str) -> None:
        self._lines: list[dict] = []
        for _ in range(3):
            if not self._play(folder, name):
                break

    def _play(self, folder, name: str) -> bool:
        """Play it; return whether the computer was too busy for it."""
        path = folder / "seen.jsonl"
        path.unlink(missing_ok=True)
        (folder / "cell.toml").write_text(cell_text("xy", period="20ms", heartbeat="400ms"), encoding="utf-8")
        with Program("program_ends", str(folder), name) as program:
            self.code, self.errors = program.end()
        assert path.exists(), self.errors
        self._lines = [json.loads(line) for line in path.read_text().splitlines()]
        return REMEDY in self.errors

    def all(self, who: str) -> list[dict]:
        """The output of one of them."""
        return [line for line in self._lines if line["who"] == who]

    def one(self, who: str) -> dict:
        """The only thing that one of them has written."""
        (line,) = self.all(who)
        return line

    def must_turn(self, speed: float, who: str = "end") -> None:
        """Make sure that the parent's motor continues, monitored."""
        seen = self.one(who)
        assert abs(seen["velocity"] - speed) < 5.0, seen
        assert seen["stage"] == ENABLED
        assert seen["watch"] != 0

    def must_have_sent_nothing(self) -> None:
        """Make sure that no child has sent a frame."""
        assert self.all("sent") == []


def must_be_still(plant: dict) -> None:
    """Make sure that a motor is at standstill and off."""
    if plant["velocity"] or plant["stage"] not in OFF:
        raise PlantMoves(str(plant))


@POSIX
def test_a_machine_that_is_closed_leaves_the_signals_to_the_others(tmp_path):
    scene = Scene(tmp_path, "first_closed_first")
    must_be_still(scene.one("end"))
    assert scene.code == 143


@POSIX
def test_after_the_last_machine_the_process_is_as_before_in_any_order(tmp_path):
    scene = Scene(tmp_path, "both_closed")
    assert scene.code == 0, scene.errors
    assert [end["same"] for end in scene.all("end")] == [True, True], scene.all("end")


@POSIX
def test_a_signal_stops_all_machines(tmp_path):
    scene = Scene(tmp_path, "signal_stops_both")
    assert scene.code == 0, scene.errors
    must_be_still(scene.one("end")["first"])
    must_be_still(scene.one("end")["second"])


@POSIX
def test_a_forked_child_can_neither_command_nor_close_its_parents_machine(tmp_path):
    scene = Scene(tmp_path, "child_exits")
    assert scene.code == 0, scene.errors
    scene.must_turn(80.0)
    scene.must_have_sent_nothing()
    child = scene.one("child")
    for what in ("command", "wait"):
        assert child[what].startswith("StateError: "), child
        assert "belongs to the process that opened it" in child[what]
    for what in ("position", "state"):
        assert child[what].startswith("StaleError: ")
    assert "forked" in child["error"]
    for what in ("sdo", "nmt"):
        kind = "StateError" if os.environ.get("AXISBUS_PROCESS") == "own" else "AdapterError"
        assert child[what].startswith(f"{kind}: "), child
    assert child["close"] == child["leave"] == "nothing"
    assert child["terminated"] == repr(signal.SIG_DFL)
    assert abs(child["interval"] - 0.005) < 1e-6
    assert scene.one("end")["code"] == 0
    assert scene.one("child gone")["after"] < 5.0
    assert [end["pid"] for end in scene.all("ended")] == [False, True]


@POSIX
def test_a_forked_child_that_leaves_the_block_by_an_exception_stops_nothing(tmp_path):
    scene = Scene(tmp_path, "child_leaves_by_exception")
    assert scene.code == 0, scene.errors
    scene.must_turn(90.0)
    scene.must_have_sent_nothing()


@POSIX
def test_a_worker_process_that_is_terminated_does_not_stop_its_parent(tmp_path):
    scene = Scene(tmp_path, "worker_terminated")
    assert scene.code == 0, scene.errors
    scene.must_turn(90.0)
    codes = scene.one("end")["codes"]
    assert codes[0] == -signal.SIGTERM
    assert codes[1] != 0
    assert scene.one("end")["state"] == "ContinuousMotion"


@POSIX
def test_spawned_workers_and_other_programs_leave_the_machine_alone(tmp_path):
    scene = Scene(tmp_path, "other_processes")
    assert scene.code == 0, scene.errors
    scene.must_turn(90.0)
    scene.must_have_sent_nothing()
    assert scene.one("end")["squares"] == [1, 2, 3]


@POSIX
def test_a_forked_child_may_have_its_own_machine(tmp_path):
    scene = Scene(tmp_path, "machine_in_child")
    assert scene.code == 0, scene.errors
    must_be_still(scene.one("child"))
    scene.must_turn(90.0)
    assert scene.one("end")["code"] == 143
