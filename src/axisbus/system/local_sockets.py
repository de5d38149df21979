"""Sockets with a path in the file system, between programs of one computer: Linux and macOS; Python has none on Windows."""

from __future__ import annotations

import socket
import sys

from axisbus.errors import PlatformError


def local_socket() -> socket.socket:
    """Return a new stream socket, to be bound or connected to a path.

    Raises:
        PlatformError: on Windows.
    """
    if sys.platform == "win32":
        raise PlatformError(
            "sockets with a path are not available on Windows",
            remedy='leave --control out: drives that a program itself simulates (interface = "sim") need no socket',
        )
    return socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
