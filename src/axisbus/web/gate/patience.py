"""How long a connection may take until it has asked for something: one that says nothing takes a place from who would stop."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.auto import AutoHTTPProtocol

PATIENCE = 5.0  # seconds for the first request, with all its headers


class Impatient(AutoHTTPProtocol):  # type: ignore[misc, valid-type]  # it is what is installed
    """The server's own protocol; a connection that has made no request in time is closed."""

    cycle: Any  # None until a request has come

    def connection_made(self, transport: asyncio.Transport) -> None:
        """Somebody has come."""
        super().connection_made(transport)
        asyncio.get_running_loop().call_later(PATIENCE, self._give_up, transport)

    def _give_up(self, transport: asyncio.Transport) -> None:
        """Close it where nothing was asked: a socket, which has a protocol of its own by now, has."""
        if self.cycle is None and transport.get_protocol() is self:
            transport.close()
