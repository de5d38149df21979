"""A recording read back from CSV as ``export`` and the demo write it: heads such as ``x.position [deg]``, one row each cycle."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from axisbus.errors import UserError
from axisbus.record.columns import COLUMNS
from axisbus.record.recorded import Recorded, Track

HEAD = b"time [s],"
WRITTEN_BY = "give a CSV file that axisbus record export or axisbus demo has written"
_HEAD = re.compile(r"(?P<axis>.+)\.(?P<column>\w+)(?: \[(?P<unit>[^\]]*)\])?")


def _number(text: str) -> float:
    return float(text) if text else math.nan


def _truth(text: str) -> bool | None:
    return {"True": True, "False": False, "": None}[text]


_READ: Mapping[str, Callable[[str], Any]] = {
    "number": _number,
    "integer": lambda text: int(text) if text else None,
    "boolean": _truth,
    "string": lambda text: text or None,
}
_COLUMNS = {column.name: _READ[column.type] for column in COLUMNS}


def load(path: Path) -> Recorded:
    """Read a CSV recording; columns that are none of an axis (objects that were read) are left out. Blocks for its file.

    Raises:
        UserError: a line of it is not as it was written. OSError: it cannot be read.
    """
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        rows = csv.reader(file)
        heads = next(rows, [])
        taken = _taken(heads)
        if not taken:
            raise UserError(f"{path}:1: there is no column of an axis", remedy=WRITTEN_BY)
        times: list[float] = []
        columns: dict[tuple[str, str], list[Any]] = {key: [] for _, key, _ in taken}
        try:
            for row in rows:
                if len(row) != len(heads):
                    raise ValueError(f"{len(row)} fields instead of {len(heads)}")
                times.append(float(row[0]))
                for number, key, _ in taken:
                    columns[key].append(_COLUMNS[key[1]](row[number]))
        except (ValueError, KeyError, csv.Error) as error:
            raise UserError(
                f"{path}:{rows.line_num}: this line is no sample", observed=str(error), remedy=WRITTEN_BY
            ) from None
    return Recorded({track.name: track for track in _tracks(times, columns, taken)})


_Taken = list[tuple[int, tuple[str, str], str]]  # the number of a column, its axis and name, its unit


def _taken(heads: list[str]) -> _Taken:
    found: _Taken = []
    for number, head in enumerate(heads[1:], 1):
        match = _HEAD.fullmatch(head)
        if match is not None and match["column"] in _COLUMNS:
            found.append((number, (match["axis"], match["column"]), match["unit"] or ""))
    axes = {axis for _, (axis, _), _ in found}
    whole = {axis for axis in axes if {name for _, (one, name), _ in found if one == axis} == set(_COLUMNS)}
    return [each for each in found if each[1][0] in whole]


def _tracks(
    times: list[float], columns: Mapping[tuple[str, str], list[Any]], taken: _Taken
) -> Iterator[Track]:
    for axis in dict.fromkeys(axis for axis, _ in columns):
        values = {name: each for (one, name), each in columns.items() if one == axis}
        units = {name: unit for _, (one, name), unit in taken if one == axis}
        yield Track(axis, times, values, units)
