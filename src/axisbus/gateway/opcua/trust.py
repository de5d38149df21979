"""Certificates: those of trusted clients, from a folder, and the server's own, with its key."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding

from axisbus.errors import ConfigError, StateError

_ENDINGS = (".pem", ".crt", ".cer", ".der")
_UNFIT = (  # errors for an invalid file or certificate; those of cryptography have no common base
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
    except _UNFIT:
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
            "it contains no certificate of a client",
            file=str(folder),
            remedy=f"put them there, each in a file that ends in {', '.join(_ENDINGS)}",
        )
    return Trust(frozenset(_der(path) for path in files))


def _der(path: Path) -> bytes:
    try:
        return _parsed(path.read_bytes()).public_bytes(Encoding.DER)
    except _UNFIT as error:
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
    except _UNFIT as error:
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
