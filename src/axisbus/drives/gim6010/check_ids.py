"""The table of the checks of a module, apart from their code: a cell file is checked and explained without that code."""

from __future__ import annotations

from functools import cache

from axisbus.eds.rules.table import rows_of


@cache
def rows() -> list[dict[str, str]]:
    return rows_of(__package__, "checks.tsv")
