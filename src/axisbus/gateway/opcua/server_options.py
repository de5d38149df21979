"""The options of a server: admitted clients and files, available methods, and update rate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from axisbus.errors import ArgumentError
from axisbus.gateway.opcua.methods import OpcuaMethod
from axisbus.gateway.opcua.users import Users


@dataclass(frozen=True, slots=True)
class ServerOptions:
    """The admitted clients, the server's certificate and key, the folder of trusted certificates, and the users."""

    access: Access
    certificate: Path | None = None
    key: Path | None = None
    trust: Path | None = None
    users: Users | None = None
    allow_reset: bool = False
    rate: float = 10.0  # updates per second

    @property
    def verbs(self) -> tuple[OpcuaMethod, ...]:
        """The available methods."""
        return (OpcuaMethod.HALT, OpcuaMethod.STOP, *((OpcuaMethod.RESET,) if self.allow_reset else ()))


# -- Decide which clients the server admits, by its address and its options, and their permissions. Pure ---------------


@dataclass(frozen=True, slots=True)
class Given:
    """The requested options: whether the address is reachable from this computer only, and which files and options were given."""

    loopback: bool
    certificate: bool = False
    trust: bool = False
    users: bool = False
    insecure: bool = False


@dataclass(frozen=True, slots=True)
class Access:
    """The admitted clients: only on an encrypted channel; only with a trusted certificate; without a name; with name and password.

    Admitted clients may read, browse and subscribe. No client may write. Clients with a name may call the available methods.
    """

    encrypted: bool
    trusted: bool
    anonymous: bool
    named: bool


def decide(given: Given) -> Access:
    """Return which clients are admitted.

    Raises:
        ArgumentError: the options contradict each other, or would admit any client that reaches the address.
    """
    _require_consistent(given)
    if not given.certificate:
        return Access(False, False, True, given.users)
    return Access(True, given.trust, given.trust, given.users)


def _require_consistent(given: Given) -> None:
    if not (given.loopback or given.certificate or given.insecure):
        raise ArgumentError(
            "other computers can reach the address",
            remedy="give --certificate, --key and --trust; or --insecure, if the network is trusted and every client may read",
        )
    if given.certificate and not (given.trust or given.users):
        raise ArgumentError(
            "with only a server certificate, every client with a certificate of its own could connect",
            remedy="give --trust (a folder with the certificates of clients), --users (names and passwords), or both",
        )
    if given.trust and not given.certificate:
        raise ArgumentError(
            "certificates of clients are checked only on encrypted channels",
            remedy="give --certificate and --key as well",
        )
    if given.users and not (given.certificate or given.loopback):
        raise ArgumentError(
            "passwords would cross the network unencrypted",
            remedy="give --certificate and --key; or leave --users out; then no client can call methods",
        )
