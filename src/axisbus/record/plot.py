"""A picture of a recording: position and target, velocity and state of each axis over time (needs the ``plot`` extra)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from axisbus.errors import UserError
from axisbus.record.recorder import Recorder

_STATE_COLOURS = {
    "Disabled": "#d9d9d9",
    "Standstill": "#e8f1e4",
    "Homing": "#fbe3b5",
    "Stopping": "#f3c3a0",
    "DiscreteMotion": "#cfe3f5",
    "ContinuousMotion": "#c7d7f0",
    "SynchronizedMotion": "#dccdf0",
    "ErrorStop": "#f5b5b5",
}
_LINES = ("#1f6fb4", "#c8553d", "#3a7d44", "#7a4fa3", "#8a6d1d", "#1d7f86")


def plot(recorder: Recorder, path: Path | str, title: str = "") -> Path:
    """Draw the recording as a PNG at ``path`` and return it; the folder is made if needed.

    Raises:
        UserError: matplotlib is not installed, or nothing was recorded.
    """
    pyplot = _pyplot()
    rows = list(recorder.rows())
    if not rows:
        raise UserError("nothing was recorded, so there is nothing to draw")
    figure, panels = pyplot.subplots(
        2 * len(recorder.axes), 1, sharex=True, figsize=(11, 2.6 * len(recorder.axes) + 1.2),
        gridspec_kw={"height_ratios": [3, 1.3] * len(recorder.axes), "hspace": 0.18},
    )  # fmt: skip
    figure.suptitle(title, fontsize=12, x=0.125, y=0.935, ha="left")
    figure.subplots_adjust(top=0.9)
    columns = list(zip(*rows, strict=True))
    for number, axis in enumerate(recorder.axes):
        values = [columns[0], *columns[1 + 5 * number : 6 + 5 * number]]
        colour = _LINES[number % len(_LINES)]
        _draw_axis(panels[2 * number], panels[2 * number + 1], axis, recorder.unit(axis), values, colour)
    panels[-1].set_xlabel("time in s")
    _legend_of_states(figure, pyplot, {state for column in columns[5::5] for state in column})
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110, bbox_inches="tight")
    pyplot.close(figure)
    return path


def _pyplot() -> Any:
    try:
        import matplotlib
    except ImportError:
        raise UserError(
            "drawing needs matplotlib, which is not installed", remedy="pip install 'axisbus[plot]'"
        ) from None
    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def _draw_axis(upper: Any, lower: Any, axis: str, unit: str, values: list[Any], colour: str) -> None:
    time, position, velocity, _, target, state = values
    _shade_states((upper, lower), time, state)
    upper.step(
        time, _gaps(target), where="post", color="#555555", linewidth=0.9, linestyle="--", label="commanded"
    )
    upper.plot(time, _gaps(position), color=colour, linewidth=1.5, label="actual")
    upper.set_ylabel(f"{axis}\n{unit}")
    upper.legend(loc="upper right", fontsize=8, frameon=False, ncols=2)
    lower.plot(time, _gaps(velocity), color=colour, linewidth=1.0)
    lower.set_ylabel(f"{unit}/s", fontsize=8)
    for panel in (upper, lower):
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(labelsize=8)
        panel.margins(x=0)


def _gaps(values: Any) -> list[float]:
    return [float("nan") if value is None else value for value in values]


def _shade_states(panels: Any, time: Any, states: Any) -> None:
    start = 0
    for index in range(1, len(states) + 1):
        if index == len(states) or states[index] != states[start]:
            end = time[min(index, len(time) - 1)]
            for panel in panels:
                panel.axvspan(
                    time[start], end, color=_STATE_COLOURS.get(states[start], "#ffffff"), linewidth=0
                )
            start = index


def _legend_of_states(figure: Any, pyplot: Any, states: set[str]) -> None:
    patches = [
        pyplot.Rectangle((0, 0), 1, 1, color=colour, label=state)
        for state, colour in _STATE_COLOURS.items()
        if state in states
    ]
    figure.legend(
        handles=patches,
        loc="lower center",
        bbox_to_anchor=(0.5, 0.02),
        ncols=len(patches),
        fontsize=8,
        frameon=False,
    )
