"""How long a node takes to answer: the only evidence of a link's delay that no clock of the node is needed for."""

from __future__ import annotations

import math

ALLOWED = 0.05  # seconds that are the node's own time to answer, where it has never been quicker


class RoundTrips:
    """The SDO answers of one node; holds state: the newest one, and the shortest time that any took.

    An answer that came at ``heard`` to a request of ``asked`` (seconds) was sent after ``asked``, and so was whatever came behind
    it. ``newest`` is that pair, replaced as a whole. May be read in any thread.
    """

    __slots__ = ("newest", "shortest")

    def __init__(self) -> None:
        self.newest = (-math.inf, -math.inf)
        self.shortest = math.inf

    def note(self, asked: float, heard: float) -> None:
        """Take an answer."""
        taken = max(0.0, heard - asked)
        if taken < self.shortest:
            self.shortest = taken
        self.newest = (asked, heard)

    @property
    def own_time(self) -> float:
        """The seconds that the node itself may need: its shortest answer, at most ``ALLOWED``."""
        return min(self.shortest, ALLOWED)

    @property
    def shortest_delay(self) -> float:
        """The delay on the way (seconds) that every answer so far allows."""
        return self.shortest - self.own_time if self.shortest < math.inf else 0.0

    def delay(self) -> float:
        """Return the longest delay on the way (seconds) that the newest answer allows."""
        asked, heard = self.newest
        return max(0.0, heard - asked - self.own_time) if heard > -math.inf else 0.0
