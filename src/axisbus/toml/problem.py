"""One error, danger or note about a TOML file, with its location and its remedy; and its conversion to and from an exception."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.eds.model import Severity
from axisbus.errors import ConfigError, EdsError
from axisbus.wording import counted

UNREADABLE = "C001"  # the id of a file that cannot be read; ``axisbus.check`` has the table of all ids
_SHOWN = 10  # maximum number of further errors in the text of an exception


@dataclass(frozen=True, slots=True)
class CellProblem:
    """A finding about a cell: ``line`` counts from 1 (0: the whole file).

    An error prevents the cell from being opened; a warning is dangerous or may surprise; a note is only information. ``page`` is
    the page of its symptom; ``rule`` is the id of the check that found it, such as C017.
    """

    severity: Severity
    file: str
    line: int
    message: str
    observed: str = ""
    remedy: str = ""
    page: str = "cell-file"
    rule: str = ""

    def __str__(self) -> str:
        return self._text(self.message)

    @property
    def with_rule(self) -> str:
        """The same text with the id of the check after its message."""
        return self._text(f"{self.message} [{self.rule}]")

    def _text(self, message: str) -> str:
        where = f"{self.file}:{self.line}" if self.line else self.file
        lines = [f"{where}: {self.severity.value}: {message}"]
        if self.observed:
            lines.append(f"  observed: {self.observed}")
        if self.remedy:
            lines.append(f"  remedy:   {self.remedy}")
        return "\n".join(lines)

    @property
    def rank(self) -> tuple[int, int]:
        """Key to sort by: the line, then the worst first."""
        return self.line, self.severity.rank


def errors(problems: list[CellProblem]) -> list[CellProblem]:
    """Return the problems that prevent a cell from being opened."""
    return [problem for problem in problems if problem.severity is Severity.ERROR]


def as_problem(error: ConfigError) -> CellProblem:
    """Return the error of a file that cannot be read as a finding."""
    prefix = f"{error.file}:{error.line}: " if error.line else f"{error.file}: "
    message = error.message.removeprefix(prefix)
    return CellProblem(
        Severity.ERROR, error.file, error.line, message, error.observed, error.remedy, rule=UNREADABLE
    )


def as_exception(wrong: list[CellProblem]) -> ConfigError:
    """Return the first of several errors as an exception, which lists the others."""
    first, others = wrong[0], wrong[1:]
    observed = [first.observed] if first.observed else []
    if others:
        observed.append(f"{counted(len(others), 'more error')}:")
        observed += [f"  {other.file}:{other.line}: {other.message}" for other in others[:_SHOWN]]
        observed += ["  ..."] * (len(others) > _SHOWN)
    kind = EdsError if first.page == "eds" else ConfigError
    return kind(
        first.message,
        file=first.file,
        line=first.line,
        observed="\n            ".join(observed),
        remedy=first.remedy,
    )
