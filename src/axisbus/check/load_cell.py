"""Read a cell file and refuse it if ``axisbus check`` would find an error."""

from __future__ import annotations

from pathlib import Path

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.cell.problem import CellProblem, errors
from axisbus.check.run import check_cell


def checked(path: str | Path, beside: bool = False) -> CellConfig:
    """Return the cell of a file in which ``check`` finds no error; ``beside``: as if the file said so. Blocks for its files.

    Raises:
        ConfigError: there is an error; it contains the first error, and lists the others.
    """
    cell, problems = reader.read(path)
    if cell is None:
        raise reader.as_exception(errors(problems))
    require_sound(cell, problems)
    return cell.beside(beside)


def require_sound(cell: CellConfig, problems: list[CellProblem]) -> None:
    """Raise ``ConfigError`` as ``checked`` does; ``problems`` come from reading the cell. Blocks for its files."""
    if wrong := errors(check_cell(cell, problems)):
        raise reader.as_exception(wrong)
