"""Differences between two EDS files as lines for a user, and as plain values for programs."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby

from axisbus.eds.model import Eds
from axisbus.eds.report import overview, wording
from axisbus.eds.report.difference import DifferenceGroup, EdsDifference

_DIGITS = re.compile(r"\d+")


def lines(a: Eds, b: Eds, differences: Sequence[EdsDifference], node_id: int | None) -> Iterator[str]:
    """Yield the comparison as lines: the files, the differences that matter for a master, then all differences by group."""
    yield f"A  {_file(a)}"
    yield f"B  {_file(b)}"
    if node_id is not None:
        yield f"   values for node {node_id}"
    if not differences:
        yield "no difference in meaning"
        return
    weighty = [each for each in differences if each.matters]
    if weighty:
        yield ""
        yield f"Important for a master: {len(weighty)}"
        for run in _runs(weighty):
            yield f"  {_where(run)}{run[0].what}: {run[0].matters}"
    for group, members in groupby(differences, key=lambda each: each.group):
        found = list(members)
        yield ""
        yield f"{group.value}: {len(found)}"
        for run in _runs(found):
            yield f"  {_where(run)}{run[0].what}: {change(run[0])}{_place(run[0])}"


def change(each: EdsDifference) -> str:
    """Return both sides of a difference: ``10 -> 20``; an absent side is a dash."""
    if each.group is DifferenceGroup.ADDED:
        return each.b
    return each.a if each.group is DifferenceGroup.REMOVED else f"{each.a or '-'} -> {each.b or '-'}"


def plain(a: Eds, b: Eds, differences: Sequence[EdsDifference], node_id: int | None) -> dict[str, object]:
    """Return the comparison for JSON: counts by group, and each difference; lines count from 1 (0: none)."""
    counts = Counter(each.group for each in differences)
    return {
        "a": a.source,
        "b": b.source,
        "node_id": node_id,
        "different": bool(differences),
        "counts": {group.value: counts[group] for group in DifferenceGroup},
        "differences": [
            {
                "group": each.group.value,
                "index": each.index,
                "subindex": each.subindex,
                "what": each.what,
                "a": each.a,
                "b": each.b,
                "matters": each.matters,
                "line_a": each.line_a,
                "line_b": each.line_b,
            }
            for each in differences
        ],
    }


def _file(eds: Eds) -> str:
    info = eds.info.get("fileinfo", {})
    version = overview.file_version(info)
    date = info.get("modificationdate") or info.get("creationdate", "")
    about = ", ".join(
        part
        for part in (overview.overview(eds).title, f"file version {version}" if version else "", date)
        if part
    )
    return f"{eds.source} ({about})"


def _runs(found: Sequence[EdsDifference]) -> Iterator[list[EdsDifference]]:
    """Yield runs of neighbouring sub-indices with the same difference."""
    run: list[EdsDifference] = []
    for each in found:
        if run and not _follows(run[-1], each):
            yield run
            run = []
        run.append(each)
    if run:
        yield run


def _follows(one: EdsDifference, other: EdsDifference) -> bool:
    if one.subindex is None or other.index != one.index or other.subindex != one.subindex + 1:
        return False
    return _said(one) == _said(other)


def _said(each: EdsDifference) -> tuple[DifferenceGroup, str, str, str, str]:
    return each.group, _DIGITS.sub("#", each.what), each.a, each.b, each.matters


def _where(run: Sequence[EdsDifference]) -> str:
    first, last = run[0], run[-1]
    if first.index is None:
        return ""
    if len(run) == 1:
        return f"{wording.place(first.index, first.subindex)} "
    return f"{wording.place(first.index, first.subindex)}-{last.subindex:02X} "


def _place(each: EdsDifference) -> str:
    texts = [f"{side}:{line}" for side, line in (("A", each.line_a), ("B", each.line_b)) if line]
    return f"  ({', '.join(texts)})" if texts else ""
