"""A rule of the campaign that did not hold."""

from __future__ import annotations


class Violation(Exception):
    """A rule that did not hold; ``rule`` is its name, ``kind`` that with its error, if there was one."""

    def __init__(self, rule: str, text: str, error: Exception | None = None) -> None:
        super().__init__(rule, text, error)
        self.rule = rule
        self.kind = rule if error is None else f"{rule}: {type(error).__name__}"

    def __str__(self) -> str:
        return str(self.args[1])
