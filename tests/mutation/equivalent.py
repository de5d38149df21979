"""The mutants without an observable change, each with the reason, from ``equivalent.toml``."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from mutation.mutant import Mutant

_KEYS = {"file", "line", "change", "reason"}


@dataclass(frozen=True)
class Equivalent:
    """A change of a line, known by the line's text; ``inside``: the function, if several have such a line."""

    file: str
    line: str
    change: str
    reason: str
    inside: str = ""

    def matches(self, mutant: Mutant, text: str) -> bool:
        """Whether this entry speaks of ``mutant`` of a file with ``text``."""
        if mutant.file != self.file or (self.inside and mutant.inside != self.inside):
            return False
        return text.splitlines()[mutant.line - 1].strip() == self.line and mutant.change(text) == self.change


def load(path: Path) -> list[Equivalent]:
    """Read the entries; one without a reason is refused."""
    entries = tomllib.loads(path.read_text()).get("mutant", [])
    for entry in entries:
        if not set(entry) >= _KEYS or not entry["reason"].strip():
            raise SystemExit(f"{path}: an entry needs {', '.join(sorted(_KEYS))}: {entry}")
    return [Equivalent(**entry) for entry in entries]


def stale(entries: list[Equivalent], found: list[Mutant], texts: dict[str, str]) -> list[Equivalent]:
    """Return the entries that no longer speak of any mutant."""
    by_file: dict[str, list[Mutant]] = {}
    for mutant in found:
        by_file.setdefault(mutant.file, []).append(mutant)
    return [e for e in entries if not any(e.matches(m, texts[m.file]) for m in by_file.get(e.file, []))]
