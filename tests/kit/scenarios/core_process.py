"""A cell whose core has a process of its own, and its axes in motion for as long as a scenario takes."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.cell import SCALE, cell_file

OWN_PROCESS = pytest.mark.skipif(
    sys.platform != "linux", reason="a core in a process of its own is for Linux"
)


def own_cell(folder: Path, names: str = "xy", more: str = "", axis: str = "", period: str = "20ms") -> Path:
    """Write the file of a cell with an axis for each letter of ``names``, and return it; ``axis`` is said of each."""
    return cell_file(
        folder, names, period=period, heartbeat="1s", bus='process = "own"', more=more, axis=axis
    )


def enabled(axis: Axis) -> Axis:
    """Enable an axis of a machine that several tests share, whatever the one before has left it in, and return it."""
    if axis.state is AxisState.ERRORSTOP:
        axis.reset().wait(10)
    axis.enable().wait(20)
    return axis


def recover(file: Path, machine: Machine) -> None:
    """Reset the axes in ErrorStop of a machine without a program in control, by a program that joins it for that."""
    if any(axis.state is AxisState.ERRORSTOP for axis in machine):
        with Machine.attach(file, command=True) as joined:
            for axis in joined:
                if axis.state is AxisState.ERRORSTOP:
                    axis.reset().wait(10)


def under_way(axis: Axis) -> Handle:
    """A move that continues for longer than any scenario, to the other side; it turns already."""
    handle = axis.move_relative(1000.0 if axis.position < 0 else -1000.0, velocity=30.0)
    until = time.monotonic() + 10.0
    while abs(axis.velocity) < 29.0:
        assert time.monotonic() < until, axis
        time.sleep(0.01)
    return handle


def mean_speed(machine: Machine, node_id: int = 1, seconds: float = 1.0) -> float:
    """How fast the plant turns over some time, in deg/s; in csp a busy computer makes single periods longer or shorter."""
    begin, place = time.monotonic(), machine.simulated_node(node_id).drive().axis.motor.position
    time.sleep(seconds)
    there, end = machine.simulated_node(node_id).drive().axis.motor.position, time.monotonic()
    speed: float = (there - place) / SCALE / (end - begin)
    return speed


def turns(machine: Machine, node_id: int = 1) -> float:
    """How fast the plant turns, in deg/s."""
    velocity: float = machine.simulated_node(node_id).drive().axis.motor.velocity
    return velocity / SCALE
