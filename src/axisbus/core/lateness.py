"""The lateness of a scan's cycles, and its causes: counted in classes, so that the cost does not grow with time.

Theory of operation
-------------------
A delay falls into one of eight classes per doubling, from a microsecond on, so that a quantile is off by an eighth at most. The
cause of a skipped cycle is derived from values that are known anyway. If the garbage collector ran for at least half of the delay,
it is the collector. Otherwise, if the previous cycle ended so late that it explains at least half of the delay, it is the sending
or the work of that cycle. Otherwise this program did not get a processor in time.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from enum import Enum
from itertools import accumulate
from math import frexp

from axisbus.session import LATENESS_BOUNDS, LatenessReport

_CLASSES_PER_OCTAVE = 8
_LEAST, _MOST = -19, 7  # exponents of two, in seconds: about 1 µs and 64 s
_CLASSES = (_MOST - _LEAST + 1) * _CLASSES_PER_OCTAVE
_HALF = 0.5
_HANG_TIME = 0.25  # seconds without a cycle (at least ten periods) after which the last values are outdated


class Cause(Enum):
    """The cause of skipped cycles."""

    COLLECTOR = "the garbage collector"
    SEND = "a send that blocked"
    WORK = "the work of the cycle before"
    NOT_RUN = "the wait for a processor"


_CAUSES = tuple(Cause)
# The index of each number; after them the numbers of each cause, and of each class.
_CYCLES, _SKIPPED, _LAST, _TOTAL, _WORST, _FIRST_CAUSE = range(6)
_FIRST_CLASS = _FIRST_CAUSE + len(_CAUSES)
COUNTS = _FIRST_CLASS + _CLASSES  # number of numbers


class Lateness:
    """Counts the cycles of one scan; written by its thread, read by any thread, also of another process if memory is shared."""

    __slots__ = ("_counts",)

    def __init__(self, counts: array[float] | memoryview[float] | None = None) -> None:
        """``counts``: memory with its ``COUNTS`` numbers, used as it is; None: own memory, from 0 on."""
        self._counts: array[float] | memoryview[float] = (
            array("d", bytes(8 * COUNTS)) if counts is None else counts
        )

    def share(self, other: Lateness) -> None:
        """Copy the numbers into the memory of ``other``, and count there from now on."""
        for index, number in enumerate(self._counts):
            other._counts[index] = number
        self._counts = other._counts

    @property
    def cycles(self) -> int:
        """The number of executed cycles."""
        return int(self._counts[_CYCLES])

    @property
    def skipped(self) -> int:
        """The number of skipped cycles."""
        return int(self._counts[_SKIPPED])

    @property
    def last(self) -> float:
        """Lateness of the last cycle, in seconds."""
        return self._counts[_LAST]

    @property
    def worst(self) -> float:
        """The largest lateness so far, in seconds."""
        return self._counts[_WORST]

    def note(self, late: float) -> None:
        """Count one cycle that began ``late`` seconds after its time."""
        counts = self._counts
        counts[_LAST] = late
        counts[_TOTAL] += late
        if late > counts[_WORST]:
            counts[_WORST] = late
        counts[_FIRST_CLASS + _class_of(late)] += 1
        counts[_CYCLES] += 1

    def skip(self, cycles: int, cause: Cause) -> None:
        """Count skipped cycles."""
        self._counts[_SKIPPED] += cycles
        self._counts[_FIRST_CAUSE + _CAUSES.index(cause)] += cycles

    def report(self) -> LatenessReport:
        """Return the numbers so far."""
        seen = [*self._counts]
        cycles, skipped, worst = int(seen[_CYCLES]), int(seen[_SKIPPED]), seen[_WORST]
        found = zip(_CAUSES, seen[_FIRST_CAUSE:_FIRST_CLASS], strict=True)
        causes = {cause.value: int(count) for cause, count in found if count}
        classes = seen[_FIRST_CLASS:]
        median, p99 = (_quantile(share, classes, worst) for share in (0.5, 0.99))
        return LatenessReport(cycles, skipped, seen[_TOTAL], median, p99, worst, causes, _within(classes))


def _within(classes: Sequence[float]) -> tuple[int, ...]:
    """Return the number of cycles below each bound: each bound is the lower edge of a class, and the last is above all."""
    below = [int(count) for count in accumulate(classes, initial=0.0)]
    return (*(below[_class_of(bound)] for bound in LATENESS_BOUNDS[:-1]), below[-1])


def _quantile(share: float, classes: Sequence[float], worst: float) -> float:
    """Return the upper edge of the class in which this share of all cycles is reached; never more than the worst."""
    wanted, seen = share * sum(classes), 0.0
    for number, count in enumerate(classes):
        seen += count
        if seen and seen >= wanted:
            return min(worst, _edge(number))
    return 0.0


def cause_of(late: float, overrun: float, sending: float, collecting: float) -> Cause:
    """Return why a cycle came ``late``; all in seconds.

    ``overrun``: by how much the previous cycle ended after this one was due; ``sending``: time of the previous cycle in the adapter
    and the driver; ``collecting``: time of the garbage collector since that cycle began.
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
    return (exponent - _LEAST) * _CLASSES_PER_OCTAVE + int((mantissa - _HALF) * 2 * _CLASSES_PER_OCTAVE)


def _edge(number: int) -> float:
    octave, eighth = divmod(number, _CLASSES_PER_OCTAVE)
    return float(2.0 ** (octave + _LEAST - 1) * (1.0 + (eighth + 1) / _CLASSES_PER_OCTAVE))


def hang_text(age: float, period: float) -> str | None:
    """Return a text if the scan hangs: its last cycle was ``age`` seconds ago, its period is ``period``; None if it runs."""
    return (
        f"the scan of the bus has done no cycle for {age:.2f} s"
        if age > max(_HANG_TIME, 10 * period)
        else None
    )
