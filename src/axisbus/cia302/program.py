"""Types for a node's program (CiA 302-3): the expected and the present program, and the flash status."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from enum import Enum, IntEnum
from typing import NamedTuple

from axisbus.cia301 import objects as o

NUMBER = 1  # the sub-index of 1F50h, 1F51h, 1F56h and 1F57h: the first program, for most devices the only one
DATE, TIME = 1, 2  # sub-indices of 1F52h

_FIRST_DAY = datetime(1984, 1, 1)
_DAY = 86_400_000
_LAST_DAYS = 0xFFFF  # 2163; later values are memory that was never written


class ProgramControl(IntEnum):
    """Values written to 1F51h, and read from it afterwards (CiA 302-3, program control)."""

    STOP = 0
    START = 1
    RESET = 2
    CLEAR = 3


# Values of 1F51h at which a command has no further effect: a cleared program does not run either.
REACHED = {
    ProgramControl.STOP: frozenset({ProgramControl.STOP, ProgramControl.CLEAR}),
    ProgramControl.CLEAR: frozenset({ProgramControl.CLEAR}),
    ProgramControl.START: frozenset({ProgramControl.START}),
}

# Bits 1 to 7 of 1F57h (CiA 302-3, flash status identification).
FLASH_ERRORS = {
    0: "no error",
    1: "it has no valid program",
    2: "it does not know the format of the data",
    3: "the data are faulty (format or checksum)",
    4: "its memory was not cleared before it was written",
    5: "its memory could not be written",
    6: "an address lies outside its memory",
    7: "its memory is protected against writing",
    63: "an error that it does not specify",
}


class FlashStatus(NamedTuple):
    """Value of 1F57h; an error that is not in the table is manufacturer-specific."""

    value: int

    @property
    def busy(self) -> bool:
        """Whether the memory is still being cleared or written."""
        return bool(self.value & 1)

    @property
    def error(self) -> int:
        """The number of the error, 0 for none."""
        return self.value >> 1 & 0x7F

    def __str__(self) -> str:
        if self.busy:
            return "still at work"
        return f"error {self.error}: {FLASH_ERRORS.get(self.error, 'not in CiA 302-3, see the manual')}"


class Version(NamedTuple):
    """The date of a program in 1F52h: days since 1984-01-01 and milliseconds after midnight, without a time zone."""

    days: int
    milliseconds: int

    @property
    def moment(self) -> datetime | None:
        """Date and time, None for invalid numbers."""
        if not 0 <= self.days <= _LAST_DAYS or not 0 <= self.milliseconds < _DAY:
            return None
        return _FIRST_DAY + timedelta(days=self.days, milliseconds=self.milliseconds)

    def __str__(self) -> str:
        moment = self.moment
        if moment is None:
            return f"no date ({self.days:08X}h, {self.milliseconds:08X}h)"
        if self == (0, 0):
            return "no date (both are 0)"
        return moment.isoformat(" ", "milliseconds" if self.milliseconds % 1000 else "seconds")


class ProgramVersion(NamedTuple):
    """Identity of a program: its date (1F52h), its identification (1F56h:01), or both; None: not used."""

    version: Version | None = None
    identification: int | None = None

    @classmethod
    def of(cls, numbers: Mapping[tuple[int, int], int]) -> ProgramVersion:
        """Return the version by the values of these objects."""
        date, time = numbers.get(_DATE), numbers.get(_TIME)
        version = None if date is None or time is None else Version(date, time)
        return cls(version, numbers.get(_IDENTIFICATION))

    @property
    def numbers(self) -> dict[tuple[int, int], int]:
        """The value of each object, in the order in which they are read."""
        found = {} if self.version is None else dict(zip((_DATE, _TIME), self.version, strict=True))
        return found if self.identification is None else {**found, _IDENTIFICATION: self.identification}

    def __str__(self) -> str:
        parts = [] if self.version is None else [str(self.version)]
        parts += [] if self.identification is None else [f"identification {self.identification:08X}h"]
        return ", ".join(parts)


_DATE, _TIME = (o.VERIFY_SOFTWARE, DATE), (o.VERIFY_SOFTWARE, TIME)
_IDENTIFICATION = (o.PROGRAM_IDENTIFICATION, NUMBER)


@dataclass(frozen=True, slots=True)
class NodeProgram:
    """The expected program of a node.

    Attributes:
        mark: its identity; empty only if it is not compared (``program_download.write_program``).
        data: the data to transfer if the node has another program; None: not available.
        allowed: whether the node's program may be replaced at all.
        deadline: seconds for each part of a replacement: the answer to one request while the node clears or writes its memory, the
            memory until it is ready, the node until it is back with the new program.
    """

    mark: ProgramVersion
    data: bytes | None = field(default=None, repr=False)
    allowed: bool = False
    deadline: float = 60.0


class ProgramStage(Enum):
    """Stage of a replacement; the value completes "while" ..."""

    CHECK = "it was asked for its program"
    STOP = "the old program was being stopped"
    CLEAR = "the old program was being cleared"
    TRANSFER = "the new program was being transferred"
    FLASH = "the node wrote the new program to its memory"
    START = "the new program was being started"
    RETURN = "the node was to come back with the new program"


@dataclass(frozen=True, slots=True)
class ProgramState:
    """State of a node's program; ``found`` and ``now`` are None if the node does not report it.

    ``stage`` is the last one that was begun, ``loaded`` the bytes of a completed transfer, ``flash`` the last reported flash
    status.
    """

    expected: ProgramVersion
    found: ProgramVersion | None
    now: ProgramVersion | None
    stage: ProgramStage = ProgramStage.CHECK
    loaded: int = 0
    flash: FlashStatus | None = None

    @property
    def replaced(self) -> bool:
        """Whether the node has the expected program because it was downloaded."""
        return self.loaded > 0 and self.now == self.expected
