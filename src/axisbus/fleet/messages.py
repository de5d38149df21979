"""Messages between a cell's bridge and a fleet, as JSON; unknown fields are ignored, so that versions may differ.

Theory of operation
-------------------
Clocks of two computers are never compared. A value has an ``age`` that its own computer measured; ``clock`` (s since 1970, of the
computer that sent it) is for people. ``bridge`` names one run of a bridge; each run numbers its states and events from 1.

A client (``client``: a unique name) takes a lease and renews it before ``seconds`` have passed. The client that takes it gets a
``token``, which is different each time. A command carries the token and an ``id``, which its client counts upwards. The same id
again is the same command. An id that is lower than the newest one and no longer cached is rejected, so that a repeated, late or
reordered command moves nothing. Halt and quick stop need no token and are executed each time that they are requested. If they carry
a token and an id, the commands that their client sent before them become too late.

A jog moves for 0.2 s after each of its queries. Its values are ``velocity``, ``press`` and ``sent``. The client counts ``press``
upwards each time that a button is pressed; ``sent`` is in seconds of the client's own clock. A press without a query for 0.2 s is
over. A query whose delay exceeds that of the promptest ones by 0.2 s is ignored: its button may have been released long ago. A jog
is answered at once.
"""

from __future__ import annotations

from typing import Literal, TypeVar

import msgspec

from axisbus.ipc.errors import ErrorFields, register_message_types

TOO_LATE = "comes too late: nothing was done"  # clients recognise by this text that an id was rejected because newer ids came first
PROTOCOL = 1  # incremented if an older fleet or bridge would misunderstand a change


Value = float | int | bool | str | None


class AxisInfo(msgspec.Struct, frozen=True):
    """An axis as its cell file describes it; ``unit`` is the unit of its positions, ``limits`` has the known limits by name."""

    name: str
    unit: str
    node: int | None = None
    limits: dict[str, float] = {}


class CellInfo(msgspec.Struct, frozen=True):
    """A cell: the versions of its bridge, and its axes, groups and nodes."""

    protocol: int
    axisbus: str
    bridge: str
    plant: str
    cell: str
    clock: float
    simulated: bool
    axes: tuple[AxisInfo, ...] = ()
    groups: dict[str, tuple[str, ...]] = {}
    nodes: tuple[int, ...] = ()
    computer: str = ""


class AxisStateMessage(msgspec.Struct, frozen=True):
    """State of an axis. ``age``: seconds since its process image was made, None if unknown; a value that is too old is None.

    ``sent``: when it was made, in seconds of the bridge's monotonic clock, by which a delay in the network is detected.
    ``position_age``: seconds since the drive's position was received, None if there is none. ``state`` is the PLCopen state,
    ``drive`` the state of CiA 402. Positions are in ``unit``, velocity in ``unit``/s, torque in N·m or as a fraction of the rated
    torque. ``error`` is the message of the axis's error.
    """

    n: int
    bridge: str
    clock: float
    unit: str
    state: str
    age: float | None = None
    drive: str | None = None
    mode: str | None = None
    position: float | None = None
    velocity: float | None = None
    torque: float | None = None
    following_error: float | None = None
    homed: bool | None = None
    error: str | None = None
    position_age: float | None = None
    sent: float | None = None


class Event(msgspec.Struct, frozen=True):
    """One event of a cell; ``n`` counts without gaps. ``about`` is an axis, ``node 3``, or empty for the cell."""

    n: int
    bridge: str
    clock: float
    kind: Literal["machine", "node", "emcy", "incident", "bus", "command", "lease"]
    text: str
    about: str = ""
    severity: Literal["info", "warning", "error"] = "info"
    cause: str = ""
    remedy: str = ""


class EventsAsk(msgspec.Struct, frozen=True):
    """Request stored events by their numbers; the answer is an ``EventsAnswer``."""

    first: int = 1
    last: int | None = None


class EventsAnswer(msgspec.Struct, frozen=True):
    """Events, oldest first, at most 256 at a time; ``oldest`` and ``newest`` are the numbers of all stored events (0: none)."""

    bridge: str
    oldest: int = 0
    newest: int = 0
    events: tuple[Event, ...] = ()


class LeaseAsk(msgspec.Struct, frozen=True):
    """Request for a lease. ``who`` is for people; ``token`` comes from an earlier answer; ``over``: take it from its holder.

    With ``over``, the present holder is notified, and moving axes are halted first.
    """

    verb: Literal["take", "renew", "release", "look"]
    client: str
    who: str = ""
    token: str = ""
    over: bool = False


class LeaseAnswer(msgspec.Struct, frozen=True):
    """The present holder of the lease, and for how many ``seconds`` from the request; ``refused`` is the reason of a rejection.

    Only the requesting client that holds the lease gets ``token``. ``holder`` may also be a program at the machine: then there are
    no ``seconds``.
    """

    holder: str | None = None
    seconds: float = 0.0
    token: str = ""
    refused: ErrorFields | None = None


class CommandAsk(msgspec.Struct, frozen=True):
    """A command for axes (none: all axes of the cell); ``values`` are the arguments of the library's call of the same verb."""

    client: str
    id: int
    token: str = ""
    axes: tuple[str, ...] = ()
    values: dict[str, Value] = {}


class CommandAnswer(msgspec.Struct, frozen=True):
    """State of a command. ``running``: the command had not ended when the answer was sent; send it again with the same id."""

    status: Literal["running", "done", "error"]
    error: ErrorFields | None = None
    note: str = ""


class ObjectWrite(msgspec.Struct, frozen=True):
    """A value for an object, with the token of the lease; a query without this payload reads the object."""

    client: str
    token: str
    value: Value


class ObjectAnswer(msgspec.Struct, frozen=True):
    """The value of an object, by its type in the EDS (octets as ``hex``), or the error."""

    value: Value = None
    hex: str = ""
    error: ErrorFields | None = None


class HistoryAsk(msgspec.Struct, frozen=True):
    """Request samples of signals (``x.position``) of one recording; without ``recording``, request the list of recordings.

    ``begin`` and ``end`` are in seconds from the recording's first sample. The answer has at most ``most`` samples, evenly thinned
    out.
    """

    recording: str = ""
    signals: tuple[str, ...] = ()
    begin: float = 0.0
    end: float | None = None
    most: int = 10_000


class RecordingInfo(msgspec.Struct, frozen=True):
    """A recording stored at a cell: its name, size in octets, and when it was last written (s since 1970, by its computer)."""

    name: str
    size: int
    written: float


class HistoryAnswer(msgspec.Struct, frozen=True):
    """The recordings, or the samples: ``times`` in seconds, and as many values for each signal."""

    recordings: tuple[RecordingInfo, ...] = ()
    times: tuple[float, ...] = ()
    values: dict[str, tuple[float | None, ...]] = {}
    error: ErrorFields | None = None


KINDS: tuple[type[msgspec.Struct], ...] = tuple(
    kind for kind in list(globals().values()) if isinstance(kind, type) and issubclass(kind, msgspec.Struct)
)


register_message_types(*KINDS)


# -- Decode payloads of the network; an invalid payload gives None -----------------------------------------------------


_Message = TypeVar("_Message")


def read(payload: bytes | None, kind: type[_Message]) -> _Message | None:
    """Return a payload decoded as ``kind``; None if there is no payload or it is not a valid message of this kind."""
    if payload is None:
        return None
    try:
        return msgspec.json.decode(payload, type=kind)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return None
