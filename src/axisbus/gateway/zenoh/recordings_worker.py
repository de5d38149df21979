"""``python -m axisbus.gateway.zenoh.recordings_worker FOLDER``: answer a query about recordings (standard input and output).

This is a process of its own with low priority, because reading a recording may take minutes, and the bridge commands a machine.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from axisbus.errors import ArgumentError, AxisbusError, StateError
from axisbus.fleet.messages import HistoryAnswer, HistoryAsk, RecordingInfo
from axisbus.ipc.errors import to_fields
from axisbus.record import mcap_reader
from axisbus.record.recording_data import Recorded
from axisbus.system.process_limits import lower_priority

SUFFIX = ".mcap"
LARGEST = 256 * 1024 * 1024  # bytes, the largest recording that is read for clients
MOST = 100_000  # values in an answer
_LISTED = 1000


def recordings(folder: Path) -> tuple[RecordingInfo, ...]:
    """Return the recordings in a folder, newest first.

    Raises:
        StateError: the folder cannot be read.
    """
    try:
        files = [path for path in folder.iterdir() if path.suffix == SUFFIX and path.is_file()]
        found = [RecordingInfo(path.name, path.stat().st_size, path.stat().st_mtime) for path in files]
    except OSError as error:
        raise StateError(
            f"the recordings in {folder} cannot be listed", observed=error.strerror or str(error)
        ) from error
    return tuple(sorted(found, key=lambda each: each.written, reverse=True)[:_LISTED])


def chosen(folder: Path, name: str) -> Path:
    """Return the file of a recording by its name in the list, so that no file outside the folder can be chosen.

    Raises:
        ArgumentError: there is no recording of this name.
        StateError: the recording is too large.
    """
    info = next((each for each in recordings(folder) if each.name == name), None)
    if info is None:
        raise ArgumentError(f"there is no recording {name!r}", remedy="query without a name to list them")
    if info.size > LARGEST:
        raise StateError(
            f"{name} is too large to be read over the network",
            observed=f"it has {info.size / 1e6:.0f} MB; at most {LARGEST / 1e6:.0f} MB are allowed",
            remedy="copy the file itself, or make shorter recordings",
        )
    return folder / name


def samples(recorded: Recorded, request: HistoryAsk) -> HistoryAnswer:
    """Return the requested signals between two times, evenly thinned out if there are more samples than requested.

    All samples have the times of the first signal's axis or object; the other signals have their latest values at these times.

    Raises:
        ArgumentError: there is no such signal, or no signal is given.
    """
    if not request.signals:
        raise ArgumentError("which signals?", remedy=f"there are {', '.join(_names(recorded)) or 'none'}")
    found = [_signal(recorded, name) for name in request.signals]
    times = found[0][0]
    end = math.inf if request.end is None else request.end
    indices = [at for at, time in enumerate(times) if request.begin <= time <= end]
    most = max(1, min(request.most, MOST // len(found)))
    step = max(1, math.ceil(len(indices) / most))
    sampled = [times[at] for at in indices[::step]]
    values = {name: _at(sampled, *each) for name, each in zip(request.signals, found, strict=True)}
    return HistoryAnswer(times=tuple(sampled), values=values)


def _signal(recorded: Recorded, name: str) -> tuple[Sequence[float], Sequence[Any]]:
    if name in recorded.objects:
        track = recorded.objects[name]
        return track.times, track.columns["value"]
    axis, _, column = name.rpartition(".")
    track_of_axis = recorded.tracks.get(axis)
    if track_of_axis is None or column not in track_of_axis.columns:
        raise ArgumentError(
            f"the recording has no signal {name!r}",
            remedy=f"there are {', '.join(_names(recorded)) or 'none'}",
        )
    return track_of_axis.times, track_of_axis.columns[column]


def _names(recorded: Recorded) -> list[str]:
    axes: Mapping[str, Any] = recorded.tracks
    return [
        *(f"{name}.{column}" for name, track in axes.items() for column in track.columns),
        *recorded.objects,
    ]


def _at(sampled: Sequence[float], times: Sequence[float], values: Sequence[Any]) -> tuple[float | None, ...]:
    """Return the latest values at these ascending times; None if there was none yet, or it is not a number."""
    found, at = list[float | None](), 0
    for time in sampled:
        while at < len(times) and times[at] <= time:
            at += 1
        found.append(_number(values[at - 1]) if at else None)
    return tuple(found)


def _number(value: Any) -> float | None:
    number = isinstance(value, (int, float)) and math.isfinite(value)
    return float(value) if number else None


_NICE = 15


def answer(folder: Path, request: HistoryAsk) -> HistoryAnswer:
    """Return the answer to a query; an error is a possible answer. Blocks."""
    try:
        if not request.recording:
            return HistoryAnswer(recordings=recordings(folder))
        return samples(mcap_reader.load(chosen(folder, request.recording)), request)
    except AxisbusError as error:
        return HistoryAnswer(error=to_fields(error))


def main() -> int:
    """Read one query, and answer it."""
    lower_priority(_NICE)
    request = msgspec.json.decode(sys.stdin.buffer.read(), type=HistoryAsk)
    sys.stdout.buffer.write(msgspec.json.encode(answer(Path(sys.argv[1]), request)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
