"""Decide whether a value is good, uncertain or bad, by the age of the process image and the last good value; pure."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

Number = float | int


class Quality(Enum):
    """The quality of a value; each has one status code of OPC UA (OPC 10000-4 7.38.2, OPC 10000-8 6.3.2)."""

    GOOD = "Good"
    LAST_USABLE = "UncertainLastUsableValue"
    WAITING = "BadWaitingForInitialData"
    NO_COMMUNICATION = "BadNoCommunication"
    NOT_SUPPORTED = "BadNotSupported"


class OpcuaValue(NamedTuple):
    """A value (None if it is bad), its quality, and its time: ``stamp`` in seconds of the core's clock, None: unknown."""

    value: Number | None
    quality: Quality
    stamp: float | None = None


class ImageFreshness(Enum):
    """Whether the process image is up to date, is old because the core runs no cycles, or is missing: no machine runs."""

    NOW = "now"
    OLD = "old"
    NONE = "none"


WAITING = OpcuaValue(None, Quality.WAITING)
GONE = OpcuaValue(None, Quality.NO_COMMUNICATION)
NOT_SUPPORTED = OpcuaValue(None, Quality.NOT_SUPPORTED)


def judged(fresh: Number | None, stamp: float, image: ImageFreshness, last: OpcuaValue | None) -> OpcuaValue:
    """Return the reading of a value that is received from the drive.

    ``fresh`` is None if the value was never received, or is older than its maximum age; ``last`` is the last good reading of the
    same machine. A value is good only while both it and the process image are fresh.
    """
    if image is ImageFreshness.NONE:
        return GONE
    if fresh is not None and image is ImageFreshness.NOW:
        return OpcuaValue(fresh, Quality.GOOD, stamp)
    if last is None:
        return WAITING
    return OpcuaValue(last.value, Quality.LAST_USABLE, last.stamp)


class Memory:
    """Store the last good reading of each value of one machine."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, str], OpcuaValue] = {}

    def judge(
        self, key: tuple[str, str], fresh: Number | None, stamp: float, image: ImageFreshness
    ) -> OpcuaValue:
        """Judge a value, and store it if it is good."""
        found = judged(fresh, stamp, image, self._last.get(key))
        if found.quality is Quality.GOOD:
            self._last[key] = found
        return found

    def forget(self) -> None:
        """Forget all readings: the next ones belong to another machine."""
        self._last.clear()
