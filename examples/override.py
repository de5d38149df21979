"""Change the override on a path: slower, faster, 0. Then halt on the path, and resume to the same end."""

from pathlib import Path

from axisbus import Machine, wait

SQUARE = [(60.0, 0.0), (60.0, 40.0), (0.0, 40.0), (0.0, 0.0)]

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    xy = cell.group("x", "y")
    xy.enable().wait()
    wait(axis.home() for axis in xy)
    path = xy.move_path(SQUARE, velocity=100.0, blend=3.0)
    for factor in (1.0, 0.3, 1.5, 0.0, 1.0):
        xy.set_override(factor)
        cell.sleep(0.3)
        print(f"override {factor:g}:", [round(axis.velocity) for axis in xy], "deg/s")
    xy.halt().wait()  # brakes along the path
    print("halted:", path.status.value)
    xy.resume().wait()
    print("at the end:", [round(axis.position, 1) for axis in xy])
