"""RTU frames: their checksum, and their end in the received bytes (Modbus over serial line V1.02, 2.5)."""

from __future__ import annotations

_READS = (0x03, 0x04)
_WRITE_ONE, _WRITE_SEVERAL = 0x06, 0x10
_SHORTEST = 4  # address, function, checksum
_REQUEST = 8  # length of reads, and of a write of one register
_COUNT_AT = 6  # position of the byte count of a write
_GAP = 0.02  # s of silence that end a frame; longer than 3.5 characters, because a computer may pause


def checksum(data: bytes) -> bytes:
    """Return the two bytes of the checksum, lowest first."""
    found = 0xFFFF
    for byte in data:
        found ^= byte
        for _ in range(8):
            odd = found & 1
            found >>= 1
            if odd:
                found ^= 0xA001
    return found.to_bytes(2, "little")


def framed(data: bytes) -> bytes:
    """Return a frame: address, function and data, with their checksum."""
    return data + checksum(data)


class Frames:
    """Splits received bytes into frames; holds an incomplete frame."""

    def __init__(self) -> None:
        self._waiting = b""
        self._last = 0.0
        self.broken = 0  # frames with a wrong checksum

    def take(self, data: bytes, now: float) -> list[bytes]:
        """Take bytes received at ``now`` (s); return the complete and correct frames, without their checksum."""
        if self._waiting and now - self._last > _GAP:
            self._waiting = b""
        self._waiting += data
        self._last = now
        found = []
        while (size := _size(self._waiting)) and len(self._waiting) >= size:
            frame, self._waiting = self._waiting[:size], self._waiting[size:]
            if checksum(frame[:-2]) == frame[-2:]:
                found.append(frame[:-2])
            else:
                self.broken += 1
                self._waiting = b""  # the begin of the next frame is unknown until the line was silent
        return found


def _size(data: bytes) -> int:
    """Return the length of the request that begins here; 0: not known yet."""
    if len(data) < 2:
        return 0
    function = data[1]
    if function in _READS or function == _WRITE_ONE:
        return _REQUEST
    if function == _WRITE_SEVERAL:
        return _COUNT_AT + 1 + data[_COUNT_AT] + 2 if len(data) > _COUNT_AT else 0
    return max(_SHORTEST, len(data))  # unknown function: all bytes received together
