"""The gate before every route and socket of the page: applies ``admission.decide``, and has no rules of its own."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Awaitable, Callable, MutableMapping
from html import escape
from typing import Any, Protocol
from urllib.parse import parse_qs

from axisbus.ipc.rate import Bucket
from axisbus.web.access.admission import AccessRefused, AdmissionRequest, Entered, ServedOrigin, decide
from axisbus.web.access.limits import FOREIGN_MESSAGE, PAGES, PAGES_AT_ONCE, max_bytes
from axisbus.web.access.tokens import NOWHERE, PageSession, PageSessions, origin_of

Message = MutableMapping[str, Any]
Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]


SESSION = "axisbus.session"  # the key of the browser's session in a scope
_POLICY_VIOLATED, _TOO_BIG = 1008, 1009
PAGE = "/"
PAGE_VALUES_SOCKET = "/live"  # limits its rate itself, so that no stop is counted
_TOO_OFTEN = AccessRefused(
    429, "This browser loads the page too often. Wait a few seconds, and load it again."
)
_CLOSE = (b"connection", b"close")
_BODY = "<!doctype html><meta charset=utf-8><title>axisbus</title><p style='font:16px sans-serif;margin:3em'>{}</p>"


class OnAdmission(Protocol):
    """A function that the gate calls with each admitted connection, and the number of its session."""

    def __call__(self, peer: tuple[str, int] | None, session: int, *, is_page: bool) -> None:
        """Note the admission."""


class AccessMiddleware:
    """An ASGI application around another; holds the number of open sockets of each session, and its rate of page loads."""

    def __init__(
        self,
        inner: Application,
        served_origin: ServedOrigin,
        keys: PageSessions,
        cookie: str,
        note_admission: OnAdmission | None = None,
    ) -> None:
        """``cookie`` is the name of the session's cookie."""
        self._inner = inner
        self._served_origin = served_origin
        self._keys = keys
        self._cookie = cookie
        self._note_admission = note_admission
        self._sockets: Counter[int] = Counter()
        self._loads: dict[int, Bucket] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or socket, or refuse it."""
        if scope["type"] == "lifespan":
            await self._inner(scope, receive, send)
            return
        arrival = arrival_of(scope, self._cookie)
        decision = decide(arrival, self._served_origin, self._keys, self._sockets, max_bytes(scope["path"]))
        if isinstance(decision, PageSession) and scope["path"] == PAGE and not self._may_load(decision):
            decision = _TOO_OFTEN
        self._report_admission(scope, decision)
        if isinstance(decision, AccessRefused):
            await _refuse(scope, send, decision)
        elif isinstance(decision, Entered):
            await self._send_cookie(send, decision)
        elif scope["type"] == "websocket":
            await self._socket(scope, receive, send, decision)
        else:
            scope[SESSION] = decision
            await self._inner(scope, _bounded(receive, max_bytes(scope["path"])), _with_headers(send))

    def _may_load(self, session: PageSession) -> bool:
        bucket = self._loads.setdefault(session.number, Bucket(PAGES, PAGES_AT_ONCE))
        return bucket.take(time.monotonic())

    def _report_admission(self, scope: Scope, decision: PageSession | Entered | AccessRefused) -> None:
        session = self._keys.session(decision.cookie) if isinstance(decision, Entered) else decision
        if self._note_admission is not None and isinstance(session, PageSession):
            self._note_admission(scope.get("client"), session.number, is_page=scope["type"] == "websocket")

    async def _send_cookie(self, send: Send, entered: Entered) -> None:
        """Send the cookie, and let the page reload itself: a strict cookie is not sent with a request that another site started."""
        secure = "; Secure" if self._served_origin.scheme == "https" else ""
        cookie = f"{self._cookie}={entered.cookie}; HttpOnly; SameSite=Strict; Path=/{secure}"
        page = "<!doctype html><meta charset=utf-8><title>axisbus</title><meta http-equiv=refresh content='0;url=/'>"
        await _answer(send, 200, page, [(b"set-cookie", cookie.encode())])

    async def _socket(self, scope: Scope, receive: Receive, send: Send, session: PageSession) -> None:
        scope[SESSION] = session
        self._sockets[session.number] += 1
        try:
            watched = receive if scope["path"] == PAGE_VALUES_SOCKET else _watched(receive, send, Bucket())
            await self._inner(scope, watched, send)
        finally:
            self._sockets[session.number] -= 1
            self._keys.renew(session, open_page=True)  # its page was open until now


def arrival_of(scope: Scope, cookie: str) -> AdmissionRequest:
    """Return the headers of a request that decide on its admission, from its ASGI scope."""
    found: dict[str, list[str]] = {}
    for name, value in scope["headers"]:
        found.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))
    query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
    pairs = (pair.strip().partition("=") for line in found.get("cookie", []) for pair in line.split(";"))
    lengths = [int(text) for text in found.get("content-length", []) if text.isdecimal() and text.isascii()]
    cookies = tuple(value for name, _, value in pairs if name == cookie)
    token = query.get("token", [None])[0]
    # Without cookie and token the request is refused anyway: no need to look the origin up.
    origin = origin_of(scope.get("client"), scope.get("server")) if cookies or token else NOWHERE
    return AdmissionRequest(
        method=scope.get("method", "GET"),
        path=scope["path"],
        socket=scope["type"] == "websocket",
        hosts=tuple(found.get("host", [])),
        origins=tuple(found.get("origin", [])),
        cookies=cookies,
        token=token,
        length=max(lengths, default=0),
        origin=origin,
    )


async def _refuse(scope: Scope, send: Send, refused: AccessRefused) -> None:
    if scope["type"] == "websocket":  # not accepted yet: the server answers 403
        await send({"type": "websocket.close", "code": _POLICY_VIOLATED})
    else:
        await _answer(
            send, refused.status, _BODY.format(escape(refused.text)), [_CLOSE] if refused.closes else []
        )


async def _answer(send: Send, status: int, body: str, headers: list[tuple[bytes, bytes]]) -> None:
    shown = secured([*headers, (b"content-type", b"text/html; charset=utf-8")])
    await send({"type": "http.response.start", "status": status, "headers": shown})
    await send({"type": "http.response.body", "body": body.encode()})


def _with_headers(send: Send) -> Send:
    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = secured(list(message.get("headers", [])))
        await send(message)

    return sent


def _bounded(receive: Receive, remaining_bytes: int) -> Receive:
    """Return a ``receive`` that disconnects when a body without a length becomes too long."""

    async def received() -> Message:
        nonlocal remaining_bytes
        message = await receive()
        remaining_bytes -= len(message.get("body", b""))
        return {"type": "http.disconnect"} if remaining_bytes < 0 else message

    return received


def _watched(receive: Receive, send: Send, bucket: Bucket) -> Receive:
    """Return a ``receive`` that closes a socket with too large or too many messages; no stop is sent by such a socket."""

    async def received() -> Message:
        message = await receive()
        if message["type"] != "websocket.receive":
            return message
        size = len(message.get("bytes") or b"") + len(message.get("text") or "")
        if size <= FOREIGN_MESSAGE and bucket.take(time.monotonic()):
            return message
        code = _TOO_BIG if size > FOREIGN_MESSAGE else _POLICY_VIOLATED
        await send({"type": "websocket.close", "code": code})
        return {"type": "websocket.disconnect", "code": code}

    return received


# -- The security headers of every response ----------------------------------------------------------------------------


# Scripts: the page's library inlines its program and compiles templates, so both keywords are needed (docs/decisions/page.md).
# Everything else comes from this server.
_POLICY = {
    "default-src": "'self'",
    "script-src": "'self' 'unsafe-inline' 'unsafe-eval'",
    "style-src": "'self' 'unsafe-inline'",
    "img-src": "'self' data:",
    "font-src": "'self'",
    "connect-src": "'self'",
    "object-src": "'none'",
    "frame-src": "'none'",
    "frame-ancestors": "'none'",
    "base-uri": "'none'",
    "form-action": "'self'",
}
HEADERS = {
    "content-security-policy": "; ".join(f"{name} {value}" for name, value in _POLICY.items()),
    "x-frame-options": "DENY",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=(), usb=(), serial=()",
}


def secured(headers: list[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
    """Return the headers of a response with the security headers, which replace any of the same name."""
    unchanged = [(name, value) for name, value in headers if name.decode("latin-1").lower() not in HEADERS]
    return [*unchanged, *((name.encode(), value.encode()) for name, value in HEADERS.items())]
