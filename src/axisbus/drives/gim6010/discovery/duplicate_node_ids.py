"""Detects several modules with the same node ID by the heartbeats of one identifier.

Theory of operation. Two modules with the same node ID send heartbeats with one identifier. If the heartbeats contain a life counter
(firmware 0.5.12 and later), the frames are two interleaved counts: each frame is assigned to the count that it continues, or starts
a new one. Without a counter there are two heartbeats in each period, so that short and long intervals alternate. Two modules whose
heartbeats coincide, or are half a period apart, look like one; they are detected by their two answers to one request.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from statistics import median

ENOUGH = 4  # frames of a count
_LOST = 3  # counts from one frame to the next at most, if some were lost
_LIFE, _ROUND = 7, 256
_EVEN = 0.1  # share of the period by which heartbeats of one module may be early or late
_APART = 0.2  # share of the period by which the two intervals must differ


def count_senders(beats: Sequence[tuple[float, bytes]]) -> int:
    """Return the minimum number of modules that sent these heartbeats (time in s, eight bytes each), oldest first."""
    lives = [data[_LIFE] for _, data in beats]
    return max(_counting(lives), _paced([time for time, _ in beats]) if len(set(lives)) == 1 else 1)


def _counting(lives: Sequence[int]) -> int:
    """Return the number of simultaneous counts; a count that ends before another begins is a module that restarted."""
    counts: list[list[int]] = []  # indices into ``lives``
    for place, life in enumerate(lives):
        steps = [((life - lives[each[-1]]) % _ROUND, -each[-1], each) for each in counts]
        fitting = [each for each in steps if 1 <= each[0] <= _LOST]
        if fitting:  # the count with the fewest lost frames, then the most recent one
            min(fitting)[2].append(place)
        else:
            counts.append([place])
    spans = [(each[0], each[-1]) for each in counts if len(each) >= ENOUGH]
    return (
        max((sum(first <= place < last for first, last in spans) for place in range(len(lives))), default=1)
        or 1
    )


def _paced(times: Sequence[float]) -> int:
    """Return 2 if short and long intervals alternate regularly; otherwise 1, also if one module is sometimes late."""
    steps = [after - before for before, after in itertools.pairwise(times)]
    if len(steps) < 2 * ENOUGH:
        return 1
    turns = steps[::2], steps[1::2]
    usual = [median(each) for each in turns]
    period = sum(usual)
    even = all(
        abs(step - length) <= _EVEN * period
        for each, length in zip(turns, usual, strict=True)
        for step in each
    )
    return 2 if even and abs(usual[0] - usual[1]) > _APART * period else 1
