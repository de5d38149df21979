"""SYNC of a simulated node: its COB-ID, its counter, and its transmission if 1005h requires that."""

from __future__ import annotations

from axisbus.cia301.nmt import NmtState
from axisbus.sim.device import Device

_PRODUCER = 0x4000_0000  # in 1005h
_WRONG_LENGTH = 0x8240


class SyncService:
    """SYNC of one node; holds its parameters, the time of the next SYNC, and the counter."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._period = 0.0  # s; 0: it does not send SYNC
        self._next = 0.0
        self._count = 0
        self._odd = False
        self._has_overflow, self._overflow = False, 0  # of the counter (1019h)
        self.cob_id = 0x80
        self.reload()

    def reload(self) -> None:
        """Read 1005h, 1006h and 1019h."""
        get = self._device.dictionary.get_int
        value = get(0x1005, 0, 0x80)
        self.cob_id = value & 0x7FF
        self._period = get(0x1006) / 1e6 if value & _PRODUCER else 0.0
        if not self.enabled:
            self._count = 0
        self._has_overflow, self._overflow = self._device.dictionary.has(0x1019), get(0x1019)

    @property
    def enabled(self) -> bool:
        """Whether it produces SYNC in some NMT states."""
        return self._period > 0.0

    @property
    def produces(self) -> bool:
        """Whether it produces SYNC now."""
        states = (NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL)
        return self._period > 0.0 and self._device.nmt in states

    def due(self, now: float) -> bytes | None:
        """Return the data of a SYNC to be sent at ``now``, None if none is due."""
        if not self.produces:
            self._next, self._count = now, 0
            return None
        if now < self._next - 1e-9:
            return None
        following = self._next + self._period
        self._next = following if following > now else now + self._period
        overflow = self._overflow
        if not overflow:
            return b""
        self._count = self._count % overflow + 1
        return bytes((self._count,))

    def counter(self, data: bytes) -> int:
        """Return the counter of a SYNC, 0 if the node uses none; a length that contradicts 1019h is reported once."""
        overflow = self._overflow
        odd = self._has_overflow and len(data) != (1 if overflow else 0)
        if odd and not self._odd:
            self._device.errors.report(-1, _WRONG_LENGTH)
        self._odd = odd
        return data[0] if overflow and len(data) == 1 else 0
