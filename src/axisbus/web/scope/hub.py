"""The scope's sockets: each page gets every cycle of the signals that it chose, in thirty batches a second."""

from __future__ import annotations

import asyncio
import math
from contextlib import suppress

from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from axisbus.machine.machine import Machine
from axisbus.web.scope.batch import batch
from axisbus.web.scope.choice import Choice, read
from axisbus.web.scope.cycles import Cycles
from axisbus.web.scope.signals import Reader, Signal, signals_of

_PERIOD = 1.0 / 30.0  # s
_SLOW = 5.0  # s that a page may take for one batch, until it is given up


class Hub:
    """Holds the last cycles while anybody looks at them; nothing is kept while nobody does. Its sockets live in one event loop."""

    def __init__(self, machine: Machine) -> None:
        """Nothing happens before ``serve``."""
        self._machine = machine
        self._cycles = Cycles()
        self._looking = 0
        # A batch may be longer than usual, after a page was slow, but no longer than it can catch up by.
        self._most = max(64, math.ceil(4 * _PERIOD / machine.cell.bus.scan_period))

    @property
    def signals(self) -> list[Signal]:
        """All that there are."""
        facts = self._machine.session.axes
        return [
            each
            for axis in self._machine.axes
            if axis in facts
            for each in signals_of(axis, facts[axis].parameters)
        ]

    async def serve(self, socket: WebSocket) -> None:
        """Serve one page until it is gone; each message that it sends is a choice, and one that is none ends it."""
        await socket.accept()
        self._enter()
        sender: asyncio.Task[None] | None = None
        try:
            while (choice := await self._next(socket)) is not None:
                if sender is not None:
                    sender.cancel()
                sender = asyncio.create_task(self._send(socket, choice))
        finally:
            if sender is not None:
                sender.cancel()
            self._leave()
            if socket.application_state is WebSocketState.CONNECTED:
                with suppress(RuntimeError, OSError, WebSocketDisconnect):
                    await socket.close(1008)

    async def _next(self, socket: WebSocket) -> Choice | None:
        try:
            text = await socket.receive_text()
        except (WebSocketDisconnect, RuntimeError, KeyError):
            return None
        return read(text, {signal.name for signal in self.signals})

    async def _send(self, socket: WebSocket, choice: Choice) -> None:
        facts = self._machine.session.axes
        reader = Reader(choice.signals, {axis: facts[axis].parameters for axis in facts})
        at = self._cycles.end
        try:
            while choice.signals:
                await asyncio.sleep(_PERIOD)
                fetched = self._cycles.since(at, self._most)
                at = fetched.next
                if fetched.cycles:
                    async with asyncio.timeout(_SLOW):
                        await socket.send_bytes(batch(choice.number, fetched.cycles, reader, fetched.lost))
        except (TimeoutError, WebSocketDisconnect, RuntimeError, OSError):
            with suppress(RuntimeError, OSError, WebSocketDisconnect):  # it takes none, or is gone
                await socket.close(1008)

    def _enter(self) -> None:
        self._looking += 1
        if self._looking == 1:
            self._cycles = Cycles()
            self._machine.session.observe(self._cycles.add)

    def _leave(self) -> None:
        self._looking -= 1
        if self._looking == 0:
            self._machine.session.forget(self._cycles.add)
