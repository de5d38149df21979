"""The scope's sockets: each page gets every cycle of the signals that it chose, in thirty batches a second."""

from __future__ import annotations

import asyncio
import math

from starlette.websockets import WebSocket

from axisbus.machine.machine import Machine
from axisbus.web.scope.batch import batch
from axisbus.web.scope.cycles import ScopeBuffer
from axisbus.web.scope.signal_request import Choice, read
from axisbus.web.scope.signals import SignalReader, all_signals
from axisbus.web.sockets import GONE, SLOW, end, next_text

_PERIOD = 1.0 / 30.0  # s


class Hub:
    """Holds the last cycles while anybody looks at them; nothing is kept while nobody does. Its sockets live in one event loop."""

    def __init__(self, machine: Machine) -> None:
        """Nothing happens before ``serve``."""
        self._machine = machine
        self._cycles = ScopeBuffer()
        self._looking = 0
        # A batch may be longer than usual, after a page was slow, but no longer than it can catch up by.
        self._most = max(64, math.ceil(4 * _PERIOD / machine.cell.bus.scan_period))

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
            await end(socket)

    async def _next(self, socket: WebSocket) -> Choice | None:
        text = await next_text(socket)
        return None if text is None else read(text, {signal.name for signal in all_signals(self._machine)})

    async def _send(self, socket: WebSocket, choice: Choice) -> None:
        facts = self._machine.session.axes
        reader = SignalReader(choice.signals, {axis: facts[axis].parameters for axis in facts})
        at = self._cycles.end
        try:
            while choice.signals:
                await asyncio.sleep(_PERIOD)
                fetched = self._cycles.since(at, self._most)
                at = fetched.next
                if fetched.cycles:
                    async with asyncio.timeout(SLOW):
                        await socket.send_bytes(batch(choice.number, fetched.cycles, reader, fetched.lost))
        except (TimeoutError, *GONE):  # it takes none, or is gone
            await end(socket)

    def _enter(self) -> None:
        self._looking += 1
        if self._looking == 1:
            self._cycles = ScopeBuffer()
            self._machine.session.observe(self._cycles.add)

    def _leave(self) -> None:
        self._looking -= 1
        if self._looking == 0:
            self._machine.session.forget(self._cycles.add)
