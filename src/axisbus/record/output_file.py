"""The output file of a recording: the cycles of a machine, its events, and the description of both."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from axisbus.cell.model import CellConfig
from axisbus.cia301.datatypes import Value
from axisbus.eds.builtin import resolve
from axisbus.errors import ArgumentError, AxisbusError, UserError, one_line
from axisbus.ipc.image import CellImage
from axisbus.motion.numbers import short_repr
from axisbus.motion.snapshot import Snapshot
from axisbus.record.columns import AxisForm, SampleRow
from axisbus.record.events import RecordingEventSource, Watched
from axisbus.record.mcap_writer import McapWriter, ObjectDescription
from axisbus.record.recording_data import RecordedEvent
from axisbus.record.sample_packing import AxisSample, RowForm, sample_of

Row = bytes | tuple[float, CellImage]

_SAMPLE = 220  # bytes of a sample before it is compressed: a chunk is about a second


class McapFile:
    """One MCAP file of some axes of a machine; holds its progress. ``pack`` may be called in any thread, the rest in one."""

    def __init__(self, machine: Watched, path: Path | str, axes: Iterable[str] | None) -> None:
        """``axes``: all, if None.

        Raises:
            StateError: there is no such axis.
        """
        if not isinstance(path, (str, os.PathLike)):
            raise ArgumentError(
                f"{short_repr(path)} is not a path of a file", remedy='give one, such as "run.mcap"'
            )
        self.path = Path(path)
        self._machine = machine
        there = machine.session.axes
        self.forms = {name: AxisForm.of(there[name].parameters) for name in _chosen(axes, there, machine)}
        self._row = RowForm(len(self.forms))
        self._facts = facts_of(
            machine.cell, simulated=machine.is_simulated, real_time_status=machine.real_time_status
        )
        self._event_source = RecordingEventSource(machine)
        self._writer: McapWriter | None = None
        self._axes: dict[str, int] = {}
        self._objects: dict[str, int] = {}
        self.began = self.newest = 0.0  # s, monotonic
        self.rows = 0

    @property
    def is_open(self) -> bool:
        """Whether the file is open."""
        return self._writer is not None

    @property
    def size(self) -> int:
        """The number of bytes in the file."""
        return 0 if self._writer is None else self._writer.size

    def pack(self, now: float, snapshots: Mapping[str, Snapshot]) -> Row:
        """Pack a cycle into a row as fast as possible: bytes, in which form a core's process image arrives already."""
        if isinstance(snapshots, CellImage):
            return now, snapshots
        return self._row.struct.pack(*self._row.values(now, [snapshots[name] for name in self.forms]))

    def time_of(self, row: Row) -> float:
        """Return the time of a packed cycle, in seconds of the monotonic clock."""
        return self._unpacked(row)[0]

    def begin(self, began: float, objects: Mapping[str, ObjectDescription] | None = None) -> None:
        """Open the file, which is replaced; ``began``: its start time (s, monotonic).

        ``objects``: the description of each object, by label.

        Raises:
            UserError: the package mcap is not installed, or the file cannot be written.
        """
        self.began = self.newest = began
        try:
            self._begin(objects or {})
        except OSError as error:
            self.abandon()
            self._writer = None
            raise UserError(
                f"{self.path} cannot be written", observed=one_line(error), remedy="give another path"
            ) from error

    def _begin(self, objects: Mapping[str, ObjectDescription]) -> None:
        self._writer = writer = McapWriter(self.path, self._facts, self.began, self._second())
        self._attach(writer)
        self._axes = {name: writer.axis(name, form.schema(name)) for name, form in self.forms.items()}
        self._objects = writer.objects(objects)

    def _unpacked(self, row: Row) -> tuple[float, list[AxisSample]]:
        if isinstance(row, bytes):
            return next(self._row.rows(row))
        now, image = row
        return now, [sample_of(image[name]) for name in self.forms]

    def write_rows(self, rows: Sequence[Row]) -> None:
        """Write packed cycles."""
        assert self._writer is not None
        for now, samples in map(self._unpacked, rows):
            for (name, form), sample in zip(self.forms.items(), samples, strict=True):
                self._writer.write(self._axes[name], now, SampleRow(*form.values(sample)))
            self.newest = now
            self.rows += 1

    def write_object(self, label: str, now: float, value: Value | None) -> None:
        """Write the value of an object."""
        assert self._writer is not None
        plain = value.hex() if isinstance(value, bytes) else value
        self._writer.write(self._objects[label], now, {} if plain is None else {"value": plain})

    def write_events(self) -> None:
        """Write the events since the begin or the last call; blocks for some answers of the core."""
        assert self._writer is not None
        try:
            found = self._event_source.take(self.began)
        except (AxisbusError, ExceptionGroup):  # the core is gone: its last events are already written
            return
        for event in found:
            self._writer.write_event(event)

    def note(self, text: str, time: float | None = None) -> None:
        """Write a remark about the recording itself, at ``time`` (s, monotonic) or at its newest cycle."""
        assert self._writer is not None
        self._writer.write_event(RecordedEvent(self.newest if time is None else time, "recording", "", text))

    def close(self) -> None:
        """Write the summary, and close the file."""
        assert self._writer is not None
        self._writer.close()

    def abandon(self) -> None:
        """Close the file without a summary. Harmless if it is closed."""
        if self._writer is not None:
            self._writer.abandon()

    def _attach(self, writer: McapWriter) -> None:
        cell = self._machine.cell
        writer.attach("cell.toml", "application/toml", cell.source.encode())
        files = {
            node_id: resolve(node.file, cell.folder)
            for node_id, node in cell.nodes.items()
            if node.file is not None  # a module with CAN Simple has none
        }
        told = {
            str(node_id): {"file": str(file), "sha256": hashlib.sha256(file.read_bytes()).hexdigest()}
            for node_id, file in files.items()
        }
        writer.attach("eds.json", "application/json", json.dumps(told, indent=1).encode())

    def _second(self) -> int:
        """Return the approximate number of bytes per second, before compression."""
        return max(4096, int(_SAMPLE * max(1, len(self.forms)) / self._machine.cell.bus.scan_period))


def facts_of(cell: CellConfig, *, simulated: bool, real_time_status: str) -> dict[str, str]:
    """Return the facts about a whole recording; ``real_time_status`` as ``Machine.real_time_status``."""
    real = f"{cell.bus.interface} {cell.bus.channel or ''}".strip()
    return {
        "cell": str(cell.file),
        "scan_period_s": repr(cell.bus.scan_period),
        "drives": "simulated" if simulated else real,
        "degree": real_time_status,
    }


def _chosen(axes: Iterable[str] | None, there: Mapping[str, object], machine: Watched) -> list[str]:
    wanted = list(there) if axes is None else texts_of("axes", axes)
    for name in wanted:
        if name not in there:
            raise machine.cell.no_axis(name)
    return wanted


def texts_of(what: str, given: Iterable[str]) -> list[str]:
    """Return the names in ``given``, each once; raises ArgumentError if one is not a name (``what`` names them in the text)."""
    found = [given] if isinstance(given, str) else _all_of(given)
    if found is None or not all(isinstance(each, str) for each in found):
        raise ArgumentError(
            f"{what}: {short_repr(given)} are not names",
            remedy=f'give {what} as texts in a list, such as ["x"]',
        )
    return list(dict.fromkeys(found))


def _all_of(given: object) -> list[Any] | None:
    return list(given) if isinstance(given, Iterable) else None
