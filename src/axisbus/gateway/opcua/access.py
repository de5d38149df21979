"""Who may come in, by where the server listens and what it was given; and who may do what. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.errors import ArgumentError


@dataclass(frozen=True, slots=True)
class Given:
    """What was asked for: whether the address is reached from this computer alone, and which files and options were given."""

    loopback: bool
    certificate: bool = False
    trust: bool = False
    users: bool = False
    insecure: bool = False


@dataclass(frozen=True, slots=True)
class Access:
    """Who may come in: only by an encrypted channel; only with a certificate that is trusted; without a name; with name and
    password.

    Who has come in may read, browse and subscribe. Nobody writes. Who has a name may call the methods that are there.
    """

    encrypted: bool
    trusted: bool
    anonymous: bool
    named: bool


def decide(given: Given) -> Access:
    """Return who may come in.

    Raises:
        ArgumentError: what was given does not go together, or would let in whoever reaches the address.
    """
    _require_sense(given)
    if not given.certificate:
        return Access(False, False, True, given.users)
    return Access(True, given.trust, given.trust, given.users)


def _require_sense(given: Given) -> None:
    if not (given.loopback or given.certificate or given.insecure):
        raise ArgumentError(
            "the address can be reached by others",
            remedy="give --certificate, --key and --trust; or --insecure, where the network is trusted and everybody may read",
        )
    if given.certificate and not (given.trust or given.users):
        raise ArgumentError(
            "with a certificate alone, whoever has one of his own could come in",
            remedy="give --trust (a folder with the certificates of clients), --users (names and passwords), or both",
        )
    if given.trust and not given.certificate:
        raise ArgumentError(
            "certificates of clients are known on encrypted channels only",
            remedy="give --certificate and --key as well",
        )
    if given.users and not (given.certificate or given.loopback):
        raise ArgumentError(
            "passwords would cross the network for all to read",
            remedy="give --certificate and --key; or leave --users out, and nobody calls methods",
        )
