"""Keep the last minute of a machine in an interactive session, so that its last motion can be plotted afterwards.

Theory of operation
-------------------
The cycle only packs a row; rows older than a minute are dropped. The states of the axes define a motion. The motion of another axis
at the same time is plotted with it, and moves that were commanded together are plotted together.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from axisbus.errors import ArgumentError, AxisbusError, StateError, one_line
from axisbus.motion.numbers import number, short_repr
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import MOVING
from axisbus.record.columns import AxisForm, tracks_of
from axisbus.record.events import EventProvider, RecordingEventSource
from axisbus.record.plot import plot, png
from axisbus.record.recording_data import Recorded, RecordedEvent
from axisbus.record.sample_packing import AxisSample, PackedRows
from axisbus.wording import counted

log = logging.getLogger("axisbus")
HISTORY_SECONDS = 60.0  # seconds
_BEFORE, _AFTER = 0.2, 0.4  # seconds of standstill that are plotted before and after a motion
_ARRIVAL_TIME = 2.0  # seconds that the transmission of rows may take on a busy computer


Cycle = tuple[float, list[AxisSample]]


class _Section(NamedTuple):
    """Begin and end (s), and the axes."""

    begin: float
    end: float
    axes: list[str]


class LastMinute:
    """Hold the last cycles of a machine; new axes start a new minute. One thread adds, any thread may plot."""

    def __init__(self, machine: EventProvider) -> None:
        self._machine = machine
        self._limit = math.ceil(HISTORY_SECONDS / machine.cell.bus.scan_period)
        self._forms: dict[str, AxisForm] = {}
        self._rows = PackedRows(0, self._limit)
        self._seen = -math.inf

    def begin(self) -> None:
        """Start recording."""
        self._machine.session.observe(self._observe)

    def _observe(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        try:
            self._add(now, snapshots)
        except Exception as error:  # noqa: BLE001  # the scan continues without this recording
            self._machine.session.forget(self._observe)
            log.warning("the last motion is not kept any more: %s", one_line(error))

    def _add(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        if len(snapshots) != len(self._forms):
            facts = self._machine.session.axes
            self._forms = {name: AxisForm.of(facts[name].parameters) for name in snapshots if name in facts}
            self._rows = PackedRows(len(self._forms), self._limit)
        self._seen = now
        self._rows.append(now, [snapshots[name] for name in self._forms])

    def picture(self, seconds: float | None, axes: Iterable[str] | None) -> RecordingPlot:
        """Plot the last motion, or the last ``seconds``; see ``Machine.plot_last``."""
        self._await_newest()
        forms, cycles = self._forms, list(self._rows)
        names = list(forms)
        section = (
            _last_seconds(cycles, names, seconds) if seconds is not None else _last_motion(cycles, names)
        )
        if section is None:
            raise StateError(
                f"no axis has moved in the last {HISTORY_SECONDS:g} s of this machine; older cycles are not stored",
                remedy="call it soon after the motion; with seconds=... it also draws axes at rest",
            )
        chosen = section.axes if axes is None else self._chosen(axes, forms)
        shown = [(now, samples) for now, samples in cycles if section.begin <= now <= section.end]
        recorded = self._recorded(forms, shown, chosen)
        title = _title(recorded) if seconds is None else f"the last {recorded.seconds:.1f} s"
        return RecordingPlot(recorded, title)

    def _await_newest(self) -> None:
        """Wait for the row of the newest cycle that the program has seen: rows arrive in groups."""
        session = self._machine.session
        newest = max((snapshot.now for snapshot in session.snapshots.values()), default=0.0)
        until = time.monotonic() + _ARRIVAL_TIME
        while self._seen < newest and not session.ended and time.monotonic() < until:
            time.sleep(0.005)

    def _chosen(self, axes: Iterable[str], there: Collection[str]) -> list[str]:
        wanted = list(dict.fromkeys(axes))
        for name in wanted:
            if name not in there:
                raise self._machine.cell.no_axis(name)
        return wanted

    def _recorded(
        self, forms: Mapping[str, AxisForm], cycles: list[Cycle], chosen: Collection[str]
    ) -> Recorded:
        began = cycles[0][0]
        times = [round(now - began, 6) for now, _ in cycles]
        tracks = {name: track for name, track in tracks_of(forms, times, cycles).items() if name in chosen}
        events = [event._replace(time=event.time - began) for event in self._recorded_events(began)]
        return Recorded(tracks, {}, [event for event in events if event.time <= times[-1]])

    def _recorded_events(self, since: float) -> list[RecordedEvent]:
        """Return the events; empty if the core is gone."""
        try:
            return RecordingEventSource(self._machine).take(since)
        except AxisbusError:
            return []


def _last_seconds(cycles: list[Cycle], names: list[str], seconds: float) -> _Section | None:
    section = number(seconds)
    if section is None or section <= 0.0:
        raise ArgumentError(f"seconds={short_repr(seconds)}: give seconds above 0, or leave it out")
    if not cycles:
        return None
    end = cycles[-1][0]
    moved = {at for now, samples in cycles if now >= end - section for at in _moving(samples)}
    return _Section(end - section, end, [name for at, name in enumerate(names) if at in moved] or names)


def _last_motion(cycles: list[Cycle], names: list[str]) -> _Section | None:
    """Search backwards from the newest cycle while an axis moves, and a little farther while none does."""
    at = len(cycles) - 1
    while at >= 0 and not _moving(cycles[at][1]):
        at -= 1
    if at < 0:
        return None
    end = cycles[at][0] + _AFTER
    moved: set[int] = set()
    while at >= 0 and (moving := _moving(cycles[at][1])):
        moved.update(moving)
        at -= 1
    first = cycles[at + 1][0]
    while at > 0 and first - cycles[at][0] < _BEFORE and not _moving(cycles[at - 1][1]):
        at -= 1
    return _Section(cycles[max(at, 0)][0], end, [name for place, name in enumerate(names) if place in moved])


def _moving(samples: list[AxisSample]) -> list[int]:
    return [at for at, sample in enumerate(samples) if sample.state in MOVING]


def _title(recorded: Recorded) -> str:
    """Return the commands; if they are too long for a line, the names of the axes."""
    given = [event.where for event in recorded.events if event.sort == "command" and event.text == "given"]
    text = ", ".join(given)
    return text if 0 < len(text) <= 90 else f"the last motion of {', '.join(recorded.tracks)}"


# -- A plot of a recording in memory: a notebook shows it, and it can be saved -----------------------------------------


class RecordingPlot:
    """The plot of a recording; holds the recording, and the image."""

    def __init__(self, recorded: Recorded, title: str) -> None:
        """Plot ``recorded``; blocks meanwhile.

        Raises:
            UserError: matplotlib is not installed, or there is nothing to plot.
        """
        self.recorded = recorded
        self.title = title
        self._png = png(recorded, title)

    def __repr__(self) -> str:
        axes = counted(len(self.recorded.tracks), "axis", "axes")
        return f"<Picture of {axes}, {self.recorded.seconds:.2f} s: {self.title}>"

    def _repr_png_(self) -> bytes:
        """Return the image for a notebook."""
        return self._png

    def save(self, path: Path | str) -> Path:
        """Write the plot to ``path``, as .png or .svg, and return the path; the folder is made if needed. Blocks meanwhile.

        Raises:
            UserError: ``path`` has another suffix.
        """
        return plot(self.recorded, path, self.title)
