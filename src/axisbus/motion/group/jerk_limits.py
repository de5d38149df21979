"""Speed zones of a path with limited jerk: the highest speed in corners, and how far before and after them it applies.

Theory of operation
-------------------
The position is the mean of the positions of the last cycles (``path_speed``). Speed and acceleration are therefore means as well.
While the mean is in a corner, some of its values belong to positions before or after the corner. Therefore the corner's speed and
acceleration also apply before and after it, over the distance covered at that speed in the time of the mean. Then all values comply
with them, and so does the mean.

Let v be the speed, a the acceleration and j its change. On a curve of curvature k the jerk is (j - k²v³) along the path and (3kva +
k'v³) across it. In a corner, a is limited to a small share of its value on lines, and so is j. v is the highest speed at which both
components together do not exceed the jerk.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import accumulate, pairwise
from typing import NamedTuple

from axisbus.motion.group.segments import Corner
from axisbus.motion.group.speed_zone import SpeedZone

# Of the acceleration, in corners: a larger share leaves too little jerk for the turn, a smaller one prolongs a halt in the corner.
_SHARE = 0.3
_SAFE = 0.99  # margin for values between two of the evaluated positions
_ROUNDS = 40  # of bisection
_NEXT = 1e-9  # relative to the length: the smallest distance between two boundaries
# Where the curvature of a corner and its rate of change are high: the second quarter (the third is symmetric).
_PLACES = tuple(0.25 + n / 32 for n in range(9))
_CURVED = tuple((1.0 - math.cos(math.tau * x), math.tau * math.sin(math.tau * x)) for x in _PLACES)


class Soft(NamedTuple):
    """The ``jerk`` (unit/s³), the time of the mean (s), and the highest acceleration (unit/s²) and speed (unit/s) on the path."""

    jerk: float
    seconds: float
    hardest: float
    fastest: float = math.inf


def softened(corner: Corner, parts: Sequence[SpeedZone], soft: Soft) -> list[SpeedZone]:
    """Return the speed zones of a corner with speed and acceleration reduced for the jerk; one zone if all are equal."""
    ramp = min(_SHARE * soft.hardest, *(part.ramp for part in parts))
    fastest = _fastest(corner, ramp, soft)
    found = [part._replace(top=min(part.top, fastest), ramp=ramp) for part in parts]
    if len({part.top for part in found}) == 1:
        return [found[0]._replace(length=corner.length)]
    return found


def _fastest(corner: Corner, ramp: float, soft: Soft) -> float:
    """Return the highest speed in a corner that does not exceed the jerk."""
    jerk, mean = _SAFE * soft.jerk, corner.angle / corner.length
    changes = 2.0 * ramp / soft.seconds
    bends = [(mean * rise, mean * change / corner.length) for rise, change in _CURVED]
    slow, fast = 0.0, math.cbrt(jerk) / mean ** (2.0 / 3.0)
    for _ in range(_ROUNDS):
        v = 0.5 * (slow + fast)
        cube = v * v * v
        kept = all(
            math.hypot(changes + k * k * cube, 3.0 * k * v * ramp + more * cube) <= jerk for k, more in bends
        )
        slow, fast = (v, fast) if kept else (slow, v)
    return slow


def reaching(stretches: Sequence[SpeedZone], corners: Sequence[int], soft: Soft) -> Iterator[SpeedZone]:
    """Divide speed zones so that the limits of corners hold over the distance of the mean; ``corners``: indices of corner zones.

    Speed zones of a path in the workspace are treated like corners, because their limits change from each zone to the next.
    """
    marks = list(accumulate((each.length for each in stretches), initial=0.0))
    gone = [soft.seconds * min(stretches[n].top, soft.fastest) for n in corners]
    spans = [(marks[n] - far, marks[n + 1] + far, stretches[n]) for n, far in zip(corners, gone, strict=True)]
    spans.sort(key=lambda span: span[0])
    edges = _edges(marks, [edge for begin, end, _ in spans for edge in (begin, end)])
    number, coming, near = 0, 0, spans[:0]
    for a, b in pairwise(edges):
        middle = 0.5 * (a + b)
        while marks[number + 1] <= middle:
            number += 1
        while coming < len(spans) and spans[coming][0] <= middle:
            near.append(spans[coming])
            coming += 1
        near = [span for span in near if span[1] > middle]
        here = stretches[number]
        top = min([here.top, *(other.top for _, _, other in near)])
        ramp = min([here.ramp, *(other.ramp for _, _, other in near)])
        yield SpeedZone(here.piece, b - a, top, ramp)


def _edges(marks: Sequence[float], others: Sequence[float]) -> list[float]:
    """Return the zone boundaries: all ``marks``, and those of ``others`` that lie on the path and not next to another boundary."""
    least = _NEXT * marks[-1]
    found, is_mark = [marks[0]], True
    inside = [(edge, False) for edge in others if marks[0] < edge < marks[-1]]
    for edge, marks_it in sorted([*((mark, True) for mark in marks[1:]), *inside]):
        if edge - found[-1] > least or (marks_it and is_mark and edge > found[-1]):
            found.append(edge)
            is_mark = marks_it
        elif marks_it:
            found[-1], is_mark = edge, True
    return found
