"""A recording as values: what each axis did over time, and what happened meanwhile."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import compress
from typing import Any, NamedTuple


class RecordedEvent(NamedTuple):
    """Something that happened: ``time`` in s, ``sort`` of ``SORTS``, ``where`` (a node, a command), ``text`` for people."""

    time: float
    sort: str
    where: str
    text: str


# What can happen, and what it says.
SORTS: Mapping[str, str] = {
    "command": "commands, with their ends",
    "nmt": "what error control tells of the nodes",
    "emcy": "emergency messages of the drives, grouped into incidents",
    "pdo": "TPDOs that stopped coming, and came again",
    "bus": "what the CAN controller tells",
    "machine": "why the machine was left",
    "recording": "what the recording lacks, and why it ended",
}


@dataclass(frozen=True, slots=True)
class RecordedSeries:
    """What one axis (or one object) did: ``times`` in seconds since the recording began, and as many values in each column.

    An unknown number is NaN, another unknown value None.
    """

    name: str
    times: Sequence[float]
    columns: Mapping[str, Sequence[Any]]
    units: Mapping[str, str]  # by column; empty where it has none

    def within(self, begin: float, end: float) -> RecordedSeries:
        """Return what of it lies between two times (s)."""
        chosen = [begin <= time <= end for time in self.times]
        columns = {name: list(compress(values, chosen)) for name, values in self.columns.items()}
        return replace(self, times=list(compress(self.times, chosen)), columns=columns)


@dataclass(frozen=True, slots=True)
class Recorded:
    """A whole recording. ``began`` by the wall clock (UTC), None where nobody noted it; ``lacks``: why it is not whole, for people.

    ``objects``: what was read beside the axes, a track each with the column ``value``. ``facts``: what else was noted, as texts.
    """

    tracks: Mapping[str, RecordedSeries]
    objects: Mapping[str, RecordedSeries] = field(default_factory=dict)
    events: Sequence[RecordedEvent] = ()
    began: datetime | None = None
    facts: Mapping[str, str] = field(default_factory=dict)
    lacks: str = ""

    @property
    def seconds(self) -> float:
        """The time of its last sample."""
        return max((track.times[-1] for track in self.tracks.values() if track.times), default=0.0)

    def within(self, begin: float, end: float) -> Recorded:
        """Return what of it lies between two times (s); its times stay as they were."""
        return replace(
            self,
            tracks={name: track.within(begin, end) for name, track in self.tracks.items()},
            objects={name: track.within(begin, end) for name, track in self.objects.items()},
            events=[event for event in self.events if begin <= event.time <= end],
        )
