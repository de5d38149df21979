"""HTTP request of the page for an MCAP file of its scope's samples; one at a time, and one for each browser."""

from __future__ import annotations

import asyncio
import json

from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from axisbus.errors import AxisbusError, StateError, one_line
from axisbus.machine.machine import Machine
from axisbus.web.access.middleware import SESSION
from axisbus.web.scope.saving import mcap
from axisbus.web.view.axes import explained

_PATIENCE = 20.0  # seconds that the upload of the samples may take
_BUSY = StateError("another file of this browser is being written", remedy="save again in a moment")


class ScopeRoutes:
    """Hold the browsers for which a file is being made; used by one event loop."""

    def __init__(self, machine: Machine) -> None:
        """``machine`` is the one whose signals are shown."""
        self._machine = machine
        self._busy: set[int] = set()
        self._turn = asyncio.Lock()

    async def save(self, request: Request) -> Response:
        """Return the file, or the error as JSON."""
        browser = request.scope[SESSION].number
        if browser in self._busy:
            return _told(_BUSY)
        self._busy.add(browser)
        try:
            async with asyncio.timeout(_PATIENCE):
                data = await request.body()
            async with self._turn:
                made = await asyncio.to_thread(mcap, self._machine, data)
            return Response(made, media_type="application/octet-stream")
        except AxisbusError as error:
            return _told(error)
        except (ClientDisconnect, TimeoutError, OSError) as error:
            return _told(StateError("the file could not be written", observed=one_line(error)))
        finally:
            self._busy.discard(browser)


def _told(error: AxisbusError) -> Response:
    return Response(json.dumps({"error": explained(error)}), media_type="application/json")
