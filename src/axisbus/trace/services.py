"""Services whose frames need no context: NMT, SYNC, TIME, EMCY, heartbeat (CiA 301 7.2.5 to 7.2.8) as pure functions."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import NamedTuple

from axisbus.cia301 import emcy
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.drives.plugin import DrivePlugin
from axisbus.wording import counted

_STATES = frozenset({NmtState.STOPPED, NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL})
_EPOCH = datetime(1984, 1, 1)  # of TIME_OF_DAY (CiA 301 7.1.6.5); a wall clock without a zone
_MILLISECONDS = (1 << 28) - 1
TOGGLE = 0x80


class Words(NamedTuple):
    """The text of a frame, whether it reports trouble, and its violation of the protocol."""

    what: str
    error: bool = False
    problem: str = ""


def nmt(data: bytes, node_text: Callable[[int], str]) -> Words:
    """Decode an NMT command; ``node_text`` names a node."""
    if len(data) != 2:
        return Words(counted(len(data), "byte"), problem="an NMT command has 2 bytes (CiA 301 7.2.8.2)")
    target = "all nodes" if data[1] == 0 else node_text(data[1])
    if data[0] not in NmtCommand.__members__.values():
        return Words(
            f"command {data[0]} to {target}", problem=f"{data[0]} is not an NMT command (CiA 301 7.2.8.2)"
        )
    problem = f"{data[1]} is not a node ID" if data[1] > 127 else ""
    return Words(f"{NmtCommand(data[0]).text}: {target}", problem=problem)


def sync(data: bytes) -> Words:
    """Decode a SYNC, with its counter if it has one."""
    if len(data) > 1:
        return Words(
            counted(len(data), "byte"),
            problem="SYNC has no data or a counter of one byte (CiA 301 7.2.5)",
        )
    return Words(f"counter {data[0]}" if data else "")


def time(data: bytes) -> Words:
    """Decode a TIME message: a wall clock without a time zone."""
    if len(data) != 6:
        return Words(counted(len(data), "byte"), problem="TIME has 6 bytes (CiA 301 7.2.6)")
    milliseconds = int.from_bytes(data[:4], "little") & _MILLISECONDS
    days = data[4] | data[5] << 8
    moment = _EPOCH + timedelta(days=days, milliseconds=milliseconds)
    return Words(moment.isoformat(sep=" ", timespec="milliseconds"))


def emergency(data: bytes, make: DrivePlugin) -> Words:
    """Decode an emergency message, with the texts of the standard and of the drive plug-in."""
    if len(data) < 2:
        return Words(
            counted(len(data), "byte"),
            error=True,
            problem="an emergency message has 8 bytes (CiA 301 7.2.7)",
        )
    one = emcy.parse(data, 0.0)
    register = ", ".join(emcy.register_words(one.register)) or "no error"
    parts = [emcy.describe(one.code), f"error register 0x{one.register:02X} ({register})"]
    if any(one.data):
        parts.append(f"manufacturer-specific data {one.data.hex(' ').upper()}")
    parts += make.explain(one.code, {}) if not one.is_reset else []
    short = (
        f"{counted(len(data), 'byte')}, an emergency message has 8 (CiA 301 7.2.7)" if len(data) != 8 else ""
    )
    return Words("; ".join(parts), error=not one.is_reset, problem=short)


def heartbeat(data: bytes, before: NmtState | None) -> tuple[Words, NmtState | None]:
    """Decode a node's report of its NMT state without the toggle bit; ``before`` is the previously reported state."""
    if len(data) != 1:
        return Words(counted(len(data), "byte"), problem="a heartbeat has 1 byte (CiA 301 7.2.8.3)"), before
    state = NmtState(data[0] & ~TOGGLE)
    problem = "" if state in _STATES else f"{int(state)} is not an NMT state (CiA 301 7.2.8.3)"
    change = f" (was {before.text})" if before is not None and before != state else ""
    return Words(state.text + change, problem=problem), state
