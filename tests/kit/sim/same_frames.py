"""Scenarios in virtual time, each with its seed, and the digests of all their frames; as a program it prints them."""

from __future__ import annotations

import hashlib
import random
import sys
from pathlib import Path

from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from kit.cell import GENERIC, cell_text

SCENARIOS = range(10)


def frames_of(folder: Path, seed: int) -> str:
    """Play a scenario with random commands and faults of the wire; return a digest of all frames and their times."""
    rng = random.Random(seed)
    path = folder / f"cell{seed}.toml"
    path.write_text(cell_text("xy", eds=GENERIC, bus="bitrate = 500_000"), encoding="utf-8")
    digest, count = hashlib.sha256(), 0
    machine = Machine.simulated(path)

    def hear(frames) -> None:
        nonlocal count
        for frame in frames:
            count += 1
            digest.update(f"{frame.time!r} {frame.can_id:X} {frame.data.hex()}\n".encode())

    machine.session.tap(hear)
    wire = machine._core.runtime.link._channel.bus.wire
    x, y = machine
    for axis in (x, y):
        axis.enable().wait(5)
    wire.faults.loss = 0.002 * rng.random()
    commands = (
        lambda axis: axis.move_relative(rng.uniform(-90, 90)),
        lambda axis: axis.move_velocity(50.0),
        lambda axis: axis.halt(),
    )
    for _ in range(6):
        try:
            rng.choice(commands)(rng.choice((x, y)))
        except AxisbusError:
            digest.update(b"refused")
        machine.sleep(rng.uniform(0.1, 0.6))
    try:
        machine.close()
    except (AxisbusError, ExceptionGroup) as error:
        digest.update(str(error).encode())
    assert count > 1000
    return digest.hexdigest()


if __name__ == "__main__":
    print(*[frames_of(Path(sys.argv[1]), seed) for seed in SCENARIOS])
