"""The interface of all triggers of a capture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from axisbus.motion.snapshot import Snapshot


class RecordingTrigger(Protocol):
    """Evaluate each cycle, and report the time of the trigger. A condition that is true from the beginning does not fire."""

    def begin(self) -> None:
        """Start observing."""

    def end(self) -> None:
        """Stop observing; harmless when repeated."""

    def seen(self, now: float, snapshots: Mapping[str, Snapshot]) -> float | None:
        """Return the time of the trigger (s, monotonic), at the latest that of the cycle at ``now``; None: not yet."""
