"""Channels: with which certificate a client may open one, and what its sessions may ask for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from asyncua import ua
from asyncua.crypto.permission_rules import ADMIN_TYPES, USER_TYPES, PermissionRuleset, User, UserRole
from asyncua.crypto.security_policies import SecurityPolicyFactory, SecurityPolicyNone

from axisbus.gateway.opcua.trust import Trust, is_in_time

Policy = Any  # asyncua's are a family without types

_WRITES = {ua.ObjectIds.WriteRequest_Encoding_DefaultBinary, ua.ObjectIds.CallRequest_Encoding_DefaultBinary}
_NEVER = {*ADMIN_TYPES, ua.ObjectIds.HistoryReadRequest_Encoding_DefaultBinary}


def _ids(numbers: set[int]) -> frozenset[ua.NodeId]:
    return frozenset(ua.NodeId(number) for number in numbers)


class Rules(PermissionRuleset):
    """What a session may ask for: who has no name reads, browses and subscribes; who has one also calls methods."""

    def __init__(self) -> None:
        named = set(map(int, USER_TYPES)) - set(map(int, _NEVER))
        self._of_role = {
            UserRole.User: _ids(named),
            UserRole.Anonymous: _ids(named - set(map(int, _WRITES))),
        }

    def check_validity(self, user: User, action_type_id: ua.NodeId, body: object) -> bool:  # noqa: ARG002  # asyncua's shape
        """Return whether a request of this kind is one of the user's role."""
        return action_type_id in self._of_role.get(user.role, frozenset())


class _Nothing(PermissionRuleset):
    """The rules of a channel by which a client only finds out how it may come in."""

    def check_validity(self, user: User, action_type_id: ua.NodeId, body: object) -> bool:  # noqa: ARG002  # asyncua's shape
        """Return that nothing is allowed."""
        return False


def refusal(code: int) -> Exception:
    """Return the refusal of a channel: of all errors, this kind alone is told to the client before its connection is closed."""
    error = ua.uaerrors.BadRequestTooLarge()
    error.code = code
    return error


class TrustingFactory:
    """Opens channels of one policy to those whose certificates are trusted, of what asyncua itself does not look at in time."""

    def __init__(self, factory: SecurityPolicyFactory, trust: Trust | None) -> None:
        """``trust`` None: every certificate may open one, since a name and a password are asked for later."""
        self._factory, self._trust = factory, trust

    def matches(self, uri: str, mode: ua.MessageSecurityMode | None = None) -> bool:
        """As asyncua's own."""
        return bool(self._factory.matches(uri, mode))

    def create(self, peer_certificate: bytes | None) -> Policy:
        """Return the policy of one channel.

        Raises:
            BadRequestTooLarge: the certificate is not known here, or is not valid now (see ``refusal``).
        """
        if self._trust is not None and not self._trust.is_known(peer_certificate):
            raise refusal(ua.StatusCodes.BadCertificateUntrusted)
        if not (peer_certificate and is_in_time(peer_certificate)):
            raise refusal(ua.StatusCodes.BadCertificateTimeInvalid)
        return self._factory.create(peer_certificate)


class Discovery:
    """Channels without encryption beside encrypted ones: to ask for the endpoints, and for nothing else."""

    def matches(self, uri: str, mode: ua.MessageSecurityMode | None = None) -> bool:
        """Whether it is asked for."""
        return uri == SecurityPolicyNone.URI and mode in (None, ua.MessageSecurityMode.None_)

    def create(self, peer_certificate: bytes | None) -> Policy:  # noqa: ARG002  # asyncua's shape
        """Return the policy of one channel."""
        return SecurityPolicyNone(permission_ruleset=_Nothing())


class Refusing:
    """Every other policy: it is refused in words that the client understands, not by silence."""

    def matches(self, uri: str, mode: ua.MessageSecurityMode | None = None) -> bool:  # noqa: ARG002  # asyncua's shape
        """Whatever is left."""
        return mode is None

    def create(self, peer_certificate: bytes | None) -> Policy:  # noqa: ARG002  # asyncua's shape
        """Refuse it.

        Raises:
            BadRequestTooLarge: always (see ``refusal``).
        """
        raise refusal(ua.StatusCodes.BadSecurityPolicyRejected)


def guarded(policies: Sequence[SecurityPolicyFactory], encrypted: bool, trust: Trust | None) -> list[Policy]:
    """Return what channels may be opened, of the policies that asyncua offers."""
    if not encrypted:
        return [*policies, Refusing()]
    return [*(TrustingFactory(each, trust) for each in policies), Discovery(), Refusing()]
