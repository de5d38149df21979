"""asyncua's server within limits: which clients it admits, and how many sessions it permits."""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import logging
import secrets
from collections.abc import Awaitable, Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextvars import ContextVar
from typing import Any

from asyncua import ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.binary_server_asyncio import OPCUAProtocol
from asyncua.server.internal_server import InternalServer

from axisbus.gateway.opcua import limits
from axisbus.gateway.opcua.monitoring import Subscriptions
from axisbus.gateway.opcua.session import PEER, GuardedSession
from axisbus.gateway.opcua.users import Users

log = logging.getLogger("axisbus")
_REPORTED_LIMITS = {  # by their names in OPC 10000-5 6.3.11
    "MaxNodesPerRead": limits.READS,
    "MaxNodesPerBrowse": limits.BROWSES,
    "MaxNodesPerMethodCall": limits.CALLS,
    "MaxNodesPerTranslateBrowsePathsToNodeIds": limits.READS,
    "MaxNodesPerRegisterNodes": limits.READS,
    "MaxMonitoredItemsPerCall": limits.ITEMS,
}


CHECKED: ContextVar[tuple[str, str, bool] | None] = ContextVar(
    "checked", default=None
)  # name, password, whether it is correct


class OpcuaUserManager:
    """Identify users by name and password. It is asyncua's user manager; holds the thread that checks passwords.

    Each check needs 50 ms of processor time. Passwords are checked one after the other, in order of arrival, so that a client with
    wrong ones neither blocks the server nor keeps others out. A correct password is accepted at once when it comes again.
    """

    def __init__(self, users: Users | None, *, anonymous: bool) -> None:
        self._users, self._anonymous = users, anonymous
        self._password_thread = ThreadPoolExecutor(1, "axisbus-opcua-password")
        self._salt = secrets.token_bytes(32)
        self._right: dict[str, bytes] = {}

    async def check(self, username: str, password: str) -> bool:
        """Return whether name and password belong together; a wrong password takes a second longer."""
        if self._users is None:
            return False
        if hmac.compare_digest(self._right.get(username, b""), self._digest(password)):
            return True
        found = await asyncio.get_running_loop().run_in_executor(
            self._password_thread, self._users.is_correct, username, password
        )
        if not found:
            await asyncio.sleep(limits.WRONG)
            return False
        self._right[username] = self._digest(password)
        return True

    def close(self) -> None:
        """End its thread."""
        self._password_thread.shutdown(wait=False, cancel_futures=True)

    def get_user(
        self,
        iserver: InternalServer,  # noqa: ARG002  # asyncua's shape
        username: str | None = None,
        password: str | None = None,
        certificate: object = None,  # noqa: ARG002  # asyncua's shape
    ) -> User | None:
        """Return the user, or None if the client is not admitted; its password has been checked (``CHECKED``)."""
        if username is None:
            return User(role=UserRole.Anonymous) if self._anonymous else None
        if CHECKED.get() != (username, password, True):
            log.warning("OPC UA: a wrong name or password came from %s", PEER.get())
            return None
        return User(role=UserRole.User, name=username)

    def _digest(self, password: str) -> bytes:
        """Return the digest that represents a correct password while this process runs."""
        return hashlib.blake2b(password.encode("utf-8", "surrogatepass"), key=self._salt).digest()


class GuardedServer(InternalServer):
    """The inner server of asyncua, with ``limits``; ``before`` is awaited before a client reads values."""

    time_task: asyncio.Task[None] | None

    def __init__(
        self, gate: OpcuaUserManager, *, encrypted: bool, before: Callable[[], Awaitable[None]]
    ) -> None:
        super().__init__(user_manager=gate)
        self.gate = gate
        self.subscription_service = self.isession.subscription_service = Subscriptions(self.aspace, self)
        self.before_read = before
        self.connections: list[OPCUAProtocol] = []
        self._ending: set[asyncio.Task[None]] = set()
        self._lock, self._nameless_lock = asyncio.Lock(), asyncio.Lock()
        self._encrypted = encrypted
        self.allow_remote_admin = False
        self.supported_tokens = (ua.AnonymousIdentityToken, ua.UserNameIdentityToken)
        self.max_session_timeout_ms = limits.SESSION_MS
        self.max_unacked_messages_per_subscription = limits.UNACKNOWLEDGED
        self.max_monitored_item_queue_size = limits.QUEUE
        self.max_pending_messages_per_connection = limits.PENDING
        self.max_connections = limits.CONNECTIONS
        self.max_pending_activation_seconds = 0.0  # each connection enforces that itself
        self.max_lifetime_count = limits.LIFETIME
        self.max_subscriptions = limits.SUBSCRIPTIONS

    async def setup_nodes(self) -> None:
        """Report the limits of one request to clients, so that they can split their requests."""
        await super().setup_nodes()
        for name, limit in _REPORTED_LIMITS.items():
            node = ua.NodeId(getattr(ua.ObjectIds, f"Server_ServerCapabilities_OperationLimits_{name}"))
            value = ua.DataValue(ua.Variant(limit, ua.VariantType.UInt32))
            await self.aspace.write_attribute_value(node, ua.AttributeIds.Value, value)

    def create_session(
        self,
        name: str,
        user: User | None = None,  # noqa: ARG002  # asyncua's shape
        external: bool = False,  # noqa: ARG002  # asyncua's shape
    ) -> GuardedSession:
        """Return a new session of the client whose connection has this name.

        Raises:
            ServiceError: its channel does not meet the requirements.
        """
        if self._encrypted and not self.certificate_of(name):
            raise ServiceError(ua.StatusCodes.BadSecurityModeInsufficient)
        for session in list(self._external_sessions.values()):
            if isinstance(session, GuardedSession) and session.is_stale:
                self.unregister_external_session(session)
        created = GuardedSession(self, name, User(role=UserRole.Anonymous))
        created.required = self._encrypted
        return created

    async def await_lock(self, *, named: bool) -> None:
        """Wait until a request may be processed: one after the other, and of clients without a name only one waits beside users.

        Between two requests, the methods of users are called, and new clients connect.
        """
        if not named:
            async with self._nameless_lock:
                await self.await_lock(named=True)
            return
        async with self._lock:
            await asyncio.sleep(0)

    def admits(self, session: GuardedSession, *, named: bool) -> bool:
        """Return whether one more client may be admitted, with a name or without: each kind has places of its own.

        If there are too many, the oldest session without a connection ends.
        """
        address = session.name[0]
        group = [
            each
            for each in self._external_sessions.values()
            if each is not session and each.is_activated() and each.is_named is named
        ]
        candidates = group if named else [each for each in group if each.name[0] == address]
        is_full = len(group) >= limits.SESSIONS
        if not is_full and (named or len(candidates) < limits.OF_ADDRESS.sessions):
            return True
        ended = self.first_disconnected(group if is_full else candidates)
        if ended is not None:
            self.unregister_external_session(ended)
            ending = asyncio.get_running_loop().create_task(ended.close_session(True))
            self._ending.add(ending)
            ending.add_done_callback(self._ending.discard)
        return ended is not None

    def first_disconnected(self, sessions: Iterable[Any]) -> Any:
        """Return the first of some sessions that has no connection; None if each has one."""
        connected = {id(each.processor.session) for each in self.connections if each.processor is not None}
        return next((each for each in sessions if id(each) not in connected), None)

    def nameless(self, address: str | None = None) -> list[Any]:
        """Return the sessions of clients without a name, of one address or of all, oldest first."""
        all_sessions = self._external_sessions.values()
        return [each for each in all_sessions if not each.is_named and address in (None, each.name[0])]

    def subscriptions_of(self, sessions: Iterable[Any]) -> int:
        """Return the number of subscriptions of some sessions."""
        session_ids = {each.session_id for each in sessions}
        return sum(
            each.session_id in session_ids for each in self.subscription_service.subscriptions.values()
        )

    def certificate_of(self, name: str) -> bytes:
        """Return the certificate with which a connection opened its channel; empty if it has none."""
        found = next((each for each in self.connections if each.peer_name == name), None)
        if found is None or found.processor is None:
            return b""
        return found.processor._connection.security_policy.peer_certificate or b""

    async def stop(self) -> None:
        """End the server; asyncua waits for its clock, which sleeps for up to a second."""
        clock, self.time_task = self.time_task, None
        if clock is not None:
            clock.cancel()
        self.gate.close()
        await super().stop()

    def register_server(self, server: Any, conf: Any = None) -> None:  # noqa: ARG002  # asyncua's shape
        """Refuse to register a server: this is no discovery server.

        Raises:
            ServiceError: always.
        """
        raise ServiceError(ua.StatusCodes.BadServiceUnsupported)
