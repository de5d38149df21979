"""Observations of connections to our servers."""

from __future__ import annotations

import socket
from contextlib import suppress


def closed(line: socket.socket, within: float) -> bool:
    """Read until the far end has closed a connection; raises TimeoutError if ``within`` seconds pass without data."""
    line.settimeout(within)
    with suppress(ConnectionResetError):
        while line.recv(65536):
            pass
    return True
