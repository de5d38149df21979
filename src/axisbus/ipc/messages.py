"""The messages between a program and its core, as frozen values; a ``Codec`` turns each into bytes.

A core answers ``OpenCell`` with ``CellOpened`` or ``NotOpened`` and ``CoreQuery`` with ``CoreReply``, each by its number; what else
it sends is told by itself. Everything that a program sends after ``Leave`` but ``RequestStop`` is passed over.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from axisbus.boot.report import NodeReport
from axisbus.bus.link.controller import ControllerEvent
from axisbus.bus.node.events import NodeEvent
from axisbus.bus.pdo.plan import PdoPlan
from axisbus.bus.pdo.tpdo_timeout import PdoEvent
from axisbus.cia301.dropped_frames import Drop
from axisbus.cia301.emcy import Emcy
from axisbus.cia301.errorfield import ErrorEntry
from axisbus.cia301.frame import BusTraffic
from axisbus.cia301.incident import Incident
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.sdo import SdoTransferType
from axisbus.cia301.sdo_counts import SdoCount
from axisbus.errors import AxisbusError
from axisbus.ipc.values import Codec
from axisbus.link import StopResult, Unsafe
from axisbus.motion.moves.remote_trajectory import StreamHead
from axisbus.motion.parameters import AxisParameters
from axisbus.session import (
    AnyCommand,
    AxisFacts,
    ClientProgram,
    CommandEvent,
    CommandSeen,
    LatenessReport,
    Target,
)


@dataclass(frozen=True, slots=True)
class OpenCell:
    """Open the cell of a file; ``version`` is that of the program's axisbus. The first message, and once.

    ``shared``: this program commands nothing; whoever is joined to it may. ``in_cells``: Ctrl-C ends one of its cells, and not it.
    """

    version: str
    cell: str
    beside: bool = False
    shared: bool = False
    in_cells: bool = False


@dataclass(frozen=True, slots=True)
class Attach:
    """Join the machine of a cell that is open; ``text`` is what its file says (a digest). The first message of a guest, and once.

    ``command``: it is to have the command, which nobody else may have; ``take``: then it is taken from whoever has it.
    """

    version: str
    text: str
    command: bool = False
    take: bool = False


@dataclass(frozen=True, slots=True)
class NodeFacts:
    """What a program must know of a node that has been booted."""

    report: NodeReport
    parameters: dict[str, AxisParameters]
    plans: tuple[PdoPlan, ...]
    watched: bool


@dataclass(frozen=True, slots=True)
class CellOpened:
    """The machine runs: its nodes, and its axes; ``degree`` says how surely its cycles come in time, ``process`` where (its ID).

    ``commanded_by``: who has the command, for people.
    """

    nodes: dict[int, NodeFacts]
    axes: dict[str, AxisFacts]
    degree: str
    process: int
    commanded_by: str = ""


@dataclass(frozen=True, slots=True)
class NotOpened:
    """It does not: one reason, or several of which ``message`` tells."""

    errors: tuple[AxisbusError, ...]
    message: str = ""


@dataclass(frozen=True, slots=True)
class Submit:
    """``Session.submit``; ``stream``: the number of the trajectory that is to be followed, whose head it has (0: none)."""

    number: int
    target: Target
    command: AnyCommand
    name: str
    stream: int = 0


@dataclass(frozen=True, slots=True)
class WantSamples:
    """The core wants samples of a trajectory (``Streamed.wanted``)."""

    stream: int
    first: int
    count: int


@dataclass(frozen=True, slots=True)
class TrajectorySamples:
    """Samples of a trajectory, from number ``first`` on."""

    stream: int
    first: int
    positions: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class NoSamples:
    """A trajectory gives no more: its code has failed."""

    stream: int
    error: AxisbusError


@dataclass(frozen=True, slots=True)
class StreamOver:
    """Nobody in the core follows a trajectory any more."""

    stream: int


@dataclass(frozen=True, slots=True)
class AddGroup:
    """``Session.add_group``."""

    key: Target
    members: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RequestStop:
    """``Session.request_stop``."""

    reason: str
    quick: bool = False


@dataclass(frozen=True, slots=True)
class RequestHalt:
    """``Session.request_halt``."""

    reason: str
    number: int


@dataclass(frozen=True, slots=True)
class HoldToRunMessage:
    """``Session.hold_to_run``."""

    seconds: float | None
    continuous: float | None = None


@dataclass(frozen=True, slots=True)
class Observe:
    """Whether images of all cycles are wanted (``CycleImages``)."""

    wanted: bool


@dataclass(frozen=True, slots=True)
class Tap:
    """Whether the frames of the bus are wanted (``Frames``): those of ``can_ids``, or all where there are none."""

    wanted: bool
    can_ids: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class CoreQuery:
    """Ask for something that takes its time, such as an SDO transfer; ``node`` 0: of the core itself."""

    number: int
    what: str
    node: int = 0
    arguments: tuple[Any, ...] = ()


@dataclass(frozen=True, slots=True)
class CoreReply:
    """What was asked for, or the error that it came to."""

    number: int
    value: Any = None
    error: AxisbusError | None = None


@dataclass(frozen=True, slots=True)
class Leave:
    """Stop every axis, and leave the nodes."""

    reason: str


@dataclass(frozen=True, slots=True)
class Left:
    """Everything has been left; what went wrong, and what would have been answered last, by node (0: the core) and question."""

    failures: tuple[AxisbusError, ...]
    last: dict[tuple[int, str], Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class CommandEvents:
    """How commands go on, of one cycle."""

    events: tuple[CommandEvent, ...]


@dataclass(frozen=True, slots=True)
class ErrorTold:
    """The error that an image calls by its number."""

    number: int
    error: AxisbusError


@dataclass(frozen=True, slots=True)
class NodeJoined:
    """An optional node has come later, with these axes."""

    node: int
    facts: NodeFacts
    axes: dict[str, AxisFacts]


@dataclass(frozen=True, slots=True)
class NodeTold:
    """Error control has told something of a node whose events are asked for."""

    event: NodeEvent


@dataclass(frozen=True, slots=True)
class CycleImages:
    """Images of cycles that followed each other, each with its time; ``lost`` were left out before, as nobody took them."""

    images: tuple[tuple[float, bytes], ...]
    lost: int = 0


@dataclass(frozen=True, slots=True)
class Frames:
    """Frames of the bus, packed (``ipc.frames``); ``lost`` were left out, as nobody took them."""

    packed: bytes
    lost: int = 0


@dataclass(frozen=True, slots=True)
class CoreCondition:
    """How the core is: see ``Session`` for each."""

    dead: str | None = None
    ended: bool = False
    failed: bool = False
    left: tuple[float, str] | None = None


@dataclass(frozen=True, slots=True)
class Rescued:
    """The core is dead; ``why`` says how it ended, ``stopped`` how its warden left the axes that had been commanded.

    Of the outputs that had been set, ``safe`` are seen in their safe state, and ``unsafe`` are not.
    """

    why: str
    stopped: tuple[StopResult, ...]
    unsafe: tuple[Unsafe, ...] = ()
    safe: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Logged:
    """A line of the core's log."""

    name: str
    level: int
    text: str


Message = (
    OpenCell
    | Attach
    | CellOpened
    | NotOpened
    | Submit
    | WantSamples
    | TrajectorySamples
    | NoSamples
    | StreamOver
    | AddGroup
    | RequestStop
    | RequestHalt
    | HoldToRunMessage
    | Observe
    | Tap
    | CoreQuery
    | CoreReply
    | Leave
    | Left
    | CommandEvents
    | ErrorTold
    | NodeJoined
    | NodeTold
    | CycleImages
    | Frames
    | CoreCondition
    | Logged
    | Rescued
)
# What else an answer, or the argument of a question, may hold.
_ASKED = (
    LatenessReport,
    CommandSeen,
    ClientProgram,
    BusTraffic,
    NodeEvent,
    ControllerEvent,
    Drop,
    SdoCount,
    Emcy,
    Incident,
    PdoEvent,
    ErrorEntry,
    NmtState,
    NmtCommand,
    SdoTransferType,
    StreamHead,
)
CODEC = Codec([Message, *_ASKED])
