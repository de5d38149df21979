"""The regularity of a cycle as a plot (needs the ``plot`` extra): one histogram for each measured value."""

from __future__ import annotations

from pathlib import Path

from axisbus.record.plot import load_pyplot
from axisbus.trace.cycle_timing import MEASURED, CycleTiming, spread
from axisbus.wording import counted

_BINS = 60
_US = 1e6
_COLOUR, _MARK = "#1f6fb4", "#c8553d"


def draw(pace: CycleTiming, path: Path, name: str) -> None:
    """Plot the measurements as a PNG or SVG; raises UserError if matplotlib is not installed. Blocks meanwhile."""
    pyplot = load_pyplot()
    figure, panels = pyplot.subplots(2, 2, figsize=(11, 6), layout="constrained")
    for panel, (what, words) in zip(panels.flat, MEASURED.items(), strict=True):
        values = [value * _US for value in getattr(pace, what)]
        panel.set_xlabel(f"{words}, µs")
        panel.set_ylabel("cycles")
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
        found = spread(values)
        if found is None:
            panel.text(0.5, 0.5, "none was seen", ha="center", transform=panel.transAxes)
            continue
        panel.hist(values, bins=_BINS, color=_COLOUR, log=True)
        panel.axvline(
            found.p99, color=_MARK, linewidth=1.2, linestyle="--", label=f"99 % up to {found.p99:.0f} µs"
        )
        panel.legend(frameon=False, loc="upper right")
    figure.suptitle(
        f"{name}: {counted(pace.cycles, 'cycle')} of {pace.period * 1000:g} ms, {pace.missing} missing"
    )
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
