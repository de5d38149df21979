"""One-time links, and the sessions that they start."""

from __future__ import annotations

import hashlib
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from axisbus.web.access.origin import NOWHERE, Origin

_BYTES = 32
_MOST = 64  # the most unused links, and the most sessions
LINK_LIVES = 3600.0  # seconds for which an unused link is valid
SESSION_LIVES = (
    12 * 3600.0
)  # seconds without a request, and without a socket, after which a browser needs another link


class Role(Enum):
    """The permissions of a browser; both roles may halt and stop."""

    OPERATOR = "operator"
    LOOKER = "looker"


@dataclass(frozen=True, slots=True)
class PageSession:
    """A browser that was admitted by a link; ``number`` counts the sessions from 1."""

    number: int
    role: Role


class LinkRefusal(Enum):
    """Why a link is refused."""

    USED = "has already been used: it opens one browser, once"
    LATE = "was made more than an hour ago, and is no longer valid"
    UNKNOWN = "is not a link of this server: it was mistyped, or it belongs to a server that has ended"


class PageSessions:
    """Links and sessions; holds the digests of unused links, of used links, and of the sessions' cookies."""

    def __init__(
        self,
        make: Callable[[], str] = lambda: secrets.token_urlsafe(_BYTES),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """``make`` returns an unguessable secret, ``clock`` the time in seconds."""
        self._make = make
        self._clock = clock
        self._links: dict[str, tuple[Role, float]] = {}
        self._used: set[str] = set()
        self._sessions: dict[str, PageSession] = {}
        self._origins: dict[int, Origin] = {}
        self._seen: dict[int, float] = {}
        self._count = 0

    def issue(self, role: Role) -> str:
        """Return the token of a new link; if there are more than 64 unused links, the oldest one is dropped."""
        token = self._make()
        self._links[_digest(token)] = role, self._clock()
        while len(self._links) > _MOST:
            del self._links[next(iter(self._links))]
        return token

    def enter(self, token: str, origin: Origin = NOWHERE) -> str | LinkRefusal:
        """Use up a token; return the cookie of a new session, valid for ``origin``, or the reason of the refusal."""
        digest = _digest(token)
        role, made = self._links.pop(digest, (None, 0.0))
        if role is None:
            return LinkRefusal.USED if digest in self._used else LinkRefusal.UNKNOWN
        if self._clock() - made > LINK_LIVES:
            return LinkRefusal.LATE
        self._used.add(digest)
        cookie = self._make()
        self._count += 1
        self._sessions[_digest(cookie)] = PageSession(self._count, role)
        self._origins[self._count] = origin
        self._seen[self._count] = self._clock()
        while len(self._sessions) > _MOST:
            over = self._sessions.pop(next(iter(self._sessions)))
            del self._origins[over.number], self._seen[over.number]
        return cookie

    def session(self, cookie: str) -> PageSession | None:
        """Return the session of a cookie, None if there is none."""
        return self._sessions.get(_digest(cookie))

    def renew(self, session: PageSession, *, open_page: bool = False) -> bool:
        """Return whether a session is valid, and extend it by 12 h if so; with an ``open_page`` it does not expire."""
        seen, now = self._seen.get(session.number), self._clock()
        if seen is None or (now - seen > SESSION_LIVES and not open_page):
            return False
        self._seen[session.number] = now
        return True

    def holds_for(self, session: PageSession, origin: Origin) -> bool:
        """Return whether a session was started from this origin."""
        return self._origins.get(session.number) == origin


def _digest(secret: str) -> str:
    """Return the digest of a secret. Secrets are looked up by digest, so that the duration reveals nothing of them."""
    return hashlib.sha256(secret.encode("utf-8", "surrogateescape")).hexdigest()
