"""Home an axis, and set its position to a value of your choice."""

from pathlib import Path

from axisbus import Machine
from axisbus.errors import ArgumentError

with Machine.open(Path(__file__).with_name("cell.toml")) as cell:
    x = cell["x"]
    x.enable().wait()
    try:
        x.move_absolute(10.0)
    except ArgumentError as error:  # x has position limits, so it must be homed first
        print(error)
    x.home().wait()  # the method of [axes.x.homing]
    print(f"homed: {x.homed}, at {x.position:.2f} {x.unit}")
    x.move_absolute(45.0).wait()
    x.set_position(0.0).wait()  # the master stores the offset
    print(f"set to zero: {x.position:.2f} {x.unit}")
    x.move_absolute(-10.0).wait()
    print(f"at {x.position:.2f} {x.unit}")
