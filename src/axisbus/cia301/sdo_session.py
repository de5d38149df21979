"""One SDO request with all its attempts, as a pure state machine of dialogues.

Theory of operation
-------------------
An attempt without an answer, or with a garbled one, is ended by an abort. Before the next attempt comes a *barrier*: the client
reads a mandatory object, and discards all frames that arrive before its answer. A server answers in order. So the late answer to an
abandoned request can never be taken for the answer to a later one, not even for the same object. The barrier itself may be
abandoned and answered late, so the next one reads another object: one to which no answer may still come, or the one that was
abandoned longest ago. A barrier without an answer counts as a failed attempt. ``late`` and ``no_block`` hold the information for
the next request.

Large data is sent in blocks if the server supports blocks. After a block transfer has failed, the last attempt uses the normal
transfer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from axisbus.cia301 import abort as codes
from axisbus.cia301.objects import DEVICE_TYPE, ERROR_REGISTER, IDENTITY
from axisbus.cia301.sdo import (
    BLOCK_FROM,
    LONGEST,
    NO_BLOCK,
    STRAYS,
    Frames,
    Garbled,
    NoAnswer,
    SdoAborted,
    SdoTransferType,
)
from axisbus.cia301.sdo_download import Download
from axisbus.cia301.sdo_upload import Upload

# Aborts that report a broken dialogue and not an objection to the request: worth another attempt.
BROKEN_DIALOGUE = frozenset(
    {
        codes.TOGGLE,
        codes.TIMED_OUT,
        codes.UNKNOWN_COMMAND,
        codes.WRONG_BLOCK_SIZE,
        codes.WRONG_SEQUENCE,
        codes.WRONG_CHECKSUM,
    }
)
_BARRIERS = ((DEVICE_TYPE, 0), (ERROR_REGISTER, 0), (IDENTITY, 0))
_BARRIER_MOST = 64  # bytes; 1000h has 4, the others have 1


class SdoTransferRequest(NamedTuple):
    """A request: ``data`` None reads; ``timeout`` in seconds is for one answer, ``tries`` is the maximum number of attempts.

    ``most`` limits the bytes accepted from the server when reading. ``usual`` is the size of the object's type in bytes (None:
    unknown).
    """

    index: int  # type: ignore[assignment]  # hides tuple.index, which is not needed here
    subindex: int
    data: bytes | None
    timeout: float
    tries: int
    transfer_type: SdoTransferType = SdoTransferType.AUTO
    most: int = LONGEST
    usual: int | None = None


class SdoSession:
    """One running request; holds state: the present dialogue, and the failures so far.

    ``done`` is True when it has ended. Then ``failure`` is the reason (None: success), and ``data`` holds the bytes that were read.
    """

    def __init__(
        self,
        request: SdoTransferRequest,
        *,
        late: tuple[tuple[int, int], ...] = (),
        no_block: bool = False,
        urgent: bool = False,
    ) -> None:
        """``late``: objects of requests that may still be answered, oldest first; ``urgent``: the first attempt has no barrier."""
        self.late = late
        self.no_block = no_block
        self.done = False
        self.data = b""
        self.failure: NoAnswer | Garbled | SdoAborted | None = None
        self.strays: list[bytes] = []
        self.astray = 0  # frames that did not fit; the newest are in ``strays``
        self.retries = 0  # attempts after the first
        self.answers_others = False  # whether the last barrier was answered
        self._request = request
        self._urgent = urgent
        self._attempt = 0
        self._barrier: Upload | None = None
        self._dialogue = self._made()

    @property
    def remaining(self) -> float:
        """Seconds that may still pass without an answer."""
        return self._current.remaining

    @property
    def unfit(self) -> int:
        """Number of frames so far that did not fit."""
        return self.astray + self._current.astray

    @property
    def progress(self) -> tuple[int, int | None]:
        """Bytes transferred in this attempt, and bytes in total (None: unknown)."""
        return self._dialogue.progress

    def start(self) -> Frames:
        """Return the first frames."""
        return self._step(self._begin_attempt)

    def receive(self, frame: bytes, dt: float = 0.0) -> Frames:
        """Handle a frame that came ``dt`` seconds after the last call; return the frames to send. Never raises."""
        return self._step(lambda: self._current.receive(frame, dt))

    def elapse(self, dt: float) -> Frames:
        """Let ``dt`` seconds pass; return the frames to send. Never raises."""
        return self._step(lambda: self._current.elapse(dt))

    def give_up(self) -> Frames:
        """End the session because its result is no longer needed; return the abort if a transfer has begun."""
        self.done = True
        self._keep_strays()
        return self._abandoned(codes.GENERAL) if self._current.begun else ()

    @property
    def _current(self) -> Upload | Download:
        return self._barrier or self._dialogue

    def _step(self, act: Callable[[], Frames]) -> Frames:
        try:
            frames = act()
        except NoAnswer as silence:
            return (*self._abandoned(codes.TIMED_OUT), *self._again(silence))
        except Garbled as garbled:
            return (*self._abandoned(garbled.code), *self._again(garbled))
        except SdoAborted as refused:
            return self._refused(refused)
        return (*frames, *self._finish()) if self._current.done else frames

    def _refused(self, refused: SdoAborted) -> Frames:
        if self._barrier is not None:
            return self._passed_barrier()  # any answer, including an abort, passes the barrier
        if refused.code in BROKEN_DIALOGUE:
            return self._again(refused)
        return self._ended(refused)

    def _finish(self) -> Frames:
        if self._barrier is not None:
            return self._passed_barrier()
        self.no_block = self.no_block or self._dialogue.block_refused in NO_BLOCK
        if isinstance(self._dialogue, Upload):
            self.data = self._dialogue.data
        return self._ended(None)

    def _ended(self, failure: NoAnswer | Garbled | SdoAborted | None) -> Frames:
        self._keep_strays()
        self.done, self.failure = True, failure
        return ()

    # -- attempts and barriers -----------------------------------------------------------------------------------------------------

    def _begin_attempt(self) -> Frames:
        self._dialogue = self._made()
        if not self.late or (self._urgent and self._attempt == 0):
            return self._dialogue.start()
        index, subindex = min(_BARRIERS, key=self._abandoned_at)
        self._barrier = Upload(index, subindex, self._request.timeout, most=_BARRIER_MOST)
        return self._barrier.start()

    def _abandoned_at(self, wanted: tuple[int, int]) -> int:
        return self.late.index(wanted) if wanted in self.late else -1

    def _passed_barrier(self) -> Frames:
        self._keep_strays()
        self._barrier, self.late = None, ()
        self.answers_others = True
        return self._dialogue.start()

    def _again(self, failure: NoAnswer | Garbled | SdoAborted) -> Frames:
        self._keep_strays()
        if self._barrier is not None:
            self.answers_others = False
        self._barrier = None
        self._attempt += 1
        if self._attempt >= self._request.tries:
            return self._ended(failure)
        self.retries += 1
        return self._begin_attempt()

    def _abandoned(self, code: int) -> Frames:
        asked = self._current.entry
        self.late = (*(each for each in self.late if each != asked), asked)
        return (self._current.abort(code),)

    def _keep_strays(self) -> None:
        self.strays = (self.strays + self._current.strays)[-STRAYS:]
        self._current.strays.clear()
        self.astray += self._current.astray
        self._current.astray = 0

    def _made(self) -> Upload | Download:
        index, subindex, data, timeout = self._request[:4]
        if data is None:
            return Upload(
                index,
                subindex,
                timeout,
                self._transfer_type(),
                most=self._request.most,
                usual=self._request.usual,
            )
        return Download(index, subindex, data, timeout, self._transfer_type())

    def _transfer_type(self) -> SdoTransferType:
        """Choose the transfer type; the type in the request has priority over the experience with this server."""
        request = self._request
        if request.transfer_type is not SdoTransferType.AUTO:
            return request.transfer_type
        last_resort = 0 < self._attempt == request.tries - 1
        if self.no_block or last_resort:
            return SdoTransferType.NORMAL
        if request.data is None:
            return SdoTransferType.AUTO
        return SdoTransferType.BLOCK if len(request.data) >= BLOCK_FROM else SdoTransferType.NORMAL
