"""A command inside the core: its name, how far it is, and who hears of that."""

from __future__ import annotations

import logging
from collections.abc import Callable
from enum import Enum

from axisbus.errors import AxisbusError, Interrupted
from axisbus.motion.probing.capture import ProbeCapture

log = logging.getLogger("axisbus")


class Status(Enum):
    """How far a command is."""

    BUSY = "busy"  # accepted or about to be
    ACTIVE = "active"  # it has control of the axis
    DONE = "done"
    ABORTED = "aborted"  # another command or a stop took over
    ERROR = "error"


ENDED = frozenset({Status.DONE, Status.ABORTED, Status.ERROR})


class CommandStatus:
    """Holds how far one command is; only the core changes it.

    ``hear`` is called when the command has taken control, and when it has ended; it must not raise. ``note`` says what is to be
    known of an end that is otherwise well, ``capture`` what a touch probe has latched, while it is told.
    """

    __slots__ = ("_after", "_hear", "capture", "error", "name", "note", "number", "status")

    def __init__(
        self, name: str, hear: Callable[[CommandStatus], None] | None = None, number: int = 0
    ) -> None:
        """``name`` says what was asked, such as ``x.move_absolute(90.0 deg)``; ``hear`` None: nobody outside the core asks.

        ``number`` is that by which its owner knows it.
        """
        self.name = name
        self.number = number
        self.status = Status.BUSY
        self.error: AxisbusError | None = None
        self.note = ""
        self.capture: ProbeCapture | None = None
        self._hear = hear
        self._after: list[Callable[[], None]] = []

    def __repr__(self) -> str:
        return f"<Ticket {self.name}: {self.status.value}>"

    @property
    def busy(self) -> bool:
        """Whether the command has not ended."""
        return self.status not in ENDED

    def begin(self) -> None:
        """The command has control of what it moves, or shares it."""
        self.status = Status.ACTIVE
        self._tell()

    def tell(self, capture: ProbeCapture) -> None:
        """Tell what a touch probe has latched; the command goes on."""
        self.capture = capture
        self._tell()
        self.capture = None

    def finish(self, status: Status, error: AxisbusError | None = None) -> None:
        """End the command; a second call changes nothing."""
        if self.status in ENDED:
            return
        self.error = error
        self.status = status
        self._tell()
        for do in self._after:
            do()

    def then(self, do: Callable[[], None]) -> None:
        """Let ``do`` follow the end of this command, which is under way; for what the core itself makes of it."""
        self._after.append(do)

    def _tell(self) -> None:
        if self._hear is not None:
            self._hear(self)


def end_as(error: AxisbusError) -> Status:
    """Return how a command ends that ``error`` ended."""
    return Status.ABORTED if isinstance(error, Interrupted) else Status.ERROR


def unattended(name: str) -> CommandStatus:
    """Return the ticket of a command that nobody waits for, such as a stop of the core's own: where it fails, that is logged."""
    return CommandStatus(name, _log_failure)


def _log_failure(ticket: CommandStatus) -> None:
    if ticket.status is Status.ERROR:
        log.error("%s failed, and nobody looked at its handle:\n%s", ticket.name, ticket.error)
