"""The newest frame of one TPDO, stored by the receive thread and decoded once by the scan."""

from __future__ import annotations

import math
from collections.abc import Sequence

from axisbus.bus.link.channel import Receiver
from axisbus.bus.pdo.plan import PlannedPdo
from axisbus.cia301.pdo import PdoCodec
from axisbus.cia402.port import INPUT_OBJECTS, Sample

_PLACES = {name: place for place, name in enumerate(INPUT_OBJECTS)}
_tuple = tuple.__new__  # makes a named tuple from fitting values without the cost of its own ``__new__``


class TpdoSlot:
    """The newest frame of a TPDO.

    Holds state: one (data, stamp) pair, replaced as a whole, so that a reader never sees half of one.

    A frame shorter than the mapping is not decoded; it is counted in ``short``, and its values grow old. Surplus bytes of a longer
    frame are ignored (CiA 301 7.2.2.5). ``latest`` is the newest pair, ``seen`` the pair that the one reader has read last.
    ``frames`` counts all frames, whole or short. ``places`` assigns the frame's values to inputs, by position in both.
    """

    __slots__ = (
        "_drop",
        "_names",
        "cob_id",
        "frames",
        "latest",
        "name",
        "places",
        "request",
        "seen",
        "short",
        "size",
        "unpack",
    )

    def __init__(self, pdo: PlannedPdo, drop: Receiver | None = None) -> None:
        """``drop(data, stamp)`` is called with a frame that is too short."""
        self.name = pdo.name
        self.cob_id = pdo.target.cob_id
        self.request = pdo.request
        self.frames = 0
        codec = PdoCodec(pdo.target.mapping, pdo.signed)
        self.size = codec.size  # data bytes of a whole frame
        self.unpack = codec.unpack_from
        self._names = tuple((position, name) for position, name in enumerate(pdo.values) if name is not None)
        self.places = tuple((position, _PLACES[name]) for position, name in self._names)
        self._drop = drop
        self.latest = self.seen = (b"", -math.inf)

    @property
    def stamp(self) -> float:
        """Time of the newest whole frame in seconds; minus infinity if there is none."""
        return self.latest[1]

    def on_frame(self, data: bytes, stamp: float) -> None:
        """Store a frame; called in the receive thread."""
        self.frames += 1
        if len(data) < self.size:
            if self._drop is not None:
                self._drop(data, stamp)
            return
        self.latest = (data, stamp)

    def read_into(self, samples: dict[str, Sample], sampled: float) -> float:
        """Put the values of a frame that has come since the last call into ``samples`` if they are newer; for one reader.

        ``sampled``: the earliest time at which they were sampled (seconds). Return the frame's ``stamp``.
        """
        latest = self.latest
        data, stamp = latest
        if latest is self.seen:
            return stamp
        self.seen = latest
        values = self.unpack(data)
        for position, name in self._names:
            known = samples.get(name)
            if known is None or known.stamp <= stamp:
                samples[name] = _tuple(Sample, (values[position], sampled))
        return stamp


class Requests:
    """Schedule of the TPDOs that are sent only on request; holds state: the due time of each. Empty if there are none."""

    def __init__(self, slots: Sequence[TpdoSlot]) -> None:
        self._slots = tuple(slot for slot in slots if slot.request > 0.0)
        self._due = [-math.inf] * len(self._slots)

    def __bool__(self) -> bool:
        return bool(self._slots)

    def due(self, now: float) -> list[tuple[int, int]]:
        """Return COB-ID and data length of each TPDO to request now; ``now`` in seconds."""
        asked = [number for number, due in enumerate(self._due) if now >= due]
        for number in asked:
            period = self._slots[number].request
            due = self._due[number] + period
            self._due[number] = due if due > now else now + period
        return [(self._slots[number].cob_id, self._slots[number].size) for number in asked]
