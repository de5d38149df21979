"""Cells with a pair ``b`` of the axes x and y, tied by a beam or not, and with switches by which it is homed."""

from __future__ import annotations

import math

from axisbus.machine.gantry import Gantry
from axisbus.machine.machine import Machine
from kit.cell import Cell, Stage, cell_text
from kit.gantry.beam import tied
from kit.gantry.pair import HOMING, MAX_SKEW
from kit.plants import Plant, devices

NAME, AXES = "b", "xy"
SWITCHES = {"x": -40.0, "y": -37.0}  # deg: each is high from there downwards
# deg: how much farther the motor of y is than that of x, less the offset, by SWITCHES and HOMING
SQUARE_AT_SWITCHES = 1.0
STIFF = 0.5  # ‰ of rated torque per increment: the usual beam
_LIMITS = "position_limits = [-300.0, 300.0]"


class PairCell(Cell):
    """A cell with the pair; ``pushes``: an external force on the motor of each side, ‰ of rated torque upwards.

    ``pulled``: when (by the plant's clock) each motor was pulled last with more than its friction, by these forces or by the beam.
    """

    def __init__(self, machine: Machine, stiff: float) -> None:
        super().__init__(machine)
        self.pushes = dict.fromkeys(AXES, 0.0)
        self.pulled = dict.fromkeys(AXES, -math.inf)
        tied(self.device("x"), self.device("y"), stiff, 0.02 * stiff)
        self.device("y").step_hooks.append(self._push)

    @property
    def gantry(self) -> Gantry:
        """The pair."""
        return self.machine.gantry(NAME)

    def _push(self) -> None:
        for name, force in self.pushes.items():
            motor = self.drive(name).axis.motor
            motor.pull -= force
            if abs(motor.pull) > motor.params.friction:
                self.pulled[name] = self.drive(name).time


def open_pair(
    stage: Stage,
    plant: Plant,
    *,
    names: str = AXES,
    stiff: float = STIFF,
    offset: float = 0.0,
    homes: bool = False,
    bus: str = "",
) -> PairCell:
    """Open the cell with all axes enabled at their positions; ``homes``: the pair must be homed before its position is known.

    ``bus``: lines of its table.
    """
    axis = f"rated_torque = 10.0\nstandstill_window = {plant.window}\nmax_acceleration = 1000.0\n{_LIMITS}"
    table = f'[gantries.{NAME}]\naxes = ["x", "y"]\nmax_skew = {MAX_SKEW}\noffset = {offset}\n{HOMING}'
    text = cell_text(names, axis=axis, more=table, bus=bus)
    for name in AXES if homes else "":
        text = _required(text, name)
    opened = stage.simulated(names, text=text, devices=devices(plant, names, stage.folder))
    cell = PairCell(opened.machine, stiff)
    for name in names:
        cell.device(name).write(0x6065, 0, 0xFFFF_FFFF)  # a drive that pushes on, as many do
    for name, at in SWITCHES.items():
        scale = cell.scale_of(name)
        cell.drive(name).touch_probe.put_mark(1, (at - 300.0) * scale, at * scale)
    cell.gantry.enable().wait(5)
    for name in names.replace("x", "").replace("y", ""):
        cell[name].enable().wait(5)
    cell.run(0.5)
    return cell


def _required(text: str, name: str) -> str:
    head, table, tail = text.partition(f"[axes.{name}.homing]")
    return head + table + tail.replace("required = false", "required = true", 1)
