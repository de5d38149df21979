"""SDO client of one node: read and write its objects by number or name, with values checked before anything is sent.

Theory of operation
-------------------
There is one lock per client; transfers of several threads wait for it. Each call is one ``SdoSession``, which makes up to ``tries``
attempts. A late answer is never taken for the answer to another request (see ``axisbus.cia301.sdo_session``). Between two calls the
client remembers the object that may still be answered, and whether the server has shown that it does not support block transfers.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from axisbus.bus.link.channel import Channel, require_other_thread
from axisbus.bus.sdo.access import decoded
from axisbus.bus.sdo.transfer import Call, Cancelled, Progress, RoundTrips, SdoConnection, carry_out
from axisbus.bus.sdo.value import checked_bytes
from axisbus.cia301 import abort
from axisbus.cia301.datatypes import DataType, Value, encode, size_in_bytes
from axisbus.cia301.sdo import LONGEST, Garbled, SdoAborted, SdoTransferType
from axisbus.cia301.sdo_counts import SdoOutcome, end_of
from axisbus.cia301.sdo_session import BROKEN_DIALOGUE, SdoSession, SdoTransferRequest
from axisbus.clock import FairLock
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, Interrupted, SdoAbort, SdoError, SdoTimeout
from axisbus.wording import counted

TIMEOUT = 0.5
TRIES = 3
# A server that was silent for so many objects is expected to be silent for all that the EDS lacks.
_SILENCES = 3
_TRIES_IF_SILENT = 2
BUSY_PAUSE = 0.05  # seconds until a request is repeated that the node has refused because it is busy
URGENT_LOCK = 0.2  # seconds that an urgent write waits for the running transfer to end
_URGENT_TURN = 0.01
_NUMBER, _TEXT = 256, 1 << 16  # bytes that are accepted for an object of such a type
_TEXTS = (DataType.VISIBLE_STRING, DataType.UNICODE_STRING)


def _most(data_type: DataType | None) -> int:
    """Return how many bytes to accept for an object: a device may send more than its type has, but not without end."""
    if data_type is not None and data_type.bits is not None:
        return _NUMBER
    return _TEXT if data_type in _TEXTS else LONGEST


class SdoClient:
    """SDO transfers with one node; holds state: the lock, the running and waiting calls, and whether a late answer may still come.

    May be used from any thread but the channel's receive thread. Every call blocks; a node that does not answer costs ``tries`` ×
    ``timeout`` seconds.
    """

    def __init__(
        self,
        channel: Channel,
        node_id: int,
        eds: Eds | None = None,
        *,
        timeout: float = TIMEOUT,
        tries: int = TRIES,
        cob_ids: tuple[int, int] | None = None,
    ) -> None:
        """``timeout`` is for one answer, in seconds; ``tries`` is the maximum number of attempts.

        ``cob_ids`` are client to server and server to client, for an additional SDO channel of the node; None: the predefined ones.
        """
        self.node_id = node_id
        self.dictionary = Dictionary(eds, node_id)
        self.timeout = timeout
        self.tries = tries
        self.clock = channel.clock
        self._channel = channel
        self._line = SdoConnection(channel, node_id, *(cob_ids or (None, None)))
        self._lock = FairLock(self.clock)  # the worker polls again at once after each answer
        self._calls: list[Call] = []
        self._late: tuple[tuple[int, int], ...] = ()  # objects of requests that may still be answered
        self._no_block = False  # whether the server has shown that it does not support block transfers
        self._busy_time = 0.0  # seconds of ``repeating_busy``; 0: no request is repeated
        self._busy_left = 0.0  # seconds of them that are left
        self._silences = 0  # objects for which the server was silent while it answered for others

    # -- bytes --------------------------------------------------------------------------------------------------------------------

    def upload(
        self,
        index: int,
        subindex: int = 0,
        *,
        timeout: float | None = None,
        tries: int | None = None,
        call: Call | None = None,
        transfer_type: SdoTransferType = SdoTransferType.AUTO,
        progress: Progress | None = None,
        most: int | None = None,
    ) -> bytes:
        """Read an object's bytes (CiA 301 7.2.4.3.5, in blocks 7.2.4.3.12); blocks.

        ``timeout`` (seconds) and ``tries`` replace those of the client. ``call`` is a handle made before, for ``cancel``. With
        ``transfer_type`` AUTO the client changes to a block transfer if the server announces 256 bytes or more. ``progress(done,
        all)`` is called in this thread with the bytes received and the bytes announced (None: not announced); it starts again with
        each attempt. ``most`` limits the bytes accepted from the server; None: 256 for a number, 64 KiB for a text, else 16 MiB.

        Raises:
            SdoAbort: the server refused.
            SdoTimeout: no answer in ``tries`` attempts of ``timeout`` seconds each.
            SdoError: the dialogue broke in every attempt.
            Interrupted: another thread called ``cancel``.
            AdapterError: the channel failed.
            StateError: called in the receive thread.
        """
        data_type = self.dictionary.entry(index, subindex).data_type
        if most is None:
            most = _most(data_type)
        usual = None if data_type is None else size_in_bytes(data_type)
        tries = tries or self._tries_to_read(index, subindex)
        request = SdoTransferRequest(
            index, subindex, None, timeout or self.timeout, tries, transfer_type, most, usual
        )
        return self._run(request, call, progress)

    def download(
        self,
        index: int,
        subindex: int,
        data: bytes,
        *,
        timeout: float | None = None,
        tries: int | None = None,
        call: Call | None = None,
        transfer_type: SdoTransferType = SdoTransferType.AUTO,
        progress: Progress | None = None,
    ) -> None:
        """Write an object's bytes (CiA 301 7.2.4.3.3, in blocks 7.2.4.3.8); blocks. An empty value uses a segmented transfer.

        With ``transfer_type`` AUTO the client uses a block transfer for 256 bytes and more. ``progress(done, all)`` counts the
        bytes that the server has confirmed.

        Raises:
            as ``upload``.
        """
        request = SdoTransferRequest(
            index, subindex, bytes(data), timeout or self.timeout, tries or self.tries, transfer_type
        )
        self._run(request, call, progress)

    def download_urgent(self, index: int, subindex: int, data: bytes) -> None:
        """Write up to 4 bytes at once: abort a running transfer, and send the frame without waiting for an answer before.

        Blocks for the answer as ``download`` does.

        Raises:
            as ``upload``.
        """
        require_other_thread(self._channel, "an SDO transfer")
        request = SdoTransferRequest(index, subindex, bytes(data), self.timeout, self.tries)
        locked = self._take_lock_from_others()
        try:
            with self._calling(Call(urgent=True)) as call:
                self._attempts(call, request)
        finally:
            if locked:
                self._lock.release()

    def cancel(self, call: Call | None = None) -> None:
        """End one transfer, or all running and waiting ones (except urgent ones); does not block.

        The running transfer is aborted, and the callers get ``Interrupted``.
        """
        for one in tuple(self._calls) if call is None else (call,):
            if call is not None or not one.urgent:
                one.cancelled = True
        self._line.wake()

    @contextlib.contextmanager
    def repeating_busy(self, seconds: float) -> Iterator[None]:
        """Inside the ``with`` block, repeat requests that the node refuses because it is busy (``abort.BUSY``).

        ``seconds`` is the waiting time for all requests of the block together. Then such a refusal is an ``SdoAbort`` at once.
        Urgent writes are never repeated.
        """
        self._busy_time = self._busy_left = seconds
        try:
            yield
        finally:
            self._busy_time = self._busy_left = 0.0

    @property
    def trips(self) -> RoundTrips:
        """The response times of the node."""
        return self._line.trips

    def close(self) -> None:
        """End a running transfer and stop listening; harmless when repeated."""
        self.cancel()
        self._line.close()

    # -- values -------------------------------------------------------------------------------------------------------------------

    def read(
        self,
        key: int | str,
        subindex: int = 0,
        *,
        data_type: DataType | None = None,
        call: Call | None = None,
    ) -> Value:
        """Read an object as a value of its data type; blocks.

        ``key`` is an index or a text (see ``Dictionary.resolve``). The type is ``data_type``, else the dictionary's, else the
        standard's. If none is known, up to 4 or exactly 8 bytes are read as an unsigned integer, and other lengths are returned as
        bytes.

        Raises:
            ArgumentError: no object of this name.
            others as ``upload``.
        """
        entry = self.dictionary.resolve(key, subindex)
        known = data_type or entry.data_type
        data = self.upload(entry.index, entry.subindex, call=call, most=_most(known))
        return decoded(data, known)

    def write(
        self, key: int | str, subindex: int, value: Value, *, data_type: DataType | None = None
    ) -> None:
        """Write a value to an object, checked against its type and the EDS's limits before anything is sent; blocks.

        Raises:
            ArgumentError: no such name, a value of the wrong kind, or the type is not known.
            LimitError: beyond the type's range, LowLimit or HighLimit.
            others as ``upload``.
        """
        entry = self.dictionary.resolve(key, subindex)
        self.download(entry.index, entry.subindex, checked_bytes(entry, value, data_type))

    def write_unchecked(self, key: int | str, subindex: int, value: int) -> None:
        """Write an integer in its data type without checking the EDS's limits, which are often wrong; blocks.

        Raises:
            ArgumentError: no such name, or the type is not known.
            LimitError: beyond the type's range.
            others as ``upload``.
        """
        entry = self.dictionary.resolve(key, subindex)
        if entry.data_type is None:
            raise ArgumentError(f"the data type of {self.describe(entry.index, entry.subindex)} is not known")
        self.download(entry.index, entry.subindex, encode(value, entry.data_type, str(entry)))

    def describe(self, index: int, subindex: int = 0) -> str:
        """Return the object for a message, such as ``node 5, 6081h:00 (Profile velocity)``."""
        return f"node {self.node_id}, {self.dictionary.entry(index, subindex)}"

    # -- calls --------------------------------------------------------------------------------------------------------------------

    def _run(self, request: SdoTransferRequest, call: Call | None, progress: Progress | None) -> bytes:
        require_other_thread(self._channel, "an SDO transfer")
        with self._calling(call or Call()) as known:
            while True:
                try:
                    with self._lock:
                        return self._attempts(known, request, progress)
                except SdoAbort as error:
                    if error.code not in abort.BUSY or not self._busy_time:
                        raise
                    if self._busy_left <= 0.0:
                        error.observed += (
                            f"; requests refused with such a code were repeated for {self._busy_time:g} s"
                        )
                        raise
                self._busy_left -= BUSY_PAUSE
                self.clock.sleep(BUSY_PAUSE)

    @contextlib.contextmanager
    def _calling(self, call: Call) -> Iterator[Call]:
        self._calls.append(call)
        try:
            yield call
        finally:
            self._calls.remove(call)

    def _take_lock_from_others(self) -> bool:
        deadline = self.clock.now() + URGENT_LOCK
        while self.clock.now() < deadline:
            self.cancel()
            if self._lock.acquire(timeout=_URGENT_TURN):
                return True
        return False  # sending the frame is more important than the order of answers

    def _attempts(self, call: Call, request: SdoTransferRequest, progress: Progress | None = None) -> bytes:
        session = SdoSession(request, late=self._late, no_block=self._no_block, urgent=call.urgent)
        end = SdoOutcome.CUT_SHORT
        try:
            carry_out(self._line, call, session, progress)
            end = end_of(session.failure)
        except Cancelled:
            raise cancelled(self.node_id, self._entry(request), request) from None
        finally:
            self._late, self._no_block = session.late, session.no_block
            self._channel.sdo_counts.note(self.node_id, end, session.retries)
        if session.failure is not None:
            entry, health = self._entry(request), self._channel.health()
            error = failed(self.node_id, entry, request, session, health)
            self._silences += isinstance(error, SdoTimeout) and error.for_this_only
            raise error
        return session.data

    def _tries_to_read(self, index: int, subindex: int) -> int:
        """Return the attempts for an object: fewer, if the EDS lacks it and the server is silent for such objects."""
        silent = self._silences >= _SILENCES and self.dictionary.has(index, subindex) is False
        return min(self.tries, _TRIES_IF_SILENT) if silent else self.tries

    def _entry(self, request: SdoTransferRequest) -> DictionaryEntry:
        return self.dictionary.entry(request.index, request.subindex)


# -- Errors of a failed SDO request as text: the request, the received frames, and the remedy --------------------------


_SHOWN = 8  # bytes of a value in a message


def failed(
    node_id: int, entry: DictionaryEntry, request: SdoTransferRequest, session: SdoSession, health: str
) -> SdoError:
    """Return the error for a session that failed; ``health`` describes the state of the bus in one line."""
    doing, failure = _doing(node_id, entry, request), session.failure
    if isinstance(failure, SdoAborted):
        if failure.code not in BROKEN_DIALOGUE:
            return _refused(node_id, doing, request, failure.code)
        return _broken(node_id, doing, request, f"the node aborted with {abort.describe(failure.code)}")
    if isinstance(failure, Garbled):
        return _broken(node_id, doing, request, str(failure))
    silent = SdoTimeout(
        f"{doing} got no answer in {counted(request.tries, 'attempt')} of {request.timeout:g} s",
        node=node_id,
        index=request.index,
        subindex=request.subindex,
        observed=_what_came(request, session, health),
        remedy=_remedy(request, session),
    )
    silent.for_this_only = session.answers_others and not _late(request, session)
    return silent


def cancelled(node_id: int, entry: DictionaryEntry, request: SdoTransferRequest) -> Interrupted:
    """Return the error for a transfer that another thread ended."""
    return Interrupted(
        f"{_doing(node_id, entry, request)} was cut short", observed="a more urgent transfer replaced it"
    )


def _doing(node_id: int, entry: DictionaryEntry, request: SdoTransferRequest) -> str:
    data = request.data
    if data is None:
        return f"node {node_id}: reading {entry}"
    value = data.hex(" ") if len(data) <= _SHOWN else counted(len(data), "byte")
    return f"node {node_id}: writing {entry} = {value}"


def _refused(node_id: int, doing: str, request: SdoTransferRequest, code: int) -> SdoAbort:
    return SdoAbort(
        f"{doing} was refused",
        node=node_id,
        index=request.index,
        subindex=request.subindex,
        code=code,
        observed=f"abort code {abort.describe(code)}",
        remedy=abort.explain(code).hint,
    )


def _broken(node_id: int, doing: str, request: SdoTransferRequest, observed: str) -> SdoError:
    return SdoError(
        f"{doing} failed in {counted(request.tries, 'attempt')}",
        node=node_id,
        index=request.index,
        subindex=request.subindex,
        observed=observed,
        remedy="check that no other program sends SDO requests to this node",
    )


def _late(request: SdoTransferRequest, session: SdoSession) -> list[bytes]:
    """Return the answers for the object that came after the attempt had ended."""
    asked = request.index.to_bytes(2, "little") + bytes([request.subindex])
    return [frame for frame in session.strays if frame[1:4] == asked]


def _what_came(request: SdoTransferRequest, session: SdoSession, health: str) -> str:
    late, strays = _late(request, session), session.strays
    if late:
        return f"{counted(len(late), 'answer')} for this object came after {request.timeout:g} s, the last: {late[-1].hex(' ')}"
    if strays:
        return f"{counted(len(strays), 'frame')} that answer another request, the last: {strays[-1].hex(' ')}"
    if session.answers_others:
        return "it answered for another object meanwhile, but not for this one"
    return health or "no frame from its SDO server"


def _remedy(request: SdoTransferRequest, session: SdoSession) -> str:
    if _late(request, session):
        return "the device is slow: try again when it is idle, and check the bus load (axisbus monitor)"
    if session.answers_others:
        return (
            "the node has power and is wired, but does not answer for this object; check in its manual whether it has "
            "the object"
        )
    return "check the node's power, node ID and bitrate, the wiring, and that it is not in NMT stopped"
