"""Superimpose a distance of y on a line of x and y. The line continues, and its end is displaced by that distance."""

from pathlib import Path

from axisbus import Machine, wait

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    xy = cell.group("x", "y")
    xy.enable().wait()
    wait(axis.home() for axis in xy)
    line = xy.move_linear((60.0, 30.0), velocity=40.0)
    cell.sleep(0.3)
    cell["y"].move_superimposed(5.0, velocity=15.0, acceleration=100.0).wait()
    print("superimposed:", "the line is still active" if line.busy else "the line is done")
    line.wait()
    print("at the end:", [round(axis.position, 1) for axis in xy])
