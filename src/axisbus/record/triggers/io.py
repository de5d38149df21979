"""Trigger a capture on an edge of a named input or output, or when its value crosses a limit.

Theory of operation
-------------------
If a PDO carries the signal, each of its frames is evaluated when it is received or sent, so that an edge has the time of its frame,
and no pulse between two cycles is lost. Without a bus, or if no PDO carries the signal, the value of each cycle is evaluated. While
the signal is unknown (its node is lost), it has no value: its first value afterwards is a new starting point, not an edge.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from axisbus.cia301.frame import CanFrame
from axisbus.cia401.port import SignalValidity
from axisbus.motion.snapshot import Snapshot
from axisbus.record.object_selection import WantedObject
from axisbus.record.pdo_objects import MappedSignal
from axisbus.session import MachineSession

_MOST = 16  # the most triggers waiting for their cycle: the first one counts


class IoMoment:
    """Hold whether the condition was last true (None: unknown), and the trigger times from frames."""

    def __init__(
        self,
        session: MachineSession,
        wanted: WantedObject,
        place: MappedSignal | None,
        met: Callable[[Any], bool],
    ) -> None:
        """``place``: the location of ``wanted`` in a PDO; ``met`` returns whether a value meets the condition."""
        self._session = session
        self._wanted = wanted
        self._place = place
        self._met = met
        self._before: bool | None = None
        self._found: deque[float] = deque(maxlen=_MOST)
        self._since: float | None = None  # the first cycle: earlier ones are not in the file
        self._taps = place is not None and session.carried is not None

    def begin(self) -> None:
        """As ``RecordingTrigger.begin``."""
        self._before = self._now()
        if self._place is not None and self._taps:
            self._session.tap(self._hear, (self._place.carried.can_id,))

    def end(self) -> None:
        """As ``RecordingTrigger.end``."""
        if self._taps:
            self._taps = False
            self._session.untap(self._hear)

    def seen(self, now: float, _snapshots: Mapping[str, Snapshot]) -> float | None:
        """As ``RecordingTrigger.seen``: the time of the frame, or of the cycle if there is no frame."""
        found = self._now()
        self._since = now if self._since is None else self._since
        while self._found and self._found[0] < self._since:
            self._found.popleft()
        if found is None or self._before is None:
            self._before = found
        elif not self._taps and self._rises(found):
            return now
        return self._found.popleft() if self._found and self._found[0] <= now else None

    def _hear(self, frames: Sequence[CanFrame]) -> None:
        assert self._place is not None
        for frame in frames:
            value = None if frame.remote else self._place.value(frame.data)
            if value is not None and self._rises(self._met(value)):
                self._found.append(frame.time)

    def _rises(self, now: bool) -> bool:
        before, self._before = self._before, now
        return before is False and now

    def _now(self) -> bool | None:
        """Return whether the condition is true in the last cycle; None if the value is unknown."""
        reading = self._session.readings.get(self._wanted.label)
        if reading is None or reading.known is not SignalValidity.YES or reading.value is None:
            return None
        assert self._wanted.point is not None
        return self._met(self._wanted.point.shown(reading.value))
