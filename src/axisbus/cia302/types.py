"""Types for a node's boot-up (CiA 302-2): the plan, the requests, the answers, and the outcome."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import Value
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.sdo import SdoTransferType
from axisbus.cia302.program import NodeProgram, ProgramState

TRIES = 8  # with 4 % of the dialogues lost, one in 10^11 fails eight times
LEAST_CONSUMER = 0.15  # seconds: the shortest time after which a silent node counts as lost
DEADLINE = 0.5  # seconds for the answer to one SDO request
LOAD = int.from_bytes(b"load", "little")  # the signature of 1011h


class Letter(Enum):
    """The error status of a boot-up: its letter in CiA 302-2, with a sentence by axisbus."""

    A = "the node is not in the master's list of nodes"
    B = "the node does not answer the request for its device type (1000h)"
    C = "the device type (1000h) is not the expected one"
    D = "the vendor ID (1018h:01) is not the expected one"
    E = "the node is to send a heartbeat and sends none, so its state is not known"
    F = "the node does not answer node guarding, so its state is not known"
    G = "the data needed to check or replace the node's program are missing or inconsistent"
    H = "the node has a program other than the expected one, which may not be replaced"
    I = "the node's program had to be replaced, and its download failed"  # noqa: E741 - the standard's letter
    J = "the download of the configuration failed"
    K = "the node sends no heartbeat after error control was started"
    L = "the node was operational already"
    M = "the product code (1018h:02) is not the expected one"
    N = "the revision number (1018h:03) is not the expected one"
    O = "the serial number (1018h:04) is not the expected one"  # noqa: E741 - the standard's letter

    @property
    def sentence(self) -> str:
        """The meaning of the letter."""
        return str(self.value)


# Compared values in the order of the standard: object, name, and the letter for a difference.
IDENTITY = (
    ((o.DEVICE_TYPE, 0), "device type", Letter.C),
    ((o.IDENTITY, o.VENDOR_ID), "vendor ID", Letter.D),
    ((o.IDENTITY, o.PRODUCT_CODE), "product code", Letter.M),
    ((o.IDENTITY, o.REVISION_NUMBER), "revision number", Letter.N),
    ((o.IDENTITY, o.SERIAL_NUMBER), "serial number", Letter.O),
)
Address = tuple[int, int]


# -- the plan ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Expected:
    """An expected identity value: only the bits of ``mask`` count.

    ``lenient``: a node that does not report it (or 0) is accepted.
    """

    value: int
    mask: int = 0xFFFF_FFFF
    lenient: bool = False


@dataclass(frozen=True, slots=True)
class Setting:
    """An object to be written and read back; ``source`` is the origin of the setting as text.

    ``fixed``: the node does not permit writing it, so it is only read, and must have the value already.
    """

    index: int
    subindex: int
    value: Value
    source: str = ""
    fixed: bool = False


@dataclass(frozen=True, slots=True)
class BootPlan:
    """The boot-up of one node.

    Attributes:
        node: its ID, 1 to 127.
        listed: whether the node is in the master's list at all.
        identity: expected values by object (see ``IDENTITY``); objects that are left out are only read.
        find_tries: number of requests for 1000h, ``DEADLINE`` seconds each, before the node counts as absent.
        keep_alive: a node found operational stays as it is: it is neither configured nor taken out of operational.
        program: the expected program of the node; None: any. It is checked after the state, and before anything is written.
        restore: restore the default parameters (1011h:01) and restart the node before it is configured.
        settings: the configuration, in order.
        version: date (days since 1984-01-01) and time (ms after midnight) of the configuration, for 1020h; a node that has the same
            is not configured again. None: it always is.
        heartbeat: seconds between the node's heartbeats; None: no error control.
        missed: number of heartbeats that may be missing.
        start: whether the node is started at the end.
    """

    node: int
    listed: bool = True
    identity: Mapping[Address, Expected] = field(default_factory=dict)
    find_tries: int = 6
    keep_alive: bool = False
    program: NodeProgram | None = None
    restore: bool = False
    settings: tuple[Setting, ...] = ()
    version: tuple[int, int] | None = None
    heartbeat: float | None = None
    missed: int = 3
    start: bool = True


# -- requests: each is made up to ``tries`` times, with ``deadline`` seconds each ----------------------------------------


@dataclass(frozen=True, slots=True)
class Read:
    """Read an object; the answer is its value."""

    index: int
    subindex: int = 0
    deadline: float = DEADLINE
    tries: int = TRIES


@dataclass(frozen=True, slots=True)
class BootWrite:
    """Write an object; ``checked``: against the limits of its description."""

    index: int
    subindex: int
    value: Value
    checked: bool = True
    deadline: float = DEADLINE
    tries: int = TRIES


@dataclass(frozen=True, slots=True)
class ProgramDownload:
    """Write a node's program, as bytes; ``deadline`` (seconds) is for each single answer of the node."""

    index: int
    subindex: int
    data: bytes = field(repr=False)
    transfer_type: SdoTransferType = SdoTransferType.AUTO
    deadline: float = DEADLINE
    tries: int = 1  # a part may have been written: only the steps of the plan may repeat it


@dataclass(frozen=True, slots=True)
class Pause:
    """Let ``seconds`` pass; always answered."""

    seconds: float
    tries: int = 1


@dataclass(frozen=True, slots=True)
class BootNmtCommand:
    """Send an NMT command and wait for its confirmation; for the resets, the boot-up message. The answer is the NMT state.

    ``always``: also if the node has reported the state before, which may have changed since.
    """

    command: NmtCommand
    deadline: float = 2.0
    tries: int = 5
    always: bool = False


@dataclass(frozen=True, slots=True)
class Listen:
    """Wait for a heartbeat; the answer is the NMT state."""

    deadline: float
    tries: int = 3


@dataclass(frozen=True, slots=True)
class GuardRequest:
    """Request the NMT state by node guarding; the answer is the NMT state."""

    deadline: float = 0.1
    tries: int = TRIES


# -- answers, each with the seconds that it took -------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Got:
    """The requested value."""

    value: Value | NmtState | None = None
    elapsed: float = 0.0


@dataclass(frozen=True, slots=True)
class SdoAbortReply:
    """An SDO abort."""

    code: int
    elapsed: float = 0.0


@dataclass(frozen=True, slots=True)
class NoReply:
    """No answer within the deadline; ``for_this_only``: the node answered for another object meanwhile."""

    elapsed: float = 0.0
    for_this_only: bool = False


@dataclass(frozen=True, slots=True)
class Failed:
    """The request could not be made, or the application's part failed: another try would be useless."""

    elapsed: float = 0.0


Answer = Got | SdoAbortReply | NoReply | Failed


# -- the end -----------------------------------------------------------------------------------------------------------


class ErrorControl(Enum):
    """How the master will detect the loss of the node."""

    HEARTBEAT = "its heartbeat"
    GUARDING = "node guarding"
    NONE = "nothing"


@dataclass(frozen=True, slots=True)
class BootOutcome:
    """The result of a boot-up, and all known facts about it.

    ``letter`` is None for plain success, and for a failure without a letter in the standard (a node that becomes silent during the
    boot-up, an NMT command that is not confirmed). L is not a failure. ``tries`` are those of the last request, ``retries`` the
    number of repeated requests, ``elapsed`` is in seconds. ``setting`` is the setting that could not be written. ``program`` is the
    state of the node's program if one is expected. ``consumer`` is the time in seconds after which a missing heartbeat counts as
    lost.
    """

    node: int
    ok: bool
    letter: Letter | None
    step: str
    address: Address | None = None
    expected: Value | None = None
    got: Value | None = None
    abort: int | None = None
    tries: int = 0
    retries: int = 0
    elapsed: float = 0.0
    identity: Mapping[Address, int] = field(default_factory=dict)
    found: NmtState = NmtState.UNKNOWN
    control: ErrorControl = ErrorControl.NONE
    consumer: float | None = None
    program: ProgramState | None = None
    setting: Setting | None = None
    written: int = 0
    done: tuple[str, ...] = ()
    skipped: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """The result as a sentence."""
        if self.letter is not None:
            return self.letter.sentence
        return "the node is booted" if self.ok else f"the node fell silent at the step {self.step}"


# -- the application's parts -------------------------------------------------------------------------------------------


class BootPhase(Enum):
    """Points of a boot-up at which the application has a part of its own."""

    STEP = "a step begins"
    LOOK = "identified: may it be disturbed?"
    PREPARE = "about to be configured, or found configured"
    CONFIGURE = "1020h is not the expected one: about to be downloaded"
    COMPLETE = "configured, about to be started"


@dataclass(frozen=True, slots=True)
class Local:
    """Let the application do its part, with the outcome so far; the answer False to ``LOOK`` leaves the node as it is."""

    phase: BootPhase
    known: BootOutcome
    tries: int = 1


Request = Read | BootWrite | ProgramDownload | Pause | BootNmtCommand | Listen | GuardRequest | Local
