"""The scope's sockets: each page gets every cycle of its selected signals, in thirty batches per second."""

from __future__ import annotations

import asyncio
import math
import sys
from array import array
from collections.abc import Sequence
from struct import Struct

from starlette.websockets import WebSocket

from axisbus.machine.machine import Machine
from axisbus.web.page_socket import GONE, SLOW, end, next_text
from axisbus.web.scope.signals import Choice, ScopeBuffer, ScopeCycle, SignalReader, all_signals, read

_PERIOD = 1.0 / 30.0  # s


class Hub:
    """Buffer the last cycles while a page observes them, and nothing otherwise. Its sockets belong to one event loop."""

    def __init__(self, machine: Machine) -> None:
        """Nothing happens before ``serve``."""
        self._machine = machine
        self._cycles = ScopeBuffer()
        self._looking = 0
        # After a page was slow, a batch may be longer than usual, but only as long as needed to catch up.
        self._most = max(64, math.ceil(4 * _PERIOD / machine.cell.bus.scan_period))

    async def serve(self, socket: WebSocket) -> None:
        """Serve one page until it disconnects; each message selects signals, and an invalid message ends the connection."""
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
        except (TimeoutError, *GONE):  # the page accepts no data, or is gone
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


# -- Encode a batch of samples as bytes; each page gets thirty batches per second --------------------------------------
#
# Theory of operation
# Little-endian: four 32-bit numbers (number of the signal selection, number of samples, number of signals, number of samples lost
# before this batch), then the times (float64, s), then the values of each signal (float32), one signal after the other; NaN is
# unknown. The batch has every cycle, so that the page can draw the highest and lowest value of each line of the screen.


HEAD = Struct("<IIII")


def batch(choice: int, cycles: Sequence[ScopeCycle], reader: SignalReader, lost: int) -> bytes:
    """Return some cycles encoded for a page."""
    times = array("d", [cycle.time for cycle in cycles])
    rows = [reader.values(cycle) for cycle in cycles]
    columns = [array("f", column) for column in zip(*rows, strict=True)]
    if sys.byteorder == "big":
        for each in (times, *columns):
            each.byteswap()
    head = HEAD.pack(choice, len(cycles), reader.count, min(lost, 0xFFFF_FFFF))
    return head + times.tobytes() + b"".join(column.tobytes() for column in columns)
