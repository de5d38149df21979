"""The 29-bit protocol of firmware 0.6.8 and later: recognised by its beats, and never spoken to.

Theory of operation. Published is one identifier of a beat, 19200404h, of node 1: 48h in bits 25 to 18 is its type, and both bits 17
to 10 and bits 9 to 2 hold a 1. Which of the two is the sender's is not public, so that where they differ both are told. Several
beats of one identifier, at a period that a beat may have, make a module.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median

from axisbus.cia301.frame import CanFrame

ENOUGH = 4  # beats
_TYPE, _TYPE_SHIFT = 0x48, 18
_SEQUENCE = 0x3  # bits of the identifier that change
_PERIOD = (0.005, 2.5)  # s that a beat may have
_KEPT = 16
_MOST = 256  # identifiers


def is_beat(frame: CanFrame) -> bool:
    """Whether a frame has the identifier of a beat."""
    return frame.extended and not frame.remote and frame.can_id >> _TYPE_SHIFT & 0xFF == _TYPE


def addresses(can_id: int) -> tuple[int, ...]:
    """Return what the two address fields of a 29-bit identifier hold, each once."""
    return tuple(dict.fromkeys((can_id >> 10 & 0xFF, can_id >> 2 & 0xFF)))


@dataclass(slots=True)
class Heartbeat29:
    """Follows the beats of a bus; holds state: when the last ones of each identifier came."""

    _times: dict[int, deque[float]] = field(default_factory=dict)

    def note(self, frame: CanFrame) -> None:
        """Take any frame, in the order of time."""
        key = frame.can_id & ~_SEQUENCE
        if is_beat(frame) and (key in self._times or len(self._times) < _MOST):
            self._times.setdefault(key, deque(maxlen=_KEPT)).append(frame.time)

    @property
    def modules(self) -> tuple[int, ...]:
        """The identifiers under which modules beat, their sequence left out, lowest first."""
        return tuple(sorted(key for key, times in self._times.items() if _beats(list(times))))


def _beats(times: list[float]) -> bool:
    if len(times) < ENOUGH:
        return False
    usual = median(after - before for before, after in pairwise(times))
    return _PERIOD[0] <= usual <= _PERIOD[1]
