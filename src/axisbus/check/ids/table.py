"""The table of all checks of a cell file by id: the finding, its severity, the remedy, and the reason."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from axisbus.check.context import Check
from axisbus.drives import registry
from axisbus.eds.rules.table import Rule, rows_of, table

UNREADABLE = "C010"  # an EDS or DCF
READER = "reader"  # findings of reading the file itself, which have their ids from the reader
PART = "check_ids"  # of a drive plug-in: a function that returns the rows of its table; a check is module.function in its package
_PACKAGE = "axisbus.check."


@cache
def checks() -> Mapping[str, Rule]:
    """Return all checks by id, in the order of their numbers, with those of drive plug-ins. Blocks while plug-ins are imported."""
    rows = [*_rows(), *(row for part in registry.parts(PART) for row in part())]
    return table(sorted(rows, key=lambda row: row["rule"]))


@cache
def ids() -> Mapping[str, str]:
    """Return the id of each check of this package by its function: ``limits.torque``."""
    return {row["check"]: row["rule"] for row in _rows() if row["check"] != READER}


def id_of(check: Check) -> str:
    """Return the id of a check; empty if the check only runs other checks, which have ids of their own."""
    if check.__module__.startswith(_PACKAGE):
        return ids().get(f"{check.__module__.removeprefix(_PACKAGE)}.{check.__name__}", "")
    name = f"{check.__module__}.{check.__name__}"
    parts = ((part.__module__.rpartition(".")[0], part()) for part in registry.parts(PART))
    return next(
        (row["rule"] for package, rows in parts for row in rows if f"{package}.{row['check']}" == name), ""
    )


@cache
def _rows() -> list[dict[str, str]]:
    return rows_of(__package__, "checks.tsv")
