"""A group of axes: enable it in one SYNC, move it on a straight line or axis by axis, halt it on the line, resume it."""

from pathlib import Path

from axisbus import Machine, wait
from axisbus.errors import Stopped

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    xyz = cell.group("xyz")  # its name in cell.toml; or name the axes: cell.group("x", "z")
    xyz.enable().wait()
    wait(axis.home() for axis in xyz)
    xyz.move_linear((60.0, -30.0, 90.0), velocity=150.0).wait()
    print("straight line:", [round(axis.position, 2) for axis in xyz])
    xyz.move_direct((0.0, 0.0, 0.0)).wait()
    print("each axis with its own profile:", [round(axis.position, 2) for axis in xyz])
    line = xyz.move_linear((60.0, 60.0, 60.0), velocity=60.0)
    cell.sleep(0.5)
    xyz.halt().wait()  # brakes along the line
    print("halted:", [round(axis.position, 2) for axis in xyz])
    try:
        line.wait()
    except Stopped as stopped:
        print(stopped)
    xyz.resume().wait()  # continues to the same end
    print("resumed:", [round(axis.position, 2) for axis in xyz])
