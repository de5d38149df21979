"""Close connections of Zenoh without waiting, so that a far end that is cut off does not block other connections.

Zenoh sets SO_LINGER: when it closes a TCP connection, the system waits up to 10 s until the far end has taken the data sent. If the
far end is cut off, a thread of Zenoh that other connections need blocks meanwhile. New connections are not accepted, and if several
far ends are cut off at once, no message of any peer is received. So this module switches lingering off for each new connection. The
system still sends the remaining data.
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
    """Switch lingering off for all present and future connections of a session. Only on Linux does closing wait at all."""
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
    except Exception:  # a thread of zenoh calls this
        log.exception("a connection could not be inspected")


def _switch_off(number: int, ends: tuple[Any, Any]) -> None:
    """Switch lingering off for an open file if it is the connection between these two ends."""
    with suppress(OSError), _connection(number) as one:  # already closed, not a socket, or not connected
        if one.type == socket.SOCK_STREAM and _ends(one) == ends:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _OFF)


def _connection(number: int) -> socket.socket:
    """Return a duplicate of an open file as a socket: the number may be reused for another file, the duplicate stays valid."""
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
    """Return the address and port of an end as Zenoh writes it; None if it has another protocol."""
    protocol, _, rest = place.partition("?")[0].partition("#")[0].partition("/")
    host, _, port = rest.rpartition(":")
    return (_address(host.strip("[]")), int(port)) if protocol in _PROTOCOLS else None


def _address(host: str) -> Any:
    return ipaddress.ip_address(host.partition("%")[0])
