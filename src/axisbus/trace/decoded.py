"""What one frame says, as frozen values: the decoder fills them, ``text`` and ``plain`` write them out."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from axisbus.cia301.datatypes import Value
from axisbus.cia301.frame import CanFrame


class FrameKind(Enum):
    """Which service of CiA 301, 302 or 305 a frame belongs to; ``FOREIGN`` is one of another protocol that is known."""

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
    """One object's value that a frame carries.

    ``value`` is as the object's type says (bytes where no type is known), None where only the object is named. ``words`` says what
    the value means (``operation enabled, target reached``), ``quantity`` gives it in ``unit``; each is empty where there is none.
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
    """What an SDO frame did in its transfer: ``step`` in words, the bytes moved so far and in all, abort code, seconds waited."""

    step: str
    write: bool
    done: int | None = None
    total: int | None = None
    abort: int | None = None
    waited: float | None = None


@dataclass(frozen=True, slots=True)
class Decoded:
    """One frame in words.

    ``node`` is the node that the frame belongs to (None: to the bus), ``from_node`` whether that node sent it. ``what`` says the
    rest. ``error`` marks what reports trouble (EMCY, abort, a drive in fault, an error frame, a request without answer), and
    ``problem`` says what is against the protocol in the frame itself; it is empty for a sound frame.
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
        """Whether it reports or is trouble."""
        return self.error or bool(self.problem)
