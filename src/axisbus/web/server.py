"""The server of the page: in a thread of its own, behind the gate, on a socket that was opened before the machine."""

from __future__ import annotations

import asyncio
import json
import logging
import queue
import socket
import sys
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from logging.handlers import QueueHandler, QueueListener
from pathlib import Path
from typing import Any

import nicegui
import uvicorn
from fastapi import FastAPI, WebSocket
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.staticfiles import StaticFiles

from axisbus.errors import AxisbusError, StateError
from axisbus.machine.machine import Machine
from axisbus.web.access.acceptor import Acceptor
from axisbus.web.access.admission import ENTER, STOP
from axisbus.web.access.limits import FOREIGN_MESSAGE, SAVE_SAMPLES, UPLOAD_FILE
from axisbus.web.access.middleware import PAGE_VALUES_SOCKET, SESSION, AccessMiddleware
from axisbus.web.access.tokens import PageSessions, Role
from axisbus.web.address import PageAddress
from axisbus.web.commands.clients import PageClients
from axisbus.web.config import file_process
from axisbus.web.config.files import BACKED_UP, MAX_SIZE, UPLOADED, Dcf, PageFiles, named
from axisbus.web.config.report import bounded_texts
from axisbus.web.objects.dictionary import DictionaryCache
from axisbus.web.objects.worker import ObjectWorker
from axisbus.web.page.page import Pages, add_page
from axisbus.web.page_socket import Hub, PageSocket
from axisbus.web.scope import saving as scope
from axisbus.web.view import Values, explained
from axisbus.wording import PrintableFormatter

SCOPE, OBJECTS, TRIALS, BACKUP = "/scope", "/objects", "/trials", "/config/backup"
_START_TIMEOUT = 10.0  # seconds for the start of the server
_PING = 2.0  # seconds after which a silent page is pinged, and then disconnected
STATIC = Path(__file__).parent / "page" / "static"


class PageServer:
    """Hold the thread of the server, its links, and the reason of its end, if it has ended."""

    def __init__(
        self,
        machine: Machine,
        page_address: PageAddress,
        listening: socket.socket,
        tls: tuple[Path, Path] | None,
        status_lines: Callable[[], list[str]],
        *,
        observes_only: bool = False,
    ) -> None:
        """``listening`` is bound; ``tls`` are the files of a certificate and its key.

        ``status_lines``: as for ``PageSocket``; ``observes_only``: as for ``PageClients``.
        """
        self._machine = machine
        self._place = page_address
        self._listening = listening
        self._keys = PageSessions()
        self._clients = PageClients(machine, lambda: self.link(Role.OBSERVER), observes_only=observes_only)
        self._pages = Pages(machine)
        self._live = PageSocket(machine, self._clients, status_lines, self._pages.look)
        self._hub = Hub(machine)
        self._dictionaries = DictionaryCache(machine)
        self._worker = ObjectWorker(machine, self._clients.objects)
        self._config = ConfigRoutes(self._clients)
        self._saving = scope.ScopeRoutes(machine)
        self._failure: BaseException | None = None
        self._acceptor = Acceptor(listening)
        gate = AccessMiddleware(
            self._application(),
            page_address.served_origin,
            self._keys,
            page_address.cookie,
            self._acceptor.note_admission,
        )
        self._uvicorn = uvicorn.Server(
            uvicorn.Config(
                gate,
                log_config=None,
                access_log=False,
                ws_per_message_deflate=False,  # compression would need more processor time than everything else
                ws_max_size=FOREIGN_MESSAGE,
                ws_ping_interval=_PING,
                ws_ping_timeout=_PING,
                timeout_graceful_shutdown=1,
                server_header=False,
                proxy_headers=False,
                ssl_certfile=None if tls is None else tls[0],
                ssl_keyfile=None if tls is None else tls[1],
            )
        )
        self._thread = threading.Thread(target=self._run, name="axisbus-web", daemon=True)

    def link(self, role: Role) -> str:
        """Return a new link, which admits one browser, once."""
        return f"{self._place.url}{ENTER}?token={self._keys.issue(role)}"

    def begin(self) -> None:
        """Start the server; blocks until it serves.

        Raises:
            StateError: the server does not start.
        """
        self._thread.start()
        waited = threading.Event()
        for _ in range(int(_START_TIMEOUT / 0.02)):
            if self._uvicorn.started or not self._thread.is_alive():
                break
            waited.wait(0.02)
        if not self._uvicorn.started:
            raise StateError(
                "the page could not be served",
                observed=str(self._failure or f"it took more than {_START_TIMEOUT:g} s"),
            )

    def end(self) -> None:
        """End the server; blocks for at most 3 s."""
        self._uvicorn.should_exit = True
        self._thread.join(3.0)
        self._listening.close()

    def require_alive(self) -> None:
        """Check that the server runs.

        Raises:
            StateError: the server has ended unexpectedly.
        """
        if not self._thread.is_alive() or self._failure is not None:
            raise StateError(
                "the server of the page has ended", observed=repr(self._failure), remedy="start it again"
            )

    def _run(self) -> None:
        try:
            self._uvicorn.run(sockets=[])  # the acceptor provides the connections
        except (Exception, SystemExit) as error:  # noqa: BLE001  # ``require_alive`` reports it
            self._failure = error

    def _application(self) -> FastAPI:
        application = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
        application.add_api_websocket_route(PAGE_VALUES_SOCKET, self._serve)
        application.add_api_websocket_route(SCOPE, self._scope)
        application.add_api_route(STOP, self._stop, methods=["POST"])
        application.add_api_route(f"{OBJECTS}/{{node}}", self._dictionary)
        application.add_route(UPLOAD_FILE, self._config.upload, methods=["POST"])
        application.add_route(BACKUP, self._config.made, methods=["GET"])
        application.add_route(SAVE_SAMPLES, self._saving.save, methods=["POST"])
        application.add_api_route(f"{TRIALS}/{{number}}", self._trial)
        application.mount("/own", StaticFiles(directory=STATIC))
        add_page(application, self._machine, self._pages)
        # The library's own lifespan inspects every object of the program, and some of canopen's must not be inspected.
        application.router.lifespan_context = self._lifespan
        return application

    async def _serve(self, websocket: WebSocket) -> None:
        await self._live.serve(websocket)

    async def _scope(self, websocket: WebSocket) -> None:
        await self._hub.serve(websocket)

    async def _dictionary(self, node: int) -> Response:
        return Response(await self._dictionaries.page(node), media_type="application/json")

    async def _trial(self, number: int) -> Response:
        found = self._clients.trials.outcome(number)
        text = "null" if found is None else await asyncio.to_thread(lambda: json.dumps(found.samples()))
        return Response(text, media_type="application/json")

    async def _stop(self, request: Request) -> Response:  # noqa: ARG002  # its contents are ignored
        """Quick-stop every axis; the page requests this if its socket does not work."""
        self._clients.stop_all()
        return Response(status_code=204)

    @asynccontextmanager
    async def _lifespan(self, _: FastAPI) -> AsyncIterator[None]:
        update_task = asyncio.create_task(self._live.run())
        update_task.add_done_callback(self._ended)
        worker_task = asyncio.create_task(self._worker.run())
        try:
            async with nicegui.app.router.lifespan_context(nicegui.app):
                accepting = asyncio.create_task(self._acceptor.run(self._protocol, self._uvicorn.config.ssl))
                accepting.add_done_callback(self._ended)
                yield
                accepting.cancel()
        finally:
            update_task.cancel()
            worker_task.cancel()

    def _protocol(self) -> asyncio.Protocol:
        """Return the protocol of one connection, as uvicorn itself makes it."""
        server = self._uvicorn
        kind: Any = server.config.http_protocol_class  # mypy does not know its arguments
        made: asyncio.Protocol = kind(
            config=server.config, server_state=server.server_state, app_state=server.lifespan.state
        )
        return made

    def _ended(self, update_task: asyncio.Task[None]) -> None:
        """End the server if its update loop or its acceptor ends: nothing would end a jog, or no new page could stop an axis."""
        if not update_task.cancelled():
            self._failure = update_task.exception()
            self._uvicorn.should_exit = True


# -- The log in a thread of its own, so that a blocked terminal does not block the pages ------------------------------------------

_WAITING = 200  # records; when the queue is full, new ones are dropped


class PageLogThread(QueueHandler):
    """Put records into a queue, and never wait for room in it."""

    def enqueue(self, record: logging.LogRecord) -> None:
        """Put a record into the queue if there is room."""
        with suppress(queue.Full):
            self.queue.put_nowait(record)


@contextmanager
def logging_aside() -> Iterator[None]:
    """Log to standard error in a thread of its own within the block."""
    waiting: queue.Queue[logging.LogRecord] = queue.Queue(_WAITING)
    writer, log_thread, root = logging.StreamHandler(sys.stderr), PageLogThread(waiting), logging.getLogger()
    writer.setFormatter(PrintableFormatter())
    listener = QueueListener(waiting, writer)
    listener.start()
    root.addHandler(log_thread)
    try:
        yield
    finally:
        root.removeHandler(log_thread)
        with suppress(queue.Full):  # a blocked writer is abandoned: its thread ends with the process
            listener.enqueue_sentinel()


# -- HTTP requests of the page for its DCFs: upload a file, download the last backup; only for the browser of that page ----

_NOT_FOUND, _TOO_LARGE, _BUSY = 404, 413, 503
_MAX_PARSED = 2  # files that are parsed at the same time; the others wait
_UPLOAD_TIMEOUT = 10.0  # seconds that an upload may take


class ConfigRoutes:
    """Hold the browsers that are uploading a file; used by one event loop."""

    def __init__(self, clients: PageClients) -> None:
        """``clients`` has the pages and their files."""
        self._clients = clients
        self._uploading: set[int] = set()
        self._parse_slots = asyncio.Semaphore(_MAX_PARSED)

    async def upload(self, request: Request) -> Response:
        """Accept a file of a page and return its description; an invalid file is not stored."""
        page = self._page(request)
        if page is None:
            return Response(status_code=_NOT_FOUND)
        browser = request.scope[SESSION].number
        if browser in self._uploading:
            return Response(status_code=_BUSY)
        self._uploading.add(browser)
        try:
            async with asyncio.timeout(_UPLOAD_TIMEOUT):
                file = Dcf(named(request.query_params.get("name", "")), await request.body())
            return await self._parsed(page, file)
        except (ClientDisconnect, TimeoutError):
            return Response(status_code=_TOO_LARGE)
        finally:
            self._uploading.discard(browser)

    async def made(self, request: Request) -> Response:
        """Return the last backup of a page."""
        page = self._page(request)
        file = None if page is None else self._files.of(page, BACKED_UP)
        if file is None:
            return Response(status_code=_NOT_FOUND)
        attached = {
            "content-disposition": f'attachment; filename="{file.name}"'
        }  # the server made this name: it needs no escaping
        return Response(file.data, media_type="application/octet-stream", headers=attached)

    async def _parsed(self, page: int, file: Dcf) -> Response:
        async with self._parse_slots:
            description = await asyncio.to_thread(_described, file)
        if description["error"] is None and page in self._clients.clients and len(file.data) <= MAX_SIZE:
            self._files.store(page, UPLOADED, file)
        return Response(json.dumps(description), media_type="application/json")

    @property
    def _files(self) -> PageFiles:
        return self._clients.objects.configuring.files

    def _page(self, request: Request) -> int | None:
        """Return the page that a request names, if it belongs to the same browser."""
        text = request.query_params.get("page", "")
        client = (
            self._clients.clients.get(int(text))
            if text.isascii() and text.isdecimal() and len(text) < 10
            else None
        )
        if client is None or client.session != request.scope[SESSION].number:
            return None
        return client.identity.number


def _described(file: Dcf) -> Values:
    """Return the description of a file, or why it is invalid."""
    try:
        return {"name": file.name, "text": file_process.summary(file), "error": None}
    except AxisbusError as error:
        return {"name": file.name, "text": "", "error": bounded_texts(explained(error))}
