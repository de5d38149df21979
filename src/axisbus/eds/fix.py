"""Mending an EDS or DCF as text: only what is safe, and each change by the rule that it mends.

Theory of operation. A mend looks at a reading and names changes of lines. The mends stand in stages: what a later one counts, an
earlier one may have removed or renamed. Within a stage all mends look at the same reading; of two that want the same line the later
one waits for the next round. A stage ends when no mend of it finds anything, and the whole ends when no stage does. Every mend
takes away what it looks for, so that mending what was mended changes nothing.

Safe means: what the file says to ``axisbus`` stays the same, apart from counts, from values that could not be read at all, and from
letters of names that ASCII does not have. Comments stay. What needs a person's judgement is left to ``axisbus eds check``; what
``check`` asks for and what is mended agree.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import accumulate

from axisbus.eds.fixes import counts, dummy_usage, encoding, non_ascii, spelling, text, values
from axisbus.eds.fixes.base import Fix, FixContext, Mend
from axisbus.eds.io import edit, reader
from axisbus.eds.io.edit import LineEdit
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.io.text import EdsText

STAGES: tuple[Mapping[str, Mend], ...] = (
    {**text.MENDS, **spelling.MENDS, **values.MENDS, **dummy_usage.NAMES, **non_ascii.MENDS},
    counts.NUMBERING,
    {**counts.MENDS, **dummy_usage.MENDS},
)
RULES = frozenset(
    (*encoding.WHOLE, *(rule for stage in STAGES for rule in stage), "B003", "L001", "O013", "O024")
)

_MAX_ROUNDS = 100  # far more than mends that wait for each other can need


@dataclass(frozen=True, slots=True)
class Fixed:
    """A mended reading, what was mended (lines are those of the original), and the original's line of each line now.

    ``origins`` holds 0 for a line that is new or changed.
    """

    reading: EdsParseResult
    mended: tuple[Fix, ...]
    origins: tuple[int, ...]


def fix(reading: EdsParseResult) -> Fixed:
    """Return the reading with everything mended that safely can be; pure, the given one stays as it is.

    Raises:
        EdsError: nothing is left that describes an object, which no file that was read should come to.
    """
    reading, done = _whole(reading)
    bench = FixContext(reading)
    stages = (
        STAGES[:1] if _ends_early(reading) else STAGES
    )  # where the rest is missing, the counts are not wrong
    origins = tuple(range(1, len(reading.document.lines) + 1))
    for _ in range(_MAX_ROUNDS):
        before = len(done)
        for stage in stages:
            bench, more, origins = _stage(bench, stage, origins)
            done += more
        if len(done) == before:
            break
    return Fixed(bench.reading, tuple(sorted(done, key=lambda mended: mended.line)), origins)


def _ends_early(reading: EdsParseResult) -> bool:
    from axisbus.eds.rules import context, truncated_file  # the rules take as long to import as all the rest

    return truncated_file.ending(context.RuleContext(reading)) is not None


def _whole(reading: EdsParseResult) -> tuple[EdsParseResult, list[Fix]]:
    """Mend the encoding and the line ends."""
    done = []
    for rule, (mend, what) in encoding.WHOLE.items():
        document = mend(reading.document)
        if document is not None:
            reading = reader.read_document(document, reading.eds.source)
            done.append(Fix(rule, 1, what, ()))
    return reading, done


def _stage(
    bench: FixContext, stage: Mapping[str, Mend], origins: tuple[int, ...]
) -> tuple[FixContext, list[Fix], tuple[int, ...]]:
    done: list[Fix] = []
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
    """Return what the mends want, without what touches a line that an earlier one touches."""
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
    """Return the original's line of each line after changes were made."""
    made: list[int] = []
    done = 0
    for change in sorted(changes, key=lambda change: (change.line, change.count > 0)):
        made += origins[done : change.line - 1]
        made += [0] * len(change.lines)
        done = change.line - 1 + change.count
    made += origins[done:]
    return tuple(made[: len(document.lines)])
