"""The stop of an energised beam that is out of square: both axes stop, and are quick-stopped if they are still skewed at rest."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy

from axisbus.errors import SkewError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.gantry.skew import SkewMonitor
from axisbus.motion.stop.active_stop import StopKind
from axisbus.motion.stop.stop_sequence import AfterStop, StopLevel


class SkewStop:
    """Holds whether both axes are being stopped because of the skew."""

    def __init__(self, axes: Mapping[str, AxisCore], watch: SkewMonitor) -> None:
        self._axes, self._watch = axes, watch
        self._stopping = False

    def stop_both(self, error: SkewError) -> None:
        """Stop both axes along their line if one commands them, otherwise each by its stop sequence."""
        failing = self._watch.failing()
        self._stopping = True
        for core in failing:
            path = core.leading_path
            if path is not None and len(failing) == len(self._axes):
                path.brakes_along = True
            core.break_off(copy(error))

    def let_nothing_pull(self) -> None:
        """Quick-stop both axes when their path is at rest and the beam is still skewed: a jammed side would jump to its target."""
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
                    "the beam is still out of square",
                    None,
                )
