"""A beam that was found out of square while it is driven: both axes are stopped, and nothing pulls once they are at rest."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy

from axisbus.errors import SkewError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.gantry.skew import SkewMonitor
from axisbus.motion.stop.active_stop import StopKind
from axisbus.motion.stop.stop_sequence import AfterStop, StopLevel


class SkewStop:
    """Holds whether both are being stopped because of it."""

    def __init__(self, axes: Mapping[str, AxisCore], watch: SkewMonitor) -> None:
        self._axes, self._watch = axes, watch
        self._stopping = False

    def stop_both(self, error: SkewError) -> None:
        """Stop both along their line, where one leads them, else each by its ladder."""
        failing = self._watch.failing()
        self._stopping = True
        for core in failing:
            path = core.leading_path
            if path is not None and len(failing) == len(self._axes):
                path.brakes_along = True
            core.break_off(copy(error))

    def let_nothing_pull(self) -> None:
        """Quick-stop both once their way is at rest, if the beam is bent still: a side that comes free would leap to its target."""
        if not self._stopping:
            return
        halting = [
            core
            for core in self._axes.values()
            if core.ladder is not None and core.ladder.rung is StopLevel.HALT
        ]
        if halting and any(core.leading_path is not None for core in self._axes.values()):
            return
        self._stopping = False
        if self._watch.skew is not None and abs(self._watch.skew) > self._watch.bound:
            for core in halting:
                core.stop_because(
                    StopKind.ERROR,
                    AfterStop.HOLD,
                    StopLevel.QUICK_STOP,
                    "the beam is out of square still",
                    None,
                )
