"""A terminal of a fixed size for tests: its screen, and the lines that have scrolled off it."""

from __future__ import annotations

import io
import re

_SEQUENCE = re.compile(r"\x1b\[(\??)(\d*)(?:;\d+)*([A-Za-z])|(\r\n|\r|\n)|([^\x1b\r\n])", re.DOTALL)


class Screen(io.StringIO):
    """Shows the output of a program. It knows line feeds, returns, moving up, and erasing a line; colours change nothing."""

    def __init__(self, width: int, height: int) -> None:
        super().__init__()
        self.width, self.height = width, height
        self.scrolled: list[str] = []
        self._rows: list[list[str]] = [[]]
        self._row = self._column = 0

    def isatty(self) -> bool:
        return True

    @property
    def lines(self) -> list[str]:
        """The lines on the screen."""
        return ["".join(row).rstrip() for row in self._rows]

    def write(self, text: str) -> int:
        for private, number, command, feed, letter in _SEQUENCE.findall(text):
            if letter:
                self._put(letter)
            elif "\n" in feed:
                self._column = 0
                self._feed()
            elif feed:
                self._column = 0
            elif command == "A":
                self._row = max(0, self._row - int(number or 1))
            elif command == "K":
                self._rows[self._row] = []
            else:
                assert command in "mhl", (private, number, command)
        return len(text)

    def _put(self, letter: str) -> None:
        if self._column == self.width:
            self._column = 0
            self._feed()
        row = self._rows[self._row]
        row.extend(" " * (self._column + 1 - len(row)))
        row[self._column] = letter
        self._column += 1

    def _feed(self) -> None:
        self._row += 1
        if self._row == len(self._rows):
            self._rows.append([])
        if len(self._rows) > self.height:
            self.scrolled.append("".join(self._rows.pop(0)).rstrip())
            self._row -= 1
