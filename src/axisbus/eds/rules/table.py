"""The table of all rules for an EDS or DCF: the severity of a breach, the clause of the rule, and the remedy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

from axisbus.eds.model import Severity


class Rule(NamedTuple):
    """One rule, by its stable ``id``.

    ``severity`` is the highest severity of a breach, ``clause`` is the clause of the standard, ``title`` a sentence with the
    finding, ``remedy`` the first remedy, ``explanation`` the reason for the rule.
    """

    id: str
    severity: Severity
    clause: str
    title: str
    remedy: str
    explanation: str


@cache
def rules() -> Mapping[str, Rule]:
    """Return all rules by id, in the order of the families: text first, modules last."""
    return table(rows_of(__package__, "rules.tsv"))


def rows_of(package: str, name: str) -> list[dict[str, str]]:
    """Return the rows of a table of rules that ships with the code of a package."""
    from axisbus.cia301 import (
        tables,  # imported only here: reading a clean file needs no rule, so start-up is faster
    )

    return tables.rows(package, name)


def table(rows: Iterable[Mapping[str, str]]) -> Mapping[str, Rule]:
    """Return rules by id, in the order of their rows."""
    return MappingProxyType(
        {
            row["rule"]: Rule(
                row["rule"],
                Severity(row["severity"]),
                row.get("clause", ""),
                row["title"],
                row["remedy"],
                row["explanation"],
            )
            for row in rows
        }
    )
