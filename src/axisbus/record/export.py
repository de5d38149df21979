"""A recording as a table for other programs: CSV with units in the heads of its columns, Parquet with them in its metadata."""

from __future__ import annotations

import csv
import json
import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from axisbus.errors import UserError
from axisbus.record.columns import COLUMNS
from axisbus.record.recorded import Recorded, Track

_TEXTS = {column.name: column.text for column in COLUMNS}


class Field(NamedTuple):
    """One column of the table; None is unknown."""

    name: str
    unit: str
    text: str
    values: Sequence[Any]

    @property
    def head(self) -> str:
        """Its name with its unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def table(recorded: Recorded) -> list[Field]:
    """Return a recording as columns of one length: ``time``, then those of each axis, then the objects, each where it was read.

    Raises:
        UserError: it has no samples.
    """
    tracks = list(recorded.tracks.values())
    times = max((track.times for track in tracks), key=len, default=[])
    if not times:
        raise UserError("nothing was recorded, so there is no table")
    fields = [Field("time", "s", "since the recording began", times)]
    for track in tracks:
        fields += _of_axis(track, len(times))
    return fields + [_of_object(track, times) for track in recorded.objects.values()]


def write_csv(recorded: Recorded, path: Path) -> None:
    """Write the table, with a line of heads such as ``x.position [deg]``; an empty field is an unknown value.

    Raises:
        OSError: it cannot be written; and as ``table``.
    """
    fields = table(recorded)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([field.head for field in fields])
        writer.writerows(zip(*(field.values for field in fields), strict=True))


def write_parquet(recorded: Recorded, path: Path) -> None:
    """Write the table; each column's metadata has its ``unit`` and ``description``, the table's the facts and the events, as JSON.

    Raises:
        UserError: the package pyarrow is not installed; and as ``table``.
        OSError: it cannot be written.
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


def _of_axis(track: Track, rows: int) -> Iterator[Field]:
    for name, values in track.columns.items():
        known = [None if _is_unknown(value) else value for value in values]
        yield Field(
            f"{track.name}.{name}",
            track.units[name],
            _TEXTS.get(name, ""),
            known + [None] * (rows - len(known)),
        )


def _of_object(track: Track, times: Sequence[float]) -> Field:
    values: list[Any] = [None] * len(times)
    for time, value in zip(track.times, track.columns["value"], strict=True):
        values[min(bisect_left(times, time), len(times) - 1)] = value
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) > 1 and not kinds <= {int, float}:
        values = [None if value is None else str(value) for value in values]
    return Field(track.name, "", "read by SDO", values)


def _is_unknown(value: Any) -> bool:
    return isinstance(value, float) and math.isnan(value)
