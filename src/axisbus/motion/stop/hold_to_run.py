"""A program that holds what it has set going to run: unless it says so again and again, everything halts."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple


class _Held(NamedTuple):
    since: float
    seconds: float
    continuous: float
    who: str


class HoldToRun:
    """Holds until when (s) the program is trusted, and why it then is no more; said in any thread, looked at by the scan."""

    def __init__(self) -> None:
        self._held: _Held | None = None

    def hold(self, now: float, seconds: float, who: str, continuous: float | None = None) -> None:
        """Trust it for ``seconds`` from ``now`` on; ``who`` is the program, for people.

        ``continuous``: the same while an axis moves that only a further command stops; None: as long.
        """
        self._held = _Held(now, seconds, min(seconds, seconds if continuous is None else continuous), who)

    def let_go(self) -> None:
        """It holds nothing any more: what moves goes on by itself."""
        self._held = None

    def broken(self, now: float, moves_on: Callable[[], bool]) -> str | None:
        """Return why everything has to halt now; once, and None while it need not.

        ``moves_on`` tells whether an axis is in continuous motion; it is asked where that decides.
        """
        held = self._held
        if held is None or now <= held.since + held.continuous:
            return None
        if now <= held.since + held.seconds and not moves_on():
            return None
        if self._held is held:  # else it was just said anew
            self._held = None
        silent = held.continuous if now <= held.since + held.seconds else held.seconds
        return f"{held.who}, which holds it to run, said nothing for {silent:g} s"
