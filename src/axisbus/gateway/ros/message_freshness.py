"""Whether a message is of now: not sent before, not out of order, not held up on its way, and heard by a program that runs.

Theory of operation
-------------------
The clocks of two computers are not compared. What a message's way takes is known but for what both clocks differ by, so the
quickest way of a publisher's messages is kept, and one that took ``HELD_UP`` longer is late. A program that stood still (suspended,
starved) hears all that has waited at once: for ``AGAIN`` after that nothing that it hears is of now.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

from axisbus.errors import StateError
from axisbus.gateway.ros.attachment import Attachment

HELD_UP = 1.0  # seconds
AGAIN = 1.0  # seconds
STOOD = 0.5  # seconds without a beat
_MOST = 256  # publishers that are known
_REMEDY = "send it again, with another number"


@dataclass(slots=True)
class _Known:
    number: int
    quickest: float  # seconds, with what the clocks differ by


class Freshness:
    """Holds what was heard of each publisher, and when this program was seen to run; times in s, monotonic, of this computer."""

    def __init__(self, now: float) -> None:
        self._known: OrderedDict[bytes, _Known] = OrderedDict()
        self._beat = now
        self._from = now

    def beat(self, now: float) -> None:
        """Note that this program runs; to be called several times in ``STOOD``."""
        if now - self._beat > STOOD:
            self._from = now + AGAIN
        self._beat = now

    def require(self, attachment: Attachment, now: float) -> None:
        """Check that a message is of now, and note it.

        Raises:
            StateError: it is not.
        """
        way = now - attachment.sent / 1e9
        known = self._known.get(attachment.gid)
        number, quickest = attachment.number, way if known is None else min(way, known.quickest)
        self._note(attachment.gid, max(number, number if known is None else known.number), quickest)
        if now - self._beat > STOOD or now < self._from:
            raise StateError(
                "a trajectory came while the bridge stood still",
                remedy=f"{_REMEDY}, once the bridge runs again",
            )
        if known is not None and number <= known.number:
            raise StateError(
                "a trajectory came once more, or out of order",
                observed=f"its number is {number}, and {known.number} was there",
                remedy=_REMEDY,
            )
        if way - quickest > HELD_UP:
            raise StateError(
                "a trajectory came too late",
                observed=f"it was {way - quickest:.3f} s longer on its way than others of its sender",
                remedy=_REMEDY,
            )

    def _note(self, gid: bytes, number: int, quickest: float) -> None:
        self._known[gid] = _Known(number, quickest)
        self._known.move_to_end(gid)
        while len(self._known) > _MOST:
            self._known.popitem(last=False)
