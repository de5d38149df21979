"""One error, danger or note about a cell file, with its location and its remedy."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from axisbus.eds.model import Severity
from axisbus.wording import listed


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


# -- one finding for several axes or nodes --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class SharedProblem:
    """A finding that several axes, nodes, groups or inputs share: ``subjects`` are their names, ``lines`` the line of each.

    ``problem`` is the common finding, at the first line. If the finding has only one subject or none, ``subjects`` is empty.
    """

    problem: CellProblem
    subjects: tuple[str, ...] = ()
    lines: tuple[int, ...] = ()


_SUBJECT = re.compile(
    r"(?P<kind>virtual axis|axis|node|group) (?P<name>[\w-]+)(?P<colon>:?) (?P<said>.*)"
    r"|\[(?P<io>io)\.(?P<point>[\w-]+)\](?P<points>:) (?P<found>.*)",
    re.DOTALL,
)
_SEVERAL = {"virtual axis": "virtual axes", "axis": "axes", "node": "nodes", "group": "groups", "io": "io"}
_TABLES = "axes|nodes|groups|io"
_Parts = tuple[str, str, str, str]  # the kind of thing, its name, a colon or none, and the statement


def shared(problems: Iterable[CellProblem]) -> list[SharedProblem]:
    """Combine findings that are the same for several axes, nodes, groups or inputs; the order of the findings is kept."""
    found: dict[tuple[object, ...], list[tuple[CellProblem, _Parts | None]]] = {}
    for problem in problems:
        parts = _parts(problem.message)
        found.setdefault(_without_name(problem, parts), []).append((problem, parts))
    return [_as_one(each) for each in found.values()]


def _parts(message: str) -> _Parts | None:
    match = _SUBJECT.fullmatch(message)
    if match is None:
        return None
    if match["io"]:
        return match["io"], match["point"], match["points"], match["found"]
    return match["kind"], match["name"], match["colon"], match["said"]


def _without_name(problem: CellProblem, parts: _Parts | None) -> tuple[object, ...]:
    """Return the key that is equal for two findings with the same statement about two subjects."""
    texts = (problem.message, problem.observed, problem.remedy)
    key = (problem.rule, problem.severity, problem.file, problem.page)
    if parts is None:
        return (*key, problem.line, *texts)
    kind, name, colon, said = parts
    return (*key, kind, colon, *(_unnamed(text, name) for text in (said, *texts[1:])))


def _unnamed(text: str, name: str) -> str:
    """Return a text with NAME instead of a name, in ``[axes.x.stop]`` and in ``axis x``."""
    return re.sub(rf"(\[(?:{_TABLES})\.|\b(?:axis|node|group) ){re.escape(name)}(?![\w-])", r"\1NAME", text)


def _as_one(each: list[tuple[CellProblem, _Parts | None]]) -> SharedProblem:
    first, parts = each[0]
    if parts is None or len(each) == 1:
        return SharedProblem(first)
    kind, name, colon, said = parts
    names = tuple(found[1] for _, found in each if found is not None)
    lines = tuple(problem.line for problem, _ in each)
    said = _unnamed(said, name) if colon else f"each {_unnamed(said, name)}"
    message = f"{_SEVERAL[kind]} {listed(names)} (lines {listed(map(str, lines))}): {said}"
    observed, remedy = (_unnamed(text, name) for text in (first.observed, first.remedy))
    return SharedProblem(replace(first, message=message, observed=observed, remedy=remedy), names, lines)
