"""How a command to a cell goes on: asked again under the same id until its end is known, or nobody can tell it any more.

Theory of operation
-------------------
A query may be lost, and so may its answer. The cell keeps the answers of ids that it has seen, so asking again moves nothing twice.
What stays open is told as that: a handle never ends well for want of news.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from axisbus import errors
from axisbus.errors import AxisbusError, CommandError
from axisbus.fleet.messages import CommandAnswer
from axisbus.ipc.errors import ErrorFields, from_fields
from axisbus.motion.command_status import Status, end_as

SILENCE = 10.0  # seconds that a cell which is there may say nothing to a command
_AGAIN = 0.1  # seconds until it is asked again that gave no answer
_GOES_ON = 0.02  # and that said "running"
_LOOK = "whether it moved is not known: look at the state and the position of the axis"


class Situation(NamedTuple):
    """What is known of the cell when a query has ended: ``now`` in seconds, local and monotonic."""

    now: float
    alive: bool
    run: str
    leased: bool


class Again(NamedTuple):
    """Ask once more, after so many seconds."""

    after: float


class CommandEnd(NamedTuple):
    """The command has ended, as far as can be known."""

    status: Status
    error: AxisbusError | None = None
    note: str = ""


@dataclass
class CommandRetry:
    """One command under way. ``once``: it must not come late, so it is never asked again."""

    name: str
    begun: float
    run: str
    once: bool = False
    needs_lease: bool = True
    active: bool = False

    def __post_init__(self) -> None:
        self._heard = self.begun

    def answered(self, answer: CommandAnswer, now: float) -> Again | CommandEnd:
        """Return what follows an answer."""
        if answer.status == "done":
            return CommandEnd(Status.DONE, None, answer.note)
        if answer.status == "error":
            error = error_of(answer.error, self.name)
            return CommandEnd(end_as(error), error, answer.note)
        if self.once:
            return CommandEnd(
                Status.DONE, None, answer.note
            )  # it was taken: to ask again would be to press again
        self.active, self._heard = True, now
        return Again(_GOES_ON)

    def unanswered(self, seen: Situation) -> Again | CommandEnd:
        """Return what follows a query that nobody has answered."""
        why = self._given_up(seen)
        return Again(_AGAIN) if why is None else CommandEnd(Status.ERROR, self._unknown(why))

    def closed(self) -> CommandEnd:
        """Return how it ends here where its program asks nothing any more."""
        return CommandEnd(Status.ERROR, self._unknown("this program has closed its fleet while it ran"))

    def _given_up(self, seen: Situation) -> str | None:
        """Return why it is not asked again, None where it is."""
        if not seen.alive:
            return "the cell is gone"
        if self.run and seen.run != self.run:
            return "the bridge of the cell has begun anew meanwhile, and does not know the command"
        if self.once:
            return "the cell gave no answer; it is not asked again, for it must not come late"
        if self.needs_lease and not seen.leased:
            return "the lease is lost and the cell gave no answer; it halts what the lease had moved"
        if seen.now - self._heard > SILENCE:
            return f"the cell is there and gave no answer for {SILENCE:g} s"
        return None

    def _unknown(self, why: str) -> CommandError:
        return CommandError(f"{self.name}: how it ended is not known", observed=why, remedy=_LOOK)


def error_of(fields: ErrorFields | None, what: str) -> AxisbusError:
    """Return an error as it was there; one that this version does not know, or that is incomplete, as its base."""
    given: dict[str, Any] = {} if fields is None else fields.fields
    if fields is None or fields.kind not in errors.__all__ or not isinstance(given.get("message"), str):
        kind = "an error that it does not name" if fields is None else fields.kind
        return AxisbusError(f"{what}: {given.get('message', 'failed')}", observed=f"the cell tells {kind}")
    texts = {key: str(given.get(key, "")) for key in ("message", "observed", "remedy")}
    return from_fields(ErrorFields(fields.kind, {**given, **texts}, fields.notes, fields.cause))
