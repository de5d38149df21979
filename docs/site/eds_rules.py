"""The rules for EDS and DCF files, and the checks of cell files, generated from the tables of the checks."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import groupby

from texts import plain

from axisbus.check.ids.table import checks
from axisbus.eds.rules.table import Rule, rules

_ABOUT = """# Rules for EDS and DCF files

`axisbus eds check` applies {count} rules, from DS 306, CiA 301, CiA 402 and experience.
`axisbus eds check --explain D002` prints one of them in the terminal. The severity is the highest one that a violation can have.
"""
_FAMILIES = {
    "S": "Text",
    "F": "[FileInfo]",
    "D": "[DeviceInfo], [DummyUsage], [Comments]",
    "L": "Lists of objects",
    "O": "Objects",
    "B": "Compact sub-indices, and lists beside an object",
    "V": "Values",
    "P": "PDOs",
    "C": "CiA 301",
    "M": "CiA 402",
    "K": "DCF",
    "X": "Modules",
}


_ABOUT_CELLS = """# Checks of cell files

`axisbus check` applies {count} checks to a cell file. Each finding ends with the id of its check, such as [C019].
`axisbus check --explain C019` prints one of them in the terminal, and `axisbus check cell.toml --ignore C019` leaves out its
warnings and notes; errors are always shown. The severity is the highest one that a finding can have. The rules for EDS files
have ids of their own: `axisbus eds check` prints those.
"""


def pages() -> Mapping[str, str]:
    """Return the page of the rules, and that of the checks."""
    parts = [_ABOUT.format(count=len(rules()))]
    for family, found in groupby(rules().values(), key=lambda rule: rule.id[0]):
        parts += [f"## {plain(_FAMILIES[family])}\n", *map(_rule, found)]
    cells = [_ABOUT_CELLS.format(count=len(checks())), "## The checks\n", *map(_rule, checks().values())]
    return {"reference/eds-rules": "\n".join(parts), "reference/cell-checks": "\n".join(cells)}


def _rule(rule: Rule) -> str:
    rows = [("to do", plain(rule.remedy))]
    if rule.clause:
        rows.insert(0, ("stands in", plain(rule.clause)))
    head = f"### {rule.id}\n\n**{rule.severity.value.capitalize()}.** {plain(rule.title)}\n\n{plain(rule.explanation)}\n"
    return f"{head}\n" + "\n".join(f"- *{name}:* {text}" for name, text in rows) + "\n"
