"""Hold-to-run: a program must confirm again and again that the axes may move; otherwise everything halts."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple


class _Held(NamedTuple):
    since: float
    seconds: float
    continuous: float
    who: str


class HoldToRun:
    """Holds the time (s) until which the axes may move, and the reason for the halt after it.

    Any thread may confirm; the scan checks.
    """

    def __init__(self) -> None:
        self._held: _Held | None = None

    def hold(self, now: float, seconds: float, who: str, continuous: float | None = None) -> None:
        """Permit motion for ``seconds`` from ``now`` on; ``who`` is the program's name for the user.

        ``continuous``: the shorter time that counts while an axis is in a motion that only a further command stops; None: the same
        time.
        """
        self._held = _Held(now, seconds, min(seconds, seconds if continuous is None else continuous), who)

    def let_go(self) -> None:
        """End the monitoring: motion continues without further confirmation."""
        self._held = None

    def broken(self, now: float, moves_on: Callable[[], bool]) -> str | None:
        """Return why everything must halt now, once; None if no halt is needed.

        ``moves_on`` returns whether an axis is in continuous motion. It is called only if the result depends on it.
        """
        held = self._held
        if held is None or now <= held.since + held.continuous:
            return None
        if now <= held.since + held.seconds and not moves_on():
            return None
        if self._held is held:  # otherwise the program has just confirmed again
            self._held = None
        silent = held.continuous if now <= held.since + held.seconds else held.seconds
        return f"{held.who}, the hold-to-run client, sent no confirmation for {silent:g} s"
