"""The boot-up step "check and update software version" (CiA 302-2), with the objects of CiA 302-3.

Theory of operation
-------------------
The date of the node's program (1F52h) is compared with the expected one. So is its identification (1F56h), which many devices
without 1F52h use. Only if they differ and the plan allows it, the program is replaced: stopped, cleared, transferred, started. Then
the node is read until it reports the expected program. Rules:

1. **Nothing before the node is known.** Identity and state come first, as in the standard: a program is only transferred to the
   device that it was written for. Afterwards the identity is compared once more, because a program may bring another revision
   (1018h:03).
2. **The transfer alone is never repeated.** Half a program may be in the memory, so each new attempt begins with stop and clear.
   All other requests can be repeated without harm: a command that is refused, or whose answer was lost, counts as executed if 1F51h
   shows that.
3. **A node may not answer while it works on its memory**, and it may restart when it starts its program, at once or a moment later.
   So it counts as lost only after the plan's ``deadline``, and its last report decides. A boot loader may report the new program
   before it restarts. So the report must be stable for some seconds before anything else is written.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import replace

from axisbus.cia301 import objects as o
from axisbus.cia301.nmt import NmtCommand
from axisbus.cia301.sdo import SdoTransferType
from axisbus.cia302.program import (
    NUMBER,
    REACHED,
    FlashStatus,
    NodeProgram,
    ProgramControl,
    ProgramStage,
    ProgramState,
    ProgramVersion,
)
from axisbus.cia302.requests import BootUpEnded, BootUpProgress, Dialogue, Step
from axisbus.cia302.types import (
    DEADLINE,
    TRIES,
    Address,
    Answer,
    BootNmtCommand,
    BootOutcome,
    BootPlan,
    BootWrite,
    Failed,
    Got,
    Letter,
    NoReply,
    Pause,
    ProgramDownload,
    Read,
    Request,
    SdoAbortReply,
)

ATTEMPTS = 3  # of transferring the program
SETTLE = 2.0  # seconds for which a node must report the new date: a pending restart has happened by then
POLL = 0.25  # seconds between two requests to a busy node

_CONTROL = (o.PROGRAM_CONTROL, NUMBER)
_DATA = (o.PROGRAM_DATA, NUMBER)
_FLASH = (o.FLASH_STATUS, NUMBER)


class ProgramSteps(BootUpProgress):
    """The steps of a boot-up for the node's program; holds the state of ``BootUpProgress``."""

    def _program(self) -> Generator[Request, Answer, bool]:
        """Compare the node's program with the expected one, and replace it if allowed; return whether it was replaced."""
        wanted = self.plan.program
        if wanted is None:
            return False
        found, abort = yield from self._mark(wanted)
        self._note(program=ProgramState(wanted.mark, found, found))
        if found == wanted.mark:
            self._did("program is the expected one")
            return False
        if not self._disturb:
            has = "which it is cannot be read" if found is None else f"it is {found}"
            self._skipped(f"program: {has}, expected is {wanted.mark}; it is left as it was found")
            return False
        self._require_replaceable(wanted, found, abort)
        yield from self._replace(wanted)
        yield from self._hold_again()
        self._did(f"program replaced: {found} by {wanted.mark}")
        return True

    def _mark(
        self, wanted: NodeProgram, letter: Letter | None = None
    ) -> Generator[Request, Answer, tuple[ProgramVersion | None, int | None]]:
        """Return the program that the node reports; None with the abort code if it does not.

        Silence ends the boot-up with ``letter``.
        """
        numbers = {}
        for address in wanted.mark.numbers:
            self._note(address=address)
            answer = yield from self._must(Read(*address), letter)
            if not isinstance(answer, Got) or not isinstance(answer.value, int):
                return None, answer.code if isinstance(answer, SdoAbortReply) else None
            numbers[address] = answer.value
        return ProgramVersion.of(numbers), None

    def _require_replaceable(
        self, wanted: NodeProgram, found: ProgramVersion | None, abort: int | None
    ) -> None:
        """End the boot-up if the program must not or cannot be replaced.

        If the node does not report it, success could not be verified.
        """
        expected = str(wanted.mark)
        if found is None:
            self._fail(Letter.G, expected=expected, abort=abort)
            return
        differ = [
            address for address, number in wanted.mark.numbers.items() if found.numbers[address] != number
        ]
        facts = {"expected": expected, "got": str(found), "address": differ[0]}
        if not wanted.allowed:
            self._fail(Letter.H, **facts)
        if not wanted.data:
            self._fail(Letter.G, **facts)

    # -- replacing it ------------------------------------------------------------------------------------------------

    def _replace(self, wanted: NodeProgram) -> Step:
        yield from self._transfer(wanted, wanted.data or b"")
        yield from self._flashed(wanted)
        yield from self._start_program(wanted)
        yield from self._see_new_program(wanted)

    def _transfer(self, wanted: NodeProgram, data: bytes) -> Step:
        """Transfer the program into cleared memory; the last attempt uses no block transfer."""
        for attempt in range(1, ATTEMPTS + 1):
            yield from self._make_room(wanted)
            self._at(ProgramStage.TRANSFER, _DATA)
            transfer_type = SdoTransferType.NORMAL if attempt == ATTEMPTS else SdoTransferType.AUTO
            answer = yield from self._ask(ProgramDownload(*_DATA, data, transfer_type, wanted.deadline))
            if isinstance(answer, Got):
                self._state(loaded=len(data))
                return
            if not isinstance(answer, NoReply):
                self._fail_by(answer)
            self._note(tries=attempt, retries=self.outcome.retries + (attempt < ATTEMPTS))
            yield from self._await_node(wanted)
        self._fail(Letter.I, tries=ATTEMPTS)

    def _make_room(self, wanted: NodeProgram) -> Step:
        """Stop the program (which may restart the node into its boot loader) and clear it."""
        patience = math.ceil(wanted.deadline / DEADLINE)
        yield from self._order(ProgramControl.STOP, ProgramStage.STOP, DEADLINE, max(TRIES, patience))
        yield from self._await_node(wanted)
        # Many nodes answer only after clearing; a repeated request would make them clear again and again.
        yield from self._order(ProgramControl.CLEAR, ProgramStage.CLEAR, wanted.deadline, 2)
        yield from self._ready(wanted)  # errors in the flash status are irrelevant now: there is no program

    def _flashed(self, wanted: NodeProgram) -> Step:
        self._at(ProgramStage.FLASH, _FLASH)
        status = yield from self._ready(wanted)
        if status is not None and status.error:
            self._fail(Letter.I, expected=str(FlashStatus(0)), got=str(status))

    def _start_program(self, wanted: NodeProgram) -> Step:
        for _ in range(TRIES):
            self._at(ProgramStage.START, _CONTROL)
            answer = yield from self._ask(BootWrite(*_CONTROL, ProgramControl.START, checked=False, tries=1))
            if not isinstance(answer, (Got, NoReply)) and not (
                yield from self._has_done(ProgramControl.START)
            ):
                self._fail_by(answer)
            yield from self._await_node(wanted)
            if not isinstance(answer, NoReply) or (yield from self._has_done(ProgramControl.START)):
                return
        self._fail(Letter.I)

    def _see_new_program(self, wanted: NodeProgram) -> Step:
        """Read the program until the node has reported the expected one for ``SETTLE`` seconds without interruption."""
        self._at(ProgramStage.RETURN, next(iter(wanted.mark.numbers), _CONTROL))
        begun, since = self.outcome.elapsed, None
        wrong: Answer | None = NoReply()
        for _ in range(math.ceil((wanted.deadline + 2 * SETTLE) / POLL)):
            wrong = yield from self._other_program(wanted)
            now = self.outcome.elapsed
            since = None if wrong is not None else now if since is None else since
            if since is not None and now - since >= SETTLE:
                self._state(now=wanted.mark)
                return
            if wrong is not None and (now - begun >= wanted.deadline or isinstance(wrong, Failed)):
                break
            yield from self._ask(Pause(POLL))
        yield from self._fail_program(wanted, wrong or NoReply())

    def _other_program(self, wanted: NodeProgram) -> Generator[Request, Answer, Answer | None]:
        """Return the first answer that is not the expected one; None if all are.

        If the identity of the program is not known, 1F51h must show that it runs, if the program has this object.
        """
        if not wanted.mark.numbers:
            answer = yield from self._ask(Read(*_CONTROL, tries=3))
            runs = isinstance(answer, Got) and answer.value == ProgramControl.START
            return None if runs or isinstance(answer, SdoAbortReply) else answer
        for address, number in wanted.mark.numbers.items():
            self._note(address=address)
            answer = yield from self._ask(Read(*address, tries=3))
            if not isinstance(answer, Got) or answer.value != number:
                return answer
        return None

    def _fail_program(self, wanted: NodeProgram, wrong: Answer) -> Step:
        """End the boot-up with the program that the node has instead, if it reports it."""
        if not isinstance(wrong, Got):
            self._fail_by(wrong, expected=str(wanted.mark))
            return
        if not wanted.mark.numbers:
            self._fail(Letter.I, expected=ProgramControl.START.value, got=wrong.value)
        address = self.outcome.address
        now, _ = yield from self._mark(wanted, Letter.I)
        self._state(now=now)
        self._fail(Letter.I, address=address, expected=str(wanted.mark), got=str(now))

    def _hold_again(self) -> Step:
        self._note(address=None)
        yield from self._must(BootNmtCommand(NmtCommand.ENTER_PRE_OPERATIONAL), Letter.I)

    # -- commands and their result -----------------------------------------------------------------------------------

    def _order(self, order: ProgramControl, stage: ProgramStage, deadline: float, tries: int) -> Step:
        """Write a command to 1F51h."""
        self._at(stage, _CONTROL)
        request = BootWrite(*_CONTROL, order, checked=False, deadline=deadline, tries=tries)
        answer = yield from self._ask(request)
        if not isinstance(answer, Got) and not (yield from self._has_done(order)):
            self._note(tries=tries if isinstance(answer, NoReply) else 1)
            self._fail_by(answer)

    def _has_done(self, order: ProgramControl) -> Generator[Request, Answer, bool]:
        """Whether 1F51h shows that the command has no further effect."""
        answer = yield from self._ask(Read(*_CONTROL, tries=2))
        return isinstance(answer, Got) and answer.value in REACHED[order]

    def _ready(self, wanted: NodeProgram) -> Generator[Request, Answer, FlashStatus | None]:
        """Wait until the node's memory is ready; None if the node does not report it (no 1F57h)."""
        answer = yield from self._poll(Read(*_FLASH, tries=1), wanted, _is_at_rest)
        if isinstance(answer, SdoAbortReply):
            return None
        if not isinstance(answer, Got) or not isinstance(answer.value, int):
            self._fail_by(answer, address=_FLASH)
            return None
        status = FlashStatus(answer.value)
        self._state(flash=status)
        if status.busy:
            self._fail(Letter.I, address=_FLASH, expected="ready", got=str(status))
        return status

    def _await_node(self, wanted: NodeProgram) -> Step:
        """Wait until the node answers SDO requests, as after every restart."""
        answer = yield from self._poll(
            Read(o.DEVICE_TYPE, tries=1), wanted, lambda answer: isinstance(answer, Got)
        )
        if not isinstance(answer, Got):
            self._fail_by(answer)

    def _poll(self, request: Request, wanted: NodeProgram, good: Callable[[Answer], bool]) -> Dialogue:
        """Repeat a request until the answer is good, for as long as the plan allows; return the last answer."""
        begun = self.outcome.elapsed
        for _ in range(math.ceil(wanted.deadline / POLL)):
            answer = yield from self._ask(request)
            late = self.outcome.elapsed - begun >= wanted.deadline
            if good(answer) or late or not isinstance(answer, (Got, NoReply, SdoAbortReply)):
                return answer
            yield from self._ask(Pause(POLL))
        return (yield from self._ask(request))

    # -- outcome -----------------------------------------------------------------------------------------------------

    def _at(self, stage: ProgramStage, address: Address) -> None:
        self._note(address=address)
        self._state(stage=stage)

    def _state(self, **facts: object) -> None:
        if self.outcome.program is not None:
            self._note(program=replace(self.outcome.program, **facts))  # type: ignore[arg-type]

    def _fail_by(self, answer: Answer, **facts: object) -> None:
        """End the boot-up with letter I, because of a missing or bad answer."""
        abort = answer.code if isinstance(answer, SdoAbortReply) else None
        self._fail(Letter.I, abort=abort, **facts)


def write_program(node: int, wanted: NodeProgram) -> Generator[Request, Answer, BootOutcome]:
    """Replace the program of a node, without a boot-up; the outcome has the letter I if that has failed.

    If the identity in ``wanted`` is empty, the new program must only run. Also for a node in its boot loader.
    """
    run = ProgramSteps(BootPlan(node, program=wanted))
    run._note(step="program", program=ProgramState(wanted.mark, None, None))
    try:
        yield from run._replace(wanted)
    except BootUpEnded:
        return run.outcome
    return replace(run.outcome, ok=True)


def _is_at_rest(answer: Answer) -> bool:
    """Whether the memory is ready, or the node does not report its state."""
    if isinstance(answer, Got) and isinstance(answer.value, int):
        return not FlashStatus(answer.value).busy
    return isinstance(answer, SdoAbortReply)
