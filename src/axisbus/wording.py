"""Words that messages share: a number with its noun."""

from __future__ import annotations


def counted(number: int, noun: str, several: str = "") -> str:
    """Return a number with its noun, which gets an s where there are several of it, unless ``several`` is given.

    A noun of several words is pluralised in its last one: ``counted(2, "SDO request")`` is "2 SDO requests".
    """
    return f"{number} {noun}" if number == 1 else f"{number} {several or noun + 's'}"
