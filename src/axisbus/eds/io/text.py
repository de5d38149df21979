"""An EDS as text: convert bytes to lines to sections, without losing anything.

A document holds each line unchanged, with its line end and comments, so that it can be written back byte for byte; the sections
refer to the lines. Section names and keys are not case-sensitive (DS 306 4.2) and are stored in lower case.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from axisbus.eds.io.findings import Findings
from axisbus.wording import counted

_BOMS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_NO_KEY = (";", "[")
_KEYS = {
    key: key.lower()
    for key in (
        *("ParameterName", "ObjectType", "DataType", "AccessType", "DefaultValue", "ParameterValue"),
        *("LowLimit", "HighLimit", "PDOMapping", "ObjFlags", "SubNumber"),
    )
}  # in the spelling of nearly all files
# The text before a section's name: the end of the line before it, and a bracket, which may be indented.
_HEADERS = {end: re.compile(rf"{end}[^\S{end}]*\[") for end in ("\n", "\r")}
_NAME, _DEFAULT = "ParameterName=", "DefaultValue="
_BLANK_OR_COMMENT = ("", ";")  # the beginnings of lines that are no entries
# ü ä Ä ö Ö Ü of code page 850 inside a word; in code page 1252 these bytes are quotation marks and signs, never inside a word.
_CP850_LETTER = re.compile(rb"[A-Za-z][\x81\x84\x8e\x94\x99\x9a][a-z]")


def entry_of(raw: str) -> tuple[str, str]:
    """Return lower-case key and trimmed value of a line; the key is empty if the line is no entry (comment, header, blank)."""
    given, equals, value = raw.partition("=")
    key = _KEYS.get(given) if equals else ""
    if key is None:
        key = given.strip().lower()
        key = "" if key[:1] in _NO_KEY else key
    return key, value.strip()


class _Entries(dict[str, tuple[str, str]]):
    """The (key, value) of each line; a line that occurs again is not parsed again. ``newline`` separates the lines."""

    def __init__(self, newline: str) -> None:
        self.newline = newline

    def __missing__(self, raw: str) -> tuple[str, str]:
        self[raw] = entry = entry_of(raw)
        return entry


class Section:
    """One ``[section]``: its ``name`` as written, its ``line`` (from 1), and ``end``, the number of the line after its last.

    Its entries are parsed on first access; they are its only state.
    """

    __slots__ = ("_body", "_entries", "_known", "_line_numbers", "end", "line", "name")

    def __init__(self, name: str, line: int, end: int, body: str, known: _Entries) -> None:
        self.name = name
        self.line = line
        self.end = end
        self._body = body
        self._known = known
        self._entries: dict[str, str] | None = None
        self._line_numbers: dict[str, int] | None = None

    @property
    def entries(self) -> Mapping[str, str]:
        """Values (trimmed) by lower-case key, in the file's order; of two equal keys the first counts."""
        if self._entries is None:
            body = self.lines()
            entries = dict(map(self._known.__getitem__, body))  # quick, but the last of two equal keys counts
            if len(entries) < len(body):
                entries = dict(map(self._known.__getitem__, reversed(body)))
                entries = {key: entries[key] for key, _ in map(self._known.__getitem__, body)}
            entries.pop("", None)
            self._entries = entries
        return self._entries

    def split_entries(self) -> tuple[str, str, str | None]:
        """Return ParameterName, DefaultValue ("" for none), and the text of the other lines.

        The text is None if the section does not begin with its name, as it does in most files.
        """
        if self._body[: len(_NAME)] != _NAME:
            return "", "", None
        newline = self._known.newline
        first, _, rest = self._body.partition(newline)
        name = first[len(_NAME) :].strip()
        before, found, behind = rest.partition(_DEFAULT)
        if not found or before[-1:] not in ("", newline):
            return name, "", rest
        default, _, behind = behind.partition(newline)
        return name, default.strip(), before + behind

    def lines(self) -> list[str]:
        """Return the lines below its header."""
        return self._body.split(self._known.newline) if self.end > self.line + 1 else []

    def every(self) -> Iterator[tuple[int, str, str]]:
        """Yield line (from 1), lower-case key and value of all entries, including duplicate keys."""
        for number, raw in enumerate(self.lines(), self.line + 1):
            key, value = self._known[raw]
            if key:
                yield number, key, value

    @property
    def line_numbers(self) -> Mapping[str, int]:
        """Line numbers (from 1) by lower-case key; of two equal keys the first one's."""
        if self._line_numbers is None:
            line_numbers: dict[str, int] = {}
            for number, key, _ in self.every():
                line_numbers.setdefault(key, number)
            self._line_numbers = line_numbers
        return self._line_numbers

    def __repr__(self) -> str:
        return f"<[{self.name}], line {self.line}>"


@dataclass(frozen=True)
class EdsText:
    """A file's text: ``newline`` separates its ``lines``, ``bom`` and ``encoding`` convert it to bytes.

    If the line ends are CR LF, the lines keep their CR. ``sections`` is by lower-case name in the file's order; of two with the
    same name it holds the first, and ``repeated`` the others.
    """

    text: str
    newline: str
    encoding: str
    bom: bytes
    sections: Mapping[str, Section]
    repeated: Sequence[Section] = ()

    @cached_property
    def lines(self) -> Sequence[str]:
        """All lines, for users that go through a whole file; the model does not need them."""
        return self.text.split(self.newline)

    def location(self, section: Section, key: str) -> tuple[int, int]:
        """Return line and column (from 1) of the value of ``key``; those of the section if it has no such key."""
        number = section.line_numbers.get(key)
        if number is None:
            return section.line, 1
        raw = self.lines[number - 1].removesuffix("\r")
        value = raw.partition("=")[2]
        return number, len(raw) - len(value.lstrip()) + 1


class Text(NamedTuple):
    """A file's bytes as text, and the data for converting it back to the same bytes."""

    text: str
    encoding: str
    bom: bytes = b""


def parse(content: Text) -> EdsText:
    """Split a text into lines and sections; never raises; ``report`` finds the oddities."""
    return _document(content.text, "\n" if "\n" in content.text else "\r", content.encoding, content.bom)


def document(lines: Sequence[str], newline: str, encoding: str, bom: bytes) -> EdsText:
    """Return the document of these lines."""
    return _document(newline.join(lines), newline, encoding, bom)


def _document(text: str, newline: str, encoding: str, bom: bytes) -> EdsText:
    known = _Entries(newline)
    sections: dict[str, Section] = {}
    repeated = []
    preface, *parts = _HEADERS[newline].split(newline + text)  # every header follows the end of a line
    line = preface.count(newline) + 1
    for part in parts:
        header, _, body = part.partition(newline)
        end = line + part.count(newline) + 1
        section = Section(header.partition("]")[0].strip(), line, end, body, known)
        line = end
        if sections.setdefault(section.name.lower(), section) is not section:
            repeated.append(section)
    return EdsText(text, newline, encoding, bom, sections, repeated)


def decode(data: bytes) -> Text:
    """Return the text of a file in its probable encoding; encoding it again always gives the same bytes."""
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
    """Return the variant of UTF-16 if many of the first bytes are zero, else ``ascii``."""
    start = data[:200]
    if start.count(0) * 3 < len(start):
        return "ascii"
    return "utf-16-le" if start[1:2] == b"\0" else "utf-16-be"


def report(document: EdsText, findings: Findings) -> None:
    """Report the oddities of a document's text."""
    every = [*document.sections.values(), *document.repeated]
    _report_preface(document, findings)
    for section in every:
        _report_header(document.lines[section.line - 1], section, findings)
        _report_body(document.lines, section, findings)
    for section in document.repeated:
        first = document.sections[section.name.lower()].line
        text = f"section [{_short(section.name)}] is there twice, first in line {first}"
        findings.add("S003", text, line=section.line)
    _report_encoding(document, findings)


def _report_preface(document: EdsText, findings: Findings) -> None:
    start = next(iter(document.sections.values())).line if document.sections else len(document.lines) + 1
    lines = document.lines[: start - 1]
    odd = [number for number, raw in enumerate(lines, 1) if raw.strip()[:1] not in _BLANK_OR_COMMENT]
    findings.add_lines(
        "S005", odd, lambda number: f"{_short(lines[number - 1].strip())} is before the first section"
    )


def _report_header(raw: str, section: Section, findings: Findings) -> None:
    line = raw.strip()
    if raw[0] != "[":
        findings.add("S009", f"{_short(line)} is indented", line=section.line, column=raw.index("[") + 1)
    _, bracket, rest = line.partition("]")
    if not bracket:
        findings.add("S010", f"{_short(line)} has no closing bracket", line=section.line)
    elif rest.strip():
        column = raw.index("]") + 2
        findings.add("S011", f"text after [{_short(section.name)}]", line=section.line, column=column)


def _report_body(lines: Sequence[str], section: Section, findings: Findings) -> None:
    known = section._known
    body = lines[section.line : section.end - 1]
    keys = [known[raw][0] for raw in body]
    empty = keys.count("")
    if empty:  # most sections have no such line
        odd = [
            number
            for number, (key, raw) in enumerate(zip(keys, body, strict=True), section.line + 1)
            if not key and raw.strip()[:1] not in _BLANK_OR_COMMENT
        ]
        findings.add_lines(
            "S006", odd, lambda number: f"{_short(lines[number - 1].strip())} is not a key=value"
        )
    if len(keys) - empty > len(section.entries):
        _report_twice(keys, section, findings)


def _report_twice(keys: Sequence[str], section: Section, findings: Findings) -> None:
    seen = {""}
    for number, key in enumerate(keys, section.line + 1):
        if key in seen and key:
            findings.add("S004", f"key {_short(key)} is there twice in its section", line=number)
        seen.add(key)


def _report_encoding(document: EdsText, findings: Findings) -> None:
    if document.bom or document.encoding.startswith("utf-16"):
        mark = " with a byte order mark" if document.bom else ""
        findings.add("S002", f"the file is {document.encoding.upper()}{mark}", line=1)
    if document.encoding == "ascii":
        return
    foreign = [number for number, line in enumerate(document.lines, 1) if not line.isascii()]
    if foreign:
        line = document.lines[foreign[0] - 1]
        column = next(at for at, letter in enumerate(line, 1) if not letter.isascii())
        what = f"{counted(len(foreign), 'line holds', 'lines hold')} letters beyond ASCII, read as {document.encoding.upper()}"
        findings.add("S001", what, line=foreign[0], column=column)


def _short(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...")
