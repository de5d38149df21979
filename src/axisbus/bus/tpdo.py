"""The newest frame of one TPDO, stored by the receive thread and decoded once by the scan."""

from __future__ import annotations

from axisbus.bus.plan import PlannedPdo
from axisbus.cia301.pdo import PdoCodec
from axisbus.cia402.port import Sample


class TpdoSlot:
    """The newest frame of a TPDO; holds state: one (data, stamp) pair, replaced as a whole, so that no reader sees half of one.

    A frame shorter than the mapping is not decoded: it is counted in ``short``, and the values it should have brought grow old. The
    surplus of a longer one is ignored (CiA 301 7.2.2.5).
    """

    __slots__ = ("_codec", "_latest", "_names", "_seen", "cob_id", "short")

    def __init__(self, pdo: PlannedPdo) -> None:
        self.cob_id = pdo.target.cob_id
        self.short = 0
        self._codec = PdoCodec(pdo.target.mapping, pdo.signed)
        self._names = tuple((position, name) for position, name in enumerate(pdo.values) if name is not None)
        self._latest: tuple[bytes, float] | None = None
        self._seen: tuple[bytes, float] | None = None

    def on_frame(self, data: bytes, stamp: float) -> None:
        """Store a frame; called in the receive thread."""
        if len(data) < self._codec.size:
            self.short += 1
            return
        self._latest = (data, stamp)

    def read_into(self, samples: dict[str, Sample]) -> None:
        """Put the values of a frame that has come since the last call into ``samples``, where they are newer; for one reader."""
        latest = self._latest
        if latest is None or latest is self._seen:
            return
        self._seen = latest
        data, stamp = latest
        values = self._codec.unpack(data)
        for position, name in self._names:
            known = samples.get(name)
            if known is None or known.stamp <= stamp:
                samples[name] = Sample(values[position], stamp)
