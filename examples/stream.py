"""A stream of points: the program gives them at its own pace, is late once, and the axes wait for it on their way."""

import math
import time
from pathlib import Path

from axisbus import Machine, wait


def place(t: float) -> tuple[float, float]:
    """Where x and y are to be at a time: an eight, begun from rest."""
    grown = 20.0 * min(t, 1.0) ** 2 * (3.0 - 2.0 * min(t, 1.0))
    return grown * math.sin(3.0 * t), grown * math.sin(6.0 * t)


with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    xy = cell.group("x", "y")
    xy.enable().wait()
    wait(axis.home() for axis in xy)
    with xy.stream(period="20ms", on_underrun="hold") as points:
        for number in range(150):
            points.push(place(number * 0.02))  # blocks while enough is ahead of the axes
            if number == 100:
                print(f"busy with something else, {points.buffered_seconds:.1f} s are buffered")
                time.sleep(1.0)
                print("the axes are at standstill on the path:", [round(axis.velocity) for axis in xy])
    print("at the last point:", [round(axis.position, 1) for axis in xy])
