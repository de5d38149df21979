"""Homing, and calling a position what you like."""

from pathlib import Path

from axisbus import Machine
from axisbus.errors import ArgumentError

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    x = cell["x"]
    x.enable().wait()
    try:
        x.move_absolute(10.0)
    except ArgumentError as error:  # x has position limits, so it wants to be homed first
        print(error)
    x.home().wait()  # the method of [axes.x.homing]
    print(f"homed: {x.homed}, at {x.position:.2f} {x.unit}")
    x.move_absolute(45.0).wait()
    x.set_position(0.0).wait()  # the master keeps the difference
    print(f"called zero: {x.position:.2f} {x.unit}")
    x.move_absolute(-10.0).wait()
    print(f"at {x.position:.2f} {x.unit}")
