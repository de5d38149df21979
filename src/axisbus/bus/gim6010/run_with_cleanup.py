"""Run a dialogue that moves a motor: whatever ends it, its own cleanup runs to its end before the program continues.

Theory of operation. Ctrl-C, SIGTERM and SIGHUP do not interrupt the dialogue. The signal handler calls ``interrupt``, the dialogue
starts its cleanup with the next step, and the function returns the signal. An exception in the callback for news (a closed pipe)
also calls ``interrupt``; it is raised again when the dialogue has ended. If even the cleanup cannot run, the dialogue's final
frames are sent.
"""

from __future__ import annotations

import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Protocol

from axisbus.bus.gim6010.request import RequestFrame, send
from axisbus.bus.gim6010.run import run
from axisbus.bus.link.channel import Channel
from axisbus.cia301.frame import CanFrame
from axisbus.errors import AxisbusError

Tell = Callable[[str], None]
_SIGNALS = {"SIGINT": "Ctrl-C", "SIGTERM": "SIGTERM", "SIGHUP": "SIGHUP"}  # not every system has all of them
_PARTINGS = 3


class Interruptible(Protocol):
    """A dialogue with a cleanup of its own, which takes a limited time."""

    news: deque[str]

    @property
    def done(self) -> bool:
        """As ``ModuleProcedure.done``."""

    @property
    def parting(self) -> Sequence[RequestFrame]:
        """Final frames that remove the power if the dialogue cannot continue."""

    def note(self, frame: CanFrame) -> None:
        """As ``ModuleProcedure.note``."""

    def trouble(self, words: str) -> None:
        """As ``ModuleProcedure.trouble``."""

    def step(self, now: float) -> RequestFrame | None:
        """As ``ModuleProcedure.step``."""

    def interrupt(self, why: str) -> None:
        """Make the dialogue start its cleanup."""


class _Told:
    """A dialogue whose news are passed to ``tell``."""

    def __init__(self, dialogue: Interruptible, tell: Tell) -> None:
        self._dialogue, self._tell = dialogue, tell
        self.note, self.trouble = dialogue.note, dialogue.trouble

    @property
    def done(self) -> bool:
        return self._dialogue.done and not self._dialogue.news

    def step(self, now: float) -> RequestFrame | None:
        request = None if self._dialogue.done else self._dialogue.step(now)
        if request is None and self._dialogue.news:
            self._tell(self._dialogue.news.popleft())
        return request


def run_guarded(channel: Channel, dialogue: Interruptible, tell: Tell) -> int:
    """Run a dialogue and its cleanup to the end in any case; blocks. Return the signal that interrupted it, 0 for none.

    Raises:
        AdapterError: the channel failed before anything was sent. Any exception of ``tell``, after the dialogue's cleanup.
    """
    with _signals(dialogue) as caught:
        try:
            run(channel, _Told(dialogue, tell))
        except BaseException as error:
            _leave(channel, dialogue, error)
            raise
    return caught[0] if caught else 0


def _leave(channel: Channel, dialogue: Interruptible, error: BaseException) -> None:
    dialogue.interrupt(f"this program aborted: {type(error).__name__}")
    try:
        with suppress(AxisbusError):  # the first error is reported
            run(channel, dialogue)
    finally:
        if not dialogue.done:
            for _ in range(_PARTINGS):
                for frame in dialogue.parting:
                    with suppress(AxisbusError):
                        send(channel, frame)


@contextmanager
def _signals(dialogue: Interruptible) -> Iterator[list[int]]:
    """Handle signals by ``interrupt``; only in the main thread, in which Python delivers them."""
    caught: list[int] = []
    before = {}

    def take(number: int, _: FrameType | None) -> None:
        caught.append(number)
        dialogue.interrupt(_SIGNALS[signal.Signals(number).name])

    if threading.current_thread() is threading.main_thread():
        for name in _SIGNALS:
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
                before[number] = signal.signal(number, take)
    try:
        yield caught
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
