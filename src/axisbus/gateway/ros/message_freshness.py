"""Check that a message is fresh: not repeated, not reordered, not delayed, and received while this program runs.

Theory of operation
-------------------
The clocks of two computers are not compared. The transmission time of a message is known except for the difference of both clocks.
So the shortest time of a publisher's messages is stored, and a message that took ``HELD_UP`` longer is late. A program that did not
run for a while (suspended, starved) then receives all waiting messages at once: for ``AGAIN`` after that, no message is fresh.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

from axisbus.errors import StateError
from axisbus.gateway.ros.attachment import Attachment

HELD_UP = 1.0  # seconds
AGAIN = 1.0  # seconds
STOOD = 0.5  # seconds without a call of ``beat``
_MOST = 256  # the most remembered publishers
_REMEDY = "send it again, with another number"


@dataclass(slots=True)
class _Known:
    number: int
    quickest: float  # seconds, including the difference of the clocks


class Freshness:
    """Hold the last message of each publisher, and when this program was last seen to run; times in s, monotonic, local."""

    def __init__(self, now: float) -> None:
        self._known: OrderedDict[bytes, _Known] = OrderedDict()
        self._beat = now
        self._from = now

    def beat(self, now: float) -> None:
        """Note that this program runs; to be called several times within ``STOOD``."""
        if now - self._beat > STOOD:
            self._from = now + AGAIN
        self._beat = now

    def require(self, attachment: Attachment, now: float) -> None:
        """Check that a message is fresh, and note it.

        Raises:
            StateError: the message is not fresh.
        """
        way = now - attachment.sent / 1e9
        known = self._known.get(attachment.gid)
        number, quickest = attachment.number, way if known is None else min(way, known.quickest)
        self._note(attachment.gid, max(number, number if known is None else known.number), quickest)
        if now - self._beat > STOOD or now < self._from:
            raise StateError(
                "a trajectory arrived while the bridge was suspended",
                remedy=f"{_REMEDY}, when the bridge runs again",
            )
        if known is not None and number <= known.number:
            raise StateError(
                "a trajectory arrived twice, or out of order",
                observed=f"its number is {number}, and {known.number} had arrived before",
                remedy=_REMEDY,
            )
        if way - quickest > HELD_UP:
            raise StateError(
                "a trajectory arrived too late",
                observed=f"it was {way - quickest:.3f} s slower than other messages of its sender",
                remedy=_REMEDY,
            )

    def _note(self, gid: bytes, number: int, quickest: float) -> None:
        self._known[gid] = _Known(number, quickest)
        self._known.move_to_end(gid)
        while len(self._known) > _MOST:
            self._known.popitem(last=False)
