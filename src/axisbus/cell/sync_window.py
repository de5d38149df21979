"""Compare a node's objects for SYNC with the scan: the synchronous window (1007h) and the cycle period (1006h); pure."""

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


def has_other_period(period: int | None, bus: BusConfig) -> bool:
    """Whether a node has another cycle period (1006h, in µs; 0 or None: none) than the SYNC of the master.

    CiA 301 7.5.2.6. Some drives time their interpolation by it, or monitor SYNC with it, and then stop with a fault.
    """
    return bus.sync and not bus.hears_sync and bool(period) and period != _scan(bus)


def other_period(period: int | None, bus: BusConfig) -> str:
    """Return both periods, in words."""
    return (
        f"its cycle period (1006h) is {period} µs, and SYNC comes every {_scan(bus)} µs (scan_period); some drives monitor SYNC "
        "by 1006h, or interpolate with it"
    )


def period_remedy(node_id: int, bus: BusConfig) -> str:
    """Return the line for the cell file."""
    return f'write "1006" = {_scan(bus)} in [nodes.{node_id}.objects]'


def _scan(bus: BusConfig) -> int:
    return round(bus.scan_period * 1e6)


def _latest(bus: BusConfig) -> int:
    return min(_FOLLOW, round(bus.scan_period * 1e6 / 2))
