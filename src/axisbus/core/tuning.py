"""What of Python itself is set while machines run in real time: once for all of them, and set back by the last."""

from __future__ import annotations

import gc
import sys
import threading

from axisbus.bus.link.inherited import disown_in_children

_SWITCH_INTERVAL = (
    0.0005  # seconds; Python's own 5 ms would let another thread delay the scan by a whole period
)


class Tuning:
    """Counts who needs it; holds the switch interval that was there before the first."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._count = 0
        self._before = 0.0

    def take(self) -> None:
        """Let threads take turns quickly, and leave the collector what is alive now alone."""
        with self._lock:
            if not self._count:
                self._before = sys.getswitchinterval()
                sys.setswitchinterval(_SWITCH_INTERVAL)
            self._count += 1
            gc.freeze()  # a full collection over the dictionaries takes several periods

    def give_back(self) -> None:
        """End what ``take`` began, when nobody else needs it; a switch interval that somebody has set since is left."""
        with self._lock:
            self._count -= 1
            if not self._count:
                self._set_back()

    def disown(self) -> None:
        """No machine runs in a forked child."""
        self._lock = threading.Lock()
        if self._count:
            self._set_back()
        self._count = 0

    def _set_back(self) -> None:
        if abs(sys.getswitchinterval() - _SWITCH_INTERVAL) < _SWITCH_INTERVAL / 100:
            sys.setswitchinterval(self._before)
        gc.unfreeze()


TUNING = Tuning()
disown_in_children(TUNING)
