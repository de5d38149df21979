"""The WebSockets of the page: send values, receive requests, send the cycles of a scope; all in one event loop."""

from __future__ import annotations

import asyncio
import json
import logging
import math
import sys
import time
from array import array
from collections.abc import Callable, Sequence
from contextlib import suppress
from struct import Struct

from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from axisbus.machine.machine import Machine
from axisbus.web.access.middleware import SESSION
from axisbus.web.access.tokens import PageSession
from axisbus.web.commands.clients import PageClient, PageClients, is_ahead
from axisbus.web.scope.signals import Choice, ScopeBuffer, ScopeCycle, SignalReader, all_signals, read
from axisbus.web.view import Values, all_axes, whole_cell

log = logging.getLogger("axisbus")
_HOLD_TIME = 1.0  # seconds for which this server may hang before all motion started by its pages halts
_CONTINUOUS = 0.3  # the same while an axis moves until it is halted
_POLL_PERIOD, _VALUES, _CELL = (
    0.02,
    0.1,
    0.5,
)  # seconds between two checks of held jogs, of the axes, and of everything else


class PageSocket:
    """Hold the clients, the newest values as text, and an event that signals new ones."""

    def __init__(
        self,
        machine: Machine,
        clients: PageClients,
        status_lines: Callable[[], list[str]],
        add_axes: Callable[[], None],
    ) -> None:
        """Nothing happens before ``run``; ``status_lines`` returns lines about the bus, the cycle and the programs, and may block.

        ``add_axes`` adds axes that have joined to the pages.
        """
        self._machine = machine
        self._clients = clients
        self._status_lines = status_lines
        self._add_axes = add_axes
        self._axes = self._cell = "null"
        self._cell_time = time.monotonic()
        self._new_values = asyncio.Event()

    async def run(self) -> None:
        """Update the values cyclically, until cancelled."""
        cell = asyncio.create_task(self._update_cell())
        try:
            await self._update()
        finally:
            cell.cancel()

    async def serve(self, socket: WebSocket) -> None:
        """Serve one page until it disconnects."""
        session: PageSession = socket.scope[SESSION]
        await socket.accept()
        client = self._clients.admit(session, socket.client.host if socket.client else "an unknown address")
        writer = asyncio.create_task(self._write(socket, client))
        try:
            while (text := await next_text(socket)) is not None:
                self._clients.receive(client, text, time.monotonic())
                await asyncio.sleep(0)  # a flood of messages must not keep other pages from being heard
        finally:
            self._clients.remove(client)
            writer.cancel()
            await end(socket)

    async def _update(self) -> None:
        due = 0.0
        while True:
            now = time.monotonic()
            self._clients.poll(now)
            if now >= due:
                due = now + _VALUES
                self._machine.hold_to_run(_HOLD_TIME, _CONTINUOUS)
                self._add_joined_axes()
                self._axes = self._shown(now)
                self._new_values.set()
                self._new_values = asyncio.Event()
            await asyncio.sleep(_POLL_PERIOD)

    def _add_joined_axes(self) -> None:
        """Add the axes that have joined to the pages; if that fails, everything else continues."""
        try:
            self._add_axes()
        except Exception:
            log.exception("a new axis could not be added to the pages")

    def _shown(self, now: float) -> str:
        """Return the values of the axes as text, or "null" if they cannot be read: the page shows that; its stops still work."""
        try:
            return json.dumps(all_axes(self._machine, now))
        except Exception:
            log.exception("the values of the axes cannot be shown")
            return "null"

    async def _update_cell(self) -> None:
        """Update the state of the cell in a thread, so that slow queries to the core do not block the event loop."""
        while True:
            with suppress(
                Exception
            ):  # the machine is being closed: the axes show that, and the last state stays, with its age
                seen = await asyncio.to_thread(self._cell_values)
                self._cell, self._cell_time = json.dumps(seen), time.monotonic()
            await asyncio.sleep(_CELL)

    def _cell_values(self) -> Values:
        return whole_cell(self._machine, self._status_lines(), time.monotonic())

    async def _write(self, socket: WebSocket, client: PageClient) -> None:
        """Send the newest values; a slow page misses the values in between, and a page that accepts none is disconnected."""
        sent, sent_at = "", 0.0
        try:
            while True:
                if is_ahead(sent_at, client.seen):  # it would queue up, and be old when it is shown
                    await self._new_values.wait()
                    continue
                sent_at = time.monotonic()
                cell = "" if self._cell is sent else f', "cell": {self._cell}'
                sent = self._cell
                own_values = json.dumps(self._own(client, sent_at))
                async with asyncio.timeout(SLOW):
                    await socket.send_text(f'{{"axes": {self._axes}, "own": {own_values}{cell}}}')
                await self._new_values.wait()
        except (TimeoutError, *DISCONNECTED):
            self._clients.remove(client)

    def _own(self, client: PageClient, now: float) -> Values:
        messages, client.messages = client.messages, []
        holder = self._clients.lease.holder
        return {
            "who": client.identity.page_name,
            "role": client.identity.role.value,
            "looks": self._clients.observes_only,
            "mine": self._clients.lease.held_by(client.identity),
            "holder": None if holder is None else holder.page_name,
            "held": client.deadman.axis,
            "press": client.deadman.press,
            "now": now,
            "heard": client.last_sent,
            "dead": self._machine.session.dead,
            "cell_age": now - self._cell_time,
            "boots": self._clients.boots.unread(),
            "objects": self._clients.objects.unread(client.identity.number, now),
            "page": client.identity.number,
            "verified": self._verified(client),
            "configured": self._configured(client),
            "trial": self._clients.trials.unread(client.identity.number),
            "told": [{"kind": one.kind, "text": one.text, "remedy": one.remedy} for one in messages],
        }

    def _verified(self, client: PageClient) -> Values | None:
        """Return the progress of the verification, if it has changed since it was last sent to the page."""
        now = self._clients.objects.verified
        if now is None or now is client.verified:
            return None
        client.verified = now
        return now.as_values()

    def _configured(self, client: PageClient) -> Values | None:
        """Return the progress of the configuration job, if it has changed since it was last sent to the page."""
        now = self._clients.objects.configured
        if now is None or now is client.configured:
            return None
        client.configured = now
        return now.as_values()


# -- Common functions of the page's own sockets: receive a text, detect a page that accepts nothing, close a socket --------

SLOW = 5.0  # seconds that a page may take for one message before it is disconnected
DISCONNECTED = (WebSocketDisconnect, RuntimeError, OSError)  # raised by sending if a page is gone
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
        with suppress(*DISCONNECTED):
            await socket.close(_POLICY_VIOLATED)


# -- The scope's sockets: each page gets every cycle of its selected signals, in thirty batches per second -----------------

_PERIOD = 1.0 / 30.0  # s


class Hub:
    """Buffer the last cycles while a page observes them, and nothing otherwise. Its sockets belong to one event loop."""

    def __init__(self, machine: Machine) -> None:
        """Nothing happens before ``serve``."""
        self._machine = machine
        self._cycles = ScopeBuffer()
        self._observers = 0
        # After a page was slow, a batch may be longer than usual, but only as long as needed to catch up.
        self._max_cycles = max(64, math.ceil(4 * _PERIOD / machine.cell.bus.scan_period))

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
            self._remove_observer()
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
                fetched = self._cycles.since(at, self._max_cycles)
                at = fetched.next
                if fetched.cycles:
                    async with asyncio.timeout(SLOW):
                        await socket.send_bytes(batch(choice.number, fetched.cycles, reader, fetched.lost))
        except (TimeoutError, *DISCONNECTED):  # the page accepts no data, or is gone
            await end(socket)

    def _enter(self) -> None:
        self._observers += 1
        if self._observers == 1:
            self._cycles = ScopeBuffer()
            self._machine.session.observe(self._cycles.add)

    def _remove_observer(self) -> None:
        self._observers -= 1
        if self._observers == 0:
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
