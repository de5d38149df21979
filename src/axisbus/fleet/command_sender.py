"""Send commands to cells, each with its handle, until the end of the command is known or cannot be known any more."""

from __future__ import annotations

import itertools
import threading
import time
import uuid
from collections import deque
from collections.abc import Mapping
from functools import partial

import msgspec

from axisbus.core.waiting import ThreadWaiter
from axisbus.errors import AxisbusError, StateError
from axisbus.fleet.command_retry import CommandEnd, CommandRetry, SendAgain
from axisbus.fleet.event_loop import EventLoopThread
from axisbus.fleet.keys import ZenohCellKeys
from axisbus.fleet.messages import TOO_LATE, CommandAnswer, CommandAsk, Value, read
from axisbus.fleet.subscriptions import FleetSubscriptions
from axisbus.fleet.zenoh_client import ZenohClient
from axisbus.machine.handle import Handle
from axisbus.motion.command_status import Status
from axisbus.session import CommandEvent

_TIMEOUT = 3.0  # seconds for an answer; a command that takes longer is answered "running"
_TIMEOUT_ONCE = 0.5  # the same for a command that must not arrive late
_PROMPT = 1.0  # seconds in which an overtaken command is sent again; later, its motion would be unexpected
_STOPS = 64  # the number of stops whose axes are remembered


class CommandSender:
    """Send commands to cells and hold the running ones. Any thread may use it."""

    def __init__(
        self, subscriptions: FleetSubscriptions, zenoh_client: ZenohClient, worker: EventLoopThread
    ) -> None:
        self.client = uuid.uuid4().hex
        self.waiter = ThreadWaiter()
        self.waiter.callback_thread = worker.thread  # a callback that waited there would wait for itself
        self._subscriptions, self._zenoh_client, self._worker = subscriptions, zenoh_client, worker
        self._ids = itertools.count(1)
        self._lock = threading.Lock()  # ids are sent in ascending order
        self._running: set[_Sent] = set()
        self._tokens: dict[str, str] = {}
        self._stops: dict[str, deque[tuple[int, tuple[str, ...]]]] = {}  # newest stops: ids and axes
        subscriptions.on_cell_lost = self._cell_lost

    def lease(self, cell: str, token: str | None) -> None:
        """Set the token for the commands to a cell; None: the cell has no token any more."""
        with self._lock:
            self._tokens.pop(cell, None)
            if token is not None:
                self._tokens[cell] = token

    def token(self, cell: str) -> str:
        """Return the token of a cell's lease, empty if there is none."""
        return self._tokens.get(cell, "")

    def leased(self, cell: str) -> bool:
        """Whether there is a token for a cell."""
        return cell in self._tokens

    def send(
        self,
        cell: str,
        verb: str,
        axes: tuple[str, ...],
        values: Mapping[str, Value],
        name: str,
        *,
        once: bool = False,
        stops: bool = False,
    ) -> Handle:
        """Send a command and return its handle; does not block. ``once``: it must not arrive late; ``stops``: it needs no lease."""
        handle = Handle(name, self.waiter)
        state = self._subscriptions.situation(cell, True)
        if not stops and not state.alive:
            self._end(handle, CommandEnd(Status.ERROR, _no_cell_error(name)))
            return handle
        retry = CommandRetry(name, state.now, state.run, once=once, needs_lease=not stops)
        with self._lock:
            request = CommandAsk(self.client, next(self._ids), self._tokens.get(cell, ""), axes, dict(values))
            sent = _Sent(
                cell, ZenohCellKeys(self._subscriptions.plant, cell).command(verb), request, retry, handle
            )
            self._running.add(sent)
            if stops:
                self._stops.setdefault(cell, deque(maxlen=_STOPS)).append((request.id, axes))
            self._query(sent)
        return handle

    def end(self) -> None:
        """Send no more queries: every running command ends with the result unknown."""
        for sent in list(self._running):
            self._continue(sent, sent.retry.closed())

    def _query(self, sent: _Sent) -> None:
        if sent.handle.busy:
            timeout = _TIMEOUT_ONCE if sent.retry.once else _TIMEOUT
            self._zenoh_client.begin(
                sent.key,
                msgspec.json.encode(sent.request),
                timeout,
                lambda answer: self._worker.call_soon(partial(self._on_answer, sent, answer)),
                to_all_peers=not sent.retry.needs_lease,
            )

    def _on_answer(self, sent: _Sent, payload: bytes | None) -> None:
        """Handle the end of a query, with or without an answer."""
        answer = read(payload, CommandAnswer)  # an invalid answer counts as missing
        if answer is None:
            self._continue(
                sent, sent.retry.unanswered(self._subscriptions.situation(sent.cell, self.leased(sent.cell)))
            )
            return
        if self._overtaken(sent, answer):
            self._resend(sent)
            return
        self._continue(sent, sent.retry.answered(answer, time.monotonic()))
        if sent.retry.active:
            sent.handle._on_event(CommandEvent(0, Status.ACTIVE, None, ""))

    def _overtaken(self, sent: _Sent, answer: CommandAnswer) -> bool:
        """Return whether a command was rejected only because a later stop of other axes, sent by this program, overtook it."""
        error = answer.error
        if error is None or TOO_LATE not in str(error.fields.get("message")) or sent.retry.once:
            return False
        later_stops = [axes for number, axes in self._stops.get(sent.cell, ()) if number > sent.request.id]
        prompt = time.monotonic() - sent.retry.started < _PROMPT
        return (
            prompt
            and bool(later_stops)
            and all(axes and not set(axes) & set(sent.request.axes) for axes in later_stops)
        )

    def _resend(self, sent: _Sent) -> None:
        with self._lock:
            token = self._tokens.get(sent.cell, "")
            sent.request = msgspec.structs.replace(sent.request, id=next(self._ids), token=token)
            self._query(sent)

    def _continue(self, sent: _Sent, what: SendAgain | CommandEnd) -> None:
        if isinstance(what, SendAgain):
            self._worker.call_later(what.delay, partial(self._query, sent))
            return
        self._running.discard(sent)
        self._end(sent.handle, what)

    def _end(self, handle: Handle, end: CommandEnd) -> None:
        handle._on_event(CommandEvent(0, end.status, end.error, end.note))
        self.waiter.notify()

    def _cell_lost(self, cell: str) -> None:
        """Handle the loss of a cell: end its commands without waiting for their time-outs."""
        state = self._subscriptions.situation(cell, self.leased(cell))
        for sent in list(self._running):
            if sent.cell == cell and not state.alive:
                self._continue(sent, sent.retry.unanswered(state))


class _Sent:
    """One running command: its request, its key, and its handle."""

    def __init__(self, cell: str, key: str, request: CommandAsk, retry: CommandRetry, handle: Handle) -> None:
        self.cell, self.key, self.request, self.retry, self.handle = cell, key, request, retry, handle


def _no_cell_error(name: str) -> AxisbusError:
    return StateError(
        f"{name}: the cell is not on the network; nothing was sent",
        remedy="check that its bridge runs and that this program reaches it (axisbus fleet list)",
    )
