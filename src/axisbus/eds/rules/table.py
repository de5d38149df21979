"""The table of all rules for an EDS or DCF: the severity of a breach, the clause of the rule, and the remedy."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

from axisbus.eds.model import Severity
from axisbus.errors import ArgumentError


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


# -- Select rules by ids and by beginnings of ids ----------------------------------------------------------------------


_ALL = 0  # length of the empty prefix, with which every id begins
_NONE = -1


def chooser(
    select: str | Iterable[str] = (), ignore: str | Iterable[str] = (), of: RuleIds | None = None
) -> Callable[[str], bool]:
    """Return a test for ids: selected (all, if nothing is selected) and not ignored.

    ``V`` means all ids that begin with it, a complete id (``V003``) only that rule; case does not matter. If both options match,
    the longer text decides: ignoring ``V`` and selecting ``V003`` leaves V003. ``of`` are the rules; None means those of EDS files.

    Raises:
        ArgumentError: no rule's id begins with a given text.
    """
    known = RuleIds(rules()) if of is None else of
    wanted, unwanted = known.named(select, "select"), known.named(ignore, "ignore")

    def test(rule: str) -> bool:
        chosen = known.longest(rule, wanted) if wanted else _ALL
        return chosen > known.longest(rule, unwanted)

    return test


class RuleIds:
    """The existing ids; ``command`` prints all of them with ``--list``."""

    def __init__(self, ids: Collection[str], command: str = "axisbus eds check") -> None:
        self._ids = ids
        self._command = command

    def named(self, given: str | Iterable[str], option: str) -> frozenset[str]:
        """Return ids and beginnings of ids in the case of the table; raises ``ArgumentError`` if no id begins with a text."""
        texts = (given,) if isinstance(given, str) else given
        return frozenset(self._as_printed(text.strip(), option) for text in texts)

    def _as_printed(self, text: str, option: str) -> str:
        found = self.starting(text)
        if not text or not found:
            near = difflib.get_close_matches(text.upper(), self._ids, n=1, cutoff=0.5)
            raise ArgumentError(
                f"{option}: no rule's id begins with {text[:20]!r}",
                remedy=f"{f'did you mean {near[0]}? ' if near else ''}the list has all: {self._command} --list",
            )
        return found[0][: len(text)]

    def starting(self, text: str) -> list[str]:
        """Return the ids that begin with this text in any case; only the rule itself if it is a complete id."""
        exact = [rule for rule in self._ids if rule.lower() == text.lower()]
        return exact or [rule for rule in self._ids if rule.lower().startswith(text.lower())]

    def longest(self, rule: str, prefixes: Collection[str]) -> int:
        """Return the length of the longest prefix that matches a rule."""
        meant = [len(prefix) for prefix in prefixes if rule == prefix or self._begins(rule, prefix)]
        return max(meant, default=_NONE)

    def _begins(self, rule: str, prefix: str) -> bool:
        return prefix not in self._ids and rule.startswith(prefix)
