"""What carries requests and replies: one exchange at a time, and a clock; a serial line is one, arithmetic another."""

from __future__ import annotations

from typing import Protocol

from axisbus.drives.gim6010.modbus.requests import ModbusRequest, Reply


class ModbusTimeout(Exception):  # what happened; nobody but ``dialogue`` sees it
    """No reply that can be read came in time: none at all, or one whose checksum or length is wrong."""


class Wire(Protocol):
    """One line; used by one thread at a time."""

    timeout: float  # s that a reply is waited for

    def exchange(self, device: int, request: ModbusRequest) -> Reply:
        """Send a request to a device (1 to 247) and return its reply; blocks for at most ``timeout``.

        Raises:
            Silence: none came. AdapterError: the line is gone.
        """

    def drain(self, seconds: float) -> None:
        """Let so many seconds pass, and forget whatever comes meanwhile."""

    def now(self) -> float:
        """Return the time in s, of a clock that never goes back."""

    def sleep(self, seconds: float) -> None:
        """Let so many seconds pass."""

    def close(self) -> None:
        """Give the line back; harmless when repeated."""
