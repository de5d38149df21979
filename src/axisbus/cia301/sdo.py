"""The part that both directions of an SDO transfer share on the client's side (CiA 301 7.2.4), independent of bus and clock.

Theory of operation
-------------------
A ``SdoTransferAttempt`` is one attempt at one transfer. ``start`` returns the first frame. ``receive`` takes a frame of the server
and the seconds since the last call; ``elapse`` takes only the seconds. Each returns the frames to be sent. The attempt has
succeeded when ``done`` is True. It fails with an exception: ``NoAnswer``, ``SdoAborted`` or ``Garbled``. After ``NoAnswer`` and
``Garbled`` the caller must send the frame that ``abort`` returns, which contains the object.

The method ``_on`` handles the frame that is expected next. It returns the frames to send, or None for a frame that does not fit.
Such a frame is a *stray*: the late answer to an earlier request, or an answer to another client. A stray is recorded and does not
prolong the wait. A frame of less than 8 bytes fits if it contains all the bytes that its command requires. Bytes that the server
has not sent are never assumed.
"""

from __future__ import annotations

import binascii
from collections.abc import Callable
from enum import Enum
from typing import TypeVar

from axisbus.cia301 import abort as codes
from axisbus.errors import SdoAbort, SdoError
from axisbus.wording import counted

T = TypeVar("T")

Frames = tuple[bytes, ...]
_Handler = Callable[[bytes], Frames | None]

ABORT = 0x80
LARGEST_BLOCK = 127  # segments in a sub-block
SEGMENT = 7  # bytes in a segment
BLOCK_FROM = 256  # bytes from which the additional frames of a block transfer pay off
FUTILE_BLOCKS = 8  # sub-blocks in a row without any received segment, after which the client gives up
LONGEST = 1 << 24  # bytes that are accepted in one transfer; a server that sends more does not end

NO_BLOCK = frozenset(
    {codes.UNKNOWN_COMMAND, codes.TIMED_OUT}
)  # answers to the initiation of a block transfer that apply to every object
STRAYS = 64  # that are stored
_NO_MULTIPLEXER = b"\0\0\0"
_ROUNDING = 1e-9  # seconds; sums of floats do not equal the time-out exactly


class SdoTransferType(Enum):
    """Transfer protocol."""

    NORMAL = "expedited up to 4 bytes, else in segments that are confirmed one by one"
    BLOCK = "in blocks, or as NORMAL where the server does not know blocks"
    AUTO = "by size: in blocks where there are many bytes, else as NORMAL"


class NoAnswer(Exception):
    """The server did not answer in time."""


class SdoAborted(Exception):
    """The server aborted the transfer with ``code``."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = code


class Garbled(Exception):
    """The server violated the protocol: toggle bit, sequence, size, checksum or command. Abort the transfer with ``code``."""

    def __init__(self, text: str, code: int = codes.GENERAL) -> None:
        super().__init__(text)
        self.code = code


class SdoTransferAttempt:
    """One attempt; holds state: the expected frame, the time waited for it, and the strays."""

    def __init__(self, index: int, subindex: int, timeout: float) -> None:
        """``timeout`` is for one answer, in seconds."""
        self.strays: list[bytes] = []
        self.astray = 0  # total number of strays
        self.done = False
        self.begun = False
        # abort code of a server that refused the initiation of a block transfer
        self.block_refused: int | None = None
        self.entry = (index, subindex)
        self._multiplexer = index.to_bytes(2, "little") + bytes([subindex])
        self._timeout = timeout
        self._waited = 0.0
        self._on: _Handler = _nothing
        self._futile = 0
        self._came = 8  # bytes of the present frame

    @property
    def remaining(self) -> float:
        """Seconds that may still pass without an answer."""
        return max(0.0, self._timeout - self._waited)

    @property
    def progress(self) -> tuple[int, int | None]:
        """Bytes transferred, and bytes in total (None: unknown)."""
        raise NotImplementedError

    def start(self) -> Frames:
        """Return the first frames."""
        self.begun = True
        return self._begin()

    def receive(self, frame: bytes, dt: float = 0.0) -> Frames:
        """Handle a frame of the server that came ``dt`` seconds after the last call; return the frames to send.

        Raises:
            NoAnswer, SdoAborted, Garbled.
        """
        self._came = len(frame)
        frame = frame.ljust(8, b"\0")
        if frame[0] == ABORT and self._came >= 8 and frame[1:4] in (self._multiplexer, _NO_MULTIPLEXER):
            self._waited = 0.0
            return self._aborted(int.from_bytes(frame[4:8], "little"))
        answer = self._on(frame) if frame[0] != ABORT and self._came else None
        if answer is None:
            self.astray += 1
            self.strays.append(frame[: self._came])
            del self.strays[:-STRAYS]
            return self.elapse(dt)
        self._waited = 0.0
        return answer

    def elapse(self, dt: float) -> Frames:
        """Let ``dt`` seconds pass without a frame that fits; return the frames to send.

        Raises:
            NoAnswer: the time is up.
        """
        self._waited += dt
        if self._waited < self._timeout - _ROUNDING:
            return ()
        self._waited = 0.0
        return self._silence()

    def abort(self, code: int) -> bytes:
        """Return the frame that ends the transfer, with the multiplexer of its object (CiA 301 7.2.4.3.17)."""
        return bytes([ABORT]) + self._multiplexer + code.to_bytes(4, "little")

    # -- for the two directions ---------------------------------------------------------------------------------------------------

    def _begin(self) -> Frames:
        raise NotImplementedError

    def _aborted(self, code: int) -> Frames:
        raise SdoAborted(code)

    def _silence(self) -> Frames:
        raise NoAnswer

    def _request(self, command: int, data: bytes = b"") -> bytes:
        return bytes([command]) + self._multiplexer + data.ljust(4, b"\0")

    def _is_ours(self, frame: bytes) -> bool:
        return self._came >= 4 and frame[1:4] == self._multiplexer

    def _end(self) -> None:
        self.done = True
        self._on = _nothing

    def _count_futile(
        self, progress: int, what: str = "block", why: str = "without any received segment"
    ) -> None:
        """Give up if several sub-blocks or segments in a row transferred nothing."""
        self._futile = 0 if progress else self._futile + 1
        if self._futile >= FUTILE_BLOCKS:
            raise Garbled(f"{counted(self._futile, what)} in a row {why}", codes.WRONG_SEQUENCE)


def checksum(data: bytes) -> int:
    """Return the CRC of a block transfer (CiA 301 7.2.4.3.16: polynomial 1021h, start 0; ``123456789`` gives 31C3h)."""
    return binascii.crc_hqx(data, 0)


def check_toggle(frame: bytes, expected: int) -> None:
    """Check that the toggle bit of a segment's answer alternates.

    Raises:
        Garbled: it does not.
    """
    if frame[0] & 0x10 != expected:
        raise Garbled("toggle bit not alternated", codes.TOGGLE)


def _nothing(_frame: bytes) -> None:
    """Accept no frame."""


def if_served(read: Callable[[int, int], T], index: int, subindex: int = 0) -> T | None:
    """Return what ``read`` returns for an object; None if the node refuses it, or is silent for this object only.

    Raises:
        SdoAbort: the node is busy (``abort.BUSY``): it has the object, and does not serve it now.
        As ``read`` in other cases: the node does not answer.
    """
    try:
        return read(index, subindex)
    except SdoError as error:
        if not error.for_this_only or (isinstance(error, SdoAbort) and error.code in codes.BUSY):
            raise
        return None


def number_if_served(upload: Callable[[int, int], bytes], index: int, subindex: int = 0) -> int | None:
    """Return the bytes of an object as an unsigned number, or None, as ``if_served``."""
    data = if_served(upload, index, subindex)
    return None if data is None else int.from_bytes(data, "little")
