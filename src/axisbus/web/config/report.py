"""The result of a configuration job, as sent to the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from axisbus.web.config.files import Dcf
from axisbus.web.view.axes import Values

MOST = 300  # the most rows that are shown


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
    it. ``dcf``: the backup. ``broken``: the three texts of an error that ended a restore early.
    """

    text: str
    lines: tuple[str, ...] = ()
    titles: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    refusal: Mapping[str, str] = field(default_factory=dict)
    command: str = ""
    dcf: Dcf | None = None
    broken: Mapping[str, str] = field(default_factory=dict)

    def told(self) -> Values:
        """Return the report as plain values."""
        return {
            "text": self.text,
            "lines": list(self.lines),
            "titles": list(self.titles),
            "rows": [list(row) for row in self.rows[:MOST]],
            "all": len(self.rows),
            "refusal": dict(self.refusal) or None,
            "command": self.command,
            "broken": dict(self.broken) or None,
            "file": None if self.dcf is None else self.dcf.name,
        }


@dataclass(frozen=True, slots=True)
class ConfigProgress:
    """The progress of a job: ``done`` of ``whole`` objects; ``report`` or ``error`` (its three texts) once it is ``over``."""

    wanted: ConfigJob
    done: int = 0
    whole: int = 0
    over: bool = False
    report: ConfigReport | None = None
    error: Mapping[str, str] = field(default_factory=dict)

    def told(self) -> Values:
        """Return the progress as plain values."""
        return {
            "kind": self.wanted.kind.value,
            "what": self.wanted.kind.text,
            "page": self.wanted.page,
            "node": self.wanted.node,
            "done": self.done,
            "whole": self.whole,
            "over": self.over,
            "report": None if self.report is None else self.report.told(),
            "error": dict(self.error) or None,
        }
