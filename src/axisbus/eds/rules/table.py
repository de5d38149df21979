"""Every rule that an EDS or DCF is checked by, as one table: how bad a breach is, where the rule stands, and what to do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

from axisbus.eds.model import Severity


class Rule(NamedTuple):
    """One rule, by its stable ``id``.

    ``severity`` is the worst that a breach can be, ``clause`` where the rule stands, ``title`` a sentence that says what is found,
    ``remedy`` what to do first, ``explanation`` why it matters.
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
    """Return the rows of a table of rules that ships beside the code of a package."""
    from axisbus.cia301 import (
        tables,  # reading a clean file asks for no rule, and start-up is spared its imports
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
