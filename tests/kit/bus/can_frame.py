"""A frame as the sockets of Linux carry it, typed off from linux/can.h."""

from __future__ import annotations


def can_frame(can_id: int, data: bytes, length: int | None = None) -> bytes:
    """Return the struct can_frame of an identifier with its flags; ``length``: of a remote frame, which has no data."""
    size = len(data) if length is None else length
    return can_id.to_bytes(4, "little") + bytes((size, 0, 0, 0)) + data.ljust(8, b"\0")
