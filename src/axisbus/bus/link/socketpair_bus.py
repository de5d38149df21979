"""python-can's bus on one end of a line between two processes of one computer (``core.process.launch.can_line``)."""

from __future__ import annotations

import select
import socket
import sys
import time
from typing import Any

import can

from axisbus.bus.link.frame_batch import FRAME
from axisbus.bus.link.raw_sockets import EXTENDED, REMOTE
from axisbus.cia301 import cob

if sys.platform != "win32":  # only Unix has them
    import fcntl
    import termios

_PAUSE = 0.05  # seconds
_NOTHING = bytes(4)  # an int of 0


class PairBus(can.BusABC):
    """One end of a line. If the other end is gone, a master's end fails; an end of drives receives nothing more.

    ``alone``: whether the other end of an end of drives is gone.
    """

    def __init__(self, end: socket.socket, *, of_drives: bool = False) -> None:
        """``end``: of a ``cable``; ``shutdown`` closes it. ``of_drives``: continue without the other end, as drives do."""
        self.alone = False
        self._of_drives = of_drives
        super().__init__(channel=f"line {end.fileno()}")
        self.channel_info = "a line between two processes"
        end.setblocking(False)
        self.socket = end
        self._poll = select.poll()
        self._poll.register(end, select.POLLIN)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002  # it never waits
        """Send a frame; raises CanOperationError if the line is full or its other end is gone."""
        number = msg.arbitration_id | (EXTENDED if msg.is_extended_id else 0)
        number |= REMOTE if msg.is_remote_frame else 0
        try:
            self.socket.send(FRAME.pack(number, msg.dlc, bytes(msg.data)))
        except OSError as error:
            if not self._of_drives:
                raise can.CanOperationError(f"Failed to transmit: {error}", error.errno) from error

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self.alone:
            time.sleep(_PAUSE if timeout is None else timeout)
            return None, False
        if not self._poll.poll(None if timeout is None else timeout * 1000):
            return None, False
        try:
            packet = self.socket.recv(FRAME.size)
        except BlockingIOError:
            return None, False
        except OSError:
            packet = b""
        if len(packet) == FRAME.size:
            return _message(packet), False
        if not self._of_drives:
            raise can.CanOperationError("Error receiving: the other end of the line has closed")
        self.alone = True
        return None, False

    def behind(self) -> bool:
        """Return whether the other end has not yet read all sent frames (Linux)."""
        try:
            left = fcntl.ioctl(self.socket, termios.TIOCOUTQ, _NOTHING)
        except (OSError, ValueError):  # the socket is closed
            return False
        return left != _NOTHING

    def fileno(self) -> int:
        """Return the descriptor of the socket."""
        return self.socket.fileno()

    def shutdown(self) -> None:
        """Close this end; harmless when repeated."""
        super().shutdown()
        self.socket.close()


def _message(packet: bytes) -> can.Message:
    number, length, data = FRAME.unpack(packet)
    options: dict[str, Any] = {
        "is_extended_id": bool(number & EXTENDED),
        "is_remote_frame": bool(number & REMOTE),
    }
    mask = cob.ID_MASK_29 if number & EXTENDED else cob.ID_MASK_11
    return can.Message(
        timestamp=time.time(),
        arbitration_id=number & mask,
        dlc=length,
        data=None if number & REMOTE else data[:length],
        **options,
    )
