"""One-time links, and the sessions that they begin."""

from __future__ import annotations

import hashlib
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from axisbus.web.access.origin import NOWHERE, Origin

_BYTES = 32
_MOST = 64  # links that were not used yet, and sessions
LINK_LIVES = 3600.0  # seconds in which a link is to be used
SESSION_LIVES = (
    12 * 3600.0
)  # seconds without a request, and without a socket, after which a browser needs another link


class Role(Enum):
    """What a browser may do; both may halt and stop."""

    OPERATOR = "operator"
    LOOKER = "looker"


@dataclass(frozen=True, slots=True)
class PageSession:
    """A browser that has come in by a link; ``number`` counts them from 1."""

    number: int
    role: Role


class LinkRefusal(Enum):
    """What is wrong with a link."""

    USED = "was used already: it opens one browser, once"
    LATE = "was made more than an hour ago, and holds no longer"
    UNKNOWN = "is none of this server's: it was mistyped, or it is of one that has ended"


class PageSessions:
    """Links and sessions; holds state: the digests of the links not yet used, of those that were, and of the sessions' cookies."""

    def __init__(
        self,
        make: Callable[[], str] = lambda: secrets.token_urlsafe(_BYTES),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """``make`` returns a secret that nobody can guess, ``clock`` the time in seconds."""
        self._make = make
        self._clock = clock
        self._links: dict[str, tuple[Role, float]] = {}
        self._used: set[str] = set()
        self._sessions: dict[str, PageSession] = {}
        self._origins: dict[int, Origin] = {}
        self._seen: dict[int, float] = {}
        self._count = 0

    def issue(self, role: Role) -> str:
        """Return the token of a new link; of more than 64 that nobody has used, the oldest is forgotten."""
        token = self._make()
        self._links[_digest(token)] = role, self._clock()
        while len(self._links) > _MOST:
            del self._links[next(iter(self._links))]
        return token

    def enter(self, token: str, origin: Origin = NOWHERE) -> str | LinkRefusal:
        """Use a token up; return the cookie of a new session, which holds for ``origin``, or the reason why there is none."""
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
        """Return the session of a cookie, None where there is none."""
        return self._sessions.get(_digest(cookie))

    def renew(self, session: PageSession, *, open_page: bool = False) -> bool:
        """Whether a session still holds, as it does while it has an ``open_page``; then it does for another 12 h."""
        seen, now = self._seen.get(session.number), self._clock()
        if seen is None or (now - seen > SESSION_LIVES and not open_page):
            return False
        self._seen[session.number] = now
        return True

    def holds_for(self, session: PageSession, origin: Origin) -> bool:
        """Whether a session was begun from there."""
        return self._origins.get(session.number) == origin


def _digest(secret: str) -> str:
    """Secrets are looked up by their digests: how long that takes tells nothing of them."""
    return hashlib.sha256(secret.encode("utf-8", "surrogateescape")).hexdigest()
