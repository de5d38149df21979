"""Count dropped frames by reason and node, so that no frame is lost without a trace."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from enum import Enum

from axisbus.cia301 import cob

_FUNCTION, _NODE = 0x780, 0x7F
EVERY = 1.0  # seconds between two reports of the same reason and node
_MOST = 256  # reasons and nodes that are counted separately


class DropReason(Enum):
    """Why a frame was dropped: the text for one frame and the text for several."""

    SHORT_PDO = "PDO too short for its mapping", "PDOs too short for their mapping"
    EMCY = "EMCY without an error code", "EMCYs without an error code"
    HEARTBEAT = "heartbeat without a state", "heartbeats without a state"
    TOGGLE = (
        "guarding answer with the toggle bit of the previous answer",
        "guarding answers with the toggle bit of the previous answer",
    )
    SDO = "SDO answer that nothing was waiting for", "SDO answers that nothing was waiting for"
    LSS = "LSS answer that nothing was waiting for", "LSS answers that nothing was waiting for"
    SYNC = "SYNC of more than one byte", "SYNCs of more than one byte"
    TIME = "TIME message that is not a time", "TIME messages that are no time"
    UNKNOWN_PDO = "PDO that is not configured", "PDOs that are not configured"
    REMOTE = "remote frame", "remote frames"
    FD = "CAN FD frame, which CANopen has not", "CAN FD frames, which CANopen has not"
    EXTENDED = (
        "frame with an identifier of 29 bits where 11 are meant",
        "frames with an identifier of 29 bits where 11 are meant",
    )
    MANY = "other frame", "other frames"

    def words(self, count: int) -> str:
        """Return ``3 PDOs too short for their mapping``."""
        one, several = self.value
        return f"{count} {one if count == 1 else several}"


@dataclass(frozen=True, slots=True)
class Drop:
    """Frames dropped for one reason; ``node`` is their node (None: no node), ``last`` the time of the newest (s, monotonic).

    ``data`` and ``can_id`` are those of the newest frame.
    """

    fault: DropReason
    node: int | None
    count: int
    last: float
    can_id: int
    data: bytes

    def __str__(self) -> str:
        return self.fault.words(self.count) + (f" (node {self.node})" if self.node is not None else "")


class Drops:
    """Counter of dropped frames; holds state: a count and the newest frame for each reason and node."""

    def __init__(self, lock: AbstractContextManager[object] | None = None) -> None:
        """``lock`` is held while counting; give one if several threads use this."""
        self._lock = nullcontext() if lock is None else lock
        self._found: dict[tuple[DropReason, int | None], Drop] = {}

    def frame(self, fault: DropReason, can_id: int, stamp: float, data: bytes) -> None:
        """Count a frame whose node is known only from its identifier (CiA 301 7.3.5)."""
        self.note(fault, can_id & _NODE or None, stamp, can_id, data)

    def note(
        self,
        fault: DropReason,
        node: int | None,
        stamp: float,
        can_id: int,
        data: bytes = b"",
        count: int = 1,
    ) -> None:
        """Count dropped frames; ``data`` and ``can_id`` are those of the newest."""
        with self._lock:
            before = self._found.get((fault, node))
            if before is None and len(self._found) >= _MOST:
                fault, node = DropReason.MANY, None
                before = self._found.get((fault, node))
            so_far = 0 if before is None else before.count
            self._found[fault, node] = Drop(fault, node, so_far + count, stamp, can_id, data[:8])

    def unreceived(self, can_id: int, stamp: float, data: bytes) -> None:
        """Count a frame without a receiver if its identifier is that of a TPDO (CiA 301 7.3.5)."""
        if can_id <= cob.ID_MASK_11 and can_id & _FUNCTION in cob.TPDO and can_id & _NODE:
            self.frame(DropReason.UNKNOWN_PDO, can_id, stamp, data)

    @property
    def found(self) -> tuple[Drop, ...]:
        """The counts so far, in the order of ``DropReason`` and of nodes."""
        with self._lock:
            found = list(self._found.values())
        order = list(DropReason)
        return tuple(sorted(found, key=lambda drop: (order.index(drop.fault), drop.node or 0)))


class DropNews:
    """Selects the counts to be reported; holds state: the last reported count and its time for each reason and node.

    The same reason and node are reported at most once in ``EVERY`` seconds, however many frames are dropped.
    """

    def __init__(self) -> None:
        self._reported: dict[tuple[DropReason, int | None], tuple[int, float]] = {}

    def take(self, found: Iterable[Drop], now: float) -> list[Drop]:
        """Return those of ``found`` whose count has grown, with the total count; ``now`` in seconds of any steady clock."""
        new = [drop for drop in found if self._is_due(drop, now)]
        for drop in new:
            self._reported[drop.fault, drop.node] = drop.count, now
        return new

    def _is_due(self, drop: Drop, now: float) -> bool:
        count, reported_at = self._reported.get((drop.fault, drop.node), (0, -EVERY))
        return drop.count > count and now - reported_at >= EVERY


def words(drops: Iterable[Drop]) -> str:
    """Return one line such as ``dropped: 3 PDOs too short for their mapping (node 2)``; empty if no frame was dropped."""
    texts = [str(drop) for drop in drops]
    return f"dropped: {', '.join(texts)}" if texts else ""
