"""asyncua's server within limits: whom it lets in, how many, and what it takes of a connection that does not behave."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from collections.abc import Awaitable, Callable
from typing import Any

from asyncua import ua
from asyncua.common.connection import TransportLimits
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.binary_server_asyncio import BinaryServer, OPCUAProtocol
from asyncua.server.internal_server import InternalServer

from axisbus.gateway.opcua import limits
from axisbus.gateway.opcua.session import PEER, GuardedSession
from axisbus.gateway.opcua.users import Users
from axisbus.guests.rate import Bucket

log = logging.getLogger("axisbus")
_KINDS = (b"HEL", b"OPN", b"MSG", b"CLO", b"ERR")
_HEADER = 8  # octets: kind, chunk, and how long it is


class Tries:
    """How many wrong passwords are left to each address; holds a bucket for each of the last ``limits.ADDRESSES``."""

    def __init__(self) -> None:
        self._buckets: dict[str, Bucket] = {}

    def take(self, address: str, now: float) -> bool:
        """Whether one more may be looked at."""
        bucket = self._buckets.pop(address, None) or Bucket(limits.TRIES, limits.TRIES_AT_ONCE)
        self._buckets[address] = bucket  # the newest is the last
        while len(self._buckets) > limits.ADDRESSES:
            del self._buckets[next(iter(self._buckets))]
        return bucket.take(now)

    def give_back(self, address: str) -> None:
        """The last one was right."""
        bucket = self._buckets.get(address)
        if bucket is not None:
            bucket.left = min(bucket.burst, bucket.left + 1.0)


class Gate:
    """Who a session is, by name and password; holds how many tries are left. It is asyncua's user manager."""

    def __init__(self, users: Users | None, *, anonymous: bool) -> None:
        self._users, self._anonymous = users, anonymous
        self._tries = Tries()

    def get_user(
        self,
        iserver: InternalServer,  # noqa: ARG002  # asyncua's shape
        username: str | None = None,
        password: str | None = None,
        certificate: object = None,  # noqa: ARG002  # asyncua's shape
    ) -> User | None:
        """Return who comes in, None where nobody may.

        Raises:
            ServiceError: too many wrong passwords came from there: each costs the processor 50 ms.
        """
        if username is None:
            return User(role=UserRole.Anonymous) if self._anonymous else None
        if self._users is None or password is None:
            return None
        if not self._tries.take(PEER.get(), time.monotonic()):
            raise ServiceError(ua.StatusCodes.BadTooManyOperations)
        if not self._users.let_in(username, password):
            log.warning("OPC UA: a wrong name or password came from %s", PEER.get())
            return None
        self._tries.give_back(PEER.get())
        return User(role=UserRole.User, name=username)


class GuardedServer(InternalServer):
    """The inner server of asyncua, with ``limits``; ``before`` is awaited before values are read by a client."""

    time_task: asyncio.Task[None] | None

    def __init__(self, gate: Gate, *, encrypted: bool, before: Callable[[], Awaitable[None]]) -> None:
        super().__init__(user_manager=gate)
        self.before_read = before
        self.connections: list[OPCUAProtocol] = []
        self._encrypted = encrypted
        self.allow_remote_admin = False
        self.supported_tokens = (ua.AnonymousIdentityToken, ua.UserNameIdentityToken)
        self.max_session_timeout_ms = limits.SESSION_MS
        self.max_unacked_messages_per_subscription = limits.UNACKNOWLEDGED
        self.max_monitored_item_queue_size = limits.QUEUE
        self.max_pending_messages_per_connection = limits.PENDING
        self.max_connections = limits.CONNECTIONS
        self.max_pending_activation_seconds = limits.PATIENCE
        self.max_lifetime_count = limits.LIFETIME
        self.max_subscriptions = limits.SUBSCRIPTIONS

    def create_session(
        self,
        name: str,
        user: User | None = None,  # noqa: ARG002  # asyncua's shape
        external: bool = False,  # noqa: ARG002  # asyncua's shape
    ) -> GuardedSession:
        """Return a new session of the client whose connection has this name.

        Raises:
            ServiceError: there are too many, or its channel is not as it has to be.
        """
        if self._encrypted and not self.certificate_of(name):
            raise ServiceError(ua.StatusCodes.BadSecurityModeInsufficient)
        for session in list(self._external_sessions.values()):
            if isinstance(session, GuardedSession) and session.is_stale:
                self.unregister_external_session(session)
        if len(self._external_sessions) >= limits.SESSIONS:
            raise ServiceError(ua.StatusCodes.BadTooManySessions)
        made = GuardedSession(self, name, User(role=UserRole.Anonymous))
        made.required = self._encrypted
        return made

    def certificate_of(self, name: str) -> bytes:
        """Return the certificate with which a connection has opened its channel; empty where it is without."""
        found = next((each for each in self.connections if each.peer_name == name), None)
        if found is None or found.processor is None:
            return b""
        return found.processor._connection.security_policy.peer_certificate or b""

    async def stop(self) -> None:
        """End it; its clock, which asyncua waits for, sleeps for up to a second."""
        clock, self.time_task = self.time_task, None
        if clock is not None:
            clock.cancel()
        await super().stop()

    def register_server(self, server: Any, conf: Any = None) -> None:  # noqa: ARG002  # asyncua's shape
        """Refuse it: this is no directory of servers.

        Raises:
            ServiceError: always.
        """
        raise ServiceError(ua.StatusCodes.BadServiceUnsupported)


class GuardedProtocol(OPCUAProtocol):
    """One connection: closed where what comes is no OPC UA, is too long, or nothing that is sent is read."""

    _unread: asyncio.TimerHandle | None = None
    _held = False  # nothing more is taken until what waits is done

    def data_received(self, data: bytes) -> None:
        """Take what has come, where it can be the beginning of a message."""
        super().data_received(data)
        if self.transport is None or self.transport.is_closing():
            return
        if self._is_wrong():
            self.transport.abort()
        elif not self._held and self.messages.qsize() > limits.WAITING:
            self._held = True
            self.transport.pause_reading()

    async def _process_one_msg(self, header: Any, buf: Any) -> bool:
        going: bool = await super()._process_one_msg(header, buf)
        if self._held and self.messages.qsize() <= limits.WAITING // 2 and self.transport is not None:
            self._held = False
            if not self.transport.is_closing():
                self.transport.resume_reading()
        return going

    def _is_wrong(self) -> bool:
        """Whether what is left is no beginning of a message, or the client has too much unread already."""
        assert self.transport is not None
        left = self._buffer
        length = int.from_bytes(left[4:_HEADER], "little") if len(left) >= _HEADER else 0
        kind = bool(left) and not any(each.startswith(left[:3]) for each in _KINDS)
        return kind or length > limits.CHUNK or self.transport.get_write_buffer_size() > limits.UNREAD

    def pause_writing(self) -> None:
        """The client reads too slowly: it may catch up, for a while."""
        loop = asyncio.get_running_loop()
        if self._unread is None and self.transport is not None:
            self._unread = loop.call_later(limits.PATIENCE, self.transport.abort)

    def resume_writing(self) -> None:
        """The client has caught up."""
        if self._unread is not None:
            self._unread.cancel()
            self._unread = None

    def connection_lost(self, ex: BaseException | None) -> None:
        """The connection has ended."""
        self.resume_writing()
        super().connection_lost(ex)


class GuardedListener(BinaryServer):
    """Listens on a socket that is bound already, and makes guarded connections of what comes."""

    def __init__(self, server: GuardedServer, listening: socket.socket) -> None:
        address, port = listening.getsockname()[:2]
        sizes = TransportLimits(
            limits.CHUNK, limits.CHUNK, limits.MESSAGE // limits.CHUNK + 1, limits.MESSAGE
        )
        super().__init__(server, address, port, sizes)
        self._listening = listening
        server.connections = self.clients

    def _make_protocol(self) -> OPCUAProtocol:
        return GuardedProtocol(self.iserver, self._policies, self.clients, self.closing_tasks, self.limits)

    async def start(self) -> None:
        """Begin to listen."""
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(self._make_protocol, sock=self._listening)
        self.cleanup_task = asyncio.create_task(self._close_task_loop())

    async def stop(self) -> None:
        """End every connection, also of who does not read, and listen no more."""
        for client in list(self.clients):
            if client.transport is not None:
                client.transport.abort()
        await super().stop()
