"""A program of its own in which every error occurs for the first time, while the files opened by its scan's threads are watched.

``python -m kit.scenarios.first_fault FOLDER``: prints each error, then the opened files.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from kit import scan_file_access
from kit.scenarios.simulated_bus import Line, enable, until
from kit.virtual_time import virtual_time


def told(machine: Machine) -> None:
    """Wait for the first axis's error and print it."""
    until(lambda: machine["x"].error is not None)
    print(machine["x"].error)


def drives_fault(folder: Path) -> None:
    with Line(folder, "xy", eds="builtin:gim6010-8") as line, line.open() as machine:
        for axis in machine:
            enable(axis)
        with line.lock:
            line.drive("x").fault(0xFF00, maker_bits=1 << 4)
        told(machine)


def node_is_lost(folder: Path) -> None:
    with Line(folder, "xy") as line, line.open() as machine:
        for axis in machine:
            enable(axis)
            axis.move_velocity(90.0)
        line.devices["x"].dials.dead = True
        told(machine)
        line.devices["x"].dials.dead = False
        time.sleep(1.0)  # its messages are received again


def drive_refuses(folder: Path) -> None:
    with Line(folder) as line, line.open() as machine:
        enable(machine["x"])
        line.drive().dials.modes_refused = frozenset({3})
        try:
            machine["x"].move_velocity(90.0).wait(20)
        except AxisbusError as error:
            print(error)


def main() -> None:
    folder = Path(sys.argv[1])
    scan_file_access.begin()
    for scene in (drives_fault, node_is_lost, drive_refuses):
        try:
            with virtual_time():
                scene(folder)
        except AxisbusError as error:
            print(error)
    print("opened:", scan_file_access.taken())


if __name__ == "__main__":
    main()
