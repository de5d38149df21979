"""The address of the page's server, and the host names by which browsers may request it."""

from __future__ import annotations

import ipaddress
import socket
import ssl
from dataclasses import dataclass
from pathlib import Path

from axisbus.errors import ArgumentError, StateError
from axisbus.web.access.admission import ServedOrigin

ANY, LOOPBACK = "0.0.0.0", "127.0.0.1"
_PORTS = {"http": 80, "https": 443}


@dataclass(frozen=True, slots=True)
class PageAddress:
    """An address with its port, the names by which a browser may request it, and whether it is encrypted."""

    address: str
    port: int
    names: tuple[str, ...]
    tls: bool

    @property
    def served_origin(self) -> ServedOrigin:
        """The hosts and origins that the gate admits."""
        scheme = "https" if self.tls else "http"
        hosts = {f"{name}:{self.port}" for name in self.names}
        if self.port == _PORTS[scheme]:  # a browser omits it
            hosts |= set(self.names)
        return ServedOrigin(scheme, frozenset(hosts))

    @property
    def url(self) -> str:
        """The URL of the page, by its first name."""
        return f"{'https' if self.tls else 'http'}://{self.names[0]}:{self.port}"

    @property
    def cookie(self) -> str:
        """The name of its cookie: browsers distinguish the cookies of one host by name, not by port."""
        return f"axisbus_{self.port}"


def resolved(address: str) -> str:
    """Return an address in numeric form: one address of this computer, because each further one would need its own host name.

    Raises:
        ArgumentError: the address means all addresses.
        StateError: the address cannot be resolved.
    """
    try:
        found = str(socket.getaddrinfo(address or ANY, None, type=socket.SOCK_STREAM)[0][4][0])
    except OSError as error:
        raise StateError(
            f"--listen {address}: no such address", observed=error.strerror or str(error)
        ) from error
    if ipaddress.ip_address(found).is_unspecified:
        raise ArgumentError(
            f"--listen {address} means every address of this computer",
            remedy="give the one address of the page",
        )
    return found


def is_loopback(number: str) -> bool:
    """Whether a numeric address is reachable from this computer only."""
    return ipaddress.ip_address(number).is_loopback


def opened(address: str, port: int, *, tls: bool) -> tuple[socket.socket, PageAddress]:
    """Open the socket of a server; ``port`` 0 takes a free one.

    Raises:
        StateError: the port is taken, or the address does not belong to this computer.
        ArgumentError: as ``resolved``.
    """
    number = resolved(address)
    try:
        listening = socket.create_server(
            (number, port), family=socket.AF_INET6 if ":" in number else socket.AF_INET
        )
    except OSError as error:
        raise StateError(
            f"{address}:{port} cannot be used",
            observed=error.strerror or str(error),
            remedy="give another port: --port N",
        ) from error
    return listening, PageAddress(address, listening.getsockname()[1], _names(address, number), tls)


def require_certificate(certificate: Path, key: Path) -> None:
    """Check that a certificate and its key can be used.

    Raises:
        StateError: they cannot.
    """
    try:
        ssl.create_default_context(ssl.Purpose.CLIENT_AUTH).load_cert_chain(certificate, key)
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
        raise StateError(
            f"{certificate} and {key} cannot be used as a certificate and its key",
            observed=str(error),
            remedy="give two files in PEM, the key without a password",
        ) from error


def _names(address: str, number: str) -> tuple[str, ...]:
    shown = f"[{address}]" if ":" in address else address.lower()
    if is_loopback(number):
        return tuple(dict.fromkeys((shown, "localhost", LOOPBACK, "[::1]")))
    return tuple(dict.fromkeys((shown, socket.gethostname().lower(), socket.getfqdn().lower())))
