"""Connections of Zenoh that are closed without waiting: one whose far end is cut off holds nobody else up.

Zenoh has the system wait at the close of a TCP connection for up to 10 s until the far end has taken what was sent (SO_LINGER).
Where that one is cut off, a thread of Zenoh's stands still meanwhile, which others need as well: whoever connects is not let in,
and where several are cut off at once nothing of anybody is heard. So it is switched off for each connection as it comes; the
system sends what is left all the same.
"""

from __future__ import annotations

import ipaddress
import logging
import os
import socket
import struct
from contextlib import suppress
from pathlib import Path
from typing import Any

log = logging.getLogger("axisbus")
_FILES = Path("/proc/self/fd")
_OFF = struct.pack("ii", 0, 0)
_PROTOCOLS = frozenset({"tcp", "tls"})


def never_linger(session: Any) -> None:
    """Let no connection of a session wait at its close, be it one that comes later. Only on Linux does a close wait at all."""
    import zenoh

    def changed(event: Any) -> None:
        if event.kind == zenoh.SampleKind.PUT:
            _unlinger(str(event.link.src), str(event.link.dst))

    if _FILES.is_dir():
        session.info.declare_link_events_listener(changed, history=True)


def _unlinger(near: str, far: str) -> None:
    try:
        ends = _end(near), _end(far)
        if None not in ends:
            for file in _FILES.iterdir():
                _switch_off(int(file.name), ends)
    except Exception:  # what calls it is a thread of zenoh's
        log.exception("a connection could not be looked at")


def _switch_off(number: int, ends: tuple[Any, Any]) -> None:
    """Switch it off for an open file that is the connection between two ends."""
    with suppress(OSError), _connection(number) as one:  # it is closed since, no socket, or not connected
        if one.type == socket.SOCK_STREAM and _ends(one) == ends:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _OFF)


def _connection(number: int) -> socket.socket:
    """Return an open file as a socket of its own: the number may be another file's by now, the file stays the one looked at."""
    own = os.dup(number)
    try:
        return socket.socket(fileno=own)
    except OSError:
        os.close(own)
        raise


def _ends(one: socket.socket) -> Any:
    if one.family not in (socket.AF_INET, socket.AF_INET6):
        return None
    return tuple((_address(name[0]), name[1]) for name in (one.getsockname(), one.getpeername()))


def _end(place: str) -> tuple[Any, int] | None:
    """Return the address and the port of an end as Zenoh writes it; None where it is of another kind."""
    protocol, _, rest = place.partition("?")[0].partition("#")[0].partition("/")
    host, _, port = rest.rpartition(":")
    return (_address(host.strip("[]")), int(port)) if protocol in _PROTOCOLS else None


def _address(host: str) -> Any:
    return ipaddress.ip_address(host.partition("%")[0])
