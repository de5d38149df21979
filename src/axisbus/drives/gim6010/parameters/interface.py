"""Common interface to a module's parameters: endpoints over CAN and over Modbus, and the object tree on USB.

A written value is in RAM: it takes effect at once, and is lost with the next restart. ``save`` saves RAM to flash and restarts the
module (manual v2.2, 3.1.6). The contents of the flash cannot be read separately; after a restart, RAM and flash are the same.
"""

from __future__ import annotations

from typing import Protocol

from axisbus.drives.gim6010.can_simple.endpoints import Endpoint, EndpointList, Firmware

Value = int | float | bool


class ModuleParameters(Protocol):
    """A module whose parameters can be read and written; it is open, and its list verified.

    ``widest``: the maximum number of bytes of a value over this interface.
    """

    widest: int

    @property
    def listed(self) -> EndpointList:
        """The parameters of its firmware."""

    @property
    def firmware(self) -> Firmware:
        """The firmware version that it reported."""

    @property
    def serial(self) -> int:
        """Its serial number, as far as the interface transfers it: the lowest 32 bits over CAN."""

    def endpoint(self, path: str) -> Endpoint:
        """Return the description of a parameter; its path may begin with ``odrv0.``.

        Raises:
            ArgumentError: it does not exist; the message names similar ones.
        """

    def read(self, path: str) -> Value:
        """Return a parameter's value in RAM; blocks.

        Raises:
            ArgumentError: the list has no such parameter, it is not readable, or the interface cannot transfer it.
            BusError: no answer, or the module restarted or was disconnected meanwhile.
        """

    def write(self, path: str, value: Value, *, by_name: bool = False) -> Value:
        """Write a parameter into RAM, read it back and return the stored value; blocks.

        ``by_name``: the user named this very parameter.

        Raises:
            ArgumentError, LimitError: as ``read``; it is not writable or protected; the value is not of its type.
            StateError: the module is not idle. BusError: as ``read``, or it stores another value than was written.
        """

    @property
    def axis_error(self) -> int:
        """Error word of the axis, 0 if the interface reports none; may block.

        Raises:
            BusError: no answer.
        """

    def clear_errors(self) -> None:
        """Clear its errors, which enables nothing; blocks.

        Raises:
            StateError: it is not idle. BusError: no answer, or the axis's error remains.
        """

    def require_idle(self) -> None:
        """Check that there is no power on its motor; blocks.

        Raises:
            StateError: it is in another state. BusError: its state cannot be read.
        """

    def save_and_leave(self) -> None:
        """Save like ``save``, but do not wait for the restart, for changes after which the module does not return."""

    def save(self) -> None:
        """Save RAM to flash; the module restarts. Blocks until it answers again.

        Raises:
            StateError: it is not idle. BusError: it does not restart, or does not come back.
        """
