"""What a way to a module's parameters has to offer: endpoints over CAN and over Modbus, and the tree on USB.

A value that is written is in RAM: it holds at once, and is lost with the next start. ``save`` brings RAM to flash, which restarts
the module (manual v2.2, 3.1.6). What is in flash cannot be read beside RAM; after a restart both are the same.
"""

from __future__ import annotations

from typing import Protocol

from axisbus.drives.gim6010.can_simple.endpoints import Endpoint, EndpointList
from axisbus.drives.gim6010.can_simple.verified_endpoints import Firmware

Value = int | float | bool


class ModuleParameters(Protocol):
    """A module whose parameters can be read and written; opened, and its list shown to fit.

    ``widest``: how many bytes a value may have to travel this way.
    """

    widest: int

    @property
    def listed(self) -> EndpointList:
        """The parameters that its firmware has."""

    @property
    def firmware(self) -> Firmware:
        """The version that it reported."""

    @property
    def serial(self) -> int:
        """Its serial number, or the part of it that this way brings: its lowest 32 bits over CAN."""

    def endpoint(self, path: str) -> Endpoint:
        """Return what its firmware says of a parameter, whose path may begin with ``odrv0.``.

        Raises:
            ArgumentError: there is none; similar ones are named.
        """

    def read(self, path: str) -> Value:
        """Return a parameter's value as it is in RAM; blocks.

        Raises:
            ArgumentError: the list has no such parameter, it is not for reading, or does not travel this way.
            BusError: no answer, or the module restarted or left meanwhile.
        """

    def write(self, path: str, value: Value, *, by_name: bool = False) -> Value:
        """Write a parameter into RAM, read it back and return what it holds; blocks.

        ``by_name``: a person named this very parameter.

        Raises:
            ArgumentError, LimitError: as ``read``; it is not for writing or protected; the value is not of its type.
            StateError: the module is not idle. BusError: as ``read``, or it holds another value than was written.
        """

    @property
    def axis_error(self) -> int:
        """The axis's error word, 0 where nothing tells one; may block.

        Raises:
            BusError: no answer.
        """

    def clear_errors(self) -> None:
        """Clear its errors, which enables nothing; blocks.

        Raises:
            StateError: it is not idle. BusError: no answer, or the axis's error stays.
        """

    def require_idle(self) -> None:
        """Check that there is no power on its motor; blocks.

        Raises:
            StateError: it is in another state. BusError: its state cannot be read.
        """

    def save_and_leave(self) -> None:
        """As ``save``, but only until it restarts, for what it does not come back from."""

    def save(self) -> None:
        """Bring RAM to flash; the module restarts. Blocks until it is back.

        Raises:
            StateError: it is not idle. BusError: it does not restart, or does not come back.
        """
