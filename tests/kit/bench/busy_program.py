"""A program that is busy beside its bus, and prints how late SYNC came, as JSON.

Run it as ``python -m kit.bench.busy_program SIDE LOAD SECONDS [FILE]``.

Sides: ``own`` and ``thread`` (our machine of the cell FILE, its axes on a straight line together), ``canopen`` (its SyncProducer),
``control`` (the C program beside this one).
"""

from __future__ import annotations

import gc
import json
import os
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

PERIOD = float(os.environ.get("AXISBUS_BENCH_PERIOD", "0.004"))  # seconds; that of the cell, too
OBJECTS = 5_000_000
NUMBERS = 1_200_000  # about 20 MB of JSON


def nothing(seconds: float) -> None:
    """The program waits."""
    time.sleep(seconds)


def thread(seconds: float) -> None:
    """A thread counts."""
    until = time.monotonic() + seconds

    def count() -> None:
        number = 0
        while time.monotonic() < until:
            number += 1

    counting = threading.Thread(target=count)
    counting.start()
    counting.join()


def dumps(seconds: float) -> None:
    """It serialises 20 MB again and again."""
    data = [number * 1.000_001 for number in range(NUMBERS)]
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        json.dumps(data)


def collector(seconds: float) -> None:
    """The collector goes through millions of objects, and the program waits in between."""
    kept = [[number] for number in range(OBJECTS)]
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        gc.collect()
        time.sleep(0.1)
    assert len(kept) == OBJECTS


def numpy(seconds: float) -> None:
    """It multiplies matrices."""
    import numpy as np

    matrix = np.random.default_rng(1).random((1000, 1000))
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        matrix @ matrix  # its result is of no use


LOADS: dict[str, Callable[[float], None]] = {
    "nothing": nothing,
    "a busy thread": thread,
    "20 MB of JSON": dumps,
    "5 million objects": collector,
    "numpy": numpy,
}


def ours(load: Callable[[float], None], seconds: float, file: str) -> dict[str, float]:
    """Our machine, in the mode that ``AXISBUS_PROCESS`` says; a motion that fails is an error."""
    from axisbus.machine.machine import Machine

    with Machine.open(file) as machine:
        group = machine.group("xyz")
        group.enable().wait(10)
        for axis in machine:
            axis.home().wait(10)
        moving = group.move_linear([170.0, 85.0, 170.0], velocity=min(1.0, 200 / seconds))
        load(seconds)
        if not moving.active:
            raise AssertionError(f"{moving}: {moving.error}")
        found = machine.cycle_jitter
    return {
        "cycles": found.cycles,
        "lost": found.skipped,
        "p50": found.p50,
        "p99": found.p99,
        "worst": found.worst,
    }


def theirs(load: Callable[[float], None], seconds: float) -> dict[str, float]:
    """``canopen``'s SyncProducer on a line that another process reads."""
    import canopen

    from axisbus.bus.link.socketpair_bus import PairBus
    from axisbus.core.process.launch import can_line

    near, far = can_line()
    stamps: list[float] = []

    class Stamping(PairBus):
        def send(self, msg: object, timeout: float | None = None) -> None:
            stamps.append(time.monotonic())
            super().send(msg, timeout)  # type: ignore[arg-type]

    with draining(far):
        network = canopen.Network(Stamping(near))
        network.sync.start(PERIOD)
        load(seconds)
        network.sync.stop()
        network.bus.shutdown()
    return _of_grid(stamps)


def _of_grid(stamps: list[float]) -> dict[str, float]:
    """How far the stamps are from the grid that fits them best."""
    first = stamps[0]
    numbers = [round((stamp - first) / PERIOD) for stamp in stamps]
    away = [stamp - first - number * PERIOD for stamp, number in zip(stamps, numbers, strict=True)]
    middle = statistics.median(away)
    away = sorted(abs(one - middle) for one in away)
    lost = numbers[-1] + 1 - len(set(numbers))
    return {
        "cycles": len(stamps),
        "lost": lost,
        "p50": away[len(away) // 2],
        "p99": away[int(len(away) * 0.99)],
        "worst": away[-1],
    }


def control(load: Callable[[float], None], seconds: float) -> dict[str, float]:
    """The C program, beside this one with its load."""
    from axisbus.core.process.launch import can_line

    near, far = can_line()
    with draining(far):
        command = [os.environ["AXISBUS_CONTROL"], str(near.fileno()), str(int(PERIOD * 1e6)), str(seconds)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, pass_fds=[near.fileno()])
        load(seconds)
        out, _ = process.communicate()
    found: dict[str, float] = json.loads(out)
    return found


class draining:  # noqa: N801  # it reads as a verb in a with statement
    """Another process reads the frames of a line."""

    def __init__(self, end: socket.socket) -> None:
        code = "import socket, sys\nline = socket.socket(fileno=int(sys.argv[1]))\nwhile line.recv(16): pass"
        self._end = end
        self._process = subprocess.Popen(
            [sys.executable, "-c", code, str(end.fileno())], pass_fds=[end.fileno()]
        )

    def __enter__(self) -> None:
        self._end.close()

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()


def main(side: str, load: str, seconds: str, file: str = "") -> None:
    """Print the result of one side."""
    work, time_of_it = LOADS[load], float(seconds)
    if side in ("own", "thread"):
        os.environ["AXISBUS_PROCESS"] = side
        found = ours(work, time_of_it, str(Path(file)))
    else:
        found = {"canopen": theirs, "control": control}[side](work, time_of_it)
    print(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
