"""HTTP requests of the page for its DCFs: upload a file, download the last backup; only for the browser of that page."""

from __future__ import annotations

import asyncio
import json

from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from axisbus.errors import AxisbusError
from axisbus.web.access.middleware import SESSION
from axisbus.web.commands.clients import PageClients
from axisbus.web.config import file_process
from axisbus.web.config.files import BROUGHT, MADE, MOST, Dcf, PageFiles, named
from axisbus.web.config.report import bounded_texts
from axisbus.web.view import Values, explained

_NOT_FOUND, _TOO_LARGE, _BUSY = 404, 413, 503
_AT_ONCE = 2  # files that are parsed at the same time; the others wait
_PATIENCE = 10.0  # seconds that an upload may take


class ConfigRoutes:
    """Hold the browsers that are uploading a file; used by one event loop."""

    def __init__(self, desk: PageClients) -> None:
        """``desk`` has the pages and their files."""
        self._desk = desk
        self._coming: set[int] = set()
        self._turn = asyncio.Semaphore(_AT_ONCE)

    async def bring(self, request: Request) -> Response:
        """Accept a file of a page and return its description; an invalid file is not stored."""
        page = self._page(request)
        if page is None:
            return Response(status_code=_NOT_FOUND)
        browser = request.scope[SESSION].number
        if browser in self._coming:
            return Response(status_code=_BUSY)
        self._coming.add(browser)
        try:
            async with asyncio.timeout(_PATIENCE):
                file = Dcf(named(request.query_params.get("name", "")), await request.body())
            return await self._taken(page, file)
        except (ClientDisconnect, TimeoutError):
            return Response(status_code=_TOO_LARGE)
        finally:
            self._coming.discard(browser)

    async def made(self, request: Request) -> Response:
        """Return the last backup of a page."""
        page = self._page(request)
        file = None if page is None else self._files.of(page, MADE)
        if file is None:
            return Response(status_code=_NOT_FOUND)
        attached = {
            "content-disposition": f'attachment; filename="{file.name}"'
        }  # the server made this name: it needs no escaping
        return Response(file.data, media_type="application/octet-stream", headers=attached)

    async def _taken(self, page: int, file: Dcf) -> Response:
        async with self._turn:
            told = await asyncio.to_thread(_described, file)
        if told["error"] is None and page in self._desk.places and len(file.data) <= MOST:
            self._files.keep(page, BROUGHT, file)
        return Response(json.dumps(told), media_type="application/json")

    @property
    def _files(self) -> PageFiles:
        return self._desk.objects.configuring.files

    def _page(self, request: Request) -> int | None:
        """Return the page that a request names, if it belongs to the same browser."""
        text = request.query_params.get("page", "")
        place = (
            self._desk.places.get(int(text))
            if text.isascii() and text.isdecimal() and len(text) < 10
            else None
        )
        if place is None or place.session != request.scope[SESSION].number:
            return None
        return place.seat.number


def _described(file: Dcf) -> Values:
    """Return the description of a file, or why it is invalid."""
    try:
        return {"name": file.name, "text": file_process.about(file), "error": None}
    except AxisbusError as error:
        return {"name": file.name, "text": "", "error": bounded_texts(explained(error))}
