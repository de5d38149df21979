"""Accept the connections of the page, and close some of a flood, so that a new one gets through: it may carry a stop.

Theory of operation
-------------------
This module accepts the connections of the page's server, because asyncio accepts all waiting connections at once, and waits a
minute for a TLS handshake that never starts. Here, each round of the event loop accepts one connection. If there are too many, the
oldest connection of the client with the most is closed; all clients that the gate has not admitted count as one. So a flood closes
only its own connections, and a new connection has as many rounds as the limit of connections to send its request. A connection that
is the socket of a page is not closed: the gate limits these by browser.
"""

from __future__ import annotations

import asyncio
import socket
import ssl
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass

from axisbus.system.process_limits import most_descriptors
from axisbus.web.access.limits import CONNECTIONS

ADMISSION_TIMEOUT = 5.0  # seconds within which the gate must admit a connection, including its TLS handshake
_TLS_CLOSE_TIME = 1.0  # seconds that the far end of an encrypted connection may take to confirm its end
_WAITING = 2048  # connections that may wait in the kernel until they are accepted
_PAUSE = 0.05  # seconds before the next attempt if no descriptor was free
_SHARE = 4  # one of this many descriptors of the process is for these connections

Peer = tuple[str, int]


@dataclass(slots=True)
class Connection:
    """An open connection; ``session`` is the number of its browser once the gate has admitted it.

    ``is_page``: it is the socket of a page.
    """

    line: socket.socket
    session: int | None = None
    is_page: bool = False
    ended: bool = False  # by this module; its protocol notices that in one of the next rounds

    @property
    def is_open(self) -> bool:
        """Whether its descriptor is still open."""
        return self.line.fileno() != -1

    def end(self) -> None:
        """Shut it down, so that its protocol notices the end in any state."""
        self.ended = True
        with suppress(OSError):
            self.line.shutdown(socket.SHUT_RDWR)


class Acceptor:
    """Hold the listening socket and the open connections, in order of arrival."""

    def __init__(self, listening: socket.socket) -> None:
        """``listening`` is bound; nothing is accepted before ``run``."""
        self._listening = listening
        self._open: dict[Peer, Connection] = {}
        self._beginning: set[asyncio.Task[None]] = set()
        self._max_connections = max_connections()

    def note_admission(self, peer: Peer | None, session: int, *, is_page: bool) -> None:
        """Note that the gate has admitted the browser of a session on a connection; ``is_page``: as the socket of a page."""
        connection = None if peer is None else self._open.get((str(peer[0]), int(peer[1])))
        if connection is not None:
            connection.session, connection.is_page = session, is_page

    async def run(self, protocol: Callable[[], asyncio.Protocol], tls: ssl.SSLContext | None) -> None:
        """Accept connections for protocols made by ``protocol``, until cancelled."""
        loop = asyncio.get_running_loop()
        self._listening.setblocking(False)
        self._listening.listen(_WAITING)
        while True:
            try:
                line, address = await loop.sock_accept(self._listening)
            except OSError:  # no descriptor is free, or the connection was closed again
                self._limit_connections(len(self._open))
                await asyncio.sleep(_PAUSE)
                continue
            self._limit_connections(self._max_connections)
            peer = (str(address[0]), int(address[1]))
            connection = self._open[peer] = Connection(line)
            beginning = loop.create_task(_begin(connection, protocol, tls))
            self._beginning.add(beginning)
            beginning.add_done_callback(self._beginning.discard)
            loop.call_later(ADMISSION_TIMEOUT, _close_if_not_admitted, connection)
            await asyncio.sleep(0)  # other tasks run in between, however many connections wait

    def _limit_connections(self, limit: int) -> None:
        """Forget connections that have ended; close one if their number has reached ``limit``."""
        self._open = {peer: each for peer, each in self._open.items() if each.is_open}
        one = connection_to_close(self._open.values(), limit)
        if one is not None:
            one.end()


def max_connections() -> int:
    """Return the highest number of connections, without the sockets of pages: lower if the process may have few descriptors."""
    descriptors = most_descriptors()
    return CONNECTIONS if descriptors is None else min(CONNECTIONS, descriptors // _SHARE)


def connection_to_close(found: Iterable[Connection], limit: int) -> Connection | None:
    """Return the connection, of those given oldest first, to close for one more; None if there are fewer than ``limit``."""
    ending = [each for each in found if not each.is_page and not each.ended]
    if len(ending) < limit or not ending:
        return None
    ((greatest, _),) = Counter(each.session for each in ending).most_common(1)
    return next(each for each in ending if each.session == greatest)


async def _begin(
    connection: Connection, protocol: Callable[[], asyncio.Protocol], tls: ssl.SSLContext | None
) -> None:
    """Let a protocol serve a connection, after the handshake if it is encrypted."""
    line, loop = connection.line, asyncio.get_running_loop()
    try:
        line.setblocking(False)
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if tls is None:
            await loop.connect_accepted_socket(protocol, line)
        else:
            await loop.connect_accepted_socket(
                protocol,
                line,
                ssl=tls,
                ssl_handshake_timeout=ADMISSION_TIMEOUT,
                ssl_shutdown_timeout=_TLS_CLOSE_TIME,
            )
    except OSError:  # includes ssl.SSLError: no handshake, or none in time
        line.close()


def _close_if_not_admitted(connection: Connection) -> None:
    """Close a connection that the gate has not admitted: its client is unknown, or has sent no request."""
    if connection.session is None and connection.is_open:
        connection.end()
