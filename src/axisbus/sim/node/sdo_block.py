"""Block transfers at the server's side (CiA 301 7.2.4.3.8 to 7.2.4.3.15): the frames between initiation and end."""

from __future__ import annotations

from axisbus.sim.fault_injection import NodeFaults

Answer = list[bytes]

CHECKSUM_WRONG = 0x0504_0004
SEQUENCE_WRONG = 0x0504_0003
SIZE_WRONG = 0x0504_0002
COMMAND_WRONG = 0x0504_0001
LENGTH_WRONG = 0x0607_0010


class BlockAbort(Exception):
    """The server aborts the transfer with ``code``."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class BlockUpload:
    """An upload to the client; holds the number of segments that the client has confirmed."""

    def __init__(self, data: bytes, size: int, checksum: bool) -> None:
        """``size``: number of segments that the client accepts at a time; ``checksum``: both sides support it."""
        self._segments = [data[at : at + 7] for at in range(0, len(data), 7)] or [b""]
        self._crc = crc16(data) if checksum else 0
        self._from = 0
        self._under_way = 0
        self._started = False
        self._size = _checked(size)
        self.finished = False

    def take(self, frame: bytes) -> Answer:
        """Answer the client's start (A3h), confirmation (A2h) or end (A1h)."""
        kind = frame[0] & 3
        if kind == 3 and not self._started:
            self._started = True
            return self._burst()
        if kind == 2 and self._started:
            return self._confirmed(frame[1], frame[2])
        if kind == 1 and self._from == len(self._segments):
            self.finished = True
            return []
        raise BlockAbort(COMMAND_WRONG)

    def _confirmed(self, last: int, size: int) -> Answer:
        if self._from < len(self._segments):  # else the client has missed the end frame, and confirms again
            if last > self._under_way:
                raise BlockAbort(SEQUENCE_WRONG)
            self._size = _checked(size)
            self._from += last
        if self._from < len(self._segments):
            return self._burst()
        empty = 7 - len(self._segments[-1])
        return [bytes([0xC0 | empty << 2 | 1, self._crc & 0xFF, self._crc >> 8, 0, 0, 0, 0, 0])]

    def _burst(self) -> Answer:
        part = self._segments[self._from : self._from + self._size]
        self._under_way = len(part)
        frames = [bytes([number]) + data.ljust(7, b"\0") for number, data in enumerate(part, 1)]
        if self._from + len(part) == len(self._segments):
            frames[-1] = bytes([frames[-1][0] | 0x80]) + frames[-1][1:]
        return frames


class BlockDownload:
    """A download from the client; holds the segments received in order."""

    def __init__(self, dials: NodeFaults, announced: int | None, checksum: bool) -> None:
        """``announced``: size indicated by the client; ``checksum``: both sides support it."""
        self._dials = dials
        self._announced = announced
        self._checksum = checksum
        self._segments: list[bytes] = []
        self._size = _checked(dials.sdo_block_size)
        self._came = 0  # segments in order, in this sub-block
        self._whole = False
        self.data: bytes | None = None  # the data to write, after the client's end

    def take(self, frame: bytes) -> Answer:
        """Take a segment or, after the last one, the client's end."""
        if self._whole:
            return self._end(frame)
        number, last = frame[0] & 0x7F, frame[0] >= 0x80
        if number == self._came + 1:
            self._came = number
            self._segments.append(frame[1:8])
            self._whole = last
        if not last and number != self._size:
            return []
        came, self._came = self._came, 0
        self._size = _checked(self._dials.sdo_block_size)
        return [bytes([0xA2, came, self._size, 0, 0, 0, 0, 0])]

    def _end(self, frame: bytes) -> Answer:
        if frame[0] & 0b1110_0011 != 0b1100_0001:
            raise BlockAbort(COMMAND_WRONG)
        data = b"".join(self._segments)
        data = data[: len(data) - (frame[0] >> 2 & 7)]
        if self._checksum and crc16(data) != frame[1] | frame[2] << 8:
            raise BlockAbort(CHECKSUM_WRONG)
        if self._announced is not None and len(data) != self._announced:
            raise BlockAbort(LENGTH_WRONG)
        self.data = data
        return [bytes([0xA1, 0, 0, 0, 0, 0, 0, 0])]


def crc16(data: bytes) -> int:
    """Return the checksum of CiA 301 7.2.4.3.16: x^16 + x^12 + x^5 + 1, initial value 0."""
    crc = 0
    for byte in data:
        crc = _STEP[crc >> 8 ^ byte] ^ (crc << 8 & 0xFF00)
    return crc


def _step(high: int) -> int:
    crc = high << 8
    for _ in range(8):
        crc = crc << 1 ^ (0x1_1021 if crc & 0x8000 else 0)
    return crc


_STEP = [_step(high) for high in range(256)]


def _checked(size: int) -> int:
    if not 0 < size < 128:
        raise BlockAbort(SIZE_WRONG)
    return size
