"""Export a recording as a table, and read a CSV file back; CSV has units in its header, Parquet in its metadata."""

from __future__ import annotations

import csv
import json
import math
import re
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from axisbus.errors import UserError
from axisbus.record.columns import COLUMNS
from axisbus.record.recording_data import Recorded, RecordedSeries

_TEXTS = {column.name: column.text for column in COLUMNS}


class ExportColumn(NamedTuple):
    """One column of the table; None is unknown."""

    name: str
    unit: str
    text: str
    values: Sequence[Any]

    @property
    def head(self) -> str:
        """Its name with its unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def table(recorded: Recorded) -> list[ExportColumn]:
    """Return a recording as columns of equal length: ``time``, those of each axis, then the objects, each at its read times.

    Raises:
        UserError: the recording has no samples.
    """
    tracks = list(recorded.tracks.values())
    times = max((track.times for track in tracks), key=len, default=[])
    if not times:
        raise UserError("nothing was recorded, so there is no table")
    fields = [ExportColumn("time", "s", "since the recording began", times)]
    for track in tracks:
        fields += _of_axis(track, len(times))
    return fields + [_of_object(track, times) for track in recorded.objects.values()]


def write_csv(recorded: Recorded, path: Path) -> None:
    """Write the table, with a header such as ``x.position [deg]``; an empty field is an unknown value.

    Raises:
        UserError: as ``table``.
        OSError: the file cannot be written.
    """
    fields = table(recorded)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([field.head for field in fields])
        writer.writerows(zip(*(field.values for field in fields), strict=True))


def write_parquet(recorded: Recorded, path: Path) -> None:
    """Write the table; metadata has each column's ``unit`` and ``description``, and the facts and events as JSON.

    Raises:
        UserError: the package pyarrow is not installed; and as ``table``.
        OSError: the file cannot be written.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise UserError(
            "Parquet needs the package pyarrow, which is not installed",
            remedy='pip install "axisbus[record]"',
        ) from None
    fields = table(recorded)
    arrays = [pyarrow.array(field.values) for field in fields]
    columns = [
        pyarrow.field(field.name, values.type, metadata={"unit": field.unit, "description": field.text})
        for field, values in zip(fields, arrays, strict=True)
    ]
    events = json.dumps([event._asdict() for event in recorded.events])
    facts = {**recorded.facts, "events": events}
    parquet.write_table(pyarrow.table(arrays, schema=pyarrow.schema(columns, metadata=facts)), path)


def _of_axis(track: RecordedSeries, rows: int) -> Iterator[ExportColumn]:
    for name, values in track.columns.items():
        known = [None if _is_unknown(value) else value for value in values]
        yield ExportColumn(
            f"{track.name}.{name}",
            track.units[name],
            _TEXTS.get(name, ""),
            known + [None] * (rows - len(known)),
        )


def _of_object(track: RecordedSeries, times: Sequence[float]) -> ExportColumn:
    values: list[Any] = [None] * len(times)
    for time, value in zip(track.times, track.columns["value"], strict=True):
        values[min(bisect_left(times, time), len(times) - 1)] = value
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) > 1 and not kinds <= {int, float}:
        values = [None if value is None else str(value) for value in values]
    return ExportColumn(track.name, "", "read by SDO", values)


def _is_unknown(value: Any) -> bool:
    return isinstance(value, float) and math.isnan(value)


# -- read back -----------------------------------------------------------------------------------------------------------

CSV_HEAD = b"time [s],"
_WRITTEN_BY = "give a CSV file that axisbus record export or axisbus demo has written"
_HEAD_OF = re.compile(r"(?P<axis>.+)\.(?P<column>\w+)(?: \[(?P<unit>[^\]]*)\])?")


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


def read_csv(path: Path) -> Recorded:
    """Read a CSV recording; columns that belong to no axis (objects) are skipped. Blocks while reading.

    Raises:
        UserError: a line of the file is invalid.
        OSError: the file cannot be read.
    """
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        rows = csv.reader(file)
        heads = next(rows, [])
        taken = _taken(heads)
        if not taken:
            raise UserError(f"{path}:1: there is no column of an axis", remedy=_WRITTEN_BY)
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
                f"{path}:{rows.line_num}: this line is not a sample", observed=str(error), remedy=_WRITTEN_BY
            ) from None
    return Recorded({track.name: track for track in _tracks(times, columns, taken)})


_Taken = list[tuple[int, tuple[str, str], str]]  # index of a column, its axis and name, its unit


def _taken(heads: list[str]) -> _Taken:
    found: _Taken = []
    for number, head in enumerate(heads[1:], 1):
        match = _HEAD_OF.fullmatch(head)
        if match is not None and match["column"] in _COLUMNS:
            found.append((number, (match["axis"], match["column"]), match["unit"] or ""))
    axes = {axis for _, (axis, _), _ in found}
    whole = {axis for axis in axes if {name for _, (one, name), _ in found if one == axis} == set(_COLUMNS)}
    return [each for each in found if each[1][0] in whole]


def _tracks(
    times: list[float], columns: Mapping[tuple[str, str], list[Any]], taken: _Taken
) -> Iterator[RecordedSeries]:
    for axis in dict.fromkeys(axis for axis, _ in columns):
        values = {name: each for (one, name), each in columns.items() if one == axis}
        units = {name: unit for _, (one, name), unit in taken if one == axis}
        yield RecordedSeries(axis, times, values, units)
