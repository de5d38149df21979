"""A batch of samples as bytes: what travels to a page thirty times in a second.

Theory of operation
-------------------
Little-endian: four numbers of 32 bits (which choice of signals it answers, how many samples, how many signals, how many samples are
lost before it), then the times (float64, s), then the values of each signal (float32), one signal after the other; NaN is unknown.
Every cycle is in it: whoever draws finds the highest and the lowest of what falls on one line of the screen.
"""

from __future__ import annotations

import sys
from array import array
from collections.abc import Sequence
from struct import Struct

from axisbus.web.scope.cycles import ScopeCycle
from axisbus.web.scope.signals import SignalReader

HEAD = Struct("<IIII")


def batch(choice: int, cycles: Sequence[ScopeCycle], reader: SignalReader, lost: int) -> bytes:
    """Return some cycles as a page takes them."""
    times = array("d", [cycle.time for cycle in cycles])
    rows = [reader.values(cycle) for cycle in cycles]
    columns = [array("f", column) for column in zip(*rows, strict=True)]
    if sys.byteorder == "big":
        for each in (times, *columns):
            each.byteswap()
    head = HEAD.pack(choice, len(cycles), reader.count, min(lost, 0xFFFF_FFFF))
    return head + times.tobytes() + b"".join(column.tobytes() for column in columns)
