"""Single owner of a CAN channel on this computer: a lock that other users see, and that ends with its last holder.

Theory of operation
-------------------
The lock is an exclusive claim on the channel (``claims``). It leaves nothing on a disk, however a program ends. Child processes may
inherit its descriptors, so a channel stays locked until every process that must still stop a drive is gone. A process makes its own
claim first and then looks for others; if it sees another claim, it withdraws its own. So two processes never get the channel at the
same time.

Any user can make a claim, so a claim blocks others only if its holder can own the bus (``_counts``):

- the holder is the same user or root;
- on SocketCAN, the kernel shows that the holder has the link open (the claim's mark);
- if the channel is a device file, the holder may read and write that file;
- with any other adapter this is unknown, so the claim counts: a refusal moves nothing, and ``axisbus stop`` needs no lock.

Two names of one adapter are one channel (``Adapter``).

macOS and Windows have no such sockets: there the lock is a file (``system.file_lock``), which only programs of the same user see.
"""

from __future__ import annotations

import logging
import os
import random
import re
import socket
import stat
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePath

from axisbus.bus.link.claims import CellFileId, ChannelClaim, HeldClaim, claim, claims, is_marked
from axisbus.bus.link.interfaces import NO_RATE
from axisbus.errors import SecondMasterError
from axisbus.system.file_lock import FileLock, text_of

if sys.platform != "win32":
    import pwd

log = logging.getLogger("axisbus")
_ROOT = 0
_TRIES = 20  # for a channel that other processes try to take at the same time
_GIVES_WAY = 0.05  # seconds, at most, until the next try
_LONGEST = 100  # characters of a command
_DESCRIBED = re.compile(r"process \d+ \((.*)\), which began .*")
_OLD_NAMES = re.compile(r"_(native|ctypes)$")  # of python-can's socketcan


@dataclass(frozen=True, slots=True)
class Adapter:
    """A CAN adapter by properties that are the same under all of its names.

    ``key``: the text that identifies the channel in claims; ``link``: the SocketCAN link, if the kernel has it; ``device``: the
    device file, if the channel is one.
    """

    key: str
    socketcan: bool = False
    link: str | None = None
    device: Path | None = None

    @classmethod
    def of(cls, interface: str, channel: str | int | None) -> Adapter:
        """Return the adapter that python-can would open; does not open it."""
        kind, text = kind_of(interface), "" if channel is None else str(channel).strip()
        if kind == "socketcan":
            link = _link(text)
            return cls(f"socketcan:{link or text}", True, link)
        if text.startswith("/"):
            # The text after it is the rate of the serial line.
            device = Path(os.path.realpath(text.partition("@")[0]))
            with suppress(OSError):
                found = device.stat()
                if stat.S_ISCHR(found.st_mode):
                    return cls(f"device:{os.major(found.st_rdev)}:{os.minor(found.st_rdev)}", device=device)
            return cls(f"device:{device}")
        return cls(f"{kind}:{_handle(kind, text)}")


def take(interface: str, channel: str | int | None, *, beside: bool = False) -> HeldClaim | FileLock | None:
    """Take a channel for this process; return the lock that holds it until closed: on Linux a claim, elsewhere a lock file.

    Returns None in three cases: the channel has no adapter, ``beside`` is set and another program has the channel, or the lock file
    cannot be written.

    Raises:
        SecondMasterError: another program has it.
    """
    if sys.platform == "linux":
        return take_claim(interface, channel, beside=beside)
    if kind_of(interface) in NO_RATE:
        return None
    key, what = Adapter.of(interface, channel).key, f"{interface}:{channel}"
    try:
        lock = FileLock.take(key, f"process {os.getpid()} ({_shortened(' '.join(sys.argv))})")
    except OSError as error:
        log.warning("%s cannot be locked, so another program could use it too: %s", what, error)
        return None
    if lock is None and not beside:
        raise _taken(what, text_of(key) or "a program that has just begun")
    return lock


def take_claim(
    interface: str,
    channel: str | int | None,
    *,
    beside: bool = False,
    cell: str | None = None,
    accepts_clients: bool = False,
) -> HeldClaim | None:
    """Take a channel on Linux, as ``take``. ``cell``: the cell file for which it is taken; ``accepts_clients``: clients will
    connect to the socket of the claim. Raises as ``take``.
    """
    if kind_of(interface) in NO_RATE:
        return None
    adapter, keys = Adapter.of(interface, channel), CellFileId.of(cell)
    for _ in range(_TRIES):
        other = _other(adapter, "")
        if other is not None:
            break
        lock = claim(adapter.key, keys, exclusive=True, accepts_clients=accepts_clients, link=adapter.link)
        other = _other(adapter, lock.name)
        if other is None:
            return lock
        lock.close()  # taken at the same time: the first to come back gets it
        time.sleep(random.uniform(0.0, _GIVES_WAY))
    if beside:
        return None
    assert other is not None
    user = "" if other.user == os.geteuid() else f", of user {user_name(other.user)}"
    raise _taken(f"{interface}:{channel}", described(other.process), user)


def hold(
    interface: str, channel: str | int | None, cell: str, *, beside: bool, simulated: bool
) -> HeldClaim | FileLock | None:
    """Take a channel for the machine of a cell in this process, as ``take``; on Linux also publish that the machine runs."""
    if sys.platform == "linux":
        return hold_claim(interface, channel, cell, beside=beside, accepts_clients=False, simulated=simulated)
    return None if simulated else take(interface, channel, beside=beside)


def hold_claim(
    interface: str,
    channel: str | int | None,
    cell: str,
    *,
    beside: bool,
    accepts_clients: bool,
    simulated: bool,
) -> HeldClaim:
    """Take a channel for the machine of a cell on Linux; if there is none to take, only publish that the machine runs.

    Raises as ``take``.
    """
    lock = (
        None
        if simulated
        else take_claim(interface, channel, beside=beside, cell=cell, accepts_clients=accepts_clients)
    )
    return lock or claim(None, CellFileId.of(cell), exclusive=False, accepts_clients=accepts_clients)


def holder(interface: str, channel: str | int | None) -> ChannelClaim | None:
    """Return the claim of the program that has a channel, None if there is none."""
    if sys.platform != "linux" or kind_of(interface) in NO_RATE:
        return None
    return _other(Adapter.of(interface, channel), "")


def kind_of(interface: str) -> str:
    """Return python-can's name of an interface for any spelling."""
    return _OLD_NAMES.sub("", interface.strip().casefold())


def _other(adapter: Adapter, own: str) -> ChannelClaim | None:
    """Return the oldest claim that blocks the adapter, except the one named ``own``."""
    found = [each for each in claims(channel=adapter.key) if each.exclusive and each.name != own]
    for each in found:
        if _counts(each, adapter):
            return each
        log.warning(
            "a program of another user claims %s without permission, so its claim is ignored: user %d, %s",
            adapter.key,
            each.user,
            described(each.process),
        )
    return None


def _counts(other: ChannelClaim, adapter: Adapter) -> bool:
    """Whether the holder of a claim can own the bus; see the theory of operation."""
    if other.user in (os.geteuid(), _ROOT):
        return True
    if adapter.socketcan:
        return adapter.link is not None and is_marked(other.name, adapter.link)
    return adapter.device is None or _may_open(adapter.device, other)


def _may_open(device: Path, other: ChannelClaim) -> bool:
    """Whether the user of a claim may read and write a device file, by its mode; an access list is assumed to permit it."""
    try:
        found = device.stat()
        if "system.posix_acl_access" in os.listxattr(device):
            return True
    except OSError:
        return False
    shift = 6 if found.st_uid == other.user else 3 if found.st_gid in _groups(other) else 0
    return (found.st_mode >> shift) & 0o6 == 0o6


def _groups(other: ChannelClaim) -> set[int]:
    with suppress(KeyError):
        return {other.group, *os.getgrouplist(pwd.getpwuid(other.user).pw_name, other.group)}
    return {other.group}


def _link(name: str) -> str | None:
    """Return the kernel's name of a network link, also for an alternative name; None if there is no such link."""
    try:
        return socket.if_indextoname(socket.if_nametoindex(name))
    except (OSError, ValueError):
        return None


def _handle(kind: str, channel: str) -> str:
    """Return a channel of an adapter without a device file in a normalised spelling."""
    if not channel.isdecimal():
        return channel
    if kind == "pcan":
        from can.interfaces.pcan.basic import PCAN_CHANNEL_NAMES

        handles = {handle.value: name for name, handle in PCAN_CHANNEL_NAMES.items()}
        return handles.get(int(channel), channel)
    return str(int(channel))


def _taken(what: str, who: str, user: str = "") -> SecondMasterError:
    return SecondMasterError(
        f"another program has the CAN channel {what}; nothing was sent",
        observed=f"it is used by {who}{user}",
        heard=(who,),
        remedy="if that program is starting a machine (axisbus run), wait until it has booted, and give the command again, "
        "which then joins it; otherwise end that program, or use it instead; axisbus stop CELL stops the drives "
        "without it, axisbus monitor and axisbus trace only read",
    )


def user_name(user: int) -> str:
    """Return a user by name, or by ID if it has no name."""
    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return str(user) if user >= 0 else "unknown"


def described(process: int, *, kept: bool = False) -> str:
    """Return a text with a process's command and age (start time if ``kept``), as far as they are visible."""
    folder = Path(f"/proc/{process}")
    try:
        words = (folder / "cmdline").read_bytes().split(b"\0")
        ticks = int((folder / "stat").read_text("utf-8", "replace").rpartition(")")[2].split()[19])
    except (OSError, ValueError, IndexError):
        return f"process {process}, which has ended: its drives are being stopped"
    age = time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    command = " ".join(" ".join(word.decode(errors="replace") for word in words if word).split())
    command = "".join(each if each.isprintable() else "?" for each in command)  # any user can write it
    command = _shortened(command)
    began = time.strftime("at %H:%M:%S", time.localtime(time.time() - age)) if kept else f"{_ago(age)} ago"
    return f"process {process} ({command}), which began {began}"


def _shortened(command: str) -> str:
    return command if len(command) <= _LONGEST else command[: _LONGEST - 3] + "..."


def command_of(text: str) -> str:
    """Return the command from a text of ``described``, without folders and process-specific parts; "ended" if the text has none."""
    found = _DESCRIBED.fullmatch(text)
    return "ended" if found is None else " ".join(PurePath(word).name for word in found[1].split())


def _ago(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
