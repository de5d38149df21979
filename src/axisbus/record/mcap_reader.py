"""An MCAP file of ours read back, also one that ends in the midst of a write."""

from __future__ import annotations

import json
import math
import struct
from array import array
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from axisbus.errors import UserError
from axisbus.record.mcap_writer import library
from axisbus.record.recorded import Happening, Recorded, Track

_NANO = 1e9
_NAN = math.nan
Progress = Callable[[float], None]


def load(path: Path | str, progress: Progress | None = None) -> Recorded:
    """Read a recording; blocks for some seconds for each hour of it. ``progress`` is told which part of it is done (0 to 1).

    A file that is not whole is read as far as it goes; ``lacks`` says so.

    Raises:
        UserError: the package mcap is not installed, the file cannot be read, or it is no recording of axisbus.
    """
    library()
    path = Path(path)
    loading = _Loading(path)
    try:
        with path.open("rb") as file:
            size = max(1, path.stat().st_size)
            for number, record in enumerate(loading.records(file, size)):
                loading.take(record)
                if progress is not None and number % 10_000 == 0:
                    progress(file.tell() / size)
    except OSError as error:
        raise UserError(f"{path} cannot be read", observed=str(error.strerror)) from error
    return loading.recorded()


class _Channel(NamedTuple):
    sort: str  # axis, object or events
    name: str
    times: array[float]
    columns: dict[str, Any]
    units: dict[str, str]


class _Loading:
    """Holds what has been read so far."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._schemas: dict[int, dict[str, Any]] = {}
        self._channels: dict[int, _Channel] = {}
        self._events: list[Happening] = []
        self._facts: dict[str, str] = {}
        self._begin = 0
        self._same: dict[Any, Any] = {}  # equal texts and words are one object
        self._decode = msgspec.json.Decoder().decode
        self._lacks = ""

    def records(self, file: Any, size: int) -> Iterator[Any]:
        """Yield the records of the data section, as far as they can be read."""
        from mcap import exceptions, records, stream_reader

        broken: tuple[type[Exception], ...] = (
            exceptions.McapError,
            struct.error,
            ValueError,
            EOFError,
            *_of_decompression(),
        )
        try:
            found = stream_reader.StreamReader(file, record_size_limit=size, validate_crcs=True).records
            yield from takewhile(lambda record: not isinstance(record, records.DataEnd), found)
        except exceptions.InvalidMagic as error:
            raise UserError(f"{self._path} is no MCAP file") from error
        except broken:
            self._lacks = "it ends in the midst of a write: what was recorded last is missing"

    def take(self, record: Any) -> None:
        """Take one record."""
        take = _TAKES.get(type(record).__name__)
        if take is not None:
            take(self, record)

    def recorded(self) -> Recorded:
        """Return all of it.

        Raises:
            UserError: it is none of ours.
        """
        if not self._begin:
            raise UserError(
                f"{self._path} is no recording of axisbus",
                observed="it has no metadata of that name" + (f"; {self._lacks}" if self._lacks else ""),
                remedy="make one: axisbus record CELL -o run.mcap",
            )
        return Recorded(
            self._tracks("axis"),
            {name: track for name, track in self._tracks("object").items() if track.times},
            sorted(self._events),
            datetime.fromtimestamp(int(self._facts["began_ns"]) / _NANO, UTC),
            self._facts,
            self._lacks,
        )

    def _tracks(self, sort: str) -> dict[str, Track]:
        found = [channel for channel in self._channels.values() if channel.sort == sort]
        return {one.name: Track(one.name, one.times, one.columns, one.units) for one in found}

    def _schema(self, record: Any) -> None:
        self._schemas[record.id] = json.loads(record.data)

    def _metadata(self, record: Any) -> None:
        if record.name == "axisbus":
            self._facts = dict(record.metadata)
            self._begin = int(self._facts["began_monotonic_ns"])

    def _channel(self, record: Any) -> None:
        sort, _, name = record.topic.partition("/")
        about = self._schemas.get(record.schema_id, {}).get("properties", {})
        packed = sort == "axis"  # the values of an object keep their types
        columns: dict[str, Any] = {
            key: array("d") if packed and _is_number(each) else [] for key, each in about.items()
        }
        units = {key: each.get("unit", "") for key, each in about.items()}
        self._channels.setdefault(record.id, _Channel(sort, name, array("d"), columns, units))

    def _message(self, record: Any) -> None:
        channel = self._channels.get(record.channel_id)
        if channel is None:
            return
        values = self._decode(record.data)
        time = (record.publish_time - self._begin) / _NANO
        if channel.sort == "events":
            self._events.append(Happening(time, channel.name, values["where"], values["text"]))
            return
        channel.times.append(time)
        for key, column in channel.columns.items():
            value = values.get(key)
            if isinstance(column, array):
                column.append(_NAN if value is None else value)
            else:
                column.append(self._same.setdefault(value, value))


_TAKES: dict[str, Callable[[_Loading, Any], None]] = {
    "Schema": _Loading._schema,
    "Metadata": _Loading._metadata,
    "Channel": _Loading._channel,
    "Message": _Loading._message,
}


def _is_number(about: dict[str, Any]) -> bool:
    return "number" in about.get("type", ())  # by itself, or in a list of older files


def _of_decompression() -> list[type[Exception]]:
    import zstandard

    return [zstandard.ZstdError]
