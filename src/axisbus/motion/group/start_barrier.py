"""A barrier at which the axes of a group wait for each other, so that all continue in the same cycle."""

from __future__ import annotations


class StartBarrier:
    """Opens in the cycle after all expected axes have arrived; holds those that are present in the current cycle.

    A waiting activity asks in every cycle and counts in that cycle only, so one that has dropped out no longer counts. All that ask
    within one cycle get the same answer, because the owner opens the barrier between cycles (``update``).
    """

    __slots__ = ("_open", "_present", "_shut")

    def __init__(self, is_open: bool = False) -> None:
        self._present: set[int] = set()
        self._open = is_open
        self._shut = False

    def pass_through(self, waiting: object) -> bool:
        """Note that ``waiting`` is present; return whether it may continue."""
        if not self._open:
            self._present.add(id(waiting))
        return self._open

    def update(self, expected: int) -> None:
        """Open if all are present; called once per cycle, before the axes step.

        ``expected``: number of axes that have not ended. An axis that is already at its target ends, and never arrives here.
        """
        if len(self._present) >= expected and not self._shut:
            self._open = True
        self._present.clear()

    def shut(self) -> None:
        """Keep the barrier closed because the start was cancelled. If it is open already, it stays open."""
        self._shut = not self._open

    @property
    def is_open(self) -> bool:
        """Whether all may continue."""
        return self._open


OPEN = StartBarrier(is_open=True)
