"""Messages that are requested periodically: when, by which kind of frame, and when the firmware counts as not answering them."""

from __future__ import annotations

from axisbus.drives.gim6010.can_simple import codec
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.messages import named

_TRIES = 5  # requests by a remote frame, and as many by eight bytes of 0
_SELDOM = 1.0  # s between two requests for a message that is not answered
_GIVEN_UP = 0.05  # s after which a request counts as not answered


class PolledMessage:
    """One periodically requested message, with the time of the last request and the number of requests without an answer.

    Owners saw answers to remote frames, and the maker's program sends eight bytes of 0. After some remote frames without an answer,
    the data frame is used; if the bus carries no remote frames, only the data frame is used. A message that is answered to neither
    is *not answered by this firmware*: this is reported once, and the message is then requested rarely.
    """

    def __init__(self, node: int, name: str, *, remote: bool = True) -> None:
        """``node``: 0 to 63; ``name``: the manual's name of a message that an empty request asks for.

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
        """Whether both kinds of request had no answer."""
        return self._vain >= 2 * _TRIES

    def ask(self, now: float, every: float) -> Outgoing | None:
        """Return the request if it is due, with a period of ``every`` s; otherwise None."""
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
        """Note that the message arrived at ``at``, requested or not."""
        self.answered_at = at
        self._open = False
        self._vain = _TRIES * self._way if self._vain < 2 * _TRIES else 0

    @property
    def _way(self) -> int:
        return int(self._vain >= _TRIES) if not self.silent else self._vain % 2
