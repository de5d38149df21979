"""One SDO transfer over canopen's stream codec: answers matched by multiplexer, aborts that name the object, and a way to cancel.

Theory of operation
-------------------
canopen's ``ReadableStream`` and ``WritableStream`` hold the protocol (CiA 301 7.2.4: expedited and segmented). They talk to what
they take for an SDO client; here that is a ``Transfer``, made for one attempt and closed after it. Three things follow:

- A frame is an answer only if its command fits the request and, where the frame has one, its multiplexer is ours. What does not
  fit is noted and dropped: another master's dialogue, or the late answer to a request that we gave up.
- An abort that we send carries our multiplexer. canopen's own says 0000h:00, which some servers ignore.
- A stream that was given up is closed by the garbage collector and would then send one more segment, into whatever runs by that
  time. A closed ``Transfer`` sends nothing.
"""

from __future__ import annotations

import struct
import time
from queue import Empty, SimpleQueue

from canopen.sdo.client import ReadableStream, WritableStream
from canopen.sdo.exceptions import SdoCommunicationError

from axisbus.bus.channel import Channel
from axisbus.cia301 import cob

SEND_PATIENCE = 0.05

# Client command specifier -> server command specifier of its answer (CiA 301 7.2.4.3, upper three bits).
_ANSWERS = {0x20: 0x60, 0x40: 0x40, 0x00: 0x20, 0x60: 0x00}
_WITH_MULTIPLEXER = frozenset({0x20, 0x40})
_SPECIFIER = 0xE0
_ABORT = 0x80
_MULTIPLEXER = struct.Struct("<HB")
_NO_MULTIPLEXER = b"\0\0\0"

# Put into the inbox to wake whoever waits there.
WAKE = b""


class NoAnswer(Exception):
    """The server did not answer in time."""


class Refused(Exception):
    """The server aborted the transfer with ``code``."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = code


class Garbled(Exception):
    """The dialogue went wrong: toggle bit, size or command; the transfer was aborted by us."""


class Cancelled(Exception):
    """Another thread cancelled the transfer; an abort was sent."""


class Line:
    """One node's SDO channel (600h + node ID, 580h + node ID); holds state: its inbox."""

    def __init__(self, channel: Channel, node_id: int) -> None:
        self.channel = channel
        self.request_id = cob.SDO_RX + node_id
        self.answer_id = cob.SDO_TX + node_id
        self.inbox: SimpleQueue[bytes] = SimpleQueue()
        channel.subscribe(self.answer_id, self._on_answer)
        channel.on_failure.append(self._on_failure)

    def send(self, data: bytes) -> None:
        """Send a request frame; blocks up to 50 ms while the adapter's queue is full (raises ``AdapterError`` after that)."""
        self.channel.send(self.request_id, data, SEND_PATIENCE)

    def empty(self) -> None:
        """Drop what came while no transfer ran."""
        while True:
            try:
                self.inbox.get_nowait()
            except Empty:
                return

    def wake(self) -> None:
        """Have a waiting transfer look whether it is still wanted."""
        self.inbox.put(WAKE)

    def close(self) -> None:
        """End the subscription."""
        self.channel.unsubscribe(self.answer_id, self._on_answer)
        if self._on_failure in self.channel.on_failure:
            self.channel.on_failure.remove(self._on_failure)

    def _on_answer(self, data: bytes, _: float) -> None:
        if data:
            self.inbox.put(data)

    def _on_failure(self, _: object) -> None:
        self.wake()


class Call:
    """What one caller wants, over all its attempts; holds state: whether it was cancelled."""

    __slots__ = ("cancelled", "urgent")

    def __init__(self, urgent: bool = False) -> None:
        self.urgent = urgent
        self.cancelled = False


class Transfer:
    """One attempt at a transfer; what canopen's streams take for their SDO client. Used by one thread; closed after use."""

    def __init__(self, line: Line, call: Call, index: int, subindex: int, timeout: float) -> None:
        self.rx_cobid = line.request_id  # a name that canopen's streams read
        self.strays: list[bytes] = []
        self._line = line
        self._call = call
        self._multiplexer = _MULTIPLEXER.pack(index, subindex)
        self._timeout = timeout
        self._closed = False
        self._begun = False
        self._aborted = False

    def upload(self, index: int, subindex: int) -> bytes:
        """Read an object's bytes.

        Raises:
            NoAnswer, Refused, Garbled, Cancelled, AdapterError.
        """
        try:
            stream = ReadableStream(self, index, subindex)  # type: ignore[no-untyped-call]
            data = bytes(stream.readall() or b"")
        except SdoCommunicationError as error:
            raise Garbled(str(error)) from error
        finally:
            self._closed = True
        if stream.size is not None and len(data) != stream.size:
            raise Garbled(f"{len(data)} bytes came, {stream.size} were announced")
        return data

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object's bytes; up to 4 in one frame, more in segments.

        Raises:
            NoAnswer, Refused, Garbled, Cancelled, AdapterError.
        """
        try:
            stream = WritableStream(self, index, subindex, size=len(data))  # type: ignore[no-untyped-call]
            position = 0
            while position < len(data):
                position += stream.write(data[position:])  # type: ignore[no-untyped-call]
            stream.close()  # type: ignore[no-untyped-call]  # sends the one segment of an empty value, else nothing
        except SdoCommunicationError as error:
            raise Garbled(str(error)) from error
        finally:
            self._closed = True

    def request_response(self, request: bytes) -> bytes:
        """Send a frame and return its answer (called by canopen's streams)."""
        if self._closed:
            return bytes(8)
        self._check_wanted()
        self._begun = True
        self._line.send(bytes(request))
        return self._answer(request[0] & _SPECIFIER)

    def abort(self, code: int = 0x0800_0000) -> None:
        """Tell the server that the transfer is over (called by canopen's streams when an answer breaks the protocol)."""
        if not self._closed:
            self.give_up(code)

    def give_up(self, code: int) -> bool:
        """Send the abort, unless it was sent; ``code`` is one of CiA 301. Return whether the server had been asked anything."""
        if self._begun and not self._aborted:
            self._aborted = True
            self._line.send(bytes([_ABORT]) + self._multiplexer + struct.pack("<I", code))
        return self._begun

    def _answer(self, specifier: int) -> bytes:
        deadline = time.monotonic() + self._timeout
        while True:
            data = self._receive(deadline)
            if data is WAKE:
                self._check_wanted()
            elif data[0] == _ABORT and data[1:4] in (self._multiplexer, _NO_MULTIPLEXER):
                raise Refused(int.from_bytes(data[4:8], "little"))
            elif self._fits(data, specifier):
                return data.ljust(8, b"\0")
            else:
                self.strays.append(data)

    def _receive(self, deadline: float) -> bytes:
        left = deadline - time.monotonic()
        try:
            return self._line.inbox.get(timeout=left) if left > 0 else self._line.inbox.get_nowait()
        except Empty:
            raise NoAnswer from None

    def _fits(self, data: bytes, specifier: int) -> bool:
        if data[0] & _SPECIFIER != _ANSWERS[specifier] or data[0] == _ABORT:
            return False
        return specifier not in _WITH_MULTIPLEXER or data[1:4] == self._multiplexer

    def _check_wanted(self) -> None:
        self._line.channel.check()
        if self._call.cancelled:
            raise Cancelled
