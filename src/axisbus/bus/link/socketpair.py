"""A CAN line between two processes of one computer: a socket pair with one frame in each packet (its bus: ``socketpair_bus``)."""

from __future__ import annotations

import socket

_ROOM = 1 << 18  # bytes; some thousand frames


def cable() -> tuple[socket.socket, socket.socket]:
    """Return the two ends of a new line."""
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in ends:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _ROOM)
    return ends
