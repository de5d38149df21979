"""A frame of CAN Simple or CANopen that a dialogue sends: a data frame, or a remote frame that requests data."""

from __future__ import annotations

from typing import Protocol

_LENGTH = 8  # bytes that a remote frame requests


class RequestFrame(Protocol):
    """A frame to send: 11-bit identifier and data, or ``remote`` without data."""

    @property
    def can_id(self) -> int:
        """The identifier."""

    @property
    def data(self) -> bytes:
        """The data of a data frame."""

    @property
    def remote(self) -> bool:
        """Whether it is a remote frame."""


class Sends(Protocol):
    """Destination of the frames: a ``Channel``."""

    def send(self, can_id: int, data: bytes) -> None:
        """Send a data frame."""

    def send_remote(self, can_id: int, length: int = 0) -> None:
        """Send a remote frame."""


def send(channel: Sends, request: RequestFrame) -> None:
    """Send the frame; raises as ``Channel.send``."""
    if request.remote:
        channel.send_remote(request.can_id, _LENGTH)
    else:
        channel.send(request.can_id, request.data)
