"""Helpers for messages: a number with its noun, a text with its subject, and files with similar names."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

# Characters that control a terminal: C0 without tab and line feed, DEL, C1, and those that change the text direction.
_ACTED_UPON = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


def printable(text: str) -> str:
    """Return a text that is safe to print on a terminal: names of devices and files come from outside and may contain anything.

    Control characters become escapes as in JSON; line feeds and tabs stay.
    """
    return _ACTED_UPON.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


class PrintableFormatter(logging.Formatter):
    """Formats log records as text that is safe to print."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the lines of a record."""
        return printable(super().format(record))


def counted(number: int, noun: str, several: str = "") -> str:
    """Return a number with its noun; the plural is the noun with an s, unless ``several`` is given.

    In a noun of several words the last one gets the s: ``counted(2, "SDO request")`` is "2 SDO requests".
    """
    return f"{number} {noun}" if number == 1 else f"{number} {several or noun + 's'}"


def age_text(seconds: float) -> str:
    """Return the age of a value in words: milliseconds below a second."""
    return f"{seconds * 1000:.0f} ms" if seconds < 1.0 else f"{seconds:.1f} s"


def with_subject(about: str, text: str) -> str:
    """Return a text after its subject, unless it begins with the subject: "x: it stands", but "x.enable(): done"."""
    if not about or re.match(rf"{re.escape(about)}(?![\w-])", text):
        return text
    return f"{about}: {text}"


def listed(names: Iterable[str]) -> str:
    """Return names as an enumeration: "x, y and z"."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def first_of(texts: Sequence[str], most: int) -> str:
    """Return at most ``most`` texts, and the number of the others: "x; y; and 3 more"."""
    rest = f"; and {len(texts) - most} more" if len(texts) > most else ""
    return "; ".join(texts[:most]) + rest


def files_near(folder: Path, name: str, belongs: Callable[[Path], bool]) -> str:
    """Return a sentence with the most similar names of suitable files in ``folder``, or with its first five files; or empty."""
    from difflib import get_close_matches

    try:
        there = sorted(entry.name for entry in folder.iterdir() if belongs(entry))
    except OSError:
        return "" if folder.exists() else f"there is no folder {folder}"
    near = get_close_matches(name, there, n=3, cutoff=0.4) or there[:5]
    return f"in {folder} there is: {', '.join(near)}" if near else ""
