"""The state of an input or output in one cycle."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.cia401.port import SignalValidity


class IoReading(NamedTuple):
    """``value`` is raw: of an input as received at ``stamp``, of an output as sent; None if it is not ``known``.

    ``now`` is the cycle's time. ``set``: this machine has set the output, and sets it to its safe state at the end.
    """

    now: float
    known: SignalValidity
    value: int | None
    stamp: float
    set: bool = False
