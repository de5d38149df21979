"""A program that holds what it has set going to run: unless it says so again and again, everything halts."""

from __future__ import annotations

from typing import NamedTuple


class _Held(NamedTuple):
    until: float
    reason: str


class HoldToRun:
    """Holds until when (s) the program is trusted, and why it then is no more; said in any thread, looked at by the scan."""

    def __init__(self) -> None:
        self._held: _Held | None = None

    def hold(self, now: float, seconds: float, who: str) -> None:
        """Trust it for ``seconds`` from ``now`` on; ``who`` is the program, for people."""
        self._held = _Held(now + seconds, f"{who}, which holds it to run, said nothing for {seconds:g} s")

    def let_go(self) -> None:
        """It holds nothing any more: what moves goes on by itself."""
        self._held = None

    def broken(self, now: float) -> str | None:
        """Return why everything has to halt now; once, and None while it need not."""
        held = self._held
        if held is None or now <= held.until:
            return None
        if self._held is held:  # else it was just said anew
            self._held = None
        return held.reason
