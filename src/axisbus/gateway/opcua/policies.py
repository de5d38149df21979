"""Security policies of channels: which certificates may open one, and which requests its sessions may send."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from asyncua import ua
from asyncua.crypto.permission_rules import ADMIN_TYPES, USER_TYPES, PermissionRuleset, User, UserRole
from asyncua.crypto.security_policies import SecurityPolicyFactory, SecurityPolicyNone

from axisbus.gateway.opcua.trust import Trust, is_in_time

Policy = Any  # asyncua's policies have no types

_WRITES = {ua.ObjectIds.WriteRequest_Encoding_DefaultBinary, ua.ObjectIds.CallRequest_Encoding_DefaultBinary}
_NEVER = {*ADMIN_TYPES, ua.ObjectIds.HistoryReadRequest_Encoding_DefaultBinary}


def _ids(numbers: set[int]) -> frozenset[ua.NodeId]:
    return frozenset(ua.NodeId(number) for number in numbers)


class Rules(PermissionRuleset):
    """The permitted requests of a session: users without a name read, browse and subscribe; those with a name also call methods."""

    def __init__(self) -> None:
        named = set(map(int, USER_TYPES)) - set(map(int, _NEVER))
        self._of_role = {
            UserRole.User: _ids(named),
            UserRole.Anonymous: _ids(named - set(map(int, _WRITES))),
        }

    def check_validity(self, user: User, action_type_id: ua.NodeId, body: object) -> bool:  # noqa: ARG002  # asyncua's shape
        """Return whether the user's role permits a request of this kind."""
        return action_type_id in self._of_role.get(user.role, frozenset())


class _Nothing(PermissionRuleset):
    """The rules of a channel on which a client can only ask for the endpoints."""

    def check_validity(self, user: User, action_type_id: ua.NodeId, body: object) -> bool:  # noqa: ARG002  # asyncua's shape
        """Return False: no request is permitted."""
        return False


def refusal(code: int) -> Exception:
    """Return the error that refuses a channel: only this error is sent to the client before its connection is closed."""
    error = ua.uaerrors.BadRequestTooLarge()
    error.code = code
    return error


class TrustingFactory:
    """Open channels of one policy for trusted certificates; asyncua itself does not check that in time."""

    def __init__(self, factory: SecurityPolicyFactory, trust: Trust | None) -> None:
        """``trust`` None: any certificate may open a channel, because name and password are required later."""
        self._factory, self._trust = factory, trust

    def matches(self, uri: str, mode: ua.MessageSecurityMode | None = None) -> bool:
        """As in asyncua."""
        return bool(self._factory.matches(uri, mode))

    def create(self, peer_certificate: bytes | None) -> Policy:
        """Return the policy of one channel.

        Raises:
            BadRequestTooLarge: the certificate is not trusted, or is not valid now (see ``refusal``).
        """
        if self._trust is not None and not self._trust.is_known(peer_certificate):
            raise refusal(ua.StatusCodes.BadCertificateUntrusted)
        if not (peer_certificate and is_in_time(peer_certificate)):
            raise refusal(ua.StatusCodes.BadCertificateTimeInvalid)
        return self._factory.create(peer_certificate)


class Discovery:
    """Unencrypted channels beside encrypted ones, only to ask for the endpoints."""

    def matches(self, uri: str, mode: ua.MessageSecurityMode | None = None) -> bool:
        """Whether this policy is requested."""
        return uri == SecurityPolicyNone.URI and mode in (None, ua.MessageSecurityMode.None_)

    def create(self, peer_certificate: bytes | None) -> Policy:  # noqa: ARG002  # asyncua's shape
        """Return the policy of one channel."""
        return SecurityPolicyNone(permission_ruleset=_Nothing())


class Refusing:
    """All other policies: refused with an error that the client understands, instead of silence."""

    def matches(self, uri: str, mode: ua.MessageSecurityMode | None = None) -> bool:  # noqa: ARG002  # asyncua's shape
        """Match all remaining policies, if no security mode is given."""
        return mode is None

    def create(self, peer_certificate: bytes | None) -> Policy:  # noqa: ARG002  # asyncua's shape
        """Refuse the channel.

        Raises:
            BadRequestTooLarge: always (see ``refusal``).
        """
        raise refusal(ua.StatusCodes.BadSecurityPolicyRejected)


def guarded(policies: Sequence[SecurityPolicyFactory], encrypted: bool, trust: Trust | None) -> list[Policy]:
    """Return the permitted channels among the policies that asyncua offers."""
    if not encrypted:
        return [*policies, Refusing()]
    return [*(TrustingFactory(each, trust) for each in policies), Discovery(), Refusing()]
