"""Read a recording for a command, with a progress line and a remark if it is incomplete."""

from __future__ import annotations

from pathlib import Path

from axisbus.cli.shared.common import echo, progress_bar
from axisbus.record.load import load
from axisbus.record.recording_data import Recorded


def read(path: Path) -> Recorded:
    """Return the recording; report if it is incomplete. Raises as ``mcap_reader.load``."""
    with progress_bar(f"reading {path}") as tell:
        recorded = load(path, None if tell is None else lambda part: tell(round(part * 1000), 1000))
    if recorded.lacks:
        echo(f"{path}: {recorded.lacks}", err=True)
    return recorded
