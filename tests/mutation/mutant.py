"""One small wrong change of one place in the source."""

from __future__ import annotations

import difflib
from dataclasses import dataclass


@dataclass(frozen=True, order=True)
class Mutant:
    """Bytes ``start`` to ``end`` of ``file`` become ``new``; ``lines`` are those of the statement that they belong to."""

    file: str  # relative to the root of the project
    start: int
    end: int
    new: str
    kind: str
    line: int
    lines: tuple[int, int]
    inside: str  # the qualified name of the function or class around it, "" at the top of the module
    names: tuple[str, ...] = ()  # outside a function: by which names others see it

    def apply(self, text: str) -> str:
        """Return the text of the file with this change."""
        data = text.encode()
        return (data[: self.start] + self.new.encode() + data[self.end :]).decode()

    def change(self, text: str) -> str:
        """Return the change in a few characters: ``old -> new``."""
        old = " ".join(text.encode()[self.start : self.end].decode().split())
        return f"{old} -> {' '.join(self.new.split())}".strip()

    def diff(self, text: str) -> str:
        """Return the change as a diff of the lines that it touches."""
        lines = difflib.unified_diff(text.splitlines(), self.apply(text).splitlines(), lineterm="", n=0)
        return "\n".join(line for line in lines if not line.startswith(("---", "+++", "@@")))
