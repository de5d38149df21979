"""The lease of a cell as its holder keeps it: how long it holds, when it is to be renewed, and why it is gone; without a clock."""

from __future__ import annotations

from axisbus.errors import AxisbusError

_RENEWED = 0.25  # of its time, after which it is renewed
_AGAIN = 0.1  # of its time, after which a renewal that got no answer is asked for once more
_LONGEST = 60.0  # s, the longest lease that is believed; a larger number would overflow a wait


class LeaseKeeper:
    """Holds one lease. It counts from when it was asked for, not from the answer: so it ends here before it does at the cell."""

    def __init__(self, token: str, seconds: float, asked: float) -> None:
        """``asked``: the time at which it was asked for."""
        self.token = token
        self.why: AxisbusError | None = None
        self._seconds = min(seconds, _LONGEST)
        self._until = asked + self._seconds
        self._next = asked + self._seconds * _RENEWED

    def due(self, now: float) -> bool:
        """Return whether it is to be renewed now; then it is not due again for a moment."""
        if self.why is not None or now < self._next:
            return False
        self._next = now + max(0.02, self._seconds * _AGAIN)
        return True

    @property
    def next(self) -> float:
        """When it is due next."""
        return self._next

    @property
    def until(self) -> float:
        """Until when it holds, or has held, unless it was refused before."""
        return self._until

    def renewed(self, seconds: float, asked: float) -> None:
        """A renewal that was asked for at a time was granted; a late answer never shortens it."""
        seconds = min(seconds, _LONGEST)
        if self.why is None and asked + seconds > self._until:
            self._seconds = seconds
            self._until = asked + seconds
            self._next = asked + seconds * _RENEWED

    def refuse(self, why: AxisbusError) -> None:
        """It is gone: another has it, or the cell does not know it."""
        self.why = self.why or why

    def left(self, now: float) -> float:
        """Return for how many seconds it holds still, 0 where it is gone."""
        return 0.0 if self.why is not None else max(0.0, self._until - now)

    def lost(self, now: float) -> bool:
        """Return whether it is gone: it was refused, or has run out."""
        return self.left(now) <= 0.0
