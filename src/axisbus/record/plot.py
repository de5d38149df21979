"""Plot a recording (needs the ``plot`` extra): the values and states of each axis, and the events with texts."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from axisbus.errors import UserError
from axisbus.record.load import load
from axisbus.record.recorder import Recorder
from axisbus.record.recording_data import Recorded, RecordedEvent, RecordedSeries
from axisbus.wording import counted

STATE_COLOURS = {
    "Disabled": "#d9d9d9",
    "Standstill": "#cfe6c5",
    "Homing": "#fbdb9c",
    "Stopping": "#f0a878",
    "DiscreteMotion": "#a9cdee",
    "ContinuousMotion": "#93b1e0",
    "SynchronizedMotion": "#c3a9e6",
    "ErrorStop": "#ec7f7f",
}
_LINES = ("#1f6fb4", "#c8553d", "#3a7d44", "#7a4fa3", "#8a6d1d", "#1d7f86")
_COMMANDED = "#555555"
_SUFFIXES = (".png", ".svg")
_WIDTH = 11.0  # inches
_DOTS = 110  # of an inch
_LEFT, _RIGHT = 0.1, 0.985  # of the width
_POINTS = 4000  # the most points of a line; of longer ones, the minimum and maximum of each section are drawn


class _Panel(NamedTuple):
    """One panel of an axis: its height in inches, and the columns that it draws."""

    height: float
    columns: tuple[str, ...]
    label: str


_PANELS = (
    _Panel(1.9, ("demand", "target", "position"), "position"),
    _Panel(0.95, ("velocity",), "velocity"),
    _Panel(0.95, ("torque",), "torque"),
    _Panel(0.95, ("following_error",), "following\nerror"),
)
_BAND, _FLAGS, _GAP, _BETWEEN, _LINE = 0.16, 0.28, 0.09, 0.34, 0.155  # inches


def require_picture(path: Path) -> None:
    """Raise UserError if the suffix of ``path`` is not that of a supported image format."""
    if path.suffix.lower() not in _SUFFIXES:
        raise UserError(
            f"{path} is not a picture that can be drawn", remedy=f"end its name in {' or '.join(_SUFFIXES)}"
        )


def plot(
    recording: Recorder | Recorded | Path | str,
    path: Path | str,
    title: str = "",
    *,
    begin: float = -math.inf,
    end: float = math.inf,
) -> Path:
    """Plot a recording or an MCAP file as a PNG or SVG at ``path`` and return the path; the folder is made if needed. Blocks.

    ``begin`` and ``end``: the shown range, in seconds from the begin of the recording.

    Raises:
        UserError: matplotlib is not installed, nothing was recorded (in this range), or ``path`` has another suffix.
    """
    path = Path(path)
    require_picture(path)
    figure = _figure(recording, title, begin, end)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=_DOTS)
    return path


def png(recording: Recorder | Recorded | Path | str, title: str = "") -> bytes:
    """Return the same plot as a PNG. Blocks; raises as ``plot``."""
    file = BytesIO()
    _figure(recording, title, -math.inf, math.inf).savefig(file, format="png", dpi=_DOTS)
    return file.getvalue()


def _figure(recording: Recorder | Recorded | Path | str, title: str, begin: float, end: float) -> Any:
    make = _maker()
    shown = _recorded(recording).within(begin, end)
    if not any(track.times for track in shown.tracks.values()):
        raise UserError("nothing was recorded, so there is nothing to draw")
    return _Figure(make, shown, title).drawn()


def _recorded(recording: Recorder | Recorded | Path | str) -> Recorded:
    if isinstance(recording, Recorder):
        return recording.recorded()
    return recording if isinstance(recording, Recorded) else load(recording)


def _maker() -> Any:
    """Return matplotlib's own Figure class, which does not affect the figures of the program."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise _missing() from None
    return Figure


def load_pyplot() -> Any:
    """Return matplotlib's pyplot with a backend that needs no screen; raises UserError if it is not installed."""
    try:
        import matplotlib
    except ImportError:
        raise _missing() from None
    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def _missing() -> UserError:
    return UserError("drawing needs matplotlib, which is not installed", remedy='pip install "axisbus[plot]"')


class _Figure:
    """One plot under construction: its panels from the top down, measured in inches; holds the present height."""

    def __init__(self, make: Any, shown: Recorded, title: str) -> None:
        self._tracks = [track for track in shown.tracks.values() if track.times]
        times = [time for track in self._tracks for time in (track.times[0], track.times[-1])]
        self._span = min(times), max(max(times), min(times) + 1e-3)
        self._flags = flags(shown.events, *self._span)
        self._lines = lines(self._flags)
        self._panels = [_panels_of(track) for track in self._tracks]
        self._states = {state for track in self._tracks for state in track.columns["state"]}
        self._height = self._needed(bool(title) + bool(shown.lacks))
        self._figure = make(figsize=(_WIDTH, self._height))
        self._top = 0.12
        for text, size, colour in ((title, 12, "black"), (shown.lacks, 8, "#b02020")):
            if text:
                self._text(text, size, colour)
                self._top += 0.26

    def _needed(self, heads: int) -> float:
        axes = sum(
            _BAND + _GAP + sum(panel.height + _GAP for panel in panels) + _BETWEEN for panels in self._panels
        )
        texts = _LINE * (len(self._lines) + 1) if self._lines else 0.0
        return 0.2 + 0.26 * heads + (_FLAGS if self._flags else 0.0) + axes + 0.5 + texts

    def drawn(self) -> Any:
        """Draw everything and return the figure."""
        if self._flags:
            self._draw_flags(self._place(_FLAGS))
        for number, (track, panels) in enumerate(zip(self._tracks, self._panels, strict=True)):
            self._draw_axis(track, panels, _LINES[number % len(_LINES)])
        self._top += 0.02
        self._legend()
        self._top += 0.42
        for line in self._lines:
            self._text(line, 7.5, "#222222", mono=True)
            self._top += _LINE
        return self._figure

    def _place(self, height: float) -> Any:
        """Return axes of this height in inches below the present content."""
        bottom = 1.0 - (self._top + height) / self._height
        axes = self._figure.add_axes((_LEFT, bottom, _RIGHT - _LEFT, height / self._height))
        axes.set_xlim(*self._span)
        self._top += height + _GAP
        return axes

    def _text(self, text: str, size: float, colour: str, *, mono: bool = False) -> None:
        self._figure.text(
            _LEFT if not mono else 0.012,
            1.0 - self._top / self._height,
            text,
            fontsize=size,
            color=colour,
            va="top",
            ha="left",
            family="monospace" if mono else None,
            parse_math=False,
        )

    def _draw_axis(self, track: RecordedSeries, panels: Sequence[_Panel], colour: str) -> None:
        band = self._place(_BAND)
        _draw_band(band, track, track.name)
        drawn = [self._place(panel.height) for panel in panels]
        for axes, panel in zip(drawn, panels, strict=True):
            _draw_panel(axes, panel, track, colour)
            for flag in self._flags:
                axes.axvline(flag.time, color="#999999", linewidth=0.5, linestyle=":")
        for axes in drawn[:-1]:
            axes.tick_params(labelbottom=False)
        if drawn:
            drawn[-1].set_xlabel("time in s", fontsize=8, labelpad=1)
        self._top += _BETWEEN - _GAP / 2

    def _draw_flags(self, axes: Any) -> None:
        axes.set_axis_off()
        axes.set_ylim(0, 1)
        for flag in self._flags:
            _draw_flag(axes, flag)

    def _legend(self) -> None:
        from matplotlib.patches import Patch

        patches = [
            Patch(color=colour, label=state)
            for state, colour in STATE_COLOURS.items()
            if state in self._states
        ]
        self._figure.legend(
            handles=patches,
            loc="upper left",
            bbox_to_anchor=(_LEFT - 0.006, 1.0 - self._top / self._height),
            ncols=len(patches),
            fontsize=8,
            frameon=False,
            borderaxespad=0.0,
            columnspacing=1.4,
            handlelength=1.2,
        )


def _panels_of(track: RecordedSeries) -> list[_Panel]:
    """Return the panels that have data; the position panel is always included."""
    return [
        panel
        for panel in _PANELS
        if panel is _PANELS[0] or any(not math.isnan(value) for value in track.columns[panel.columns[0]])
    ]


def _draw_panel(axes: Any, panel: _Panel, track: RecordedSeries, colour: str) -> None:
    name = panel.columns[-1]
    if name == "position":
        commanded, label = _commanded(track)
        axes.step(
            *_thinned(track.times, commanded),
            where="post",
            color=_COMMANDED,
            linewidth=0.9,
            linestyle="--",
            label=label,
        )
    axes.plot(*_thinned(track.times, track.columns[name]), color=colour, linewidth=1.4 if name == "position" else 1.0,
              label="actual")  # fmt: skip
    if name == "position":
        axes.legend(loc="upper right", fontsize=7.5, frameon=True, framealpha=0.7, edgecolor="none", ncols=2)
    axes.set_ylabel(f"{panel.label}\n{track.units[name]}", fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=7.5)
    axes.margins(y=0.12)
    if name == "position":  # room for the legend
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.22 * (high - low))
    axes.locator_params(axis="y", nbins=6 if name == "position" else 3)
    axes.yaxis.set_label_coords(-0.055, 0.5)


def _commanded(track: RecordedSeries) -> tuple[Sequence[float], str]:
    """Return the commanded values of the axis, and their label: the drive's own demand, if it reports one."""
    demand = track.columns["demand"]
    if any(not math.isnan(value) for value in demand):
        return demand, "commanded (demand of the drive)"
    return track.columns["target"], "commanded (target)"


def _draw_band(axes: Any, track: RecordedSeries, name: str) -> None:
    axes.set_ylim(0, 1)
    axes.set_yticks([])
    axes.tick_params(bottom=False, labelbottom=False)
    axes.spines[:].set_visible(False)
    axes.text(-0.008, 0.5, name, transform=axes.transAxes, ha="right", va="center", fontsize=11, fontweight="bold",
              parse_math=False)  # fmt: skip
    for begin, end, state in _runs(track):
        axes.axvspan(begin, end, color=STATE_COLOURS.get(state, "#ffffff"), linewidth=0)


def _runs(track: RecordedSeries) -> Iterator[tuple[float, float, str]]:
    times, states = track.times, track.columns["state"]
    start = 0
    for index in range(1, len(states) + 1):
        if index == len(states) or states[index] != states[start]:
            yield times[start], times[min(index, len(times) - 1)], states[start]
            start = index


def _draw_flag(axes: Any, flag: Flag) -> None:
    axes.text(
        flag.time,
        0.35,
        str(flag.number),
        fontsize=7,
        ha="center",
        va="center",
        bbox={"boxstyle": "round,pad=0.18", "facecolor": "#fff6d6", "edgecolor": "#999999", "linewidth": 0.6},
    )


def _thinned(times: Sequence[float], values: Sequence[float]) -> tuple[Sequence[float], Sequence[float]]:
    """Return a line with a limited number of points: the minimum and maximum of each section, in their order."""
    size = len(times) // (_POINTS // 2)
    if size < 2:
        return times, values
    kept: list[int] = []
    for start in range(0, len(times), size):
        piece = range(start, min(start + size, len(times)))
        known = [index for index in piece if not math.isnan(values[index])] or [start]
        kept += sorted({min(known, key=values.__getitem__), max(known, key=values.__getitem__)})
    return [times[index] for index in kept], [values[index] for index in kept]


# -- Events of a recording as a limited number of numbered flags, with texts that fit below a diagram ------------------


_NEAR = 0.012  # fraction of the shown time: closer flags are merged
_MOST = 28  # the most lines of text
_ANNOTATIONS_WIDTH = 150  # characters of a line
_HIDDEN_TEXTS = ("done", "given")


class Flag(NamedTuple):
    """A flag at ``time`` (s) with its number and its texts, one line each."""

    number: int
    time: float
    texts: list[str]


def flags(events: Sequence[RecordedEvent], begin: float, end: float) -> list[Flag]:
    """Return the flags for the events between two times."""
    found: list[Flag] = []
    for time, texts in _event_texts(sorted(events)):
        if not begin <= time <= end:
            continue
        if found and time - found[-1].time < _NEAR * (end - begin):
            found[-1].texts.extend(texts)
        else:
            found.append(Flag(len(found) + 1, time, texts))
    return found


def lines(found: Sequence[Flag]) -> list[str]:
    """Return the texts of flags, one line each; if there are too many, the last ones are only counted."""
    texts: list[str] = []
    for flag in found:
        head = f"{flag.number:>3}  {flag.time:8.3f} s  "
        for text in flag.texts:
            texts.append(head + textwrap.shorten(text, _ANNOTATIONS_WIDTH, placeholder=" …"))
            head = " " * len(head)
    more = len(texts) - _MOST
    return texts if more <= 0 else [*texts[:_MOST], f"     and {counted(more, 'more line')}"]


def _event_texts(events: Sequence[RecordedEvent]) -> Iterator[tuple[float, list[str]]]:
    """Yield times with texts: a command when it is given, and its end only if it was not the normal one."""
    commands: list[str] = []
    since = 0.0
    for event in events:
        given = event.sort == "command" and event.text == "given"
        if commands and not (given and event.time - since < 0.05):
            yield since, [", ".join(commands)]
            commands = []
        if given:
            since = since if commands else event.time
            commands.append(event.where)
        elif event.text not in _HIDDEN_TEXTS:
            yield event.time, [f"{event.where}: {event.text}" if event.where else event.text]
    if commands:
        yield since, [", ".join(commands)]
