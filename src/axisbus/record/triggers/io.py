"""An edge of a named input or output, or a limit that its value passes, as the moment of a capture.

Theory of operation
-------------------
Where a PDO carries it, each of its frames is looked at as it comes or goes, so that an edge has the time of its frame, and no pulse
is lost between two looks. Without a bus, or where no PDO carries it, the value of each cycle is looked at. What is unknown (its
node is lost) is no value: what it is when it is known again is where it begins anew, and no edge.
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

_MOST = 16  # moments that wait for their cycle: the first one counts


class IoMoment:
    """Holds whether its condition held last (None: unknown), and the moments that frames have shown."""

    def __init__(
        self,
        session: MachineSession,
        wanted: WantedObject,
        place: MappedSignal | None,
        met: Callable[[Any], bool],
    ) -> None:
        """``place``: where a PDO carries what is ``wanted``; ``met`` says of its value whether the condition holds."""
        self._session = session
        self._wanted = wanted
        self._place = place
        self._met = met
        self._before: bool | None = None
        self._found: deque[float] = deque(maxlen=_MOST)
        self._since: float | None = None  # the first cycle: what was before is not in the file
        self._taps = place is not None and session.carried is not None

    def begin(self) -> None:
        """As ``Moment.begin``."""
        self._before = self._now()
        if self._place is not None and self._taps:
            self._session.tap(self._hear, (self._place.carried.can_id,))

    def end(self) -> None:
        """As ``RecordingTrigger.end``."""
        if self._taps:
            self._taps = False
            self._session.untap(self._hear)

    def seen(self, now: float, _snapshots: Mapping[str, Snapshot]) -> float | None:
        """As ``RecordingTrigger.seen``: the time of the frame, or of the cycle where there is none."""
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
        """Whether the condition holds in the last cycle; None where the value is unknown."""
        reading = self._session.readings.get(self._wanted.label)
        if reading is None or reading.known is not SignalValidity.YES or reading.value is None:
            return None
        assert self._wanted.point is not None
        return self._met(self._wanted.point.shown(reading.value))
