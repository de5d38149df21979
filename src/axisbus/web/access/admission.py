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


AdmissionDecision = PageSession | Entered | AccessRefused


def decide(
    arrival: AdmissionRequest,
    served_origin: ServedOrigin,
    keys: PageSessions,
    sockets: Mapping[int, int],
    max_bytes: int,
) -> AdmissionDecision:
    """Return the session of a request, the cookie for a request with a link, or why it is refused.

    ``sockets`` are the open ones, by the number of the session; a request may have ``max_bytes``. A link is used up by this. A
    request for ``STOP`` is refused only without a cookie or with a wrong host or origin, never because of a limit, an expired
    session, or a session of another origin.
    """
    refused = _of_host(arrival, served_origin) or _of_origin(arrival, served_origin)
    if refused is not None:
        return refused
    if arrival.path == ENTER:
        return _entered(arrival, keys)
    session = next((found for cookie in arrival.cookies if (found := keys.session(cookie))), None)
    if session is None:
        return AccessRefused(_FORBIDDEN, _NEEDS_LINK)
    if arrival.path != STOP and not keys.holds_for(session, arrival.origin):
        return AccessRefused(_FORBIDDEN, _FROM_ELSEWHERE)
    is_valid = keys.renew(session, open_page=bool(sockets.get(session.number)))
    if arrival.path != STOP and not is_valid:
        return AccessRefused(_FORBIDDEN, _LATE)
    if arrival.socket and (too_many := _too_many_sockets(sockets, session)) is not None:
        return too_many
    if arrival.length > max_bytes and arrival.path != STOP:
        return AccessRefused(_TOO_LARGE, f"A request may have at most {counted(max_bytes, 'byte')}.")
    return session


def _too_many_sockets(sockets: Mapping[int, int], session: PageSession) -> AccessRefused | None:
    """Refuse a socket beyond the limit of a browser, and beyond its guaranteed number if all browsers together have too many."""
    of_browser, of_all = sockets.get(session.number, 0), sum(sockets.values())
    if of_browser < SOCKETS_ALWAYS or (of_browser < SOCKETS_OF_BROWSER and of_all < SOCKETS):
        return None
    return AccessRefused(
        _TOO_MANY,
        f"This browser already has {counted(of_browser, 'socket')} open, all browsers together {of_all}."
        " Close a page that is not needed.",
    )


def _of_host(arrival: AdmissionRequest, served_origin: ServedOrigin) -> AccessRefused | None:
    """Refuse a foreign host name that was made to resolve to this server (DNS rebinding)."""
    if len(arrival.hosts) == 1 and arrival.hosts[0].lower() in served_origin.hosts:
        return None
    named = ", ".join(arrival.hosts) or "no host"
    return AccessRefused(
        _WRONG_HOST,
        f"The page is not served for {named[:80]}. It is for {', '.join(sorted(served_origin.hosts))}.",
    )


def _of_origin(arrival: AdmissionRequest, served_origin: ServedOrigin) -> AccessRefused | None:
    """Refuse a foreign origin; only requests that merely read may have none."""
    if not arrival.origins and arrival.method in _READS and not arrival.socket:
        return None
    if len(arrival.origins) == 1 and arrival.origins[0].lower() in served_origin.origins:
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
