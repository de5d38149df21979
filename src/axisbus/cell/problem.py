"""Combine findings about a cell that are the same for several of its axes, nodes, groups or inputs."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from axisbus.toml.problem import CellProblem as CellProblem
from axisbus.toml.problem import errors as errors
from axisbus.wording import listed


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
