"""Run a pure dialogue over a channel: send its requests, and pass it all received frames and missing acknowledgements."""

from __future__ import annotations

import time
from collections import deque
from typing import Protocol

from axisbus.bus.gim6010.request import RequestFrame, send
from axisbus.bus.link.channel import Channel, require_other_thread
from axisbus.bus.link.errorframe import CanErrorState
from axisbus.cia301.frame import CanFrame
from axisbus.errors import AdapterError

_TICK = 0.001  # s between two polls
_NO_ACKNOWLEDGE = "no acknowledge"  # as ``errorframe`` describes it


class ModuleProcedure(Protocol):
    """A dialogue; its times are those of ``time.monotonic()``, in s."""

    @property
    def done(self) -> bool:
        """Whether the dialogue has ended."""

    def note(self, frame: CanFrame) -> None:
        """Handle a received frame; called in the order of time."""

    def trouble(self, words: str) -> None:
        """Handle a request that was not acknowledged or not sent."""

    def step(self, now: float) -> RequestFrame | None:
        """Advance to ``now`` and return the frame to send, if any."""


def run(channel: Channel, dialogue: ModuleProcedure) -> None:
    """Run a dialogue to its end; blocks until then.

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
