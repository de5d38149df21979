"""The line of each table, key and array element of a TOML text.

Theory of operation. ``tomllib`` returns values without their locations. Therefore ``_Locator`` walks the same text once more. It
knows only the TOML syntax that separates keys from values: headers, dotted and quoted keys, strings, comments, brackets. It runs
only on a text that ``tomllib`` has accepted, so it does not need to find errors.
"""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_right

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
