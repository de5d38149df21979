"""An EDS as text: bytes to lines to sections, with nothing lost.

A document holds every line as it came, with its line ending and comments, so that it can be written back byte for byte; the
sections point into the lines. Section names and keys are not case-sensitive (DS 306 4.2) and are kept in lower case.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from axisbus.eds.findings import Findings

_BOMS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
# ü ä Ä ö Ö Ü of code page 850 inside a word; in code page 1252 these bytes are quotation marks and signs, which stand at its edge.
_CP850_LETTER = re.compile(rb"[A-Za-z][\x81\x84\x8e\x94\x99\x9a][a-z]")


class Section(NamedTuple):
    """One ``[section]``: its name as written, its line (from 1), and its entries by lower-case key, values trimmed."""

    name: str
    line: int
    entries: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Document:
    """A file's text: ``newline`` joins ``lines`` to the whole again, ``bom`` and ``encoding`` make bytes of it.

    Where the line ending is CR LF, the lines keep their CR. ``sections`` is by lower-case name in the file's order; of two with
    one name it holds the first.
    """

    lines: Sequence[str]
    newline: str
    encoding: str
    bom: bytes
    sections: Mapping[str, Section]
    _places: dict[int, dict[str, int]] = field(
        default_factory=dict, compare=False, repr=False
    )  # filled when asked for

    def place(self, section: Section, key: str) -> tuple[int, int]:
        """Return line and column (from 1) of the value of ``key``; those of the section where it has no such key."""
        places = self._places.get(section.line)
        if places is None:
            places = self._places[section.line] = self._lines_of(section)
        number = places.get(key)
        if number is None:
            return section.line, 1
        raw = self.lines[number - 1]
        value = raw.partition("=")[2]
        return number, len(raw) - len(value.lstrip()) + 1

    def _lines_of(self, section: Section) -> dict[str, int]:
        found: dict[str, int] = {}
        for number in range(section.line + 1, len(self.lines) + 1):
            key, equals, _ = self.lines[number - 1].partition("=")
            key = key.strip().lower()
            if key.startswith("["):
                break
            if equals:
                found.setdefault(key, number)
        return found


class Text(NamedTuple):
    """A file's bytes as text, and what turns it into the same bytes again."""

    text: str
    encoding: str
    bom: bytes = b""


def parse(content: Text, findings: Findings) -> Document:
    """Take a text apart into lines and sections; never raises, and what is odd goes to ``findings``."""
    text, encoding, bom = content
    newline = "\n" if "\n" in text else "\r"
    lines = text.split(newline)
    document = Document(lines, newline, encoding, bom, _sections(lines, findings))
    _report_encoding(document, findings)
    return document


def decode(data: bytes) -> Text:
    """Return the text of a file in whatever encoding it seems to be; encoding it again always gives the bytes again."""
    for bom, encoding in _BOMS:
        if data.startswith(bom):
            return _strict(data[len(bom) :], encoding, bom) or _fallback(data)
    if data.isascii():
        return (_strict(data, _utf16_without_bom(data)) if b"\0" in data else None) or Text(
            data.decode(), "ascii"
        )
    return _strict(data, "utf-8") or _strict(data, _utf16_without_bom(data)) or _fallback(data)


def _strict(data: bytes, encoding: str, bom: bytes = b"") -> Text | None:
    try:
        return Text(data.decode(encoding), encoding, bom)
    except UnicodeDecodeError:
        return None


def _fallback(data: bytes) -> Text:
    code_page = "cp850" if _CP850_LETTER.search(data) else "cp1252"
    return _strict(data, code_page) or Text(data.decode("latin-1"), "latin-1")


def _utf16_without_bom(data: bytes) -> str:
    """Return the UTF-16 that plain text with a zero in every other byte must be, else ``ascii``."""
    start = data[:200]
    if start.count(0) * 3 < len(start):
        return "ascii"
    return "utf-16-le" if start[1:2] == b"\0" else "utf-16-be"


class _Entries(dict[str, tuple[str, str]]):
    """Lines to (key, value), each different line worked out once; no key where a line is no entry (comment, header, blank)."""

    def __missing__(self, raw: str) -> tuple[str, str]:
        key, equals, value = raw.partition("=")
        key = key.strip().lower()
        if not equals or key[:1] in (";", "["):
            key = ""
        self[raw] = entry = (key, value.strip())
        return entry


def _sections(lines: Sequence[str], findings: Findings) -> dict[str, Section]:
    """Sort the lines into sections; the loop runs once per line of the file and is kept bare for that."""
    sections: dict[str, Section] = {}
    entries: dict[str, str] = {}
    known = _Entries()
    for number, raw in enumerate(lines, 1):
        key, value = known[raw]
        if not key:
            line = raw.strip()
            if line[:1] == "[":
                entries = _open(sections, raw, line, number, findings)
            elif line and line[0] != ";":
                findings.add("S006", f"{_short(line)} is no key=value", line=number)
        elif key in entries:
            findings.add("S004", f"key {_short(key)} is there twice in its section", line=number)
        else:
            entries[key] = value
    _report_preface(lines, findings)
    return sections


def _report_preface(lines: Sequence[str], findings: Findings) -> None:
    for number, raw in enumerate(lines, 1):
        line = raw.strip()
        if line[:1] == "[":
            break
        if line and line[0] != ";":
            findings.add("S005", f"{_short(line)} stands before the first section", line=number)


def _open(
    sections: dict[str, Section], raw: str, line: str, number: int, findings: Findings
) -> dict[str, str]:
    """Begin a section and return its (still empty) entries; those of a second one of the same name go nowhere."""
    if raw[0] != "[":
        findings.add("S009", f"{_short(line)} is indented", line=number, column=raw.index("[") + 1)
    name, bracket, rest = line[1:].partition("]")
    name = name.strip()
    if not bracket:
        findings.add("S010", f"{_short(line)} has no closing bracket", line=number)
    elif rest.strip():
        findings.add("S011", f"text after [{_short(name)}]", line=number, column=raw.index("]") + 2)
    entries: dict[str, str] = {}
    first = sections.setdefault(name.lower(), Section(name, number, entries))
    if first.entries is not entries:
        findings.add(
            "S003", f"section [{_short(name)}] is there twice, first in line {first.line}", line=number
        )
    return entries


def _report_encoding(document: Document, findings: Findings) -> None:
    if document.bom or document.encoding.startswith("utf-16"):
        mark = " with a byte order mark" if document.bom else ""
        findings.add("S002", f"the file is {document.encoding.upper()}{mark}", line=1)
    if document.encoding == "ascii":
        return
    foreign = [number for number, line in enumerate(document.lines, 1) if not line.isascii()]
    if foreign:
        line = document.lines[foreign[0] - 1]
        column = next(at for at, letter in enumerate(line, 1) if not letter.isascii())
        what = f"{len(foreign)} line(s) hold letters beyond ASCII, read as {document.encoding.upper()}"
        findings.add("S001", what, line=foreign[0], column=column)


def _short(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...")
