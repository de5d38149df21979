"""A command inside the core: its name, its status, and the callback that reports changes."""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

from axisbus.cia402.touch_probe import Edge
from axisbus.errors import AxisbusError, CommandError, Interrupted, one_line

log = logging.getLogger("axisbus")


class ProbeCapture(NamedTuple):
    """A position latched by a touch probe: ``position`` (unwrapped increments) of the axis at the edge.

    ``origin``: of the axis when the edge was read. ``stamp``: seconds (monotonic) of the cycle in which it was read. ``missed``:
    number of edges of this kind that the drive has counted since the previous one without a report; None if it does not count.
    """

    edge: Edge
    position: int
    origin: int
    stamp: float
    missed: int | None = None


class Status(Enum):
    """Status of a command."""

    BUSY = "busy"  # accepted or about to be
    ACTIVE = "active"  # it has control of the axis
    DONE = "done"
    ABORTED = "aborted"  # another command or a stop took over
    ERROR = "error"


ENDED = frozenset({Status.DONE, Status.ABORTED, Status.ERROR})


class CommandStatus:
    """Status of one command; only the core changes it.

    ``on_change`` is called when the command takes control and when it ends; it must not raise. ``note`` gives additional
    information about an end without error. ``capture`` is the position that a touch probe has latched; it is set only while
    ``on_change`` is called for it.
    """

    __slots__ = ("_after", "_on_change", "capture", "error", "name", "note", "number", "status")

    def __init__(
        self, name: str, on_change: Callable[[CommandStatus], None] | None = None, number: int = 0
    ) -> None:
        """``name``: description of the command, such as ``x.move_absolute(90.0 deg)``; ``on_change`` None: no callback.

        ``number``: identifier that the owner of the command uses.
        """
        self.name = name
        self.number = number
        self.status = Status.BUSY
        self.error: AxisbusError | None = None
        self.note = ""
        self.capture: ProbeCapture | None = None
        self._on_change = on_change
        self._after: list[Callable[[], None]] = []

    def __repr__(self) -> str:
        return f"<CommandStatus {self.name}: {self.status.value}>"

    @property
    def busy(self) -> bool:
        """Whether the command has not ended."""
        return self.status not in ENDED

    def begin(self) -> None:
        """Mark the command as active: it has control of its axes, or shares it."""
        self.status = Status.ACTIVE
        self._notify()

    def report_capture(self, capture: ProbeCapture) -> None:
        """Report a position that a touch probe has latched; the command continues."""
        self.capture = capture
        self._notify()
        self.capture = None

    def finish(self, status: Status, error: AxisbusError | None = None) -> None:
        """End the command; a second call has no effect."""
        if self.status in ENDED:
            return
        self.error = error
        self.status = status
        self._notify()
        for callback in self._after:
            callback()

    def then(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` after the end of this command, which must not have ended yet; for reactions of the core itself."""
        self._after.append(callback)

    def _notify(self) -> None:
        if self._on_change is not None:
            self._on_change(self)


def end_as(error: AxisbusError) -> Status:
    """Return the final status of a command that ``error`` has ended."""
    return Status.ABORTED if isinstance(error, Interrupted) else Status.ERROR


def unattended(name: str) -> CommandStatus:
    """Return the ticket of a command without a waiting client, such as the core's own stop; a failure is logged."""
    return CommandStatus(name, _log_failure)


def _log_failure(ticket: CommandStatus) -> None:
    if ticket.status is Status.ERROR:
        log.error("%s failed, and its handle was not read:\n%s", ticket.name, ticket.error)


# -- The commands that share one motion: each ends as done when its end has been passed, and the next one takes over -------


class CommandEnds:
    """Holds the tickets whose ends are ahead, in order. The owner of the motion holds the ticket of the last command."""

    __slots__ = ("_ahead", "_marks")

    def __init__(self) -> None:
        self._ahead: deque[tuple[CommandStatus, CommandStatus]] = deque()
        self._marks: dict[CommandStatus, float] = {}  # by ticket, as far as known

    def __len__(self) -> int:
        return len(self._ahead)

    def add(self, ticket: CommandStatus, following: CommandStatus) -> None:
        """Let ``ticket`` end when ``following`` takes over (see ``mark``); an error of ``following`` ends ``ticket`` too."""
        self._ahead.append((ticket, following))
        following.then(lambda: self._end(following))

    def end_passed(self, progress: float) -> bool:
        """End the commands whose ends have been passed at ``progress``; return whether there were any."""
        found = False
        while self._ahead and progress >= self._marks.get(self._ahead[0][0], math.inf):
            ticket, following = self._ahead.popleft()
            del self._marks[ticket]
            ticket.finish(Status.DONE)
            if following.busy:
                following.begin()
            found = True
        return found

    def mark(self, ticket: CommandStatus, progress: float) -> None:
        """Set the path position, time or count at which ``ticket`` ends."""
        self._marks[ticket] = progress

    def _end(self, last: CommandStatus) -> None:
        """End all commands before ``last``, which has ended."""
        while any(following is last for _, following in self._ahead):
            ticket = self._ahead.popleft()[0]
            self._marks.pop(ticket, None)
            error = last.error
            ticket.finish(Status.DONE if error is None else end_as(error), error)


# -- Errors for unexpected exceptions: an exception in the user's code, or a bug in axisbus, ends one command --------------

_REMEDY = (
    "its traceback is the __cause__ of this error: correct the trajectory or the number that it names; if it names neither, "
    "it is a mistake in axisbus: report it. The axis was stopped"
)


def broken(error: Exception, what: str) -> AxisbusError:
    """Return the error that ends command ``what``, in which ``error`` was raised."""
    if isinstance(error, AxisbusError):
        return error
    failure = CommandError(
        f"{what}: ended by an unexpected exception", observed=one_line(error), remedy=_REMEDY
    )
    failure.__cause__ = error
    return failure
