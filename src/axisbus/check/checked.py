"""A cell file that may be opened: read, and without any error that ``axisbus check`` would find."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.cell.problem import errors
from axisbus.check.run import check_cell


def checked(path: str | Path, beside: bool = False) -> CellConfig:
    """Return the cell of a file in which ``check`` finds no error; ``beside`` is as if the file said so. Blocks for its files.

    Raises:
        ConfigError: there is an error; the first is told, and the others listed.
    """
    cell, problems = reader.read(path)
    wrong = errors(problems if cell is None else check_cell(cell, problems))
    if cell is None or wrong:
        raise reader.as_exception(wrong)
    return replace(cell, bus=replace(cell.bus, beside=True)) if beside else cell
