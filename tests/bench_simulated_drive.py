"""The cost of the simulated drive, printed: run it by hand with ``python tests/bench_simulated_drive.py``."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from axisbus.machine.machine import Machine
from axisbus.sim.device import Device
from axisbus.sim.drive import Drive
from axisbus.sim.node.slave import Slave
from kit.cell import cell_file
from kit.sim.eds import drive_eds

PERIOD = 0.01


def microseconds(call: Callable[[], None], count: int = 20_000) -> float:
    """Time per call; the best of three rounds."""
    rounds = []
    for _ in range(3):
        start = time.perf_counter()
        for _ in range(count):
            call()
        rounds.append((time.perf_counter() - start) / count * 1e6)
    return min(rounds)


def moving(drive: Drive, step: Callable[[float], None]) -> None:
    """Enable it and send it on a long pp move."""
    drive.mode = 1
    for word in (6, 7, 15):
        drive.controlword = word
        for _ in range(5):
            step(PERIOD)
    drive.target_position = 2_000_000_000
    drive.controlword = 0x1F
    step(PERIOD)
    drive.controlword = 0x0F


def main() -> None:
    drive = Drive(drive_eds())
    for _ in range(5):
        drive.step(PERIOD)
    moving(drive, drive.step)
    print(f"Drive.step(0.01) on a pp move    {microseconds(lambda: drive.step(PERIOD)):7.2f} µs")

    device = Device(drive_eds(), 5)
    slave = Slave(device)
    clock = [0.0]

    def step(_: float = 0.0) -> None:
        clock[0] += PERIOD
        slave.step(clock[0])
        slave.take_frames()

    moving(device.drive, step)
    slave.on_frame(0, b"\1\0", clock[0])
    print(f"Slave.step with two event TPDOs  {microseconds(step):7.2f} µs")

    with tempfile.TemporaryDirectory() as folder:
        file = cell_file(Path(folder), "xyz")
        with Machine.simulated(file) as machine:
            for axis in machine:
                axis.enable().wait(5)
                axis.move_velocity(50.0).wait(5)
            cost = microseconds(lambda: machine.sleep(PERIOD), 2000)
    print(f"a cycle of three axes, simulated {cost:7.2f} µs")
    print(f"an hour of three axes at 10 ms   {cost * 3600 / PERIOD * 1e-6:7.1f} s")


if __name__ == "__main__":
    main()
