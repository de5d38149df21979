"""Gears: y goes with x at half its speed, then so that both are at their places at a time; gear_out and a halt end it."""

from pathlib import Path

from axisbus import Machine, wait

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    x, y = cell["x"], cell["y"]
    wait(axis.enable() for axis in (x, y))
    wait(axis.home() for axis in (x, y))
    x.move_velocity(60.0).wait()
    y.gear_in(x, 0.5).wait()  # takes up its speed, then keeps to x
    print("in step:", round(x.velocity), "and", round(y.velocity), "deg/s")
    y.gear_out().wait()  # goes on with its speed, whatever x does
    wait(axis.halt() for axis in (x, y))
    wait(axis.move_absolute(0.0) for axis in (x, y))
    meeting = y.gear_in(x, -0.5, sync_positions=(60.0, 10.0), master_start_distance=40.0)
    x.move_absolute(90.0, velocity=60.0).wait()
    meeting.wait()
    cell.sleep(0.3)
    print("x at", round(x.position, 1), "and y at", round(y.position, 1), "deg")
    y.halt().wait()
