"""Run all checks of a cell, before the first frame is sent."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.cell.parameters import axis_parameters
from axisbus.cell.problem import CellProblem
from axisbus.check import (
    bootup,
    cobids,
    devices,
    firmware,
    limits,
    missing,
    modes,
    monitoring_windows,
    objects,
    pdos,
    ranges,
    scales,
    services,
    stopping,
    structure,
    watchdog,
)
from axisbus.check import cycle_bus_load as load
from axisbus.check.can_simple import axes, modules
from axisbus.check.context import Check, CheckContext
from axisbus.check.cyclic import feed_forward, interpolated
from axisbus.check.gantry import pairs
from axisbus.check.ids.table import id_of
from axisbus.check.io import points
from axisbus.motion.stop.promises import Promise, promises

CHECKS: tuple[Check, ...] = (
    *structure.CHECKS,
    *modules.CHECKS,
    *axes.CHECKS,
    *devices.CHECKS,
    *objects.CHECKS,
    *cobids.CHECKS,
    *services.CHECKS,
    *pdos.CHECKS,
    *points.CHECKS,
    *pairs.CHECKS,
    *modes.CHECKS,
    *limits.CHECKS,
    *feed_forward.CHECKS,
    *interpolated.CHECKS,
    *ranges.CHECKS,
    *scales.CHECKS,
    *stopping.CHECKS,
    *watchdog.CHECKS,
    *monitoring_windows.CHECKS,
    *bootup.CHECKS,
    *firmware.CHECKS,
    *missing.CHECKS,
    *load.CHECKS,
)


def check(path: str | Path) -> list[CellProblem]:
    """Return all errors, dangers and notes of a cell file, in the order of its lines.

    Blocks for as long as its files take to read; sends nothing. Raises nothing: an unreadable file is a problem, too.
    """
    cell, problems = reader.read(path)
    return problems if cell is None else check_cell(cell, problems)


def promised(path: str | Path) -> dict[str, tuple[Promise, ...]]:
    """Return how the limits of each axis with a drive are kept, by its EDS; after boot, use ``Axis.promises``.

    Blocks for its files. Raises ``ConfigError`` if the cell file cannot be read.
    """
    cell = reader.load(path)
    drives = CheckContext(cell, devices.load_all(cell)[0]).drives
    return {drive.axis.name: promises(axis_parameters(cell, drive.axis.name, drive.eds)) for drive in drives}


def check_cell(cell: CellConfig, problems: list[CellProblem] | None = None) -> list[CellProblem]:
    """Return the same as ``check``, for a cell that is already read; ``problems`` come from reading it."""
    eds, unreadable = devices.load_all(cell)
    case = CheckContext(cell, eds)
    found = [*(problems or ()), *unreadable]
    for one in CHECKS:
        rule = id_of(one)
        found += (replace(problem, rule=problem.rule or rule) for problem in one(case))
    return sorted(dict.fromkeys(found), key=lambda problem: problem.rank)
