"""A stand-in of a simulated cell as its user sees it: look at the plant, turn dials, provoke faults."""

from __future__ import annotations

from contextlib import AbstractContextManager

from axisbus.sim.device import Device
from axisbus.sim.drive import Drive


class StandIn:
    """One simulated node; only there where the cell is simulated. Its methods may be called from any thread."""

    def __init__(self, device: Device, lock: AbstractContextManager[object]) -> None:
        self.device = device
        self.lock = lock

    def drive(self, axis: int = 1) -> Drive:
        """Return the drive of an axis (from 1): its values, and its ``dials`` for misbehaviour."""
        return self.device.drives[axis - 1]

    def fault(self, code: int, maker_bits: int = 0, axis: int = 1) -> None:
        """Let the drive fall into fault with the error code ``code`` (603Fh) and the maker's error bits."""
        with self.lock:
            self.drive(axis).fault(code, maker_bits=maker_bits)
