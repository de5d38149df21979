"""Accepts the connections of the page, and ends those of a crowd, so that a new one gets in: it may bring a stop.

Theory of operation
-------------------
The server of the page gets connections that are accepted here, since asyncio itself accepts all that wait at once, and waits for a
minute for a TLS handshake of which nothing comes. Here one connection is accepted in each round of the event loop. Where there are
too many, the oldest one ends of the client that has most; those who have not been let in by the gate count as one client. So a
crowd only ends connections of its own, and a new connection has as many rounds as there are places to say what it comes for. A
connection that is the socket of a page is left alone: the gate counts these by browser.
"""

from __future__ import annotations

import asyncio
import socket
import ssl
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass

from axisbus.web.access.limits import CONNECTIONS

try:
    import resource
except ImportError:  # Windows, which has no such limit
    resource = None  # type: ignore[assignment]

PATIENCE = 5.0  # seconds until the gate has let a connection in, its TLS handshake included
_FAREWELL = 1.0  # seconds that the far end of an encrypted connection may take to confirm its end
_WAITING = 2048  # connections that wait in the kernel until they are accepted
_PAUSE = 0.05  # seconds after which is tried again what failed for want of descriptors
_SHARE = 4  # of so many descriptors that this process may have, one is for these connections

Peer = tuple[str, int]


@dataclass(slots=True)
class Connection:
    """One that is open; ``session`` is the number of its browser once the gate has let it in, ``kept`` that of a page's socket."""

    line: socket.socket
    session: int | None = None
    kept: bool = False
    ended: bool = False  # by us; its protocol is to see that in one of the next rounds

    @property
    def is_open(self) -> bool:
        """Whether its descriptor has not been closed."""
        return self.line.fileno() != -1

    def end(self) -> None:
        """Let its protocol see its end, in whatever state that is."""
        self.ended = True
        with suppress(OSError):
            self.line.shutdown(socket.SHUT_RDWR)


class Acceptor:
    """Holds the listening socket, and the connections that are open, in the order in which they came."""

    def __init__(self, listening: socket.socket) -> None:
        """``listening`` is bound; nothing is accepted before ``run``."""
        self._listening = listening
        self._open: dict[Peer, Connection] = {}
        self._beginning: set[asyncio.Task[None]] = set()
        self._most = most_connections()

    def let_in(self, peer: Peer | None, session: int, *, kept: bool) -> None:
        """The gate has let the browser of a session in by a connection; ``kept``: as the socket of a page."""
        connection = None if peer is None else self._open.get((str(peer[0]), int(peer[1])))
        if connection is not None:
            connection.session, connection.kept = session, kept

    async def run(self, protocol: Callable[[], asyncio.Protocol], tls: ssl.SSLContext | None) -> None:
        """Accept connections for protocols that are made by ``protocol``, until it is cancelled."""
        loop = asyncio.get_running_loop()
        self._listening.setblocking(False)
        self._listening.listen(_WAITING)
        while True:
            try:
                line, address = await loop.sock_accept(self._listening)
            except OSError:  # no descriptor is left, or it has gone again
                self._make_room(len(self._open))
                await asyncio.sleep(_PAUSE)
                continue
            self._make_room(self._most)
            peer = (str(address[0]), int(address[1]))
            connection = self._open[peer] = Connection(line)
            beginning = loop.create_task(_begin(connection, protocol, tls))
            self._beginning.add(beginning)
            beginning.add_done_callback(self._beginning.discard)
            loop.call_later(PATIENCE, _give_up, connection)
            await asyncio.sleep(0)  # the others have their turn, however many wait

    def _make_room(self, most: int) -> None:
        """Forget connections that have ended; end one where there are as many as there may be."""
        self._open = {peer: each for peer, each in self._open.items() if each.is_open}
        one = one_too_many(self._open.values(), most)
        if one is not None:
            one.end()


def most_connections() -> int:
    """Return how many there may be, but for the sockets of pages: fewer where the process may have few descriptors."""
    if resource is None:
        return CONNECTIONS
    descriptors, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return CONNECTIONS if descriptors == resource.RLIM_INFINITY else min(CONNECTIONS, descriptors // _SHARE)


def one_too_many(found: Iterable[Connection], most: int) -> Connection | None:
    """Return which of the connections, the oldest first, ends where one more comes; None where there are fewer than ``most``."""
    ending = [each for each in found if not each.kept and not each.ended]
    if len(ending) < most or not ending:
        return None
    ((greatest, _),) = Counter(each.session for each in ending).most_common(1)
    return next(each for each in ending if each.session == greatest)


async def _begin(
    connection: Connection, protocol: Callable[[], asyncio.Protocol], tls: ssl.SSLContext | None
) -> None:
    """Let a protocol serve a connection, after its handshake where it is encrypted."""
    line, loop = connection.line, asyncio.get_running_loop()
    try:
        line.setblocking(False)
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if tls is None:
            await loop.connect_accepted_socket(protocol, line)
        else:
            await loop.connect_accepted_socket(
                protocol, line, ssl=tls, ssl_handshake_timeout=PATIENCE, ssl_shutdown_timeout=_FAREWELL
            )
    except OSError:  # ssl.SSLError is one: no handshake, or none in time
        line.close()


def _give_up(connection: Connection) -> None:
    """End it if the gate has not let it in: it is a stranger's, or has sent no request."""
    if connection.session is None and connection.is_open:
        connection.end()
