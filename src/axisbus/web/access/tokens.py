"""One-time links, and the sessions that they start."""

from __future__ import annotations

import hashlib
import ipaddress
import secrets
import socket
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

_BYTES = 32
_MAX_TOKENS = 64  # the most unused links, and the most sessions
LINK_LIVES = 3600.0  # seconds for which an unused link is valid
SESSION_LIVES = (
    12 * 3600.0
)  # seconds without a request, and without a socket, after which a browser needs another link


# -- The origin of a connection: its address and, on this computer, the user of its process ----------------------------
#
# Theory of operation
# A browser sends a cookie to every port of a host, also to the web server of another user of this computer, who could then use it.
# So a session is valid only for the address and the user that started it. Linux reports the user of a local connection by a netlink
# socket (sock_diag(7)); on other systems, and for other computers, only the address is known.


_SOCK_DIAG, _BY_FAMILY, _REQUEST = (
    4,
    20,
    1,
)  # the netlink protocol, its request type, and the flag of a request
_HEADER = struct.Struct("=IHHII")  # length, type, flags, sequence, port
_QUESTION = struct.Struct("=BBBxI")  # family, protocol, extensions, states
_ENDS = struct.Struct("!HH16s16s")  # ports and addresses: of the client's end, and of the server's end
_ANY_INTERFACE = struct.pack("=III", 0, 0xFFFFFFFF, 0xFFFFFFFF)  # any interface, and no cookie of the kernel
_FACTS = struct.Struct("=IIIII")  # after four octets and the ends: expires, queues, the user, the file
_FACTS_OFFSET = _HEADER.size + 4 + _ENDS.size + len(_ANY_INTERFACE)
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
        client_address, server_address = ipaddress.ip_address(client[0]), ipaddress.ip_address(server[0])
        ends = _ENDS.pack(
            client[1],
            server[1],
            client_address.packed.ljust(16, b"\0"),
            server_address.packed.ljust(16, b"\0"),
        )
        text = (
            _QUESTION.pack(_FAMILIES[client_address.version], socket.IPPROTO_TCP, 0, _ANY_STATE)
            + ends
            + _ANY_INTERFACE
        )
        with socket.socket(socket.AF_NETLINK, socket.SOCK_DGRAM, _SOCK_DIAG) as line:
            line.setblocking(False)
            line.send(_HEADER.pack(_HEADER.size + len(text), _BY_FAMILY, _REQUEST, 1, 0) + text)
            answer = line.recv(_LONGEST)
    except (AttributeError, OSError, ValueError, struct.error):  # no Linux, or no permission
        return None
    if _HEADER.unpack_from(answer)[1] != _BY_FAMILY or len(answer) < _FACTS_OFFSET + _FACTS.size:
        return None  # there is no such connection on this computer
    return int(_FACTS.unpack_from(answer, _FACTS_OFFSET)[3])


# -- The tokens and their roles ----------------------------------------------------------------------------------------


class Role(Enum):
    """The permissions of a browser; both roles may halt and stop."""

    OPERATOR = "operator"
    OBSERVER = "looker"


@dataclass(frozen=True, slots=True)
class PageSession:
    """A browser that was admitted by a link; ``number`` counts the sessions from 1."""

    number: int
    role: Role


class LinkRefusal(Enum):
    """Why a link is refused."""

    USED = "has already been used: it admits one browser, once"
    LATE = "was made more than an hour ago, and is no longer valid"
    UNKNOWN = "is not a link of this server: it was mistyped, or it belongs to a server that has ended"


class PageSessions:
    """Links and sessions; holds the digests of unused links, of used links, and of the sessions' cookies."""

    def __init__(
        self,
        make: Callable[[], str] = lambda: secrets.token_urlsafe(_BYTES),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """``make`` returns an unguessable secret, ``clock`` the time in seconds."""
        self._make = make
        self._clock = clock
        self._links: dict[str, tuple[Role, float]] = {}
        self._used: set[str] = set()
        self._sessions: dict[str, PageSession] = {}
        self._origins: dict[int, Origin] = {}
        self._last_seen: dict[int, float] = {}
        self._count = 0

    def issue(self, role: Role) -> str:
        """Return the token of a new link; if there are more than 64 unused links, the oldest one is dropped."""
        token = self._make()
        self._links[_digest(token)] = role, self._clock()
        while len(self._links) > _MAX_TOKENS:
            del self._links[next(iter(self._links))]
        return token

    def enter(self, token: str, origin: Origin = NOWHERE) -> str | LinkRefusal:
        """Use up a token; return the cookie of a new session, valid for ``origin``, or the reason of the refusal."""
        digest = _digest(token)
        role, made_at = self._links.pop(digest, (None, 0.0))
        if role is None:
            return LinkRefusal.USED if digest in self._used else LinkRefusal.UNKNOWN
        if self._clock() - made_at > LINK_LIVES:
            return LinkRefusal.LATE
        self._used.add(digest)
        cookie = self._make()
        self._count += 1
        self._sessions[_digest(cookie)] = PageSession(self._count, role)
        self._origins[self._count] = origin
        self._last_seen[self._count] = self._clock()
        while len(self._sessions) > _MAX_TOKENS:
            oldest = self._sessions.pop(next(iter(self._sessions)))
            del self._origins[oldest.number], self._last_seen[oldest.number]
        return cookie

    def session(self, cookie: str) -> PageSession | None:
        """Return the session of a cookie, None if there is none."""
        return self._sessions.get(_digest(cookie))

    def renew(self, session: PageSession, *, open_page: bool = False) -> bool:
        """Return whether a session is valid, and extend it by 12 h if so; with an ``open_page`` it does not expire."""
        last_seen, now = self._last_seen.get(session.number), self._clock()
        if last_seen is None or (now - last_seen > SESSION_LIVES and not open_page):
            return False
        self._last_seen[session.number] = now
        return True

    def holds_for(self, session: PageSession, origin: Origin) -> bool:
        """Return whether a session was started from this origin."""
        return self._origins.get(session.number) == origin


def _digest(secret: str) -> str:
    """Return the digest of a secret. Secrets are looked up by digest, so that the duration reveals nothing of them."""
    return hashlib.sha256(secret.encode("utf-8", "surrogateescape")).hexdigest()
