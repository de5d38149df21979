"""Messages that are asked for time and again: when, how, and when a firmware is said not to answer them."""

from __future__ import annotations

from axisbus.drives.gim6010.can_simple import codec
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.messages import named

_TRIES = 5  # by a remote frame, and as many by eight bytes of 0
_SELDOM = 1.0  # s between two tries of what is not answered
_GIVEN_UP = 0.05  # s after which a question counts as not answered


class PolledMessage:
    """One message that is asked for; holds when it was asked for last, and how often in vain.

    Owners saw remote frames answered, and the maker's program asks with eight bytes of 0: after some remote frames in vain the
    other way is tried; where the bus carries no remote frames, that way alone. A message that is answered neither way is *not
    answered by this firmware*: that is told once, and it is asked for seldom from then on.
    """

    def __init__(self, node: int, name: str, *, remote: bool = True) -> None:
        """``node``: 0 to 63; ``name``: the manual's, of a message that an empty request asks for.

        ``remote``: whether the bus carries remote frames.
        """
        self.name = name
        self._frames = [codec.request(node, named(name), remote=way) for way in (remote, False)]
        self._asked_at: float | None = None
        self._open = False
        self._vain = 0
        self.answered_at: float | None = None

    @property
    def silent(self) -> bool:
        """Whether it has been asked for in both ways, in vain."""
        return self._vain >= 2 * _TRIES

    def ask(self, now: float, every: float) -> Outgoing | None:
        """Return the request where it is due, having been asked for ``every`` so many s; None where it is not."""
        since = None if self._asked_at is None else now - self._asked_at
        if self._open and since is not None and since >= _GIVEN_UP:
            self._open = False
            self._vain += 1
        pause = _SELDOM if self.silent else every
        if self._open or (since is not None and since < pause - 1e-9):
            return None
        self._asked_at, self._open = now, True
        return self._frames[self._way]

    def take(self, at: float) -> None:
        """It came at ``at``, asked for or not."""
        self.answered_at = at
        self._open = False
        self._vain = _TRIES * self._way if self._vain < 2 * _TRIES else 0

    @property
    def _way(self) -> int:
        return int(self._vain >= _TRIES) if not self.silent else self._vain % 2
