"""Change single lines of an EDS text in the style of the file, and nothing else.

A change is a value: the replaced lines and their replacement. ``apply`` makes a new document from the old one and any number of
changes that do not touch the same lines. Line ends, encoding, spacing and the case of keys are those of the neighbouring lines.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from axisbus.eds.io import text
from axisbus.eds.io.text import EdsText, Section
from axisbus.errors import ArgumentError

_BREAK = re.compile(r"[\x00-\x08\x0a-\x1f\x7f\x85\u2028\u2029]")


class LineEdit(NamedTuple):
    """Replace ``count`` lines from ``line`` on (from 1) by ``lines``, which have no line ends; with ``count`` 0 only insert."""

    line: int
    count: int  # type: ignore[assignment]  # hides tuple.count, which is not used
    lines: tuple[str, ...] = ()


class _Style(NamedTuple):
    """The notation of ``key=value`` in a file."""

    indent: str = ""
    before: str = ""
    after: str = ""
    lower: bool = False

    def entry(self, key: str, value: str) -> str:
        shown = key.lower() if self.lower else key
        return f"{self.indent}{shown}{self.before}={self.after if value else ''}{value}"


def apply(document: EdsText, changes: Iterable[LineEdit]) -> EdsText:
    """Return the document with all changes made; insertions at one line keep their order.

    Raises:
        ArgumentError: two changes touch the same line, or a character of a new line does not exist in the file's encoding.
    """
    lines, ended = _ended_lines(document)
    edited: list[str] = []
    copied = 0  # lines that are processed
    for change in sorted(changes, key=lambda change: (change.line, change.count > 0)):
        if change.line <= copied:
            raise ArgumentError(f"two changes touch line {copied}", remedy="make one after the other")
        edited += lines[copied : change.line - 1]
        for raw in change.lines:
            _check_encoding(raw, document.encoding)
            edited.append(raw + _carriage(lines, change.line if change.count else change.line - 1))
        copied = change.line - 1 + change.count
    edited += lines[copied:]
    if ended:
        edited.append("")
    elif edited:
        edited[-1] = edited[-1].removesuffix("\r")
    newline = "\n" if len(document.lines) == 1 else document.newline
    return text.document(edited, newline, document.encoding, document.bom)


def _ended_lines(document: EdsText) -> tuple[list[str], bool]:
    """Return the lines, each with its CR if it needs one, even the last; and whether the last line has a line end."""
    *lines, last = document.lines
    if last == "":
        return lines, True
    return [*lines, last + _carriage(lines, len(lines))], False


def _carriage(lines: list[str], number: int) -> str:
    """Return the CR that a line next to line ``number`` (from 1) needs, if any."""
    if not lines:
        return ""
    return "\r" if lines[max(0, min(number, len(lines)) - 1)].endswith("\r") else ""


def _check_encoding(raw: str, encoding: str) -> None:
    try:
        raw.encode(encoding)
    except UnicodeEncodeError as error:
        letter = raw[error.start]
        raise ArgumentError(
            f"{raw[:60]!r} cannot be written: the file is {encoding.upper()}, which has no {letter!r}",
            remedy="write it without this letter; DS 306 4.2 allows ASCII only",
        ) from None


def set_value(document: EdsText, section: Section, key: str, value: str) -> LineEdit:
    """Return the change that gives ``key`` this value; a missing key is added after the section's last one.

    Of two equal keys the first is changed, because it is the valid one. The line's spacing and the key's spelling stay.

    Raises:
        ArgumentError: the key or value is not allowed in an EDS: line breaks, control characters, spaces at the ends.
    """
    number = section.line_numbers.get(key.lower())
    if number is None:
        return insert_key(document, section, key, value)
    _check_text("the value of " + key, value)
    head, _, text_after = document.lines[number - 1].removesuffix("\r").partition("=")
    before = text_after[: len(text_after) - len(text_after.lstrip())]
    after = text_after[len(text_after.rstrip()) :] if text_after.strip() else ""
    return LineEdit(number, 1, (f"{head}={before}{value}{after}",))


def insert_key(document: EdsText, section: Section, key: str, value: str, *, first: bool = False) -> LineEdit:
    """Return the change that adds ``key=value`` after the last entry of a section, in the style of that entry.

    With ``first`` it is inserted before all entries, below the header.

    Raises:
        ArgumentError: the key or value is not allowed in an EDS.
    """
    check_key(key, value)
    last = section.line if first else _last_entry(document, section)
    return LineEdit(last + 1, 0, (_style(document, section).entry(key, value),))


def set_values(document: EdsText, section: Section, values: Mapping[str, str]) -> list[LineEdit]:
    """Return the changes that give several keys of a section their values, as ``set_value`` does, in one pass over the section.

    Raises:
        ArgumentError: a key or value is not allowed in an EDS.
    """
    line_numbers = section.line_numbers
    changes = [
        set_value(document, section, key, value)
        for key, value in values.items()
        if key.lower() in line_numbers
    ]
    added = {key: value for key, value in values.items() if key.lower() not in line_numbers}
    for key, value in added.items():
        check_key(key, value)
    if added:
        style = _style(document, section)
        lines = tuple(style.entry(key, value) for key, value in added.items())
        changes.append(LineEdit(_last_entry(document, section) + 1, 0, lines))
    return changes


def rename_key(document: EdsText, line: int, key: str) -> LineEdit:
    """Return the change that renames the key of the entry in ``line`` (from 1); its value and spacing stay.

    Raises:
        ArgumentError: the key is not allowed in an EDS.
    """
    check_key(key, "")
    head, _, text_after = document.lines[line - 1].removesuffix("\r").partition("=")
    old = head.strip()
    start = head.index(old)
    return LineEdit(line, 1, (f"{head[:start]}{key}{head[start + len(old) :]}={text_after}",))


def remove_keys(document: EdsText, section: Section, keys: Iterable[str]) -> Iterator[LineEdit]:
    """Yield the changes that remove each line of these keys from a section."""
    unwanted = {key.lower() for key in keys}
    for number, key in entries(document, section):
        if key in unwanted:
            yield LineEdit(number, 1)


def add_section(
    document: EdsText, name: str, values: Mapping[str, str], before: Section | None = None
) -> LineEdit:
    """Return the change that adds a section with these entries before another one, else at the end.

    Raises:
        ArgumentError: the name, a key or a value is not allowed in an EDS.
    """
    return add_sections(document, {name: values}, before)


def add_sections(
    document: EdsText, sections: Mapping[str, Mapping[str, str]], before: Section | None = None
) -> LineEdit:
    """Return the change that adds several sections, like ``add_section``."""
    style = _style(document, before)
    lines: list[str] = []
    for name, values in sections.items():
        check_name(name)
        for key, value in values.items():
            check_key(key, value)
        lines += ["", f"[{name}]", *(style.entry(key, value) for key, value in values.items())]
    start = before.line if before is not None else len(document.lines) + (document.lines[-1] != "")
    while before is not None and start > 1 and document.lines[start - 2].lstrip()[:1] == ";":
        start -= 1  # a comment above a section belongs to it
    spaced = start == 1 or not document.lines[start - 2].strip()  # whether blank lines separate sections
    if before is not None and not spaced:
        return LineEdit(start, 0, tuple(line for line in lines if line))
    return LineEdit(start, 0, tuple(lines[1:] if spaced else lines) + (("",) if before is not None else ()))


def remove_section(document: EdsText, section: Section) -> LineEdit:
    """Return the change that removes a section with the blank lines after it; a comment after its last entry stays."""
    end = _last_entry(document, section) + 1
    while end < section.end and not document.lines[end - 1].strip() and end < len(document.lines):
        end += 1
    return LineEdit(section.line, end - section.line)


def rename_section(document: EdsText, section: Section, name: str) -> LineEdit:
    """Return the change that renames a section, and adds a missing closing bracket; the header then begins in column 1.

    Raises:
        ArgumentError: the name is not allowed in an EDS.
    """
    check_name(name)
    _, bracket, text_after = document.lines[section.line - 1].removesuffix("\r").partition("]")
    return LineEdit(section.line, 1, (f"[{name}]{text_after if bracket else ''}",))


def entries(document: EdsText, section: Section) -> Iterator[tuple[int, str]]:
    """Yield line number (from 1) and lower-case key of each entry of a section, including repeated keys."""
    for number in range(section.line + 1, section.end):
        key, _ = text.entry_of(document.lines[number - 1])
        if key:
            yield number, key


def _last_entry(document: EdsText, section: Section) -> int:
    """Return the line of the last entry of a section, or of its header if it has no entry."""
    return max((number for number, _ in entries(document, section)), default=section.line)


def _style(document: EdsText, section: Section | None) -> _Style:
    """Return the notation of the section's entries, else of the first entries in the file."""
    for model in (section, *document.sections.values()):
        line_numbers = model.line_numbers if model is not None else {}
        if line_numbers:
            return _style_of([document.lines[number - 1] for number in line_numbers.values()])
    return _Style()


def _style_of(lines: list[str]) -> _Style:
    head, _, text_after = lines[-1].removesuffix("\r").partition("=")
    indent = head[: len(head) - len(head.lstrip())]
    keys = "".join(line.partition("=")[0] for line in lines)
    return _Style(
        indent,
        " " if head.strip() != head.lstrip() else "",
        " " if text_after != text_after.lstrip() else "",
        keys.islower(),
    )


def check_key(key: str, value: str) -> None:
    """Raise ArgumentError unless ``key=value`` is allowed in an EDS (DS 306 4.2)."""
    if not key or "=" in key or key[0] in ";[":
        raise ArgumentError(f"{key!r} is not a key of an EDS", remedy="give a name without '='")
    _check_text("the key", key)
    _check_text("the value of " + key, value)


def check_name(name: str) -> None:
    """Raise ArgumentError unless this is a valid name of a section."""
    if not name or "]" in name or "[" in name:
        raise ArgumentError(f"{name!r} is not a name of a section", remedy="give a name without brackets")
    _check_text("the name", name)


def _check_text(what: str, written: str) -> None:
    if _BREAK.search(written) or written != written.strip():
        raise ArgumentError(
            f"{what} cannot be {written[:60]!r} in an EDS",
            remedy="write it in one line, without control characters and without spaces at its ends (DS 306 4.2)",
        )
