"""A cam: per turn of x, y moves out and back twice. y engages within the first 36 degrees of x, and is halted at the end."""

from pathlib import Path

from axisbus import Cam, Machine, wait

LOBES = Cam([(0.0, 0.0), (90.0, 20.0), (180.0, 0.0), (270.0, 20.0), (360.0, 0.0)], periodic=True)

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    x, y = cell["x"], cell["y"]
    wait(axis.enable() for axis in (x, y))
    wait(axis.home() for axis in (x, y))
    y.move_absolute(5.0).wait()
    into = y.cam_in(x, LOBES, master_start_distance=36.0)
    turn = x.follow([(0.0, x.position), (1.5, 90.0), (2.5, 180.0)])
    into.wait()
    print("in step, with x at", round(x.position), "deg")
    turn.wait()
    cell.sleep(0.3)
    print("x at", round(x.position, 1), "and y at", round(y.position, 1), "deg")
    y.halt().wait()
