"""A stream of points: the program pushes them at its own pace. It is late once, and the axes wait on the path."""

import math
import time
from pathlib import Path

from axisbus import Machine, wait


def place(t: float) -> tuple[float, float]:
    """Return the positions of x and y at ``t`` seconds: a figure of eight that starts from rest."""
    grown = 20.0 * min(t, 1.0) ** 2 * (3.0 - 2.0 * min(t, 1.0))
    return grown * math.sin(3.0 * t), grown * math.sin(6.0 * t)


with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    xy = cell.group("x", "y")
    xy.enable().wait()
    wait(axis.home() for axis in xy)
    with xy.stream(period="20ms", on_underrun="hold") as points:
        for number in range(150):
            points.push(place(number * 0.02))  # blocks while enough points are buffered
            if number == 100:
                print(f"the program is late; {points.buffered_seconds:.1f} s are buffered")
                time.sleep(1.0)
                print("the axes are at standstill on the path:", [round(axis.velocity) for axis in xy])
    print("at the last point:", [round(axis.position, 1) for axis in xy])
