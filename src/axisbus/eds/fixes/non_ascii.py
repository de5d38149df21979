"""Fixes of non-ASCII characters in names and comments (DS 306 4.2), if there is an ASCII spelling."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping
from functools import cache

from axisbus.eds.fixes.base import Fix, FixContext, Mend, short
from axisbus.eds.io.edit import LineEdit
from axisbus.eds.io.text import EdsText, entry_of
from axisbus.wording import counted

MAX_LINE = 255  # DS 306 4.2

# Texts for readers only, which no tool compares with the device; values are not changed.
_NAMES = re.compile(
    "parametername|denotation|description|createdby|modifiedby|vendorname|productname|line[0-9]+"
)

_PLAIN: Mapping[str, str] = {
    "ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss", "æ": "ae", "Æ": "Ae",
    "ø": "oe", "Ø": "Oe", "å": "aa", "Å": "Aa", "œ": "oe", "ł": "l", "Ł": "L", "đ": "d", "ı": "i",
    "µ": "u", "\u03bc": "u", "Ω": "Ohm", "°": "deg", "‰": "per mille", "€": "EUR", "£": "GBP",
    "¹": "1", "²": "2", "³": "3", "¼": "1/4", "½": "1/2", "¾": "3/4", "±": "+/-", "÷": "/",
    "\u00d7": "x", "\u00b7": "*", "\u2022": "*", "\u2026": "...", "\u00a0": " ", "\u00ad": "",
    "\u2010": "-", "\u2011": "-", "\u2012": "-", "\u2013": "-", "\u2014": "-", "\u2212": "-",
    "\u2018": "'", "\u2019": "'", "\u201a": "'", "\u00b4": "'", "\u201c": '"', "\u201d": '"', "\u201e": '"',
    "≤": "<=", "≥": ">=", "≠": "!=", "→": "->", "←": "<-", "©": "(C)", "®": "(R)", "™": "(TM)",
}  # fmt: skip

_TABLE = str.maketrans(dict(_PLAIN))
# Code pages that the file may use instead of the key's: nothing in a file identifies them.
_ALSO: Mapping[str, tuple[str, ...]] = {
    "cp1252": ("cp1250", "cp1254", "cp1257"),
    "cp850": ("cp437", "cp852"),
    "latin-1": (),
}
_SQUARE = "²"  # CP1250 has the ogonek here, which never occurs alone
_WORD = re.compile(r"[^\W\d_]+")
_SYMBOLS = re.compile(r"[^\x00-\x7f\w]{2}")


def plain(text: str) -> str | None:
    """Return a text in ASCII, None if one of its characters has no ASCII spelling."""
    known = unicodedata.normalize("NFC", text).translate(_TABLE)
    if known.isascii():
        return known
    letters = [_bare(letter) for letter in known]
    return None if None in letters else "".join(letter for letter in letters if letter is not None)


def _bare(letter: str) -> str | None:
    """Return the ASCII spelling of a character; None if there is none."""
    if letter.isascii():
        return letter
    apart = unicodedata.normalize("NFD", letter)
    known = apart[0].isascii() and all(unicodedata.combining(accent) for accent in apart[1:])
    return apart[0] if known else None


def is_certain(document: EdsText) -> bool:
    """Whether the non-ASCII characters were decoded with the right code page.

    The code page is a guess. It is certain if each character is the same in all western code pages, and is part of words of mostly
    ASCII letters. In a Cyrillic, Greek or East Asian file, non-ASCII letters are next to each other.
    """
    if document.encoding not in _ALSO:
        return True  # UTF-8 or UTF-16
    whole = "\n".join(document.lines)
    return (
        {letter for letter in whole if not letter.isascii()} <= _shared(document.encoding)
        and all(_is_western(word[0]) for word in _WORD.finditer(whole))
        and _SYMBOLS.search(whole) is None
    )


@cache
def _shared(encoding: str) -> frozenset[str]:
    """Return the characters with the same octet in a code page and in those that may be confused with it."""
    if not _ALSO[encoding]:
        return frozenset()
    octets = [bytes((number,)) for number in range(0x80, 0x100)]
    found = {
        octet.decode(encoding, "replace")
        for octet in octets
        if len({octet.decode(page, "replace") for page in (encoding, *_ALSO[encoding])}) == 1
    }
    return frozenset(found | {_SQUARE})


def _is_western(word: str) -> bool:
    """Whether a word may be of a western language: at most half of its letters are not ASCII."""
    return sum(not letter.isascii() and letter != "µ" for letter in word) * 2 <= len(word)


def _letters(bench: FixContext) -> Iterator[Fix]:
    """Fix S001 in names and comments, in one fix as for the check; do nothing if the code page is uncertain."""
    if not is_certain(bench.document):
        return
    changes = tuple(_changes(bench))
    if changes:
        first = bench.document.lines[changes[0].line - 1].strip()
        more = f", and {counted(len(changes) - 1, 'more line')}" if len(changes) > 1 else ""
        yield Fix("S001", changes[0].line, f"{short(first)} in ASCII{more}", changes)


def _changes(bench: FixContext) -> Iterator[LineEdit]:
    for number, line in enumerate(bench.document.lines, 1):
        if line.isascii():
            continue
        raw = line.removesuffix("\r")
        new = plain(raw) if _is_for_people(raw) else None
        if new is not None and len(new) <= MAX_LINE:
            yield LineEdit(number, 1, (new,))


def _is_for_people(raw: str) -> bool:
    key, _ = entry_of(raw)
    return raw.lstrip()[:1] == ";" or _NAMES.fullmatch(key) is not None


MENDS: Mapping[str, Mend] = {"S001": _letters}
