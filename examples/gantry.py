"""A gantry pair: two axes carry one beam. Home it by a switch on each side, square it, and move it as one axis."""

from pathlib import Path

from axisbus import Machine
from axisbus.errors import StateError

with Machine.open(Path(__file__).with_name("gantry.toml")) as cell:
    # Only in simulation: the switches, and a beam that is 1.5 mm out of square (in increments of the motors).
    cell.simulated_node(1).drive().touch_probe.put_mark(1, -200_000, -20_000)
    cell.simulated_node(2).drive().touch_probe.put_mark(1, -200_000, -21_000)

    y = cell.gantry("y")
    y.enable().wait()
    y.home().wait()
    print(f"homed: the beam is at {y.position:.2f} {y.unit}, {abs(y.skew):.2f} {y.unit} out of square")

    y.move_absolute(80.0).wait()
    move = y.move_absolute(10.0)
    cell.sleep(0.3)
    y.halt().wait()
    print(f"halted: {[round(axis.position) for axis in y]}")
    y.resume().wait()
    print(f"resumed: {[round(axis.position) for axis in y]}")

    try:
        cell["y2"].move_relative(1.0).wait()
    except StateError as error:
        print(error.message)
