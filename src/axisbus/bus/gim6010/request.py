"""A frame of CAN Simple or CANopen that a dialogue sends: data, or a remote one that asks for them."""

from __future__ import annotations

from typing import Protocol

_LENGTH = 8  # bytes that a remote frame asks for


class RequestFrame(Protocol):
    """A frame to be sent: 11 bits, its data, or a ``remote`` one without."""

    @property
    def can_id(self) -> int:
        """The identifier."""

    @property
    def data(self) -> bytes:
        """Its data."""

    @property
    def remote(self) -> bool:
        """Whether it asks for data instead."""


class Sends(Protocol):
    """Where it goes: a ``Channel``."""

    def send(self, can_id: int, data: bytes) -> None:
        """Send a data frame."""

    def send_remote(self, can_id: int, length: int = 0) -> None:
        """Send a remote frame."""


def send(channel: Sends, request: RequestFrame) -> None:
    """Send it; raises as ``Channel.send``."""
    if request.remote:
        channel.send_remote(request.can_id, _LENGTH)
    else:
        channel.send(request.can_id, request.data)
