"""One-time links, and the sessions that they begin."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

_BYTES = 32
_MOST = 64  # links that were not used yet, and sessions


class Role(Enum):
    """What a browser may do; both may halt and stop."""

    OPERATOR = "operator"
    LOOKER = "looker"


@dataclass(frozen=True, slots=True)
class Session:
    """A browser that has come in by a link; ``number`` counts them from 1."""

    number: int
    role: Role


class Entry(Enum):
    """What is wrong with a link."""

    USED = "was used already: it opens one browser, once"
    UNKNOWN = "is none of this server's: it was mistyped, or it is of one that has ended"


class Keys:
    """Links and sessions; holds state: the digests of the links not yet used, of those that were, and of the sessions' cookies."""

    def __init__(self, make: Callable[[], str] = lambda: secrets.token_urlsafe(_BYTES)) -> None:
        """``make`` returns a secret that nobody can guess."""
        self._make = make
        self._links: dict[str, Role] = {}
        self._used: set[str] = set()
        self._sessions: dict[str, Session] = {}
        self._count = 0

    def issue(self, role: Role) -> str:
        """Return the token of a new link; of more than 64 that nobody has used, the oldest is forgotten."""
        token = self._make()
        self._links[_digest(token)] = role
        while len(self._links) > _MOST:
            del self._links[next(iter(self._links))]
        return token

    def enter(self, token: str) -> str | Entry:
        """Use a token up; return the cookie of a new session, or what is wrong with it."""
        digest = _digest(token)
        role = self._links.pop(digest, None)
        if role is None:
            return Entry.USED if digest in self._used else Entry.UNKNOWN
        self._used.add(digest)
        cookie = self._make()
        self._count += 1
        self._sessions[_digest(cookie)] = Session(self._count, role)
        while len(self._sessions) > _MOST:
            del self._sessions[next(iter(self._sessions))]
        return cookie

    def session(self, cookie: str) -> Session | None:
        """Return the session of a cookie, None where there is none."""
        return self._sessions.get(_digest(cookie))


def _digest(secret: str) -> str:
    """Secrets are looked up by their digests: how long that takes tells nothing of them."""
    return hashlib.sha256(secret.encode("utf-8", "surrogateescape")).hexdigest()
