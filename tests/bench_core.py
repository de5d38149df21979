"""The performance of a core in a process of its own: SYNC beside busy programs, full buses, opening. ``make bench-core``.

Every figure is measured in processes of its own, in turn with its reference. It takes minutes (``--help``).
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from kit.bench.busy_program import LOADS

ROOT = Path(__file__).parents[1]
CELL = ROOT / "examples" / "cell.toml"
CONTROL = Path(__file__).parent / "kit" / "bench" / "control.c"
GOOD_ENOUGH = 150e-6  # seconds of lateness at 99 %
WIRES = ((3, 1), (6, 2), (13, 4), (33, 10))  # axes, and milliseconds, that fill 1 Mbit/s
QUARTER = 0.25  # of a processor, for 13 axes at 4 ms
OPENING = 1.5
READING = 4.0
missed: list[str] = []
rows: list[dict[str, object]] = []


class Late(NamedTuple):
    """How late SYNC was: cycles, lost ones, and seconds."""

    cycles: float
    lost: float
    p99: float

    def __str__(self) -> str:
        return f"p99 {self.p99 * 1e6:6.0f} µs, lost {self.lost:g} of {self.cycles + self.lost:g}"


def row(what: str, figure: str, baseline: str, promise: bool | None = None) -> None:
    """Print one line; ``promise`` False marks a miss."""
    mark = "" if promise is None else "ok" if promise else "MISSED"
    print(f"{what:<42}{figure:<48}{baseline}   {mark}", flush=True)
    rows.append({"what": what, "figure": figure, "baseline": baseline, "promise": promise})
    if promise is False:
        missed.append(what)


def busy(side: str, load: str, seconds: float) -> Late:
    """One run of ``kit.bench.busy_program``; a program that could not keep its machine counts as lost altogether."""
    command = [sys.executable, "-m", "kit.bench.busy_program", side, load, str(seconds), str(CELL)]
    done = subprocess.run(command, cwd=ROOT / "tests", capture_output=True, text=True, check=False)
    if done.returncode:
        if side == "own" or side == "control":
            raise SystemExit(f"{side} beside {load} failed:\n{done.stderr}")
        return Late(0, seconds / 0.004, float("inf"))
    found = json.loads(done.stdout)
    return Late(found["cycles"], found["lost"], found["p99"])


def medians(runs: list[Late]) -> Late:
    """The median of each figure."""
    return Late(*(statistics.median(column) for column in zip(*runs, strict=True)))


def beside_programs(seconds: float, pairs: int) -> None:
    """SYNC of three axes at 4 ms in the program of a user, against a bare loop in C and canopen's SyncProducer."""
    sides = ("own", "control", "thread", "canopen")
    for load in LOADS:
        runs: dict[str, list[Late]] = {side: [] for side in sides}
        for number in range(pairs):
            for side in sides[: None if number == 0 else 2]:
                runs[side].append(busy(side, load, seconds))
        mine, bare = medians(runs["own"]), medians(runs["control"])
        good = mine.p99 <= max(2 * bare.p99, GOOD_ENOUGH) and mine.lost <= 2 * bare.lost + 3
        others = "; ".join(
            f"{name}: {runs[side][0]}" for side, name in (("thread", "in a thread"), ("canopen", "canopen"))
        )
        row(f"SYNC at 4 ms beside {load}", str(mine), f"C: {bare}; {others}", good)


def cycles(axes: int, period: float, seconds: float) -> dict[str, float]:
    """The result of ``bench_cycle.py`` for a core with so many axes."""
    asked = ("--axes", str(axes), "--period", str(period), "--seconds", str(seconds))
    command = [sys.executable, str(Path(__file__).with_name("bench_cycle.py")), "core", *asked]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{axes} axes at {period} s failed:\n{done.stderr}")
    found: dict[str, float] = json.loads(done.stdout)
    return found


def full_wires(seconds: float, pairs: int) -> None:
    """A wire that is full at 1 Mbit/s, every axis on a trajectory; its drives are in another process and answer at once."""
    for axes, period in WIRES:
        runs = [cycles(axes, period / 1000, seconds) for _ in range(pairs)]
        late = medians([Late(run["cycles"], run["lost"], run["p99"]) for run in runs])
        share = statistics.median(run["cpu"] for run in runs) / period * 1000
        os.environ["AXISBUS_BENCH_PERIOD"] = str(period / 1000)
        bare = medians([busy("control", "nothing", seconds) for _ in range(pairs)])
        del os.environ["AXISBUS_BENCH_PERIOD"]
        good = late.lost <= 2 * bare.lost + 3 and (axes != 13 or share <= QUARTER)
        row(f"{axes} axes at {period} ms", f"{late}, {share * 100:.0f} % of a core", f"C: {bare}", good)


OPEN = f"""
import time
from axisbus import Machine
began = time.perf_counter()
machine = Machine.open({str(CELL)!r})
opened = time.perf_counter() - began
axis = machine["x"]
axis.position
began = time.perf_counter()
for _ in range(20000):
    axis.position
read = (time.perf_counter() - began) / 20000
axis.enable().wait(10)
began = time.perf_counter()
for _ in range(20):
    axis.halt().wait(5)
halted = (time.perf_counter() - began) / 20
machine.close()
print(opened, read, halted)
"""


def from_a_program(pairs: int) -> None:
    """Opening, reading and commanding from a fresh program, beside the same in a thread."""
    found: dict[str, list[list[float]]] = {"own": [], "thread": []}
    for _ in range(pairs):
        for mode, figures in found.items():
            environment = {**os.environ, "AXISBUS_PROCESS": mode}
            done = subprocess.run(
                [sys.executable, "-c", OPEN], env=environment, capture_output=True, text=True, check=True
            )
            figures.append([*map(float, done.stdout.split())])
    own, thread = (
        [statistics.median(column) for column in zip(*found[mode], strict=True)] for mode in ("own", "thread")
    )
    row(
        "opening, the first of a program",
        f"{own[0]:.2f} s",
        f"in a thread {thread[0]:.2f} s",
        own[0] <= OPENING * thread[0],
    )
    row(
        "reading axis.position",
        f"{own[1] * 1e6:.1f} µs",
        f"in a thread {thread[1] * 1e6:.1f} µs",
        own[1] <= READING * thread[1],
    )
    row(
        "a halt at rest, from the call to its end",
        f"{own[2] * 1e3:.1f} ms",
        f"in a thread {thread[2] * 1e3:.1f} ms",
    )


@contextmanager
def control() -> Iterator[None]:
    """Have the C program compiled."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise SystemExit("these rows need a C compiler (cc) for their control")
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "control"
        subprocess.run([compiler, "-O2", "-o", str(made), str(CONTROL), "-lm"], check=True)
        os.environ["AXISBUS_CONTROL"] = str(made)
        yield


def main() -> int:
    """Run all and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--seconds", type=float, default=10.0, help="of each run beside a busy program, and of each wire"
    )
    parser.add_argument("--pairs", type=int, default=3, help="runs of which medians are taken")
    parser.add_argument("--json", type=Path, help="a file for the table")
    asked = parser.parse_args()
    with control():
        from_a_program(asked.pairs)
        beside_programs(asked.seconds, asked.pairs)
        full_wires(asked.seconds, asked.pairs)
    if asked.json is not None:
        asked.json.write_text(json.dumps(rows, indent=1, ensure_ascii=False), encoding="utf-8")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
