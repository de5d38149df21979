"""Fix the text of an EDS or DCF: only safe changes, each for the rule that was broken.

Theory of operation. A fix examines a reading and returns changes of lines. The fixes are grouped in stages, because an earlier fix
may remove or rename lines that a later one counts. Within a stage all fixes examine the same reading. If two fixes want to change
the same line, the later one waits for the next round. A stage ends when none of its fixes finds anything, and the whole process
ends when no stage does. Each fix removes the problem that it looks for, so that fixing a file twice changes nothing.

A fix is safe if ``axisbus`` reads the same contents afterwards, apart from counts, from values that were unreadable, and from
characters of names that are not ASCII. Comments stay. Problems that need the user's judgement are left to ``axisbus eds check``.
The fixes agree with the demands of ``check``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple

from axisbus.eds.fixes import counts, spelling, text, values
from axisbus.eds.fixes.base import Fix, FixContext, Mend
from axisbus.eds.io import edit, reader
from axisbus.eds.io.edit import LineEdit
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.io.text import EdsText

STAGES: tuple[Mapping[str, Mend], ...] = (
    {**text.MENDS, **spelling.MENDS, **values.MENDS, **values.NAMES, **text.NON_ASCII_MENDS},
    counts.NUMBERING,
    {**counts.MENDS, **values.DUMMY_USAGE_MENDS},
)
RULES = frozenset(
    (*text.WHOLE, *(rule for stage in STAGES for rule in stage), "B003", "L001", "O013", "O024")
)

_MAX_ROUNDS = 100  # far more than fixes that wait for each other can need


@dataclass(frozen=True, slots=True)
class Fixed:
    """A fixed reading, the fixes (with lines of the original), and the original's line number of each present line.

    ``origins`` is 0 for a line that is new or changed.
    """

    reading: EdsParseResult
    mended: tuple[Fix, ...]
    origins: tuple[int, ...]


def fix(reading: EdsParseResult) -> Fixed:
    """Return the reading with all safe fixes; pure, the given reading is not changed.

    Raises:
        EdsError: no object description is left, which should never happen to a file that was readable.
    """
    reading, done = _whole(reading)
    bench = FixContext(reading)
    origins = tuple(range(1, len(reading.document.lines) + 1))
    for _ in range(_MAX_ROUNDS):
        before = len(done)
        bench, done, origins = _stage(bench, STAGES[0], origins, done)
        if not _ends_early(bench.reading):  # the counts of a truncated file are not wrong
            for stage in STAGES[1:]:
                bench, done, origins = _stage(bench, stage, origins, done)
        if len(done) == before:
            break
    return Fixed(bench.reading, tuple(sorted(done, key=lambda mended: mended.line)), origins)


def _ends_early(reading: EdsParseResult) -> bool:
    from axisbus.eds.rules import context, truncated_file  # the rules take as long to import as the rest

    return truncated_file.ending(context.RuleContext(reading)) is not None


def _whole(reading: EdsParseResult) -> tuple[EdsParseResult, list[Fix]]:
    """Fix the encoding and the line ends."""
    done = []
    for rule, (mend, what) in text.WHOLE.items():
        document = mend(reading.document)
        if document is not None:
            reading = reader.read_document(document, reading.eds.source)
            done.append(Fix(rule, 1, what, ()))
    return reading, done


def _stage(
    bench: FixContext, stage: Mapping[str, Mend], origins: tuple[int, ...], before: list[Fix]
) -> tuple[FixContext, list[Fix], tuple[int, ...]]:
    """Run one stage to its end; return the fixed file, the fixes with those ``before``, and the original lines."""
    done = [*before]
    for _ in range(_MAX_ROUNDS):
        chosen = _chosen(bench, stage.values())
        if not chosen:
            break
        changes = [change for mended in chosen for change in mended.changes]
        known = tuple(accumulate(origins, lambda last, origin: origin or last, initial=1))
        done += [mended._replace(line=known[mended.line]) for mended in chosen]
        document = edit.apply(bench.document, changes)
        origins = _moved(origins, changes, document)
        bench = FixContext(reader.read_document(document, bench.reading.eds.source))
    return bench, done, origins


def _chosen(bench: FixContext, mends: Iterable[Mend]) -> list[Fix]:
    """Return the fixes, without those that touch a line of an earlier one."""
    taken: set[int] = set()
    chosen = []
    for mend in mends:
        for mended in mend(bench):
            lines = {change.line for change in mended.changes}
            if lines and taken.isdisjoint(lines):
                taken |= lines
                chosen.append(mended)
    return chosen


def _moved(origins: tuple[int, ...], changes: Iterable[LineEdit], document: EdsText) -> tuple[int, ...]:
    """Return the original's line number of each line after changes."""
    made: list[int] = []
    done = 0
    for change in sorted(changes, key=lambda change: (change.line, change.count > 0)):
        made += origins[done : change.line - 1]
        made += [0] * len(change.lines)
        done = change.line - 1 + change.count
    made += origins[done:]
    return tuple(made[: len(document.lines)])


# -- The changes of the fixes, as a unified diff ---------------------------------------------------------------------------------

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
    for each in edits:
        if hunk and each.old - hunk[-1].old_end > 2 * CONTEXT:
            yield hunk
            hunk = []
        hunk.append(each)
    if hunk:
        yield hunk


def _hunk(edits: list[_Edit], old: list[str], new: list[str]) -> Iterator[str]:
    lead = min(CONTEXT, edits[0].old)
    trail = min(CONTEXT, len(old) - edits[-1].old_end)
    start, end = edits[0].old - lead, edits[-1].old_end + trail
    first, last = edits[0].new - lead, edits[-1].new_end + trail
    yield f"@@ -{_span(start, end)} +{_span(first, last)} @@"
    at = start
    for each in edits:
        yield from (f" {line}" for line in old[at : each.old])
        yield from (f"-{line}" for line in old[each.old : each.old_end])
        yield from (f"+{line}" for line in new[each.new : each.new_end])
        at = each.old_end
    yield from (f" {line}" for line in old[at:end])


def _span(start: int, end: int) -> str:
    return f"{start + 1 if end > start else start},{end - start}"
