"""A program whose cell has a module: its axes turn, until one of its processes is killed or suspended.

``python -m kit.can_simple.moving_program FOLDER SCENE``: it prints ``ready PROGRAM WATCHDOG CORE`` (process IDs, 0 if the core is
a thread of the program) when all axes turn; the module at a velocity, which continues without a master.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

from axisbus.core.process.client import RemoteCore
from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine

LONG = 60.0


def turning(folder: Path) -> Machine:
    """Open the machine, and let its axes turn."""
    machine = Machine.open(folder / "cell.toml")
    for axis in machine:
        _enable(machine, axis.name)
    for name in "xy":
        machine[name].move_relative(1e5, velocity=90.0)
    machine["m"].move_velocity(90.0).wait(10)
    owner = machine._core
    pids = (owner._process._watchdog.pid, owner.process) if isinstance(owner, RemoteCore) else (0, 0)  # type: ignore[union-attr]
    print("ready", os.getpid(), *pids, flush=True)
    return machine


def _enable(machine: Machine, name: str) -> None:
    """A computer that was too busy for a heartbeat is given another moment."""
    for _ in range(5):
        try:
            machine[name].enable().wait(10)
        except AxisbusError:
            time.sleep(0.3)
            if machine[name].error is not None:
                machine[name].reset().wait(10)
        else:
            return
    machine[name].enable().wait(10)


def sleeping(folder: Path) -> None:
    """It does nothing."""
    with turning(folder):
        time.sleep(LONG)


def returning(folder: Path) -> None:
    """It ends, and has closed nothing."""
    machine = turning(folder)
    assert machine


def raising(folder: Path) -> None:
    """Its block ends by an exception."""
    with turning(folder):
        raise ValueError("a mistake of its own")


def closing(folder: Path) -> None:
    """It closes the machine."""
    turning(folder).close()


SCENES: dict[str, Callable[[Path], None]] = {
    scene.__name__: scene for scene in (sleeping, returning, raising, closing)
}

if __name__ == "__main__":
    SCENES[sys.argv[2]](Path(sys.argv[1]))
