"""Monitor that a drive stays in the mode of the motion: 6061h, checked while the axis moves."""

from __future__ import annotations

import math

from axisbus.cia402 import modes
from axisbus.cia402.modes import ModeOfOperation
from axisbus.errors import ModeError
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import Activity

_TWICE = 2  # consecutive samples


class ModeWatch:
    """Holds whether the drive has shown the running command's mode, and how many consecutive samples then showed another mode."""

    __slots__ = ("_activity", "_agreed", "_misses", "_mode", "_name", "_stamp")

    def __init__(self, name: str) -> None:
        self._name = name
        self._mode: ModeOfOperation | None = None
        self._watch(None)

    def _watch(self, activity: Activity | None) -> None:
        """Start again, unless ``activity`` continues the present motion in the same mode: it need not request the mode."""
        before = self._mode
        self._activity = activity
        self._mode = None if activity is None else activity.mode
        if activity is not None and self._mode is not None and self._mode == before:
            set_point_source = activity.set_point_source
            if set_point_source is not None and not set_point_source.at_rest:
                return
        self._agreed = False
        self._misses = 0
        self._stamp = -math.inf

    def has_agreed(self, activity: Activity) -> bool:
        """Whether the drive shows the mode of ``activity``, and has done so before; while this is so, ``error`` does nothing."""
        return activity is self._activity and self._agreed and not self._misses

    def error(self, image: AxisImage, activity: Activity | None) -> ModeError | None:
        """Return the error that the drive has left the mode of ``activity`` on its own; None if it has not (as far as is known)."""
        if activity is not self._activity:
            self._watch(activity)
        mode, shown = self._mode, image.mode
        if mode is None or shown is None or image.mode_stamp == self._stamp:
            return None
        if shown == mode and self._agreed and not self._misses:
            return None  # unchanged, so it does not matter whether it answers the last requested mode
        if not image.flight.mode_answered(image.now):
            return None
        self._stamp = image.mode_stamp  # only now: a mode sent on change is evaluated until it counts
        if shown == mode:
            self._agreed, self._misses = True, 0
            return None
        self._misses += self._agreed
        return self._left_mode_error(mode, shown) if self._misses >= _TWICE else None

    def _left_mode_error(self, mode: ModeOfOperation, shown: int) -> ModeError:
        return ModeError(
            f"{self._name}: the drive has left mode {int(mode)} ({modes.short(mode)}) without a command",
            axis=self._name,
            observed=f"6061h shows {shown} ({modes.short(ModeOfOperation(shown))}) during a motion, and this program has not "
            "commanded it",
            remedy="look for a commissioning tool or another master that writes 6060h, and in the drive's manual for causes "
            "of a mode change (a limit, an input, a lost reference); the axis was stopped",
        )
