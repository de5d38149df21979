"""A program's end of the connection: its requests and their answers, and other messages, each in its proper thread."""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from axisbus.bus.link.frame_queue import UnboundedQueue
from axisbus.clock import REAL
from axisbus.core.waiting import inherited
from axisbus.errors import ScanError, one_line
from axisbus.interrupt_guard import sheltered
from axisbus.ipc import messages as m
from axisbus.ipc.stream import MessageStream
from axisbus.ipc.values import NotSendable
from axisbus.link import alarm
from axisbus.motion.stop.diagnosis import join_remedies

log = logging.getLogger("axisbus")
_POLL_PERIOD = 0.01  # seconds
_SLICE = 0.1  # seconds; waiting in slices lets signal handlers run on every platform

_MAKE_SURE = "make sure that every axis is at standstill, then open the machine again"

Take = Callable[[Any], None]


class _PendingRequest:
    """A request without an answer yet; the reading thread adds its progress and its reply, and sets ``changed``."""

    def __init__(self) -> None:
        self.changed = threading.Event()
        self.progress = deque[Any]()
        self.reply: m.CoreReply | None = None


class RpcClient:
    """Holds the connection, the pending requests, and the function for each kind of message.

    The functions in ``immediate`` run in the reading thread at once, and must not block; those in ``deferred`` run in another
    thread, one after the other, which also runs the program's own callbacks. ``on_end`` is called once when the connection has
    ended.
    """

    def __init__(
        self,
        stream: MessageStream,
        immediate: Mapping[type, Take],
        deferred: Mapping[type, Take],
        on_end: Callable[[], None],
    ) -> None:
        self._stream = stream
        self._immediate: dict[type, Take] = {
            m.CoreReply: self._take_reply,
            m.CoreProgress: self._take_progress,
            m.Logged: _log,
            **immediate,
        }
        self._deferred = dict(deferred)
        self._on_end = on_end
        self._deferred_messages: UnboundedQueue[object] = UnboundedQueue(REAL)
        self._numbers = itertools.count(1)
        self._waiting: dict[int, _PendingRequest] = {}
        self.last: dict[tuple[int, str], Any] = {}  # answers of a core that has left
        self.has_left = False  # whether the core has left, and reported it
        self.rescued: m.Rescued | None = None  # by its watchdog process: the core has died
        self._over = False
        self._inherited = False
        # It runs the callbacks of the program.
        self.events = threading.Thread(target=self._dispatch, name="axisbus events", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._stream.watch_for_loss()
        threading.Thread(target=self._read, name="axisbus core's messages", daemon=True).start()
        self.events.start()

    @property
    def over(self) -> bool:
        """Whether the connection has ended."""
        return self._over

    @property
    def lost(self) -> bool:
        """Whether it has ended because this process has closed or replaced its descriptor."""
        return self._stream.lost

    def send(self, message: m.Message | bytes) -> None:
        """Send a message, which may be packed already; does not block. After the end of the connection it is dropped."""
        if not self._inherited:
            self._stream.send(message)

    def ask(
        self, what: str, node: int = 0, *arguments: Any, progress: Callable[[Any], None] = lambda _: None
    ) -> Any:
        """Send a request to the core, and return its answer; blocks meanwhile. After the core has left, its last answers are used.

        ``progress`` is called in this thread with each value that the core sends before the answer.

        Raises:
            AxisbusError: the error there; ScanError if the core is gone, StateError in a forked child.
        """
        if self._inherited:
            raise inherited(what)
        if (node, what) in self.last:
            return self.last[node, what]
        number, request = next(self._numbers), _PendingRequest()
        self._waiting[number] = request
        try:
            # packed here, so that a value that cannot be sent raises here
            self.send(m.CODEC.pack(m.CoreQuery(number, what, node, arguments)))
            ended = False
            while not ended:
                _await_change(request.changed)
                request.changed.clear()
                ended = (
                    request.reply is not None or self._over
                )  # looked at first: all progress came before it
                while request.progress:
                    progress(request.progress.popleft())
        finally:
            del self._waiting[number]
        reply = request.reply
        if reply is None:
            raise self.ended_error(f"{what} was asked")
        if reply.error is not None:
            raise reply.error
        return reply.value

    def ended_error(self, what: str) -> ScanError:
        """Return the error of an action that the end of the connection makes impossible."""
        if self.has_left:
            return ScanError(f"{what}: the machine was closed", remedy="open it again to continue")
        return _lost_error(what) if self._stream.lost else ended_error(what, self.rescued)

    def close(self, wait: float = 0.0) -> None:
        """End the connection, at most ``wait`` seconds later, after the queue has been sent."""
        self._stream.close(wait)

    def close_gracefully(self, wait: float) -> None:
        """Request nothing more, and let the far end close first; close the connection after at most ``wait`` seconds. Blocks."""
        self._stream.end_sending()
        until = time.monotonic() + wait
        while not self._over and time.monotonic() < until:
            time.sleep(_POLL_PERIOD)
        self._stream.close()

    def disown(self) -> None:
        """Release a forked child's copy."""
        self._inherited = self._over = True
        self._stream.disown()

    def _read(self) -> None:
        try:
            for data in self._stream.messages():
                self._take(m.CODEC.unpack(data))
        except NotSendable as error:
            log.error("the connection to the core was closed: %s", error)
        finally:
            self._over = True
            self._deferred_messages.put(None)
            for request in list(self._waiting.values()):
                request.changed.set()
            self._stream.finish()

    def _take(self, message: object) -> None:
        immediate = self._immediate.get(type(message))
        if immediate is not None:
            immediate(message)
        if type(message) in self._deferred:
            self._deferred_messages.put(message)

    def _dispatch(self) -> None:
        while (
            (message := self._deferred_messages.take(time.monotonic() + _SLICE)) is not None
            or not self._over
            or len(self._deferred_messages)
        ):
            if message is not None:
                self._call(self._deferred[type(message)], message)
        self._on_end()

    def _call(self, take: Take, message: object) -> None:
        try:
            take(message)
        # raised by the program's own callback, perhaps by sys.exit(): later messages must still be delivered
        except BaseException as error:
            log.error("while a callback of the program ran: %s", one_line(error), exc_info=error)

    def _take_reply(self, answer: m.CoreReply) -> None:
        request = self._waiting.get(answer.number)
        if request is not None:
            request.reply = answer
            request.changed.set()

    def _take_progress(self, message: m.CoreProgress) -> None:
        request = self._waiting.get(message.number)
        if request is not None:
            request.progress.append(message.value)
            request.changed.set()


@sheltered  # the answering thread uses its lock too
def _await_change(changed: threading.Event) -> None:
    changed.wait(_SLICE)


def _lost_error(what: str) -> ScanError:
    """Return the error of an action after this program has closed its own connection to the core."""
    return ScanError(
        f"{what}, and this program no longer has a connection to its core: the core stops the axes",
        observed="a descriptor of the connection was closed or replaced in this process, and not by axisbus",
        remedy="make sure that every axis is at standstill; do not close descriptors (os.closerange, os.dup2) while a "
        "machine is open: a program must become a daemon before it opens the machine",
    )


def ended_error(what: str, rescued: m.Rescued | None = None) -> ScanError:
    """Return the error of an action that is impossible now; ``rescued``: the report of the watchdog process."""
    if rescued is None:
        return ScanError(
            f"{what}, and the core of this machine has ended",
            observed="its process or its connection has ended; the state of the drives is not known",
            remedy=_MAKE_SURE,
        )
    if rescued.left:
        return ScanError(
            f"{what}, and the core of this machine has ended without a report: {rescued.why}",
            observed="it had left its nodes, but it is not known whether every axis could be stopped: its report was lost",
            remedy=_MAKE_SURE,
        )
    danger = alarm(rescued.stopped)
    return ScanError(
        f"{what}, and the core of this machine has ended: {rescued.why}",
        observed="\n            ".join(_lines_of(rescued)),
        remedy=join_remedies(danger, "then open the machine again" if danger else "open the machine again"),
    )


def unanswered(what: str, seconds: float) -> ScanError:
    """Return the error of an action that a core has not done in time, although its connection has not ended."""
    return ScanError(
        f"{what}, and the core of this machine has not answered for {seconds:.0f} s",
        observed="its process hangs or gets no processor time; the state of the drives is not known",
        remedy=_MAKE_SURE,
    )


def _lines_of(rescued: m.Rescued) -> list[str]:
    """Return the actions of its watchdog process, line by line."""
    texts = [f"{each.axis}: {each.text}" for each in rescued.stopped]
    stopped = (
        ["its watchdog process stopped the drives:", *texts] if texts else ["no axis had been commanded"]
    )
    safe = (
        [f"its watchdog process set outputs to their safe states: {', '.join(rescued.safe)}"]
        if rescued.safe
        else []
    )
    unsafe = [f"{each.output} NOT CONFIRMED as safe: {each.text}" for each in rescued.unsafe]
    return [*stopped, *safe, *unsafe]


def _log(line: m.Logged) -> None:
    logging.getLogger(line.name).log(line.level, "%s", line.text)
