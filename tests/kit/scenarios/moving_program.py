"""A program with a core of its own whose axes turn, until one of its processes is killed or suspended.

``python -m kit.scenarios.moving_program FOLDER SCENE``: the cell file is FOLDER/cell.toml. It prints
``ready PROGRAM WATCHDOG CORE`` (process IDs) when they turn, and appends its errors to FOLDER/told.txt afterwards.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from axisbus.core.process.client import RemoteCore
from axisbus.errors import AxisbusError
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine

LONG = 30.0


def turning(folder: Path) -> tuple[Machine, Handle]:
    """Open the machine and let its axes turn for long; return it with the handle of the first one."""
    machine = Machine.open(folder / "cell.toml")
    for enabled in [axis.enable() for axis in machine]:
        enabled.wait(20)
    handle, *_ = [axis.move_relative(1e6, velocity=90.0) for axis in machine]
    time.sleep(0.5)
    return machine, handle


def ready(machine: Machine) -> None:
    """Print the process IDs."""
    owner = machine._core
    assert isinstance(owner, RemoteCore)
    print("ready", os.getpid(), owner._process._watchdog.pid, owner.process, flush=True)


def sleeping(folder: Path) -> None:
    """It does nothing."""
    machine, _ = turning(folder)
    ready(machine)
    time.sleep(LONG)


def waiting(folder: Path) -> None:
    """It waits for its command, and writes down how that ends."""
    machine, handle = turning(folder)
    ready(machine)
    try:
        handle.wait(LONG)
    except (AxisbusError, TimeoutError) as error:
        (folder / "told.txt").write_text(f"{type(error).__name__}: {error}", encoding="utf-8")
    time.sleep(1.0)


def streaming(folder: Path) -> None:
    """It gives points to all axes, at 90 deg/s, as they find room."""
    machine = Machine.open(folder / "cell.toml")
    for enabled in [axis.enable() for axis in machine]:
        enabled.wait(20)
    group = machine.group(*(axis.name for axis in machine))
    points, began = group.stream(period="10ms"), time.monotonic()
    told = False
    while time.monotonic() < began + LONG:
        points.push([0.9 * points.count] * len(machine))
        if not told and time.monotonic() > began + 1.5:
            ready(machine)
            told = True


def carrying(folder: Path) -> None:
    """Two of its axes carry a beam, which it moves."""
    machine = Machine.open(folder / "cell.toml")
    beam = machine.gantry("b")
    beam.enable().wait(20)
    beam.move_velocity(90.0).wait(20)
    time.sleep(0.5)
    ready(machine)
    time.sleep(LONG)


def computing(folder: Path) -> None:
    """It is in a long call, in which no other thread of its own runs."""
    machine, _ = turning(folder)
    ready(machine)
    sum(range(400_000_000))
    time.sleep(LONG)


def returning(folder: Path) -> None:
    """It ends, and has closed nothing."""
    machine, _ = turning(folder)
    ready(machine)


def raising(folder: Path) -> None:
    """Its block ends by an exception."""
    machine, _ = turning(folder)
    with machine:
        ready(machine)
        raise ValueError("a mistake of its own")


def forking(folder: Path) -> None:
    """It has forked a worker before, which has all of its descriptors and lives on."""
    machine, _ = turning(folder)
    if os.fork() == 0:
        time.sleep(LONG)
        os._exit(0)
    ready(machine)
    time.sleep(LONG)


def hoarding(folder: Path) -> None:
    """The same, with a worker that bypasses the hooks of a forked child: its copies of the connection stay open."""
    machine, _ = turning(folder)
    copies = [os.dup(machine._core._process.line.fileno())]  # type: ignore[attr-defined]
    worker = subprocess.Popen(["sleep", str(LONG)], pass_fds=copies)
    print("worker", worker.pid, file=sys.stderr)
    ready(machine)
    time.sleep(LONG)


def _have_closed(close: Callable[[int], None], hoarded: bool = False) -> Callable[[Path], None]:
    """A scene that breaks the connection to its machine on request, and then continues computing."""

    def scene(folder: Path) -> None:
        machine, _ = turning(folder)
        line = machine._core._process.line.fileno()  # type: ignore[attr-defined]
        if hoarded:
            subprocess.Popen(["sleep", str(LONG)], pass_fds=[os.dup(line)])
        signal.signal(signal.SIGUSR1, lambda *_: close(line))
        ready(machine)
        while True:
            time.sleep(0.01)

    return scene


def _replace(line: int) -> None:
    os.dup2(os.open(os.devnull, os.O_RDWR), line)


def _close_and_compute(_: int) -> None:
    os.closerange(3, 4096)
    sum(range(400_000_000))


def _close_in_a_child(_: int) -> None:
    if os.fork() == 0:
        os.closerange(3, 4096)
        time.sleep(LONG)
        os._exit(0)


LOSSES = {
    "closing-all": _have_closed(lambda _: os.closerange(3, 4096)),
    "closing-one": _have_closed(os.close),
    "replacing": _have_closed(_replace),
    "closing-and-computing": _have_closed(_close_and_compute),
    "closing-a-hoarded-one": _have_closed(os.close, hoarded=True),
    "closing-in-a-child": _have_closed(_close_in_a_child),
}

SCENES: dict[str, Callable[[Path], None]] = {
    scene.__name__: scene
    for scene in (sleeping, waiting, streaming, carrying, computing, returning, raising, forking, hoarding)
} | LOSSES

if __name__ == "__main__":
    SCENES[sys.argv[2]](Path(sys.argv[1]))
