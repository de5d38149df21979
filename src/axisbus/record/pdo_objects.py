"""Record objects that PDOs carry: the value in each frame sent or received, without extra transfers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from axisbus.cia301.datatypes import Value, decode
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.pdo import PdoLocation
from axisbus.record.object_selection import WantedObject
from axisbus.session import MachineSession

_MOST = 100_000  # the most values waiting to be written


@dataclass(frozen=True, slots=True)
class MappedSignal:
    """The location of an object in a PDO, and the meaning of its bits."""

    wanted: WantedObject
    carried: PdoLocation

    @property
    def label(self) -> str:
        """The name under which it was requested."""
        return self.wanted.label

    def value(self, data: bytes) -> Value | None:
        """Return the value in a frame, None if the frame is too short."""
        _, _, shift, bits = self.carried
        if len(data) * 8 < shift + bits:
            return None
        raw = int.from_bytes(data, "little") >> shift & ((1 << bits) - 1)
        data_type = self.wanted.data_type
        value = raw if data_type is None else decode(raw.to_bytes((bits + 7) // 8, "little"), data_type)
        return self.wanted.means(value)


class MappedObjects:
    """Extract the values of objects from the frames of the bus; holds those waiting to be written, and their number."""

    def __init__(self, session: MachineSession, places: Sequence[MappedSignal]) -> None:
        self._session = session
        self.places = tuple(places)
        self._by_id: dict[int, list[MappedSignal]] = {}
        for place in self.places:
            self._by_id.setdefault(place.carried.can_id, []).append(place)
        self._values: deque[tuple[str, float, Value]] = deque(maxlen=_MOST)
        self.counts = {place.label: 0 for place in self.places}

    def begin(self) -> None:
        """Start listening."""
        if self._by_id:
            self._session.tap(self._hear, self._by_id)

    def end(self) -> None:
        """Stop listening."""
        if self._by_id:
            self._session.untap(self._hear)

    def write(self, write: Callable[[str, float, Value | None], None]) -> None:
        """Call ``write(label, time, value)`` for every waiting value."""
        for label, now, value in self._take():
            write(label, now, value)
            self.counts[label] += 1

    def _take(self) -> Iterator[tuple[str, float, Value]]:
        for _ in range(len(self._values)):
            yield self._values.popleft()

    def _hear(self, frames: Sequence[CanFrame]) -> None:
        for frame in frames:
            for place in () if frame.remote else self._by_id.get(frame.can_id, ()):
                value = place.value(frame.data)
                if value is not None:
                    self._values.append((place.label, frame.time, value))
