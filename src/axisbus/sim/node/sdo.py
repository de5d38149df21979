"""SDO server of a simulated node (CiA 301 7.2.4): expedited, segmented and block transfers, one at a time.

A block upload of few bytes is answered by a normal upload, which CiA 301 permits. A segment without a transfer is rejected. The
server never waits: the slave decides when an answer is sent.
"""

from __future__ import annotations

from axisbus.errors import SdoAbort
from axisbus.sim.dictionary import LENGTH, Dictionary
from axisbus.sim.fault_injection import NodeFaults

TOGGLE = 0x0503_0000
UNKNOWN_COMMAND = 0x0504_0001
BLOCK_PATIENCE = 1.0  # seconds of silence after which a block transfer is discarded


class _Abort(Exception):
    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class SdoServer:
    """Answers requests; holds the active transfer."""

    def __init__(self, dictionary: Dictionary, dials: NodeFaults) -> None:
        self._dictionary = dictionary
        self._dials = dials
        self._multiplexer = b"\0\0\0"
        self._last_request = 0.0
        self.reset()

    def reset(self) -> None:
        """Discard the active transfer."""
        self._upload: bytes | None = None
        self._download: bytearray | None = None
        self._announced: int | None = None
        self._toggle = 0
        self._block_down: BlockDownload | None = None
        self._block_up: BlockUpload | None = None

    def request(self, data: bytes, now: float = 0.0) -> list[bytes]:
        """Return the answers to an 8-byte frame received at ``now`` (seconds): usually one, in a block transfer none or many."""
        if len(data) != 8:
            return []
        if now - self._last_request > BLOCK_PATIENCE:
            self._block_down = self._block_up = None
        self._last_request = now
        try:
            return self._answer(data)
        except (_Abort, BlockAbort, SdoAbort) as abort:
            code = abort.code
        self.reset()
        return [b"\x80" + self._multiplexer + code.to_bytes(4, "little")]

    def _answer(self, data: bytes) -> list[bytes]:
        command = data[0] >> 5
        if data[0] == 0x80:
            self.reset()
            return []
        if self._block_down is not None:
            return self._download_block(data)
        if command == 5 and data[0] & 3 and self._block_up is not None:
            return self._upload_block(data)
        if command == 0:
            return [self._download_segment(data)]
        if command == 3:
            return [self._upload_segment(data)]
        return [self._initiate(command, data)]

    def _initiate(self, command: int, data: bytes) -> bytes:
        self.reset()
        self._multiplexer = bytes(data[1:4])
        if command == 1:
            return self._start_download(data)
        if command == 2:
            return self._start_upload()
        if command == 5 and data[0] & 3 == 0 and self._dials.sdo_block:
            return self._start_block_upload(data)
        if command == 6 and data[0] & 1 == 0 and self._dials.sdo_block:
            return self._start_block_download(data)
        raise _Abort(UNKNOWN_COMMAND)

    @property
    def _object(self) -> tuple[int, int]:
        return self._multiplexer[0] | self._multiplexer[1] << 8, self._multiplexer[2]

    def _start_upload(self) -> bytes:
        index, subindex = self._object
        self._require_accepted(index, subindex, writing=False)
        data = self._dictionary.upload(index, subindex)
        if 0 < len(data) <= 4:
            return bytes([0x43 | (4 - len(data)) << 2]) + self._multiplexer + data.ljust(4, b"\0")
        self._upload = data
        return b"\x41" + self._multiplexer + len(data).to_bytes(4, "little")

    def _upload_segment(self, request: bytes) -> bytes:
        if self._upload is None:
            raise _Abort(UNKNOWN_COMMAND)
        self._check_toggle(request[0])
        part, rest = self._upload[:7], self._upload[7:]
        header = (request[0] & 0x10) | (7 - len(part)) << 1 | (0 if rest else 1)
        self._upload = rest if rest else None
        return bytes([header]) + part.ljust(7, b"\0")

    def _start_block_upload(self, request: bytes) -> bytes:
        index, subindex = self._object
        self._require_accepted(index, subindex, writing=False)
        data = self._dictionary.upload(index, subindex)
        if len(data) <= request[5]:
            return self._start_upload()
        checksum = self._dials.sdo_checksum
        self._block_up = BlockUpload(data, request[4], checksum and bool(request[0] & 4))
        return bytes([0xC2 | checksum << 2]) + self._multiplexer + len(data).to_bytes(4, "little")

    def _upload_block(self, data: bytes) -> list[bytes]:
        assert self._block_up is not None
        answer = self._block_up.take(data)
        if self._block_up.finished:
            self._block_up = None
        return answer

    def _start_block_download(self, request: bytes) -> bytes:
        index, subindex = self._object
        self._require_accepted(index, subindex, writing=True)
        self._dictionary.require_writable(index, subindex)
        announced = int.from_bytes(request[4:8], "little") if request[0] & 2 else None
        checksum = self._dials.sdo_checksum
        self._block_down = BlockDownload(self._dials, announced, checksum and bool(request[0] & 4))
        return (
            bytes([0xA0 | checksum << 2]) + self._multiplexer + bytes([self._dials.sdo_block_size, 0, 0, 0])
        )

    def _download_block(self, data: bytes) -> list[bytes]:
        assert self._block_down is not None
        answer = self._block_down.take(data)
        if self._block_down.data is not None:
            whole = self._block_down.data
            self._block_down = None
            self._dictionary.download(*self._object, whole)
        return answer

    def _start_download(self, request: bytes) -> bytes:
        index, subindex = self._object
        self._require_accepted(index, subindex, writing=True)
        expedited, sized = request[0] & 0x02, request[0] & 0x01
        if expedited:
            self._dictionary.download(index, subindex, self._expedited_data(request))
        else:
            self._dictionary.require_writable(index, subindex)
            self._download = bytearray()
            self._announced = int.from_bytes(request[4:8], "little") if sized else None
        return b"\x60" + self._multiplexer + bytes(4)

    def _expedited_data(self, request: bytes) -> bytes:
        if request[0] & 0x01:
            return request[4 : 8 - (request[0] >> 2 & 0x03)]
        entry = self._dictionary.entries.get(self._object[0] << 8 | self._object[1])
        size = 4 if entry is None or entry.size is None else min(entry.size, 4)
        return request[4 : 4 + size]  # size not indicated: use the object's size

    def _download_segment(self, request: bytes) -> bytes:
        if self._download is None:
            raise _Abort(UNKNOWN_COMMAND)
        self._check_toggle(request[0])
        self._download += request[1 : 8 - (request[0] >> 1 & 0x07)]
        if request[0] & 0x01:
            data, self._download = bytes(self._download), None
            if self._announced is not None and len(data) != self._announced:
                raise _Abort(LENGTH)
            self._dictionary.download(*self._object, data)
        return bytes([0x20 | request[0] & 0x10]) + bytes(7)

    def _check_toggle(self, command: int) -> None:
        if command & 0x10 != self._toggle:
            raise _Abort(TOGGLE)
        self._toggle ^= 0x10

    def _require_accepted(self, index: int, subindex: int, *, writing: bool) -> None:
        """Reject the request if a fault setting requires that."""
        code = self._dials.refusal(index, subindex, writing=writing)
        if code is not None:
            raise _Abort(code)


# -- Block transfers at the server's side (CiA 301 7.2.4.3.8 to 7.2.4.3.15): the frames between initiation and end -----


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
        self._received = 0  # segments in order, in this sub-block
        self._whole = False
        self.data: bytes | None = None  # the data to write, after the client's end

    def take(self, frame: bytes) -> Answer:
        """Take a segment or, after the last one, the client's end."""
        if self._whole:
            return self._end(frame)
        number, last = frame[0] & 0x7F, frame[0] >= 0x80
        if number == self._received + 1:
            self._received = number
            self._segments.append(frame[1:8])
            self._whole = last
        if not last and number != self._size:
            return []
        received, self._received = self._received, 0
        self._size = _checked(self._dials.sdo_block_size)
        return [bytes([0xA2, received, self._size, 0, 0, 0, 0, 0])]

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
