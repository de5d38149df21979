"""Words that messages share: a number with its noun, and a text with what it is about."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable

# What a terminal acts upon: control characters (C0 without tab and line feed, DEL, C1), and what turns the direction of text.
_ACTED_UPON = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


def printable(text: str) -> str:
    """Return a text that only prints on a terminal: names of devices and files come from outside and may hold anything.

    Control characters become escapes as JSON has them; line feeds and tabs stay.
    """
    return _ACTED_UPON.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


class PrintableFormatter(logging.Formatter):
    """Formats what is logged as text that only prints."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the lines of a record."""
        return printable(super().format(record))


def counted(number: int, noun: str, several: str = "") -> str:
    """Return a number with its noun, which gets an s where there are several of it, unless ``several`` is given.

    A noun of several words is pluralised in its last one: ``counted(2, "SDO request")`` is "2 SDO requests".
    """
    return f"{number} {noun}" if number == 1 else f"{number} {several or noun + 's'}"


def with_subject(about: str, text: str) -> str:
    """Return a text behind what it is about, unless it begins with that: "x: it stands", but "x.enable(): done"."""
    if not about or re.match(rf"{re.escape(about)}(?![\w-])", text):
        return text
    return f"{about}: {text}"


def listed(names: Iterable[str]) -> str:
    """Return names as they are said one after the other: "x, y and z"."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
