"""Decide how a command to a cell continues: send it again with the same id until its end is known or cannot be known any more.

Theory of operation
-------------------
A query may be lost, and so may its answer. The cell caches the answers of the ids that it has seen, so sending a command again
never moves an axis twice. If the end of a command stays unknown, the handle reports that: it never ends as done for lack of an
answer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from axisbus import errors
from axisbus.errors import AxisbusError, CommandError
from axisbus.fleet.messages import CommandAnswer
from axisbus.ipc.errors import ErrorFields, from_fields
from axisbus.motion.command_status import Status, end_as

SILENCE = 10.0  # seconds without an answer to a command after which a cell that is alive counts as failed
_RETRY_DELAY = 0.1  # seconds until a command without an answer is sent again
_RUNNING_DELAY = 0.02  # seconds until a command that was answered "running" is sent again
_UNKNOWN_REMEDY = "it is not known whether the axis moved: check its state and position"


class Situation(NamedTuple):
    """State of the cell when a query has ended: ``now`` in seconds, local and monotonic."""

    now: float
    alive: bool
    run: str
    leased: bool


class SendAgain(NamedTuple):
    """Send the command again after this number of seconds."""

    delay: float


class CommandEnd(NamedTuple):
    """The end of the command, as far as it is known."""

    status: Status
    error: AxisbusError | None = None
    note: str = ""


@dataclass
class CommandRetry:
    """One running command. ``once``: it must not arrive late, so it is never sent again."""

    name: str
    started: float
    run: str
    once: bool = False
    needs_lease: bool = True
    active: bool = False

    def __post_init__(self) -> None:
        self._last_answer = self.started

    def answered(self, answer: CommandAnswer, now: float) -> SendAgain | CommandEnd:
        """Return the next step after an answer."""
        if answer.status == "done":
            return CommandEnd(Status.DONE, None, answer.note)
        if answer.status == "error":
            error = error_of(answer.error, self.name)
            return CommandEnd(end_as(error), error, answer.note)
        if self.once:
            return CommandEnd(
                Status.DONE, None, answer.note
            )  # it was accepted; sending it again would be another press
        self.active, self._last_answer = True, now
        return SendAgain(_RUNNING_DELAY)

    def unanswered(self, situation: Situation) -> SendAgain | CommandEnd:
        """Return the next step after a query without an answer."""
        why = self._why_ended(situation)
        return SendAgain(_RETRY_DELAY) if why is None else CommandEnd(Status.ERROR, self._unknown(why))

    def closed(self) -> CommandEnd:
        """Return the end of the command when this program closes its fleet."""
        return CommandEnd(Status.ERROR, self._unknown("this program has closed its fleet while it ran"))

    def _why_ended(self, situation: Situation) -> str | None:
        """Return why the command is not sent again; None if it is sent again."""
        if not situation.alive:
            return "the cell is gone"
        if self.run and situation.run != self.run:
            return "the bridge of the cell has restarted meanwhile, and does not know the command"
        if self.once:
            return "the cell did not answer; the command is not sent again, because it must not arrive late"
        if self.needs_lease and not situation.leased:
            return "the lease is lost and the cell did not answer; it halts the axes that were moved under the lease"
        if situation.now - self._last_answer > SILENCE:
            return f"the cell is alive but did not answer for {SILENCE:g} s"
        return None

    def _unknown(self, why: str) -> CommandError:
        return CommandError(f"{self.name}: its result is not known", observed=why, remedy=_UNKNOWN_REMEDY)


def error_of(fields: ErrorFields | None, what: str) -> AxisbusError:
    """Return the error that the cell reported; an unknown or incomplete error becomes an ``AxisbusError``."""
    given: dict[str, Any] = {} if fields is None else fields.fields
    if fields is None or fields.kind not in errors.__all__ or not isinstance(given.get("message"), str):
        kind = "an unnamed error" if fields is None else fields.kind
        return AxisbusError(f"{what}: {given.get('message', 'failed')}", observed=f"the cell reports {kind}")
    texts = {key: str(given.get(key, "")) for key in ("message", "observed", "remedy")}
    return from_fields(ErrorFields(fields.kind, {**given, **texts}, fields.notes, fields.cause))
