"""What is known of an input or output in one cycle."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.cia401.port import SignalValidity


class IoReading(NamedTuple):
    """``value`` is raw: of an input as it came at ``stamp``, of an output as it was sent; None where it is not ``known``.

    ``now`` is the cycle's time. ``set``: an output was set by this machine, so that it is led to its safe state at the end.
    """

    now: float
    known: SignalValidity
    value: int | None
    stamp: float
    set: bool = False
