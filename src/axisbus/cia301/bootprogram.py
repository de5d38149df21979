"""The boot-up's step "check and update software version" (CiA 302-2), with the objects of CiA 302-3.

Theory of operation
-------------------
The date of the node's program (1F52h) is compared with the expected one. Only where they differ, and the plan allows it, the
program is replaced: stopped, cleared, transferred, started; then the node is asked until it is back with the expected date. Rules:

1. **Nothing before the node is known.** Identity and state come first, as in the standard: a program goes only into the device that
   it was written for. Afterwards the identity is compared once more, because a program may bring another revision (1018h:03).
2. **The transfer is not repeated by itself.** Half a program may be in the memory, so each new attempt begins with stop and clear.
   All other requests can be repeated without harm: an order that is refused, or whose answer was lost, counts as carried out where
   1F51h says so.
3. **A node that works on its memory may be deaf**, and one that starts its program may restart, now or a moment later. So it is not
   counted lost before the plan's ``deadline`` has passed, and what counts is the date that it says in the end. A boot loader may
   know that date before it restarts: so the date must stand for some seconds before anything else is written.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import replace

from axisbus.cia301 import objects as o
from axisbus.cia301.bootask import Asking, Dialogue, Step
from axisbus.cia301.bootplan import (
    DEADLINE,
    TRIES,
    Address,
    Answer,
    Command,
    Failed,
    Got,
    Letter,
    Pause,
    Read,
    Refused,
    Request,
    Silence,
    Transfer,
    Write,
)
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia301.program import (
    DATE,
    NUMBER,
    REACHED,
    TIME,
    Control,
    FlashStatus,
    Program,
    ProgramState,
    Stage,
    Version,
)
from axisbus.cia301.sdo import Way

ATTEMPTS = 3  # at transferring the program
SETTLE = (
    2.0  # seconds for which a node must have said the new date: a restart that it owes us has come until then
)
POLL = 0.25  # seconds between two questions to a node that is at work

_CONTROL = (o.PROGRAM_CONTROL, NUMBER)
_DATA = (o.PROGRAM_DATA, NUMBER)
_FLASH = (o.FLASH_STATUS, NUMBER)


class ProgramSteps(Asking):
    """The part of a boot-up that is about the node's program; holds what ``Asking`` does."""

    def _program(self) -> Generator[Request, Answer, bool]:
        """Compare the node's program with the expected one, and replace it where it may be; return whether it was."""
        wanted = self.plan.program
        if wanted is None:
            return False
        found, abort = yield from self._version()
        self._note(program=ProgramState(wanted.version, found, found))
        if found == wanted.version:
            self._did("program is the expected one")
            return False
        if not self._disturb:
            has = "its date cannot be read (1F52h)" if found is None else f"it is that of {found}"
            self._skipped(f"program: {has}, expected is {wanted.version}; it is left as it was found")
            return False
        self._require_replaceable(wanted, found, abort)
        yield from self._replace(wanted)
        self._did(f"program replaced: {found} by {wanted.version}")
        return True

    def _version(
        self, letter: Letter | None = None
    ) -> Generator[Request, Answer, tuple[Version | None, int | None]]:
        """Return what 1F52h says; None with the abort code where the node does not say it. Silence ends it with ``letter``."""
        numbers = []
        for subindex in (DATE, TIME):
            self._note(address=(o.VERIFY_SOFTWARE, subindex))
            answer = yield from self._must(Read(o.VERIFY_SOFTWARE, subindex), letter)
            if not isinstance(answer, Got) or not isinstance(answer.value, int):
                return None, answer.code if isinstance(answer, Refused) else None
            numbers.append(answer.value)
        return Version(*numbers), None

    def _require_replaceable(self, wanted: Program, found: Version | None, abort: int | None) -> None:
        """Without 1F52h nobody could tell afterwards which program the node has, so it is not replaced then either."""
        expected = str(wanted.version)
        if found is None:
            self._fail(Letter.G, expected=expected, abort=abort)
        differs = DATE if found is None or found.days != wanted.version.days else TIME
        facts = {"expected": expected, "got": str(found), "address": (o.VERIFY_SOFTWARE, differs)}
        if not wanted.allowed:
            self._fail(Letter.H, **facts)
        if not wanted.data:
            self._fail(Letter.G, **facts)

    # -- replacing it ------------------------------------------------------------------------------------------------

    def _replace(self, wanted: Program) -> Step:
        yield from self._transfer(wanted, wanted.data or b"")
        yield from self._flashed(wanted)
        yield from self._start_program(wanted)
        yield from self._see_new_version(wanted)
        yield from self._hold_again()

    def _transfer(self, wanted: Program, data: bytes) -> Step:
        """Transfer the program into memory that was cleared for it; the last attempt goes without blocks."""
        for attempt in range(1, ATTEMPTS + 1):
            yield from self._make_room(wanted)
            self._at(Stage.TRANSFER, _DATA)
            way = Way.NORMAL if attempt == ATTEMPTS else Way.AUTO
            answer = yield from self._ask(Transfer(*_DATA, data, way, wanted.deadline))
            if isinstance(answer, Got):
                self._state(loaded=len(data))
                return
            if not isinstance(answer, Silence):
                self._fail_by(answer)
            self._note(tries=attempt, retries=self.outcome.retries + (attempt < ATTEMPTS))
            yield from self._await_node(wanted)
        self._fail(Letter.I, tries=ATTEMPTS)

    def _make_room(self, wanted: Program) -> Step:
        """Stop the program (which may restart the node into its boot loader) and clear it."""
        patience = math.ceil(wanted.deadline / DEADLINE)
        yield from self._order(Control.STOP, Stage.STOP, DEADLINE, max(TRIES, patience))
        yield from self._await_node(wanted)
        # Many nodes answer only when they have cleared: asked too soon again, they would clear without end.
        yield from self._order(Control.CLEAR, Stage.CLEAR, wanted.deadline, 2)
        yield from self._ready(wanted)  # what it says of errors is of no account now: there is no program

    def _flashed(self, wanted: Program) -> Step:
        self._at(Stage.FLASH, _FLASH)
        status = yield from self._ready(wanted)
        if status is not None and status.error:
            self._fail(Letter.I, expected=str(FlashStatus(0)), got=str(status))

    def _start_program(self, wanted: Program) -> Step:
        for _ in range(TRIES):
            self._at(Stage.START, _CONTROL)
            answer = yield from self._ask(Write(*_CONTROL, Control.START, checked=False, tries=1))
            if not isinstance(answer, (Got, Silence)) and not (yield from self._has_done(Control.START)):
                self._fail_by(answer)
            yield from self._await_node(wanted)
            if not isinstance(answer, Silence) or (yield from self._has_done(Control.START)):
                return
        self._fail(Letter.I)

    def _see_new_version(self, wanted: Program) -> Step:
        """Ask until the node has said the expected date for ``SETTLE`` seconds on end."""
        self._at(Stage.RETURN, (o.VERIFY_SOFTWARE, DATE))
        begun, since = self.outcome.elapsed, None
        wrong: Answer | None = Silence()
        for _ in range(math.ceil((wanted.deadline + 2 * SETTLE) / POLL)):
            wrong = yield from self._other_version(wanted)
            now = self.outcome.elapsed
            since = None if wrong is not None else now if since is None else since
            if since is not None and now - since >= SETTLE:
                self._state(now=wanted.version)
                return
            if wrong is not None and (now - begun >= wanted.deadline or isinstance(wrong, Failed)):
                break
            yield from self._ask(Pause(POLL))
        yield from self._fail_version(wanted, wrong or Silence())

    def _other_version(self, wanted: Program) -> Generator[Request, Answer, Answer | None]:
        """Return the first answer that is not what 1F52h is to say; None where all is as it is to be."""
        for subindex, number in ((DATE, wanted.version.days), (TIME, wanted.version.milliseconds)):
            self._note(address=(o.VERIFY_SOFTWARE, subindex))
            answer = yield from self._ask(Read(o.VERIFY_SOFTWARE, subindex, tries=3))
            if not isinstance(answer, Got) or answer.value != number:
                return answer
        return None

    def _fail_version(self, wanted: Program, wrong: Answer) -> Step:
        """Say in words which program the node has instead, if it says so."""
        if not isinstance(wrong, Got):
            self._fail_by(wrong, expected=str(wanted.version))
        address = self.outcome.address
        now, _ = yield from self._version(Letter.I)
        self._state(now=now)
        self._fail(Letter.I, address=address, expected=str(wanted.version), got=str(now))

    def _hold_again(self) -> Step:
        self._note(address=None)
        yield from self._must(Command(NmtCommand.ENTER_PRE_OPERATIONAL), Letter.I)

    # -- orders and their end ----------------------------------------------------------------------------------------

    def _order(self, order: Control, stage: Stage, deadline: float, tries: int) -> Step:
        """Write 1F51h."""
        self._at(stage, _CONTROL)
        request = Write(*_CONTROL, order, checked=False, deadline=deadline, tries=tries)
        answer = yield from self._ask(request)
        if not isinstance(answer, Got) and not (yield from self._has_done(order)):
            self._note(tries=tries if isinstance(answer, Silence) else 1)
            self._fail_by(answer)

    def _has_done(self, order: Control) -> Generator[Request, Answer, bool]:
        """Whether 1F51h says that there is nothing left to do."""
        answer = yield from self._ask(Read(*_CONTROL, tries=2))
        return isinstance(answer, Got) and answer.value in REACHED[order]

    def _ready(self, wanted: Program) -> Generator[Request, Answer, FlashStatus | None]:
        """Wait until the node's memory is at rest; None where the node does not say (no 1F57h)."""
        answer = yield from self._poll(Read(*_FLASH, tries=1), wanted, _is_at_rest)
        if isinstance(answer, Refused):
            return None
        if not isinstance(answer, Got) or not isinstance(answer.value, int):
            self._fail_by(answer, address=_FLASH)
            return None
        status = FlashStatus(answer.value)
        self._state(flash=status)
        if status.busy:
            self._fail(Letter.I, address=_FLASH, expected="ready", got=str(status))
        return status

    def _await_node(self, wanted: Program) -> Step:
        """Find it by asking, as after every restart."""
        answer = yield from self._poll(
            Read(o.DEVICE_TYPE, tries=1), wanted, lambda answer: isinstance(answer, Got)
        )
        if not isinstance(answer, Got):
            self._fail_by(answer)

    def _poll(self, request: Request, wanted: Program, good: Callable[[Answer], bool]) -> Dialogue:
        """Ask until the answer is good, for as long as the plan allows; return the last answer."""
        begun = self.outcome.elapsed
        for _ in range(math.ceil(wanted.deadline / POLL)):
            answer = yield from self._ask(request)
            late = self.outcome.elapsed - begun >= wanted.deadline
            if good(answer) or late or not isinstance(answer, (Got, Silence, Refused)):
                return answer
            yield from self._ask(Pause(POLL))
        return (yield from self._ask(request))

    # -- what is known -----------------------------------------------------------------------------------------------

    def _at(self, stage: Stage, address: Address) -> None:
        self._note(address=address)
        self._state(stage=stage)

    def _state(self, **facts: object) -> None:
        if self.outcome.program is not None:
            self._note(program=replace(self.outcome.program, **facts))  # type: ignore[arg-type]

    def _fail_by(self, answer: Answer, **facts: object) -> None:
        """End it with letter I, because of an answer that is none or a bad one."""
        abort = answer.code if isinstance(answer, Refused) else None
        self._fail(Letter.I, abort=abort, **facts)


def _is_at_rest(answer: Answer) -> bool:
    """Also where the node does not say."""
    if isinstance(answer, Got) and isinstance(answer.value, int):
        return not FlashStatus(answer.value).busy
    return isinstance(answer, Refused)
