"""Suggest files of a folder with names similar to a missing one."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches
from pathlib import Path


def files_near(folder: Path, name: str, belongs: Callable[[Path], bool]) -> str:
    """Return a sentence with the most similar names of suitable files in ``folder``, or with its first five files; or empty."""
    try:
        there = sorted(entry.name for entry in folder.iterdir() if belongs(entry))
    except OSError:
        return "" if folder.exists() else f"there is no folder {folder}"
    near = get_close_matches(name, there, n=3, cutoff=0.4) or there[:5]
    return f"in {folder} there is: {', '.join(near)}" if near else ""
