"""A socketcand server on this computer that connects client programs with the simulated nodes of a cell.

Each frame that a client sends reaches all other clients and the simulated nodes; each frame of the simulated nodes reaches all
clients. The server disconnects a client that does not read, or that sends anything but messages: neither may hold up the bus. A
client that sends faster than the simulated nodes can read waits for them, as it would wait for a full bus.
"""

from __future__ import annotations

import queue
import select
import socket
import sys
import threading
import time
from contextlib import suppress
from typing import Any

import can

from axisbus.errors import AdapterError
from axisbus.sim.socketcand_protocol import GREETING, QUIET, Dialogue, Frame, frame_text

LOOPBACK = "127.0.0.1"  # no other computer may join this bus
_MAX_CLIENTS = 32  # clients
_READ_SIZE = 4096  # bytes
_WAITING = 1024  # frames in the queue to the simulated nodes
_PATIENCE = 1.0  # s for which they may read no frame
_QUICK_ACK = getattr(
    socket, "TCP_QUICKACK", None
)  # without it, a client that waits for acknowledgements holds back its frames for 40 ms

_AT_ONCE = getattr(socket, "MSG_DONTWAIT", None)  # not on Windows


class Server:
    """Server on a TCP port, with its connected clients; ``bus`` is the bus of the simulated nodes."""

    def __init__(self, port: int, channel: str = "") -> None:
        """``port`` 0: any free port; ``channel``: name of the bus, by default ``sim`` and the port.

        Raises:
            AdapterError: the port is in use.
        """
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        if sys.platform != "win32":  # on Windows this option would let two servers share a port
            self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._listener.bind((LOOPBACK, port))
        except OSError as error:
            self._listener.close()
            raise AdapterError(
                f"port {port} of this computer cannot be served",
                observed=str(error.strerror),
                remedy="another program has it: give another one with --port, or 0 for any that is free",
            ) from error
        self._listener.listen(_MAX_CLIENTS)
        self.port: int = self._listener.getsockname()[1]
        self.channel = channel or f"sim{self.port}"
        self.bus = ServedBus(self)
        self._clients: tuple[_Client, ...] = ()
        self._lock = threading.Lock()
        self._closed = False
        threading.Thread(target=self._accept, name="axisbus serves", daemon=True).start()

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    def distribute(self, frame: Frame, origin: _Client | None) -> None:
        """Send a frame to all but its origin (None: the simulated nodes, for which this call does not block).

        Raises:
            queue.Full: the simulated nodes have read no frame for 1 s.
        """
        if origin is not None:
            self.bus.received.put(frame, timeout=_PATIENCE)
        text = frame_text(frame, time.time())
        for client in self._clients:
            if client is not origin:
                client.send_frame(text)

    def dismiss(self, client: _Client) -> None:
        """Remove a client."""
        with self._lock:
            self._clients = tuple(one for one in self._clients if one is not client)

    def close(self) -> None:
        """Disconnect all clients. Harmless when repeated."""
        self._closed = True
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for client in self._clients:
            client.close()

    def _accept(self) -> None:
        while not self._closed:
            try:
                line, _ = self._listener.accept()
            except OSError:
                return
            if len(self._clients) >= _MAX_CLIENTS:
                line.close()
                continue
            client = _Client(self, line)
            with self._lock:
                self._clients = (*self._clients, client)
            client.start()


class _Client:
    """One connection; holds its dialogue, and the time from which it may receive frames."""

    def __init__(self, server: Server, line: socket.socket) -> None:
        self._server = server
        self._line = line
        self._dialogue = Dialogue(server.channel)
        self._frames_from = float("inf")
        self._sending = threading.Lock()
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def start(self) -> None:
        """Start to receive, in a separate thread."""
        threading.Thread(target=self._run, name="axisbus served", daemon=True).start()

    def send_frame(self, text: bytes) -> None:
        """Send a frame, if the client may receive frames; does not block: a client that does not read is disconnected."""
        if time.monotonic() >= self._frames_from:
            self._send(text)

    def close(self) -> None:
        """End the connection."""
        with suppress(OSError):
            self._line.shutdown(socket.SHUT_RDWR)

    def _send(self, text: bytes) -> None:
        try:
            with self._sending:
                complete = _sent_now(self._line, text)
        except OSError:
            complete = False
        if not complete:
            self._frames_from = float("inf")
            self.close()

    def _run(self) -> None:
        self._send(GREETING)
        try:
            while data := self._line.recv(_READ_SIZE):
                self._take(data)
        except (OSError, queue.Full):
            pass
        finally:
            self._server.dismiss(self)
            self._line.close()

    def _take(self, data: bytes) -> None:
        if _QUICK_ACK is not None:
            self._line.setsockopt(socket.IPPROTO_TCP, _QUICK_ACK, 1)
        dialogue = self._dialogue
        was_raw = dialogue.raw
        answers, frames = dialogue.take(data)
        if answers:
            self._send(answers)
        if dialogue.raw and not was_raw:
            self._frames_from = time.monotonic() + QUIET
        for frame in frames:
            self._server.distribute(frame, self)
        if dialogue.is_overlong:
            self.close()


def _sent_now(line: socket.socket, text: bytes) -> bool:
    """Send a text completely and without blocking; return whether this succeeded."""
    if _AT_ONCE is not None:
        return line.send(text, _AT_ONCE) == len(text)
    return bool(select.select([], [line], [], 0)[1]) and line.send(text) == len(text)


class ServedBus(can.BusABC):
    """The simulated nodes' end of a server, as a bus of python-can."""

    def __init__(self, server: Server) -> None:
        super().__init__(channel=server.channel)
        self.channel_info = f"simulated drives served on port {server.port}"
        self.received: queue.Queue[Frame] = queue.Queue(_WAITING)
        self._server = server

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002  # it never blocks
        """Send a frame of the simulated nodes to all clients."""
        self._server.distribute(Frame(msg.arbitration_id, bytes(msg.data), msg.is_extended_id), None)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            can_id, data, extended = self.received.get(timeout=timeout)
        except queue.Empty:
            return None, False
        message: Any = can.Message(
            timestamp=time.time(), arbitration_id=can_id, data=data, is_extended_id=extended
        )
        return message, False

    def shutdown(self) -> None:
        """Disconnect all clients."""
        super().shutdown()
        self._server.close()
