"""SDO transfers of a direct port: one at a time, served as virtual time passes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from axisbus.cia402.port import SdoReply, SdoRequest
from axisbus.errors import SdoAbort
from axisbus.sim.device import Device

TIMED_OUT = 0x0504_0000
_PROFILE_AREA = range(0x6000, 0x6800)


def shifted(index: int, offset: int) -> int:
    """Return a profile object's index for the axis at ``offset`` (800h each); others are the node's and stay."""
    return index + offset if index in _PROFILE_AREA else index


class _Transfer(NamedTuple):
    id: int | None  # None: the port's own, without a reply
    target: int
    subindex: int
    value: int | None
    asked: float


class SdoQueue:
    """Requests in the order of receipt, the running one, and the replies not yet taken."""

    def __init__(self, device: Device, offset: int, time: float, timeout: float) -> None:
        """``time`` is how long a transfer takes, ``timeout`` how long is waited for an answer, in s."""
        self._device = device
        self._offset = offset
        self._time = time
        self._timeout = timeout
        self._queue: deque[_Transfer] = deque()
        self._free_at = 0.0
        self._late: list[tuple[float, _Transfer]] = []
        self._replies: list[SdoReply] = []

    def add(self, requests: Iterable[SdoRequest], now: float) -> None:
        """Queue a request of motion."""
        for id_, index, subindex, value in requests:
            self._queue.append(_Transfer(id_, shifted(index, self._offset), subindex, value, now))

    def add_write(self, index: int, value: int, now: float, *, urgent: bool) -> None:
        """Queue a write of the port's own; an urgent one goes first."""
        transfer = _Transfer(None, shifted(index, self._offset), 0, value, now)
        if urgent:
            self._queue.appendleft(transfer)
        else:
            self._queue.append(transfer)

    def refuse(self, requests: Iterable[SdoRequest]) -> None:
        """Answer at once with a time-out."""
        self._replies.extend(SdoReply(request.id, None, TIMED_OUT) for request in requests)

    def cancel(self, ids: Iterable[int]) -> None:
        """Forget requests that are no longer wanted; they get no reply."""
        unwanted = set(ids)
        self._queue = deque(transfer for transfer in self._queue if transfer.id not in unwanted)

    def take_replies(self) -> tuple[SdoReply, ...]:
        """Return the replies since the last call."""
        if not self._replies:
            return ()
        replies, self._replies = tuple(self._replies), []
        return replies

    def serve(self, now: float) -> None:
        """Serve the requests that are due at ``now``."""
        if self._late:
            self._finish_late(now)
        while self._queue:
            transfer = self._queue[0]
            answer = self._time + self._device.dials.sdo_delay
            silent = not self._device.answers_sdo or answer > self._timeout
            begin = max(transfer.asked, self._free_at)
            due = begin + (self._timeout if silent else answer)
            if due > now + 1e-9:
                return
            self._queue.popleft()
            self._free_at = due
            if not silent:
                self._reply(transfer, *self._carry_out(transfer))
                continue
            self._reply(transfer, None, TIMED_OUT)
            if self._device.answers_sdo:
                self._late.append((begin + answer, transfer))

    def _finish_late(self, now: float) -> None:
        """A request whose answer came after we had given up was carried out all the same."""
        due = [transfer for time, transfer in self._late if time <= now]
        self._late = [(time, transfer) for time, transfer in self._late if time > now]
        for transfer in due:
            self._carry_out(transfer)

    def _carry_out(self, transfer: _Transfer) -> tuple[int | None, int | None]:
        """Return value and abort code."""
        try:
            if transfer.value is None:
                return self._device.read(transfer.target, transfer.subindex), None
            self._device.write(transfer.target, transfer.subindex, transfer.value)
        except SdoAbort as refused:
            return None, refused.code
        return None, None

    def _reply(self, transfer: _Transfer, value: int | None, abort: int | None) -> None:
        if transfer.id is not None:
            self._replies.append(SdoReply(transfer.id, value, abort))
