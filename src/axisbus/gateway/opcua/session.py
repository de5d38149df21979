"""The sessions of the server: asyncua's functions, without those that could harm other clients or the server.

Theory of operation
-------------------
asyncua numbers sessions and subscriptions, and trusts any client's numbers. Here a session has an unguessable token, a subscription
belongs to the session that created it, requests are brought within ``limits``, and nothing can be written. The rights of a session
are checked twice: by the rules of its channel (``trust``), and here.
"""

from __future__ import annotations

import asyncio
import math
import secrets
import time
from collections.abc import Callable, Iterable, Sized
from contextvars import ContextVar
from typing import Any

from asyncua import ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.internal_server import InternalServer
from asyncua.server.internal_session import SessionState

from axisbus.gateway.opcua import limits
from axisbus.gateway.opcua.monitoring import Items, MonitoringSession, weight

CALLER: ContextVar[str] = ContextVar("caller", default="")  # the name of the user that calls the method
PEER: ContextVar[str] = ContextVar("peer", default="")  # the address of the client that activates a session


class GuardedSession(MonitoringSession):
    """A session of a client; ``required``: its channel must have a certificate."""

    required = False

    def __init__(self, server: InternalServer, name: str, user: User) -> None:
        super().__init__(server, server.aspace, server.subscription_service, name, user=user, external=True)
        server.unregister_external_session(self)
        self.auth_token = ua.NodeId(secrets.token_bytes(24), 0, ua.NodeIdType.ByteString)
        server.register_external_session(self)

    @property
    def is_stale(self) -> bool:
        """Whether it was created, but not activated in time."""
        return self.state is SessionState.Created and time.monotonic() - self._last_activity > limits.PATIENCE

    def activate_session(
        self, params: ua.ActivateSessionParameters, peer_certificate: bytes | None
    ) -> ua.ActivateSessionResult:
        """Activate the session if its channel meets the requirements."""
        if self.required and not peer_certificate:
            raise ServiceError(ua.StatusCodes.BadSecurityModeInsufficient)
        named = isinstance(params.UserIdentityToken, ua.UserNameIdentityToken)
        if not named and not self.iserver.admits(self, named=False):
            raise ServiceError(ua.StatusCodes.BadTooManySessions)
        token = PEER.set(str(self.name[0]))
        try:
            result = super().activate_session(params, peer_certificate)
        finally:
            PEER.reset(token)
        if named and not self.iserver.admits(self, named=True):
            self.user = User(role=UserRole.Anonymous)
            raise ServiceError(ua.StatusCodes.BadTooManySessions)
        return result

    # -- no writing --------------------------------------------------------------------------------------------------

    async def write(self, params: ua.WriteParameters) -> list[ua.StatusCode]:
        """Refuse to write: all values come from the machine."""
        return [ua.StatusCode(ua.StatusCodes.BadNotWritable) for _ in params.NodesToWrite]

    async def read(self, params: ua.ReadParameters) -> list[ua.DataValue]:
        """Read up-to-date values."""
        _require_at_most(params.NodesToRead, limits.READS)
        await self.iserver.before_read()
        found = await super().read(params)
        if sum(weight(each.Value) for each in found) > limits.ANSWER:
            raise ServiceError(ua.StatusCodes.BadResponseTooLarge)
        return found

    async def browse(self, params: ua.BrowseParameters) -> list[ua.BrowseResult]:
        """Browse nodes, up to the limits of one request."""
        _require_at_most(params.NodesToBrowse, limits.BROWSES)
        found: list[ua.BrowseResult] = []
        references = 0
        for node in params.NodesToBrowse:
            params.NodesToBrowse = [node]
            found += await super().browse(params)
            references += len(found[-1].References)
            if references > limits.REFERENCES:
                raise ServiceError(ua.StatusCodes.BadResponseTooLarge)
        return found

    async def call(self, params: list[ua.CallMethodRequest]) -> list[ua.CallMethodResult]:
        """Call methods, all at the same time; permitted only for users with a name."""
        _require_at_most(params, limits.CALLS)
        if not self.is_named:
            refused = ua.StatusCode(ua.StatusCodes.BadUserAccessDenied)
            return [ua.CallMethodResult(StatusCode=refused) for _ in params]
        token = CALLER.set(str(self.user.name))
        try:
            called = [self._call(each) for each in params]
            return [result for results in await asyncio.gather(*called) for result in results]
        finally:
            CALLER.reset(token)

    async def _call(self, method: ua.CallMethodRequest) -> list[ua.CallMethodResult]:
        return await super().call([method])

    # -- subscriptions of the session --------------------------------------------------------------------------------

    def _require_all_own(self, numbers: Iterable[int]) -> None:
        for number in numbers:
            self._require_own(number)

    async def create_subscription(
        self,
        params: ua.CreateSubscriptionParameters,
        callback: Callable[..., Any],
        request_callback: Callable[..., Any] | None = None,
    ) -> ua.CreateSubscriptionResult:
        """Create a subscription; its interval is limited, so that it does not overload the server, and ends if it is not used."""
        while (sessions := self._over_limit()) is not None:
            disconnected = self.iserver.first_disconnected(sessions)
            if disconnected is None:
                raise ServiceError(ua.StatusCodes.BadTooManySubscriptions)
            await disconnected.close_session(True)
        requested = params.RequestedPublishingInterval
        interval = (
            min(max(requested, limits.FASTEST_MS), limits.SLOWEST_MS)
            if math.isfinite(requested)
            else limits.FASTEST_MS
        )
        params.RequestedPublishingInterval = interval
        created = await super().create_subscription(params, callback, request_callback)
        subscription = self.subscription_service.subscriptions[created.SubscriptionId]
        subscription.turn, subscription.is_named = self.subscription_service.turn, self.is_named
        subscription.monitored_item_srv = Items(subscription, self.aspace)
        return created

    def _over_limit(self) -> list[Any] | None:
        """Return the sessions of unnamed users if these use all permitted subscriptions; None if one more is permitted."""
        if self.is_named:
            return None
        of_address, nameless_sessions = self.iserver.nameless(self.name[0]), self.iserver.nameless()
        if self.iserver.subscriptions_of(of_address) >= limits.OF_ADDRESS.subscriptions:
            return of_address
        return (
            nameless_sessions
            if self.iserver.subscriptions_of(nameless_sessions) >= limits.NAMELESS_SUBSCRIPTIONS
            else None
        )

    def modify_subscription(self, params: ua.ModifySubscriptionParameters) -> ua.ModifySubscriptionResult:
        """As in asyncua, for a subscription of this session."""
        self._require_own(params.SubscriptionId)
        return super().modify_subscription(params)

    async def delete_subscriptions(self, ids: list[int]) -> list[ua.StatusCode]:
        """Delete subscriptions of this session."""
        known = [number for number in ids if self._owns(number)]
        deleted = dict(zip(known, await super().delete_subscriptions(known), strict=True))
        unknown = ua.StatusCode(ua.StatusCodes.BadSubscriptionIdInvalid)
        return [deleted.get(number, unknown) for number in ids]

    async def transfer_subscriptions(
        self, params: ua.TransferSubscriptionsParameters, callback: Callable[..., Any]
    ) -> list[ua.TransferResult]:
        """Transfer subscriptions of this session."""
        self._require_all_own(params.SubscriptionIds)
        return await super().transfer_subscriptions(params, callback)

    async def set_publishing_mode(self, params: ua.SetPublishingModeParameters) -> list[ua.StatusCode]:
        """As in asyncua, for subscriptions of this session."""
        self._require_all_own(params.SubscriptionIds)
        return await super().set_publishing_mode(params)

    def republish(self, params: ua.RepublishParameters) -> ua.NotificationMessage:
        """As in asyncua, for a subscription of this session."""
        self._require_own(params.SubscriptionId)
        return super().republish(params)

    def publish(
        self, acks: Iterable[ua.SubscriptionAcknowledgement] | None = None
    ) -> tuple[int, list[ua.StatusCode]]:
        """Acknowledge notifications of this session's subscriptions."""
        return super().publish([each for each in acks or () if self._owns(each.SubscriptionId)])


def _require_at_most(requested: Sized, limit: int) -> None:
    if len(requested) > limit:
        raise ServiceError(ua.StatusCodes.BadTooManyOperations)
