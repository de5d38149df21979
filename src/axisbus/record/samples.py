"""Write samples of some columns, from any source, to an MCAP file like that of a recording; unknown values are omitted."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from axisbus.record.columns import NAMES, AxisForm, SampleRow
from axisbus.record.events import Watched
from axisbus.record.mcap_writer import McapWriter
from axisbus.record.output_file import facts_of

_NANO = 1_000_000_000
_CHUNK = 1 << 18  # bytes

# By axis, the values of some columns of ``record.columns``, one for each time; NaN is unknown.
Columns = Mapping[str, Mapping[str, Sequence[float]]]


def write_samples(
    machine: Watched, path: Path, times: Sequence[float], columns: Columns, facts: Mapping[str, str]
) -> None:
    """Write samples of a machine's axes to ``path``, which is replaced; ``times`` in ascending seconds of the monotonic clock.

    ``facts``: further facts about them.

    Raises:
        UserError: the package mcap is not installed.
        OSError: the file cannot be written.
    """
    known = facts_of(machine.cell, simulated=machine.is_simulated, degree=machine.real_time_status)
    offset = time.time_ns() - round(time.monotonic() * _NANO)
    writer = McapWriter(path, {**known, **facts}, times[0], _CHUNK, offset)
    try:
        writer.attach("cell.toml", "application/toml", machine.cell.source.encode())
        for axis, values in columns.items():
            form = AxisForm.of(machine.session.axes[axis].parameters)
            _write(writer, writer.axis(axis, form.schema(axis)), times, values)
        writer.close()
    finally:
        writer.abandon()


def _write(
    writer: McapWriter, channel: int, times: Sequence[float], values: Mapping[str, Sequence[float]]
) -> None:
    there = [values.get(name) for name in NAMES]
    for at, now in enumerate(times):
        row = [None if each is None or not math.isfinite(each[at]) else each[at] for each in there]
        writer.write(channel, now, SampleRow(*row))
