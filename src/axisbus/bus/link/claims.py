"""Claims: the channels and cells that processes of this computer use, published as listening Unix sockets.

Theory of operation
-------------------
A claim is an abstract Unix socket. Its name contains the claimed object: a CAN channel, the cell file, or both. The name ends in a
random token, so no program can occupy the name of another program's claim beforehand. ``/proc/net/unix`` lists the claims, whatever
the environment of the processes is. ``SO_PEERCRED`` identifies the user and the process that listen. The kernel removes a claim
when the last process that holds its descriptor is gone. Any user can make a claim; a reader of a claim must check its user.

On SocketCAN a claim also has a mark: a raw socket on the link with one filter. No CANopen frame matches the filter, and its
identifier follows from the claim's name. ``/proc/net/can`` lists the filters of each link. So every process can see that the
claim's holder has the channel open, even if the holder hangs.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import socket
import struct
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

UNKNOWN_ID = -1  # the user and the process of a claim that the kernel does not identify
_PROC = Path("/proc")
_NONE = "-"
_NAME = re.compile(
    r"axisbus ([xs])([dn]) ([0-9a-f]{16}|-) ([0-9a-f]{16}|-) ([0-9a-f]+\.[0-9a-f]+|-) ([0-9a-f]{24})"
)
_LISTENS = 0x10000  # __SO_ACCEPTCON in the flags of /proc/net/unix
_BACKLOG = 128
_CREDENTIALS = struct.Struct("3i")  # process, user and group ID (SO_PEERCRED)
_FILTER = struct.Struct("=2I")  # identifier and mask of a CAN_RAW filter
_EXACTLY = 0xDFFFFFFF  # the mask of a filter for one extended frame
_REMOTE = 0xC0000000  # an extended remote frame, which CANopen does not have


@dataclass(frozen=True, slots=True)
class CellFileId:
    """Identity of a cell file: its real path (a digest), and device and inode; a rename or a new text changes one of them."""

    path: str
    inode: str

    @classmethod
    def of(cls, file: str | Path | None) -> CellFileId:
        """Return the identity of a cell file; for None, one that matches no claim."""
        if file is None:
            return cls(_NONE, _NONE)
        real, inode = os.path.realpath(file), _NONE
        with suppress(OSError):
            found = os.stat(real)
            inode = f"{found.st_dev:x}.{found.st_ino:x}"
        return cls(digest(real), inode)

    def match(self, other: CellFileId) -> bool:
        """Whether both may belong to one file."""
        return _NONE != self.path == other.path or _NONE != self.inode == other.inode


@dataclass(frozen=True, slots=True)
class ChannelClaim:
    """An existing claim. ``exclusive``: only its holder may use the channel; ``accepts_clients``: clients can connect to its
    socket.

    ``process``, ``user`` and ``group`` are those that began to listen, or ``UNKNOWN_ID`` if the kernel does not report them.
    """

    name: str
    exclusive: bool
    accepts_clients: bool
    channel: str
    cell: CellFileId
    token: str
    process: int
    user: int
    group: int


class HeldClaim:
    """A claim of this process; holds its socket and its mark until it is closed. Child processes may inherit the descriptors."""

    def __init__(self, name: str, link: str | None) -> None:
        """Listen under ``name``; ``link``: the SocketCAN link to mark. Raises OSError."""
        self.name = name
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._mark: socket.socket | None = None
        try:
            self._mark = None if link is None else _mark(name, link)
            self._socket.bind(name)
            self._socket.listen(_BACKLOG)
        except OSError:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def fileno(self) -> int:
        """Return the descriptor of the socket."""
        return self._socket.fileno()

    @property
    def mark(self) -> int:
        """The descriptor of the mark, -1 if there is none."""
        return -1 if self._mark is None else self._mark.fileno()

    def close(self) -> None:
        """Release the claim, unless another process has inherited it."""
        self._socket.close()
        if self._mark is not None:
            self._mark.close()


def digest(text: str) -> str:
    """Return a short digest of a text, for a claim's name."""
    return hashlib.sha256(os.fsencode(text)).hexdigest()[:16]


def claim(
    channel: str | None, cell: CellFileId, *, exclusive: bool, accepts_clients: bool, link: str | None = None
) -> HeldClaim:
    """Make a claim on a channel (by its key), a cell file, or both; ``link``: the SocketCAN link to mark."""
    token = f"{time.clock_gettime_ns(time.CLOCK_BOOTTIME):016x}{secrets.token_hex(4)}"
    kind = ("x" if exclusive else "s") + ("d" if accepts_clients else "n")
    key = _NONE if channel is None else digest(channel)
    return HeldClaim(f"\0axisbus {kind} {key} {cell.path} {cell.inode} {token}", link)


def claims(*, channel: str | None = None, cell: CellFileId | None = None) -> list[ChannelClaim]:
    """Return the claims on a channel (by its key) or on a cell file, the oldest first."""
    key = None if channel is None else digest(channel)
    found = []
    for name, inode in _listening():
        exclusive, accepts_clients, claimed, path, file, token = re.fullmatch(_NAME, name[1:]).groups()  # type: ignore[union-attr]
        keys = CellFileId(path, file)
        if claimed == key or (cell is not None and cell.match(keys)):
            holder = _holder(name, inode)
            if holder is not None:
                found.append(
                    ChannelClaim(
                        name, exclusive == "x", accepts_clients == "d", claimed, keys, token, *holder
                    )
                )
    return sorted(found, key=lambda each: each.token)


def is_marked(name: str, link: str) -> bool:
    """Whether the kernel shows that the holder of this claim has the SocketCAN link open."""
    can_id, mask = _filter(name)
    rows = []
    for file in ("rcvlist_fil", "rcvlist_eff"):
        with suppress(OSError):
            rows += (_PROC / "net/can" / file).read_text("utf-8", "replace").splitlines()
    wanted = [link, f"{can_id:08x}", f"{mask:08x}"]
    return any(
        [word.lower() if at else word for at, word in enumerate(row.split()[:3])] == wanted for row in rows
    )


def peer_of(line: socket.socket) -> tuple[int, int, int]:
    """Return the process, user and group IDs at the other end of a Unix socket."""
    process, user, group = _CREDENTIALS.unpack(
        line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    )
    return int(process), int(user), int(group)


def _listening() -> Iterator[tuple[str, str]]:
    """Yield name and inode of each listening claim; reads twice, because the kernel's list is not a snapshot."""
    found: dict[str, str] = {}
    for _ in range(2):
        try:
            lines = (_PROC / "net/unix").read_text("utf-8", "replace").splitlines()
        except OSError:
            break
        for row in (line.split(maxsplit=7) for line in lines):
            is_claim = len(row) == 8 and row[7][:1] == "@" and re.fullmatch(_NAME, row[7][1:])
            if is_claim and int(row[3], 16) & _LISTENS:
                found["\0" + row[7][1:]] = row[6]
    yield from found.items()


def _holder(name: str, inode: str) -> tuple[int, int, int] | None:
    """Return the process, user and group that listen under ``name``, None if the socket no longer listens."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.setblocking(False)
        try:
            probe.connect(name)
            return peer_of(probe)
        except BlockingIOError:  # so many clients have connected that the queue is full
            return _process_with_inode(inode) or (UNKNOWN_ID, UNKNOWN_ID, UNKNOWN_ID)
        except OSError:
            return None


def _process_with_inode(inode: str) -> tuple[int, int, int] | None:
    """Return the first process that has the socket of this inode among its visible descriptors."""
    with suppress(OSError):
        folders = [folder for folder in _PROC.iterdir() if folder.name.isdigit()]
        for folder in sorted(folders, key=lambda each: int(each.name)):
            with suppress(OSError):  # it has just ended, or belongs to another user
                if any(os.readlink(each) == f"socket:[{inode}]" for each in (folder / "fd").iterdir()):
                    found = folder.stat()
                    return int(folder.name), found.st_uid, found.st_gid
    return None


def _filter(name: str) -> tuple[int, int]:
    number = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big")
    return number & 0x1FFFFFFF | _REMOTE, _EXACTLY


def _mark(name: str, link: str) -> socket.socket | None:
    """Open the link with the filter of a claim; None if the link cannot be opened, so that no process can use it."""
    mark = None
    try:
        mark = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        mark.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, _FILTER.pack(*_filter(name)))
        mark.bind((link,))
    except OSError:
        if mark is not None:
            mark.close()
        return None
    return mark
