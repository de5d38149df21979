"""What a capture waits for, whatever it looks at."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from axisbus.motion.snapshot import Snapshot


class RecordingTrigger(Protocol):
    """Looks at each cycle, and says when the moment was. What is so from the beginning is none."""

    def begin(self) -> None:
        """Look from now on."""

    def end(self) -> None:
        """Look no more; harmless when repeated."""

    def seen(self, now: float, snapshots: Mapping[str, Snapshot]) -> float | None:
        """Return when it was (s, monotonic), by the cycle at ``now`` at the latest; None: not yet."""
