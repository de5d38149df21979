"""Hold-to-run: a program must confirm again and again that the axes may move; otherwise everything halts."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple


class _Confirmation(NamedTuple):
    since: float
    seconds: float
    continuous: float
    client: str


class HoldToRun:
    """Holds the time (s) until which the axes may move, and the reason for the halt after it.

    Any thread may confirm; the scan checks.
    """

    def __init__(self) -> None:
        self._confirmation: _Confirmation | None = None

    def hold(self, now: float, seconds: float, client: str, continuous: float | None = None) -> None:
        """Permit motion for ``seconds`` from ``now`` on; ``client`` is the program's name for the user.

        ``continuous``: the shorter time that counts while an axis is in a motion that only a further command stops; None: the same
        time.
        """
        self._confirmation = _Confirmation(
            now, seconds, min(seconds, seconds if continuous is None else continuous), client
        )

    def let_go(self) -> None:
        """End the monitoring: motion continues without further confirmation."""
        self._confirmation = None

    def broken(self, now: float, moves_continuously: Callable[[], bool]) -> str | None:
        """Return why everything must halt now, once; None if no halt is needed.

        ``moves_continuously`` returns whether an axis is in continuous motion. It is called only if the result depends on it.
        """
        confirmation = self._confirmation
        if confirmation is None or now <= confirmation.since + confirmation.continuous:
            return None
        if now <= confirmation.since + confirmation.seconds and not moves_continuously():
            return None
        if self._confirmation is confirmation:  # otherwise the program has just confirmed again
            self._confirmation = None
        silent = (
            confirmation.continuous
            if now <= confirmation.since + confirmation.seconds
            else confirmation.seconds
        )
        return f"{confirmation.client}, the hold-to-run client, sent no confirmation for {silent:g} s"
