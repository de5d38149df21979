"""The cost of a fleet: 100 fake cells, and simulated cells in processes of their own; prints figures, in minutes.

``python tests/bench_fleet.py [stand-ins] [cells]``; the CPU is that of this computer's processes, in per cent of one core.
"""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from axisbus import Fleet
from kit.cell import cell_text
from kit.fleet.processes import ProcessCell, tree
from kit.fleet.zenoh_network import free_endpoint

CELLS, AXES = 100, ("x", "y", "z")
RATES = (10.0, 25.0, 50.0, 100.0)
SECONDS = 10.0
CELL_RUNS = ((1, "4ms"), (5, "4ms"), (10, "20ms"), (20, "50ms", "x"))  # how many, their cycle, and axes
PLANT = "bench"
ROOT = Path(__file__).parents[1]
STAND_INS = """
import sys, threading
from axisbus.fleet.network import ZenohNetwork, opened
from kit.fleet.fake_cell import FakeCell
endpoint, first, count, rate = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4])
session = opened(ZenohNetwork(listen=(endpoint,)))
cells = [FakeCell(session, "bench", f"cell{n}", ("x", "y", "z"), rate=rate) for n in range(first, first + count)]
print("ready", flush=True)
threading.Event().wait()
"""


def cpu(pid="self"):
    """Seconds of CPU that a process has taken."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def used():
    taken = resource.getrusage(resource.RUSAGE_SELF)
    return taken.ru_utime + taken.ru_stime


def measured(fleet):
    """CPU of this process (per cent of a core) and states received per second, over some seconds."""
    before, begun, heard = used(), time.monotonic(), numbers(fleet)
    time.sleep(SECONDS)
    lasted = time.monotonic() - begun
    after = numbers(fleet)
    states = sum(after[key] - heard.get(key, after[key]) for key in after)
    return 100 * (used() - before) / lasted, states / lasted


def numbers(fleet):
    return {
        (cell.name, axis.name): seen.state.n
        for cell in fleet
        for axis in cell
        if (seen := cell.last_state(axis.name)) is not None
    }


def fresh(fleet):
    return sum(1 for cell in fleet for axis in cell if (seen := cell.last_state(axis.name)) and seen.fresh)


def ages(fleet):
    return sorted(
        seen.age
        for cell in fleet
        for axis in cell
        if (seen := cell.last_state(axis.name)) and seen.age is not None
    )


def simulated_nodes(rate, processes=4):
    """100 cells of 3 axes each, imitated by some processes and watched by this one."""
    each = CELLS // processes
    endpoints = [free_endpoint() for _ in range(processes)]
    begun = [
        subprocess.Popen(
            [sys.executable, "-c", STAND_INS, endpoint, str(number * each), str(each), str(rate)],
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": str(ROOT / "tests")},
            text=True,
        )
        for number, endpoint in enumerate(endpoints)
    ]
    try:
        for one in begun:
            one.stdout.readline()
        with Fleet(PLANT, connect=endpoints) as fleet:
            fleet.wait_for(*(f"cell{n}" for n in range(CELLS)), timeout=60)
            time.sleep(2.0)
            before = sum(cpu(one.pid) for one in begun)
            took, states = measured(fleet)
            players = 100 * (sum(cpu(one.pid) for one in begun) - before) / SECONDS
            told, wanted = ages(fleet), CELLS * len(AXES) * rate
            print(
                f"{CELLS} stand-ins x {len(AXES)} axes at {rate:g} Hz: {states:.0f} of {wanted:.0f} states/s told; "
                f"watcher {took:.1f} % of a core, {took / CELLS:.2f} % per cell; "
                f"stand-ins {players:.0f} %; {fresh(fleet)} of {CELLS * len(AXES)} values fresh, "
                f"age median {1000 * told[len(told) // 2]:.0f} ms, oldest {1000 * told[-1]:.0f} ms",
                flush=True,
            )
    finally:
        for one in begun:
            one.kill()
            one.wait()


def tree_cpu(program):
    """Seconds of CPU of a program and of all that it has begun."""
    found = 0.0
    for pid in tree(program.pid):
        with suppress(OSError):
            found += cpu(pid)
    return found


def example(period):
    """The cell of the examples, with another cycle."""
    text = (ROOT / "examples" / "cell.toml").read_text("utf-8")
    return re.sub(r"^scan_period = .*$", f'scan_period = "{period}"\nprocess = "own"', text, flags=re.M)


def own(axes, period):
    """A cell of generic drives, whose core has a process of its own."""
    return cell_text(axes, period=period, heartbeat="1s", bus='process = "own"')


def cells(count, period, axes="xyz"):
    """Simulated cells in processes with their bridges, watched by this one: the example's, or some of fewer axes."""
    text, begun = example(period) if axes == "xyz" else own(axes, period), []
    with tempfile.TemporaryDirectory() as folder:
        try:
            for number in range(count):  # those that are there already are ended where the next one fails
                begun += [ProcessCell(Path(folder), f"cell{number}", PLANT, axes, text)]
            with Fleet(PLANT, connect=[cell.endpoint for cell in begun]) as fleet:
                fleet.wait_for(*(cell.name for cell in begun), timeout=60)
                time.sleep(3.0)
                before = [(tree_cpu(cell.machine), tree_cpu(cell.bridge)) for cell in begun]
                took, states = measured(fleet)
                after = [(tree_cpu(cell.machine), tree_cpu(cell.bridge)) for cell in begun]
                machine, bridge = (
                    100
                    * sum(then[part] - now[part] for then, now in zip(after, before, strict=True))
                    / SECONDS
                    / count
                    for part in (0, 1)
                )
                told, all_axes = ages(fleet), sum(len(list(cell)) for cell in fleet)
                print(
                    f"{count} simulated cells x {len(axes)} axes, cycle {period}: {states:.0f} states/s told; per cell: "
                    f"machine with its simulated drives {machine:.1f} % of a core, bridge {bridge:.1f} %, "
                    f"watcher {took / count:.2f} %; together {count * (machine + bridge) + took:.0f} % of "
                    f"{100 * os.cpu_count()} %; {fresh(fleet)} of {all_axes} values fresh, "
                    f"age median {1000 * told[len(told) // 2]:.0f} ms, oldest {1000 * told[-1]:.0f} ms; {late(begun)}; "
                    f"a cell that is killed is gone after {1000 * unreachable_after(fleet, begun[-1]):.0f} ms",
                    flush=True,
                )
        finally:
            for cell in begun:
                cell.kill()
                cell.end()


def unreachable_after(fleet, cell):
    """Kill a cell, and return after how many seconds the fleet sees it as gone."""
    cell.kill()
    begin = time.monotonic()
    while fleet[cell.name].alive:
        time.sleep(0.002)
    return time.monotonic() - begin


def late(begun):
    """The skipped cycles, reported by the machines themselves."""
    skipped = [
        int(found[-1])
        if (found := re.findall(r"; (\d+) skipped", cell.file.with_name("1.log").read_text()))
        else 0
        for cell in begun
    ]
    return f"cycles left out since the beginning: {sum(skipped)}, most in one cell {max(skipped)}"


def main(arguments):
    if not arguments or "stand-ins" in arguments:
        for rate in RATES:
            simulated_nodes(rate)
    if not arguments or "cells" in arguments:
        for each in CELL_RUNS:
            cells(*each)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the started processes are ended
    main(sys.argv[1:])
