"""The cost of programs beside a core for its cycle: recordings, monitors, and attacks on its acceptor. ``make bench-clients``.

Each is measured in turn with a control, which is the same machine without it: three axes on a trajectory, at 4 ms.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from kit.acceptor_attacks import ATTACKS
from kit.bench.busy_program import ours

CELL = Path(__file__).parents[1] / "examples" / "cell.toml"
SHARE = 0.02  # of a processor, for a recording
HOURLY = 150e6  # bytes
SCOPE_SHARE = 0.25  # of a processor, for the server of the page
missed: list[str] = []
rows: list[dict[str, object]] = []


class Run(NamedTuple):
    """One run: cycles, lost ones, lateness in seconds, and the CPU time of the programs beside it, in seconds."""

    cycles: float
    lost: float
    p99: float
    cpu: float

    def __str__(self) -> str:
        return f"p99 {self.p99 * 1e6:6.0f} µs, lost {self.lost:g} of {self.cycles + self.lost:g}"


def run(cell: Path, beside: Callable[[float], float], seconds: float) -> Run:
    """Open the machine, let it move, and ``beside`` (which returns its CPU time) run meanwhile."""
    spent = 0.0

    def load(seconds: float) -> None:
        nonlocal spent
        spent = beside(seconds)

    found = ours(load, seconds, str(cell))
    return Run(found["cycles"], found["lost"], found["p99"], spent)


def waiting(seconds: float) -> float:
    """No program beside it."""
    time.sleep(seconds)
    return 0.0


def program(*words: str) -> Callable[[float], float]:
    """A program that ends after so many seconds (``{}`` in its words)."""

    def beside(seconds: float) -> float:
        command = [sys.executable, "-m", *(word.format(seconds) for word in words)]
        child = subprocess.Popen(command, cwd=Path(__file__).parent, stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(child.pid, 0)
        if status:
            raise SystemExit(f"{' '.join(command)} failed")
        return usage.ru_utime + usage.ru_stime

    return beside


def pairs(cell: Path, beside: Callable[[float], float], seconds: float, count: int) -> tuple[Run, Run]:
    """Return medians of runs with and without, in turn."""
    found: list[tuple[Run, Run]] = [
        (run(cell, beside, seconds), run(cell, waiting, seconds)) for _ in range(count)
    ]
    return tuple(Run(*map(statistics.median, zip(*side, strict=True))) for side in zip(*found, strict=True))  # type: ignore[return-value]


def row(what: str, mine: Run, control: Run, more: str = "", promise: bool = True) -> None:
    """Print one line; it is missed where more than twice the control's cycles and 3 are lost, or ``promise`` is not kept."""
    good = mine.lost <= 2 * control.lost + 3 and promise
    print(f"{what:<34}{mine!s:<40}alone: {control}{more}   {'ok' if good else 'MISSED'}", flush=True)
    rows.append({"what": what, "with": mine._asdict(), "alone": control._asdict(), "more": more, "ok": good})
    if not good:
        missed.append(what)


def recording(cell: Path, seconds: float, count: int, folder: Path) -> None:
    """A recording of all axes, by another program."""
    file = folder / "run.mcap"
    words = ("axisbus", "record", str(cell), "-o", str(file), "--force", "--for", "{}")
    mine, control = pairs(cell, program(*words), seconds, count)
    share, hourly = mine.cpu / seconds, file.stat().st_size / seconds * 3600
    more = f"; {share:.1%} of a core, {hourly / 1e6:.0f} MB/h"
    row("axisbus record", mine, control, more, share < SHARE and hourly <= HOURLY)


def others(cell: Path, seconds: float, count: int) -> None:
    """Programs that only read."""
    looks = str(int(seconds * 10))
    beside = {
        "axisbus monitor, 10 looks a second": (
            "axisbus",
            "monitor",
            str(cell),
            "--every",
            "0.1",
            "--count",
            looks,
        ),
        "axisbus trace": ("axisbus", "trace", str(cell), "--seconds", "{}"),
    }
    for what, words in beside.items():
        row(what, *pairs(cell, program(*words), seconds, count))


def scopes(seconds: float, folder: Path) -> None:
    """Four scopes of ten signals at 1 kHz, on the page of another program."""
    cell = folder / "cell.toml"
    text = CELL.read_text("utf-8")
    quick, changed = re.subn(r"^scan_period = .*$", 'scan_period = "1ms"', text, flags=re.MULTILINE)
    quick, wires = re.subn(
        r"^bitrate = .*$", "", quick, flags=re.MULTILINE
    )  # no wire carries three axes at 1 ms
    assert changed == wires == 1
    cell.write_text(quick, "utf-8")
    told: dict[str, float] = {}

    def beside(seconds: float) -> float:
        command = [sys.executable, "-m", "kit.bench.page_scopes", str(cell), str(seconds)]
        done = subprocess.run(command, cwd=Path(__file__).parent, stdout=subprocess.PIPE, check=True)
        told.update(json.loads(done.stdout))
        return told["cpu"]

    mine, control = pairs(cell, beside, seconds, 1)
    share = mine.cpu / seconds
    more = f"; {share:.1%} of a core, {told['samples']:.0f} samples, {told['lost']:.0f} lost"
    row("4 scopes of 10 signals at 1 kHz", mine, control, more, share < SCOPE_SHARE)


def by_opcua(cell: Path, said: list[str], client: str, *words: str) -> Callable[[float], float]:
    """An OPC UA server with a client, whose last line is kept in ``said``."""

    def beside(seconds: float) -> float:
        command = ("-u", "-m", "axisbus", "bridge", "opcua", str(cell), "--port", "0")
        bridge = subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, text=True)
        assert bridge.stdout is not None
        url = bridge.stdout.readline().split()[-1]
        asking = [sys.executable, "-m", client, url, *words, str(seconds)]
        done = subprocess.run(
            asking, cwd=Path(__file__).parent, stdout=subprocess.PIPE, check=True, text=True
        )
        said.append(done.stdout.strip())
        bridge.terminate()
        _, _, usage = os.wait4(bridge.pid, 0)
        bridge.stdout.close()
        return usage.ru_utime + usage.ru_stime

    return beside


def by_zenoh(cell: Path, told: list[dict[str, float]], *words: str) -> Callable[[float], float]:
    """A bridge to a Zenoh network with a subscriber to all of it; its counts are stored in ``told``."""

    def beside(seconds: float) -> float:
        command = [sys.executable, "-m", "kit.bench.zenoh_subscriber", str(cell), str(seconds), *words]
        done = subprocess.run(command, cwd=Path(__file__).parent, stdout=subprocess.PIPE, check=True)
        told.append(json.loads(done.stdout))
        return told[-1]["cpu"]

    return beside


def by_metrics(cell: Path) -> Callable[[float], float]:
    """Figures for Prometheus, asked for ten times a second."""

    def beside(seconds: float) -> float:
        end = time.monotonic() + seconds
        command = ("-u", "-m", "axisbus", "bridge", "metrics", str(cell), "--port", "0")
        bridge = subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, text=True)
        assert bridge.stdout is not None
        url = bridge.stdout.readline().split()[-1]
        while time.monotonic() < end:
            with urllib.request.urlopen(url, timeout=5.0) as answer:
                assert b"axisbus_up" in answer.read()
            time.sleep(0.1)
        bridge.terminate()
        _, _, usage = os.wait4(bridge.pid, 0)
        bridge.stdout.close()
        return usage.ru_utime + usage.ru_stime

    return beside


def bridged(cell: Path, seconds: float, count: int) -> None:
    """Each bridge with a client that reads all of it, and with a misbehaving one; then all of them at a time."""
    for what, client, words in (
        ("a subscriber", "kit.opcua.subscriber", (cell.stem,)),
        ("attacked", "kit.opcua.attacks", ()),
    ):
        said: list[str] = []
        mine, control = pairs(cell, by_opcua(cell, said, client, *words), seconds, count)
        came = f", {said[-1]} changes and good ones" if said[-1] else ""
        row(
            f"axisbus bridge opcua, {what}",
            mine,
            control,
            f"; {mine.cpu / seconds:.1%} of a core{came}",
            said[-1] != "0 0",
        )
    for what, nonsense in (("bridge zenoh, 1 subscriber", ()), ("bridge zenoh, asked nonsense", ("junk",))):
        told: list[dict[str, float]] = []
        mine, control = pairs(cell, by_zenoh(cell, told, *nonsense), seconds, count)
        rate = statistics.median(each["states"] for each in told) / seconds
        asked = statistics.median(each["asked"] for each in told) / seconds
        more = f"; {mine.cpu / seconds:.1%} of a core, {rate:.0f} states/s, {asked:.0f} queries/s"
        row(what, mine, control, more)
    everything = at_a_time(
        by_opcua(cell, [], "kit.opcua.subscriber", cell.stem), by_zenoh(cell, []), by_metrics(cell)
    )
    mine, control = pairs(cell, everything, seconds, count)
    row("all bridges at a time", mine, control, f"; {mine.cpu / seconds:.1%} of a core")


def at_a_time(*besides: Callable[[float], float]) -> Callable[[float], float]:
    """All of them, each in a thread; one that fails fails all."""

    def beside(seconds: float) -> float:
        with ThreadPoolExecutor(len(besides)) as pool:
            return sum(pool.map(lambda each: each(seconds), besides))

    return beside


def attacks(cell: Path, seconds: float, count: int) -> None:
    """Attacks on the acceptor."""
    for name in ATTACKS:
        row(name, *pairs(cell, program("kit.acceptor_attacks", name, str(cell), "{}"), seconds, count))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run all and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="of each run of an attack")
    parser.add_argument("--recorded", type=float, default=600.0, help="seconds of the run that is recorded")
    parser.add_argument("--scoped", type=float, default=600.0, help="seconds of the run with scopes")
    parser.add_argument(
        "--pairs", type=int, default=3, help="runs of which medians are taken; one of the recording"
    )
    parser.add_argument("--json", type=Path, help="a file for the table")
    asked = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        attacks(CELL, asked.seconds, asked.pairs)
        others(CELL, asked.seconds, asked.pairs)
        bridged(CELL, asked.seconds, asked.pairs)
        recording(CELL, asked.recorded, 1, Path(folder))
        scopes(asked.scoped, Path(folder))
    if asked.json is not None:
        asked.json.write_text(json.dumps(rows, indent=1, ensure_ascii=False), encoding="utf-8")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
