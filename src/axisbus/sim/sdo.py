"""The SDO server of a node (CiA 301 7.2.4): expedited and segmented, one transfer at a time.

A block upload is answered by a normal one, which CiA 301 lets a server do; a block download is refused. A segment that belongs to
no transfer is refused too. Nothing here waits: when an answer leaves is the slave's affair.
"""

from __future__ import annotations

from axisbus.errors import SdoAbort
from axisbus.sim.dials import NodeDials
from axisbus.sim.dictionary import LENGTH, Dictionary

TOGGLE = 0x0503_0000
UNKNOWN_COMMAND = 0x0504_0001


class _Abort(Exception):
    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class SdoServer:
    """Answers requests; holds the segmented transfer under way."""

    def __init__(self, dictionary: Dictionary, dials: NodeDials) -> None:
        self._dictionary = dictionary
        self._dials = dials
        self._multiplexer = b"\0\0\0"
        self.reset()

    def reset(self) -> None:
        """Forget a transfer under way."""
        self._upload: bytes | None = None
        self._download: bytearray | None = None
        self._announced: int | None = None
        self._toggle = 0

    def request(self, data: bytes) -> bytes | None:
        """Return the answer to a frame of 8 bytes; None where there is none to give."""
        if len(data) != 8:
            return None
        command = data[0] >> 5
        try:
            if command == 0:
                return self._download_segment(data)
            if command == 3:
                return self._upload_segment(data)
            if command == 4:
                self.reset()
                return None
            self.reset()
            self._multiplexer = bytes(data[1:4])
            if command == 1:
                return self._start_download(data)
            if command == 2 or (command == 5 and data[0] & 0x03 == 0):
                return self._start_upload()
            raise _Abort(UNKNOWN_COMMAND)
        except _Abort as abort:
            code = abort.code
        except SdoAbort as abort:
            code = abort.code
        self.reset()
        return b"\x80" + self._multiplexer + code.to_bytes(4, "little")

    @property
    def _object(self) -> tuple[int, int]:
        return self._multiplexer[0] | self._multiplexer[1] << 8, self._multiplexer[2]

    def _start_upload(self) -> bytes:
        index, subindex = self._object
        self._forced(index, subindex, writing=False)
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

    def _start_download(self, request: bytes) -> bytes:
        index, subindex = self._object
        self._forced(index, subindex, writing=True)
        expedited, sized = request[0] & 0x02, request[0] & 0x01
        if expedited:
            self._dictionary.download(index, subindex, self._expedited_data(request))
        else:
            self._dictionary.admit(index, subindex)
            self._download = bytearray()
            self._announced = int.from_bytes(request[4:8], "little") if sized else None
        return b"\x60" + self._multiplexer + bytes(4)

    def _expedited_data(self, request: bytes) -> bytes:
        if request[0] & 0x01:
            return request[4 : 8 - (request[0] >> 2 & 0x03)]
        entry = self._dictionary.entries.get(self._object[0] << 8 | self._object[1])
        size = 4 if entry is None or entry.size is None else min(entry.size, 4)
        return request[4 : 4 + size]  # the size was not said: as many bytes as the object has

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

    def _forced(self, index: int, subindex: int, *, writing: bool) -> None:
        """Refuse what the dials say."""
        code = self._dials.refusal(index, subindex, writing=writing)
        if code is not None:
            raise _Abort(code)
