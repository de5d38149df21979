"""Follow one SDO channel: the transfer of each frame, its effect, and the value when it is complete (CiA 301 7.2.4.3).

Theory of operation
-------------------
An SDO segment names neither its object nor whether it belongs to a block: that follows from the frames before.
``SdoChannelDecoder`` holds the one transfer that may run on a channel. It passes each frame to a handler, by the command specifier
and the phase of that transfer. It never raises: a frame that does not fit gets a ``problem``, with as much text as the frame itself
permits, and a transfer whose beginning was not recorded is reported as such.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from axisbus.trace.decoded import DecodedSdo
from axisbus.trace.transfer import (
    TracedTransfer,
    TransferPhase,
    TransferText,
    address,
    expedited,
    length,
    size,
    toggled,
    trim,
)
from axisbus.wording import counted

_ABORT = 0x80
_LAST = 0x80  # bit 7 of a block's segment
_SEGMENT = 7
_MOST = 1 << 24  # bytes, the most that are stored of one transfer
_UNKNOWN = "of a transfer whose beginning was not seen"


class SdoChannelDecoder:
    """One SDO channel (a request and a response COB-ID); holds state: the running transfer, and when the last request was sent."""

    def __init__(self) -> None:
        self._transfer: TracedTransfer | None = None
        self._seen = False
        self._waiting: float | None = None

    def feed(self, data: bytes, time: float, *, request: bool) -> TransferText:
        """Decode a frame of the client (``request``) or of the server; ``time`` in seconds."""
        waited = None if request or self._waiting is None else max(0.0, time - self._waiting)
        self._waiting = time if request else None
        said = self._short(data, request) or self._handler(data, request)(data, time)
        self._seen = True
        if self._transfer is not None and len(self._transfer.data) > _MOST:
            self._transfer = None
            said = replace(said, problem=f"more than {_MOST} bytes: it is not followed any further")
        if waited is None:
            return said
        sdo = said.sdo
        timed = DecodedSdo(sdo.step, sdo.write, sdo.done, sdo.total, sdo.abort, waited)
        return TransferText(
            timed, said.address, said.value, said.sized, said.settled, said.note, said.problem
        )

    def _handler(self, data: bytes, request: bool) -> Callable[[bytes, float], TransferText]:
        transfer, command = self._transfer, data[0]
        if command == _ABORT:
            return self._abort
        if transfer is not None and transfer.phase is TransferPhase.BLOCK and transfer.write is request:
            return self._block_segment
        table = _REQUESTS if request else _ANSWERS
        name = table.get(command >> 5)
        if name is None:
            return self._no_command
        handler: Callable[[bytes, float], TransferText] = getattr(self, name)
        return handler

    def _short(self, data: bytes, request: bool) -> TransferText | None:
        """Handle a frame with fewer than the eight bytes that CiA 301 requires."""
        if len(data) == 8:
            return None
        side = "request" if request else "answer"
        return TransferText(
            DecodedSdo(f"{side} of {counted(len(data), 'byte')}", False),
            problem="an SDO frame has 8 bytes (CiA 301 7.2.4.3)",
        )

    def _no_command(self, data: bytes, _: float) -> TransferText:
        step = f"command 0x{data[0]:02X}"
        return TransferText(
            DecodedSdo(step, False), problem=f"0x{data[0]:02X} is not an SDO command (CiA 301 7.2.4.3)"
        )

    # -- client requests ----------------------------------------------------------------------------------------------------------

    def _begin(self, data: bytes, time: float, write: bool) -> tuple[TracedTransfer, str]:
        """Begin a transfer; the note names the previous one if it got no answer."""
        before, note = self._transfer, ""
        if before is not None and before.phase is TransferPhase.ASKED:
            what = "write to" if before.write else "read of"
            note = f"the {what} {before.index:04X}h:{before.subindex:02X} {time - before.asked:.3f} s before got no answer"
        elif before is not None:
            note = f"the transfer of {before.index:04X}h:{before.subindex:02X} was left unfinished"
        index, subindex = address(data)
        self._transfer = TracedTransfer(index, subindex, write, time)
        return self._transfer, note

    def _write_request(self, data: bytes, time: float) -> TransferText:
        transfer, note = self._begin(data, time, True)
        value, sized = expedited(data)
        if value is not None:
            transfer.data += value
            return TransferText(DecodedSdo("write", True), address(data), value, sized, note=note)
        transfer.size = size(data, bool(data[0] & 1))
        return TransferText(DecodedSdo("write in segments", True, 0, transfer.size), address(data), note=note)

    def _read_request(self, data: bytes, time: float) -> TransferText:
        _, note = self._begin(data, time, False)
        return TransferText(DecodedSdo("read", False), address(data), note=note)

    def _write_segment(self, data: bytes, _: float) -> TransferText:
        transfer = self._expect(True, TransferPhase.SEGMENTS)
        if transfer is None:
            return self._lost("write segment", True)
        problem = toggled(transfer, data[0])
        transfer.data += data[1 : 8 - (data[0] >> 1 & 7)]
        transfer.last = bool(data[0] & 1)
        return self._progress(transfer, "write segment", problem, complete=transfer.last)

    def _read_segment_request(self, data: bytes, _: float) -> TransferText:
        transfer = self._expect(False, TransferPhase.SEGMENTS)
        if transfer is None:
            return self._lost("next segment asked for", False)
        return self._progress(transfer, "next segment asked for", toggled(transfer, data[0], turn=False))

    def _block_write_request(self, data: bytes, time: float) -> TransferText:
        if data[0] & 1:
            return self._block_write_end(data)
        transfer, note = self._begin(data, time, True)
        transfer.checked = bool(data[0] & 4)
        transfer.size = size(data, bool(data[0] & 2))
        return TransferText(DecodedSdo("write in blocks", True, 0, transfer.size), address(data), note=note)

    def _block_read_request(self, data: bytes, time: float) -> TransferText:
        if data[0] & 3 == 0:
            begun, note = self._begin(data, time, False)
            begun.checked = bool(data[0] & 4)
            return TransferText(DecodedSdo(f"read in blocks of {data[4]}", False), address(data), note=note)
        transfer = self._expect(False, TransferPhase.ASKED, TransferPhase.BLOCK, TransferPhase.BLOCK_END)
        step = _BLOCK_READ_STEPS[data[0] & 3]
        if transfer is None:
            return self._lost(step, False)
        if data[0] & 3 == 2:
            return self._acknowledged(transfer, data)
        if data[0] & 3 == 3:
            transfer.phase = TransferPhase.BLOCK
        else:
            self._transfer = None
        return self._progress(transfer, step)

    # -- server responses ---------------------------------------------------------------------------------------------------------

    def _write_answer(self, data: bytes, _: float) -> TransferText:
        transfer = self._transfer
        problem = self._mismatch(data, True)
        if transfer is None or problem:
            return TransferText(DecodedSdo("write answered", True), address(data), problem=problem)
        if transfer.size is None and transfer.data:  # expedited
            self._transfer = None
            return TransferText(
                DecodedSdo("written", True), address(data), bytes(transfer.data), settled=True
            )
        transfer.phase = TransferPhase.SEGMENTS
        return TransferText(DecodedSdo("write accepted", True, 0, transfer.size), address(data))

    def _write_segment_answer(self, data: bytes, _: float) -> TransferText:
        transfer = self._expect(True, TransferPhase.SEGMENTS)
        if transfer is None:
            return self._lost("segment confirmed", True)
        problem = toggled(transfer, data[0], turn=False, last=1)
        if not transfer.last:
            return self._progress(transfer, "segment confirmed", problem)
        self._transfer = None
        return self._whole(transfer, "written", problem)

    def _read_answer(self, data: bytes, _: float) -> TransferText:
        transfer = self._transfer
        problem = self._mismatch(data, False)
        value, sized = expedited(data)
        if value is not None:
            self._transfer = None if not problem else transfer
            return TransferText(
                DecodedSdo("read", False), address(data), value, sized, settled=not problem, problem=problem
            )
        announced = size(data, bool(data[0] & 1))
        if transfer is not None and not problem:
            transfer.phase, transfer.size = TransferPhase.SEGMENTS, announced
        return TransferText(
            DecodedSdo("read in segments", False, 0, announced), address(data), problem=problem
        )

    def _read_segment(self, data: bytes, _: float) -> TransferText:
        transfer = self._expect(False, TransferPhase.SEGMENTS)
        if transfer is None:
            return self._lost("segment", False)
        problem = toggled(transfer, data[0])
        transfer.data += data[1 : 8 - (data[0] >> 1 & 7)]
        if not data[0] & 1:
            return self._progress(transfer, "segment", problem)
        self._transfer = None
        return self._whole(transfer, "read", problem)

    def _block_write_answer(self, data: bytes, _: float) -> TransferText:
        step, transfer = data[0] & 3, self._transfer
        if step == 0:
            problem = self._mismatch(data, True)
            if transfer is not None and not problem:
                transfer.phase, transfer.checked = TransferPhase.BLOCK, transfer.checked and bool(data[0] & 4)
            return TransferText(
                DecodedSdo(f"write accepted, in blocks of {data[4]}", True), address(data), problem=problem
            )
        if transfer is None or not transfer.write:
            return self._lost("block acknowledged" if step == 2 else "block write confirmed", True)
        if step == 2:
            return self._acknowledged(transfer, data)
        self._transfer = None
        return self._whole(transfer, "written")

    def _block_read_answer(self, data: bytes, _: float) -> TransferText:
        transfer = self._transfer
        if data[0] & 1:
            return self._block_read_end(data)
        problem = self._mismatch(data, False)
        announced = size(data, bool(data[0] & 2))
        if transfer is not None and not problem:
            transfer.size, transfer.checked = announced, transfer.checked and bool(data[0] & 4)
        return TransferText(DecodedSdo("read in blocks", False, 0, announced), address(data), problem=problem)

    # -- blocks -------------------------------------------------------------------------------------------------------------------

    def _block_segment(self, data: bytes, _: float) -> TransferText:
        transfer = self._transfer
        assert transfer is not None  # its phase brought the frame here
        number, last = data[0] & 0x7F, bool(data[0] & _LAST)
        expected = len(transfer.block) + 1
        problem = f"segment {number} came where {expected} was due" if number != expected else ""
        if not problem:
            transfer.block[number] = bytes(data[1:8])
            transfer.last = last
        sdo = DecodedSdo(
            f"block segment {number}" + (", the last" if last else ""),
            transfer.write,
            len(transfer.data) + _SEGMENT * len(transfer.block),
            transfer.size,
        )
        return TransferText(sdo, (transfer.index, transfer.subindex), problem=problem)

    def _acknowledged(self, transfer: TracedTransfer, data: bytes) -> TransferText:
        """Keep the segments that the receiver has; the others are sent again in the next block."""
        count, sent = data[1], len(transfer.block)
        for number in range(1, min(count, sent) + 1):
            transfer.data += transfer.block[number]
        if transfer.last and count >= sent:
            transfer.phase = TransferPhase.BLOCK_END
        transfer.block.clear()
        step = f"block acknowledged up to segment {count}" + (
            f" of {sent}, the rest is asked for again" * (count < sent)
        )
        problem = f"only {counted(sent, 'segment was', 'segments were')} seen" if count > sent else ""
        return self._progress(transfer, step, problem)

    def _block_write_end(self, data: bytes) -> TransferText:
        transfer = self._expect(True, TransferPhase.BLOCK_END)
        if transfer is None:
            return self._lost("block write ended", True)
        problem = trim(transfer, data)
        return self._progress(transfer, "block write ended", problem, complete=True)

    def _block_read_end(self, data: bytes) -> TransferText:
        transfer = self._expect(False, TransferPhase.BLOCK_END)
        if transfer is None:
            return self._lost("block read ended", False)
        problem = trim(transfer, data)
        return self._whole(transfer, "read", problem)

    # -- both ---------------------------------------------------------------------------------------------------------------------

    def _abort(self, data: bytes, _: float) -> TransferText:
        entry, transfer = address(data), self._transfer
        self._transfer = None
        code = int.from_bytes(data[4:8], "little")
        write = transfer.write if transfer is not None else False
        problem = ""
        if transfer is not None and entry not in ((transfer.index, transfer.subindex), (0, 0)):
            problem = f"its object is not that of the transfer, {transfer.index:04X}h:{transfer.subindex:02X}"
        return TransferText(DecodedSdo("aborted", write, abort=code), entry, problem=problem)

    def _expect(self, write: bool, *phases: TransferPhase) -> TracedTransfer | None:
        transfer = self._transfer
        fits = transfer is not None and transfer.write is write and transfer.phase in phases
        return transfer if fits else None

    def _lost(self, step: str, write: bool) -> TransferText:
        problem = "no transfer is running that it could belong to" if self._seen else ""
        return TransferText(DecodedSdo(step if problem else f"{step} {_UNKNOWN}", write), problem=problem)

    def _mismatch(self, data: bytes, write: bool) -> str:
        """Return why an answer does not fit the request; empty if it does."""
        transfer, entry = self._transfer, address(data)
        if transfer is None:
            return "nothing was asked" if self._seen else ""
        if (transfer.index, transfer.subindex) != entry:
            return f"its object is not the requested one, {transfer.index:04X}h:{transfer.subindex:02X}"
        if transfer.write is not write:
            return f"a {'write' if transfer.write else 'read'} was asked for"
        return ""

    def _progress(
        self, transfer: TracedTransfer, step: str, problem: str = "", *, complete: bool = False
    ) -> TransferText:
        sdo = DecodedSdo(step, transfer.write, len(transfer.data), transfer.size)
        value = bytes(transfer.data) if complete else None
        return TransferText(
            sdo,
            (transfer.index, transfer.subindex),
            value,
            problem=problem or (length(transfer) if complete else ""),
        )

    def _whole(self, transfer: TracedTransfer, step: str, problem: str = "") -> TransferText:
        sdo = DecodedSdo(step, transfer.write, len(transfer.data), transfer.size)
        entry = (transfer.index, transfer.subindex)
        return TransferText(
            sdo, entry, bytes(transfer.data), settled=True, problem=problem or length(transfer)
        )


_BLOCK_READ_STEPS = {1: "block read confirmed", 2: "block acknowledged", 3: "blocks started"}
# Command specifiers, the upper three bits of the first byte (CiA 301 7.2.4.3).
_REQUESTS = {
    0: "_write_segment",
    1: "_write_request",
    2: "_read_request",
    3: "_read_segment_request",
    5: "_block_read_request",
    6: "_block_write_request",
}
_ANSWERS = {
    0: "_read_segment",
    1: "_write_segment_answer",
    2: "_read_answer",
    3: "_write_answer",
    5: "_block_write_answer",
    6: "_block_read_answer",
}
