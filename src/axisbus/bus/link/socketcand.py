"""python-can's bus of a socketcand server, with what it needs here.

Frames go out at once (``tcp_tune``), else they wait for the server's acknowledgements; a server that is not there is told at once,
where python-can tries for ten seconds with all its might; one that has gone away is told, where python-can hears nothing for ever;
and of a message that comes in pieces, as TCP may bring it at any time, nobody is warned. A server that reads no more is a transmit
queue that is full, where python-can's ``send`` would not return; the queue is short, so that no frame of long ago is in it.
"""

from __future__ import annotations

import logging
import os
import socket

import can
from can.interfaces.socketcand.socketcand import SocketCanDaemonBus

_PATIENCE = 2.0  # seconds
_QUEUE = 65_536  # bytes of the send buffer: some hundred frames with what Linux counts for each
_END = "_SocketCanDaemonBus__socket"  # python-can has no other name for it


def _is_news(record: logging.LogRecord) -> bool:
    return not str(record.msg).startswith("Got incomplete message")


logging.getLogger(SocketCanDaemonBus.__module__).addFilter(_is_news)


class SocketcandBus(SocketCanDaemonBus):
    """One connection to a server; holds the end of a message for which there was no room."""

    _rest = b""

    def __init__(self, channel: str, host: str, port: int, tcp_tune: bool = True, **options: object) -> None:
        """Connect to ``channel`` of the server on ``host`` and ``port``.

        Raises:
            OSError: there is no server. CanError: it does not serve this channel.
        """
        socket.create_connection((host, int(port)), _PATIENCE).close()
        tuned = tcp_tune and os.name != "nt"
        try:
            super().__init__(channel, host, int(port), tcp_tune=tuned, **options)  # type: ignore[no-untyped-call]
            self._end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _QUEUE)
        except BaseException:
            self._end.close()
            raise

    def _tcp_send(self, msg: str) -> None:
        """Give a message to the connection, without waiting; the end of one that had room for its beginning goes first.

        Raises:
            CanOperationError: there is no room.
        """
        if os.name == "nt":
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
        try:
            return not self._end.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
