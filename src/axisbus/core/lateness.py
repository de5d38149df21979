"""How late the cycles of a scan are, and why: counted in classes, so that it costs as much after a year as after a second.

Theory of operation
-------------------
A delay falls into one of eight classes per doubling, from a microsecond on, so that a quantile is off by an eighth at most. The
cause of a skipped cycle is looked for in what is known anyway: where the cycle before ended after this one was due, it was its
sending, or its work; where the collector held the interpreter for half of the delay, it was that; else this program was not run in
time.
"""

from __future__ import annotations

from collections import Counter
from enum import Enum
from math import frexp

from axisbus.session import LatenessReport

_PER_OCTAVE = 8
_LEAST, _MOST = -19, 7  # exponents of two, in seconds: about 1 µs and 64 s
_CLASSES = (_MOST - _LEAST + 1) * _PER_OCTAVE
_HALF = 0.5
_HANGING = 0.25  # seconds without a cycle (at least ten periods) after which what was seen last is not of now


class Cause(Enum):
    """Why cycles were skipped."""

    COLLECTOR = "the garbage collector"
    SEND = "a send that blocked"
    WORK = "the work of the cycle before"
    NOT_RUN = "this program was not run in time"


class Lateness:
    """Counts the cycles of one scan; written by its thread, read by any."""

    __slots__ = ("_causes", "_classes", "cycles", "last", "skipped", "total", "worst")

    def __init__(self) -> None:
        self.cycles = 0
        self.skipped = 0
        self.last = 0.0
        self.worst = 0.0
        self.total = 0.0
        self._causes: Counter[Cause] = Counter()
        self._classes = [0] * _CLASSES

    def note(self, late: float) -> None:
        """Count one cycle that began ``late`` seconds after its time."""
        self.cycles += 1
        self.last = late
        self.total += late
        if late > self.worst:
            self.worst = late
        self._classes[_class_of(late)] += 1

    def skip(self, cycles: int, cause: Cause) -> None:
        """Count cycles that were not done."""
        self.skipped += cycles
        self._causes[cause] += cycles

    def report(self) -> LatenessReport:
        """Return what was counted so far."""
        mean = self.total / self.cycles if self.cycles else 0.0
        causes = {cause.value: count for cause, count in self._causes.copy().items()}
        return LatenessReport(
            self.cycles, self.skipped, mean, self._quantile(0.5), self._quantile(0.99), self.worst, causes
        )

    def _quantile(self, share: float) -> float:
        """The upper edge of the class in which this share of all cycles is reached; never more than the worst."""
        classes = self._classes.copy()
        wanted, seen = share * sum(classes), 0
        for number, count in enumerate(classes):
            seen += count
            if seen and seen >= wanted:
                return min(self.worst, _edge(number))
        return 0.0


def cause_of(late: float, overrun: float, sending: float, collecting: float) -> Cause:
    """Return why a cycle came ``late``; all in seconds.

    ``overrun``: how long the cycle before still went on after this one was due; ``sending``: for how much of it adapter and driver
    were waited for; ``collecting``: how long the collector ran since that cycle began.
    """
    if collecting >= _HALF * late:
        return Cause.COLLECTOR
    if overrun < _HALF * late:
        return Cause.NOT_RUN
    return Cause.SEND if sending >= _HALF * overrun else Cause.WORK


def _class_of(late: float) -> int:
    mantissa, exponent = frexp(late)  # mantissa: 0.5 to 1
    if late <= 0.0 or exponent < _LEAST:
        return 0
    if exponent > _MOST:
        return _CLASSES - 1
    return (exponent - _LEAST) * _PER_OCTAVE + int((mantissa - _HALF) * 2 * _PER_OCTAVE)


def _edge(number: int) -> float:
    octave, eighth = divmod(number, _PER_OCTAVE)
    return float(2.0 ** (octave + _LEAST - 1) * (1.0 + (eighth + 1) / _PER_OCTAVE))


def hanging(age: float, period: float) -> str | None:
    """Return that the scan hangs, whose last cycle was ``age`` seconds ago and whose period is ``period``; None if it does not."""
    return (
        f"the scan of the bus has done no cycle for {age:.2f} s" if age > max(_HANGING, 10 * period) else None
    )
