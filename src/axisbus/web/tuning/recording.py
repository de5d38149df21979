"""Record every cycle of one axis during a trial: the core's thread adds samples, the page's thread takes them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from contextlib import suppress

from axisbus.machine.machine import Machine
from axisbus.motion.snapshot import Snapshot
from axisbus.record.columns import NAMES, AxisForm
from axisbus.record.sample_packing import sample_of
from axisbus.web.tuning.step import TuningStepKind
from axisbus.web.tuning.trial import TrialSample

_KEPT = 1 << 16  # the most waiting cycles; beyond that the oldest are dropped, which shows as a gap
_ACTUAL = {kind: NAMES.index(kind.value) for kind in TuningStepKind}
_TARGET, _DEMAND, _ERROR = (NAMES.index(name) for name in ("target", "demand", "following_error"))


class TrialRecording:
    """Hold the cycles of an axis that were not taken yet, from construction until ``end``."""

    def __init__(self, machine: Machine, axis: str, kind: TuningStepKind) -> None:
        self._session = machine.session
        self._axis = axis
        self._actual = _ACTUAL[kind]
        self._form = AxisForm.of(self._session.axes[axis].parameters)
        self._waiting: deque[tuple[float, Snapshot]] = deque(maxlen=_KEPT)
        self._session.observe(self._add)

    def taken(self) -> list[TrialSample]:
        """Return the cycles since the last call, oldest first."""
        found = []
        with suppress(IndexError):
            while True:
                found.append(self._point(*self._waiting.popleft()))
        return found

    def end(self) -> None:
        """Stop recording."""
        self._session.forget(self._add)

    def _add(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        if self._axis in snapshots:
            self._waiting.append((now, snapshots[self._axis]))

    def _point(self, now: float, snapshot: Snapshot) -> TrialSample:
        row = self._form.values(sample_of(snapshot))
        places = (self._actual, _TARGET, _DEMAND, _ERROR)
        return TrialSample(now, snapshot.state, *(_number(row[place]) for place in places))


def _number(value: object) -> float:
    return float(value) if isinstance(value, float | int) else math.nan
