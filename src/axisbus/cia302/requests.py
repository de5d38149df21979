"""Requests and progress of one boot-up: requests are repeated until they are answered, and the outcome is collected."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from typing import Any

from axisbus.cia301.abort import BUSY, OBJECT_MISSING
from axisbus.cia302.types import (
    Answer,
    BootOutcome,
    BootPlan,
    Failed,
    Got,
    Letter,
    NoReply,
    Read,
    Request,
    SdoAbortReply,
)

Dialogue = Generator[Request, Answer, Answer]
Step = Generator[Request, Answer, None]


class BootUpEnded(Exception):
    """The boot-up has ended; the outcome contains the reason."""


class BootUpProgress:
    """One running boot-up; holds the outcome as far as it is known, and whether the node may be disturbed."""

    def __init__(self, plan: BootPlan) -> None:
        self.plan = plan
        self.outcome = BootOutcome(plan.node, False, None, "list of nodes")
        self._disturb = True

    def _ask(self, request: Request) -> Dialogue:
        """Repeat a request until it is answered, at most ``tries`` times."""
        answer: Answer = NoReply()
        for number in range(1, request.tries + 1):
            answer = yield request
            more = number > 1
            self._note(
                tries=number,
                elapsed=self.outcome.elapsed + answer.elapsed,
                retries=self.outcome.retries + more,
            )
            if not isinstance(answer, NoReply):
                break
        return answer

    def _must(self, request: Request, letter: Letter | None = None) -> Dialogue:
        """As ``_ask``; silence ends the boot-up with ``letter``, and so does an abort of a request other than ``Read``.

        Some nodes are silent for an object that they do not have, and answer for others. Such a read counts as aborted. A node that
        is busy has the object: an abort with such a code ends the boot-up, as that of another request.
        """
        answer = yield from self._ask(request)
        if isinstance(answer, NoReply) and answer.for_this_only and isinstance(request, Read):
            answer = SdoAbortReply(OBJECT_MISSING, answer.elapsed)
        if isinstance(answer, Failed):
            self._fail(None)
        refused = isinstance(answer, SdoAbortReply) and (not isinstance(request, Read) or answer.code in BUSY)
        if isinstance(answer, NoReply) or refused:
            self._fail(letter, abort=answer.code if isinstance(answer, SdoAbortReply) else None)
        return answer

    def _read(self, index: int, subindex: int = 0) -> Generator[Request, Answer, int | None]:
        """Read a number; None if the node does not have it."""
        self._note(address=(index, subindex))
        answer = yield from self._must(Read(index, subindex))
        value = answer.value if isinstance(answer, Got) else None
        return value if isinstance(value, int) else None

    def _fail(self, letter: Letter | None, **facts: Any) -> None:
        self._note(letter=letter, **facts)
        raise BootUpEnded

    def _note(self, **facts: Any) -> None:
        self.outcome = replace(self.outcome, **facts)

    def _did(self, what: str) -> None:
        self._note(done=(*self.outcome.done, what))

    def _skipped(self, what: str) -> None:
        self._note(skipped=(*self.outcome.skipped, what))
