"""The 29-bit protocol of firmware 0.6.8 and later: recognised by its heartbeats, and never used for requests.

Theory of operation. Only one heartbeat identifier is published: 19200404h, of node 1. Its type 48h is in bits 25 to 18; bits 17 to
10 and bits 9 to 2 both contain 1. It is not published which of the two is the sender; if they differ, both are reported. Several
heartbeats of one identifier, with a possible heartbeat period, count as a module.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median

from axisbus.cia301.frame import CanFrame

ENOUGH = 4  # heartbeats
_TYPE, _TYPE_SHIFT = 0x48, 18
_SEQUENCE = 0x3  # bits of the identifier that vary
_PERIOD = (0.005, 2.5)  # s: possible periods
_KEPT = 16
_MOST = 256  # identifiers


def is_beat(frame: CanFrame) -> bool:
    """Return whether a frame has the identifier of a heartbeat."""
    return frame.extended and not frame.remote and frame.can_id >> _TYPE_SHIFT & 0xFF == _TYPE


def addresses(can_id: int) -> tuple[int, ...]:
    """Return the values of the two address fields of a 29-bit identifier, without duplicates."""
    return tuple(dict.fromkeys((can_id >> 10 & 0xFF, can_id >> 2 & 0xFF)))


@dataclass(slots=True)
class Heartbeat29:
    """Follows the heartbeats of a bus: the times of the last ones of each identifier."""

    _times: dict[int, deque[float]] = field(default_factory=dict)

    def note(self, frame: CanFrame) -> None:
        """Take any frame; frames must come in order of time."""
        key = frame.can_id & ~_SEQUENCE
        if is_beat(frame) and (key in self._times or len(self._times) < _MOST):
            self._times.setdefault(key, deque(maxlen=_KEPT)).append(frame.time)

    @property
    def modules(self) -> tuple[int, ...]:
        """Identifiers of the heartbeats of modules, without the sequence, lowest first."""
        return tuple(sorted(key for key, times in self._times.items() if _beats(list(times))))


def _beats(times: list[float]) -> bool:
    if len(times) < ENOUGH:
        return False
    usual = median(after - before for before, after in pairwise(times))
    return _PERIOD[0] <= usual <= _PERIOD[1]
