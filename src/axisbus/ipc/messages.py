"""The messages between a program and its core, as frozen values; a ``Codec`` converts each to bytes.

A core answers ``OpenCell`` with ``CellOpened`` or ``NotOpened``, and ``CoreQuery`` with ``CoreReply`` of the same number; it sends
all other messages unasked. After ``Leave`` from a program, the core ignores all its messages except ``RequestStop``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from axisbus.boot.program_facts import ProgramRunState
from axisbus.boot.report import NodeReport
from axisbus.bus.link.controller import ControllerEvent
from axisbus.bus.node.events import NodeEvent
from axisbus.bus.pdo.plan import PdoPlan
from axisbus.bus.pdo.tpdo_timeout import PdoEvent
from axisbus.cia301.dropped_frames import Drop
from axisbus.cia301.emcy import Emcy, ErrorEntry
from axisbus.cia301.frame import BusTraffic
from axisbus.cia301.incident import Incident
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.sdo import SdoTransferType
from axisbus.cia301.sdo_counts import SdoCount
from axisbus.configuration.replacement_order import FoundDrive, ReplacementOrder, ReplacementOutcome
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
    """Open the cell of a file; ``version`` is that of the program's axisbus. The first message, sent once.

    ``shared``: this program has no control; a joined program may have it. ``in_cells``: Ctrl-C ends one of its cells, not the
    program.
    """

    version: str
    cell: str
    beside: bool = False
    shared: bool = False
    in_cells: bool = False


@dataclass(frozen=True, slots=True)
class Attach:
    """Join the machine of an open cell; ``text`` is a digest of its file. The first message of a joining client, sent once.

    ``command``: it wants control, which only one program has at a time; ``take``: control is taken from the program that has it.
    """

    version: str
    text: str
    command: bool = False
    take: bool = False


@dataclass(frozen=True, slots=True)
class NodeFacts:
    """The facts about a booted node for a program."""

    report: NodeReport
    parameters: dict[str, AxisParameters]
    plans: tuple[PdoPlan, ...]
    watched: bool


@dataclass(frozen=True, slots=True)
class CellOpened:
    """The machine runs: its nodes and axes; ``real_time_status`` is the real-time status, ``process`` the ID of the core's process.

    ``commanded_by``: the program with control, as text.
    """

    nodes: dict[int, NodeFacts]
    axes: dict[str, AxisFacts]
    real_time_status: str
    process: int
    commanded_by: str = ""


@dataclass(frozen=True, slots=True)
class NotOpened:
    """The machine does not run: one error, or several with the common text ``message``."""

    errors: tuple[AxisbusError, ...]
    message: str = ""


@dataclass(frozen=True, slots=True)
class Submit:
    """``AxisSession.submit``; ``stream``: the number of the trajectory to be followed; the command contains its head (0: none)."""

    number: int
    target: Target
    command: AnyCommand
    name: str
    stream: int = 0


@dataclass(frozen=True, slots=True)
class WantSamples:
    """The core requests samples of a trajectory (``Streamed.wanted``)."""

    stream: int
    first: int
    count: int


@dataclass(frozen=True, slots=True)
class TrajectorySamples:
    """Samples of a trajectory, beginning with number ``first``."""

    stream: int
    first: int
    positions: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class NoSamples:
    """A trajectory has no more samples: its code has failed."""

    stream: int
    error: AxisbusError


@dataclass(frozen=True, slots=True)
class StreamOver:
    """The core no longer follows a trajectory."""

    stream: int


@dataclass(frozen=True, slots=True)
class AddGroup:
    """``AxisSession.add_group``."""

    key: Target
    members: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RequestStop:
    """``AxisSession.request_stop``."""

    reason: str
    quick: bool = False


@dataclass(frozen=True, slots=True)
class RequestHalt:
    """``AxisSession.request_halt``."""

    reason: str
    number: int


@dataclass(frozen=True, slots=True)
class HoldToRunMessage:
    """``AxisSession.hold_to_run``."""

    seconds: float | None
    continuous: float | None = None


@dataclass(frozen=True, slots=True)
class Observe:
    """Whether process images of all cycles are wanted (``CycleImages``)."""

    wanted: bool


@dataclass(frozen=True, slots=True)
class Tap:
    """Whether the frames of the bus are wanted (``Frames``): those of ``can_ids``, or all if it is empty."""

    wanted: bool
    can_ids: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class CoreQuery:
    """Request something that takes time, such as an SDO transfer; ``node`` 0: of the core itself."""

    number: int
    what: str
    node: int = 0
    arguments: tuple[Any, ...] = ()


@dataclass(frozen=True, slots=True)
class CoreReply:
    """The result of a request, or its error."""

    number: int
    value: Any = None
    error: AxisbusError | None = None


@dataclass(frozen=True, slots=True)
class CoreProgress:
    """The progress of a request that has not been answered yet, such as the step that begins."""

    number: int
    value: Any = None


@dataclass(frozen=True, slots=True)
class Leave:
    """Stop every axis, and leave the nodes."""

    reason: str


@dataclass(frozen=True, slots=True)
class Left:
    """Everything has been left: the failures, and the last answers, by node (0: the core) and request."""

    failures: tuple[AxisbusError, ...]
    last: dict[tuple[int, str], Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class CommandEvents:
    """Status changes of commands, of one cycle."""

    events: tuple[CommandEvent, ...]


@dataclass(frozen=True, slots=True)
class ErrorMessage:
    """The error that has this number in an image, and the axis that it belongs to."""

    axis: str
    number: int
    error: AxisbusError


@dataclass(frozen=True, slots=True)
class NodeJoined:
    """An optional node has come up late, with these axes."""

    node: int
    facts: NodeFacts
    axes: dict[str, AxisFacts]


@dataclass(frozen=True, slots=True)
class NodeEventMessage:
    """Error control has an event of a node whose events are requested."""

    event: NodeEvent


@dataclass(frozen=True, slots=True)
class CycleImages:
    """Images of successive cycles, each with its time; ``lost`` images before them were left out, because they were not taken."""

    images: tuple[tuple[float, bytes], ...]
    lost: int = 0


@dataclass(frozen=True, slots=True)
class Frames:
    """Frames of the bus, packed (``ipc.frames``); ``lost`` frames were left out, because they were not taken."""

    packed: bytes
    lost: int = 0


@dataclass(frozen=True, slots=True)
class CoreCondition:
    """The condition of the core: see ``MachineSession`` for each field."""

    dead: str | None = None
    ended: bool = False
    failed: bool = False
    left: tuple[float, str] | None = None


@dataclass(frozen=True, slots=True)
class Rescued:
    """The core is dead; ``why`` is how it ended, ``stopped`` the results of its watchdog process for the commanded axes.

    Of the outputs that had been set, those in ``safe`` are seen in their safe state, and those in ``unsafe`` are not. ``left``: the
    core itself had left its nodes before, so nothing was done.
    """

    why: str
    stopped: tuple[StopResult, ...]
    unsafe: tuple[Unsafe, ...] = ()
    safe: tuple[str, ...] = ()
    left: bool = False


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
    | CoreProgress
    | Leave
    | Left
    | CommandEvents
    | ErrorMessage
    | NodeJoined
    | NodeEventMessage
    | CycleImages
    | Frames
    | CoreCondition
    | Logged
    | Rescued
)
# Further types that an answer, or the argument of a request, may contain.
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
    FoundDrive,
    ReplacementOrder,
    ReplacementOutcome,
    ProgramRunState,
)
CODEC = Codec([Message, *_ASKED])
