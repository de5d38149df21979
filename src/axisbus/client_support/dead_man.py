"""The dead-man of a jog: a jog continues only while the page keeps reporting, in time, that its button is held.

Theory of operation
-------------------
The page numbers its presses: each press has a higher number than the one before. Each message of a press carries this number and
the time of the page's clock. After 0.2 s without a message the jog has ended, and no later message of the same press restarts it.
A stalled network may deliver the remaining messages all at once, when the user has long released the button. A message whose delay
exceeds that of the promptest messages by more than 0.2 s is ignored for the same reason, even if messages arrive at an even rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

SILENCE = 0.2  # seconds
_DRIFT = 0.001  # seconds per second: the drift assumed between two clocks


@dataclass(frozen=True, slots=True)
class MessageLag:
    """How long the promptest messages of a sender took, which includes the difference of both clocks; times are in seconds.

    ``max_growth``: the largest drift of the clocks that is assumed between two messages, however long the pause between them.
    """

    max_growth: float = math.inf
    shortest: float | None = None
    at: float = 0.0

    def updated(self, sent: float, now: float) -> MessageLag:
        """Account for a message sent at ``sent`` by the sender's clock: the promptest messages show the offset of the clocks."""
        lag = now - sent
        if self.shortest is not None:
            lag = min(lag, self.shortest + min(self.max_growth, _DRIFT * max(0.0, now - self.at)))
        return replace(self, shortest=lag, at=now)

    def lateness(self, sent: float, now: float) -> float:
        """Return how much longer than the promptest messages a message took, in seconds; after ``updated`` for it."""
        return 0.0 if self.shortest is None else now - sent - self.shortest


@dataclass(frozen=True, slots=True)
class DeadMan:
    """The held jog, if any: ``axis`` and ``direction`` are set while a button is held.

    ``last_signal`` is the time of the last accepted message, in seconds.
    """

    axis: str = ""
    direction: float = 0.0
    press: int = 0  # the newest press received, whether its button is still held or not
    last_signal: float = 0.0
    lag: MessageLag = MessageLag()

    @property
    def held(self) -> bool:
        """Whether a button is held."""
        return bool(self.axis)

    def is_held_by(self, press: int) -> bool:
        """Whether a button is held by this press; a message of such a press continues the jog and starts no new one."""
        return self.held and self.press == press

    def updated(self, sent: float, now: float) -> DeadMan:
        """Account for a message that the page sent at its time ``sent``."""
        return replace(self, lag=self.lag.updated(sent, now))

    def beaten(self, press: int, axis: str, direction: float, sent: float, now: float) -> DeadMan:
        """Account for a message of a press; if nothing is held in the result, the message was too late or its press has ended."""
        after = self.updated(sent, now)
        late = after.lateness(sent, now) > SILENCE
        new = press > after.press
        same = press == after.press and (axis, direction) == (after.axis, after.direction)
        if late or not (new or (same and now - after.last_signal <= SILENCE)):
            return replace(after, axis="", direction=0.0, press=max(press, after.press))
        return replace(after, axis=axis, direction=direction, press=press, last_signal=now)

    def lateness(self, sent: float, now: float) -> float:
        """As ``MessageLag.lateness``."""
        return self.lag.lateness(sent, now)

    def silent(self, now: float) -> bool:
        """Whether a button is held and the last message is more than 0.2 s old."""
        return self.held and now - self.last_signal > SILENCE

    def ended(self) -> DeadMan:
        """Return the state with nothing held: the button is released, messages are missing, or the page is closed or hidden."""
        return replace(self, axis="", direction=0.0)
