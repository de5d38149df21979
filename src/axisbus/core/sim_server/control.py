"""Access to the plant of served drives, for tests: a Unix socket of this user only, separate from the public bus."""

from __future__ import annotations

import os
import socket
import stat
import threading
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from axisbus.core.process.remote_proxy import answer_all
from axisbus.core.simulated_nodes import SimulatedNode
from axisbus.errors import UserError
from axisbus.ipc.messages import CODEC
from axisbus.ipc.stream import MessageStream
from axisbus.ipc.values import NotForCrossing

_BACKLOG = 16
_LARGEST = 1 << 20  # bytes of a request


class ControlDoor:
    """Gives programs of this user access to simulated drives and their fault settings; holds the socket."""

    def __init__(self, path: Path, stand_ins: Mapping[int, SimulatedNode]) -> None:
        """``path``: of the socket, which is created; a socket without a listener is replaced.

        Raises:
            UserError: it cannot be made there, or this platform has no such sockets.
        """
        self._stand_ins = stand_ins
        self._path = path
        self._socket = _listening(path)
        threading.Thread(target=self._accept, name="axisbus control", daemon=True).start()

    def close(self) -> None:
        """Accept no more connections."""
        with suppress(OSError):
            self._path.unlink()
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _accept(self) -> None:
        while True:
            try:
                line, _ = self._socket.accept()
            except OSError:
                return
            threading.Thread(target=self._answer, args=(line,), name="axisbus asked", daemon=True).start()

    def _answer(self, line: socket.socket) -> None:
        stream = MessageStream(line, CODEC.pack, "axisbus answers", _LARGEST)
        try:
            with suppress(NotForCrossing):
                answer_all(stream, self._stand_ins)
        finally:
            stream.finish()


def _listening(path: Path) -> socket.socket:
    _require_place(path)
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    before = os.umask(0o177)
    try:
        if _is_left_over(path):
            path.unlink()
        made.bind(str(path))
        made.listen(_BACKLOG)
    except OSError as error:
        made.close()
        raise UserError(
            f"{path} cannot be made the drives' control",
            observed=str(error.strerror or error),
            remedy="give a path in a folder of your own with --control, of at most 100 bytes",
        ) from error
    finally:
        os.umask(before)
    return made


def _require_place(path: Path) -> None:
    if not hasattr(socket, "AF_UNIX"):
        raise UserError(
            "--control needs sockets with a path, which this platform does not have", remedy="leave it out"
        )
    if path.exists() and not stat.S_ISSOCK(path.stat().st_mode):
        raise UserError(
            f"{path} exists already, and is not a socket", remedy="give another name with --control"
        )


def _is_left_over(path: Path) -> bool:
    """Whether a socket without a listener is there."""
    if not path.exists():
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as tried:
        try:
            tried.connect(str(path))
        except OSError:
            return True
    return False
