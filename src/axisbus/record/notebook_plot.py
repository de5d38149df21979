"""A picture of a recording that is not a file yet: a notebook shows it, and it can be saved."""

from __future__ import annotations

from pathlib import Path

from axisbus.record.plot import plot, png
from axisbus.record.recording_data import Recorded
from axisbus.wording import counted


class RecordingPlot:
    """What a recording looks like; holds it, and the picture once it has been drawn."""

    def __init__(self, recorded: Recorded, title: str) -> None:
        """Draw ``recorded``; blocks for that.

        Raises:
            UserError: matplotlib is not installed, or there is nothing to draw.
        """
        self.recorded = recorded
        self.title = title
        self._png = png(recorded, title)

    def __repr__(self) -> str:
        axes = counted(len(self.recorded.tracks), "axis", "axes")
        return f"<Picture of {axes}, {self.recorded.seconds:.2f} s: {self.title}>"

    def _repr_png_(self) -> bytes:
        """Let a notebook show it."""
        return self._png

    def save(self, path: Path | str) -> Path:
        """Write it to ``path``, as .png or .svg, and return that; the folder is made if needed. Blocks for it.

        Raises:
            UserError: ``path`` is of another kind.
        """
        return plot(self.recorded, path, self.title)
