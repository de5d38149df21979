"""Fixes of the text itself: lines, comments, and duplicates (DS 306 4.2)."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping
from functools import cache

from axisbus.eds.fixes.base import Fix, FixContext, FixFunction, each, short
from axisbus.eds.io import edit, text
from axisbus.eds.io.edit import LineEdit
from axisbus.eds.io.text import EdsText, Section, entry_of
from axisbus.eds.model import EdsFinding
from axisbus.wording import counted

_TRAILING = re.compile(r"\s*;|(?:^|\s+)#")
_FOREIGN_COMMENT = ("#", "//")


def _comments(rule: str) -> FixFunction:
    """Fix S005 and S006: comments in the syntax of another format."""

    def fix_function(context: FixContext) -> Iterator[Fix]:
        for number in context.lines.get(rule, ()):
            raw = context.document.lines[number - 1].removesuffix("\r")
            if raw.lstrip().startswith(_FOREIGN_COMMENT):
                change = LineEdit(number, 1, (f";{raw.lstrip()}",))
                yield Fix(rule, number, f"{short(raw.strip())} made a comment", (change,))

    return fix_function


def _indented(context: FixContext, finding: EdsFinding) -> Fix:
    """Fix S009."""
    raw = context.document.lines[finding.line - 1].removesuffix("\r")
    change = LineEdit(finding.line, 1, (raw.lstrip(),))
    return Fix("S009", finding.line, f"{short(raw.strip())} moved to column 1", (change,))


def _unclosed(context: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix S010."""
    section = context.section_at(finding.line)
    if not section.name or "[" in section.name:
        return None
    change = edit.rename_section(context.document, section, section.name)
    return Fix("S010", finding.line, f"[{short(section.name)} closed", (change,))


def _trailing(context: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix S011: move the text after a value or a name to a comment in the next line."""
    raw = context.document.lines[finding.line - 1].removesuffix("\r")
    section = context.section_at(finding.line)
    content, trailing = _header(raw) if finding.line == section.line else _value(raw)
    if not trailing:
        return None
    comment = trailing if trailing[0] == ";" else f"; {trailing}"
    change = LineEdit(finding.line, 1, (content, comment))
    return Fix("S011", finding.line, f"{short(trailing)} moved to a separate line", (change,))


def _header(raw: str) -> tuple[str, str]:
    name, _, trailing = raw.partition("]")
    return f"{name}]", trailing.strip()


def _value(raw: str) -> tuple[str, str]:
    key, _, rest = raw.partition("=")
    if key.strip().lower() == "accesstype":
        word = re.match(r"\s*[A-Za-z]+", rest)
        end = word.end() if word else len(rest)
    else:
        found = _TRAILING.search(rest)
        end = found.start() if found else len(rest)
    return f"{key}={rest[:end]}", rest[end:].strip()


def _same_section(context: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix S003: remove the second of two equal sections."""
    second = context.section_at(finding.line)
    first = context.document.sections[second.name.lower()]
    if first is second:
        first = context.duplicates.get(second, second)
    if first is second or first.entries != second.entries:
        return None
    if not (_plain(context, first) and _plain(context, second)):
        return None
    return Fix(
        "S003",
        finding.line,
        f"[{second.name}] removed, it repeats line {first.line}",
        tuple(_without_comments(context, second)),
    )


def _plain(context: FixContext, section: Section) -> bool:
    """Whether a section has no duplicate key and no unknown line."""
    lines = [line for raw in context.document.lines[section.line : section.end - 1] if (line := raw.strip())]
    return sum(line[0] != ";" for line in lines) == len(section.entries)


def _without_comments(context: FixContext, section: Section) -> Iterator[LineEdit]:
    lines = context.document.lines
    ended = len(lines) if lines[-1] == "" else 0  # after the last line end there is no line
    for number in range(section.line, section.end):
        if lines[number - 1].lstrip()[:1] != ";" and number != ended:
            yield LineEdit(number, 1)


def _same_key(context: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix S004: remove the second of two equal entries."""
    key, given = text.entry_of(context.document.lines[finding.line - 1])
    if context.section_at(finding.line).entries.get(key) != given:
        return None
    what = f"{short(key)} removed, it is there already with the same value"
    return Fix("S004", finding.line, what, (LineEdit(finding.line, 1),))


FIXES: Mapping[str, FixFunction] = {
    "S003": each("S003", _same_section),
    "S004": each("S004", _same_key),
    "S005": _comments("S005"),
    "S006": _comments("S006"),
    "S009": each("S009", _indented),
    "S010": each("S010", _unclosed),
    "S011": each("S011", _trailing),
}


# -- Fixes of a whole file: its encoding and its line ends -------------------------------------------------------------


def plain_encoding(document: EdsText) -> EdsText | None:
    """Fix S002: return the document without byte order mark, in ASCII if possible, else in UTF-8; None if nothing changes."""
    if not document.bom and not document.encoding.startswith("utf-16"):
        return None
    all_text = document.newline.join(document.lines)
    encoding = "ascii" if all_text.isascii() else "utf-8"
    try:
        decoded = text.decode(all_text.encode(encoding))
    except UnicodeEncodeError:
        return None  # half a surrogate pair of UTF-16
    if decoded.text != all_text:
        return None
    return text.document(document.lines, document.newline, decoded.encoding, decoded.bom)


def line_ends(document: EdsText) -> EdsText | None:
    """Fix S014: return the document with LF if its lines end in CR only, else None."""
    if document.newline != "\r" or len(document.lines) == 1:
        return None
    return text.document(document.lines, "\n", document.encoding, document.bom)


WHOLE_FILE = {
    "S002": (plain_encoding, "written without byte order mark, one byte for each ASCII letter"),
    "S014": (line_ends, "lines end in LF"),
}


# -- Fixes of non-ASCII characters in names and comments (DS 306 4.2), if there is an ASCII spelling -------------------


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
    letters = [_without_accent(letter) for letter in known]
    return None if None in letters else "".join(letter for letter in letters if letter is not None)


def _without_accent(letter: str) -> str | None:
    """Return the ASCII spelling of a character; None if there is none."""
    if letter.isascii():
        return letter
    decomposed = unicodedata.normalize("NFD", letter)
    known = decomposed[0].isascii() and all(unicodedata.combining(accent) for accent in decomposed[1:])
    return decomposed[0] if known else None


def is_certain(document: EdsText) -> bool:
    """Whether the non-ASCII characters were decoded with the right code page.

    The code page is a guess. It is certain if each character is the same in all western code pages, and is part of words of mostly
    ASCII letters. In a Cyrillic, Greek or East Asian file, non-ASCII letters are next to each other.
    """
    if document.encoding not in _ALSO:
        return True  # UTF-8 or UTF-16
    all_text = "\n".join(document.lines)
    return (
        {letter for letter in all_text if not letter.isascii()} <= _shared(document.encoding)
        and all(_is_western(word[0]) for word in _WORD.finditer(all_text))
        and _SYMBOLS.search(all_text) is None
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


def _letters(context: FixContext) -> Iterator[Fix]:
    """Fix S001 in names and comments, in one fix as for the check; do nothing if the code page is uncertain."""
    if not is_certain(context.document):
        return
    changes = tuple(_changes(context))
    if changes:
        first = context.document.lines[changes[0].line - 1].strip()
        more = f", and {counted(len(changes) - 1, 'more line')}" if len(changes) > 1 else ""
        yield Fix("S001", changes[0].line, f"{short(first)} in ASCII{more}", changes)


def _changes(context: FixContext) -> Iterator[LineEdit]:
    for number, line in enumerate(context.document.lines, 1):
        if line.isascii():
            continue
        raw = line.removesuffix("\r")
        new = plain(raw) if _is_for_people(raw) else None
        if new is not None and len(new) <= MAX_LINE:
            yield LineEdit(number, 1, (new,))


def _is_for_people(raw: str) -> bool:
    key, _ = entry_of(raw)
    return raw.lstrip()[:1] == ";" or _NAMES.fullmatch(key) is not None


NON_ASCII_FIXES: Mapping[str, FixFunction] = {"S001": _letters}
