"""How much of the last seconds this program, or its simulated drives, did not run: named before a drive or a cable is blamed.

Theory of operation
-------------------
Whoever is due at known times tells how late it came (``note``). A computer that is busy, another thread that holds the interpreter,
a suspended process: all look the same from inside, as time that is missing. While it was missing nothing was received, no heartbeat
and no SYNC went out, and every time-out ran on. So what is seen just after says little of the machine. Drives that are simulated
need the same computer: while they are given no time, they look like drives that are gone.
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


PROGRAM, DRIVES = "this program", "the simulated drives"
# Of drives whole periods alone are counted, and only until they count as silent.
_LEAST = {PROGRAM: LEAST, DRIVES: LEAST / 2}


class Starvation:
    """The times that were missing lately, and to whom; holds state."""

    __slots__ = ("_lost",)

    def __init__(self) -> None:
        self._lost: deque[tuple[float, float, str]] = deque(maxlen=256)

    def note(self, now: float, late: float, who: str = PROGRAM) -> None:
        """Something that was due has come ``late`` seconds after its time; infinite, because it is the first, is no delay."""
        if 0.0 < late < math.inf:
            self._lost.append((now, late, who))

    def missing(self, now: float) -> float:
        """Return the seconds within the last two that somebody did not run; 0 where they are too few to matter."""
        return self._worst(now)[0]

    def text(self, now: float) -> str:
        """Say so, for a person; empty where it ran."""
        missing, who = self._worst(now)
        return f"{who} did not run for {missing:.2g} s of the last {WINDOW:g} s" if missing else ""

    def _worst(self, now: float) -> tuple[float, str]:
        """Return how long the one who has missed most has missed, and who that is."""
        begin = now - WINDOW
        lost = dict.fromkeys((PROGRAM, DRIVES), 0.0)
        for stamp, late, who in self._lost:
            if stamp > begin:
                lost[who] += min(late, stamp - begin)
        who = max(lost, key=lost.__getitem__)
        return (min(lost[who], WINDOW), who) if lost[who] >= _LEAST[who] else (0.0, who)
