"""How much of the last seconds this program did not run: to be named before any drive, cable or adapter is blamed.

Theory of operation
-------------------
Whoever is due at known times tells how late it came (``note``). A computer that is busy, another thread that holds the interpreter,
a suspended process: all look the same from inside, as time that is missing. While it was missing nothing was received, no heartbeat
and no SYNC went out, and every time-out ran on. So what is seen just after says little of the machine.
"""

from __future__ import annotations

import math
from collections import deque

WINDOW = (
    2.0  # seconds that are looked back upon: a drive's watch over our heartbeat may take about one to tell
)
LEAST = 0.1  # seconds missing within the window that are worth a word; less is a busy computer's
REMEDY = (
    "give this program its time: do not suspend it (SIGSTOP, a debugger, a laptop's sleep), and put long calls that hold the "
    "interpreter (json or pickle of big data, regular expressions) into a process of their own"
)


class Starvation:
    """The times that were missing lately; holds state."""

    __slots__ = ("_lost",)

    def __init__(self) -> None:
        self._lost: deque[tuple[float, float]] = deque(maxlen=256)

    def note(self, now: float, late: float) -> None:
        """Something that was due has come ``late`` seconds after its time; infinite, because it is the first, is no delay."""
        if 0.0 < late < math.inf:
            self._lost.append((now, late))

    def missing(self, now: float) -> float:
        """Return the seconds within the last two that this program did not run; 0 where they are too few to matter."""
        begin = now - WINDOW
        lost = sum(min(late, stamp - begin) for stamp, late in self._lost if stamp > begin)
        return min(lost, WINDOW) if lost >= LEAST else 0.0

    def text(self, now: float) -> str:
        """Say so, for a person; empty where it ran."""
        missing = self.missing(now)
        return f"this program did not run for {missing:.2g} s of the last {WINDOW:g} s" if missing else ""
