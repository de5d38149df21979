"""Whether our synchronous RPDOs come while a node still takes them: its synchronous window (1007h); pure."""

from __future__ import annotations

from axisbus.cell.model import BusConfig

_FOLLOW = 2000  # µs after SYNC within which the RPDOs of some axes have come, behind the TPDOs that win the bus from them


def misses(window: int | None, bus: BusConfig) -> bool:
    """Whether our RPDOs may come after the window (1007h, in µs; 0 or None: there is none) has closed.

    It opens with SYNC (CiA 301 7.5.2.7), and the scan sends its RPDOs as soon after SYNC as it has computed them.
    """
    return bus.sync and 0 < (window or 0) < _latest(bus)


def closes(window: int | None, bus: BusConfig) -> str:
    """Return in words when the window closes and when the RPDOs come."""
    return (
        f"its window (1007h) closes {window} µs after SYNC, and they may come {_latest(bus)} µs after it, "
        "behind the TPDOs that answer SYNC"
    )


def remedy(node_id: int) -> str:
    """Return what to write into the cell file."""
    return f'write "1007" = 0 in [nodes.{node_id}.objects]'


def _latest(bus: BusConfig) -> int:
    return min(_FOLLOW, round(bus.scan_period * 1e6 / 2))
