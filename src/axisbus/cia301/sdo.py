"""What both directions of an SDO transfer have in common on the client's side (CiA 301 7.2.4), without a bus or a clock.

Theory of operation
-------------------
A ``SdoTransferAttempt`` is one attempt at one transfer. ``start`` gives the first frame; ``receive`` takes a frame of the server
together with the seconds that passed since the last call, ``elapse`` only time; each returns the frames to be sent. It has ended
well when ``done``, and badly by an exception: ``NoAnswer``, ``SdoAborted``, ``Garbled``. After a bad end (``SdoAborted`` excepted)
the server must be told by ``abort``, which names the object.

What the server may say next is a method, ``_on``: it returns the frames that follow, or None for a frame that does not fit. That
one is a *stray*, the late answer to an earlier request or somebody else's; it is noted and does not prolong the waiting.
A frame of less than 8 bytes fits where it has all the bytes that it speaks of; it is never filled up with what nobody has sent.
"""

from __future__ import annotations

import binascii
from collections.abc import Callable
from enum import Enum

from axisbus.cia301 import abort as codes
from axisbus.wording import counted

Frames = tuple[bytes, ...]
_Handler = Callable[[bytes], Frames | None]

ABORT = 0x80
LARGEST_BLOCK = 127  # segments in a sub-block
SEGMENT = 7  # bytes in a segment
BLOCK_FROM = 256  # bytes from which a block transfer is worth its own frames
FUTILE_BLOCKS = 8  # sub-blocks in a row of which not one segment arrived, after which we give up
LONGEST = 1 << 24  # bytes that are taken in one transfer; a server that sends more has no end

NO_BLOCK = frozenset(
    {codes.UNKNOWN_COMMAND, codes.TIMED_OUT}
)  # answers to a block's initiation that hold for every object
STRAYS = 64  # that are kept
_NO_MULTIPLEXER = b"\0\0\0"
_ROUNDING = 1e-9  # seconds; sums of floats do not meet the time-out exactly


class SdoTransferType(Enum):
    """How the data travels."""

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
    """The dialogue went wrong: toggle bit, sequence, size, checksum or command; the server is to be told ``code``."""

    def __init__(self, text: str, code: int = codes.GENERAL) -> None:
        super().__init__(text)
        self.code = code


class SdoTransferAttempt:
    """One attempt; holds state: what is expected next, how long was waited for it, and what did not fit."""

    def __init__(self, index: int, subindex: int, timeout: float) -> None:
        """``timeout`` is for one answer, in seconds."""
        self.strays: list[bytes] = []
        self.astray = 0  # how many there were
        self.done = False
        self.begun = False
        self.block_refused: int | None = (
            None  # how the server answered the initiation of a block transfer that it does not do
        )
        self._multiplexer = index.to_bytes(2, "little") + bytes([subindex])
        self._timeout = timeout
        self._waited = 0.0
        self._on: _Handler = _nothing
        self._futile = 0
        self._came = 8  # bytes of the frame at hand

    @property
    def remaining(self) -> float:
        """Seconds that may still pass without an answer."""
        return max(0.0, self._timeout - self._waited)

    @property
    def progress(self) -> tuple[int, int | None]:
        """Bytes that have arrived at the other end, and bytes in all (None: not known)."""
        raise NotImplementedError

    def start(self) -> Frames:
        """Return the first frames."""
        self.begun = True
        return self._begin()

    def receive(self, frame: bytes, dt: float = 0.0) -> Frames:
        """Take a frame of the server that came ``dt`` seconds after the last call; return what to send.

        Raises:
            NoAnswer, Refused, Garbled.
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
        """Let ``dt`` seconds pass without a frame that fits; return what to send.

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
        self, progress: int, what: str = "block", why: str = "of which no segment arrived"
    ) -> None:
        """Give up where sub-block after sub-block, or segment after segment, is sent in vain."""
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
    """Expect no frame."""
