"""Interface to a line for requests and replies, one exchange at a time, and its clock.

Implementations are a serial line, and a simulation for tests.
"""

from __future__ import annotations

from typing import Protocol

from axisbus.drives.gim6010.modbus.requests import ModbusRequest, Reply


class ModbusTimeout(Exception):  # named for what happened; only ``dialogue`` catches it
    """No valid reply arrived in time: none at all, or one with a wrong checksum or length."""


class Wire(Protocol):
    """One line; use it from one thread at a time."""

    timeout: float  # s to wait for a reply

    def exchange(self, device: int, request: ModbusRequest) -> Reply:
        """Send a request to a device (1 to 247) and return its reply; blocks for at most ``timeout``.

        Raises:
            ModbusTimeout: no reply. AdapterError: the line is gone.
        """

    def drain(self, seconds: float) -> None:
        """Wait for ``seconds``, and discard all data received meanwhile."""

    def now(self) -> float:
        """Return the time in s of a monotonic clock."""

    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds``."""

    def close(self) -> None:
        """Release the line; harmless when repeated."""
