"""Run a pure dialogue over a channel: send its requests, and pass it all received frames and missing acknowledgements."""

from __future__ import annotations

import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from types import FrameType
from typing import Any, Protocol

from axisbus.bus.link.channel import Channel, Receiver, require_other_thread
from axisbus.bus.link.controller import CanErrorState
from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.identifier import identifiers
from axisbus.errors import AdapterError, AxisbusError
from axisbus.system.signals import present

_TICK = 0.001  # s between two polls
_NO_ACKNOWLEDGE = "no acknowledge"  # as ``errorframe`` describes it


class ModuleProcedure(Protocol):
    """A dialogue; its times are those of the channel's clock, in s."""

    @property
    def done(self) -> bool:
        """Whether the dialogue has ended."""

    def note(self, frame: CanFrame) -> None:
        """Handle a received frame; called in the order of time."""

    def trouble(self, words: str) -> None:
        """Handle a request that was not acknowledged or not sent."""

    def step(self, now: float) -> Outgoing | None:
        """Advance to ``now`` and return the frame to send, if any."""


def run(channel: Channel, dialogue: ModuleProcedure, report: Callable[[], None] = lambda: None) -> None:
    """Run a dialogue to its end; blocks until then. ``report`` is called whenever nothing is to be sent, and at the end.

    Raises:
        AdapterError: the channel failed before anything was sent, or stopped receiving.
        StateError: called in the receive thread.
    """
    require_other_thread(channel, "a dialogue with modules")
    heard: deque[CanFrame] = deque()
    watch = _Watch(channel)
    with channel.frames_to(heard.append):
        while not dialogue.done:
            while heard:
                dialogue.note(heard.popleft())
            sign = watch.sign()
            if sign:
                dialogue.trouble(sign)
            request = dialogue.step(channel.clock.now())
            if request is None:
                report()
                channel.clock.sleep(_TICK)
            else:
                watch.sent = True
                _send(channel, dialogue, request, knows_failure=bool(sign) and channel.failure is not None)
    report()
    if not watch.sent:
        channel.check()


def _send(channel: Channel, dialogue: ModuleProcedure, request: Outgoing, *, knows_failure: bool) -> None:
    """Send a frame; if the dialogue knows that the channel has failed, its frames remove the power, and are sent nevertheless."""
    try:
        send(channel, request)
    except AdapterError as error:
        if knows_failure and not request.remote:
            channel.send_urgent([(request.can_id, request.data)])
        dialogue.trouble(error.message)


class _Watch:
    """Detects that sent frames are not acknowledged; holds the number of error frames before the dialogue."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._before = channel.counters.error_frames
        self.sent = False

    def sign(self) -> str:
        """Return the first sign as text; empty if there is none."""
        if not self.sent:
            return ""
        channel = self._channel
        if channel.failure is not None or channel.off is not None:
            return (channel.failure or channel.off or AdapterError("")).message
        if channel.controller.condition is not CanErrorState.ACTIVE:
            return f"the CAN controller is {channel.controller.condition.value}"
        new = channel.counters.error_frames - self._before
        errors = list(channel.counters.errors)[-new:] if new else []
        return next((each for each in errors if _NO_ACKNOWLEDGE in each), "")


# -- The frames that a dialogue sends: data frames, or remote frames that request data ----------------------------------


_LENGTH = 8  # bytes that a remote frame requests


def send(channel: Channel, request: Outgoing) -> None:
    if request.remote:
        channel.send_remote(request.can_id, _LENGTH)
    else:
        channel.send(request.can_id, request.data)


# ----------------------------------------------------------------------------------------------------------------------
# Run a dialogue that moves a motor: whatever ends it, its own cleanup runs to its end before the program continues.
#
# Theory of operation. Ctrl-C, SIGTERM and SIGHUP do not interrupt the dialogue. The signal handler calls ``interrupt``, the
# dialogue starts its cleanup with the next step, and the function returns the signal. An exception in the callback for news (a
# closed pipe) also calls ``interrupt``; it is raised again when the dialogue has ended. If even the cleanup cannot run, the
# dialogue's final frames are sent.


Tell = Callable[[str], None]
# Ctrl-Z too: a program that is suspended follows nothing.
_SIGNALS = present("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK", "SIGTSTP")
_PARTINGS = 3


class Interruptible(ModuleProcedure, Protocol):
    """A dialogue with a cleanup of its own, which takes a limited time."""

    news: deque[str]

    @property
    def parting(self) -> Sequence[Outgoing]:
        """Final frames that remove the power if the dialogue cannot continue."""

    def interrupt(self, why: str) -> None:
        """Make the dialogue start its cleanup."""


def run_guarded(channel: Channel, dialogue: Interruptible, tell: Tell) -> int:
    """Run a dialogue and its cleanup to the end in any case; blocks. Return the signal that interrupted it, 0 for none.

    Raises:
        AdapterError: the channel failed before anything was sent. Any exception of ``tell``, after the dialogue's cleanup.
    """

    def report() -> None:
        while dialogue.news:
            tell(dialogue.news.popleft())

    with interrupts(dialogue.interrupt) as caught:
        try:
            run(channel, dialogue, report)
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
            send_parting(channel, dialogue)


def send_parting(channel: Channel, dialogue: Interruptible) -> None:
    """Send the final frames of a dialogue that cannot continue, several times; failures are ignored."""
    for _ in range(_PARTINGS):
        for frame in dialogue.parting:
            with suppress(AxisbusError):
                send(channel, frame)


@contextmanager
def frames_of(channel: Channel, node: int, heard: deque[CanFrame]) -> Iterator[None]:
    """Append all frames with identifiers of a module to ``heard`` within the block; they are appended in the receive thread."""

    def hear(can_id: int, data: bytes, stamp: float) -> None:
        heard.append(CanFrame(stamp, can_id, bytes(data)))

    with subscribed(channel, [(can_id, partial(hear, can_id)) for can_id in identifiers(node)]):
        yield


@contextmanager
def subscribed(channel: Channel, receivers: Sequence[tuple[int, Receiver]]) -> Iterator[None]:
    """Pass the frames of each identifier to its receiver within the block."""
    for can_id, receiver in receivers:
        channel.subscribe(can_id, receiver)
    try:
        yield
    finally:
        for can_id, receiver in receivers:
            channel.unsubscribe(can_id, receiver)


@contextmanager
def interrupts(interrupt: Callable[[str], object]) -> Iterator[list[int]]:
    """Handle signals by ``interrupt`` (called with the signal's name), and yield the list of signals.

    If ``interrupt`` returns True, the signal is raised in the program, as KeyboardInterrupt or SystemExit. Only in the main thread,
    in which Python delivers them.
    """
    caught: list[int] = []
    before: dict[int, Any] = {}

    def take(number: int, _: FrameType | None) -> None:
        caught.append(number)
        if interrupt(_SIGNALS[number]) is not True:
            return
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + number)

    if threading.current_thread() is threading.main_thread():
        for number in _SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
                before[number] = signal.signal(number, take)
    try:
        yield caught
    finally:
        for number, handler in before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)
