"""The lease of a cell as its holder tracks it: how long it is valid, when to renew it, and why it was lost; reads no clock."""

from __future__ import annotations

from axisbus.errors import AxisbusError

_RENEWED = 0.25  # fraction of the lease's time after which it is renewed
_AGAIN = 0.1  # fraction of the lease's time after which an unanswered renewal is requested again
_LONGEST = 60.0  # s, the longest lease that is accepted; a larger number would overflow a wait


class LeaseKeeper:
    """Track one lease. It counts from the request, not from the answer, so it ends here before it ends at the cell."""

    def __init__(self, token: str, seconds: float, asked: float) -> None:
        """``asked``: the time of the request."""
        self.token = token
        self.why: AxisbusError | None = None
        self._seconds = min(seconds, _LONGEST)
        self._until = asked + self._seconds
        self._next = asked + self._seconds * _RENEWED

    def due(self, now: float) -> bool:
        """Return whether the lease has to be renewed now; if so, set the time of the next attempt."""
        if self.why is not None or now < self._next:
            return False
        self._next = now + max(0.02, self._seconds * _AGAIN)
        return True

    @property
    def next(self) -> float:
        """The time of the next renewal."""
        return self._next

    @property
    def until(self) -> float:
        """The time until which the lease is or was valid, unless it was refused before."""
        return self._until

    def renewed(self, seconds: float, asked: float) -> None:
        """Note that a renewal requested at ``asked`` was granted; a late answer never shortens the lease."""
        seconds = min(seconds, _LONGEST)
        if self.why is None and asked + seconds > self._until:
            self._seconds = seconds
            self._until = asked + seconds
            self._next = asked + seconds * _RENEWED

    def refuse(self, why: AxisbusError) -> None:
        """Note that the lease is lost: another client has it, or the cell does not know it."""
        self.why = self.why or why

    def left(self, now: float) -> float:
        """Return the seconds for which the lease is still valid, 0 if it is lost."""
        return 0.0 if self.why is not None else max(0.0, self._until - now)

    def lost(self, now: float) -> bool:
        """Return whether the lease is lost: it was refused, or has expired."""
        return self.left(now) <= 0.0
