"""What a warden is told by who starts it; it imports this alone before its core runs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Duty:
    """What a warden is told by who starts it: descriptors (-1: none), the cell's file, and how many axes it has.

    ``line`` leads from the core to its program and ``tell`` from the warden to it; ``drives`` is the line to simulated drives,
    ``lock`` what keeps others off the adapter.
    """

    line: int
    memory: int
    tell: int
    program: int
    cell: str
    axes: int
    drives: int = -1
    lock: int = -1

    @property
    def of_core(self) -> list[int]:
        """The descriptors that the core has too."""
        return [number for number in (self.line, self.memory, self.drives, self.lock) if number >= 0]
