"""A socket that other code of the same process may close, or replace by another file, without knowing of it.

Theory of operation
-------------------
Code that makes a daemon closes every descriptor of its process (``os.closerange``), and ``os.dup2`` replaces the file of a
descriptor. The number is then unused, or refers to another file. Python does not notice: its socket would read and write that file,
and close it in the end. Therefore the socket stores the identity of its file when it is made, and compares it before each use.

A call that waits in the kernel keeps its file open, even after its descriptor is gone: the far end does not see the end of the
connection. With ``watch_for_loss`` a reader waits in slices. The kernel then releases the file at the end of the slice, even while
another thread of the program holds the interpreter.
"""

from __future__ import annotations

import errno
import os
import socket
import struct
import sys
from contextlib import suppress

SLICE = 0.1  # seconds
_TIME = struct.Struct("ll")


def own_pair() -> tuple[OwnSocket, OwnSocket]:
    """Return two connected sockets; sending into the second one never blocks."""
    inside, outside = socket.socketpair()
    outside.setblocking(False)
    return OwnSocket(inside), OwnSocket(outside)


class OwnSocket:
    """A connected stream socket; holds the socket, and the identity of its file."""

    def __init__(self, line: socket.socket) -> None:
        """Take over ``line``, which no other code may use."""
        self._line = line
        self._file = _file_of(line)
        self._watches = False

    @property
    def lost(self) -> bool:
        """Whether its descriptor no longer refers to this socket, here or in a forked child that has closed it."""
        return self._file is None or _file_of(self._line) != self._file

    def fileno(self) -> int:
        """Return its descriptor, -1 after it has been released."""
        return self._line.fileno()

    def watch_for_loss(self) -> None:
        """Let ``recv`` notice within ``SLICE`` that the socket is lost, so that the far end notices it as well."""
        if not self.lost:
            self._line.setsockopt(
                socket.SOL_SOCKET, socket.SO_RCVTIMEO, _TIME.pack(0, int(SLICE * 1_000_000))
            )
            self._watches = True

    def recv(self, count: int) -> bytes:
        """Return at most ``count`` bytes, none at the end of the connection; blocks. Raises OSError, also if the socket is lost."""
        while True:
            self._require()
            try:
                return self._line.recv(count)
            except BlockingIOError:
                if not self._watches:
                    raise

    def send(self, data: bytes) -> None:
        """Send a few bytes; blocks if the socket does. Raises OSError as ``recv``."""
        self._require()
        self._line.send(data)

    def sendall(self, data: bytes) -> None:
        """Send all of ``data``; blocks. Raises OSError as ``recv``."""
        self._require()
        self._line.sendall(data)

    def shutdown(self, how: int) -> None:
        """End the connection in one direction or both; harmless if it has ended, or is lost."""
        if not self.lost:
            with suppress(OSError):
                self._line.shutdown(how)

    def close(self) -> None:
        """Release it; a file that has taken its descriptor stays open."""
        if self.lost:
            self._line.detach()
        else:
            self._line.close()

    def _require(self) -> None:
        if self.lost:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))


class FarEnd:
    """The program's end of a connection, seen from the other process; holds its descriptor there, and its file.

    A copy of the descriptor in a third process keeps the connection open, even if the program has closed its own.
    """

    def __init__(self, process: int, number: int, inode: int) -> None:
        """``number`` and ``inode``: those of the socket in ``process``."""
        self._path = f"/proc/{process}/fd/{number}"
        self._file = f"socket:[{inode}]"
        self._is_readable = self._found() == self._file

    @property
    def lost(self) -> bool:
        """Whether the process has closed or replaced it; False if this process has no permission to check."""
        return self._is_readable and self._found() not in (self._file, None)

    def _found(self) -> str | None:
        try:
            return os.readlink(self._path)
        except FileNotFoundError:
            return ""
        except OSError:  # it has ended, or belongs to another user now
            return None


def inode_of(line: socket.socket) -> int:
    """Return the inode by which ``FarEnd`` identifies a socket."""
    return os.fstat(line.fileno()).st_ino


def send_by_number(number: int, data: bytes) -> None:
    """Send to the socket, or write to the file, that other code has under this number. Raises OSError."""
    if sys.platform != "win32":
        os.write(number, data)
        return
    borrowed = socket.socket(fileno=number)
    try:
        borrowed.send(data)
    finally:
        borrowed.detach()


def _file_of(line: socket.socket) -> tuple[int, int] | None:
    if (
        sys.platform == "win32"
    ):  # there a socket is no file, and what closes or replaces files does not affect it
        return None if line.fileno() == -1 else (0, line.fileno())
    try:
        found = os.fstat(line.fileno())
    except OSError:
        return None
    return found.st_dev, found.st_ino
