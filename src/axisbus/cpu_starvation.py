"""The time in which this program, or its simulated drives, did not run: checked before a drive or a cable is blamed.

Theory of operation
-------------------
Code that is due at known times reports its lateness (``note``). A busy computer, another thread that holds the interpreter, and a
suspended process all look the same from inside: as missing time. During missing time nothing is received, no heartbeat and no SYNC
is sent, and every time-out continues. Therefore observations right afterwards say little about the machine. Simulated drives need
the same computer: while they get no time, they look like lost drives.
"""

from __future__ import annotations

import math
from collections import deque

WINDOW = 2.0  # seconds of history: a drive may take about one to report our missing heartbeat
LEAST = 0.1  # seconds missing within the window that are reported; less is normal on a busy computer
REMEDY = (
    "give this program enough processor time: do not suspend it (SIGSTOP, a debugger, a laptop's sleep), and run long calls "
    "that block the interpreter (json or pickle of big data, regular expressions) in a process of their own"
)


PROGRAM, DRIVES = "this program", "the simulated drives"
# Simulated drives count only whole periods, and only until they count as silent.
_LEAST = {PROGRAM: LEAST, DRIVES: LEAST / 2}


class Starvation:
    """The missing times of the recent past, and the part that did not run; holds state."""

    __slots__ = ("_lost",)

    def __init__(self) -> None:
        self._lost: deque[tuple[float, float, str]] = deque(maxlen=256)

    def note(self, now: float, late: float, who: str = PROGRAM) -> None:
        """Record that ``who`` was ``late`` seconds behind its time; infinite marks a first call, which is no delay."""
        if 0.0 < late < math.inf:
            self._lost.append((now, late, who))

    def missing(self, now: float) -> float:
        """Return the seconds within the last two in which a part did not run; 0 if they are too few to matter."""
        return self._worst(now)[0]

    def text(self, now: float) -> str:
        """Return this as text; empty if all ran."""
        missing, who = self._worst(now)
        return f"{who} did not run for {missing:.2g} s of the last {WINDOW:g} s" if missing else ""

    def _worst(self, now: float) -> tuple[float, str]:
        """Return the longest missing time, and the part with it."""
        begin = now - WINDOW
        lost = dict.fromkeys((PROGRAM, DRIVES), 0.0)
        for stamp, late, who in self._lost:
            if stamp > begin:
                lost[who] += min(late, stamp - begin)
        who = max(lost, key=lost.__getitem__)
        return (min(lost[who], WINDOW), who) if lost[who] >= _LEAST[who] else (0.0, who)
