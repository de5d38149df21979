"""Read an MCAP file of axisbus, even one that ends in the middle of a write; any other file is refused.

Theory of operation
-------------------
The reader trusts none of the file's own statements. A length is never longer than the rest of the file, a chunk is decompressed no
further than its stated size, and each value must have the type in the schema of its channel. Everything that is read is charged to
one budget, which is proportional to the size of the file, so that the file's size bounds memory and time. A recording of axisbus
needs about a twentieth of its budget.
"""

from __future__ import annotations

import io
import math
import struct
import zlib
from array import array
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import msgspec

from axisbus.errors import UserError
from axisbus.record.columns import COLUMNS
from axisbus.record.mcap_writer import library
from axisbus.record.recording_data import Recorded, RecordedEvent, RecordedSeries
from axisbus.wording import counted

WRITTEN_BY = "give the path of a recording: axisbus record CELL -o run.mcap writes one"
Progress = Callable[[float], None]
_NANO = 1e9
_NAN = math.nan
_TIMES = 1 << 64  # ns: a time of MCAP has 64 bits
_INTEGERS = 1 << 64  # the largest integers of CiA 301 have 64 bits
_MAGIC_SIZE = 8
_WINDOW = 8 << 20  # octets, the window of a decompressor

# The budget in octets: a multiple of the file's size, plus a constant.
_BUDGET_RATIO = 512
_BUDGET_BESIDE = 16 << 20
_MOST_COLUMNS = 256
# Charges in addition to the octets themselves.
_PER_MESSAGE = 200
_PER_NUMBER = 8
_PER_VALUE = 64
_PER_COLUMN = 500  # of a schema, and of a channel

_ANY = str | bool | int | float | None
_TYPES: Mapping[str, Any] = {
    "number": float | None,
    "string": str | None,
    "boolean": bool | None,
    "integer": int | None,
}
# The values that each channel of a sort must have, because every consumer of a recording relies on them.
_NEEDED: Mapping[str, Mapping[str, str]] = {
    "axis": {
        column.name: column.type for column in COLUMNS if column.type == "number" or column.name == "state"
    },
    "object": {"value": ""},
    "events": {},
}


class _Event(msgspec.Struct):
    where: str
    text: str


class _Property(msgspec.Struct):
    type: str | list[str] = ""  # older files have a list
    unit: str = ""

    @property
    def kind(self) -> str:
        """The type of its values, empty if there are several."""
        kinds = {self.type} if isinstance(self.type, str) else {*self.type} - {"null"}
        return kinds.pop() if len(kinds) == 1 else ""


class _Schema(msgspec.Struct):
    properties: dict[str, _Property] = {}


class _Channel(NamedTuple):
    sort: str  # axis, object or events
    name: str
    times: array[float]
    columns: dict[str, Any]
    units: dict[str, str]
    decode: Callable[[bytes], Any]
    cost: int  # per message, in addition to its octets

    @property
    def topic(self) -> str:
        return f"{self.sort}/{self.name}"


class _Damaged(ValueError):
    """A chunk contradicts its own statements."""


class _Readable(Protocol):
    def read(self, size: int) -> bytes: ...


def load(path: Path | str, progress: Progress | None = None) -> Recorded:
    """Read a recording; blocks for some seconds per hour of recording. ``progress`` gets the fraction done (0 to 1).

    An incomplete file is read as far as possible; ``lacks`` then has the reason. The file's size bounds memory and time.

    Raises:
        UserError: the package mcap is not installed, the file cannot be read, or it is not a recording of axisbus.
    """
    library()
    path = Path(path)
    try:
        with path.open("rb") as file:
            size = max(1, path.stat().st_size)
            loading = _Loading(path, size)
            for number, record in enumerate(loading.records(file)):
                loading.take(record)
                if progress is not None and number % 10_000 == 0:
                    progress(file.tell() / size)
    except OSError as error:
        raise UserError(f"{path} cannot be read", observed=str(error.strerror), remedy=WRITTEN_BY) from error
    return loading.recorded()


class _Loading:
    """Hold the data read so far."""

    def __init__(self, path: Path, size: int) -> None:
        self._path = path
        self._size = size
        self._left = _BUDGET_RATIO * size + _BUDGET_BESIDE  # octets left of the budget
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, _Channel] = {}
        self._events: list[RecordedEvent] = []
        self._facts: dict[str, str] = {}
        self._begin = 0  # ns, monotonic
        self._began: datetime | None = None
        # Equal texts and words are one object; by type, as True equals 1.
        self._same: dict[type, dict[Any, Any]] = defaultdict(dict)
        self._taken = 0  # messages
        self._lacks = ""

    # -- from octets to records ----------------------------------------------------------------------------------------

    def records(self, file: Any) -> Iterator[Any]:
        """Yield the records of the data section, as far as they can be read."""
        from mcap import exceptions, records, stream_reader

        found = stream_reader.StreamReader(
            _bounded(file, self._size), emit_chunks=True, validate_crcs=True, record_size_limit=None
        ).records
        try:
            for record in takewhile(lambda record: not isinstance(record, records.DataEnd), found):
                if isinstance(record, records.Chunk):
                    yield from self._records_of(record)
                else:
                    yield record
        except exceptions.EndOfFile:
            self._lacks = "it ends within a write: the last recorded data are missing"
        except exceptions.InvalidMagic as error:
            if file.tell() <= _MAGIC_SIZE:
                raise UserError(f"{self._path} is not an MCAP file", remedy=WRITTEN_BY) from error
            self._lacks = "its end is damaged"
        except (exceptions.McapError, struct.error, ValueError) as error:
            self._lacks = f"it is damaged before octet {file.tell()} ({error}): everything recorded after that is missing"

    def _records_of(self, chunk: Any) -> Iterator[Any]:
        """Yield the records of a chunk.

        Raises:
            ValueError: the chunk contradicts its own statements.
            UserError: the budget is spent.
        """
        from mcap import data_stream, exceptions, opcode, records

        self._spend(chunk.uncompressed_size)
        data = _decompressed(chunk)
        stream = data_stream.ReadDataStream(_bounded(io.BytesIO(data), len(data)))
        readers: Mapping[int, Callable[[Any], Any]] = {
            opcode.Opcode.CHANNEL: records.Channel.read,
            opcode.Opcode.SCHEMA: records.Schema.read,
        }
        try:
            while stream.count < len(data):
                kind, length = stream.read1(), stream.read8()
                if kind == opcode.Opcode.MESSAGE:
                    yield records.Message.read(stream, length)
                elif kind in readers:
                    yield readers[kind](stream)
                else:
                    stream.read(length)
        except (exceptions.EndOfFile, struct.error) as error:
            raise _Damaged("a record is longer than its chunk") from error

    def _spend(self, octets: int) -> None:
        """Charge octets to the budget.

        Raises:
            UserError: it is spent.
        """
        self._left -= octets
        if self._left < 0:
            raise self._not_ours(
                f"{counted(self._size, 'octet')} become over {_BUDGET_RATIO} times as many in memory, unlike those of a recording"
            )

    # -- from records to values ----------------------------------------------------------------------------------------

    def take(self, record: Any) -> None:
        """Process one record.

        Raises:
            UserError: it is not a record of axisbus.
        """
        take = _TAKES.get(type(record).__name__)
        if take is not None:
            take(self, record)

    def recorded(self) -> Recorded:
        """Return the whole recording.

        Raises:
            UserError: it is not a recording of axisbus.
        """
        if self._began is None:
            raise self._not_ours(
                "it has no metadata of that name" + (f"; {self._lacks}" if self._lacks else "")
            )
        return Recorded(
            self._tracks("axis"),
            {name: track for name, track in self._tracks("object").items() if track.times},
            sorted(self._events),
            self._began,
            self._facts,
            self._lacks,
        )

    def _tracks(self, sort: str) -> dict[str, RecordedSeries]:
        found = [channel for channel in self._channels.values() if channel.sort == sort]
        return {one.name: RecordedSeries(one.name, one.times, one.columns, one.units) for one in found}

    def _schema(self, record: Any) -> None:
        self._spend(len(record.data))
        self._schemas[record.id] = record

    def _metadata(self, record: Any) -> None:
        """Store the start time of the recording, which precedes all messages.

        Raises:
            UserError: it is missing.
        """
        if record.name != "axisbus":
            return
        self._facts = dict(record.metadata)
        try:
            self._begin, began = (int(self._facts[key]) for key in ("began_monotonic_ns", "began_ns"))
            if not 0 <= self._begin < _TIMES or not 0 <= began < _TIMES:
                raise ValueError("the time is out of range")
        except (KeyError, ValueError) as error:
            raise self._not_ours(f"its metadata does not say when it began: {error}") from error
        self._began = datetime.fromtimestamp(began / _NANO, UTC)

    def _channel(self, record: Any) -> None:
        sort, _, name = record.topic.partition("/")
        if record.id in self._channels or sort not in _NEEDED:
            return
        about = self._properties(record)
        for key, kind in _NEEDED[sort].items():
            if key not in about or kind not in ("", about[key].kind):
                raise self._not_ours(
                    f"its channel {record.topic!r} has no {kind or 'value of the name'} {key!r}"
                )
        self._spend(_PER_COLUMN * (1 + len(about)))
        packed = {key for key, each in about.items() if sort == "axis" and each.kind == "number"}
        self._channels[record.id] = _Channel(
            sort,
            name,
            array("d"),
            {
                key: array("d") if key in packed else [] for key in about
            },  # the values of an object keep their types
            {key: each.unit for key, each in about.items()},
            _decoder(sort, about),
            _PER_MESSAGE + _PER_NUMBER * len(packed) + _PER_VALUE * (len(about) - len(packed)),
        )

    def _properties(self, channel: Any) -> dict[str, _Property]:
        """Return the description of a channel's values in its schema.

        Raises:
            UserError: it is not a schema of axisbus.
        """
        schema = self._schemas.get(channel.schema_id)
        try:
            about = msgspec.json.decode(b"{}" if schema is None else schema.data, type=_Schema).properties
        except (ValueError, RecursionError) as error:
            raise self._not_ours(
                f"the schema of its channel {channel.topic!r} cannot be read: {error}"
            ) from error
        if len(about) > _MOST_COLUMNS:
            raise self._not_ours(f"its channel {channel.topic!r} has {counted(len(about), 'value')}")
        return about

    def _message(self, record: Any) -> None:
        self._taken += 1
        if self._began is None:
            raise self._not_ours("it has no metadata of that name before its first message")
        channel = self._channels.get(record.channel_id)
        if channel is None:
            return
        self._spend(len(record.data) + channel.cost)
        try:
            values = channel.decode(record.data)
        except (ValueError, RecursionError) as error:
            raise self._not_ours(
                f"message {self._taken}, of channel {channel.topic!r}, is not as its schema says: {error}"
            ) from error
        time = (record.publish_time - self._begin) / _NANO
        if channel.sort == "events":
            self._events.append(RecordedEvent(time, channel.name, values.where, values.text))
            return
        channel.times.append(time)
        for value, column in zip(msgspec.structs.astuple(values), channel.columns.values(), strict=True):
            if isinstance(column, array):
                column.append(_NAN if value is None else value)
            elif type(value) is int and abs(value) >= _INTEGERS:
                raise self._not_ours(
                    f"message {self._taken}, of channel {channel.topic!r}, has an integer of over 64 bits"
                )
            else:
                column.append(self._same[type(value)].setdefault(value, value))

    def _not_ours(self, observed: str) -> UserError:
        return UserError(
            f"{self._path} is not a recording of axisbus",
            observed=observed,
            remedy="make one: axisbus record CELL -o run.mcap",
        )


_TAKES: dict[str, Callable[[_Loading, Any], None]] = {
    "Schema": _Loading._schema,
    "Metadata": _Loading._metadata,
    "Channel": _Loading._channel,
    "Message": _Loading._message,
}


class _Bounded:
    """A file that reports its end whatever length is requested, and allocates no memory for data that it does not have."""

    def __init__(self, file: _Readable, size: int) -> None:
        self._file = file
        self._left = size

    def read(self, size: int) -> bytes:
        """Return exactly ``size`` octets.

        Raises:
            EndOfFile: there are fewer.
        """
        from mcap.exceptions import EndOfFile

        data = self._file.read(size) if 0 <= size <= self._left else b""
        self._left -= len(data)
        if len(data) != size:
            raise EndOfFile
        return data


def _bounded(file: _Readable, size: int) -> Any:
    """Return a file with the only method that mcap uses, ``read``."""
    return _Bounded(file, size)


def _decompressed(chunk: Any) -> bytes:
    """Return the octets of a chunk.

    Raises:
        ValueError: their number or their compression differs from the chunk's statements.
    """
    import lz4.frame  # type: ignore[import-untyped]
    import zstandard

    size = chunk.uncompressed_size
    try:
        if chunk.compression == "zstd":
            window = zstandard.ZstdDecompressor(max_window_size=max(_WINDOW, size))
            data = window.stream_reader(chunk.data).read(size + 1)
        elif chunk.compression == "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        elif chunk.compression == "":
            data = chunk.data
        else:
            raise _Damaged(f"a chunk is compressed by {chunk.compression!r}, which is not known")
    except (zstandard.ZstdError, RuntimeError) as error:  # lz4 raises RuntimeError
        raise _Damaged(f"a chunk cannot be decompressed: {error}") from error
    if len(data) != size:
        raise _Damaged("a chunk has not the size that it says")
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise _Damaged("the checksum of a chunk is wrong")
    return data


def _decoder(sort: str, about: Mapping[str, _Property]) -> Callable[[bytes], Any]:
    """Return a decoder for the JSON of a message, with typed values."""
    if sort == "events":
        return msgspec.json.Decoder(_Event).decode
    kinds = [_TYPES.get(each.kind, _ANY) if sort == "axis" else _ANY for each in about.values()]
    names = {f"f{number}": key for number, key in enumerate(about)}
    values = msgspec.defstruct(
        "_Values", [(field, kind, None) for field, kind in zip(names, kinds, strict=True)], rename=names
    )
    return msgspec.json.Decoder(values).decode
