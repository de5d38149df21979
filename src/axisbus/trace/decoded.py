"""The contents of one frame as frozen values, which the decoder fills and ``text`` and ``json_form`` write; count wrong frames."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import Enum

from axisbus.cia301.datatypes import Value
from axisbus.cia301.frame import CanFrame


class FrameKind(Enum):
    """The service of CiA 301, 302 or 305 that a frame belongs to; ``FOREIGN`` is a frame of another known protocol."""

    NMT = "NMT"
    SYNC = "SYNC"
    TIME = "TIME"
    EMCY = "EMCY"
    TPDO = "TPDO"
    RPDO = "RPDO"
    SDO = "SDO"
    HEARTBEAT = "heartbeat"
    BOOT_UP = "boot-up"
    GUARD = "guarding"
    LSS = "LSS"
    ERROR_FRAME = "error frame"
    FOREIGN = "foreign"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class ObjectValue:
    """One object's value in a frame.

    ``value`` has the object's type (bytes if the type is unknown), None if the frame only names the object. ``words`` is the
    meaning of the value (``operation enabled, target reached``), ``quantity`` is the value in ``unit``; each is empty if there is
    none.
    """

    index: int
    subindex: int
    name: str
    value: Value | None = None
    words: str = ""
    quantity: float | None = None
    unit: str = ""


@dataclass(frozen=True, slots=True)
class DecodedSdo:
    """The effect of an SDO frame in its transfer: ``step`` in words, bytes so far and in total, abort code, seconds waited."""

    step: str
    write: bool
    done: int | None = None
    total: int | None = None
    abort: int | None = None
    waited: float | None = None


@dataclass(frozen=True, slots=True)
class Decoded:
    """One frame as text.

    ``node`` is the node that the frame belongs to (None: the bus), ``from_node`` is whether that node sent it. ``what`` is the rest
    of the text. ``error`` marks frames that report trouble (EMCY, abort, a drive in fault, an error frame, a request without
    answer). ``problem`` is the violation of the protocol in the frame itself; it is empty for a valid frame.
    """

    frame: CanFrame
    delta: float
    kind: FrameKind
    node: int | None = None
    name: str = ""
    from_node: bool = True
    what: str = ""
    values: tuple[ObjectValue, ...] = ()
    sdo: DecodedSdo | None = None
    error: bool = False
    problem: str = ""

    @property
    def trouble(self) -> bool:
        """Whether the frame reports trouble or violates the protocol."""
        return self.error or bool(self.problem)


# -- Count the frames that violate the protocol, by service and node, for the summary of a listener ------------------------


class TraceErrorCounters:
    """Counts frames with a ``problem``; holds state."""

    def __init__(self) -> None:
        self._found: Counter[tuple[FrameKind, int | None]] = Counter()

    def note(self, one: Decoded) -> None:
        """Count a frame if it has a problem."""
        if one.problem:
            self._found[one.kind, one.node] += 1

    @property
    def found(self) -> list[tuple[FrameKind, int | None, int]]:
        """Return service, node (None: the bus) and count, in the order of ``FrameKind`` and of nodes."""
        order = list(FrameKind)
        keys = sorted(self._found, key=lambda key: (order.index(key[0]), key[1] or 0))
        return [(*key, self._found[key]) for key in keys]

    def words(self) -> str:
        """Return them in one line, empty if there are none: ``against the protocol: 3 TPDO (node 2), 1 EMCY (node 5)``."""
        texts = [
            f"{count} {kind.value}" + (f" (node {node})" if node is not None else "")
            for kind, node, count in self.found
        ]
        return f"against the protocol: {', '.join(texts)}" if texts else ""

    def plain(self) -> list[dict[str, object]]:
        """Return them as plain values."""
        return [{"kind": kind.value, "node": node, "count": count} for kind, node, count in self.found]
