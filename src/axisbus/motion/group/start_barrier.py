"""Where the axes of a group wait for each other, so that all go on in the same cycle."""

from __future__ import annotations


class StartBarrier:
    """Opens, in the next cycle, once all who are to come stand before it; holds who does in the present one.

    A comer asks in every cycle, and counts in that cycle alone: one that has gone away meanwhile is not there any more. All that
    ask within one cycle get the same answer, because the gate is opened between cycles by whoever made it (``update``).
    """

    __slots__ = ("_here", "_open", "_shut")

    def __init__(self, is_open: bool = False) -> None:
        self._here: set[int] = set()
        self._open = is_open
        self._shut = False

    def pass_through(self, comer: object) -> bool:
        """Note that ``comer`` is here; return whether it may go on."""
        if not self._open:
            self._here.add(id(comer))
        return self._open

    def update(self, coming: int) -> None:
        """Open when all are here; called once per cycle, before the axes step.

        ``coming``: how many are still under way or here. One that is where it should be already never comes.
        """
        if len(self._here) >= coming and not self._shut:
            self._open = True
        self._here.clear()

    def shut(self) -> None:
        """Do not open any more: the start has been called off. One that is open stays open."""
        self._shut = not self._open

    @property
    def is_open(self) -> bool:
        """Whether all may go on."""
        return self._open


OPEN = StartBarrier(is_open=True)
