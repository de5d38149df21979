"""Response times of a node: the only evidence of a link's delay that needs no clock of the node."""

from __future__ import annotations

import math

ALLOWED = 0.05  # seconds assumed for the node's own response time if no answer was faster


class RoundTrips:
    """The SDO answers of one node; holds state: the newest one, and the shortest response time.

    An answer received at ``heard`` to a request sent at ``asked`` (seconds) was sent after ``asked``, and so was every later frame.
    ``newest`` is that pair, replaced as a whole. May be read in any thread.
    """

    __slots__ = ("newest", "shortest")

    def __init__(self) -> None:
        self.newest = (-math.inf, -math.inf)
        self.shortest = math.inf

    def note(self, asked: float, heard: float) -> None:
        """Record an answer."""
        taken = max(0.0, heard - asked)
        if taken < self.shortest:
            self.shortest = taken
        self.newest = (asked, heard)

    @property
    def own_time(self) -> float:
        """The seconds that the node itself may need: its shortest response time, at most ``ALLOWED``."""
        return min(self.shortest, ALLOWED)

    @property
    def shortest_delay(self) -> float:
        """The delay of the link (seconds) that is compatible with every answer so far."""
        return self.shortest - self.own_time if self.shortest < math.inf else 0.0

    def delay(self) -> float:
        """Return the longest delay of the link (seconds) that is compatible with the newest answer."""
        asked, heard = self.newest
        return max(0.0, heard - asked - self.own_time) if heard > -math.inf else 0.0
