"""Where the axes of a group wait for each other, so that all go on in the same cycle."""

from __future__ import annotations


class Gate:
    """Opens, in the next cycle, once ``count`` different comers have arrived; holds who has.

    A comer asks in every cycle. All that are asked within one cycle get the same answer, because the gate is opened between cycles
    by whoever made it (``update``).
    """

    __slots__ = ("_arrived", "_count", "_open")

    def __init__(self, count: int) -> None:
        self._count = count
        self._arrived: set[int] = set()
        self._open = count <= 1

    def pass_through(self, comer: object) -> bool:
        """Note that ``comer`` has arrived; return whether it may go on."""
        if not self._open:
            self._arrived.add(id(comer))
        return self._open

    def update(self) -> None:
        """Open when all have arrived; called once per cycle, before the axes step."""
        if len(self._arrived) >= self._count:
            self._open = True

    @property
    def is_open(self) -> bool:
        """Whether all may go on."""
        return self._open


OPEN = Gate(0)
