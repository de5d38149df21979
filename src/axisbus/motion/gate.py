"""Where the axes of a group wait for each other, so that all go on in the same cycle."""

from __future__ import annotations


class Gate:
    """Opens, in the next cycle, once all who are to come have arrived; holds who has.

    A comer asks in every cycle. All that are asked within one cycle get the same answer, because the gate is opened between cycles
    by whoever made it (``update``).
    """

    __slots__ = ("_arrived", "_open")

    def __init__(self, is_open: bool = False) -> None:
        self._arrived: set[int] = set()
        self._open = is_open

    def pass_through(self, comer: object) -> bool:
        """Note that ``comer`` has arrived; return whether it may go on."""
        if not self._open:
            self._arrived.add(id(comer))
        return self._open

    def update(self, coming: int) -> None:
        """Open when all have arrived; called once per cycle, before the axes step.

        ``coming``: how many are still under way or here. One that is where it should be already never comes.
        """
        if len(self._arrived) >= coming:
            self._open = True

    @property
    def is_open(self) -> bool:
        """Whether all may go on."""
        return self._open


OPEN = Gate(is_open=True)
