"""What a job about a configuration has come to, as the page is told it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from axisbus.web.config.files import Dcf
from axisbus.web.view.axes import Values

MOST = 300  # rows that are shown


class ConfigJobKind(Enum):
    """What is done with a node, and what that is called."""

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
    """A job: ``page`` has asked for it, of a node, with the file that it has brought where the job needs one."""

    kind: ConfigJobKind
    page: int
    node: int
    file: Dcf | None = None


@dataclass(frozen=True, slots=True)
class ConfigReport:
    """``text`` sums it up, ``lines`` say it whole; a table has ``titles`` and ``rows``.

    ``refusal`` are the three texts of an error which says why not all is restored here, ``command`` is what to type for that.
    ``dcf``: what was made. ``broken``: the three texts of an error that ended a restore on its way.
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
        """Return it as plain values."""
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
    """How far a job is: ``done`` of ``whole`` objects; ``report`` or ``error`` (its three texts) once it is ``over``."""

    wanted: ConfigJob
    done: int = 0
    whole: int = 0
    over: bool = False
    report: ConfigReport | None = None
    error: Mapping[str, str] = field(default_factory=dict)

    def told(self) -> Values:
        """Return it as plain values."""
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
