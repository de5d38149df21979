"""How late the cycles of a scan are: counted in classes, for a person and for a recording."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.wording import counted

# Upper edges of the classes in seconds; the last class holds the rest.
EDGES = (0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.05)


@dataclass(frozen=True, slots=True)
class LatenessReport:
    """A look at the lateness so far: times in seconds; ``classes`` counts cycles up to each edge of ``EDGES``, and beyond."""

    cycles: int
    mean: float
    worst: float
    classes: tuple[int, ...]

    def __str__(self) -> str:
        if not self.cycles:
            return "no cycle yet"
        return f"{counted(self.cycles, 'cycle')}, late by {self.mean * 1e6:.0f} µs on average, {self.worst * 1e6:.0f} µs at worst"


class Lateness:
    """Counts how late cycles are; holds state. Written by the scan's thread, read by any."""

    def __init__(self) -> None:
        self._cycles = 0
        self._sum = 0.0
        self._worst = 0.0
        self._classes = [0] * (len(EDGES) + 1)

    def note(self, late: float) -> None:
        """Count one cycle that began ``late`` seconds after its time."""
        self._cycles += 1
        self._sum += late
        if late > self._worst:
            self._worst = late
        for number, edge in enumerate(EDGES):
            if late <= edge:
                self._classes[number] += 1
                return
        self._classes[-1] += 1

    def report(self) -> LatenessReport:
        """Return what was counted so far."""
        mean = self._sum / self._cycles if self._cycles else 0.0
        return LatenessReport(self._cycles, mean, self._worst, tuple(self._classes))
