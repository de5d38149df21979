"""asyncua's server within limits: whom it lets in, and how many sessions each address may have."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
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
from axisbus.guests.rate import Bucket

log = logging.getLogger("axisbus")
_TOLD = {  # by the names of OPC 10000-5 6.3.11
    "MaxNodesPerRead": limits.READS,
    "MaxNodesPerBrowse": limits.BROWSES,
    "MaxNodesPerMethodCall": limits.CALLS,
    "MaxNodesPerTranslateBrowsePathsToNodeIds": limits.READS,
    "MaxNodesPerRegisterNodes": limits.READS,
    "MaxMonitoredItemsPerCall": limits.ITEMS,
}


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
        self.subscription_service = self.isession.subscription_service = Subscriptions(self.aspace, self)
        self.before_read = before
        self.connections: list[OPCUAProtocol] = []
        self._ending: set[asyncio.Task[None]] = set()
        self._encrypted = encrypted
        self.allow_remote_admin = False
        self.supported_tokens = (ua.AnonymousIdentityToken, ua.UserNameIdentityToken)
        self.max_session_timeout_ms = limits.SESSION_MS
        self.max_unacked_messages_per_subscription = limits.UNACKNOWLEDGED
        self.max_monitored_item_queue_size = limits.QUEUE
        self.max_pending_messages_per_connection = limits.PENDING
        self.max_connections = limits.CONNECTIONS
        self.max_pending_activation_seconds = 0.0  # a connection looks after that itself
        self.max_lifetime_count = limits.LIFETIME
        self.max_subscriptions = limits.SUBSCRIPTIONS

    async def setup_nodes(self) -> None:
        """Tell clients how much they may ask for at once: those that know it ask in parts."""
        await super().setup_nodes()
        for name, most in _TOLD.items():
            node = ua.NodeId(getattr(ua.ObjectIds, f"Server_ServerCapabilities_OperationLimits_{name}"))
            value = ua.DataValue(ua.Variant(most, ua.VariantType.UInt32))
            await self.aspace.write_attribute_value(node, ua.AttributeIds.Value, value)

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
        if not self._has_room(name[0]):
            raise ServiceError(ua.StatusCodes.BadTooManySessions)
        made = GuardedSession(self, name, User(role=UserRole.Anonymous))
        made.required = self._encrypted
        return made

    def _has_room(self, address: str) -> bool:
        """Whether an address may have one more session; where there are too many, the oldest goes whose connection is gone."""
        every = len(self._external_sessions) >= limits.SESSIONS
        theirs = sum(each.name[0] == address for each in self._external_sessions.values())
        if not every and theirs < limits.OF_ADDRESS.sessions:
            return True
        left = self.left_behind(None if every else address)
        if left is not None:
            self.unregister_external_session(left)
            ending = asyncio.get_running_loop().create_task(left.close_session(True))
            self._ending.add(ending)
            ending.add_done_callback(self._ending.discard)
        return left is not None

    def left_behind(self, address: str | None) -> Any:
        """Return the oldest session that no connection has, of an address or (None) of all; None where each has one."""
        held = {id(each.processor.session) for each in self.connections if each.processor is not None}
        return next(
            (
                each
                for each in self._external_sessions.values()
                if id(each) not in held and address in (None, each.name[0])
            ),
            None,
        )

    def subscriptions_of(self, address: str) -> int:
        """Return how many subscriptions the sessions of an address have."""
        theirs = {each.session_id for each in self._external_sessions.values() if each.name[0] == address}
        return sum(each.session_id in theirs for each in self.subscription_service.subscriptions.values())

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
