"""A touch probe that latches an edge, as the moment of a capture."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.motion.snapshot import Snapshot


class ProbeMoment:
    """Holds how many edges the axis had latched in the cycle before; counts those that any program was told of."""

    def __init__(self, axis: str) -> None:
        self._axis = axis
        self._before: int | None = None

    def begin(self) -> None:
        """As ``Moment.begin``."""

    def end(self) -> None:
        """As ``RecordingTrigger.end``."""

    def seen(self, now: float, snapshots: Mapping[str, Snapshot]) -> float | None:
        """As ``RecordingTrigger.seen``: the cycle that saw the edge, as ``ProbeResult.time``; the edge itself was earlier."""
        latched, before = snapshots[self._axis].latched, self._before
        self._before = latched
        return now if before is not None and latched > before else None
