"""Write an object as a pure state machine: expedited, segmented, or as a block transfer.

Theory of operation
-------------------
In a block transfer the client sends up to 127 segments unconfirmed (as many as the server grants each time). The server then
confirms the last segment that came in order, and the client continues after that segment. If the confirmation does not come, it is
unknown whether the server has received the sub-block. Sending it again could write it twice. The attempt is therefore given up, and
the caller starts again.
"""

from __future__ import annotations

from axisbus.cia301 import abort as codes
from axisbus.cia301.sdo import (
    LARGEST_BLOCK,
    SEGMENT,
    Frames,
    Garbled,
    SdoTransferAttempt,
    SdoTransferType,
    check_toggle,
    checksum,
)
from axisbus.wording import counted

_EXPEDITED = 4  # bytes that fit the initiating frame


class Download(SdoTransferAttempt):
    """One attempt at writing ``data``."""

    def __init__(
        self,
        index: int,
        subindex: int,
        data: bytes,
        timeout: float,
        transfer_type: SdoTransferType = SdoTransferType.NORMAL,
    ) -> None:
        """``SdoTransferType.AUTO`` is not supported here: the caller knows the size of the data and chooses the type."""
        super().__init__(index, subindex, timeout)
        self._data = data
        self._transfer_type = transfer_type
        self._position = 0  # bytes that the server has confirmed
        self._sent = 0  # segments of this sub-block, or bytes of this segment
        self._toggle = 0
        self._block_size = 0
        self._has_checksum = False

    @property
    def progress(self) -> tuple[int, int | None]:
        """Bytes that the server has confirmed, and bytes in total."""
        return min(self._position, len(self._data)), len(self._data)

    def _begin(self) -> Frames:
        return self._ask_block() if self._transfer_type is SdoTransferType.BLOCK else self._ask()

    # -- the normal transfer (7.2.4.3.3, 7.2.4.3.4) --------------------------------------------------------------------------------

    def _ask(self) -> Frames:
        size = len(self._data)
        if 0 < size <= _EXPEDITED:
            self._on = self._written
            return (self._request(0x23 | (_EXPEDITED - size) << 2, self._data),)
        self._on = self._initiated
        return (self._request(0x21, size.to_bytes(4, "little")),)

    def _written(self, frame: bytes) -> Frames | None:
        if frame[0] & 0xE0 != 0x60 or not self._is_ours(frame):
            return None
        self._position = len(self._data)
        self._end()
        return ()

    def _initiated(self, frame: bytes) -> Frames | None:
        if frame[0] & 0xE0 != 0x60 or not self._is_ours(frame):
            return None
        self._on = self._segment_taken
        return (self._segment(),)

    def _segment(self) -> bytes:
        part = self._data[self._position : self._position + SEGMENT]
        self._sent = len(part)
        command = self._toggle | (SEGMENT - len(part)) << 1 | self._is_last
        return bytes([command]) + part.ljust(SEGMENT, b"\0")

    @property
    def _is_last(self) -> bool:
        return self._position + self._sent >= len(self._data)

    def _segment_taken(self, frame: bytes) -> Frames | None:
        if frame[0] & 0xE0 != 0x20:
            return None
        check_toggle(frame, self._toggle)
        self._toggle ^= 0x10
        last = self._is_last
        self._position += self._sent
        if not last:
            return (self._segment(),)
        self._end()
        return ()

    # -- the block transfer (7.2.4.3.8 to 7.2.4.3.11) ------------------------------------------------------------------------------

    def _ask_block(self) -> Frames:
        self._on = self._block_granted
        return (self._request(0xC6, len(self._data).to_bytes(4, "little")),)

    def _block_granted(self, frame: bytes) -> Frames | None:
        if frame[0] & 0xE3 != 0xA0 or not self._is_ours(frame) or self._came < 5:
            return None
        self._has_checksum = bool(frame[0] & 0x04)
        self._on = self._block_confirmed
        return self._sub_block(frame[4])

    def _sub_block(self, granted: int) -> Frames:
        if not 1 <= granted <= LARGEST_BLOCK:
            raise Garbled(
                f"the server grants blocks of {counted(granted, 'segment')}", codes.WRONG_BLOCK_SIZE
            )
        end = len(self._data)
        starts = range(self._position, max(end, self._position + 1), SEGMENT)[:granted]
        self._sent = len(starts)
        return tuple(
            bytes([number | (0x80 if start + SEGMENT >= end else 0)])
            + self._data[start : start + SEGMENT].ljust(SEGMENT, b"\0")
            for number, start in enumerate(starts, start=1)
        )

    def _block_confirmed(self, frame: bytes) -> Frames | None:
        if frame[0] & 0xE3 != 0xA2 or self._came < 3:
            return None
        good = frame[1]
        if good > self._sent:
            raise Garbled(f"segment {good} was confirmed, {self._sent} were sent", codes.WRONG_SEQUENCE)
        self._count_futile(good)
        self._position += good * SEGMENT
        if good < self._sent or self._position < len(self._data):
            return self._sub_block(frame[2])
        self._on = self._block_written
        return (self._block_end(),)

    def _block_end(self) -> bytes:
        unused = (-len(self._data)) % SEGMENT if self._data else SEGMENT
        crc = checksum(self._data) if self._has_checksum else 0
        return bytes([0xC1 | unused << 2]) + crc.to_bytes(2, "little") + bytes(5)

    def _block_written(self, frame: bytes) -> Frames | None:
        if frame[0] & 0xE3 != 0xA1:
            return None
        self._end()
        return ()

    # -- errors --------------------------------------------------------------------------------------------------------------------

    def _aborted(self, code: int) -> Frames:
        return self._without_block(code) if self._on == self._block_granted else super()._aborted(code)

    def _silence(self) -> Frames:
        if self._on == self._block_granted:
            return (self.abort(codes.TIMED_OUT), *self._without_block(codes.TIMED_OUT))
        return super()._silence()

    def _without_block(self, code: int) -> Frames:
        """Start a normal transfer: the refused initiation changed nothing, and this shows the server's actual objection."""
        self.block_refused = code
        return self._ask()
