"""Check that the master's synchronous RPDOs arrive within a node's synchronous window (1007h); pure."""

from __future__ import annotations

from axisbus.cell.model import BusConfig

_FOLLOW = 2000  # µs after SYNC in which the RPDOs of several axes arrive, after the TPDOs with their higher priority


def misses(window: int | None, bus: BusConfig) -> bool:
    """Whether the master's RPDOs may arrive after the end of the window (1007h, in µs; 0 or None: no window).

    The window begins at SYNC (CiA 301 7.5.2.7), and the scan sends its RPDOs as soon after SYNC as it has computed them.
    """
    return bus.sync and 0 < (window or 0) < _latest(bus)


def closes(window: int | None, bus: BusConfig) -> str:
    """Return the end of the window and the arrival of the RPDOs, in words."""
    return (
        f"its window (1007h) closes {window} µs after SYNC, and they may come {_latest(bus)} µs after it, after the TPDOs "
        "that answer SYNC"
    )


def remedy(node_id: int) -> str:
    """Return the line for the cell file."""
    return f'write "1007" = 0 in [nodes.{node_id}.objects]'


def _latest(bus: BusConfig) -> int:
    return min(_FOLLOW, round(bus.scan_period * 1e6 / 2))
