"""What the page's own sockets share: the next text of a page, a page that takes nothing more, and the end of one."""

from __future__ import annotations

from contextlib import suppress

from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

SLOW = 5.0  # seconds that a page may take for one message, until it is given up
GONE = (WebSocketDisconnect, RuntimeError, OSError)  # what sending raises where a page is no longer there
_POLICY_VIOLATED = 1008


async def next_text(socket: WebSocket) -> str | None:
    """Return the next message; None where there is none any more, or where it is bytes, which no page of ours sends."""
    try:
        return await socket.receive_text()
    except (WebSocketDisconnect, RuntimeError, KeyError):  # RuntimeError: what was sent has failed before
        return None


async def end(socket: WebSocket) -> None:
    """Close a socket that is still open."""
    if socket.application_state is WebSocketState.CONNECTED:
        with suppress(*GONE):
            await socket.close(_POLICY_VIOLATED)
