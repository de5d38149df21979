"""What crosses between a cell's bridge and a fleet, as JSON; a field that is not known is passed over, so that versions can differ.

Theory of operation
-------------------
Clocks of two computers are never compared. A value has an ``age`` that its own computer measured; ``clock`` (s since 1970, of the
computer that sent it) is for people. ``bridge`` names one run of a bridge: numbers of states and events begin with it, from 1.

A lease is taken by a client (``client``: a name that no other has) and renewed before ``seconds`` have passed; whoever takes it
has a ``token``, which is another at each taking. A command carries the token and an ``id``, which its client counts upwards. The
same id once more is the same command; one that is smaller than the newest and not kept is refused: whatever is repeated, late or
out of order moves nothing. Halt and quick stop need no token, and are done again each time that they are asked for;
with a token and an id they make late what their client had sent before them.

A jog goes on for 0.2 s from each of its queries. Its values are ``velocity``, ``press``, a number that its client counts upwards
each time that a button is pressed, and ``sent``, the seconds of the client's own clock: a press that was silent for 0.2 s is over,
and a query that comes later than the promptest ones by as much is of a hand that may be long gone. It is answered at once.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from axisbus.ipc.errors import ErrorFields
from axisbus.ipc.register_types import register_message_types

TOO_LATE = "comes too late: nothing was done"  # by which a client knows the refusal of an id that others have overtaken
PROTOCOL = 1  # counted up where an older fleet or bridge would misunderstand

Value = float | int | bool | str | None


class AxisInfo(msgspec.Struct, frozen=True):
    """An axis as its cell file describes it; ``unit`` is that of its positions, ``limits`` those that are known, by name."""

    name: str
    unit: str
    node: int | None = None
    limits: dict[str, float] = {}


class CellInfo(msgspec.Struct, frozen=True):
    """A cell: which versions speak, and what it has."""

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
    """What an axis does. ``age``: seconds since the image was made, None where nothing is known; a value that is too old is None.

    ``position_age``: since the drive's position was received, where it was. ``state`` is PLCopen's, ``drive`` that of CiA 402;
    positions are in ``unit``, velocity in ``unit``/s, torque in N·m, or in parts of the rated torque. ``error`` is what the axis's
    error says.
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


class Event(msgspec.Struct, frozen=True):
    """Something that has happened; ``n`` counts without gaps. ``about`` is an axis, ``node 3``, or empty for the cell."""

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
    """Which of the events that are kept, by their numbers; the answer is an ``EventsAnswer``."""

    first: int = 1
    last: int | None = None


class EventsAnswer(msgspec.Struct, frozen=True):
    """Events, oldest first, at most 256 at a time; ``oldest`` and ``newest`` are the numbers of all that are kept (0: none)."""

    bridge: str
    oldest: int = 0
    newest: int = 0
    events: tuple[Event, ...] = ()


class LeaseAsk(msgspec.Struct, frozen=True):
    """``who`` is for people; ``token`` is what an earlier answer gave; ``over``: from whoever has it, who is told, after a halt."""

    verb: Literal["take", "renew", "release", "look"]
    client: str
    who: str = ""
    token: str = ""
    over: bool = False


class LeaseAnswer(msgspec.Struct, frozen=True):
    """Who has the lease now, and for how many ``seconds`` from when that was asked; ``refused`` says why not.

    ``token`` is for whoever asked and has it. ``holder`` may be a program at the machine as well: then there are no ``seconds``.
    """

    holder: str | None = None
    seconds: float = 0.0
    token: str = ""
    refused: ErrorFields | None = None


class CommandAsk(msgspec.Struct, frozen=True):
    """A command for axes (none: all of the cell); ``values`` are the arguments of the library's call of the same verb."""

    client: str
    id: int
    token: str = ""
    axes: tuple[str, ...] = ()
    values: dict[str, Value] = {}


class CommandAnswer(msgspec.Struct, frozen=True):
    """How the command goes: ``running`` is told where it has not ended while the query may last; ask again with the same id."""

    status: Literal["running", "done", "error"]
    error: ErrorFields | None = None
    note: str = ""


class ObjectWrite(msgspec.Struct, frozen=True):
    """A value for an object, with the token of the lease; without this payload the object is read."""

    client: str
    token: str
    value: Value


class ObjectAnswer(msgspec.Struct, frozen=True):
    """The value of an object, by its type in the EDS (octets as ``hex``), or why it could not be had."""

    value: Value = None
    hex: str = ""
    error: ErrorFields | None = None


class HistoryAsk(msgspec.Struct, frozen=True):
    """Samples of signals (``x.position``) of one recording; without ``recording`` the recordings are listed.

    ``begin`` and ``end`` in seconds from the recording's first sample; at most ``most`` samples, evenly left out.
    """

    recording: str = ""
    signals: tuple[str, ...] = ()
    begin: float = 0.0
    end: float | None = None
    most: int = 10_000


class RecordingInfo(msgspec.Struct, frozen=True):
    """A recording that a cell keeps: its name, size in octets, and when it was last written (s since 1970, by its computer)."""

    name: str
    size: int
    written: float


class HistoryAnswer(msgspec.Struct, frozen=True):
    """The recordings, or the samples: ``times`` in seconds, and for each signal as many values."""

    recordings: tuple[RecordingInfo, ...] = ()
    times: tuple[float, ...] = ()
    values: dict[str, tuple[float | None, ...]] = {}
    error: ErrorFields | None = None


KINDS: tuple[type[msgspec.Struct], ...] = tuple(
    kind for kind in list(globals().values()) if isinstance(kind, type) and issubclass(kind, msgspec.Struct)
)
register_message_types(*KINDS)
