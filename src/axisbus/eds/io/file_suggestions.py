"""Which files of a folder may have been meant by a name that is not there."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches
from pathlib import Path


def files_near(folder: Path, name: str, belongs: Callable[[Path], bool]) -> str:
    """Return a sentence with the files of ``folder`` that belong, those with the nearest names alone if there are any; or empty."""
    try:
        there = sorted(entry.name for entry in folder.iterdir() if belongs(entry))
    except OSError:
        return "" if folder.exists() else f"there is no folder {folder}"
    near = get_close_matches(name, there, n=3, cutoff=0.4) or there[:5]
    return f"in {folder} there is: {', '.join(near)}" if near else ""
