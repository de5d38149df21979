"""A way along which the jerk is limited: how fast corners are, and how far before and behind them that holds.

Theory of operation
-------------------
The place is the mean of those of the last cycles (``travel``). So its speed and its acceleration are means, too, and while it is in
a corner some of what they are made of lies before and behind that. Where the corner's own speed and acceleration hold for as far as
is gone with that speed in the time of the mean, all of it is in there, and the mean keeps to them.

On a curve of curvature k the jerk is (j - k²v³) along the way and (3kva + k'v³) across it, with the speed v, the acceleration a,
and its change j. In a corner a is no more than a small share of what it is on lines, and so is j; v is the highest with which both
parts together are no more than the jerk.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import accumulate, pairwise
from typing import NamedTuple

from axisbus.motion.group.segments import Corner
from axisbus.motion.group.speed_zone import SpeedZone

# Of the acceleration, in corners: more would leave too little of the jerk for the turn, less would make a halt there long.
_SHARE = 0.3
_SAFE = 0.99  # between two of the places that are looked at
_ROUNDS = 40  # of halving
_NEXT = 1e-9  # of the length: as near as stretches may join
# Where the curvature of a corner, and the change of that, are high: its second quarter (the third is the same, backwards).
_PLACES = tuple(0.25 + n / 32 for n in range(9))
_CURVED = tuple((1.0 - math.cos(math.tau * x), math.tau * math.sin(math.tau * x)) for x in _PLACES)


class Soft(NamedTuple):
    """The ``jerk`` (unit/s³), the time of the mean (s), the highest acceleration (unit/s²) on the way, and the highest speed."""

    jerk: float
    seconds: float
    hardest: float
    fastest: float = math.inf


def softened(corner: Corner, parts: Sequence[SpeedZone], soft: Soft) -> list[SpeedZone]:
    """Return the stretches of a corner with what the jerk leaves of speed and acceleration; as one where they are the same."""
    ramp = min(_SHARE * soft.hardest, *(part.ramp for part in parts))
    fastest = _fastest(corner, ramp, soft)
    found = [part._replace(top=min(part.top, fastest), ramp=ramp) for part in parts]
    if len({part.top for part in found}) == 1:
        return [found[0]._replace(length=corner.length)]
    return found


def _fastest(corner: Corner, ramp: float, soft: Soft) -> float:
    """Return the highest speed with which the jerk is kept."""
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
    """Divide stretches so that what corners allow holds for as far as the mean reaches; ``corners``: the numbers of theirs.

    Stretches of a workspace are as corners here: what they allow is another from each to the next.
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
    """Return where stretches join: all ``marks``, and what of the others is on the way and not next to one that is there."""
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
