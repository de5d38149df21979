"""Whether our synchronous RPDOs come while a node still takes them: its synchronous window (1007h); pure."""

from __future__ import annotations

from axisbus.cell.model import BusConfig


def misses(window: int | None, bus: BusConfig) -> bool:
    """Whether our RPDOs come after the window (1007h, in µs; 0 or None: there is none) has closed.

    It opens with SYNC (CiA 301 7.5.2.7). The scan sends its RPDOs just before the SYNC at which they take effect, so a whole
    period after the SYNC before; behind another device's SYNC they follow at once.
    """
    return bus.sync and not bus.hears_sync and 0 < (window or 0) < round(bus.scan_period * 1e6)


def closes(window: int | None, bus: BusConfig) -> str:
    """Return in words when the window closes and when the RPDOs come."""
    return (
        f"its window (1007h) closes {window} µs after SYNC, and they come {bus.scan_period * 1e6:.0f} µs after it, "
        "just before the next one"
    )


def remedy(node_id: int) -> str:
    """Return what to write into the cell file."""
    return f'write "1007" = 0 in [nodes.{node_id}.objects]'
