"""Cells whose moves have a limit of jerk, and the differences of the commanded positions of their axes."""

from __future__ import annotations

from itertools import pairwise

from kit.campaign.cells.files import variant
from kit.cell import GENERIC, Cell, Stage, cell_text

PERIOD = 0.01
NEAR = 0.3  # degrees
WITHOUT_JERK = "without-jerk.eds"
JERK = 5000.0  # deg/s³


class Demand:
    """The demand of a drive (degrees), cycle by cycle."""

    def __init__(self, cell: Cell, name: str = "x") -> None:
        self.rows: list[list[float]] = [[]]
        drive, scale = cell.drive(name), cell.scale_of(name)
        cell.each_cycle(lambda *_: self.rows[-1].append(drive.axis.position / scale))

    def worst(self, order: int) -> float:
        """The highest difference of an order, per s: 2 is the acceleration, 3 the jerk."""
        return max(abs(value) for row in self.rows for value in differences(row, order))

    def forget(self) -> None:
        """Begin again."""
        self.rows = [[]]


class ComputedMotion(Demand):
    """Where the master controls an axis, as it was computed; each time that it begins again makes a row."""

    def __init__(self, cell: Cell, name: str = "x") -> None:
        self.rows = [[]]
        core = cell.core(name)

        def look(*_: object) -> None:
            path = None if core.active_path is None else core.active_path.commanding_path
            if path is not None and path.is_under_way:
                self.rows[-1].append(path.last_step.position)
            elif self.rows[-1]:
                self.rows.append([])

        cell.each_cycle(look)


def differences(row: list[float], order: int) -> list[float]:
    """Return the differences of an order of a row of places, per s."""
    for _ in range(order):
        row = [(b - a) / PERIOD for a, b in pairwise(row)]
    return row


def without_jerk(scenario: Stage) -> str:
    """Write the EDS of a drive without a profile jerk (60A4h), so that the master limits the jerk; return its name."""
    text = variant((0x60A4,), (), 0, None)
    (scenario.folder / WITHOUT_JERK).write_text(text, encoding="utf-8")
    return WITHOUT_JERK


def soft(scenario: Stage, eds: str = GENERIC, **changes: str) -> Cell:
    """A cell of one axis whose moves have a limit of jerk by default, enabled."""
    without_jerk(scenario)
    text = cell_text("x", eds=eds, **changes).replace(
        "acceleration = 500.0\n", f"acceleration = 500.0\njerk = {JERK}\n", 1
    )
    return scenario.simulated(text=text).enabled()
