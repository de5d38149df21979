"""The list of findings that a reading fills; ``rules.table`` defines their rules."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from axisbus.eds.model import EdsFinding
from axisbus.eds.rules.table import rules
from axisbus.wording import counted

MAX_FINDINGS = 10_000  # a file of random data must not fill the memory with messages


class Findings:
    """Collects findings while one file is read; its only state is the list, which is limited to ``max_count`` findings."""

    def __init__(self, max_count: int = MAX_FINDINGS) -> None:
        self._max_count = max_count
        self._found: list[EdsFinding] = []
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
        """Add one finding of ``rule`` (an id of the table) at ``line`` (from 1; 0: the whole file)."""
        if len(self._found) >= self._max_count:
            self._left_out += 1
            return
        broken = rules()[rule]
        shown_column = column if line else 0
        self._found.append(
            EdsFinding(rule, broken.severity, line, shown_column, message, broken.remedy, index, subindex)
        )

    def add_lines(self, rule: str, numbers: Sequence[int], message: Callable[[int], str]) -> None:
        """Add a finding of ``rule`` at each of these lines; ``message`` is called only for stored findings."""
        reported = numbers[: self._max_count - len(self._found)]
        for number in reported:
            self.add(rule, message(number), line=number)
        self._left_out += len(numbers) - len(reported)

    def all(self) -> tuple[EdsFinding, ...]:
        """Return the findings, in the order of the lines."""
        found = sorted(self._found, key=lambda finding: (finding.line, finding.column))
        if self._left_out:
            more = rules()["S099"]
            text = f"{counted(self._left_out, 'more finding is', 'more findings are')} not listed"
            found.append(EdsFinding("S099", more.severity, 0, 0, text, more.remedy))
        return tuple(found)
