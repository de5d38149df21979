"""canopen's network on an axisbus channel, for the canopen features that axisbus uses."""

from __future__ import annotations

from typing import Any, Protocol

import canopen


class NetworkChannel(Protocol):
    """The part of a channel that the network needs."""

    bus: Any  # a python-can bus, or a simulated wire

    def send(self, can_id: int, data: bytes) -> None:
        """Send a data frame."""

    def send_remote(self, can_id: int) -> None:
        """Send a remote frame."""

    def check(self) -> None:
        """Raise the channel's failure, if it has one."""


class CanopenNetwork(canopen.Network):
    """canopen's network on an axisbus channel: it sends through the channel and receives from its receive thread."""

    def __init__(self, channel: NetworkChannel) -> None:
        super().__init__(channel.bus)
        self._channel = channel

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame through the channel.

        Raises:
            AdapterError: it cannot be sent.
        """
        if remote:
            self._channel.send_remote(can_id)
        else:
            self._channel.send(can_id, bytes(data))

    def check(self) -> None:
        """Raise the channel's failure, if it has one."""
        self._channel.check()
