"""Stored faults: the cycles around a fault as a core writes them, without any extra package, and how to read them back."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from axisbus.errors import UserError
from axisbus.record.columns import AxisForm, tracks_of
from axisbus.record.recording_data import Recorded, RecordedEvent
from axisbus.record.sample_packing import RowForm

MAGIC = b"axisbus fault 1\n"


class _Head(msgspec.Struct):
    facts: dict[str, str]
    axes: dict[str, tuple[float, float, float, dict[str, str]]]
    events: list[tuple[float, str, str, str]]


def write(
    path: Path,
    forms: Mapping[str, AxisForm],
    rows: bytes,
    events: Iterable[RecordedEvent],
    facts: Mapping[str, str],
) -> None:
    """Write one fault: packed rows (``RowForm``) and events; ``facts`` as in an MCAP file. The write is atomic.

    Raises:
        OSError: the file cannot be written.
    """
    axes = {
        name: [form.position, form.velocity, form.torque, dict(form.units)] for name, form in forms.items()
    }
    head = json.dumps({"facts": dict(facts), "axes": axes, "events": list(events)}).encode()
    temporary = path.with_suffix(".new")
    try:
        temporary.write_bytes(MAGIC + head + b"\n" + rows)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)  # a full disk must not keep a part of each fault


def read(path: Path) -> Recorded:
    """Read one fault.

    Raises:
        UserError: the file is not a fault file, or is incomplete.
        OSError: the file cannot be read.
    """
    head, _, rows = path.read_bytes().removeprefix(MAGIC).partition(b"\n")
    try:
        return _recorded(msgspec.json.decode(head, type=_Head), rows)
    except (ValueError, LookupError, ArithmeticError, RecursionError) as error:
        raise UserError(
            f"{path} is not a complete fault file of axisbus",
            observed=f"{type(error).__name__}: {error}",
            remedy="choose another file: axisbus record faults CELL lists them",
        ) from error


def _recorded(head: _Head, rows: bytes) -> Recorded:
    forms = {name: AxisForm(*numbers) for name, numbers in head.axes.items()}
    facts = head.facts
    begin = int(facts["began_monotonic_ns"]) / 1e9
    form = RowForm(len(forms))
    found = list(form.rows(rows[: len(rows) // form.struct.size * form.struct.size]))
    times = [now - begin for now, _ in found]

    events = [RecordedEvent(time - begin, sort, where, text) for time, sort, where, text in head.events]
    began = datetime.fromtimestamp(int(facts["began_ns"]) / 1e9, UTC)
    return Recorded(tracks_of(forms, times, found), {}, sorted(events), began, facts)
