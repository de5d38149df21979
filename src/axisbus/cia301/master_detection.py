"""Detect another master by its frames: masters and tools send them, slaves do not (CiA 301 7.2, CiA 305)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from axisbus.cia301 import cob
from axisbus.cia301.frame import CanFrame

_FUNCTION, _NODE = 0x780, 0x7F
_MEASURED = 3  # frames from which a period is reported
_STATE = 0x7F  # of a heartbeat's byte, without the toggle bit of node guarding; 0 is a boot-up message


class Sign(Enum):
    """Kinds of frames that indicate a master, in the order in which they are reported."""

    NMT = "NMT commands"
    HEARTBEAT = "heartbeats"
    SYNC = "SYNC"
    RPDO = "RPDOs"
    SDO = "SDO requests"
    GUARDING = "node guarding requests (remote frames)"
    LSS = "LSS requests"
    TIME = "TIME"
    MODULE = "commands of CAN Simple"


_CYCLIC = frozenset({Sign.HEARTBEAT, Sign.SYNC})  # signs with a period worth reporting


@dataclass(frozen=True, slots=True)
class ExpectedMasters:
    """The expected participants: ``nodes`` are the cell's slaves, ``masters`` the node-IDs whose heartbeat is a master's.

    SYNC is a sign at the COB-IDs ``syncs``, TIME at ``times``. Frames at ``excused`` are no sign: the cell's own devices send
    there. ``commands`` maps identifiers that only a master sends to the cell's CAN Simple modules to the node-ID of the module.
    ``rpdos`` maps RPDOs of the cell's nodes at other than the default COB-IDs to their node. ``produced`` is the COB-ID at which
    this master sends SYNC.
    """

    nodes: frozenset[int]
    masters: frozenset[int]
    syncs: frozenset[int] = frozenset({cob.SYNC})
    excused: frozenset[int] = frozenset()
    commands: Mapping[int, int] = field(default_factory=dict)
    rpdos: Mapping[int, int] = field(default_factory=dict)
    times: frozenset[int] = frozenset()
    produced: int | None = None

    @property
    def all_nodes(self) -> frozenset[int]:
        """The cell's slaves and its modules that use CAN Simple."""
        return self.nodes | frozenset(self.commands.values())


def sign_of(frame: CanFrame, expected: ExpectedMasters) -> tuple[Sign, int | None] | None:
    """Return the sign that a frame is and its node (None: whole bus); None if a slave may send the frame."""
    if frame.extended or frame.error or frame.can_id in expected.excused:
        return None
    function, node = frame.can_id & _FUNCTION, frame.can_id & _NODE
    if frame.remote:  # any consumer may request a PDO
        return (Sign.GUARDING, node) if function == cob.HEARTBEAT and node else None
    if frame.can_id in expected.commands:
        return Sign.MODULE, expected.commands[frame.can_id]
    if frame.can_id == cob.NMT:
        return Sign.NMT, None
    if frame.can_id in expected.syncs:
        return Sign.SYNC, None
    if frame.can_id in expected.times:
        return Sign.TIME, None
    if frame.can_id in expected.rpdos:
        return Sign.RPDO, expected.rpdos[frame.can_id]
    if frame.can_id == cob.LSS_RX:
        return Sign.LSS, None
    if function == cob.HEARTBEAT:
        alive = bool(frame.data and frame.data[0] & _STATE)
        return (Sign.HEARTBEAT, node) if alive and node in expected.masters else None
    if function == cob.SDO_RX and node:
        return Sign.SDO, node
    return (Sign.RPDO, node) if function in cob.RPDO and node in expected.nodes else None


def commanded(frame: CanFrame, expected: ExpectedMasters) -> frozenset[int]:
    """Return the cell's nodes that a frame of another master commands; empty if it only requests data or is only a sign.

    An SDO request commands its node if it begins a download to the communication profile or the device profile. A download to a
    manufacturer-specific object does not count: vendors' tools write these while the drive runs.
    """
    sign, node = sign_of(frame, expected) or (None, None)
    if sign is Sign.NMT:
        return _of_nmt(frame.data, expected)
    if sign is Sign.SYNC:
        return expected.all_nodes if frame.can_id == expected.produced else frozenset()
    if sign in _COMMANDING or (sign is Sign.SDO and _is_command(frame.data)):
        return frozenset({node} if node is not None else ()) & expected.all_nodes
    return frozenset()


_COMMANDING = frozenset({Sign.RPDO, Sign.MODULE})
# The first three bits of a frame that begins a download: expedited or segmented, and block (CiA 301 7.2.4.3.3, 7.2.4.3.9).
_DOWNLOAD, _BLOCK_DOWNLOAD, _BLOCK_STEP = 1, 6, 1


def _of_nmt(data: bytes, expected: ExpectedMasters) -> frozenset[int]:
    if len(data) != 2:  # command and node; data of another length is not an NMT command
        return frozenset()
    return expected.all_nodes if data[1] == 0 else frozenset({data[1]}) & expected.all_nodes


def _is_command(data: bytes) -> bool:
    if len(data) < 4:  # command specifier and object
        return False
    specifier, index = data[0] >> 5, data[1] | data[2] << 8
    begins = specifier == _DOWNLOAD or (specifier == _BLOCK_DOWNLOAD and not data[0] & _BLOCK_STEP)
    # CiA 301 7.4.1: manufacturer-specific objects in between
    return begins and (index < 0x2000 or index >= 0x6000)


@dataclass(slots=True)
class MasterEvidence:
    """Frames of one sign on one COB-ID; holds state: ``count``, and the times of the first and the last."""

    sign: Sign
    node: int | None
    can_id: int
    count: int
    first: float
    last: float

    @property
    def period(self) -> float | None:
        """Mean period in seconds; None for signs that are not cyclic, or if there are too few frames."""
        if self.sign not in _CYCLIC or self.count < _MEASURED:
            return None
        return (self.last - self.first) / (self.count - 1)


@dataclass(slots=True)
class MasterDetector:
    """Collects evidence of a master; holds state: the evidence by sign and COB-ID."""

    expected: ExpectedMasters
    _heard: dict[tuple[Sign, int], MasterEvidence] = field(default_factory=dict)

    def note(self, frame: CanFrame) -> None:
        """Evaluate a frame; call in the order of time."""
        found = sign_of(frame, self.expected)
        if found is None:
            return
        sign, node = found
        one = self._heard.get((sign, frame.can_id))
        if one is None:
            self._heard[sign, frame.can_id] = MasterEvidence(
                sign, node, frame.can_id, 1, frame.time, frame.time
            )
            return
        one.count += 1
        one.last = frame.time

    @property
    def heard(self) -> list[MasterEvidence]:
        """The evidence so far, in the order of ``Sign`` and of COB-IDs."""
        order = list(Sign)
        return sorted(self._heard.values(), key=lambda one: (order.index(one.sign), one.can_id))


def words(heard: Iterable[MasterEvidence]) -> list[str]:
    """Return one line for each sign: sign, nodes, COB-IDs, number of frames, and period."""
    groups: dict[Sign, list[MasterEvidence]] = {}
    for one in heard:
        groups.setdefault(one.sign, []).append(one)
    return [_line(sign, group) for sign, group in groups.items()]


def _line(sign: Sign, group: list[MasterEvidence]) -> str:
    nodes = sorted({one.node for one in group if one.node is not None})
    target_nodes = f" {'of' if sign is Sign.HEARTBEAT else 'to'} {nodes_text(nodes)}" if nodes else ""
    period = group[0].period if len(group) == 1 else None
    often = f", every {period * 1000:.1f} ms" if period is not None else ""
    return f"{sign.value}{target_nodes} ({_identifiers(group)}): {sum(one.count for one in group)}{often}"


def nodes_text(nodes: Iterable[int]) -> str:
    """Return ``node 3`` or ``nodes 3, 5``, in ascending order."""
    found = sorted(nodes)
    return f"node{'s' * (len(found) > 1)} {', '.join(map(str, found))}"


def _identifiers(group: list[MasterEvidence]) -> str:
    found = [f"{one.can_id:03X}h" for one in group]
    return ", ".join(found) if len(found) < 5 else f"{found[0]} to {found[-1]}"
