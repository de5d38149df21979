"""The facts that a node reports about its program (firmware), and the comparison with a file, by the objects of CiA 302-3.

Theory of operation
-------------------
The identification in 1F56h is often a checksum, but CiA 302-3 does not say which one. It confirms a file if it equals one of the
usual checksums of its bytes, and proves nothing if it does not.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field

from axisbus.bus.sdo.access import SdoUploads
from axisbus.cell.program_file import deadline_for
from axisbus.cia301 import abort, sdo
from axisbus.cia301 import objects as o
from axisbus.cia301.sdo import if_served
from axisbus.cia302.program import (
    DATE,
    NUMBER,
    TIME,
    FlashStatus,
    NodeProgram,
    ProgramControl,
    ProgramVersion,
    Version,
)
from axisbus.errors import ArgumentError, AxisbusError, SdoAbort, StateError
from axisbus.wording import counted

_MOST = 8  # programs of a node that are shown

_CONTROL_TEXTS = {
    ProgramControl.STOP: "stopped: the node is in its boot loader",
    ProgramControl.START: "runs",
    ProgramControl.CLEAR: "cleared: the node has no program",
}


@dataclass(frozen=True, slots=True)
class ProgramFacts:
    """The facts that a node reports about one of its programs; None: it does not report it."""

    number: int
    control: int | None = None
    identification: int | None = None
    flash: FlashStatus | None = None

    @property
    def runs(self) -> bool:
        """Whether the program runs, as far as the node reports it."""
        return self.control in (None, ProgramControl.START)

    @property
    def control_text(self) -> str:
        """The value of 1F51h in words."""
        if self.control is None:
            return "not reported"
        known = {int(each): text for each, text in _CONTROL_TEXTS.items()}
        return known.get(self.control, f"{self.control}: not in CiA 302-3, see the manual")


@dataclass(frozen=True, slots=True)
class NodePrograms:
    """The programs of a node, and its texts about itself (empty: none); ``version`` is the date of the application (1F52h)."""

    node_id: int
    name: str
    software_version: str
    version: Version | None
    programs: tuple[ProgramFacts, ...]
    can_write: bool

    @property
    def identity(self) -> ProgramVersion:
        """The identity of the first program."""
        return ProgramVersion(self.version, self.programs[0].identification if self.programs else None)


@dataclass(frozen=True, slots=True)
class ProgramWritten:
    """The result of a write: the programs before and after, the transferred bytes, and how often a request was repeated."""

    before: NodePrograms
    after: NodePrograms
    size: int
    retries: int = 0


@dataclass(frozen=True, slots=True)
class ProgramRunState:
    """Progress of a write in bytes, and its end: ``written``, or ``error``."""

    done: int = 0
    total: int = 0
    written: ProgramWritten | None = None
    error: AxisbusError | None = None

    @property
    def ended(self) -> bool:
        """Whether the write has ended."""
        return self.written is not None or self.error is not None


@dataclass(frozen=True, slots=True)
class ProgramVerification:
    """Whether a node has a program: True, False, or None if it cannot be decided; ``reason`` in words."""

    same: bool | None
    reason: str


@dataclass(frozen=True, slots=True)
class ProgramOrder:
    """A program to be written; ``identification`` is the expected value of 1F56h:01 afterwards, None: any.

    ``deadline``: seconds for each part of the work, None: by the size.
    """

    data: bytes = field(repr=False)
    identification: int | None = None
    deadline: float | None = None

    def __post_init__(self) -> None:
        """Raise ArgumentError if there are no data: the program of the node would be cleared for nothing."""
        if not self.data:
            raise ArgumentError("the program to be written is empty", remedy="give the bytes of the program")

    @property
    def node_program(self) -> NodeProgram:
        """The same for the dialogue."""
        mark = ProgramVersion(identification=self.identification)
        return NodeProgram(mark, self.data, True, self.deadline or deadline_for(len(self.data)))


# -- reading -------------------------------------------------------------------------------------------------------------


def read_programs(node_id: int, objects: SdoUploads) -> NodePrograms:
    """Read what a node reports about its programs; blocks for some transfers, and writes nothing.

    Raises:
        SdoTimeout, BusError: the node does not answer.
    """
    date, time = (_number(objects, o.VERIFY_SOFTWARE, each) for each in (DATE, TIME))
    programs = []
    for number in range(1, _MOST + 1):
        control = _number(objects, o.PROGRAM_CONTROL, number)
        identification = _number(objects, o.PROGRAM_IDENTIFICATION, number)
        if control is None and identification is None:
            break
        flash = _number(objects, o.FLASH_STATUS, number)
        programs.append(
            ProgramFacts(number, control, identification, None if flash is None else FlashStatus(flash))
        )
    return NodePrograms(
        node_id,
        _text(objects, o.DEVICE_NAME),
        _text(objects, o.SOFTWARE_VERSION),
        None if date is None or time is None else Version(date, time),
        tuple(programs),
        bool(programs) and programs[0].control is not None and _exists(objects, o.PROGRAM_DATA),
    )


def require_writable(found: NodePrograms) -> None:
    """Raise StateError if a node's program cannot be written by CANopen."""
    if not found.can_write:
        raise StateError(
            f"the program of node {found.node_id} cannot be written over CANopen; nothing was sent",
            observed="it does not have both 1F50h (program data) and 1F51h:01 (program control) of CiA 302-3",
            remedy="load the program with the manufacturer's tool; some devices have these objects only in their boot loader",
        )


def verify_program(objects: SdoUploads, found: NodePrograms, data: bytes) -> ProgramVerification:
    """Compare a node's first program with ``data``: byte by byte if 1F50h can be read, else by 1F56h. Blocks for the transfer."""
    if found.programs and not found.programs[0].runs:
        return ProgramVerification(False, f"its program does not run: {found.programs[0].control_text}")
    present = if_served(objects.upload, o.PROGRAM_DATA, NUMBER) if found.can_write else None
    if present is not None:
        return _compared(present, data)
    reported = found.identity.identification
    sums = checksums(data)
    if reported is None:
        return ProgramVerification(
            None, "the node returns neither its program (1F50h) nor its identification (1F56h)"
        )
    same = [name for name, value in sums.items() if value == reported]
    if same:
        return ProgramVerification(
            True, f"its identification (1F56h) {reported:08X}h is the {same[0]} of the file"
        )
    texts = ", ".join(f"{name} {value:08X}h" for name, value in sums.items())
    return ProgramVerification(
        None,
        f"its identification (1F56h) is {reported:08X}h, which is none of the usual checksums of the file ({texts}); its "
        "manufacturer "
        "documents how it is computed",
    )


def checksums(data: bytes) -> dict[str, int]:
    """Return the usual checksums of a program, by name."""
    return {
        "CRC-32": zlib.crc32(data),
        "CRC-16 of CiA 301": sdo.checksum(data),
        "sum of its bytes": sum(data) & 0xFFFF_FFFF,
    }


def _compared(present: bytes, data: bytes) -> ProgramVerification:
    if present[: len(data)] == data and not present[len(data) :].strip(b"\xff\0"):
        return ProgramVerification(
            True, f"its program data (1F50h) are the {counted(len(data), 'byte')} of the file"
        )
    at = next(
        (number for number, pair in enumerate(zip(present, data, strict=False)) if pair[0] != pair[1]), None
    )
    where = (
        f"from byte {at} on"
        if at is not None
        else f"it has {counted(len(present), 'byte')}, the file {len(data)}"
    )
    return ProgramVerification(False, f"its program data (1F50h) differ from the file: {where}")


# -- objects that a node may not have --------------------------------------------------------------------------------------


def _number(objects: SdoUploads, index: int, subindex: int) -> int | None:
    data = if_served(objects.upload, index, subindex)
    return None if not data else int.from_bytes(data, "little")


def _text(objects: SdoUploads, index: int) -> str:
    data = if_served(objects.upload, index)
    return "" if data is None else data.decode("ascii", "replace").strip("\0 ")


def _exists(objects: SdoUploads, index: int) -> bool:
    """Whether a node has an array. Only sub-index 0 is read: reading another one may transfer a whole memory."""
    try:
        objects.upload(index)
    except SdoAbort as refused:
        return refused.code != abort.OBJECT_MISSING
    return True
