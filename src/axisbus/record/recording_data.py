"""A recording in memory: the values of each axis over time, and the events."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import compress
from typing import Any, NamedTuple


class RecordedEvent(NamedTuple):
    """An event: ``time`` in s, ``sort`` of ``SORTS``, ``where`` (a node, a command), ``text`` for people."""

    time: float
    sort: str
    where: str
    text: str


# The sorts of events, and their descriptions.
SORTS: Mapping[str, str] = {
    "command": "commands, with their ends",
    "nmt": "the reports of error control about the nodes",
    "emcy": "emergency messages of the drives, grouped into incidents",
    "pdo": "TPDOs that stopped coming, and came again",
    "bus": "the reports of the CAN controller",
    "machine": "why the machine was left",
    "recording": "the gaps of the recording, and why it ended",
}


@dataclass(frozen=True, slots=True)
class RecordedSeries:
    """The values of one axis or object: ``times`` in seconds since the begin of the recording, and columns of equal length.

    An unknown number is NaN, another unknown value None.
    """

    name: str
    times: Sequence[float]
    columns: Mapping[str, Sequence[Any]]
    units: Mapping[str, str]  # by column; empty if it has none

    def within(self, begin: float, end: float) -> RecordedSeries:
        """Return the part between two times (s)."""
        chosen = [begin <= time <= end for time in self.times]
        columns = {name: list(compress(values, chosen)) for name, values in self.columns.items()}
        return replace(self, times=list(compress(self.times, chosen)), columns=columns)


@dataclass(frozen=True, slots=True)
class Recorded:
    """A whole recording. ``began``: its start (UTC), None if unknown; ``lacks``: why it is incomplete, for people.

    ``objects``: the recorded objects, each a series with the column ``value``. ``facts``: further remarks, as texts.
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
        """Return the part between two times (s); its times do not change."""
        return replace(
            self,
            tracks={name: track.within(begin, end) for name, track in self.tracks.items()},
            objects={name: track.within(begin, end) for name, track in self.objects.items()},
            events=[event for event in self.events if begin <= event.time <= end],
        )
