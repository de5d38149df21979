"""canopen's network on a channel of ours, for those of its features that we use."""

from __future__ import annotations

from typing import TYPE_CHECKING

import canopen

if TYPE_CHECKING:
    from axisbus.bus.link.channel import Channel


class Network(canopen.Network):
    """canopen's network on our channel: its frames go out paced, and come in from our receive thread."""

    def __init__(self, channel: Channel) -> None:
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
