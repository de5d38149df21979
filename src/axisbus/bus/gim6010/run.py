"""A pure dialogue over a channel: its requests are sent, it is told every frame that comes, and of what nobody acknowledges."""

from __future__ import annotations

import time
from collections import deque
from typing import Protocol

from axisbus.bus.gim6010.request import RequestFrame, send
from axisbus.bus.link.channel import Channel, require_other_thread
from axisbus.bus.link.errorframe import CanErrorState
from axisbus.cia301.frame import CanFrame
from axisbus.errors import AdapterError

_TICK = 0.001  # s between two looks
_NO_ACKNOWLEDGE = "no acknowledge"  # as ``errorframe`` describes it


class ModuleProcedure(Protocol):
    """What decides; times are those of ``time.monotonic()``, in s."""

    @property
    def done(self) -> bool:
        """Whether it has ended."""

    def note(self, frame: CanFrame) -> None:
        """Take a frame that was heard, in the order of time."""

    def trouble(self, words: str) -> None:
        """Hear that a request was not acknowledged, or not sent."""

    def step(self, now: float) -> RequestFrame | None:
        """Let time pass, and return what is to be sent now."""


def run(channel: Channel, dialogue: ModuleProcedure) -> None:
    """Run a dialogue to its end; blocks so long.

    Raises:
        AdapterError: the channel failed before anything was sent, or stopped receiving.
        StateError: called in the receive thread.
    """
    require_other_thread(channel, "a dialogue with modules")
    heard: deque[CanFrame] = deque()
    watch = _Watch(channel)
    with channel.overheard(heard.append):
        while not dialogue.done:
            while heard:
                dialogue.note(heard.popleft())
            sign = watch.sign()
            if sign:
                dialogue.trouble(sign)
            request = dialogue.step(time.monotonic())
            if request is None:
                time.sleep(_TICK)
            else:
                watch.sent = True
                _send(channel, dialogue, request)
    if not watch.sent:
        channel.check()


def _send(channel: Channel, dialogue: ModuleProcedure, request: RequestFrame) -> None:
    try:
        send(channel, request)
    except AdapterError as error:
        dialogue.trouble(error.message)


class _Watch:
    """Looks for signs that what was sent is not acknowledged; holds what the channel had told before."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._before = channel.counters.error_frames
        self.sent = False

    def sign(self) -> str:
        """Return the first sign in words; empty where there is none."""
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
