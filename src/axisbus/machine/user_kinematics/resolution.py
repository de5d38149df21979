"""The resolution of a workspace, by the increments of its axes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from axisbus.motion.group.segments import Place


def moved_by(
    forward: Callable[[Place], Sequence[float]],
    joints: Place,
    place: Sequence[float],
    increments: Sequence[float],
) -> float:
    """Return the largest distance by which one increment of one axis moves the tool, if ``joints`` correspond to ``place``."""
    moved = (
        tuple(value + (step if n == axis else 0.0) for n, value in enumerate(joints))
        for axis, step in enumerate(increments)
    )
    return max(math.dist(place, forward(near)) for near in moved)
