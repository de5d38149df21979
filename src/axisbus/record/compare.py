"""Compare two recordings of one job: where, when and by how much the motion of each axis differed."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from axisbus.errors import UserError
from axisbus.record.recording_data import Recorded, RecordedSeries

COMPARED = ("position", "velocity", "torque", "following_error")


class Deviation(NamedTuple):
    """The largest difference of one column of an axis: ``time`` in s after the start of motion, both values, in ``unit``."""

    axis: str
    column: str
    unit: str
    time: float
    first: float
    second: float

    @property
    def by(self) -> float:
        """The second value minus the first."""
        return self.second - self.first


class Compared(NamedTuple):
    """The result of a comparison; ``shift``: seconds by which the second started later; ``only``: axes in one recording only."""

    deviations: list[Deviation]
    shift: float
    only: list[str]
    seconds: float  # the common duration


def compare(first: Recorded, second: Recorded) -> Compared:
    """Return the largest deviations of each axis; the recordings are aligned at the first motion of an axis.

    Raises:
        UserError: the recordings have no axis in common, or the same axis in different units.
    """
    common = [name for name in first.tracks if name in second.tracks]
    if not common:
        raise UserError(
            "the two recordings have no axis in common",
            observed=f"{', '.join(first.tracks) or 'none'}; {', '.join(second.tracks) or 'none'}",
        )
    begins = begin(first, common), begin(second, common)
    seconds = min(first.seconds - begins[0], second.seconds - begins[1])
    deviations = [
        found
        for name in common
        for found in _of_axis(first.tracks[name], second.tracks[name], begins, seconds)
    ]
    only = sorted(set(first.tracks) ^ set(second.tracks))
    return Compared(deviations, begins[1] - begins[0], only, seconds)


def begin(recorded: Recorded, axes: Sequence[str]) -> float:
    """Return when the first of some axes was first in a state of motion; if none was, the begin of the recording."""
    found = (
        next(
            (time for time, state in zip(track.times, track.columns["state"], strict=True) if _moves(state)),
            math.inf,
        )
        for track in (recorded.tracks[name] for name in axes)
    )
    earliest = min(found)
    return earliest if math.isfinite(earliest) else 0.0


def _moves(state: str) -> bool:
    return state.endswith("Motion") or state == "Homing"


def _of_axis(
    first: RecordedSeries, second: RecordedSeries, begins: tuple[float, float], seconds: float
) -> Iterator[Deviation]:
    for column in COMPARED:
        units = {first.units[column], second.units[column]}
        if len(units) > 1:
            raise UserError(f"axis {first.name}: {column} is in {' and '.join(sorted(units))}")
        worst = _worst(first, second, column, begins, seconds)
        if worst is not None:
            yield Deviation(first.name, column, first.units[column], *worst)


def _worst(
    first: RecordedSeries, second: RecordedSeries, column: str, begins: tuple[float, float], seconds: float
) -> tuple[float, float, float] | None:
    worst: tuple[float, float, float] | None = None
    others, times = second.columns[column], second.times
    for time, value in zip(first.times, first.columns[column], strict=True):
        after = time - begins[0]
        if not 0.0 <= after <= seconds:
            continue
        other = _at(times, others, after + begins[1])
        if not math.isnan(value - other) and (worst is None or abs(other - value) > abs(worst[2] - worst[1])):
            worst = after, value, other
    return worst


def _at(times: Sequence[float], values: Sequence[float], time: float) -> float:
    """Return a value interpolated between two samples; NaN if it is unknown."""
    index = bisect_right(times, time)
    if not 0 < index < len(times):
        return values[min(index, len(times) - 1)] if times else math.nan
    before, after = times[index - 1], times[index]
    share = (time - before) / (after - before) if after > before else 0.0
    return values[index - 1] + share * (values[index] - values[index - 1])
