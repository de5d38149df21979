"""python-can's bus of a socketcand server, with corrections.

- Frames are sent at once (``tcp_tune``); otherwise they wait for the server's acknowledgements.
- If there is no server, an error is raised at once. python-can retries for ten seconds at full processor load.
- If the server has gone, an error is raised. python-can then receives nothing for ever.
- A message that arrives in pieces, which TCP may do at any time, causes no warning.
- If the server does not read, this counts as a full transmit queue. python-can's ``send`` would not return. The queue is short, so
  that it contains no old frames.
"""

from __future__ import annotations

import logging
import select
import socket
import sys

import can
from can.interfaces.socketcand.socketcand import SocketCanDaemonBus

_PATIENCE = 2.0  # seconds
_QUEUE = 65_536  # bytes of the send buffer: a hundred frames or so with Linux's overhead for each
_END = "_SocketCanDaemonBus__socket"  # python-can has no other name for it


def _is_news(record: logging.LogRecord) -> bool:
    return not str(record.msg).startswith("Got incomplete message")


logging.getLogger(SocketCanDaemonBus.__module__).addFilter(_is_news)


class SocketcandBus(SocketCanDaemonBus):
    """One connection to a server; holds the end of a message that did not fit into the send buffer."""

    _rest = b""

    def __init__(self, channel: str, host: str, port: int, tcp_tune: bool = True, **options: object) -> None:
        """Connect to ``channel`` of the server on ``host`` and ``port``.

        Raises:
            OSError: there is no server. CanError: it does not serve this channel.
        """
        socket.create_connection((host, int(port)), _PATIENCE).close()
        tuned = tcp_tune and sys.platform != "win32"
        try:
            super().__init__(channel, host, int(port), tcp_tune=tuned, **options)  # type: ignore[no-untyped-call]
            self._end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _QUEUE)
        except BaseException:
            self._end.close()
            raise

    def _tcp_send(self, msg: str) -> None:
        """Write a message to the connection without waiting, after the rest of a message written in part.

        Raises:
            CanOperationError: the send buffer is full.
        """
        if sys.platform == "win32":
            super()._tcp_send(msg)
            return
        try:
            while self._rest:
                self._rest = self._rest[self._end.send(self._rest, socket.MSG_DONTWAIT) :]
            data = msg.encode("ascii")
            self._rest = data[self._end.send(data, socket.MSG_DONTWAIT) :]
        except BlockingIOError as error:
            raise can.CanOperationError("the send buffer of the connection is full", error.errno) from error

    @property
    def _end(self) -> socket.socket:
        end: socket.socket = getattr(self, _END)
        return end

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        found: tuple[can.Message | None, bool] = super()._recv_internal(timeout)  # type: ignore[no-untyped-call]
        if found[0] is None and self._is_over():
            raise can.CanOperationError("the socketcand server has closed the connection")
        return found

    def _is_over(self) -> bool:
        if sys.platform == "win32":  # no flag there keeps a single call from waiting
            return bool(select.select([self._end], [], [], 0)[0]) and not self._end.recv(1, socket.MSG_PEEK)
        try:
            return not self._end.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
