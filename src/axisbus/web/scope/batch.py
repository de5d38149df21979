"""Encode a batch of samples as bytes; each page gets thirty batches per second.

Theory of operation
-------------------
Little-endian: four 32-bit numbers (number of the signal selection, number of samples, number of signals, number of samples lost
before this batch), then the times (float64, s), then the values of each signal (float32), one signal after the other; NaN is
unknown. The batch has every cycle, so that the page can draw the highest and lowest value of each line of the screen.
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
    """Return some cycles encoded for a page."""
    times = array("d", [cycle.time for cycle in cycles])
    rows = [reader.values(cycle) for cycle in cycles]
    columns = [array("f", column) for column in zip(*rows, strict=True)]
    if sys.byteorder == "big":
        for each in (times, *columns):
            each.byteswap()
    head = HEAD.pack(choice, len(cycles), reader.count, min(lost, 0xFFFF_FFFF))
    return head + times.tobytes() + b"".join(column.tobytes() for column in columns)
