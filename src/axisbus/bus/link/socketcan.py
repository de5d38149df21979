"""State of a SocketCAN link in Linux: whether it exists, is up, and its bitrate."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

_NET = Path("/sys/class/net")
_ARPHRD_CAN = "280"  # include/uapi/linux/if_arp.h
_IFF_UP = 1
_IP_TIMEOUT = 2.0


@dataclass(frozen=True, slots=True)
class CanInterface:
    """A CAN network interface; ``bitrate`` (bit/s) and ``queue_length`` (frames) are None if Linux does not report them."""

    name: str
    up: bool
    kind: str = "can"
    bitrate: int | None = None
    queue_length: int | None = None
    state: str = ""


def links() -> list[str]:
    """Return the names of all CAN interfaces of this computer, up or down."""
    if not _NET.is_dir():
        return []
    return sorted(entry.name for entry in _NET.iterdir() if _read(entry / "type") == _ARPHRD_CAN)


def link(name: str) -> CanInterface | None:
    """Return the state of the CAN interface ``name``, None if there is none.

    Reads sysfs, and ``ip -details -json link`` for the bitrate (blocks up to 2 s in the worst case). If ``ip`` is missing, the
    bitrate is None.
    """
    if name not in links():
        return None
    found = parse_ip(_ip(name))
    if found is not None:
        return found
    flags = int(_read(_NET / name / "flags") or "0", 16)
    length = _read(_NET / name / "tx_queue_len")
    return CanInterface(name, bool(flags & _IFF_UP), queue_length=int(length) if length.isdigit() else None)


def parse_ip(text: str) -> CanInterface | None:
    """Read the output of ``ip -details -json link show dev NAME``; None if it is not valid."""
    try:
        rows = json.loads(text)
    except ValueError:
        return None
    row = next((row for row in rows if isinstance(row, dict) and "ifname" in row), None)
    if row is None:
        return None
    info = row.get("linkinfo", {})
    data = info.get("info_data", {})
    return CanInterface(
        name=row["ifname"],
        up="UP" in row.get("flags", ()),
        kind=info.get("info_kind", "can"),
        bitrate=data.get("bittiming", {}).get("bitrate"),
        queue_length=row.get("txqlen"),
        state=data.get("state", ""),
    )


def up_command(name: str, bitrate: int | None) -> str:
    """Return the command that brings the interface up.

    ``bitrate`` is in bit/s; None for a virtual interface, or for a default of 1000000 that the user must adapt.
    """
    if name.startswith("vcan"):
        return f"sudo ip link add dev {name} type vcan; sudo ip link set {name} up"
    rate = bitrate if bitrate is not None else "1000000"
    return f"sudo ip link set {name} up type can bitrate {rate} restart-ms 100; sudo ip link set {name} txqueuelen 1000"


def restart_command(name: str) -> str:
    """Return the command that restarts a controller that is bus-off and has no ``restart-ms``."""
    return f"sudo ip link set {name} type can restart"


def change_command(name: str, bitrate: int) -> str:
    """Return the commands that change the bitrate of an interface that is up."""
    return f"sudo ip link set {name} down; {up_command(name, bitrate)}"


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii").strip()
    except OSError:
        return ""


def _ip(name: str) -> str:
    program = shutil.which("ip") or shutil.which("ip", path="/usr/sbin:/sbin")
    if program is None:
        return ""
    command = [program, "-details", "-json", "link", "show", "dev", name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_IP_TIMEOUT, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout
