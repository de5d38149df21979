"""One thing found wrong, odd or worth knowing in a cell file, with its place and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.eds.model import Severity


@dataclass(frozen=True, slots=True)
class Problem:
    """A finding about a cell: ``line`` counts from 1 (0: the whole file).

    An error keeps the cell from being opened; a warning is dangerous or will surprise; a note is only worth knowing.
    ``page`` is that of its symptom.
    """

    severity: Severity
    file: str
    line: int
    message: str
    observed: str = ""
    remedy: str = ""
    page: str = "cell-file"

    def __str__(self) -> str:
        where = f"{self.file}:{self.line}" if self.line else self.file
        lines = [f"{where}: {self.severity.value}: {self.message}"]
        if self.observed:
            lines.append(f"  observed: {self.observed}")
        if self.remedy:
            lines.append(f"  remedy:   {self.remedy}")
        return "\n".join(lines)

    @property
    def rank(self) -> tuple[int, int]:
        """Key to sort by: the line, then the worst first."""
        return self.line, self.severity.rank


def errors(problems: list[Problem]) -> list[Problem]:
    """Return those that keep a cell from being opened."""
    return [problem for problem in problems if problem.severity is Severity.ERROR]
