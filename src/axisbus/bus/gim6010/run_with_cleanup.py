"""A dialogue that moves something: whatever ends it, its own way out runs to its end before the program goes on.

Theory of operation. Ctrl-C, SIGTERM and SIGHUP do not tear it apart: they are told to it as a wish, which it heeds with its next
step, and which of them it was is returned. An exception out of what hears its news (a closed pipe) becomes a wish too, and is
raised again when the dialogue has ended. What cannot even go on sends its parting frames.
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
_SIGNALS = {"SIGINT": "Ctrl-C", "SIGTERM": "SIGTERM", "SIGHUP": "SIGHUP"}  # not all are on every system
_PARTINGS = 3


class Interruptible(Protocol):
    """A dialogue that has a way out of its own, which is bounded."""

    news: deque[str]

    @property
    def done(self) -> bool:
        """As of ``Dialogue``."""

    @property
    def parting(self) -> Sequence[RequestFrame]:
        """What takes the power away, where it cannot go on itself."""

    def note(self, frame: CanFrame) -> None:
        """As of ``Dialogue``."""

    def trouble(self, words: str) -> None:
        """As of ``Dialogue``."""

    def step(self, now: float) -> RequestFrame | None:
        """As of ``Dialogue``."""

    def interrupt(self, why: str) -> None:
        """Have it take its way out."""


class _Told:
    """The same dialogue, whose news are told."""

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
    """Run it to its end, whatever comes; blocks. Return the signal that ended it, 0 for none.

    Raises:
        AdapterError: the channel failed before anything was sent. Whatever ``tell`` raises, after the dialogue's way out.
    """
    with _signals(dialogue) as caught:
        try:
            run(channel, _Told(dialogue, tell))
        except BaseException as error:
            _leave(channel, dialogue, error)
            raise
    return caught[0] if caught else 0


def _leave(channel: Channel, dialogue: Interruptible, error: BaseException) -> None:
    dialogue.interrupt(f"this program broke off: {type(error).__name__}")
    try:
        with suppress(AxisbusError):  # the first error is told
            run(channel, dialogue)
    finally:
        if not dialogue.done:
            for _ in range(_PARTINGS):
                for frame in dialogue.parting:
                    with suppress(AxisbusError):
                        send(channel, frame)


@contextmanager
def _signals(dialogue: Interruptible) -> Iterator[list[int]]:
    """Let signals be wishes; in the main thread alone, where Python delivers them."""
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
