"""Decide whether to admit a request or a socket: by its host, its origin, and its cookie."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.web.access.limits import SOCKETS, SOCKETS_ALWAYS, SOCKETS_OF_BROWSER
from axisbus.web.access.tokens import NOWHERE, LinkRefusal, Origin, PageSession, PageSessions
from axisbus.wording import counted

ENTER = "/enter"
STOP = "/stop"
_READS = frozenset({"GET", "HEAD"})
_FORBIDDEN, _WRONG_HOST, _TOO_LARGE, _TOO_MANY = 403, 421, 413, 503
_ANOTHER = "An open page (Link) makes another one; so does the terminal in which axisbus web runs: press Enter there."
_NEEDS_LINK = f"This browser was not opened by a link of axisbus web. {_ANOTHER}"

_LATE = f"This browser was away for more than 12 hours: its link is no longer valid. {_ANOTHER}"
_FROM_ELSEWHERE = (
    "This browser was opened from another address, or by another user of this computer: its link is valid only for that one."
    f" {_ANOTHER}"
)


@dataclass(frozen=True, slots=True)
class ServedOrigin:
    """The served address: ``scheme`` http or https, and the permitted hosts, with port."""

    scheme: str
    hosts: frozenset[str]

    @property
    def origins(self) -> frozenset[str]:
        """The origins of the server's own pages."""
        return frozenset(f"{self.scheme}://{host}" for host in self.hosts)


@dataclass(frozen=True, slots=True)
class AdmissionRequest:
    """The headers of a request that decide on its admission; ``hosts`` and ``origins`` are all headers of that name."""

    method: str
    path: str
    socket: bool = False
    hosts: tuple[str, ...] = ()
    origins: tuple[str, ...] = ()
    cookies: tuple[str, ...] = ()
    token: str | None = None
    length: int = 0
    origin: Origin = NOWHERE


@dataclass(frozen=True, slots=True)
class AccessRefused:
    """A refusal: the HTTP status, and the reason for the user of the browser."""

    status: int
    text: str

    @property
    def closes(self) -> bool:
        """Whether the client is unknown, so that its connection is closed."""
        return self.status in (_FORBIDDEN, _WRONG_HOST)


@dataclass(frozen=True, slots=True)
class Entered:
    """Admitted by a link: the cookie for the browser to store."""

    cookie: str


Verdict = PageSession | Entered | AccessRefused


def decide(
    arrival: AdmissionRequest,
    door: ServedOrigin,
    keys: PageSessions,
    sockets: Mapping[int, int],
    most_bytes: int,
) -> Verdict:
    """Return the session of a request, the cookie for a request with a link, or why it is refused.

    ``sockets`` are the open ones, by the number of the session; a request may have ``most_bytes``. A link is used up by this. A
    request for ``STOP`` is refused only without a cookie or with a wrong host or origin, never because of a limit, an expired
    session, or a session of another origin.
    """
    refused = _of_host(arrival, door) or _of_origin(arrival, door)
    if refused is not None:
        return refused
    if arrival.path == ENTER:
        return _entered(arrival, keys)
    session = next((found for cookie in arrival.cookies if (found := keys.session(cookie))), None)
    if session is None:
        return AccessRefused(_FORBIDDEN, _NEEDS_LINK)
    if arrival.path != STOP and not keys.holds_for(session, arrival.origin):
        return AccessRefused(_FORBIDDEN, _FROM_ELSEWHERE)
    holds = keys.renew(session, open_page=bool(sockets.get(session.number)))
    if arrival.path != STOP and not holds:
        return AccessRefused(_FORBIDDEN, _LATE)
    if arrival.socket and (crowded := _crowded(sockets, session)) is not None:
        return crowded
    if arrival.length > most_bytes and arrival.path != STOP:
        return AccessRefused(_TOO_LARGE, f"A request may have at most {counted(most_bytes, 'byte')}.")
    return session


def _crowded(sockets: Mapping[int, int], session: PageSession) -> AccessRefused | None:
    """Refuse a socket beyond the limit of a browser, and beyond its guaranteed number if all browsers together have too many."""
    own, all_of_them = sockets.get(session.number, 0), sum(sockets.values())
    if own < SOCKETS_ALWAYS or (own < SOCKETS_OF_BROWSER and all_of_them < SOCKETS):
        return None
    return AccessRefused(
        _TOO_MANY,
        f"This browser already has {counted(own, 'socket')} open, all browsers together {all_of_them}."
        " Close a page that is not needed.",
    )


def _of_host(arrival: AdmissionRequest, door: ServedOrigin) -> AccessRefused | None:
    """Refuse a foreign host name that was made to resolve to this server (DNS rebinding)."""
    if len(arrival.hosts) == 1 and arrival.hosts[0].lower() in door.hosts:
        return None
    named = ", ".join(arrival.hosts) or "no host"
    return AccessRefused(
        _WRONG_HOST, f"The page is not served for {named[:80]}. It is for {', '.join(sorted(door.hosts))}."
    )


def _of_origin(arrival: AdmissionRequest, door: ServedOrigin) -> AccessRefused | None:
    """Refuse a foreign origin; only requests that merely read may have none."""
    if not arrival.origins and arrival.method in _READS and not arrival.socket:
        return None
    if len(arrival.origins) == 1 and arrival.origins[0].lower() in door.origins:
        return None
    return AccessRefused(
        _FORBIDDEN, "This request comes from a page of another server, or does not name its page."
    )


def _entered(arrival: AdmissionRequest, keys: PageSessions) -> Entered | AccessRefused:
    if arrival.method != "GET" or arrival.socket or not arrival.token:
        return AccessRefused(_FORBIDDEN, _NEEDS_LINK)
    cookie = keys.enter(arrival.token, arrival.origin)
    if isinstance(cookie, LinkRefusal):
        return AccessRefused(_FORBIDDEN, f"This link {cookie.value}. {_ANOTHER}")
    return Entered(cookie)
