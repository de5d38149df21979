"""Gears: y follows x at half its speed, then meets x at a given pair of positions. gear_out or a halt ends a gear."""

from pathlib import Path

from axisbus import Machine, wait

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    x, y = cell["x"], cell["y"]
    wait(axis.enable() for axis in (x, y))
    wait(axis.home() for axis in (x, y))
    x.move_velocity(60.0).wait()
    y.gear_in(x, 0.5).wait()  # accelerates to half the speed of x, then follows the position of x
    print("in step:", round(x.velocity), "and", round(y.velocity), "deg/s")
    y.gear_out().wait()  # keeps its speed, independent of x
    wait(axis.halt() for axis in (x, y))
    wait(axis.move_absolute(0.0) for axis in (x, y))
    meeting = y.gear_in(x, -0.5, sync_positions=(60.0, 10.0), master_start_distance=40.0)
    x.move_absolute(90.0, velocity=60.0).wait()
    meeting.wait()
    cell.sleep(0.3)
    print("x at", round(x.position, 1), "and y at", round(y.position, 1), "deg")
    y.halt().wait()
