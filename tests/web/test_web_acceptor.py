"""Crowds of connections at the page: those that say nothing, never end a request or never read keep no request to stop out."""

from __future__ import annotations

import asyncio
import os
import select
import shutil
import socket
import ssl
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import ExitStack, asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from axisbus.web.access import acceptor
from axisbus.web.access.acceptor import Acceptor, Connection, connection_to_close
from axisbus.web.access.admission import ServedOrigin
from axisbus.web.access.limits import CONNECTIONS
from axisbus.web.access.middleware import AccessMiddleware
from axisbus.web.access.tokens import Origin, PageSessions, Role

resource = pytest.importorskip("resource", reason="the test needs many descriptors")
uvicorn = pytest.importorskip("uvicorn", reason="the server of the page is uvicorn")

CROWD = 1000
PATIENT = 20.0  # s; on a computer that is not busy it takes a second
REQUEST = "GET {} HTTP/1.1\r\nHost: localhost\r\n"


@pytest.fixture(autouse=True)
def descriptors() -> Iterator[None]:
    """As many as both ends of a crowd need."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    if before[1] != resource.RLIM_INFINITY and before[1] < 4 * CROWD:
        pytest.skip("this user may not have so many descriptors")
    resource.setrlimit(resource.RLIMIT_NOFILE, (4 * CROWD, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate and its key."""
    if shutil.which("openssl") is None:
        pytest.skip("the certificate is made by openssl")
    folder = tmp_path_factory.mktemp("certificate")
    made, key = folder / "certificate.pem", folder / "key.pem"
    command = (
        "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=localhost"
    )
    subprocess.run(
        [*command.split(), "-keyout", str(key), "-out", str(made)], capture_output=True, check=True
    )
    return made, key


@asynccontextmanager
async def serving(tls: tuple[Path, Path] | None) -> AsyncIterator[SimpleNamespace]:
    """A gate that answers "well" to a request with a cookie, and the means to reach it."""
    listening = socket.create_server(("127.0.0.1", 0))
    scheme, port = "http" if tls is None else "https", listening.getsockname()[1]
    keys = PageSessions()

    async def well(scope: Any, receive: Any, send: Any) -> None:
        if scope["path"] == "/long":
            await asyncio.sleep(60.0)
        while (await receive()).get("more_body"):
            pass
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"4")]})
        await send({"type": "http.response.body", "body": b"well"})

    accepting = Acceptor(listening)
    gate = AccessMiddleware(
        well, ServedOrigin(scheme, frozenset({"localhost"})), keys, "c", accepting.note_admission
    )
    config = uvicorn.Config(
        gate,
        log_config=None,
        lifespan="off",
        ssl_certfile=None if tls is None else tls[0],
        ssl_keyfile=None if tls is None else tls[1],
    )
    config.load()
    state = uvicorn.server.ServerState()

    def protocol() -> asyncio.Protocol:
        made: asyncio.Protocol = config.http_protocol_class(config=config, server_state=state, app_state={})
        return made

    running = asyncio.create_task(accepting.run(protocol, config.ssl))
    await asyncio.sleep(0)  # it listens
    trusting = None if tls is None else ssl.create_default_context(cafile=str(tls[0]))
    if trusting is not None:
        trusting.check_hostname = False
    here = Origin("127.0.0.1", os.geteuid() if sys.platform == "linux" else None)
    cookies = [str(keys.enter(keys.issue(role), here)) for role in (Role.OPERATOR, Role.OBSERVER)]
    yield SimpleNamespace(port=port, tls=trusting, operator=cookies[0], looker=cookies[1], keys=keys)
    running.cancel()
    listening.close()


async def answer(to: Any, text: str) -> bytes:
    """Send a request by a connection of its own, and return the first line of the answer; none in time is a failure."""
    async with asyncio.timeout(PATIENT):
        reader, writer = await asyncio.open_connection("127.0.0.1", to.port, ssl=to.tls)
        writer.write(text.encode())
        line = await reader.readline()
        writer.transport.abort()
        return line


def stop(cookie: str, scheme: str = "http") -> str:
    return f"POST /stop HTTP/1.1\r\nHost: localhost\r\nOrigin: {scheme}://localhost\r\nCookie: c={cookie}\r\n\r\n"


def are_ended(lines: list[socket.socket]) -> int:
    """How many connections the far end has ended, of those by which it sends nothing."""
    poll = select.poll()
    for line in lines:
        poll.register(line, select.POLLIN)
    return len(poll.poll(0))


@pytest.mark.parametrize("loop", ["asyncio", "uvloop"])
@pytest.mark.parametrize("encrypted", [False, True])
def test_a_thousand_silent_connections_keep_no_request_to_stop_out(monkeypatch, encrypted, loop, request):
    """All but a few of them are ended before any of them is too late."""
    make_loop = pytest.importorskip(loop).new_event_loop
    monkeypatch.setattr(acceptor, "ADMISSION_TIMEOUT", 60.0)
    tls = request.getfixturevalue("certificate") if encrypted else None

    async def seen() -> tuple[bytes, int]:
        with ExitStack() as crowd:
            async with serving(tls) as at:
                lines = [
                    crowd.enter_context(socket.create_connection(("127.0.0.1", at.port), 5.0))
                    for _ in range(CROWD)
                ]
                found = await answer(at, stop(at.operator, "https" if encrypted else "http"))
                await asyncio.sleep(0.1)
                return found, are_ended(lines)

    with asyncio.Runner(loop_factory=make_loop) as runner:
        found, ended = runner.run(seen())
    assert found.startswith(b"HTTP/1.1 200")
    assert CROWD - CONNECTIONS <= ended < CROWD


@pytest.mark.parametrize(
    ("path", "more"),
    [("/", "Content-Length: 9\r\n\r\nnever"), ("/long", "\r\n"), ("/", "X: never ended")],
    ids=["a body that is never ended", "an answer that never comes", "headers that are never ended"],
)
def test_a_thousand_requests_of_one_browser_keep_no_other_one_out(path, more):
    """Nor do they cost another browser a connection that it has open already."""

    async def seen() -> tuple[bytes, bytes]:
        with ExitStack() as crowd:
            async with serving(None) as at:
                reader, writer = await asyncio.open_connection("127.0.0.1", at.port)
                whole = stop(at.operator).replace("\r\n\r\n", "\r\nContent-Length: 4\r\n\r\n")
                writer.write(whole.encode())
                await asyncio.sleep(0.05)
                for _ in range(CROWD):
                    line = crowd.enter_context(socket.create_connection(("127.0.0.1", at.port), 5.0))
                    line.sendall(f"{REQUEST.format(path)}Cookie: c={at.looker}\r\n{more}".encode())
                new = await answer(at, stop(at.operator))
                writer.write(b"here")
                async with asyncio.timeout(PATIENT):
                    old = await reader.readline()
                writer.transport.abort()
                return new, old

    assert [line[:12] for line in asyncio.run(seen())] == [b"HTTP/1.1 200"] * 2


@pytest.mark.parametrize(
    ("said", "lives"),
    [
        ("", False),
        ("GET / HTTP/1.1\r\nHost: ", False),
        (REQUEST.format("/long") + "Cookie: c={}\r\n\r\n", True),
    ],
    ids=["nothing", "half a request", "waiting for its answer"],
)
@pytest.mark.parametrize("encrypted", [False, True])
def test_a_connection_that_is_not_authorised_in_time_is_closed(monkeypatch, said, lives, encrypted, request):
    """Also one that says nothing where a TLS handshake is waited for."""
    monkeypatch.setattr(acceptor, "ADMISSION_TIMEOUT", 0.2)
    tls = request.getfixturevalue("certificate") if encrypted else None

    async def seen() -> bytes | None:
        async with serving(tls) as at:
            handshake = at.tls if said else None
            reader, writer = await asyncio.open_connection("127.0.0.1", at.port, ssl=handshake)
            writer.write(said.format(at.operator).encode())
            try:
                return await asyncio.wait_for(reader.read(), 0.6)
            except TimeoutError:
                return None
            except OSError:
                return b""
            finally:
                writer.transport.abort()

    assert asyncio.run(seen()) == (None if lives else b"")


def connections(*sessions: int | None, kept: bool = False) -> list[Connection]:
    return [Connection(None, session, kept) for session in sessions]


def test_the_client_with_most_connections_loses_its_oldest_and_unknown_ones_count_as_one():
    found = connections(1, None, 2, 1, None, None, 2)
    assert connection_to_close(found, 8) is None
    assert connection_to_close(found, 7) is found[1]
    found[1].ended = True
    assert connection_to_close(found, 7) is None
    assert connection_to_close(found, 6) is found[0]


def test_the_socket_of_a_page_is_never_closed_for_lack_of_room():
    found = connections(*[1] * 200, kept=True)
    assert connection_to_close(found, CONNECTIONS) is None
    assert connection_to_close([*found, *connections(2)], 1).session == 2
