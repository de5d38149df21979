"""Mends of letters beyond ASCII in names and comments (DS 306 4.2), where there is a plain way to write them."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping

from axisbus.eds.io.edit import Change
from axisbus.eds.io.text import entry_of
from axisbus.eds.mends.mend import Bench, Mend, Mended, short
from axisbus.wording import counted

MAX_LINE = 255  # DS 306 4.2

# What a person reads and no tool compares with the device; a value stays as it is.
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


def plain(text: str) -> str | None:
    """Return a text in ASCII, None where one of its letters has no plain way to be written."""
    known = unicodedata.normalize("NFC", text).translate(_TABLE)
    if known.isascii():
        return known
    letters = [_bare(letter) for letter in known]
    return None if None in letters else "".join(letter for letter in letters if letter is not None)


def _bare(letter: str) -> str | None:
    """Return what stands for a letter; None where there is nothing plain."""
    if letter.isascii():
        return letter
    apart = unicodedata.normalize("NFD", letter)
    known = apart[0].isascii() and all(unicodedata.combining(accent) for accent in apart[1:])
    return apart[0] if known else None


def _letters(bench: Bench) -> Iterator[Mended]:
    """S001: names and comments, all at once as the check tells of them."""
    changes = tuple(_changes(bench))
    if changes:
        first = bench.document.lines[changes[0].line - 1].strip()
        more = f", and {counted(len(changes) - 1, 'more line')}" if len(changes) > 1 else ""
        yield Mended("S001", changes[0].line, f"{short(first)} in ASCII{more}", changes)


def _changes(bench: Bench) -> Iterator[Change]:
    for number, line in enumerate(bench.document.lines, 1):
        if line.isascii():
            continue
        raw = line.removesuffix("\r")
        new = plain(raw) if _is_for_people(raw) else None
        if new is not None and len(new) <= MAX_LINE:
            yield Change(number, 1, (new,))


def _is_for_people(raw: str) -> bool:
    key, _ = entry_of(raw)
    return raw.lstrip()[:1] == ";" or _NAMES.fullmatch(key) is not None


MENDS: Mapping[str, Mend] = {"S001": _letters}
