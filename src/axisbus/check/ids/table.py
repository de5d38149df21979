"""The table of all checks of a cell file by id: the finding, its severity, the remedy, and the reason."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from axisbus.check.context import Check
from axisbus.eds.rules.table import Rule, rows_of, table

UNREADABLE = "C010"  # an EDS or DCF
READER = "reader"  # findings of reading the file itself, which have their ids from the reader
_PACKAGE = "axisbus.check."


@cache
def checks() -> Mapping[str, Rule]:
    """Return all checks by id: those of the file itself first, those of the bus load last."""
    return table(_rows())


@cache
def ids() -> Mapping[str, str]:
    """Return the id of each check by its function: ``limits.torque``; that of a drive plug-in from ``drives`` on."""
    return {row["check"]: row["rule"] for row in _rows() if row["check"] != READER}


def id_of(check: Check) -> str:
    """Return the id of a check; empty if the check only runs other checks, which have ids of their own."""
    module = check.__module__.removeprefix(_PACKAGE).removeprefix("axisbus.")
    return ids().get(f"{module}.{check.__name__}", "")


@cache
def _rows() -> list[dict[str, str]]:
    return rows_of(__package__, "checks.tsv")
