"""The findings of ``axisbus eds check`` for the EDS of a node, as plain values; worst first."""

from __future__ import annotations

from axisbus.eds import checking
from axisbus.eds.model import Eds, EdsFinding
from axisbus.errors import AxisbusError
from axisbus.web.view.axes import Values, explained

MOST = 300


def findings(eds: Eds) -> Values:
    """Return the findings, their total number, and the error if the file could not be checked; may take a second."""
    try:
        found = sorted(checking.check(eds), key=lambda each: each.severity.rank)
    except AxisbusError as error:
        return {"all": 0, "shown": [], "error": explained(error)}
    return {"all": len(found), "shown": [_finding(each) for each in found[:MOST]], "error": None}


def _finding(each: EdsFinding) -> Values:
    where = "" if each.index is None else f"{each.index:04X}"
    return {
        "severity": each.severity.value,
        "rule": each.rule,
        "line": each.line,
        "index": where,
        "message": each.message,
        "remedy": each.remedy,
    }
