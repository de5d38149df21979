"""A master in a process of its own, whose drives are in another.

``python -m kit.scenarios.master_process FOLDER CHANNEL SOCKET NETS MOTION``:
it starts MOTION of its axis, prints ``moving``, waits for the end, and writes its errors to FOLDER/told.pickle.
"""

from __future__ import annotations

import pickle
import socket
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from axisbus.errors import AxisbusError
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.scenarios.safety_nets import cut
from kit.scenarios.socket_bridge import Bridge

SPEED = 90.0  # deg/s


def following(x: Axis) -> Handle:
    """Follow a trajectory of some seconds: every target comes from this program."""
    return x.follow(TrapezoidalTrajectory(0.0, 180.0, SPEED, 500.0))


def turning(x: Axis) -> Handle:
    """Move to a position that is far away, planned by the drive."""
    return x.move_relative(1e5, velocity=SPEED)


MOTIONS: dict[str, Callable[[Axis], Handle]] = {"following": following, "turning": turning}


def _end_of(handle: Handle) -> AxisbusError | None:
    try:
        handle.wait(30)
    except AxisbusError as error:
        return error
    return None


def main() -> None:
    """Move, wait, and report."""
    folder, channel, end, nets, motion = sys.argv[1:]
    bridge = Bridge(channel, socket.socket(fileno=int(end)))
    told: list[AxisbusError | None] = []
    with ExitStack() as stack:
        stack.callback(bridge.close)
        stack.enter_context(cut(tuple(nets.split(";")) if nets else ()))
        machine = Machine.open(Path(folder) / "cell.toml")
        try:
            with machine:
                machine["x"].enable().wait(30)
                handle = MOTIONS[motion](machine["x"])
                print("moving", flush=True)
                told.append(_end_of(handle))
                print("ended", flush=True)
                sys.stdin.readline()  # the other side looks at its motor
        except AxisbusError as error:
            told.append(error)
        (Path(folder) / "told.pickle").write_bytes(pickle.dumps(told))


if __name__ == "__main__":
    main()
