"""Run all rules for one parse result, and sort their findings.

The families of rules are other modules of this package; each has a table ``LOOKS`` of functions by rule id, which take a
``RuleContext`` and yield ``Hit``s. The reader's own findings (``Eds.findings``) have the same form and are added here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.model import EdsFinding
from axisbus.eds.rules import (
    cia301,
    cia402,
    compactlists,
    concise,
    dcf,
    deviceinfo,
    fileinfo,
    lists,
    modes,
    modules,
    objects,
    pdo,
    pdo_parameters,
    records,
    services,
    suppress_followups,
    text,
    truncated_file,
    values,
)
from axisbus.eds.rules.context import Hit, Look, RuleContext
from axisbus.eds.rules.table import Rule, rules
from axisbus.errors import EdsError
from axisbus.wording import counted

MAX_OF_A_RULE = 10_000  # a file of random data must not fill the memory
MORE, UNREADABLE = "S099", "S000"

_FAMILIES = (
    *(
        text,
        truncated_file,
        fileinfo,
        deviceinfo,
        lists,
        objects,
        records,
        compactlists,
        values,
        pdo,
        pdo_parameters,
    ),
    *(cia301, services, cia402, modes, dcf, concise, modules),
)
LOOKS: dict[str, Look] = {rule: look for family in _FAMILIES for rule, look in family.LOOKS.items()}


def check(reading: EdsParseResult, wanted: Callable[[str], bool]) -> tuple[EdsFinding, ...]:
    """Return the findings of the ``wanted`` rules (by id), in the order of lines and columns, then of the rules' ids.

    All rules are run, even unwanted ones: a consequence of a finding is left out even if that finding is not shown.
    """
    sheet = RuleContext(reading)
    found = list(reading.eds.findings)
    for rule, look in LOOKS.items():
        found += _findings(rules()[rule], look(sheet))
    return tuple(
        sorted((each for each in suppress_followups.causes(sheet, found) if wanted(each.rule)), key=_place)
    )


def _findings(rule: Rule, hits: Iterable[Hit]) -> Iterator[EdsFinding]:
    left_out = 0
    for number, hit in enumerate(dict.fromkeys(hits)):
        if number < MAX_OF_A_RULE:
            yield finding(rule, hit)
        else:
            left_out += 1
    if left_out:
        more = counted(left_out, f"more finding of {rule.id} is", f"more findings of {rule.id} are")
        yield finding(rules()[MORE], Hit(0, 0, f"{more} not listed"))


def finding(rule: Rule, hit: Hit) -> EdsFinding:
    """Return a hit as a finding, with the rule's data from the table."""
    severity = rule.severity if hit.severity is None else hit.severity
    return EdsFinding(
        rule.id, severity, hit.line, hit.column, hit.message, rule.remedy, hit.index, hit.subindex
    )


def _place(found: EdsFinding) -> tuple[int, int, str]:
    return found.line, found.column, found.rule


def unreadable(error: EdsError) -> EdsFinding:
    """Return the finding for a file that cannot be checked at all."""
    observed = f": {error.observed}" if error.observed else ""
    message = error.message.removeprefix(f"{error.file}: ")
    found = finding(rules()[UNREADABLE], Hit(0, 0, f"{message}{observed}"))
    return replace(found, remedy=error.remedy) if error.remedy else found
