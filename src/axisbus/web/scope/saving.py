"""Make an MCAP file of the samples on a page's scope; the page sends them back, because only the page has them.

Theory of operation
-------------------
Little-endian: number of samples (uint32), length of the names (uint32), the names of the signals (JSON, a list), then the times
(float64, s), then the values of each signal (float32), one signal after the other, as in the batches to the page; NaN is unknown.
"""

from __future__ import annotations

import asyncio
import json
import math
import sys
import tempfile
import time
from array import array
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from struct import Struct

from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from axisbus.errors import ArgumentError, AxisbusError, StateError, one_line
from axisbus.machine.machine import Machine
from axisbus.record.columns import NAMES, AxisForm, SampleRow
from axisbus.record.events import Watched
from axisbus.record.mcap_writer import McapWriter
from axisbus.record.output_file import facts_of
from axisbus.web.access.middleware import SESSION
from axisbus.web.scope.signals import MAX_SIGNALS, all_signals
from axisbus.web.view import explained

HEAD = Struct("<II")
MAX_SAMPLES = 1 << 17  # as many as a browser stores
_LONGEST_NAMES = 4096  # bytes
_FACTS = {"from": "data shown on the scope of a page"}


@dataclass(frozen=True, slots=True)
class ScopeSamples:
    """Times (s), and the same number of values of each signal, by name."""

    times: array[float]
    values: dict[str, array[float]]


def can_save() -> bool:
    """Whether the package that writes MCAP files is installed."""
    return find_spec("mcap") is not None


def read(data: bytes, axes: Collection[str]) -> ScopeSamples | None:
    """Return the samples in a page's data, of the signals in ``axes``; None if the data are invalid."""
    if len(data) < HEAD.size:
        return None
    count, long = HEAD.unpack_from(data)
    names = _names(data[HEAD.size : HEAD.size + min(long, _LONGEST_NAMES)], axes)
    begin = HEAD.size + long
    if not names or not 0 < count <= MAX_SAMPLES or len(data) != begin + count * (8 + 4 * len(names)):
        return None
    times = _numbers("d", data[begin : begin + 8 * count])
    if not all(map(math.isfinite, times)) or times[0] < 0.0 or any(b < a for a, b in pairwise(times)):
        return None
    begin += 8 * count
    columns = (data[at : at + 4 * count] for at in range(begin, len(data), 4 * count))
    return ScopeSamples(times, {name: _numbers("f", each) for name, each in zip(names, columns, strict=True)})


def mcap(machine: Machine, data: bytes) -> bytes:
    """Return the MCAP file of a page's data; blocks for a second or two.

    Raises:
        ArgumentError: the data are invalid.
        UserError: the package is not installed.
        OSError: there is no room for the file.
    """
    found = read(data, {signal.name for signal in all_signals(machine)})
    if found is None:
        raise ArgumentError("the received samples do not belong to this page", remedy="load the page again")
    columns: dict[str, dict[str, array[float]]] = {}
    for name, values in found.values.items():
        axis, _, column = name.rpartition(".")
        columns.setdefault(axis, {})[column] = values
    with tempfile.TemporaryDirectory(prefix="axisbus-scope-") as folder:
        path = Path(folder) / "scope.mcap"
        write_samples(machine, path, found.times, columns, _FACTS)
        return path.read_bytes()


def _names(text: bytes, axes: Collection[str]) -> list[str] | None:
    try:
        names = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(names, list) or len(names) > MAX_SIGNALS or len(set(map(str, names))) < len(names):
        return None
    return names if all(isinstance(name, str) and name in axes for name in names) else None


def _numbers(kind: str, data: bytes) -> array[float]:
    found: array[float] = array(kind)
    found.frombytes(data)
    if sys.byteorder == "big":
        found.byteswap()
    return found


# -- HTTP request of the page for an MCAP file of its scope's samples; one at a time, and one for each browser ---------


_UPLOAD_TIMEOUT = 20.0  # seconds that the upload of the samples may take
_BUSY = StateError("another file of this browser is being written", remedy="save again in a moment")


class ScopeRoutes:
    """Hold the browsers for which a file is being made; used by one event loop."""

    def __init__(self, machine: Machine) -> None:
        """``machine`` is the one whose signals are shown."""
        self._machine = machine
        self._busy: set[int] = set()
        self._lock = asyncio.Lock()

    async def save(self, request: Request) -> Response:
        """Return the file, or the error as JSON."""
        browser = request.scope[SESSION].number
        if browser in self._busy:
            return _error_response(_BUSY)
        self._busy.add(browser)
        try:
            async with asyncio.timeout(_UPLOAD_TIMEOUT):
                data = await request.body()
            async with self._lock:
                content = await asyncio.to_thread(mcap, self._machine, data)
            return Response(content, media_type="application/octet-stream")
        except AxisbusError as error:
            return _error_response(error)
        except (ClientDisconnect, TimeoutError, OSError) as error:
            return _error_response(StateError("the file could not be written", observed=one_line(error)))
        finally:
            self._busy.discard(browser)


def _error_response(error: AxisbusError) -> Response:
    return Response(json.dumps({"error": explained(error)}), media_type="application/json")


# -- Write samples of some columns to an MCAP file like that of a recording; unknown values are omitted --------------------

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
    known = facts_of(machine.cell, simulated=machine.is_simulated, real_time_status=machine.real_time_status)
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
    columns = [values.get(name) for name in NAMES]
    for at, now in enumerate(times):
        row = [None if each is None or not math.isfinite(each[at]) else each[at] for each in columns]
        writer.write(channel, now, SampleRow(*row))
