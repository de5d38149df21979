"""Run all rules for one parse result, and sort their findings.

The families of rules are other modules of this package. A function that is marked with the id of a rule (``finds``) looks for the
breaches of this rule: it takes a ``RuleContext`` and yields ``Hit``s. The reader's own findings (``Eds.findings``) have the same
form and are added here.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType
from axisbus.eds.io import values as entry_values
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.io.text import entry_of
from axisbus.eds.model import EdsFinding, Number, Severity
from axisbus.eds.rules import (
    cia301,
    cia402,
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
    standard,
    text,
    truncated_file,
)
from axisbus.eds.rules.context import RULE_FUNCTIONS, Hit, RuleContext
from axisbus.eds.rules.table import Rule, rules
from axisbus.errors import EdsError
from axisbus.wording import counted

MAX_OF_A_RULE = 10_000  # a file of random data must not fill the memory
MORE, UNREADABLE = "S099", "S000"


# The families register their functions when they are imported.
_FAMILIES = (
    *(text, truncated_file, fileinfo, deviceinfo, lists, objects, records, pdo, pdo_parameters),
    *(cia301, cia402, modes, dcf, modules),
)


def check(reading: EdsParseResult, wanted: Callable[[str], bool]) -> tuple[EdsFinding, ...]:
    """Return the findings of the ``wanted`` rules (by id), in the order of lines and columns, then of the rules' ids.

    All rules are run, even unwanted ones: a consequence of a finding is left out even if that finding is not shown.
    """
    context = RuleContext(reading)
    found = list(reading.eds.findings)
    for rule, function in RULE_FUNCTIONS.items():
        found += _findings(rules()[rule], function(context))
    return tuple(sorted((each for each in causes(context, found) if wanted(each.rule)), key=_place))


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


# -- One defect, one finding: leave out findings that are only consequences of others ----------------------------------
#
# Some findings of the reader are corrected here with the whole entry in view: which of two lines is wrong, and whether the standard
# leaves the point open.


_WRONG_TYPE = frozenset(("C003", "M002", "O009", "P009"))  # the data type is not the standard's
_OF_A_VALUE = frozenset(  # findings that depend on the data type
    (
        *("V001", "V002", "V003", "V004", "V005", "V009", "V010", "V011", "V012", "V014"),
        *("V016", "V017", "V018", "D004"),
    )
)
_WRONG_SHAPE = frozenset(("O004", "O008", "O011"))  # it is uncertain whether the object has sub-indices
_OF_A_SHAPE = frozenset(  # findings that depend on the kind of object
    ("O002", "O003", "O017", "O018", "O020", "O028", "O031", "C005", "C008", "M006", "M014", "P008", "P011")
)
# A rule, and the rules that it explains if both have a finding for the same object.
_EXPLAINS = {
    "B001": frozenset(("O010",)),
    "O003": frozenset(("O028",)),
    "O013": frozenset(("O008", "O010")),
    "P008": frozenset(("P015",)),
}
_MISSPELT = "S017"
_MISSING = frozenset(  # findings at the header of the section with the misspelt key
    ("O001", "O002", "O003", "O006", "O020", "O024", "O025", "O031", "C005", "L001", "M005", "M006", "P004")
)
_MIXED, _IDENTITY = "O026", "D004"


def causes(context: RuleContext, found: Iterable[EdsFinding]) -> list[EdsFinding]:
    """Return the findings without consequences of other findings."""
    whole = truncated_file.without_consequences(context, found)
    every = [_JUDGED[each.rule](context, each) if each.rule in _JUDGED else each for each in whole]
    typed = {(each.index, each.subindex) for each in every if each.rule in _WRONG_TYPE}
    mixed = {index for index, subindex in typed if subindex}  # an ARRAY with one wrong type has two types
    explained = {(rule, each.index) for each in every for rule in _EXPLAINS.get(each.rule, ())}
    misspelt = {_header(context, each.line) for each in every if each.rule == _MISSPELT}
    shaped = {each.index: each.line for each in every if each.rule in _WRONG_SHAPE}
    return [
        each
        for each in every
        if not (each.rule in _OF_A_VALUE and (each.index, each.subindex) in typed and _right(context, each))
        and (each.rule, each.index) not in explained
        and not (each.rule in _MISSING and each.line in misspelt)
        and not (each.rule == _MIXED and each.index in mixed)
        and not (each.rule in _OF_A_SHAPE and shaped.get(each.index, each.line) != each.line)
    ]


def _header(context: RuleContext, line: int) -> int:
    """Return the line of the section that contains a line, 0 if there is none."""
    return context.starts[bisect_right(context.starts, line) - 1]


def _right(context: RuleContext, finding: EdsFinding) -> bool:
    """Whether the value of a finding would be valid if the data type were the standard's."""
    kinds = _standard_types(context, finding.index or 0, finding.subindex or 0)
    if not finding.line or not kinds:
        return False
    _, text = entry_of(context.document.lines[finding.line - 1])
    return finding.rule == _IDENTITY or any(
        entry_values.parse(text, kind).value is not None for kind in kinds
    )


def _standard_types(context: RuleContext, index: int, subindex: int) -> tuple[DataType, ...]:
    entry = context.eds.objects.get(index)
    if subindex == 0 and entry is not None and entry.is_record:
        return (records.type_of_count(index),)
    if o.is_pdo_parameter(index):
        return (pdo_parameters.standard_type(index, subindex),)
    if index in cia301.SDO_PARAMETERS and subindex in cia301.SDO_TYPES:
        return (cia301.SDO_TYPES[subindex],)
    row = standard.row(index, subindex)
    return row.data_types if row is not None else ()


def _blamed(context: RuleContext, finding: EdsFinding) -> EdsFinding:
    """Return the finding of crossed limits at HighLimit, if that is the limit that contradicts the default (else 0)."""
    section = context.section_of(finding.index or 0, finding.subindex or 0)
    entry = context.eds.get(finding.index or 0, finding.subindex or 0)
    if section is None or entry is None:
        return finding
    low = entry_values.plain(section.entries.get("lowlimit", ""))
    default = entry.default.value if isinstance(entry.default, Number) else 0
    if low is None or default < low:
        return finding
    line, column = context.document.location(section, "highlimit")
    return replace(finding, line=line, column=column)


def _letters(context: RuleContext, finding: EdsFinding) -> EdsFinding:
    """Return the finding of a formula as a note if only the case of $NODEID is wrong, which most tools accept."""
    _, text = entry_of(context.document.lines[finding.line - 1])
    return replace(finding, severity=Severity.NOTE) if text.startswith("$") else finding


def _time(context: RuleContext, finding: EdsFinding) -> EdsFinding:
    """Return the finding of an unknown time as a note: DS 306 does not define the notation of times."""
    entry = context.eds.get(finding.index or 0, finding.subindex or 0)
    if entry is None or entry.data_type not in (DataType.TIME_OF_DAY, DataType.TIME_DIFFERENCE):
        return finding
    return replace(finding, severity=Severity.NOTE)


_JUDGED: dict[str, Callable[[RuleContext, EdsFinding], EdsFinding]] = {
    "V001": _time,
    "V004": _blamed,
    "V006": _letters,
}
