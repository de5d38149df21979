"""What becomes of connections to servers of ours."""

from __future__ import annotations

import socket
from contextlib import suppress


def closed(line: socket.socket, within: float) -> bool:
    """Take what comes until the far end has closed a connection; raises TimeoutError where ``within`` seconds bring nothing."""
    line.settimeout(within)
    with suppress(ConnectionResetError):
        while line.recv(65536):
            pass
    return True
