"""Write one object manually and safely: the checks before anything is sent, and the read-back of the result.

Theory of operation
-------------------
Two rules, in this order:

1. The checks that need only files come before any access to the bus: existence, access, type, limits, and whether the object can
   energise or move a drive (``MOVING``, and the make's calibration objects).
2. The checks on the node follow; they only read. Is one of its drives energised (then each write may move it)? If the
   object can move a drive, does another master control the node? Does the object have the size of its type? Only then is
   one write sent, and read back.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial

from axisbus.bus.node.node import CanopenNode
from axisbus.bus.sdo.access import ByObjects
from axisbus.bus.sdo.value import checked_bytes
from axisbus.cia301 import cob
from axisbus.cia301 import objects as c301
from axisbus.cia301.datatypes import DataType, Value, decode, size_in_bytes
from axisbus.cia301.nmt import watched_node
from axisbus.cia301.sdo import if_served, number_if_served
from axisbus.cia402 import objects as c402
from axisbus.cia402 import state
from axisbus.cia402.axes import COUNT, first_axis, own_index
from axisbus.cia402.objects import MOVING
from axisbus.drives import registry
from axisbus.eds.dictionary import DictionaryEntry
from axisbus.eds.model import Eds
from axisbus.errors import ArgumentError, StateError
from axisbus.wording import counted

LISTEN = 0.5  # seconds of listening for another master
_PRODUCES_SYNC = 1 << 30  # of 1005h (CiA 301 7.5.2.5)
_STATUSWORDS = tuple(own_index(c402.STATUSWORD, axis) for axis in range(1, COUNT + 1))

# Objects whose written value is a command: the value that they read back is unrelated.
_COMMANDS = frozenset({c301.STORE_PARAMETERS, c301.RESTORE_DEFAULTS, c301.PREDEFINED_ERROR_FIELD})
_MAY_MOVE = "add --may-move if you intend this, with no person in the machine and the emergency stop at hand"


@dataclass(frozen=True, slots=True)
class Written:
    """The result of a write: the values before and after (None if the object cannot be read)."""

    before: Value | None
    after: Value | None
    compared: bool

    def agrees(self, wanted: Value) -> bool:
        """Whether the node holds the written value, or the value cannot be compared."""
        if not self.compared or self.after is None or self.after == wanted:
            return True
        return isinstance(wanted, float) and math.isclose(
            float(self.after), wanted, rel_tol=1e-6
        )  # a REAL32 is rounded

    def result_text(self, wanted: Value, shown: Callable[[Value | None], str]) -> str:
        """Return the result in words, for display after the object; ``shown`` formats a value, None if it is unknown."""
        if not self.agrees(wanted):
            return (
                f"reads back {shown(self.after)}, written was {shown(wanted)}: the drive limits or rounds it"
            )
        read_back = (
            "read back" if self.compared and self.after is not None else "accepted, cannot be compared"
        )
        return f"{shown(self.before)} -> {shown(wanted)}, {read_back}"


def require_writable(eds: Eds | None, node_id: int, entry: DictionaryEntry, kind: DataType | None) -> None:
    """Check in the EDS that the node has the object and that it is writable; ``kind`` is a type given by the user.

    Raises:
        ArgumentError: the node does not have the object, or it is not writable.
    """
    if eds is None:
        return
    variable = eds.get(entry.index, entry.subindex)
    if variable is None and kind is None:
        raise ArgumentError(
            f"node {node_id} has no object {entry}",
            observed=f"{eds.source} does not have it",
            remedy="with --type the node is asked nevertheless",
        )
    if variable is not None and not variable.writable:
        raise ArgumentError(
            f"node {node_id}: {entry} cannot be written",
            observed=f"{eds.source}:{variable.line}: its access is {variable.access}",
        )


def require_harmless(eds: Eds | None, node_id: int, entry: DictionaryEntry) -> None:
    """Check that the object cannot energise or move a drive.

    Raises:
        StateError: it can.
    """
    if moves(eds, entry):
        raise StateError(
            f"node {node_id}: writing {entry} can energise the drive, move it, or release its load; nothing was sent",
            remedy=_MAY_MOVE,
        )


def write(
    node: CanopenNode, entry: DictionaryEntry, value: Value, kind: DataType | None, *, may_move: bool
) -> Written:
    """Check on the node that the write is allowed, write once, and read back; blocks for several transfers.

    ``kind`` is a type given by the user.

    Raises:
        ArgumentError, LimitError: a value that the type or the EDS's limits do not allow; nothing was sent.
        StateError: without ``may_move``: as ``require_harmless``, or a drive of the node is energised. With ``may_move``: the
            object can energise or move a drive, and another master is on the bus.
        ArgumentError: the object's size in the device differs from its type.
        SdoError, BusError: as ``SdoClient.upload``.
    """
    data = checked_bytes(entry, value, kind)
    if not may_move:
        require_harmless(node.eds, node.node_id, entry)
        _require_at_rest(node)
    elif moves(node.eds, entry):
        require_no_other_master(node)
    return _write(node, entry, data, kind or entry.data_type)


def write_in_machine(
    node: ByObjects, entry: DictionaryEntry, value: Value, kind: DataType | None, *, may_move: bool
) -> Written:
    """Do the same as ``write`` while a machine runs: only the machine's commands may then energise or move a drive.

    Raises:
        StateError: the object can energise or move a drive; or a drive of the node is energised and ``may_move`` is not set.
        The other errors of ``write``.
    """
    data = checked_bytes(entry, value, kind)
    if moves(node.eds, entry):
        raise StateError(
            f"node {node.node_id}: writing {entry} can energise the drive or move it; only the commands of the running "
            "machine may do that; nothing was sent",
            remedy="use them (axisbus enable, move, home, reset), or end the machine first",
        )
    if not may_move:
        _require_at_rest(node)
    return _write(node, entry, data, kind or entry.data_type)


def _write(node: ByObjects, entry: DictionaryEntry, data: bytes, known: DataType | None) -> Written:
    before = _read(node, entry)
    _require_size(node, entry, known, before)
    node.sdo.download(entry.index, entry.subindex, data)
    if entry.index in _COMMANDS:
        return Written(
            _typed(before, known), None, False
        )  # some drives restart now, and do not answer for a while
    return Written(_typed(before, known), _typed(_read(node, entry), known), True)


def energised(node: ByObjects) -> list[str]:
    """Return the energised drives of a node, in words; blocks for a transfer for each axis."""
    found = []
    for index in _STATUSWORDS:
        if index != c402.STATUSWORD and node.eds is not None and index not in node.eds:
            continue
        word = number_if_served(node.sdo.upload, index)
        if word is None and node.eds is None:
            break  # without an EDS, the first missing axis is taken as the end
        if word is not None and state.decode(word) in state.ENERGISED:
            found.append(f"{index:04X}h is 0x{word:04X}: {state.decode(word).value}")
    return found


def is_command(index: int) -> bool:
    """Whether writing an object is a command, and not a setting that could be stored."""
    return index in _COMMANDS or first_axis(index) in MOVING


def moves(eds: Eds | None, entry: DictionaryEntry) -> bool:
    """Whether an object can energise, move or calibrate a drive."""
    calibrates = eds is not None and registry.make_of(eds).calibrates(entry.index, entry.subindex)
    return calibrates or first_axis(entry.index) in MOVING


def require_not_energised(
    node: ByObjects, what: str, remedy: str = "stop it first: axisbus stop CELL"
) -> None:
    """Check that no drive of a node is energised; ``what`` continues the message. Blocks for a transfer for each axis.

    Raises:
        StateError: a drive is energised.
        SdoError, AdapterError: the node does not answer.
    """
    found = energised(node)
    if found:
        raise StateError(f"node {node.node_id} is energised{what}", observed="; ".join(found), remedy=remedy)


def _require_at_rest(node: ByObjects) -> None:
    remedy = f"stop it first (axisbus stop CELL), or {_MAY_MOVE}"
    require_not_energised(node, ", and any write may move it; nothing was sent", remedy)


def require_no_other_master(node: CanopenNode, *, heartbeats: bool = True) -> None:
    """Check that no other master controls the node: its frames would overwrite a written value at once, or act against it.

    Blocks for ``LISTEN`` seconds. Without ``heartbeats``, the heartbeats that the node monitors are ignored: they may come from its
    peers.

    Raises:
        StateError: SYNC, RPDOs for the node, or such heartbeats were received.
        SdoError, AdapterError: the node does not answer.
    """
    received = _traffic(node, heartbeats=heartbeats)
    if received:
        raise StateError(
            f"another master is on the bus of node {node.node_id}; nothing was sent",
            observed=f"within {LISTEN:g} s: {', '.join(f'{count} {what}' for what, count in received.items())}",
            remedy="end that program first, or give the command in it",
        )


def _traffic(node: CanopenNode, *, heartbeats: bool) -> Counter[str]:
    """Listen for frames that only a master sends: SYNC, RPDOs to the node, and the heartbeats that the node monitors (1016h)."""
    own_sync = (number_if_served(node.sdo.upload, c301.COB_ID_SYNC) or 0) & _PRODUCES_SYNC
    titles = {} if own_sync else {cob.SYNC: "SYNC"}
    titles |= {base + node.node_id: f"RPDO{number}" for number, base in enumerate(cob.RPDO, start=1)}
    watched = _watched(node) if heartbeats else []
    titles |= {cob.HEARTBEAT + each: f"heartbeats of node {each}" for each in watched}
    received: Counter[str] = Counter()
    with ExitStack() as stack:
        for identifier, title in titles.items():
            on_frame = partial(_count, received, title)
            node.channel.subscribe(identifier, on_frame)
            stack.callback(node.channel.unsubscribe, identifier, on_frame)
        node.channel.clock.sleep(LISTEN)
    return received


def _count(received: Counter[str], title: str, _: bytes, __: float) -> None:
    received[title] += 1


def _watched(node: CanopenNode) -> list[int]:
    """Return the nodes whose heartbeat the node monitors."""
    count = number_if_served(node.sdo.upload, c301.CONSUMER_HEARTBEAT) or 0
    entries = [
        number_if_served(node.sdo.upload, c301.CONSUMER_HEARTBEAT, subindex) or 0
        for subindex in range(1, min(count, 16) + 1)
    ]
    return [watched for watched in map(watched_node, entries) if watched]


def _require_size(
    node: ByObjects, entry: DictionaryEntry, kind: DataType | None, before: bytes | None
) -> None:
    size = size_in_bytes(kind) if kind is not None else None
    if before is None or size is None or len(before) == size or kind is None:
        return
    raise ArgumentError(
        f"node {node.node_id}: {entry} has another size in the device; nothing was written",
        observed=f"{kind.name} has {counted(size, 'byte')}, the device sends {len(before)}",
        remedy="check which is right (axisbus eds verify), and give the type with --type",
    )


def _read(node: ByObjects, entry: DictionaryEntry) -> bytes | None:
    return if_served(node.sdo.upload, entry.index, entry.subindex)


def _typed(raw: bytes | None, kind: DataType | None) -> Value | None:
    return decode(raw, kind) if kind is not None and raw is not None else raw
