"""Access: wrong and used tokens, foreign origins, rebound hosts, roles, limits, and the headers of every answer."""

from __future__ import annotations

import asyncio
import dataclasses
import itertools
import os
import sys
import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.ipc.rate import Bucket
from axisbus.web.access import limits
from axisbus.web.access.admission import AccessRefused, AdmissionRequest, Entered, ServedOrigin, decide
from axisbus.web.access.limits import FOREIGN_MESSAGE, SOCKETS, SOCKETS_ALWAYS, SOCKETS_OF_BROWSER
from axisbus.web.access.middleware import SESSION, AccessMiddleware, arrival_of
from axisbus.web.access.tokens import LinkRefusal, Origin, PageSession, PageSessions, Role, origin_of

HOST, ORIGIN = "127.0.0.1:8402", "http://127.0.0.1:8402"
DOOR = ServedOrigin("http", frozenset({HOST, "localhost:8402"}))


def keys_with(role: Role = Role.OPERATOR) -> tuple[PageSessions, str]:
    keys = PageSessions()
    cookie = keys.enter(keys.issue(role))
    assert isinstance(cookie, str)
    return keys, cookie


def judged(keys: PageSessions, arrival: AdmissionRequest, *sockets: int) -> Any:
    """``sockets``: how many each session has open, from the first one on."""
    return decide(arrival, DOOR, keys, dict(enumerate(sockets, 1)), FOREIGN_MESSAGE)


def get(path: str = "/", **more: Any) -> AdmissionRequest:
    return dataclasses.replace(AdmissionRequest("GET", path, hosts=(HOST,)), **more)


def socket(**more: Any) -> AdmissionRequest:
    return get("/live", socket=True, origins=(ORIGIN,), **more)


# -- connections ------------------------------------------------------------------------------------------------------


def test_a_stranger_keeps_no_connection_open():
    pytest.importorskip("uvicorn", reason="the server of the page is uvicorn")
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {"type": "http", "path": "/", "headers": [(b"host", b"evil.example")]}
    asyncio.run(AccessMiddleware(None, DOOR, PageSessions(), "c")(scope, None, send))
    assert (b"connection", b"close") in sent[0]["headers"]


# -- links ------------------------------------------------------------------------------------------------------------


def test_a_link_opens_one_browser_once():
    keys = PageSessions()
    token = keys.issue(Role.OPERATOR)
    entered = judged(keys, get("/enter", token=token))
    assert isinstance(entered, Entered)
    assert judged(keys, get(cookies=(entered.cookie,))) == PageSession(1, Role.OPERATOR)
    again = judged(keys, get("/enter", token=token))
    assert again.status == 403
    assert "already been used" in again.text
    assert "press enter" in again.text.lower()


@pytest.mark.parametrize("token", [None, "", "x", "a" * 5000, "\udcff"])
def test_a_wrong_token_opens_nothing(token):
    keys = PageSessions()
    keys.issue(Role.OPERATOR)
    assert judged(keys, get("/enter", token=token)).status == 403


def test_a_token_is_no_cookie_and_a_cookie_no_token():
    keys = PageSessions()
    token = keys.issue(Role.OPERATOR)
    assert judged(keys, get(cookies=(token,))).status == 403
    cookie = keys.enter(token)
    assert keys.enter(cookie) is LinkRefusal.UNKNOWN


@pytest.mark.parametrize("method", ["HEAD", "POST", "OPTIONS"])
def test_a_request_that_only_previews_a_link_does_not_consume_it(method):
    keys = PageSessions()
    token = keys.issue(Role.OPERATOR)
    assert isinstance(
        judged(keys, get("/enter", token=token, method=method, origins=(ORIGIN,))), AccessRefused
    )
    assert isinstance(judged(keys, get("/enter", token=token)), Entered)


def test_a_foreign_page_does_not_use_a_link_up():
    keys = PageSessions()
    token = keys.issue(Role.OPERATOR)
    assert judged(keys, get("/enter", token=token, origins=("http://evil.example",))).status == 403
    assert judged(keys, get("/enter", token=token, hosts=("evil.example:8402",))).status == 421
    assert isinstance(judged(keys, get("/enter", token=token)), Entered)


def test_links_differ_and_each_has_the_role_that_it_was_made_for():
    keys = PageSessions()
    tokens = {keys.issue(role) for role in Role}
    assert len(tokens) == len(Role)
    assert min(map(len, tokens)) >= 43  # 32 bytes
    keys, cookie = keys_with(Role.OBSERVER)
    assert judged(keys, get(cookies=(cookie,))).role is Role.OBSERVER


def test_unused_links_are_limited_in_number():
    keys = PageSessions()
    first, *rest = [keys.issue(Role.OBSERVER) for _ in range(65)]
    assert keys.enter(first) is LinkRefusal.UNKNOWN
    cookies = [keys.enter(token) for token in rest] + [keys.enter(keys.issue(Role.OBSERVER))]
    assert keys.session(cookies[0]) is None
    assert keys.session(cookies[-1]) == PageSession(65, Role.OBSERVER)


HERE = Origin("127.0.0.1", 1000)


@pytest.mark.parametrize("thief", [Origin("127.0.0.1", 1001), Origin("127.0.0.1"), Origin("10.0.0.1", 1000)])
def test_a_cookie_is_of_no_use_to_another_user_or_at_another_address_but_for_a_stop(thief):
    """A browser shows it to every port of the host, also to another user's web server."""
    keys = PageSessions()
    entered = judged(keys, get("/enter", token=keys.issue(Role.OPERATOR), origin=HERE))
    stop = get("/stop", method="POST", origins=(ORIGIN,), cookies=(entered.cookie,))
    for arrival in (get(cookies=(entered.cookie,)), socket(cookies=(entered.cookie,))):
        assert isinstance(judged(keys, dataclasses.replace(arrival, origin=HERE)), PageSession)
        refused = judged(keys, dataclasses.replace(arrival, origin=thief))
        assert refused.status == 403
        assert "another user" in refused.text
    for origin in (HERE, thief):
        assert isinstance(judged(keys, dataclasses.replace(stop, origin=origin)), PageSession)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux names the user of a connection")
@pytest.mark.parametrize("address", ["127.0.0.1", "::1"])
def test_the_user_of_a_connection_of_this_computer_is_known(address):
    import socket

    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    try:
        listening = socket.create_server((address, 0), family=family)
    except OSError:
        pytest.skip("this computer has no such address")
    with listening, socket.create_connection(listening.getsockname()[:2]) as line:
        ends = line.getsockname()[:2], line.getpeername()[:2]
        scope = {"type": "http", "path": "/", "headers": [], "client": ends[0], "server": ends[1]}
        assert arrival_of({**scope, "query_string": b"token=x"}, "c").origin == Origin(address, os.geteuid())
        assert origin_of((address, 1), ends[1]) == Origin(address)
    assert origin_of(("192.0.2.1", 5), ("127.0.0.1", 6)) == Origin("192.0.2.1")
    assert origin_of(None, None) == Origin()


class Clock:
    """A time that a test sets, in seconds."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_a_link_unused_for_an_hour_opens_nothing():
    clock = Clock()
    keys = PageSessions(clock=clock)
    tokens = [keys.issue(Role.OBSERVER) for _ in range(2)]
    clock.now = 3599.0
    assert isinstance(judged(keys, get("/enter", token=tokens[0])), Entered)
    clock.now = 3601.0
    late = judged(keys, get("/enter", token=tokens[1]))
    assert late.status == 403
    assert "more than an hour ago" in late.text


def test_a_session_ends_twelve_hours_after_its_browser_was_there_last_but_for_a_stop():
    clock = Clock()
    keys = PageSessions(clock=clock)
    cookie = keys.enter(keys.issue(Role.OPERATOR))
    for _ in range(5):
        clock.now += 11 * 3600.0
        assert isinstance(judged(keys, get(cookies=(cookie,))), PageSession)
    clock.now += 13 * 3600.0
    assert isinstance(judged(keys, get(cookies=(cookie,)), 1), PageSession)  # a page of it is open
    clock.now += 13 * 3600.0
    late = judged(keys, socket(cookies=(cookie,)))
    assert late.status == 403
    assert "12 hours" in late.text
    stop = get("/stop", method="POST", origins=(ORIGIN,), cookies=(cookie,))
    assert isinstance(judged(keys, stop), PageSession)
    assert judged(keys, get(cookies=(cookie,))).status == 403


def test_a_page_that_was_open_for_a_day_can_be_reloaded():
    clock = Clock()
    served = ServedDrives(clock)

    def page():
        clock.now += 24 * 3600.0
        yield {"type": "websocket.receive", "text": "x"}

    served.ask("websocket", "/live", page(), origin=ORIGIN)
    assert served.ask()[0]["status"] == 200


# -- host and origin --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "hosts",
    [
        (),
        ("evil.example",),
        ("evil.example:8402",),
        ("127.0.0.1",),
        ("127.0.0.1:80",),
        ("127.0.0.1:8402.evil.example",),
        (HOST, "evil.example"),
        ("evil.example", HOST),
    ],
)
def test_a_wrong_host_is_refused_with_an_otherwise_valid_request(hosts):
    keys, cookie = keys_with()
    for arrival in (get(cookies=(cookie,)), socket(cookies=(cookie,))):
        assert judged(keys, dataclasses.replace(arrival, hosts=hosts)).status == 421


@pytest.mark.parametrize(
    "origins",
    [
        (),
        ("null",),
        ("",),
        ("http://evil.example",),
        ("https://127.0.0.1:8402",),
        ("http://127.0.0.1:80",),
        ("http://127.0.0.1:8402.evil.example",),
        (ORIGIN, "http://evil.example"),
    ],
)
def test_a_socket_or_post_needs_the_origin_of_our_page(origins):
    keys, cookie = keys_with()
    for arrival in (socket(cookies=(cookie,)), get("/stop", method="POST", cookies=(cookie,))):
        assert judged(keys, dataclasses.replace(arrival, origins=origins)).status == 403
        assert isinstance(judged(keys, dataclasses.replace(arrival, origins=(ORIGIN,))), PageSession)


def test_reading_needs_no_origin_but_a_foreign_one_is_refused():
    keys, cookie = keys_with()
    assert isinstance(judged(keys, get(cookies=(cookie,))), PageSession)
    assert judged(keys, get(cookies=(cookie,), origins=("http://evil.example",))).status == 403


def test_another_name_of_the_server_is_accepted_in_any_case():
    keys, cookie = keys_with()
    other = socket(cookies=(cookie,), hosts=("LocalHost:8402",))
    assert isinstance(
        judged(keys, dataclasses.replace(other, origins=("http://LOCALHOST:8402",))), PageSession
    )


@given(st.text(max_size=60), st.text(max_size=60), st.text(max_size=60))
def test_without_a_valid_cookie_nothing_is_served(host, origin, cookie):
    keys, _ = keys_with()
    for hosts, origins in itertools.product([(host,), (HOST,)], [(origin,), (ORIGIN,), ()]):
        for arrival in (get(), socket(), get("/own/page.js"), get("/stop", method="POST")):
            shown = dataclasses.replace(arrival, hosts=hosts, origins=origins, cookies=(cookie,))
            assert isinstance(judged(keys, shown), AccessRefused)


# -- limits -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("own", "others", "let_in"),
    [
        (0, (), True),
        (SOCKETS_OF_BROWSER - 1, (), True),
        (SOCKETS_OF_BROWSER, (), False),
        (SOCKETS_ALWAYS, (SOCKETS - SOCKETS_ALWAYS - 1,), True),
        (SOCKETS_ALWAYS, (SOCKETS - SOCKETS_ALWAYS,), False),
        (SOCKETS_ALWAYS - 1, (SOCKETS_OF_BROWSER, SOCKETS_OF_BROWSER), True),
        (SOCKETS_ALWAYS - 1, (SOCKETS_OF_BROWSER,) * 60, True),
    ],
)
def test_a_browser_has_its_own_number_of_sockets_and_stops_are_not_counted(own, others, let_in):
    keys, cookie = keys_with(Role.OBSERVER)
    found = judged(keys, socket(cookies=(cookie,)), own, *others)
    assert isinstance(found, PageSession) if let_in else found.status == 503
    stop = get("/stop", method="POST", origins=(ORIGIN,), cookies=(cookie,), length=10 * FOREIGN_MESSAGE)
    assert isinstance(judged(keys, stop, own, *others), PageSession)


def test_a_request_with_too_large_a_body_is_refused():
    keys, cookie = keys_with()
    post = get("/_nicegui/x", method="POST", origins=(ORIGIN,), cookies=(cookie,), length=FOREIGN_MESSAGE)
    assert isinstance(judged(keys, post), PageSession)
    assert judged(keys, dataclasses.replace(post, length=FOREIGN_MESSAGE + 1)).status == 413


@given(st.lists(st.floats(0.0, 0.5), max_size=400))
def test_a_rate_is_kept_over_any_time(pauses):
    bucket, now, taken = Bucket(rate=10.0, burst=20.0), 100.0, 0
    for pause in pauses:
        now += pause
        taken += bucket.take(now)
        assert taken <= 20 + 10 * (now - 100.0) + 1e-6
    now += 2.0
    assert [bucket.take(now) for _ in range(21)] == [True] * 20 + [False]


def test_the_rate_of_a_page_leaves_room_for_its_beats():
    bucket = Bucket()
    assert all(bucket.take(at * 0.05 + more) for at in range(2000) for more in (0.0, 0.001))
    assert limits.MESSAGE < limits.FOREIGN_MESSAGE


def test_in_no_time_nothing_is_given():
    bucket = Bucket(rate=10.0, burst=1.0)
    assert [bucket.take(now) for now in (5.0, 5.0, 5.05, 5.11)] == [True, False, False, True]


# -- the middleware ---------------------------------------------------------------------------------------------------


class ServedDrives:
    """An application behind a gate: it stores the messages that reach it."""

    def __init__(self, clock: Any = time.monotonic) -> None:
        self.keys = PageSessions(clock=clock)
        self.cookie = self.keys.enter(self.keys.issue(Role.OPERATOR))
        self.gate = AccessMiddleware(self._inner, DOOR, self.keys, "axisbus_8402")
        self.seen: list[Any] = []

    async def _inner(self, scope, receive, send) -> None:
        self.seen.append(scope[SESSION])
        while (message := await receive())["type"] in ("websocket.receive", "http.request"):
            self.seen.append(message)
            if message["type"] == "http.request" and not message.get("more_body"):
                break
        if scope["type"] == "http":
            headers = [(b"Cache-Control", b"public"), (b"x-own", b"1")]
            await send({"type": "http.response.start", "status": 200, "headers": headers})
            await send({"type": "http.response.body", "body": b"well"})
        else:
            self.seen.append(message)

    def ask(
        self, kind: str = "http", path: str = "/", messages=(), method: str = "GET", **headers: str
    ) -> list[Any]:
        """Return the answer to these headers and messages."""
        sent: list[Any] = []
        ending = [{"type": f"{kind}.disconnect"}]
        coming = itertools.chain(messages, ending) if messages else iter([{"type": "http.request"}])
        given = {"host": HOST, "cookie": f"other=1; axisbus_8402={self.cookie}", **headers}
        scope = {
            "type": kind,
            "path": path.partition("?")[0],
            "query_string": path.partition("?")[2].encode(),
            "method": method,
            "headers": [(name.encode(), value.encode()) for name, value in given.items()],
        }

        async def receive():
            return next(coming)

        async def send(message):
            sent.append(message)

        asyncio.run(self.gate(scope, receive, send))
        return sent


def texts(number: int, size: int = 10) -> list[dict[str, str]]:
    return [{"type": "websocket.receive", "text": "x" * size}] * number


def test_every_answer_has_each_security_header_once():
    served = ServedDrives()
    token = served.keys.issue(Role.OBSERVER)
    entering, refused, well = served.ask(path=f"/enter?token={token}"), served.ask(cookie=""), served.ask()
    for sent in (entering, refused, well):
        headers = sent[0]["headers"]
        named = [name.decode().lower() for name, _ in headers]
        found = {name.decode().lower(): value.decode() for name, value in headers}
        assert len(set(named)) == len(named)
        assert found["x-content-type-options"] == "nosniff"
        assert found["referrer-policy"] == "no-referrer"
        assert found["cache-control"] == "no-store"
        assert found["x-frame-options"] == "DENY"
        policy = dict(part.strip().split(" ", 1) for part in found["content-security-policy"].split(";"))
        assert policy["default-src"] == "'self'"
        assert policy["frame-ancestors"] == policy["base-uri"] == policy["object-src"] == "'none'"
        assert "http" not in found["content-security-policy"]
        assert "*" not in found["content-security-policy"]
    assert (b"x-own", b"1") in well[0]["headers"]
    assert [sent[0]["status"] for sent in (entering, refused, well)] == [200, 403, 200]
    assert served.seen[0] == PageSession(1, Role.OPERATOR)


def test_the_cookie_is_kept_from_scripts_and_from_other_sites():
    served = ServedDrives()
    sent = served.ask(path=f"/enter?token={served.keys.issue(Role.OPERATOR)}")
    cookie = dict(sent[0]["headers"])[b"set-cookie"].decode()
    assert cookie.startswith("axisbus_8402=")
    assert {"HttpOnly", "SameSite=Strict", "Path=/"} <= set(cookie.split("; ")[1:])
    assert "Secure" not in cookie  # a browser would not keep it without https
    served.gate = AccessMiddleware(
        served._inner, ServedOrigin("https", DOOR.hosts), served.keys, "axisbus_8402"
    )
    sent = served.ask(path=f"/enter?token={served.keys.issue(Role.OPERATOR)}")
    assert "Secure" in dict(sent[0]["headers"])[b"set-cookie"].decode().split("; ")


def test_requested_texts_are_never_interpreted_as_markup():
    sent = ServedDrives().ask(host="<script>alert(1)</script>")
    assert sent[0]["status"] == 421
    assert b"<script" not in sent[1]["body"]


def test_a_socket_that_is_refused_is_never_accepted():
    served = ServedDrives()
    for headers in ({"origin": "http://evil.example"}, {}, {"origin": ORIGIN, "cookie": ""}):
        assert served.ask("websocket", "/_nicegui_ws/", texts(1), **headers) == [
            {"type": "websocket.close", "code": 1008}
        ]
    assert served.seen == []


def test_a_flood_on_the_socket_of_the_library_closes_it():
    served = ServedDrives()
    sent = served.ask("websocket", "/_nicegui_ws/", texts(10_000), origin=ORIGIN)
    assert sent == [{"type": "websocket.close", "code": 1008}]
    assert len(served.seen) < 200 + 2
    assert served.seen[-1] == {"type": "websocket.disconnect", "code": 1008}


def test_an_oversize_message_closes_it():
    served = ServedDrives()
    sent = served.ask("websocket", "/_nicegui_ws/", texts(1, FOREIGN_MESSAGE + 1), origin=ORIGIN)
    assert sent == [{"type": "websocket.close", "code": 1009}]
    assert served.seen[1:] == [{"type": "websocket.disconnect", "code": 1009}]


def test_our_own_socket_is_not_rate_limited():
    served = ServedDrives()
    assert served.ask("websocket", "/live", texts(1000), origin=ORIGIN) == []
    assert len(served.seen) == 1002


def test_a_browser_that_reloads_too_often_is_limited_alone_and_may_stop():
    served = ServedDrives()
    other = served.keys.enter(served.keys.issue(Role.OBSERVER))
    found = [served.ask()[0]["status"] for _ in range(1000)]
    assert found[:10] == [200] * 10
    assert found.count(200) < 20
    assert set(found) == {200, 429}
    assert served.ask(cookie=f"axisbus_8402={other}")[0]["status"] == 200
    assert {served.ask(path="/stop", method="POST", origin=ORIGIN)[0]["status"] for _ in range(100)} == {200}


def test_sockets_are_counted_as_long_as_they_are_open():
    served = ServedDrives()
    for _ in range(2 * SOCKETS):
        assert served.ask("websocket", "/live", texts(1), origin=ORIGIN) == []


def test_a_body_without_a_length_is_cut_off():
    served = ServedDrives()
    piece = {"type": "http.request", "body": b"x" * 10_000, "more_body": True}
    served.ask("http", "/", [piece] * 20, origin=ORIGIN)
    assert sum(len(message["body"]) for message in served.seen[1:]) <= FOREIGN_MESSAGE


@pytest.mark.parametrize("path", limits.LONGER)
def test_a_larger_body_is_allowed_only_on_the_paths_for_files(path):
    served, most = ServedDrives(), limits.max_bytes(path)
    assert FOREIGN_MESSAGE < most < 8 * 1024 * 1024
    whole = {"type": "http.request", "body": bytes(most), "more_body": True}
    more = {"type": "http.request", "body": b"x"}
    for messages in ([whole, more], [whole] * 3):
        served.seen.clear()
        served.ask("http", path, messages, origin=ORIGIN)
        assert sum(len(message["body"]) for message in served.seen[1:]) == most
    for at, length, status in (
        (path, most, 200),
        (path, most + 1, 413),
        (path + "/", most, 413),
        ("/", most, 413),
    ):
        sent = served.ask("http", at, origin=ORIGIN, **{"content-length": str(length)})
        assert sent[0]["status"] == status
    assert served.ask("http", path, origin="http://evil.example")[0]["status"] == 403
    assert served.ask("http", path, origin=ORIGIN, cookie="")[0]["status"] == 403
