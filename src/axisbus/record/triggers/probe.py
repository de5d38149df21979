"""Trigger a capture on an edge latched by a touch probe."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.motion.snapshot import Snapshot


class ProbeMoment:
    """Hold the number of edges that the axis had latched in the previous cycle; counts edges reported to any program."""

    def __init__(self, axis: str) -> None:
        self._axis = axis
        self._before: int | None = None

    def begin(self) -> None:
        """As ``RecordingTrigger.begin``."""

    def end(self) -> None:
        """As ``RecordingTrigger.end``."""

    def seen(self, now: float, snapshots: Mapping[str, Snapshot]) -> float | None:
        """As ``RecordingTrigger.seen``: the cycle that saw the edge, as ``ProbeResult.time``; the edge itself was earlier."""
        latched, before = snapshots[self._axis].latched, self._before
        self._before = latched
        return now if before is not None and latched > before else None
