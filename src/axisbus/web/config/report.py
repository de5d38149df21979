"""The result of a configuration job, as sent to the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

from axisbus.web.config.files import Dcf
from axisbus.web.view import Values
from axisbus.wording import counted

MAX_ROWS, _MAX_LINES = 300, 100  # the most rows and lines that are shown
_TEXT, _LINE = 200, 2000  # characters of a text in a row, and of a line


class ConfigJobKind(Enum):
    """The kind of a job, and its name."""

    BACKUP = "backup"
    COMPARE = "compare"
    WOULD_RESTORE = "would_restore"
    RESTORE = "restore"

    @property
    def text(self) -> str:
        """The job in words."""
        return _TEXTS[self]


_TEXTS = {
    ConfigJobKind.BACKUP: "the backup",
    ConfigJobKind.COMPARE: "the comparison",
    ConfigJobKind.WOULD_RESTORE: "the dry run of a restore",
    ConfigJobKind.RESTORE: "the restore of settings",
}


@dataclass(frozen=True, slots=True)
class ConfigJob:
    """A job of a page for a node, with the file that the page has uploaded if the job needs one."""

    kind: ConfigJobKind
    page: int
    node: int
    file: Dcf | None = None


@dataclass(frozen=True, slots=True)
class ConfigReport:
    """``text`` is the summary, ``lines`` are the details; a table has ``titles`` and ``rows``.

    ``refusal`` has the three texts of an error that says why not everything is restored here; ``command`` is the command that does
    it. ``dcf``: the backup. ``broken``: the three texts of an error that ended a restore early. ``left_out``: the number of rows
    that ``bounded`` has left out.
    """

    text: str
    lines: tuple[str, ...] = ()
    titles: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    refusal: Mapping[str, str] = field(default_factory=dict)
    command: str = ""
    dcf: Dcf | None = None
    broken: Mapping[str, str] = field(default_factory=dict)
    left_out: int = 0

    def bounded(self) -> ConfigReport:
        """Return the report without what is not shown: every page gets it, and a file may contain long and many names."""
        lines = self.lines
        if len(lines) > _MAX_LINES:
            more = counted(len(lines) - _MAX_LINES + 1, "more line")
            lines = (*lines[: _MAX_LINES - 1], f"... and {more}")
        return replace(
            self,
            text=cut(self.text, _LINE),
            lines=tuple(cut(line, _LINE) for line in lines),
            rows=tuple(tuple(cut(text, _TEXT) for text in row) for row in self.rows[:MAX_ROWS]),
            refusal=bounded_texts(self.refusal),
            broken=bounded_texts(self.broken),
            left_out=self.left_out + max(0, len(self.rows) - MAX_ROWS),
        )

    def as_values(self) -> Values:
        """Return the report as plain values."""
        return {
            "text": self.text,
            "lines": list(self.lines),
            "titles": list(self.titles),
            "rows": [list(row) for row in self.rows[:MAX_ROWS]],
            "all": len(self.rows) + self.left_out,
            "refusal": dict(self.refusal) or None,
            "command": self.command,
            "broken": dict(self.broken) or None,
            "file": None if self.dcf is None else self.dcf.name,
        }


@dataclass(frozen=True, slots=True)
class ConfigProgress:
    """The progress of a job: ``done`` of ``whole`` objects; ``report`` or ``error`` (its three texts) once it is ``over``."""

    config_job: ConfigJob
    done: int = 0
    whole: int = 0
    over: bool = False
    report: ConfigReport | None = None
    error: Mapping[str, str] = field(default_factory=dict)

    def as_values(self) -> Values:
        """Return the progress as plain values."""
        return {
            "kind": self.config_job.kind.value,
            "what": self.config_job.kind.text,
            "page": self.config_job.page,
            "node": self.config_job.node,
            "done": self.done,
            "whole": self.whole,
            "over": self.over,
            "report": None if self.report is None else self.report.as_values(),
            "error": dict(self.error) or None,
        }


def cut(text: str, max_length: int) -> str:
    """Return a text with at most so many characters, and a mark if it is longer."""
    return text if len(text) <= max_length else f"{text[:max_length]} ..."


def bounded_texts(texts: Mapping[str, str]) -> dict[str, str]:
    """Return the texts of an error, none longer than a line may be."""
    return {name: cut(text, _LINE) for name, text in texts.items()}
