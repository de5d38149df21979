"""What another master looks like on the wire: the frames that masters and tools send, and slaves do not (CiA 301 7.2, CiA 305)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from axisbus.cia301 import cob
from axisbus.cia301.frame import CanFrame

_FUNCTION, _NODE = 0x780, 0x7F
_MEASURED = 3  # frames that a period is told of
_STATE = 0x7F  # of a heartbeat's byte, without the toggle bit of node guarding; 0 is a boot-up message


class Sign(Enum):
    """What gives a master away, in the order in which it is told."""

    NMT = "NMT commands"
    HEARTBEAT = "heartbeats"
    SYNC = "SYNC"
    RPDO = "RPDOs"
    SDO = "SDO requests"
    GUARDING = "node guarding requests (remote frames)"
    LSS = "LSS requests"
    TIME = "TIME"
    MODULE = "commands of CAN Simple"


_CYCLIC = frozenset({Sign.HEARTBEAT, Sign.SYNC})  # what comes at a period that says something


@dataclass(frozen=True, slots=True)
class ExpectedMasters:
    """Who is who on a bus: ``nodes`` are the cell's slaves, ``masters`` the node IDs whose heartbeat is a master's.

    SYNC is a sign at the COB-IDs ``syncs``, TIME at ``times``; nothing is one at ``excused``, where the cell's own devices send.
    ``commands`` has the identifiers of what only a master sends to the cell's modules that speak CAN Simple, each with its module's
    node ID. ``rpdos`` are RPDOs of the cell's nodes at other COB-IDs than the usual ones. ``produced`` is where we send SYNC.
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
        """The cell's slaves, and its modules that speak CAN Simple."""
        return self.nodes | frozenset(self.commands.values())


def sign_of(frame: CanFrame, cast: ExpectedMasters) -> tuple[Sign, int | None] | None:
    """Return what a frame gives away, and the node that it is of or for (None: the bus); None where a slave may send it."""
    if frame.extended or frame.error or frame.can_id in cast.excused:
        return None
    function, node = frame.can_id & _FUNCTION, frame.can_id & _NODE
    if frame.remote:  # of a PDO any consumer may ask
        return (Sign.GUARDING, node) if function == cob.HEARTBEAT and node else None
    if frame.can_id in cast.commands:
        return Sign.MODULE, cast.commands[frame.can_id]
    if frame.can_id == cob.NMT:
        return Sign.NMT, None
    if frame.can_id in cast.syncs:
        return Sign.SYNC, None
    if frame.can_id in cast.times:
        return Sign.TIME, None
    if frame.can_id in cast.rpdos:
        return Sign.RPDO, cast.rpdos[frame.can_id]
    if frame.can_id == cob.LSS_RX:
        return Sign.LSS, None
    if function == cob.HEARTBEAT:
        alive = bool(frame.data and frame.data[0] & _STATE)
        return (Sign.HEARTBEAT, node) if alive and node in cast.masters else None
    if function == cob.SDO_RX and node:
        return Sign.SDO, node
    return (Sign.RPDO, node) if function in cob.RPDO and node in cast.nodes else None


def commanded(frame: CanFrame, cast: ExpectedMasters) -> frozenset[int]:
    """Return the cell's nodes that a frame of another master commands; none where it only asks, or is a sign alone.

    An SDO request commands its node when it begins a download to the communication profile or to the device profile. Objects of the
    maker's own are what its tool writes while the drive runs.
    """
    sign, node = sign_of(frame, cast) or (None, None)
    if sign is Sign.NMT:
        return _of_nmt(frame.data, cast)
    if sign is Sign.SYNC:
        return cast.all_nodes if frame.can_id == cast.produced else frozenset()
    if sign in _COMMANDING or (sign is Sign.SDO and _is_command(frame.data)):
        return frozenset({node} if node is not None else ()) & cast.all_nodes
    return frozenset()


_COMMANDING = frozenset({Sign.RPDO, Sign.MODULE})
# The first three bits of what begins a download: expedited or in segments, and in blocks (CiA 301 7.2.4.3.3, 7.2.4.3.9).
_DOWNLOAD, _BLOCK_DOWNLOAD, _BLOCK_STEP = 1, 6, 1


def _of_nmt(data: bytes, cast: ExpectedMasters) -> frozenset[int]:
    if len(data) != 2:  # command and node; anything else is no NMT command
        return frozenset()
    return cast.all_nodes if data[1] == 0 else frozenset({data[1]}) & cast.all_nodes


def _is_command(data: bytes) -> bool:
    if len(data) < 4:  # command specifier and object
        return False
    specifier, index = data[0] >> 5, data[1] | data[2] << 8
    begins = specifier == _DOWNLOAD or (specifier == _BLOCK_DOWNLOAD and not data[0] & _BLOCK_STEP)
    return begins and (index < 0x2000 or index >= 0x6000)  # CiA 301 7.4.1: the maker's own in between


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
        """The mean time in seconds from one to the next; None of what comes as it comes, and of too few."""
        if self.sign not in _CYCLIC or self.count < _MEASURED:
            return None
        return (self.last - self.first) / (self.count - 1)


@dataclass(slots=True)
class MasterDetector:
    """Collects what gives a master away; holds state: what was heard, by COB-ID."""

    cast: ExpectedMasters
    _heard: dict[tuple[Sign, int], MasterEvidence] = field(default_factory=dict)

    def note(self, frame: CanFrame) -> None:
        """Take a frame, in the order of time."""
        found = sign_of(frame, self.cast)
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
        """What was heard so far, in the order of ``Sign`` and of COB-IDs."""
        order = list(Sign)
        return sorted(self._heard.values(), key=lambda one: (order.index(one.sign), one.can_id))


def words(heard: Iterable[MasterEvidence]) -> list[str]:
    """Return what was heard, one line for each sign: what, of or for whom, how many, how often."""
    groups: dict[Sign, list[MasterEvidence]] = {}
    for one in heard:
        groups.setdefault(one.sign, []).append(one)
    return [_line(sign, group) for sign, group in groups.items()]


def _line(sign: Sign, group: list[MasterEvidence]) -> str:
    nodes = sorted({one.node for one in group if one.node is not None})
    whose = f" {'of' if sign is Sign.HEARTBEAT else 'to'} {nodes_text(nodes)}" if nodes else ""
    period = group[0].period if len(group) == 1 else None
    often = f", every {period * 1000:.1f} ms" if period is not None else ""
    return f"{sign.value}{whose} ({_identifiers(group)}): {sum(one.count for one in group)}{often}"


def nodes_text(nodes: Iterable[int]) -> str:
    """Return ``node 3`` or ``nodes 3, 5``, in ascending order."""
    found = sorted(nodes)
    return f"node{'s' * (len(found) > 1)} {', '.join(map(str, found))}"


def _identifiers(group: list[MasterEvidence]) -> str:
    found = [f"{one.can_id:03X}h" for one in group]
    return ", ".join(found) if len(found) < 5 else f"{found[0]} to {found[-1]}"
