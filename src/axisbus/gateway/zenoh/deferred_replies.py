"""Answer commands when they end, in one thread, so that no thread of the network waits for a machine."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import NamedTuple

from axisbus.fleet.messages import CommandAnswer
from axisbus.gateway.zenoh.execute import RUNNING, CommandExecutor

log = logging.getLogger("axisbus")
PATIENCE = 2.0  # seconds after which a command that still runs is answered "running"
_MOST = 256  # the most waiting answers; further commands are answered "running" at once
_SLICE = 1.0  # seconds, the longest sleep of the thread
Reply = Callable[[CommandAnswer], None]


class _Waiting(NamedTuple):
    doing: CommandExecutor
    reply: Reply
    until: float


class DeferredReplies:
    """Hold the waiting answers; ``put`` is for any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: list[_Waiting] = []
        self._news = threading.Event()
        self._over = False
        self._thread = threading.Thread(target=self._run, name="answers", daemon=True)
        self._thread.start()

    def put(self, doing: CommandExecutor, reply: Reply) -> None:
        """Call ``reply`` when a command has ended, or after ``PATIENCE`` seconds; does not block."""
        with self._lock:
            full = len(self._waiting) >= _MOST
            until = 0.0 if full else time.monotonic() + PATIENCE
            self._waiting.append(_Waiting(doing, reply, until))
        for handle in doing.handles:
            if handle.busy:
                handle.add_done_callback(self._news.set)
        self._news.set()

    def close(self) -> None:
        """Answer the waiting commands, and end; blocks briefly."""
        self._over = True
        self._news.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over:
            self._news.wait(self._next())
            self._news.clear()
            self._look()
        self._look()

    def _next(self) -> float:
        with self._lock:
            due = min((each.until for each in self._waiting), default=None)
        return _SLICE if due is None else min(_SLICE, max(0.0, due - time.monotonic()))

    def _look(self) -> None:
        now = time.monotonic()
        with self._lock:
            ready = [each for each in self._waiting if self._over or not each.doing.busy or each.until <= now]
            self._waiting = [each for each in self._waiting if each not in ready]
        for each in ready:
            try:
                each.reply(each.doing.answer if not each.doing.busy else RUNNING)
            except Exception as error:  # noqa: BLE001  # the client is gone
                log.debug("an answer could not be sent: %s", error)
