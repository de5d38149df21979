"""Draws the pictures of docs/motion.md from simulated drives, in virtual time. ``make pictures``."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from axisbus import Machine, wait
from axisbus.machine.groups import Group
from axisbus.motion.snapshot import Snapshot

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "pictures"
SQUARE = [(60.0, 0.0), (60.0, 40.0), (0.0, 40.0), (0.0, 0.0)]
COLOURS = ("#1f5fa8", "#c2571a", "#3b8a3e")


class Trace:
    """Where two axes were, cycle by cycle: seconds from the beginning, and places in their units."""

    def __init__(self, cell: Machine, group: Group) -> None:
        self.times: list[float] = []
        self.places: list[tuple[float, float]] = []
        self._axes = list(group)
        self._factors = [axis.axis_factor if hasattr(axis, "axis_factor") else None for axis in self._axes]
        self._cell = cell
        cell.session.observe(self._note)

    def _note(self, now: float, _snapshots: Mapping[str, Snapshot]) -> None:
        x, y = (axis.position for axis in self._axes)
        self.times.append(now)
        self.places.append((x, y))

    def end(self) -> None:
        self._cell.session.forget(self._note)
        self.times = [time - self.times[0] for time in self.times]

    @property
    def speeds(self) -> list[float]:
        """Along the path, over five cycles."""
        rows = list(zip(self.times, self.places, strict=True))
        found = [math.dist(a[1], b[1]) / (b[0] - a[0]) for a, b in zip(rows, rows[5:], strict=False)]
        return [0.0] * 5 + found


def traced(what: Callable[[Machine, Group], None]) -> Trace:
    """Return what two simulated axes do."""
    with Machine.simulated(ROOT / "examples" / "cell.toml") as cell:
        group = cell.group("x", "y")
        group.enable().wait()
        wait(axis.home() for axis in group)
        trace = Trace(cell, group)
        what(cell, group)
        trace.end()
    return trace
