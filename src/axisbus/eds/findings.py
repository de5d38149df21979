"""What reading can find wrong, as one table, and the list that a reading fills."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.eds.model import Finding, Severity

MAX_FINDINGS = 1000  # a file of noise must not fill the memory with texts about it


class Rule(NamedTuple):
    """A rule of DS 306 by its stable id: how bad a breach is, and what to do about it."""

    severity: Severity
    remedy: str


_E, _W, _N = Severity.ERROR, Severity.WARNING, Severity.NOTE

# Letters: S text (DS 306 4.2), L object lists, O objects (4.6.3), V values (4.3), K device commissioning of a DCF (5).
RULES: dict[str, Rule] = {
    "S001": Rule(_W, "write the file in ASCII (DS 306 4.2)"),
    "S002": Rule(_E, "save the file as ASCII without a byte order mark; other tools will not read it"),
    "S003": Rule(_E, "delete one of the two; the first is used, the second is ignored as a whole"),
    "S004": Rule(_E, "delete one of the two; the first is used"),
    "S005": Rule(_E, "put it under a section, or behind ';' as a comment"),
    "S006": Rule(_E, "write key=value, or ';' in column 1 for a comment"),
    "S009": Rule(
        _W, "begin the line with '['; some readers take an indented line as part of the value before it"
    ),
    "S010": Rule(_E, "close the section's name with ']'"),
    "S011": Rule(_W, "comments stand on a line of their own, ';' in column 1; this one is ignored"),
    "S012": Rule(_W, "other tools may refuse it; remove it if nothing uses it"),
    "S099": Rule(_N, "mend the findings listed and read the file again"),
    "O001": Rule(_E, "add ParameterName"),
    "O002": Rule(_E, "add DataType with a type of CiA 301, such as 0x0007 for UNSIGNED32"),
    "O003": Rule(_E, "write one of ro, wo, rw, rwr, rww, const; rw is assumed"),
    "O004": Rule(_E, "write one of 0x2 (DOMAIN), 0x7 (VAR), 0x8 (ARRAY), 0x9 (RECORD)"),
    "O005": Rule(_E, "add the section of the object itself; a RECORD is assumed"),
    "O006": Rule(
        _W, "add ObjectType; without it VAR is meant, but this object has sub-indices: a RECORD is assumed"
    ),
    "O011": Rule(_E, "make it an ARRAY (0x8) or RECORD (0x9), or delete the sub-indices, which are ignored"),
    "O012": Rule(_W, "write the sub-index without leading zeros"),
    "O013": Rule(_E, "give the number of entries, 0 to 254"),
    "V001": Rule(_E, "correct the value; until then it counts as absent"),
    "V002": Rule(_E, "give limits that the data type can hold; until then there are none"),
    "V004": Rule(_E, "give LowLimit <= HighLimit; until then there are none"),
    "V005": Rule(
        _E, "give a value that the data type can hold, or another data type; until then it counts as absent"
    ),
    "V006": Rule(_W, "write $NODEID+number, in capitals and in this order"),
    "V009": Rule(
        _E, "an unsigned type has no negative values; until it is corrected the value counts as absent"
    ),
    "V010": Rule(_N, "write the negative number in decimal"),
    "V011": Rule(_E, "an integer type has no fractions"),
    "V012": Rule(_W, "a leading 0 means octal in DS 306: write the number without it"),
    "V013": Rule(_W, "write the text without quotation marks, which are not part of it"),
    "V014": Rule(
        _W, "write the number in decimal; as hexadecimal digits it is read as the bit pattern of the type"
    ),
    "V015": Rule(_W, "write 1 or 0"),
    "V017": Rule(_W, "write pairs of hexadecimal digits without 0x, or leave the value empty"),
    "V018": Rule(_W, "leave both limits out when there are none; LowLimit=HighLimit=0 would allow only 0"),
    "V020": Rule(_E, "write $NODEID+number"),
    "K001": Rule(_W, "the standard spells it [DeviceComissioning], with one m"),
    "K003": Rule(_E, "give the node ID, 1 to 127"),
}


class Findings:
    """Collects findings while one file is read; the only state is the list, which stops growing at ``most`` findings."""

    def __init__(self, most: int = MAX_FINDINGS) -> None:
        self._most = most
        self._found: list[Finding] = []
        self._left_out = 0

    def add(
        self,
        rule: str,
        message: str,
        *,
        line: int = 0,
        column: int = 1,
        index: int | None = None,
        subindex: int | None = None,
    ) -> None:
        """Note one finding of ``rule`` (a key of ``RULES``) at ``line`` (from 1; 0: the whole file)."""
        if len(self._found) >= self._most:
            self._left_out += 1
            return
        severity, remedy = RULES[rule]
        place = column if line else 0
        self._found.append(Finding(rule, severity, line, place, message, remedy, index, subindex))

    def all(self) -> tuple[Finding, ...]:
        """Return what was found, in the order of the lines."""
        found = sorted(self._found, key=lambda finding: (finding.line, finding.column))
        if self._left_out:
            severity, remedy = RULES["S099"]
            found.append(
                Finding("S099", severity, 0, 0, f"{self._left_out} more findings are not listed", remedy)
            )
        return tuple(found)
