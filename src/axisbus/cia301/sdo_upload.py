"""Read an object as a pure state machine: expedited, segmented, or as a block transfer.

Theory of operation
-------------------
``SdoTransferType.AUTO`` begins with a normal transfer. If the server announces many bytes, the client aborts that transfer and
requests a block transfer. If the server refuses the block transfer or does not answer, the normal transfer follows.

In a block transfer the server sends up to 127 segments unconfirmed. The client stores the segments that come in order. At the end
of the sub-block the client confirms the last good number, and the server continues after it. If the end of a sub-block is lost, the
client answers the silence once with the confirmation of the segments received so far. This is safe only under two conditions. At
least one segment of the sub-block has come, else the client might confirm the sub-block before a second time. And a checksum and a
size will verify the data at the end. After the last sub-block the client repeats its confirmation once in any case. Otherwise the
attempt is given up.
"""

from __future__ import annotations

from axisbus.cia301 import abort as codes
from axisbus.cia301.sdo import (
    BLOCK_FROM,
    LARGEST_BLOCK,
    LONGEST,
    SEGMENT,
    Frames,
    Garbled,
    SdoTransferAttempt,
    SdoTransferType,
    check_toggle,
    checksum,
)
from axisbus.wording import counted


class Upload(SdoTransferAttempt):
    """One attempt at reading; ``data`` holds the bytes received so far, complete when ``done``."""

    def __init__(
        self,
        index: int,
        subindex: int,
        timeout: float,
        transfer_type: SdoTransferType = SdoTransferType.NORMAL,
        block_size: int = LARGEST_BLOCK,
        most: int = LONGEST,
        usual: int | None = None,
    ) -> None:
        """``block_size`` is the number of segments per confirmation, 1 to 127; ``most`` limits the total bytes.

        ``usual`` is the size in bytes of the object's type (None: unknown), for a server that sends up to 4 bytes without their
        number.
        """
        super().__init__(index, subindex, timeout)
        self.size: int | None = None  # as announced
        self._transfer_type = transfer_type
        self._buffer = bytearray()
        self._toggle = 0
        self._block_size = block_size
        self._has_checksum = False
        self._most = most
        self._usual = usual
        self._good = 0  # last segment of this sub-block that came in order
        self._seen = 0  # highest segment number that came
        self._confirmed = 0
        self._complete = False
        self._insisted = False

    @property
    def data(self) -> bytes:
        """The bytes received so far."""
        return bytes(self._buffer)

    @property
    def progress(self) -> tuple[int, int | None]:
        """Bytes received, and bytes announced (None: not announced)."""
        done = len(self._buffer)
        return (done if self.size is None else min(done, self.size)), self.size

    def _begin(self) -> Frames:
        return self._ask_block() if self._transfer_type is SdoTransferType.BLOCK else self._ask()

    # -- the normal transfer (7.2.4.3.5, 7.2.4.3.6) --------------------------------------------------------------------------------

    def _ask(self) -> Frames:
        self._on = self._initiated
        return (self._request(0x40),)

    def _initiated(self, frame: bytes) -> Frames | None:
        if frame[0] & 0xE0 != 0x40 or not self._is_ours(frame):
            return None
        expedited, sized = frame[0] & 0x02, frame[0] & 0x01
        end = 8 - (frame[0] >> 2 & 0x03 if sized and expedited else 0)
        if self._came < (end if expedited or sized else 4):
            return None
        if expedited:
            if not sized and self._usual is not None:  # the other bytes have no meaning (CiA 301 7.2.4.3.5)
                end = min(end, 4 + self._usual)
            self._buffer += frame[4:end]
            self.size = len(self._buffer)
            self._end()
            return ()
        self._announced(frame, bool(sized))
        if self._transfer_type is SdoTransferType.AUTO and (self.size or 0) >= BLOCK_FROM:
            return (self.abort(codes.GENERAL), *self._ask_block())
        self._on = self._segment
        return (self._request_segment(),)

    def _request_segment(self) -> bytes:
        return bytes([0x60 | self._toggle]) + bytes(7)

    def _segment(self, frame: bytes) -> Frames | None:
        end = 8 - (frame[0] >> 1 & 0x07)
        if frame[0] & 0xE0 != 0x00 or self._came < end:
            return None
        check_toggle(frame, self._toggle)
        self._toggle ^= 0x10
        self._buffer += frame[1:end]
        self._check_not_more(0)
        if not frame[0] & 0x01:
            self._count_futile(end - 1, "segment", "with no data")
            return (self._request_segment(),)
        self._check_size()
        self._end()
        return ()

    # -- the block transfer (7.2.4.3.12 to 7.2.4.3.15) -----------------------------------------------------------------------------

    def _ask_block(self) -> Frames:
        self._transfer_type = SdoTransferType.BLOCK
        self._on = self._block_initiated
        return (
            self._request(0xA4, bytes([self._block_size, 0])),
        )  # 0: the server shall not change to the normal transfer

    def _block_initiated(self, frame: bytes) -> Frames | None:
        if not self._is_ours(frame):
            return None
        if frame[0] & 0xE0 == 0x40:  # the server prefers the normal transfer
            self._transfer_type = SdoTransferType.NORMAL
            return self._initiated(frame)
        if frame[0] & 0xE1 != 0xC0 or (frame[0] & 0x02 and self._came < 8):
            return None
        self._has_checksum = bool(frame[0] & 0x04)
        self._announced(frame, bool(frame[0] & 0x02))
        self._on = self._block_segment
        return (b"\xa3" + bytes(7),)

    def _block_segment(self, frame: bytes) -> Frames | None:
        number, last = frame[0] & 0x7F, frame[0] & 0x80
        if not 1 <= number <= self._block_size or self._came < 8:
            return None
        again = number <= self._seen and number != self._good + 1
        if again and not last and number != self._block_size:
            return None  # no progress: the time-out keeps running
        self._seen = max(self._seen, number)
        if number == self._good + 1:
            self._good, self._complete, self._insisted = number, bool(last), False
            self._buffer += frame[1:8]
            self._check_not_more(SEGMENT - 1)
        return self._confirm() if last or number == self._block_size else ()

    def _confirm(self) -> Frames:
        self._count_futile(self._good)
        self._confirmed, self._good, self._seen = self._good, 0, 0
        if self._complete:
            self._on = self._block_ended
        return (self._confirmation(),)

    def _confirmation(self) -> bytes:
        return bytes([0xA2, self._confirmed, self._block_size]) + bytes(5)

    def _block_ended(self, frame: bytes) -> Frames | None:
        if frame[0] & 0xE3 != 0xC1 or (self._has_checksum and self._came < 3):
            return None
        self._trim(frame[0] >> 2 & 0x07, int.from_bytes(frame[1:3], "little"))
        self._check_size()
        self._end()
        return (b"\xa1" + bytes(7),)

    def _trim(self, unused: int, expected: int) -> None:
        """Remove the unused bytes of the last segment; ``size`` overrides ``unused`` if only ``size`` agrees with the checksum."""
        data = bytes(self._buffer[: len(self._buffer) - unused])
        if self._has_checksum and checksum(data) != expected:
            data = bytes(self._buffer[: self.size])
            if self.size is None or checksum(data) != expected:
                raise Garbled("the checksum does not match the data", codes.WRONG_CHECKSUM)
        self._buffer[:] = data

    # -- errors --------------------------------------------------------------------------------------------------------------------

    def _aborted(self, code: int) -> Frames:
        return self._without_block(code) if self._on == self._block_initiated else super()._aborted(code)

    def _silence(self) -> Frames:
        if self._on == self._block_initiated:
            return (self.abort(codes.TIMED_OUT), *self._without_block(codes.TIMED_OUT))
        if not self._insisted and self._may_insist():
            self._insisted = True
            return self._confirm() if self._on == self._block_segment else (self._confirmation(),)
        return super()._silence()

    def _may_insist(self) -> bool:
        """Whether the client may answer silence with the last confirmation (see the theory of operation)."""
        if self._on == self._block_ended:
            return True
        checked = self._has_checksum and self.size is not None
        return self._on == self._block_segment and self._good > 0 and checked

    def _without_block(self, code: int) -> Frames:
        """Start a normal transfer: the refused initiation changed nothing, and this shows the server's actual objection."""
        self.block_refused = code
        self._transfer_type = SdoTransferType.NORMAL
        return self._ask()

    def _announced(self, frame: bytes, sized: bool) -> None:
        self.size = int.from_bytes(frame[4:8], "little") if sized else None
        if self.size is not None and self.size > self._most:
            raise Garbled(
                f"{counted(self.size, 'byte', 'bytes')} announced, at most {self._most} are accepted",
                codes.OUT_OF_MEMORY,
            )

    def _check_not_more(self, padding: int) -> None:
        if len(self._buffer) > self._most + padding:
            raise Garbled(
                f"more than {counted(self._most, 'byte')} were received; no more are accepted",
                codes.OUT_OF_MEMORY,
            )
        if self.size is not None and len(self._buffer) > self.size + padding:
            raise Garbled(
                f"more than the {counted(self.size, 'byte')} came that were announced", codes.TOO_LONG
            )

    def _check_size(self) -> None:
        if self.size is not None and len(self._buffer) != self.size:
            raise Garbled(
                f"{counted(len(self._buffer), 'byte')} came, {self.size} were announced", codes.TOO_SHORT
            )
