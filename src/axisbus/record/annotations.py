"""Events of a recording as a limited number of numbered flags, with texts that fit below a diagram."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from axisbus.record.recording_data import RecordedEvent
from axisbus.wording import counted

_NEAR = 0.012  # fraction of the shown time: closer flags are merged
_MOST = 28  # the most lines of text
_WIDTH = 150  # characters of a line
_UNTOLD = ("done", "given")


class Flag(NamedTuple):
    """A flag at ``time`` (s) with its number and its texts, one line each."""

    number: int
    time: float
    words: list[str]


def flags(events: Sequence[RecordedEvent], begin: float, end: float) -> list[Flag]:
    """Return the flags for the events between two times."""
    found: list[Flag] = []
    for time, words in _told(sorted(events)):
        if not begin <= time <= end:
            continue
        if found and time - found[-1].time < _NEAR * (end - begin):
            found[-1].words.extend(words)
        else:
            found.append(Flag(len(found) + 1, time, words))
    return found


def lines(found: Sequence[Flag]) -> list[str]:
    """Return the texts of flags, one line each; if there are too many, the last ones are only counted."""
    told: list[str] = []
    for flag in found:
        head = f"{flag.number:>3}  {flag.time:8.3f} s  "
        for text in flag.words:
            told.append(head + textwrap.shorten(text, _WIDTH, placeholder=" …"))
            head = " " * len(head)
    more = len(told) - _MOST
    return told if more <= 0 else [*told[:_MOST], f"     and {counted(more, 'more line')}"]


def _told(events: Sequence[RecordedEvent]) -> Iterator[tuple[float, list[str]]]:
    """Yield times with texts: a command when it is given, and its end only if it was not the normal one."""
    together: list[str] = []
    since = 0.0
    for event in events:
        given = event.sort == "command" and event.text == "given"
        if together and not (given and event.time - since < 0.05):
            yield since, [", ".join(together)]
            together = []
        if given:
            since = since if together else event.time
            together.append(event.where)
        elif event.text not in _UNTOLD:
            yield event.time, [f"{event.where}: {event.text}" if event.where else event.text]
    if together:
        yield since, [", ".join(together)]
