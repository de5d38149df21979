"""The door of a running core: a Unix socket of this user alone, by which other programs of this computer come in.

It lies in a folder that only the user may enter, under the name of the cell's file. A lock beside it, which a crash frees, says
that its core lives; with the connection a guest is handed the image of every cycle, read only.
"""

from __future__ import annotations

import fcntl
import hashlib
import mmap
import os
import socket
import stat
from contextlib import suppress
from pathlib import Path

from axisbus.bus.link.ownership import peer_of
from axisbus.errors import ScanError, StateError

_BACKLOG = 16
_PATIENCE = 5.0  # seconds that a core may take to open
_HELLO = b"a"
_LONGEST = 60  # bytes of a path before it; that of a socket may have 107


class Door:
    """The core's side; holds the lock and the socket."""

    def __init__(self, cell: str) -> None:
        """Open the door of the core of this cell file.

        Raises:
            OSError: it cannot be: another core of the same cell has one, or there is no place for it.
        """
        place = _place(cell)
        self._lock = os.open(place.with_suffix(".lock"), os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            place.unlink(missing_ok=True)  # of a core that was killed
            self._socket.bind(str(place))
            place.chmod(0o600)
            self._socket.listen(_BACKLOG)
        except OSError:
            self._socket.close()
            os.close(self._lock)
            raise
        self._place = place

    def admit(self, image: int) -> tuple[socket.socket, int] | None:
        """Wait for somebody; return the connection and their process, None where they are of another user, or the door is closed.

        ``image``: the descriptor of the images, which they are given read only.
        """
        try:
            line, _ = self._socket.accept()
        except OSError:
            return None
        process, user = peer_of(line)
        if user != os.getuid():
            line.close()
            return None
        looked_at = os.open(f"/proc/self/fd/{image}", os.O_RDONLY | os.O_CLOEXEC)
        try:
            socket.send_fds(line, [_HELLO], [looked_at])
        except OSError:
            line.close()
            return None
        finally:
            os.close(looked_at)
        return line, process

    def close(self) -> None:
        """Let nobody in any more."""
        with suppress(OSError):
            self._place.unlink()
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        os.close(self._lock)


class Visit:
    """A guest's side: what ``launch.Processes`` is to the program that opened the cell. Holds the connection, and the images."""

    warden = control = None

    def __init__(self, line: socket.socket, image: int) -> None:
        """``line`` leads to the core; ``image``: the descriptor of its images, which is closed."""
        self.line = line
        self.memory = mmap.mmap(image, 0, access=mmap.ACCESS_READ)
        os.close(image)

    def end(self) -> None:
        """Nothing is left to be ended: the core goes on."""

    def disown(self) -> None:
        """Nothing is to be let go of in a forked child."""


def knock(cell: str) -> tuple[socket.socket, int] | None:
    """Go in to the core of this cell file; return the connection, and the descriptor of its images. Blocks for a moment.

    None where there is no such core.

    Raises:
        ScanError: it lets nobody in.
    """
    line = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    line.settimeout(_PATIENCE)
    hello, descriptors = b"", list[int]()
    try:
        line.connect(str(_place(cell)))
        hello, descriptors, _, _ = socket.recv_fds(line, len(_HELLO), 1)
    except (TimeoutError, ConnectionResetError):
        pass
    except OSError:  # nobody is there
        line.close()
        return None
    if not hello or not descriptors:
        line.close()
        raise ScanError(
            f"the machine of {cell} lets nobody in",
            observed="it closed the connection, or does not answer",
            remedy="end another program that is joined to it, or the machine itself where it hangs",
        )
    line.settimeout(None)
    return line, descriptors[0]


def text_of(cell: str) -> str:
    """Return what stands for the text of a cell's file, so that both ends know whether they mean the same."""
    return hashlib.sha256(Path(cell).read_bytes()).hexdigest()


def _place(cell: str) -> Path:
    """Return the path of the door; makes its folder.

    Raises:
        StateError: the folder is not this user's alone.
    """
    folder = _folder()
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise StateError(
            f"{folder} is not a folder of this user alone",
            observed=f"owner {found.st_uid}, mode {stat.S_IMODE(found.st_mode):o}",
            remedy="remove it, or set XDG_RUNTIME_DIR to a folder of your own (mode 700)",
        )
    name = hashlib.sha256(os.fsencode(Path(cell).resolve())).hexdigest()[:24]
    return folder / f"{name}.sock"


def _folder() -> Path:
    runtime = Path(os.environ.get("XDG_RUNTIME_DIR", ""))
    if runtime.is_absolute() and runtime.is_dir() and len(os.fsencode(runtime)) < _LONGEST:
        return runtime / "axisbus"
    return Path(f"/tmp/axisbus-{os.getuid()}")  # looked at before it is used
