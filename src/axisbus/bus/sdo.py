"""The SDO client of one node: reading and writing its objects by number or name, with values checked before anything is sent.

Theory of operation
-------------------
One lock per client: transfers of several threads queue up behind it. Each call makes up to ``tries`` whole transfers. After one
that got no answer an abort is sent, and before the next one a *barrier*: the mandatory object 1000h is read, and whatever comes
before its answer belongs to the past. A server answers in order, so the late answer to a request that was given up can never be
taken for the answer to a later one, not even to the same object.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator
from typing import NamedTuple

from axisbus.bus.channel import Channel, require_other_thread
from axisbus.bus.sdo_transfer import Call, Cancelled, Garbled, Line, NoAnswer, Refused, Transfer
from axisbus.bus.sdo_value import checked_bytes
from axisbus.cia301 import abort
from axisbus.cia301.datatypes import DataType, Value, decode, encode
from axisbus.cia301.objects import DEVICE_TYPE, ERROR_REGISTER
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, Interrupted, SdoAbort, SdoError, SdoTimeout

TIMEOUT = 0.5
TRIES = 3
URGENT_LOCK = 0.2  # seconds that an urgent write waits for the running transfer to give way
_URGENT_TURN = 0.01

# Aborts that say the dialogue broke, not that the server minds the request: worth another try.
_BROKEN_DIALOGUE = frozenset({0x0503_0000, 0x0504_0000, 0x0504_0001})


class _Request(NamedTuple):
    """What a call asks for: ``data`` None reads."""

    index: int  # type: ignore[assignment]  # hides tuple.index, which nobody wants here
    subindex: int
    data: bytes | None
    timeout: float
    tries: int


class SdoClient:
    """SDO transfers with one node; holds state: the lock, the calls that run or wait, and whether a late answer may be under way.

    May be used from any thread but the channel's receive thread. Every call blocks; a node that does not answer costs
    ``tries`` × ``timeout`` seconds.
    """

    def __init__(
        self,
        channel: Channel,
        node_id: int,
        eds: Eds | None = None,
        *,
        timeout: float = TIMEOUT,
        tries: int = TRIES,
    ) -> None:
        """``timeout`` is for one answer, in seconds; ``tries`` counts whole transfers."""
        self.node_id = node_id
        self.dictionary = Dictionary(eds, node_id)
        self.timeout = timeout
        self.tries = tries
        self._channel = channel
        self._line = Line(channel, node_id)
        self._lock = threading.Lock()
        self._calls: list[Call] = []
        self._late: tuple[int, int] | None = None  # the object of a request that may still be answered

    # -- bytes --------------------------------------------------------------------------------------------------------------------

    def upload(
        self,
        index: int,
        subindex: int = 0,
        *,
        timeout: float | None = None,
        tries: int | None = None,
        call: Call | None = None,
    ) -> bytes:
        """Read an object's bytes (CiA 301 7.2.4.3.5); blocks.

        ``timeout`` (seconds) and ``tries`` replace the client's own. ``call`` is a handle made before, by which to ``cancel`` it.

        Raises:
            SdoAbort: the server refused.
            SdoTimeout: no answer in ``tries`` attempts of ``timeout`` seconds each.
            SdoError: the dialogue broke in every attempt.
            Interrupted: another thread called ``cancel``.
            AdapterError: the channel failed.
            StateError: called in the receive thread.
        """
        request = _Request(index, subindex, None, timeout or self.timeout, tries or self.tries)
        return self._run(request, call)

    def download(
        self,
        index: int,
        subindex: int,
        data: bytes,
        *,
        timeout: float | None = None,
        tries: int | None = None,
        call: Call | None = None,
    ) -> None:
        """Write an object's bytes (CiA 301 7.2.4.3.3); blocks. An empty value goes in a segmented transfer.

        Raises:
            as ``upload``.
        """
        self._run(_Request(index, subindex, bytes(data), timeout or self.timeout, tries or self.tries), call)

    def download_urgent(self, index: int, subindex: int, data: bytes) -> None:
        """Write up to 4 bytes at once: a running transfer is aborted, and nothing is awaited before the frame is sent.

        Blocks for the answer as ``download`` does.

        Raises:
            as ``upload``.
        """
        require_other_thread(self._channel, "an SDO transfer")
        request = _Request(index, subindex, bytes(data), self.timeout, self.tries)
        locked = self._take_lock_from_others()
        try:
            with self._calling(Call(urgent=True)) as call:
                self._attempts(call, request)
        finally:
            if locked:
                self._lock.release()

    def cancel(self, call: Call | None = None) -> None:
        """End one transfer, or all that run or wait for their turn (urgent ones excepted); does not block.

        An abort is sent for the one that runs, and the callers get ``Interrupted``.
        """
        for one in tuple(self._calls) if call is None else (call,):
            if call is not None or not one.urgent:
                one.cancelled = True
        self._line.wake()

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
        """Read an object as the value that its data type says; blocks.

        ``key`` is an index or a text (see ``Dictionary.resolve``). The type is ``data_type``, else the dictionary's, else the
        standard's. Where none is known, up to 4 or exactly 8 bytes are read as an unsigned integer, and other lengths are
        returned as bytes.

        Raises:
            ArgumentError: no object of this name.
            others as ``upload``.
        """
        entry = self.dictionary.resolve(key, subindex)
        data = self.upload(entry.index, entry.subindex, call=call)
        known = data_type or entry.data_type
        if known is not None:
            return decode(data, known)
        return int.from_bytes(data, "little") if len(data) in (1, 2, 3, 4, 8) else data

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
        """Write an integer as its data type says, without asking the EDS for limits, which are often wrong; blocks.

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

    # -- the way of a call --------------------------------------------------------------------------------------------------------

    def _run(self, request: _Request, call: Call | None) -> bytes:
        require_other_thread(self._channel, "an SDO transfer")
        with self._calling(call or Call()) as known, self._lock:
            return self._attempts(known, request)

    @contextlib.contextmanager
    def _calling(self, call: Call) -> Iterator[Call]:
        self._calls.append(call)
        try:
            yield call
        finally:
            self._calls.remove(call)

    def _take_lock_from_others(self) -> bool:
        deadline = time.monotonic() + URGENT_LOCK
        while time.monotonic() < deadline:
            self.cancel()
            if self._lock.acquire(timeout=_URGENT_TURN):
                return True
        return False  # the frame matters more than the order of answers

    def _attempts(self, call: Call, request: _Request) -> bytes:
        strays: list[bytes] = []
        broken = ""
        for attempt in range(request.tries):
            try:
                if attempt or not call.urgent:
                    self._barrier(call, request.timeout)
                return self._attempt(call, request, strays)
            except NoAnswer:
                broken = ""
            except Garbled as error:
                broken = str(error)
            except Cancelled:
                raise self._cancelled(request) from None
            except Refused as error:
                broken = f"the node aborted with {abort.describe(error.code)}"
                if error.code not in _BROKEN_DIALOGUE:
                    raise self._refused(request, error.code) from None
        raise self._failed(request, broken, strays)

    def _attempt(self, call: Call, request: _Request, strays: list[bytes]) -> bytes:
        self._line.empty()
        index, subindex, data, timeout, _ = request
        transfer = Transfer(self._line, call, index, subindex, timeout)
        try:
            if data is None:
                return transfer.upload(index, subindex)
            transfer.download(index, subindex, data)
            return b""
        except (NoAnswer, Cancelled, Garbled) as error:
            if transfer.give_up(abort.TIMED_OUT if isinstance(error, NoAnswer) else abort.GENERAL):
                self._late = (index, subindex)
            raise
        finally:
            strays.extend(transfer.strays)

    def _barrier(self, call: Call, timeout: float) -> None:
        """Let pass what may still come for a request that was given up (see the theory of operation)."""
        if self._late is None:
            return
        index = ERROR_REGISTER if self._late == (DEVICE_TYPE, 0) else DEVICE_TYPE
        with contextlib.suppress(Refused, Garbled):  # an answer, and that is all it is asked for
            Transfer(self._line, call, index, 0, timeout).upload(index, 0)
        self._late = None

    # -- errors -------------------------------------------------------------------------------------------------------------------

    def _doing(self, request: _Request) -> str:
        index, subindex, data, *_ = request
        what = f"node {self.node_id}: {'reading' if data is None else 'writing'} {self.dictionary.entry(index, subindex)}"
        if data is None:
            return what
        return f"{what} = {data.hex(' ')}" if len(data) <= 8 else f"{what} = {len(data)} bytes"

    def _refused(self, request: _Request, code: int) -> SdoAbort:
        return SdoAbort(
            f"{self._doing(request)} was refused",
            node=self.node_id,
            index=request.index,
            subindex=request.subindex,
            code=code,
            observed=f"abort code {abort.describe(code)}",
            remedy=abort.explain(code).hint,
        )

    def _failed(self, request: _Request, broken: str, strays: list[bytes]) -> SdoError:
        doing = self._doing(request)
        if broken:
            return SdoError(
                f"{doing} failed in {request.tries} attempts",
                node=self.node_id,
                index=request.index,
                subindex=request.subindex,
                observed=broken,
                remedy="check that no other program talks SDO with this node",
            )
        return SdoTimeout(
            f"{doing} got no answer in {request.tries} attempts of {request.timeout:g} s",
            node=self.node_id,
            index=request.index,
            subindex=request.subindex,
            observed=_what_came(strays, self._channel.health()),
            remedy="check the node's power, node ID and bitrate, the wiring, and that it is not in NMT stopped",
        )

    def _cancelled(self, request: _Request) -> Interrupted:
        return Interrupted(
            f"{self._doing(request)} was cut short", observed="something more urgent took over"
        )


def _what_came(strays: list[bytes], health: str) -> str:
    if strays:
        return f"{len(strays)} frames that answer something else, the last: {strays[-1].hex(' ')}"
    return health or "no frame from its SDO server"
