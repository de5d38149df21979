"""Errors of a node: error register 1001h, history 1003h, and the pending emergency messages."""

from __future__ import annotations

from axisbus.cia301.emcy import Emcy

# Bits of the error register by class of error code (CiA 301 table 25 and 7.5.2.2); bit 0 is set with every error.
_GENERIC, _CURRENT, _VOLTAGE, _TEMPERATURE, _COMMUNICATION, _PROFILE, _MANUFACTURER = (
    0x01,
    0x02,
    0x04,
    0x08,
    0x10,
    0x20,
    0x80,
)
_BITS = {
    0x2: _CURRENT,
    0x3: _VOLTAGE,
    0x4: _TEMPERATURE,
    0x5: _PROFILE,
    0x6: _PROFILE,
    0x7: _PROFILE,
    0xF: _MANUFACTURER,
}
_QUEUE_LIMIT = 64


def register_bits(code: int) -> int:
    """Return the bits of 1001h that an error code sets: 81xxh and 82xxh are communication, other 8xxxh device profile."""
    if code >> 12 == 0x8:
        return _GENERIC | (_COMMUNICATION if code >> 8 in (0x81, 0x82) else _PROFILE)
    return _GENERIC | _BITS.get(code >> 12, 0)


class ErrorHistory:
    """Errors of one node, shared by its axes: the active ones, the newest ones, and the queue of messages."""

    def __init__(self, capacity: int = 8) -> None:
        self.capacity = capacity
        self.entries: list[int] = []  # newest first, as 1003h:1 upwards
        self._active: dict[tuple[int, int], int] = {}  # (axis, code): bits
        self._queue: list[tuple[int, int, bytes]] = []

    @property
    def register(self) -> int:
        """The value of 1001h."""
        value = 0
        for bits in self._active.values():
            value |= bits
        return value

    def entry(self, number: int) -> int:
        """Return entry ``number`` of the history, from 0 for the newest; 0 if it does not exist."""
        return self.entries[number] if number < len(self.entries) else 0

    def report(self, source: int, code: int, maker_bits: int = 0, register: int | None = None) -> None:
        """Add an error of axis ``source`` (-1: communication) and queue its message with five manufacturer-specific bytes."""
        bits = register_bits(code) if register is None else register
        self._active[source, code] = bits
        data = (maker_bits & 0xFF_FFFF_FFFF).to_bytes(5, "little")
        self.entries.insert(0, code | (maker_bits & 0xFFFF) << 16)
        del self.entries[self.capacity :]
        self._put(code, data)

    def settle(self, source: int) -> None:
        """Remove the errors of axis ``source``, and queue message 0000h once, with the resulting register."""
        mine = [key for key in self._active if key[0] == source]
        for key in mine:
            del self._active[key]
        if mine:
            self._put(0x0000, bytes(5))

    def clear(self) -> None:
        """Clear everything, as a restart does."""
        self.entries.clear()
        self._active.clear()
        self._queue.clear()

    @property
    def queued(self) -> bool:
        """Whether messages wait to be sent."""
        return bool(self._queue)

    def take(self) -> list[tuple[int, int, bytes]]:
        """Return the queued messages (code, register, five bytes), and clear the queue."""
        queue, self._queue = self._queue, []
        return queue

    def waiting(self, now: float) -> tuple[Emcy, ...]:
        """Return the queued messages as values received at ``now``, without clearing the queue."""
        return tuple(Emcy(code, register, data, now) for code, register, data in self._queue)

    def take_emcy(self, now: float) -> tuple[Emcy, ...]:
        """Return the queued messages as values received at ``now``, and clear the queue."""
        if not self._queue:
            return ()
        messages = self.waiting(now)
        self._queue = []
        return messages

    def _put(self, code: int, data: bytes) -> None:
        self._queue.append((code, self.register, data))
        del self._queue[:-_QUEUE_LIMIT]
