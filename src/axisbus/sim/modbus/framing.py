"""RTU frames: their checksum, and where one ends in the bytes that come (Modbus over serial line V1.02, 2.5)."""

from __future__ import annotations

_READS = (0x03, 0x04)
_WRITE_ONE, _WRITE_SEVERAL = 0x06, 0x10
_SHORTEST = 4  # address, function, checksum
_REQUEST = 8  # of reads, and of a write of one register
_COUNT_AT = 6  # of the byte that says how many bytes are written
_GAP = 0.02  # s of silence that end a frame; 3.5 characters are less, but a computer pauses


def checksum(data: bytes) -> bytes:
    """Return the two bytes that end a frame, lowest first."""
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
    """Cuts what comes into frames; holds the beginning of one."""

    def __init__(self) -> None:
        self._waiting = b""
        self._last = 0.0
        self.broken = 0  # frames whose checksum was wrong

    def take(self, data: bytes, now: float) -> list[bytes]:
        """Take bytes that came at ``now`` (s); return the frames that are complete and right, without their checksum."""
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
                self._waiting = b""  # where the next one begins nobody knows before the line was silent
        return found


def _size(data: bytes) -> int:
    """Return how long the request is that begins here; 0: not known yet."""
    if len(data) < 2:
        return 0
    function = data[1]
    if function in _READS or function == _WRITE_ONE:
        return _REQUEST
    if function == _WRITE_SEVERAL:
        return _COUNT_AT + 1 + data[_COUNT_AT] + 2 if len(data) > _COUNT_AT else 0
    return max(_SHORTEST, len(data))  # a function that a module does not know: whatever came together
