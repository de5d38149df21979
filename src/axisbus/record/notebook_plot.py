"""A plot of a recording in memory: a notebook shows it, and it can be saved."""

from __future__ import annotations

from pathlib import Path

from axisbus.record.plot import plot, png
from axisbus.record.recording_data import Recorded
from axisbus.wording import counted


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
