"""Run all checks of a cell, before the first frame is sent."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import parts_for
from axisbus.cell.parameters import axis_parameters
from axisbus.cell.problem import CellProblem, errors
from axisbus.check import (
    bootup,
    cobids,
    cyclic_modes,
    devices,
    gantry,
    io,
    limits,
    modes,
    objects,
    pdos,
    ranges,
    services,
    stopping,
    structure,
)
from axisbus.check import cycle_schedule as load
from axisbus.check.context import Check, CheckContext
from axisbus.check.ids.table import id_of
from axisbus.motion.stop.promises import Promise, promises
from axisbus.toml.problem import as_exception

PACKAGE = "check"
_CHECKS: tuple[Check, ...] = (
    *devices.CHECKS,
    *objects.CHECKS,
    *cobids.CHECKS,
    *services.CHECKS,
    *pdos.CHECKS,
    *io.CHECKS,
    *gantry.CHECKS,
    *modes.CHECKS,
    *limits.CHECKS,
    *cyclic_modes.CHECKS,
    *cyclic_modes.INTERPOLATED_CHECKS,
    *ranges.CHECKS,
    *ranges.SCALE_CHECKS,
    *stopping.CHECKS,
    *stopping.WATCHDOG_CHECKS,
    *limits.WINDOW_CHECKS,
    *bootup.CHECKS,
    *bootup.PROGRAM_CHECKS,
    *structure.MISSING_KEY_CHECKS,
    *load.CHECKS,
)


def all_checks(parts: Iterable[Sequence[Check]]) -> tuple[Check, ...]:
    """Return the checks of a cell, with those of drive plug-ins (the ``parts`` of their ``Extension``)."""
    return (*structure.CHECKS, *(one for checks in parts for one in checks), *_CHECKS)


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
    for one in all_checks(parts_for(cell, PACKAGE)):
        rule = id_of(one)
        found += (replace(problem, rule=problem.rule or rule) for problem in one(case))
    return sorted(dict.fromkeys(found), key=lambda problem: problem.rank)


# -- Read a cell file and refuse it if ``axisbus check`` would find an error -------------------------------------------


def checked(path: str | Path, beside: bool = False) -> CellConfig:
    """Return the cell of a file in which ``check`` finds no error; ``beside``: as if the file said so. Blocks for its files.

    Raises:
        ConfigError: there is an error; it contains the first error, and lists the others.
    """
    cell, problems = reader.read(path)
    if cell is None:
        raise as_exception(errors(problems))
    require_no_errors(cell, problems)
    return cell.beside(beside)


def require_no_errors(cell: CellConfig, problems: list[CellProblem]) -> None:
    """Raise ``ConfigError`` as ``checked`` does; ``problems`` come from reading the cell. Blocks for its files."""
    if wrong := errors(check_cell(cell, problems)):
        raise as_exception(wrong)
