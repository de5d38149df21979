"""Certificates: those of trusted clients, from a folder, and the server's own, with its key."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from asyncua import ua
from asyncua.crypto.permission_rules import ADMIN_TYPES, USER_TYPES, PermissionRuleset, User, UserRole
from asyncua.crypto.security_policies import SecurityPolicyFactory, SecurityPolicyNone
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding

from axisbus.errors import ConfigError, StateError

_ENDINGS = (".pem", ".crt", ".cer", ".der")
_INVALID = (  # errors for an invalid file or certificate; those of cryptography have no common base
    OSError,
    ValueError,
    x509.InvalidVersion,
    x509.ExtensionNotFound,
    x509.DuplicateExtension,
    x509.UnsupportedGeneralNameType,
)


@dataclass(frozen=True, slots=True)
class Trust:
    """The trusted certificates, as octets (DER): each client's own certificate is trusted, not its issuer."""

    known: frozenset[bytes]

    def is_known(self, certificate: bytes | None) -> bool:
        """Whether a certificate (DER) is trusted."""
        return certificate in self.known


def is_in_time(certificate: bytes) -> bool:
    """Whether octets (DER) are a certificate that is valid now."""
    try:
        found = x509.load_der_x509_certificate(certificate)
        return found.not_valid_before_utc <= datetime.now(UTC) <= found.not_valid_after_utc
    except _INVALID:
        return False


def trusted(folder: Path) -> Trust:
    """Read the certificates in a folder: each file that ends in .pem, .crt, .cer or .der.

    Raises:
        ConfigError: there is no certificate, or the folder or one of them cannot be read.
    """
    try:
        files = sorted(path for path in folder.iterdir() if path.suffix.lower() in _ENDINGS)
    except OSError as error:
        raise ConfigError("the folder cannot be read", file=str(folder), observed=str(error)) from error
    if not files:
        raise ConfigError(
            "the folder contains no certificate of a client",
            file=str(folder),
            remedy=f"put the certificates there, each in a file that ends in {', '.join(_ENDINGS)}",
        )
    return Trust(frozenset(_der(path) for path in files))


def _der(path: Path) -> bytes:
    try:
        return _parsed(path.read_bytes()).public_bytes(Encoding.DER)
    except _INVALID as error:
        raise ConfigError("this is not a certificate", file=str(path), observed=str(error)) from error


def _parsed(octets: bytes) -> x509.Certificate:
    pem = octets.lstrip().startswith(b"-----BEGIN")
    return x509.load_pem_x509_certificate(octets) if pem else x509.load_der_x509_certificate(octets)


def uri_of(path: Path) -> str:
    """Return the application URI in the server's certificate; clients compare it with the URI that the server reports.

    Raises:
        StateError: the certificate has none, or cannot be read.
    """
    try:
        certificate = _parsed(path.read_bytes())
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        found = names.get_values_for_type(x509.UniformResourceIdentifier)
    except _INVALID as error:
        raise _no_uri(path, str(error)) from error
    if not found:
        raise _no_uri(path, "its subjectAltName has none")
    return str(found[0])


def _no_uri(path: Path, observed: str) -> StateError:
    return StateError(
        f"{path} cannot be the certificate of an OPC UA server: it has no application URI",
        observed=observed,
        remedy="make one with a URI in its subjectAltName, such as URI:urn:my-computer:axisbus (docs/opcua.md says how)",
    )


# -- Security policies of channels: which certificates may open one, and which requests its sessions may send ----------


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


class _NoPermissions(PermissionRuleset):
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
        return SecurityPolicyNone(permission_ruleset=_NoPermissions())


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
