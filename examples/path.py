"""Axes on a path: lines with rounded corners, a circle, slower and faster on the way, a halt, and on from there."""

from pathlib import Path

from axisbus import Machine, wait

SQUARE = [(60.0, 0.0), (60.0, 40.0), (0.0, 40.0), (0.0, 0.0)]

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    xy = cell.group("x", "y")
    xy.enable().wait()
    wait(axis.home() for axis in xy)
    xy.move_path(SQUARE, velocity=120.0, blend=3.0).wait()
    print("round the corners:", [round(axis.position, 1) for axis in xy])
    xy.move_circular((0.0, 0.0), centre=(30.0, 0.0), velocity=120.0).wait()
    print("once round:", [round(axis.position, 1) for axis in xy])

    path = xy.move_path(SQUARE, velocity=120.0, blend=3.0)
    for factor in (0.3, 1.5, 1.0):
        xy.set_override(factor)
        cell.sleep(0.3)
    xy.halt().wait()  # brakes along the path
    print("halted:", path.status.value)
    xy.resume().wait()  # goes on from there, to the same end
    print("there:", [round(axis.position, 1) for axis in xy])
