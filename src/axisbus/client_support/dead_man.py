"""The dead-man of a jog: it goes on only while the page says again and again, and in time, that the button is held.

Theory of operation
-------------------
A page counts what is pressed: each press has a number above the one before, and each of its messages carries it, with the time of
the page's clock. A jog goes on from beat to beat; after 0.2 s without one it has ended, and no message of that press revives it:
what a stalled network delivers afterwards, all at once, is of a hand that may be long gone. A message that comes later than the
promptest ones by more than 0.2 s is of such a hand too, though the stream of them may be even.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

SILENCE = 0.2  # seconds
_DRIFT = 0.001  # seconds in each: how far the clocks of page and server may run apart


@dataclass(frozen=True, slots=True)
class DeadMan:
    """What is held: ``axis`` and ``direction`` while something is; ``heard`` and ``shortest`` are times and lags in seconds."""

    axis: str = ""
    direction: float = 0.0
    press: int = 0  # the last one that was heard of, whether it is still held or not
    heard: float = 0.0
    shortest: float | None = None
    at: float = 0.0

    @property
    def held(self) -> bool:
        """Whether something is."""
        return bool(self.axis)

    def is_held_by(self, press: int) -> bool:
        """Whether something is, by this press: what comes of it goes on, and begins nothing."""
        return self.held and self.press == press

    def told(self, sent: float, now: float) -> DeadMan:
        """Any message of the page, sent at its time ``sent``: the promptest ones show how far the clocks are apart."""
        lag = now - sent
        known = lag if self.shortest is None else min(lag, self.shortest + _DRIFT * max(0.0, now - self.at))
        return replace(self, shortest=known, at=now)

    def beaten(self, press: int, axis: str, direction: float, sent: float, now: float) -> DeadMan:
        """A message of a press; what it leaves held is to go on, and nothing where it came too late or of what has ended."""
        after = self.told(sent, now)
        late = after.lateness(sent, now) > SILENCE
        new = press > after.press
        same = press == after.press and (axis, direction) == (after.axis, after.direction)
        if late or not (new or (same and now - after.heard <= SILENCE)):
            return replace(after, axis="", direction=0.0, press=max(press, after.press))
        return replace(after, axis=axis, direction=direction, press=press, heard=now)

    def lateness(self, sent: float, now: float) -> float:
        """How much longer than the promptest ones a message was under way, in seconds; it has been ``told``."""
        return 0.0 if self.shortest is None else now - sent - self.shortest

    def silent(self, now: float) -> bool:
        """Whether something is held of which nothing was heard for too long."""
        return self.held and now - self.heard > SILENCE

    def ended(self) -> DeadMan:
        """Nothing is held any more: released, or silent, or the page is gone or hidden."""
        return replace(self, axis="", direction=0.0)
