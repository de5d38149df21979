"""Common functions of the page's own sockets: receive a text, detect a page that accepts nothing, close a socket."""

from __future__ import annotations

from contextlib import suppress

from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

SLOW = 5.0  # seconds that a page may take for one message before it is disconnected
GONE = (WebSocketDisconnect, RuntimeError, OSError)  # raised by sending if a page is gone
_POLICY_VIOLATED = 1008


async def next_text(socket: WebSocket) -> str | None:
    """Return the next message; None at the end, or if it is bytes, which no page of this server sends."""
    try:
        return await socket.receive_text()
    except (WebSocketDisconnect, RuntimeError, KeyError):  # RuntimeError: sending has failed before
        return None


async def end(socket: WebSocket) -> None:
    """Close a socket that is still open."""
    if socket.application_state is WebSocketState.CONNECTED:
        with suppress(*GONE):
            await socket.close(_POLICY_VIOLATED)
