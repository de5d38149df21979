"""Write a recording as an MCAP file while it runs: whole chunks at a time, so that it is readable however it ends.

There is one channel for each axis (``axis/x``) and object (``object/x:6074``), and one for each sort of events (``events/nmt``),
all in JSON with a schema that has the units. Each value has one plain type and is omitted if unknown, because other readers do not
accept nullable types. ``publish_time`` is the time of a cycle by the monotonic clock. ``log_time`` is its time of day: the
monotonic time plus the difference of the clocks at the begin of the recording, so that it never jumps.
"""

from __future__ import annotations

import io
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from axisbus.errors import UserError
from axisbus.record.recording_data import SORTS, RecordedEvent
from axisbus.version import __version__

_NANO = 1_000_000_000
_EVENT_SCHEMA = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "event",
    "type": "object",
    "properties": {
        "where": {"type": "string", "description": "a node, an axis or a command"},
        "text": {"type": "string", "description": "what happened"},
    },
    "required": ["where", "text"],
}


class ObjectDescription(NamedTuple):
    """The description of an object: its name, how its values are obtained, and their JSON type."""

    name: str
    comes: str
    json_type: str


def library() -> Any:
    """Return the module ``mcap.writer``.

    Raises:
        UserError: it is not installed.
    """
    try:
        import mcap.writer
    except ImportError:
        raise UserError(
            "recordings need the package mcap, which is not installed", remedy='pip install "axisbus[record]"'
        ) from None
    return mcap.writer


class McapWriter:
    """One file that is being written; holds its channels. For one thread. Each method may raise OSError."""

    def __init__(
        self, path: Path, facts: Mapping[str, str], now: float, chunk: int, offset: int | None = None
    ) -> None:
        """Open ``path``, which is replaced; its folder is made if needed. ``now``: the start time, in s, monotonic.

        ``chunk``: the size of a chunk in bytes. ``offset``: the time of day minus the monotonic clock, in ns; by default, the
        present difference.

        Raises:
            UserError: the package is not installed.
        """
        mcap = library()
        self._offset = time.time_ns() - round(now * _NANO) if offset is None else offset
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("wb", buffering=0)
        self._stream = _Counted(self._file)
        # All indexes: the message index is as long as the messages, but other readers (Foxglove's) refuse a file without it.
        self._writer = mcap.Writer(self._stream, chunk_size=chunk)
        self._channels: dict[str, int] = {}
        self._counts: dict[int, int] = {}
        begun = round(now * _NANO)
        clocks = {"began_ns": str(begun + self._offset), "began_monotonic_ns": str(begun)}
        try:
            self._begin({**clocks, **facts})
        except OSError:
            self._file.close()
            raise

    def _begin(self, facts: dict[str, str]) -> None:
        self._writer.start(profile="", library=f"axisbus {__version__}")
        self._writer.add_metadata("axisbus", facts)
        events = self._schema("axisbus/event", _EVENT_SCHEMA)
        for sort, text in SORTS.items():
            self._register(f"events/{sort}", events, {"about": text})

    @property
    def size(self) -> int:
        """The number of bytes in the file."""
        return self._stream.written

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a whole file."""
        stamp = time.time_ns()
        self._writer.add_attachment(stamp, stamp, name, media_type, data)

    def axis(self, name: str, schema: Mapping[str, Any]) -> int:
        """Create the channel of an axis, and return its number."""
        topic = f"axis/{name}"
        return self._register(topic, self._schema(f"axisbus/{topic}", schema), {})

    def objects(self, wanted: Mapping[str, ObjectDescription]) -> dict[str, int]:
        """Create the channels of objects, and return their numbers by label."""
        kinds = sorted({one.json_type for one in wanted.values()})
        schemas = {kind: self._schema(f"axisbus/object/{kind}", _object_schema(kind)) for kind in kinds}
        return {
            label: self._register(
                f"object/{label}", schemas[one.json_type], {"name": one.name, "comes": one.comes}
            )
            for label, one in wanted.items()
        }

    def write(self, channel: int, now: float, value: object) -> None:
        """Write a value with its time ``now`` (s, monotonic)."""
        stamp = round(now * _NANO)
        count = self._counts[channel] = self._counts.get(channel, 0) + 1
        self._writer.add_message(channel, stamp + self._offset, msgspec.json.encode(value), stamp, count)

    def write_event(self, event: RecordedEvent) -> None:
        """Write an event; its time is that of the monotonic clock."""
        values = {"where": event.where, "text": event.text}
        self.write(self._channels[f"events/{event.sort}"], event.time, values)

    def close(self) -> None:
        """Write the summary, and close the file."""
        self._writer.finish()
        self._file.close()

    def abandon(self) -> None:
        """Close the file without a summary. Harmless if it is closed."""
        self._file.close()

    def _schema(self, name: str, schema: Mapping[str, Any]) -> int:
        number: int = self._writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
        return number

    def _register(self, topic: str, schema: int, about: dict[str, str]) -> int:
        number: int = self._writer.register_channel(topic, "json", schema, about)
        self._channels[topic] = number
        return number


def _object_schema(json_type: str) -> dict[str, Any]:
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "object",
        "type": "object",
        "properties": {"value": {"type": json_type, "description": "left out where the node did not answer"}},
    }


class _Counted(io.BufferedIOBase):
    """Count the bytes written to a file; write all of them or raise."""

    def __init__(self, file: io.FileIO) -> None:
        self._file = file
        self.written = 0

    def write(self, data: Any) -> int:
        """Write all bytes."""
        left = memoryview(data)
        while left:
            done = self._file.write(left) or 0
            left = left[done:]
            self.written += done
        return len(data)

    def tell(self) -> int:
        """Return the position of the next byte, counted here because a pipe has none."""
        return self.written
