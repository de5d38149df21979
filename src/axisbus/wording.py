"""Words that messages share: a number with its noun, and a text with what it is about."""

from __future__ import annotations

import re
from collections.abc import Iterable


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
