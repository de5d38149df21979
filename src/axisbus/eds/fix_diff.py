"""The changes of the fixes, as a unified diff."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from axisbus.eds.fix import Fixed
from axisbus.eds.io.text import EdsText

CONTEXT = 3  # unchanged lines shown around a change


class _Edit(NamedTuple):
    """Lines ``old`` to ``old_end`` of the original became ``new`` to ``new_end`` (from 0, ends excluded)."""

    old: int
    old_end: int
    new: int
    new_end: int


def unified(before: EdsText, fixed: Fixed, name: str) -> Iterator[str]:
    """Yield the lines of a unified diff without line ends; nothing if no line changed."""
    old = [line.removesuffix("\r") for line in before.lines]
    new = [line.removesuffix("\r") for line in fixed.reading.document.lines]
    edits = _edits(fixed.origins, len(old))
    if edits:
        yield f"--- {name}"
        yield f"+++ {name} (mended)"
    for hunk in _hunks(edits):
        yield from _hunk(hunk, old, new)


def _edits(origins: tuple[int, ...], length: int) -> list[_Edit]:
    """Return the changes, in order; neighbouring changes are combined."""
    edits = []
    at_old = at_new = 0
    for number, origin in enumerate((*origins, length + 1)):
        if origin == 0:
            continue
        if origin - 1 > at_old or number > at_new:
            edits.append(_Edit(at_old, origin - 1, at_new, number))
        at_old, at_new = origin, number + 1
    return edits


def _hunks(edits: list[_Edit]) -> Iterator[list[_Edit]]:
    """Group edits whose context lines would touch."""
    hunk: list[_Edit] = []
    for edit in edits:
        if hunk and edit.old - hunk[-1].old_end > 2 * CONTEXT:
            yield hunk
            hunk = []
        hunk.append(edit)
    if hunk:
        yield hunk


def _hunk(edits: list[_Edit], old: list[str], new: list[str]) -> Iterator[str]:
    lead = min(CONTEXT, edits[0].old)
    trail = min(CONTEXT, len(old) - edits[-1].old_end)
    start, end = edits[0].old - lead, edits[-1].old_end + trail
    first, last = edits[0].new - lead, edits[-1].new_end + trail
    yield f"@@ -{_span(start, end)} +{_span(first, last)} @@"
    at = start
    for edit in edits:
        yield from (f" {line}" for line in old[at : edit.old])
        yield from (f"-{line}" for line in old[edit.old : edit.old_end])
        yield from (f"+{line}" for line in new[edit.new : edit.new_end])
        at = edit.old_end
    yield from (f" {line}" for line in old[at:end])


def _span(start: int, end: int) -> str:
    return f"{start + 1 if end > start else start},{end - start}"
