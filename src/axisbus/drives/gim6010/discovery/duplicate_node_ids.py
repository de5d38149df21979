"""Whether one identifier's heartbeats come from several modules of one node ID.

Theory of operation. Two modules of one ID beat on one identifier. Where a heartbeat counts (firmware 0.5.12 and later), its frames
then are two counts laid into each other: each frame is given to the count that it continues, and one that continues none begins a
new one. Where it does not count there are two beats in each period, so that a short step and a long one take turns. Two that beat
in the same instant, or half a period apart, look like one; those are found by their answers, of which there are two.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from statistics import median

ENOUGH = 4  # frames of each that make a count
_LOST = 3  # beats from one frame to the next, where some were lost
_LIFE, _ROUND = 7, 256
_EVEN = 0.1  # of the period, by which the beats of one module may be early or late
_APART = 0.2  # of the period, by which the two steps have to differ


def count_senders(beats: Sequence[tuple[float, bytes]]) -> int:
    """Return how many modules at least sent these heartbeats (time in s, eight bytes each), oldest first."""
    lives = [data[_LIFE] for _, data in beats]
    return max(_counting(lives), _paced([time for time, _ in beats]) if len(set(lives)) == 1 else 1)


def _counting(lives: Sequence[int]) -> int:
    """Return how many counts ran at the same time; one that ends before another begins is a module that restarted."""
    counts: list[list[int]] = []  # places in ``lives``
    for place, life in enumerate(lives):
        steps = [((life - lives[each[-1]]) % _ROUND, -each[-1], each) for each in counts]
        fitting = [each for each in steps if 1 <= each[0] <= _LOST]
        if (
            fitting
        ):  # the one that it goes on from with the fewest lost, and of those the one that was heard last
            min(fitting)[2].append(place)
        else:
            counts.append([place])
    spans = [(each[0], each[-1]) for each in counts if len(each) >= ENOUGH]
    return (
        max((sum(first <= place < last for first, last in spans) for place in range(len(lives))), default=1)
        or 1
    )


def _paced(times: Sequence[float]) -> int:
    """Return 2 where a short and a long step take turns, each of its length; 1 also where one beats late now and then."""
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
