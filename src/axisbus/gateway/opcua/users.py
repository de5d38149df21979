"""Names and passwords of the users that may call methods: one line each, with a hash of the password by scrypt."""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from axisbus.errors import ArgumentError, ConfigError

_NAME = re.compile(r"[^\W][\w.@-]{0,63}")
_COST, _BLOCK, _PARALLEL = 1 << 14, 8, 1  # of scrypt (RFC 7914): 16 MiB, some 50 ms
_MAX_COST, _MAX_BLOCK, _MAX_PARALLEL = 1 << 17, 16, 4
_MEMORY = 512 << 20
_SALT, _LENGTH = 16, 32  # bytes
LONGEST = 256  # characters of a password
_FORM = "a line is NAME:scrypt:N:R:P:SALT:HASH, as axisbus bridge opcua-user NAME prints it"


@dataclass(frozen=True, slots=True)
class Secret:
    """The stored form of a password: the parameters of scrypt, a salt and the hash."""

    cost: int
    block: int
    parallel: int
    salt: bytes
    hash: bytes

    def matches(self, password: str) -> bool:
        """Return whether it matches this password; takes the same time for any password."""
        found = _hashed(password, self.cost, self.block, self.parallel, self.salt, len(self.hash))
        return hmac.compare_digest(found, self.hash)


def _hashed(password: str, cost: int, block: int, parallel: int, salt: bytes, length: int) -> bytes:
    text = password.encode("utf-8", "surrogatepass")
    return hashlib.scrypt(text, salt=salt, n=cost, r=block, p=parallel, maxmem=_MEMORY, dklen=length)


def line_of(name: str, password: str, salt: bytes | None = None) -> str:
    """Return the line of a user; ``salt`` is generated if it is not given.

    Raises:
        ArgumentError: the name has characters that are not permitted, or the password is empty or too long.
    """
    if not _NAME.fullmatch(name):
        raise ArgumentError(
            f"{name!r} is not the name of a user",
            remedy="use at most 64 letters, digits and _; after the first character also . @ -",
        )
    if not 0 < len(password) <= LONGEST:
        raise ArgumentError("this is not a password", remedy=f"give 1 to {LONGEST} characters")
    salt = secrets.token_bytes(_SALT) if salt is None else salt
    found = _hashed(password, _COST, _BLOCK, _PARALLEL, salt, _LENGTH)
    return f"{name}:scrypt:{_COST}:{_BLOCK}:{_PARALLEL}:{_text(salt)}:{_text(found)}"


def _text(octets: bytes) -> str:
    return base64.b64encode(octets).decode("ascii")


def _dummy_secret() -> Secret:
    """Return the secret that an unknown name is compared with, so that it takes as long as a known one."""
    return Secret(_COST, _BLOCK, _PARALLEL, secrets.token_bytes(_SALT), secrets.token_bytes(_LENGTH))


@dataclass(frozen=True, slots=True)
class Users:
    """The users that may call methods: their secrets by name."""

    secrets: Mapping[str, Secret] = field(default_factory=dict)
    dummy: Secret = field(default_factory=_dummy_secret)

    def is_correct(self, name: str, password: str) -> bool:
        """Whether name and password belong together. Takes some 50 ms of processor time."""
        known = self.secrets.get(name)
        matches = (known or self.dummy).matches(password[: LONGEST + 1])
        return matches and known is not None


def read(path: Path) -> Users:
    """Read a file of users; empty lines and lines that begin with # are ignored.

    Raises:
        ConfigError: the file cannot be read, a line is invalid, there is no user, or a user is listed twice.
    """
    try:
        text = path.read_text("utf-8")
    except (OSError, ValueError) as error:
        raise ConfigError("the users cannot be read", file=str(path), observed=str(error)) from error
    found: dict[str, Secret] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        name, secret = _read_line(line.strip(), str(path), number)
        if name in found:
            raise ConfigError(f"the user {name} is listed twice", file=str(path), line=number)
        found[name] = secret
    if not found:
        raise ConfigError("the file contains no user", file=str(path), remedy=_FORM)
    return Users(found)


def _read_line(line: str, file: str, number: int) -> tuple[str, Secret]:
    parts = line.split(":")
    try:
        name, kind, *numbers, salt, digest_text = parts
        cost, block, parallel = map(int, numbers)
        secret = Secret(
            cost,
            block,
            parallel,
            base64.b64decode(salt, validate=True),
            base64.b64decode(digest_text, validate=True),
        )
    except (ValueError, binascii.Error):
        raise ConfigError("this line does not define a user", file=file, line=number, remedy=_FORM) from None
    if kind != "scrypt" or not _NAME.fullmatch(name) or not _is_valid(secret):
        raise ConfigError("this line does not define a user", file=file, line=number, remedy=_FORM)
    return name, secret


def _is_valid(secret: Secret) -> bool:
    """Whether scrypt accepts the parameters, and none is so high that a wrong password would overload the server."""
    power = secret.cost >= 2 and secret.cost & (secret.cost - 1) == 0
    small = (
        secret.cost <= _MAX_COST and 1 <= secret.block <= _MAX_BLOCK and 1 <= secret.parallel <= _MAX_PARALLEL
    )
    return power and small and len(secret.salt) >= 8 and 16 <= len(secret.hash) <= 64
