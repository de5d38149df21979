"""The origin of a connection: its address and, on this computer, the user of its process.

Theory of operation
-------------------
A browser sends a cookie to every port of a host, also to the web server of another user of this computer, who could then use it.
So a session is valid only for the address and the user that started it. Linux reports the user of a local connection by a netlink
socket (sock_diag(7)); on other systems, and for other computers, only the address is known.
"""

from __future__ import annotations

import ipaddress
import socket
import struct
from dataclasses import dataclass

_SOCK_DIAG, _BY_FAMILY, _REQUEST = (
    4,
    20,
    1,
)  # the netlink protocol, its request type, and the flag of a request
_HEADER = struct.Struct("=IHHII")  # length, type, flags, sequence, port
_QUESTION = struct.Struct("=BBBxI")  # family, protocol, extensions, states
_ENDS = struct.Struct("!HH16s16s")  # ports and addresses: of the client's end, and of the server's end
_REST = struct.pack("=III", 0, 0xFFFFFFFF, 0xFFFFFFFF)  # any interface, and no cookie of the kernel
_FACTS = struct.Struct("=IIIII")  # after four octets and the ends: expires, queues, the user, the file
_BEFORE = _HEADER.size + 4 + _ENDS.size + len(_REST)
_ANY_STATE = 0xFFFFFFFF
_LONGEST = 4096
_FAMILIES = {4: socket.AF_INET, 6: socket.AF_INET6}


@dataclass(frozen=True, slots=True)
class Origin:
    """The address of a client, and the user ID of its process; None if unknown."""

    address: str = ""
    user: int | None = None


NOWHERE = Origin()


def origin_of(client: tuple[str, int] | None, server: tuple[str, int | None] | None) -> Origin:
    """Return the origin of a connection from its two ends; does not block."""
    if client is None:
        return NOWHERE
    if server is None or server[1] is None:
        return Origin(client[0])
    return Origin(client[0], _user_of(client, (server[0], server[1])))


def _user_of(client: tuple[str, int], server: tuple[str, int]) -> int | None:
    try:
        own, far = ipaddress.ip_address(client[0]), ipaddress.ip_address(server[0])
        ends = _ENDS.pack(client[1], server[1], own.packed.ljust(16, b"\0"), far.packed.ljust(16, b"\0"))
        text = _QUESTION.pack(_FAMILIES[own.version], socket.IPPROTO_TCP, 0, _ANY_STATE) + ends + _REST
        with socket.socket(socket.AF_NETLINK, socket.SOCK_DGRAM, _SOCK_DIAG) as line:
            line.setblocking(False)
            line.send(_HEADER.pack(_HEADER.size + len(text), _BY_FAMILY, _REQUEST, 1, 0) + text)
            answer = line.recv(_LONGEST)
    except (AttributeError, OSError, ValueError, struct.error):  # no Linux, or no permission
        return None
    if _HEADER.unpack_from(answer)[1] != _BY_FAMILY or len(answer) < _BEFORE + _FACTS.size:
        return None  # there is no such connection on this computer
    return int(_FACTS.unpack_from(answer, _BEFORE)[3])
