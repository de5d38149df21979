"""Read a TOML file: the values by ``tomllib``, and the line of each table and key for the messages."""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from axisbus.errors import ConfigError
from axisbus.wording import counted, files_near

MAX_BYTES = 1 << 20  # a cell of 127 nodes takes about 100 kB
CELL_FILE = "cell file"
_OF_PYTHON = "pyproject.toml"  # not a cell file, and often in the same folder


@dataclass(frozen=True, slots=True)
class TomlDocument:
    """A TOML file: its values, and the line (from 1) of each table, key and array element by its path; ``kind`` is for messages."""

    file: str
    text: str
    data: dict[str, Any]
    lines: Mapping[KeyPath, int]
    kind: str = CELL_FILE

    def line(self, path: KeyPath) -> int:
        """Return the line of ``path``, or of the nearest enclosing table that has one; 1 if none has."""
        while path:
            if path in self.lines:
                return self.lines[path]
            path = path[:-1]
        return 1


def load(path: str | Path, kind: str = CELL_FILE) -> TomlDocument:
    """Read a file, a ``kind`` of file in messages; blocks while the file is read.

    Raises:
        ConfigError: it is missing, cannot be read, is too large, is not UTF-8, or is not TOML; with the line if there is one.
    """
    path = Path(path)
    return loads(_decoded(_bytes(path, kind), str(path)), str(path), kind)


def loads(text: str, file: str, kind: str = CELL_FILE) -> TomlDocument:
    """Read ``text``; ``file`` is the name in messages, and ``kind`` what it is.

    Raises:
        ConfigError: it is not TOML.
    """
    text = text.replace("\r\n", "\n")
    try:
        data = tomllib.loads(text)
        lines = locate(text)
    except RecursionError:
        raise ConfigError(
            "brackets are nested too deeply", file=file, remedy=f"a {kind} needs no more than three levels"
        ) from None
    except ValueError as error:  # tomllib's own error is a ValueError, and so is the error of a number with thousands of digits
        raise _syntax(str(error), text, file) from None
    document = TomlDocument(file, text, data, lines, kind)
    _require_printable(document, data)
    return document


# -- errors ----------------------------------------------------------------------------------------------------------

_SHOWN = 80
_EXAMPLE = "C:\\drives\\x.eds"
_BACKSLASHES = "put a path with backslashes in single quotes"
_QUOTED = re.compile(r'"([^"\']*\\[^"\']*)"')
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")
_AT = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")


# A message of tomllib -> the usual remedy.
_REMEDIES = (
    ("Cannot overwrite a value", "this key is given twice in its table: delete one"),
    ("Cannot declare", "this table is opened twice: put all of its keys under one header"),
    ("Cannot mutate", "this name is used both for a value and for a table: rename or delete one"),
    ("Cannot redefine", "this table is opened twice: put all of its keys under one header"),
    (
        "Expected newline or end of document after a statement",
        'write one "key = value" per line; a text or a value with a unit must be in quotes: scan_period = "4ms"',
    ),
    ("Expected '='", 'write key = value; a key with other characters than letters, digits, _ and - must be in quotes: '
                     '"607D:1" = 5'),
    ("Invalid value", "write a number, true, false, a list in [ ], or a text in quotes"),
    ("Invalid statement", "a line is a [table], a key = value, or a comment that begins with #"),
    ("Unescaped '\\'", _BACKSLASHES),
    ("hex value", _BACKSLASHES),
    ("not a Unicode scalar", _BACKSLASHES),
    ("Unclosed array", "close the list with ]"),
    ("Expected ']'", "close the name of the table with ]"),
    ("Unterminated string", "close the text with a quotation mark"),
    ("Illegal character", "close the text with a quotation mark on its own line"),
    ("Expected \"'\"", "close the text with a quotation mark"),
    ("digits", "the number has too many digits"),
)  # fmt: skip


def _require_printable(document: TomlDocument, value: Any, path: KeyPath = ()) -> None:
    """Check that no backslash of a path was read as an escape: "C:\\new" contains a line feed.

    Raises:
        ConfigError: one was.
    """
    if isinstance(value, dict):
        for key, each in value.items():
            _require_printable(document, each, (*path, key))
    elif isinstance(value, list):
        for number, each in enumerate(value):
            _require_printable(document, each, (*path, number))
    elif isinstance(value, str) and _CONTROL.search(value):
        line = document.line(path)
        written = document.text.split("\n")[line - 1].strip()
        if (
            "\\" in written and '"""' not in written and "'''" not in written
        ):  # a text of several lines may contain control characters
            raise ConfigError(
                f"{'.'.join(map(str, path))}: TOML reads a backslash in double quotes as the beginning of a control character",
                file=document.file,
                line=line,
                observed=f"the line reads: {written[:_SHOWN]}",
                remedy=_in_single_quotes(written),
            )


def _in_single_quotes(line: str) -> str:
    """Return the remedy for a line whose backslashes belong to a path."""
    found = _QUOTED.search(line)
    return f"{_BACKSLASHES}: '{found[1] if found else _EXAMPLE}'"


def _syntax(reason: str, text: str, file: str) -> ConfigError:
    place = _AT.search(reason)
    line = int(place[1]) if place and place[1] else text.rstrip("\n").count("\n") + 1 if place else 0
    said = _AT.sub("", reason)
    remedy = next(
        (advice for part, advice in _REMEDIES if part in said), "see https://toml.io for the syntax of TOML"
    )
    shown = text.split("\n")[line - 1].strip() if line else ""
    if remedy == _BACKSLASHES:
        remedy = _in_single_quotes(shown)
    return ConfigError(
        f"this is not TOML: {said[:1].lower()}{said[1:]}",
        file=file,
        line=line,
        observed=f"the line reads: {shown[:_SHOWN]}" if shown else "",
        remedy=remedy,
    )


def _bytes(path: Path, kind: str) -> bytes:
    try:
        if path.is_dir():
            raise ConfigError(
                f"this is a folder, not a {kind}",
                file=str(path),
                remedy=_nearby(path, "") or "name a .toml file",
            )
        if path.exists() and not path.is_file():
            raise ConfigError("this is not a regular file", file=str(path), remedy="name a .toml file")
        data = path.read_bytes()
    except FileNotFoundError:
        remedy = _nearby(path.parent, path.name) or f"there is no .toml file in {path.parent}: check the path"
        raise ConfigError("the file does not exist", file=str(path), remedy=remedy) from None
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise ConfigError(
            "the file cannot be read",
            file=str(path),
            observed=str(error),
            remedy="check the path and its permissions",
        ) from error
    if len(data) > MAX_BYTES:
        raise ConfigError(
            f"the file is too large for a {kind}: {counted(len(data), 'byte')}",
            file=str(path),
            remedy=f"name a {kind}",
        )
    return data


def _decoded(data: bytes, file: str) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ConfigError(
            "this is not UTF-8 text",
            file=file,
            line=line,
            observed=f"byte {data[error.start]:02X}h",
            remedy="save the file as UTF-8",
        ) from None


def _nearby(folder: Path, name: str) -> str:
    return files_near(folder, name, lambda path: path.suffix == ".toml" and path.name != _OF_PYTHON)


# -- The line of each table, key and array element of a TOML text ------------------------------------------------------
#
# Theory of operation. ``tomllib`` returns values without their locations. Therefore ``_Locator`` walks the same text once more. It
# knows only the TOML syntax that separates keys from values: headers, dotted and quoted keys, strings, comments, brackets. It runs
# only on a text that ``tomllib`` has accepted, so it does not need to find errors.


KeyPath = tuple[str | int, ...]


def locate(text: str) -> dict[KeyPath, int]:
    """Return the line (from 1) of each path in ``text``, which must be valid TOML with line feeds only.

    The elements of arrays have their number (from 0) in the path; those of an array of tables likewise.
    """
    return _Locator(text).run()


_SPACE = re.compile(r"[ \t]*")
_BLANK = re.compile(r"(?:[ \t\n]|#[^\n]*)*")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_STRING = re.compile(
    r'"""(?:[^\\]|\\.)*?"{3,5}'  # up to two quotation marks may precede the closing three
    r"|'''.*?'{3,5}"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'",
    re.DOTALL,
)
_SCALAR = re.compile(r"[^,\]}\n#]+")


class _Locator:
    """Walk a valid TOML text; holds the present offset, and the lines found so far."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._newlines = [at for at, char in enumerate(text) if char == "\n"]
        self._lines: dict[KeyPath, int] = {}
        self._counts: dict[KeyPath, int] = {}  # index of the last element of each array of tables

    def run(self) -> dict[KeyPath, int]:
        """Return the line of each path."""
        table: KeyPath = ()
        while self._skip(_BLANK):
            before = self._at
            if self._peek("["):
                table = self._header()
            else:
                self._pair(table)
            if self._at == before:  # never happens in valid TOML; prevents an endless loop on invalid text
                break
        return self._lines

    def _header(self) -> KeyPath:
        line = self._line()
        brackets = 2 if self._peek("[[") else 1
        self._at += brackets
        path: KeyPath = ()
        keys = self._key()
        for number, key in enumerate(keys, 1):
            path = (*path, key)
            last = number == len(keys)
            if not last or brackets == 1:
                self._lines.setdefault(path, line)
            if last and brackets == 2:
                self._lines.setdefault(path, line)
                self._counts[path] = self._counts.get(path, -1) + 1
            if path in self._counts:
                path = (*path, self._counts[path])
                self._lines.setdefault(path, line)
        if brackets == 1:
            self._lines[path] = line
        self._skip(_SPACE)
        self._at += brackets
        return path

    def _pair(self, table: KeyPath) -> None:
        line = self._line()
        path = table
        for key in self._key():
            path = (*path, key)
            self._lines.setdefault(path, line)
        self._skip(_SPACE)
        self._at += 1  # the equals sign
        self._value(path)

    def _key(self) -> list[str]:
        parts = []
        while True:
            self._skip(_SPACE)
            parts.append(self._part())
            self._skip(_SPACE)
            if not self._peek("."):
                return parts
            self._at += 1

    def _part(self) -> str:
        if self._peek('"') or self._peek("'"):
            quoted = self._take(_STRING)
            return str(tomllib.loads(f"k = {quoted}")["k"])
        return self._take(_BARE)

    def _value(self, path: KeyPath) -> None:
        self._skip(_SPACE)
        if self._peek("["):
            self._array(path)
        elif self._peek("{"):
            self._inline_table(path)
        elif self._peek('"') or self._peek("'"):
            self._take(_STRING)
        else:
            self._take(_SCALAR)

    def _array(self, path: KeyPath) -> None:
        self._at += 1
        number = 0
        while self._skip(_BLANK) and not self._peek("]"):
            before = self._at
            self._lines.setdefault((*path, number), self._line())
            self._value((*path, number))
            number += 1
            self._skip(_BLANK)
            if self._peek(","):
                self._at += 1
            if self._at == before:
                return
        self._at += 1

    def _inline_table(self, path: KeyPath) -> None:
        self._at += 1
        while self._skip(_BLANK) and not self._peek("}"):
            before = self._at
            self._pair(path)
            self._skip(_BLANK)
            if self._peek(","):
                self._at += 1
            if self._at == before:
                return
        self._at += 1

    def _skip(self, pattern: re.Pattern[str]) -> bool:
        """Skip the match of ``pattern``, which may be empty; return whether any text is left."""
        found = pattern.match(self._text, self._at)
        self._at = found.end() if found else self._at
        return self._at < len(self._text)

    def _take(self, pattern: re.Pattern[str]) -> str:
        found = pattern.match(self._text, self._at)
        self._at = found.end() if found else self._at
        return found[0] if found else ""

    def _peek(self, text: str) -> bool:
        return self._text.startswith(text, self._at)

    def _line(self) -> int:
        return bisect_right(self._newlines, self._at - 1) + 1
