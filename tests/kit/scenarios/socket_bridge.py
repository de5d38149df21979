"""A cable between two programs: a virtual channel here and one there, joined by a socket."""

from __future__ import annotations

import socket
import struct
import threading
from contextlib import suppress

import can

_FRAME = struct.Struct("<I?B8s")  # identifier, remote frame, length, data


class Bridge:
    """Carries the frames of a channel to the other end and back, until either end goes; holds two threads."""

    def __init__(self, channel: str, end: socket.socket) -> None:
        self._bus = can.Bus(interface="virtual", channel=channel)
        self._end = end
        self._open = True
        self._threads = [
            threading.Thread(target=work, name=f"bridge {channel}", daemon=True)
            for work in (self._to_other_end, self._from_other_end)
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Cut the cable; blocks about 0.1 s."""
        self._open = False
        with suppress(OSError):  # the other end is gone already
            self._end.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join(5.0)
        self._end.close()
        self._bus.shutdown()

    def _to_other_end(self) -> None:
        while self._open:
            frame = self._bus.recv(0.1)
            if frame is None:
                continue
            try:
                self._end.sendall(
                    _FRAME.pack(frame.arbitration_id, frame.is_remote_frame, frame.dlc, bytes(frame.data))
                )
            except OSError:
                return

    def _from_other_end(self) -> None:
        with self._end.makefile("rb") as stream:
            while self._open:
                try:
                    record = stream.read(_FRAME.size)
                except OSError:
                    return
                if len(record) < _FRAME.size:
                    return
                number, remote, length, data = _FRAME.unpack(record)
                self._bus.send(
                    can.Message(
                        arbitration_id=number,
                        is_extended_id=False,
                        is_remote_frame=remote,
                        dlc=length,
                        data=None if remote else data[:length],
                    )
                )
