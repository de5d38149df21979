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
from axisbus.eds.fixes.base import Fix, FixContext, FixFunction
from axisbus.eds.io import edit, reader
from axisbus.eds.io.edit import LineEdit
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.io.text import EdsText

STAGES: tuple[Mapping[str, FixFunction], ...] = (
    {**text.FIXES, **spelling.FIXES, **values.FIXES, **values.NAMES, **text.NON_ASCII_FIXES},
    counts.NUMBERING,
    {**counts.FIXES, **values.DUMMY_USAGE_FIXES},
)
RULES = frozenset(
    (*text.WHOLE_FILE, *(rule for stage in STAGES for rule in stage), "B003", "L001", "O013", "O024")
)

_MAX_ROUNDS = 100  # far more than fixes that wait for each other can need


@dataclass(frozen=True, slots=True)
class Fixed:
    """A fixed reading, the fixes (with lines of the original), and the original's line number of each present line.

    ``origins`` is 0 for a line that is new or changed.
    """

    reading: EdsParseResult
    fixes: tuple[Fix, ...]
    origins: tuple[int, ...]


def fix(reading: EdsParseResult) -> Fixed:
    """Return the reading with all safe fixes; pure, the given reading is not changed.

    Raises:
        EdsError: no object description is left, which should never happen to a file that was readable.
    """
    reading, fixes = _whole(reading)
    context = FixContext(reading)
    origins = tuple(range(1, len(reading.document.lines) + 1))
    for _ in range(_MAX_ROUNDS):
        before = len(fixes)
        context, fixes, origins = _stage(context, STAGES[0], origins, fixes)
        if not _ends_early(context.reading):  # the counts of a truncated file are not wrong
            for stage in STAGES[1:]:
                context, fixes, origins = _stage(context, stage, origins, fixes)
        if len(fixes) == before:
            break
    return Fixed(context.reading, tuple(sorted(fixes, key=lambda one_fix: one_fix.line)), origins)


def _ends_early(reading: EdsParseResult) -> bool:
    from axisbus.eds.rules import context, truncated_file  # the rules take as long to import as the rest

    return truncated_file.ending(context.RuleContext(reading)) is not None


def _whole(reading: EdsParseResult) -> tuple[EdsParseResult, list[Fix]]:
    """Fix the encoding and the line ends."""
    fixes = []
    for rule, (fix_function, what) in text.WHOLE_FILE.items():
        document = fix_function(reading.document)
        if document is not None:
            reading = reader.read_document(document, reading.eds.source)
            fixes.append(Fix(rule, 1, what, ()))
    return reading, fixes


def _stage(
    context: FixContext, stage: Mapping[str, FixFunction], origins: tuple[int, ...], before: list[Fix]
) -> tuple[FixContext, list[Fix], tuple[int, ...]]:
    """Run one stage to its end; return the fixed file, the fixes with those ``before``, and the original lines."""
    fixes = [*before]
    for _ in range(_MAX_ROUNDS):
        chosen = _chosen(context, stage.values())
        if not chosen:
            break
        changes = [change for one_fix in chosen for change in one_fix.changes]
        known = tuple(accumulate(origins, lambda last, origin: origin or last, initial=1))
        fixes += [one_fix._replace(line=known[one_fix.line]) for one_fix in chosen]
        document = edit.apply(context.document, changes)
        origins = _moved(origins, changes, document)
        context = FixContext(reader.read_document(document, context.reading.eds.source))
    return context, fixes, origins


def _chosen(context: FixContext, functions: Iterable[FixFunction]) -> list[Fix]:
    """Return the fixes, without those that touch a line of an earlier one."""
    touched: set[int] = set()
    chosen = []
    for fix_function in functions:
        for one_fix in fix_function(context):
            lines = {change.line for change in one_fix.changes}
            if lines and touched.isdisjoint(lines):
                touched |= lines
                chosen.append(one_fix)
    return chosen


def _moved(origins: tuple[int, ...], changes: Iterable[LineEdit], document: EdsText) -> tuple[int, ...]:
    """Return the original's line number of each line after changes."""
    origins_after: list[int] = []
    done = 0
    for change in sorted(changes, key=lambda change: (change.line, change.count > 0)):
        origins_after += origins[done : change.line - 1]
        origins_after += [0] * len(change.lines)
        done = change.line - 1 + change.count
    origins_after += origins[done:]
    return tuple(origins_after[: len(document.lines)])


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
    leading = min(CONTEXT, edits[0].old)
    trail = min(CONTEXT, len(old) - edits[-1].old_end)
    start, end = edits[0].old - leading, edits[-1].old_end + trail
    first, last = edits[0].new - leading, edits[-1].new_end + trail
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
