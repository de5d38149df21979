"""Messages over a stream socket, each preceded by its length; sending never blocks the caller.

Theory of operation
-------------------
``send`` puts a message into a queue; a thread converts the messages to bytes and sends them. Therefore ``send`` may be called in a
scan's thread, and in a signal handler: it takes no lock, and wakes the thread by a byte in a socket. If the far end reads nothing,
the queue grows: ``waiting`` is its length, which a sender of many messages checks.

A connection whose sockets the process has lost (see ``own_socket``) has ended. ``watch_for_loss`` lets both ends notice that soon.
"""

from __future__ import annotations

import logging
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress

from axisbus.ipc.own_socket import OwnSocket, own_pair

log = logging.getLogger("axisbus")
_LENGTH = struct.Struct("<I")
_LARGEST = 1 << 28  # bytes; a larger length is no message
_READ = 1 << 16
_SLICE = 0.1  # seconds


class MessageStream:
    """One end of a connection; holds the queue. ``send`` is for any thread, ``messages`` for one."""

    def __init__(
        self, line: socket.socket, pack: Callable[[object], bytes], name: str, largest: int = _LARGEST
    ) -> None:
        """``line``: a connected stream socket, closed by ``close``; ``name``: of the thread that packs and sends.

        ``largest``: maximum size in bytes of a received message.
        """
        self._line = OwnSocket(line)
        self._largest = largest
        self._pack = pack
        self._queue: deque[object] = deque()
        self._wake_receiver, self._wake_source = own_pair()
        self._closing = False
        self.lost = False  # whether this process has closed or replaced one of its sockets
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """The number of messages that have not been sent."""
        return len(self._queue)

    def watch_for_loss(self) -> None:
        """Let a lost socket end the connection within ``own_socket.SLICE``, for the far end as well; before ``messages``."""
        self._line.watch_for_loss()

    def send(self, message: object) -> None:
        """Queue a message (bytes: already packed); if the connection has been closed, it is dropped."""
        if self._closing:
            return
        self._queue.append(message)
        self._wake_sender()

    def messages(self) -> Iterator[bytes]:
        """Yield each received message, until the far end is gone or has sent an invalid length; blocks."""
        while (head := self._read(_LENGTH.size)) is not None:
            length = _LENGTH.unpack(head)[0]
            message = self._read(length) if length <= self._largest else None
            if message is None:
                return
            yield message

    def close(self, wait: float = 0.0) -> None:
        """End the connection after the queue has been sent, at most ``wait`` seconds from now; harmless when repeated.

        Time in which this process does not run does not count: the last message would be lost by a pause of the computer.
        """
        if self._closing:
            return
        self._closing = True
        self._wake_sender()
        while wait > 0.0 and self._thread.is_alive():
            began, part = time.monotonic(), min(wait, _SLICE)
            self._thread.join(part)
            wait -= min(part, time.monotonic() - began)
        self._line.shutdown(socket.SHUT_RDWR)

    def end_sending(self) -> None:
        """Notify the far end that nothing more is sent; its messages can still be read until it closes."""
        self._line.shutdown(socket.SHUT_WR)

    def finish(self) -> None:
        """End the connection, and release it; for the reading thread, when there is nothing more to be read."""
        self.close()
        self._thread.join()
        self._release()

    def disown(self) -> None:
        """Release a forked child's copy, which must neither read nor send."""
        self._closing = True
        self._queue = deque()
        self._release()

    def _wake_sender(self) -> None:
        with suppress(OSError):  # full: it is awake; closed: no thread is there
            self._wake_source.send(b"\0")

    def _read(self, count: int) -> bytes | None:
        parts = bytearray()
        while len(parts) < count:
            try:
                part = self._line.recv(min(count - len(parts), _READ))
            except OSError:
                self._note_lost()
                return None
            if not part:
                return None
            parts += part
        return bytes(parts)

    def _run(self) -> None:
        try:
            while self._send_queue() and not self._closing:
                if not self._woken():
                    self._line.shutdown(socket.SHUT_RDWR)  # nothing could be sent any more
                    return
            self._send_queue()
        finally:
            self._queue.clear()

    def _woken(self) -> bool:
        """Wait until there is something to do; return False if no thread can wake this one any more."""
        try:
            woken = bool(self._wake_receiver.recv(_READ))
        except OSError:
            woken = False
        if not woken:
            self._note_lost()
        return woken

    def _note_lost(self) -> None:
        if not self._closing:
            self.lost = any(end.lost for end in (self._line, self._wake_receiver, self._wake_source))

    def _send_queue(self) -> bool:
        """Send the queue; return False if the far end is gone."""
        while self._queue:
            data = self._packed(self._queue[0])
            try:
                self._line.sendall(data)
            except OSError:
                return False
            self._queue.popleft()
        return True

    def _packed(self, message: object) -> bytes:
        """Return a message with its length; nothing for one that cannot be sent, which must not delay the others."""
        try:
            data = message if isinstance(message, bytes) else self._pack(message)
        except Exception:
            log.exception("a message could not be sent to another process: %s", type(message).__name__)
            return b""
        return _LENGTH.pack(len(data)) + data

    def _release(self) -> None:
        for end in (self._line, self._wake_receiver, self._wake_source):
            end.close()
