"""A program in a process of its own (a module of this package), the signals to it, and its records."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from kit.cell import cell_text
from kit.plant_probe import OFF, STAGE_NAMES, PlantMoves

TESTS = Path(__file__).parents[2]
LONGEST = 120.0  # seconds after which a program that hangs is killed; it needs a few


@dataclass(frozen=True)
class FinalState:
    """The end of a scene, as the program wrote it down: velocity in deg/s, the distance in degrees since closing began."""

    scene: str
    raised: str
    notes: list[str]
    velocity: float
    stage: int
    way: float

    def must_be_still(self) -> None:
        """Make sure that the motor was at standstill and off when the machine was closed.

        Raises:
            PlantMoves: it was not.
        """
        if self.velocity or self.stage not in OFF:
            raise PlantMoves(f"{self.scene}: {self.velocity:g} deg/s, {STAGE_NAMES[self.stage]}")


@dataclass(frozen=True)
class Ended:
    """A program that has ended."""

    scenes: list[FinalState]
    code: int
    errors: str


class Program:
    """A running program of this package, by its module's name; it is killed at the end in any case."""

    def __init__(
        self, program: str, *arguments: str, stdin: int | None = None, pass_fds: Sequence[int] = ()
    ) -> None:
        path = os.pathsep.join([str(TESTS), *filter(None, [os.environ.get("PYTHONPATH")])])
        self.process = subprocess.Popen(
            [sys.executable, "-m", f"kit.scenarios.{program}", *arguments],
            stdin=stdin,
            pass_fds=pass_fds,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": path},
        )
        self._alarm = threading.Timer(LONGEST, self.process.kill)

    def __enter__(self) -> Program:
        self._alarm.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._alarm.cancel()
        self.process.kill()
        self.process.communicate()

    def hear(self, word: str) -> None:
        """Wait until the program prints a word."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline().strip()
        assert line == word, f"{line!r} instead of {word!r}: {self.process.communicate()[1]}"

    def send(self, *numbers: int, pause: float = 0.0) -> None:
        """Send signals, with ``pause`` seconds between them."""
        for place, number in enumerate(numbers):
            time.sleep(pause if place else 0.0)
            os.kill(self.process.pid, number)

    def end(self) -> tuple[int, str]:
        """Wait for its end; return its exit code and its error output."""
        _, errors = self.process.communicate()
        return self.process.returncode, errors


def play(
    folder: Path,
    scenes: Sequence[tuple[str, tuple[int, ...]]],
    nets: Sequence[str] = (),
    *,
    before: float = 0.1,
    pause: float = 0.0,
) -> Ended:
    """Let a program play scenes and send each its signals, ``before`` seconds after it is ready and with ``pause`` in between."""
    text = cell_text("x", period="20ms", heartbeat="200ms", stop='halt_time = "15s"')
    (folder / "cell.toml").write_text(text, encoding="utf-8")
    with Program("signalled_program", str(folder), ";".join(nets), *(name for name, _ in scenes)) as program:
        for name, numbers in scenes:
            if numbers:
                program.hear("ready")
                time.sleep(before)
                program.send(*_in_time(name, numbers, nets), pause=pause)
        code, errors = program.end()
    seen = folder / "seen.jsonl"
    assert seen.exists(), errors
    return Ended([FinalState(**json.loads(line)) for line in seen.read_text().splitlines()], code, errors)


def _in_time(scene: str, numbers: tuple[int, ...], nets: Sequence[str]) -> tuple[int, ...]:
    """Leave out the signals that would come after the end of a stop that is cut short."""
    if not nets:
        return numbers
    return () if scene in ("leaving", "closing") else numbers[:1]
