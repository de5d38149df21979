"""One owner of a CAN channel on this computer: a lock that other users see, and that ends with the last process which holds it.

It is an abstract Unix socket of Linux, named after the channel: nothing is left on any disk, whatever way a program ends. Its
descriptor may be inherited, so that a channel stays taken until everybody who must still stop a drive is gone.
"""

from __future__ import annotations

import os
import re
import socket
import struct
import sys
import time
from contextlib import suppress
from pathlib import Path, PurePath

from axisbus.bus.link.interfaces import NO_RATE
from axisbus.errors import SecondMasterError

_CREDENTIALS = struct.Struct("3i")  # process, user and group ID (SO_PEERCRED)
_BACKLOG = 16
_LONGEST = 100  # characters of a command
_DESCRIBED = re.compile(r"process \d+ \((.*)\), which began .*")


def take(interface: str, channel: str | int | None, *, beside: bool = False) -> socket.socket | None:
    """Take a channel for this process; return what holds it until it is closed.

    None where there is nothing to be taken: a channel without an adapter, or a platform without such locks, or ``beside``, where it
    is taken already.

    Raises:
        SecondMasterError: another program has it.
    """
    if sys.platform != "linux" or interface in NO_RATE:
        return None
    lock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    name = f"\0axisbus {interface}:{channel}"
    try:
        lock.bind(name)
        lock.listen(_BACKLOG)
    except OSError:
        lock.close()
        if beside:
            return None
        raise _taken(f"{interface}:{channel}", _holder(name)) from None
    return lock


def _holder(name: str) -> int | None:
    """Return the process that took the lock, None where it has just ended."""
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        asking.setblocking(False)  # whoever has been asked as often as its backlog is long answers no more
        asking.connect(name)
        return peer_of(asking)[0]
    return _looked_up(name.replace("\0", "@"))


def peer_of(line: socket.socket) -> tuple[int, int]:
    """Return the process and the user at the other end of a Unix socket, by their IDs."""
    process, user, _ = _CREDENTIALS.unpack(
        line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    )
    return int(process), int(user)


def _looked_up(name: str) -> int | None:
    """Return the first process that has the socket of this name among its descriptors, as far as they may be seen."""
    with suppress(OSError):
        rows = [line.split(maxsplit=7) for line in Path("/proc/net/unix").read_text().splitlines()]
        sockets = {f"socket:[{row[6]}]" for row in rows if row[7:] == [name]}
        folders = [folder for folder in Path("/proc").iterdir() if folder.name.isdigit()]
        for folder in sorted(folders, key=lambda each: int(each.name)):
            if sockets & _descriptors(folder / "fd"):
                return int(folder.name)
    return None


def _descriptors(folder: Path) -> set[str]:
    found = set()
    with suppress(OSError):  # of another user, or just closed
        for each in folder.iterdir():
            found.add(os.readlink(each))
    return found


def _taken(what: str, holder: int | None) -> SecondMasterError:
    who = "a program that is just ending" if holder is None else described(holder)
    return SecondMasterError(
        f"another program has the CAN channel {what}; nothing was sent",
        observed=f"it is held by {who}",
        heard=(who,),
        remedy="end that program, or use it for what you want; axisbus stop CELL stops the drives beside it, axisbus monitor and "
        "axisbus trace look on",
    )


def described(process: int, *, kept: bool = False) -> str:
    """Return a process by its command and its age, or, where the text is ``kept``, when it began; as far as they may be seen."""
    folder = Path(f"/proc/{process}")
    try:
        words = (folder / "cmdline").read_bytes().split(b"\0")
        ticks = int((folder / "stat").read_text().rpartition(")")[2].split()[19])
    except (OSError, ValueError, IndexError):
        return f"process {process}, which has ended: its drives are being stopped"
    age = time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    command = " ".join(" ".join(word.decode(errors="replace") for word in words if word).split())
    command = command if len(command) <= _LONGEST else command[: _LONGEST - 3] + "..."
    began = time.strftime("at %H:%M:%S", time.localtime(time.time() - age)) if kept else f"{_ago(age)} ago"
    return f"process {process} ({command}), which began {began}"


def command_of(text: str) -> str:
    """Return the command in a text of ``described``, without folders and what is of one process; "ended" where it has none."""
    found = _DESCRIBED.fullmatch(text)
    return "ended" if found is None else " ".join(PurePath(word).name for word in found[1].split())


def _ago(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
