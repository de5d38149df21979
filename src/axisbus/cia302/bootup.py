"""The boot-up of one NMT slave according to CiA 302-2, as a pure state machine: answers in, requests out, and an outcome at the
end.

Theory of operation
-------------------
``boot_up(plan)`` is a generator: it yields a ``Request``, is sent the ``Answer``, and returns the ``BootOutcome``. It uses no bus,
no clock and no thread; the answers contain the elapsed time. Two rules:

1. **Each request is repeated separately.** Silence costs one more try of this request and nothing else. Only a request that stays
   unanswered in all its tries ends the boot-up. Every request can be repeated without harm, except the transfer of a program, which
   has a single try (see ``program_download``).
2. **The first error ends the boot-up**, and the outcome contains all known facts: letter, step, object, expected and received
   value, abort code.

The order is that of the standard: device type, identity, state, program, restore, configuration, error control, start. There are
two differences. A running node is never reset: at most it is switched to pre-operational, and if the application requests it, not
even that. And the application has its own part at certain points (``BootPhase``).
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

from axisbus.cia301 import objects as o
from axisbus.cia301.abort import VALUE_REFUSED
from axisbus.cia301.datatypes import Value
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia302.program_download import ProgramSteps
from axisbus.cia302.requests import BootUpEnded, Step
from axisbus.cia302.types import (
    IDENTITY,
    LEAST_CONSUMER,
    LOAD,
    Address,
    Answer,
    BootNmtCommand,
    BootOutcome,
    BootPhase,
    BootPlan,
    BootWrite,
    ErrorControl,
    Expected,
    Got,
    GuardRequest,
    Letter,
    Listen,
    Local,
    NoReply,
    Read,
    Request,
    SdoAbortReply,
    Setting,
)

LONGEST_LISTEN = 3.0  # seconds; the boot-up does not wait for a node with a longer heartbeat period
_LEAST_LISTEN = 0.3
_REAL_TOLERANCE = 1e-6  # REAL32 values are rounded when read back


def boot_up(plan: BootPlan) -> Generator[Request, Answer, BootOutcome]:
    """Boot one node; see the module. Raises no exceptions of its own."""
    run = _Run(plan)
    try:
        yield from run.all()
    except BootUpEnded:
        return run.outcome
    letter = Letter.L if run.outcome.found is NmtState.OPERATIONAL else None
    return replace(run.outcome, ok=True, letter=letter)


def same(got: object, wanted: Value) -> bool:
    """Whether a value read back equals the value written."""
    if isinstance(got, float) and isinstance(wanted, (int, float)):
        return abs(got - wanted) <= _REAL_TOLERANCE * max(1.0, abs(wanted))
    return got == wanted


class _Run(ProgramSteps):
    """One boot-up; holds the outcome as far as it is known."""

    def all(self) -> Step:
        """Execute the steps in order."""
        if not self.plan.listed:
            self._fail(Letter.A)
        for name, step in (
            ("find", self._find),
            ("identity", self._identify),
            ("state", self._look),
            ("pre-operational", self._hold),
            ("program", self._renew),
            ("restore", self._restore),
            ("configuration", self._configure),
            ("error control", self._control),
            ("completion", self._complete),
            ("start", self._start),
        ):
            self._note(step=name, address=None, tries=0)
            yield Local(BootPhase.STEP, self.outcome)
            yield from step()

    # -- identity ----------------------------------------------------------------------------------------------------

    def _find(self) -> Step:
        address = (o.DEVICE_TYPE, 0)
        self._note(address=address)
        answer = yield from self._ask(Read(*address, tries=1))
        if isinstance(answer, NoReply):
            yield from self._wake()
            answer = yield from self._must(Read(*address, tries=self.plan.find_tries), Letter.B)
        self._learn(address, answer)
        self._did("found")

    def _wake(self) -> Step:
        """Switch a node in the NMT state *stopped*, which has no SDO server, to pre-operational; that energises nothing.

        A node that sends no heartbeat, for example because it has restarted, does not tell its state. It gets the command as well,
        unless it may be operational and is to stay so.
        """
        answer = yield from self._ask(Listen(_LEAST_LISTEN, tries=1))
        stopped = isinstance(answer, Got) and answer.value is NmtState.STOPPED
        if stopped:
            self._did("woken: it was in the NMT state stopped")
        if stopped or (isinstance(answer, NoReply) and not self.plan.keep_alive):
            command = NmtCommand.ENTER_PRE_OPERATIONAL
            yield from self._ask(BootNmtCommand(command, deadline=_LEAST_LISTEN, tries=1, always=True))

    def _identify(self) -> Step:
        for address, _, letter in IDENTITY:
            self._note(address=address)
            answer: Answer | None = None
            if address != (o.DEVICE_TYPE, 0):
                answer = yield from self._must(Read(*address))
                self._learn(address, answer)
            self._compare(address, letter, answer)
        self._did("identified")

    def _learn(self, address: Address, answer: Answer) -> None:
        if isinstance(answer, Got) and isinstance(answer.value, int):
            self._note(identity={**self.outcome.identity, address: answer.value})

    def _compare(self, address: Address, letter: Letter, answer: Answer | None) -> None:
        expected = self.plan.identity.get(address)
        if expected is None or _fits(expected, self.outcome.identity.get(address)):
            return
        abort = answer.code if isinstance(answer, SdoAbortReply) else None
        got = self.outcome.identity.get(address)
        self._fail(letter, expected=expected.value, got=got, abort=abort)

    # -- state -------------------------------------------------------------------------------------------------------

    def _look(self) -> Step:
        period = yield from self._read(o.PRODUCER_HEARTBEAT)
        if period:
            yield from self._hear(period / 1000)
        else:
            self._skipped("its NMT state: it sends no heartbeat yet")
        self._note(address=None)
        answer = yield from self._must(Local(BootPhase.LOOK, self.outcome))
        allowed = not isinstance(answer, Got) or answer.value is not False
        kept = self.plan.keep_alive and self.outcome.found is NmtState.OPERATIONAL
        self._disturb = allowed and not kept
        self._did("looked at")

    def _hear(self, period: float) -> Step:
        """Wait for a heartbeat of a node that is configured to send it (letter E if none comes)."""
        patience = (self.plan.missed + 1) * period
        if patience > LONGEST_LISTEN:
            self._skipped(f"its NMT state: it sends a heartbeat every {period:g} s only")
            return
        answer = yield from self._must(Listen(max(patience, _LEAST_LISTEN)), Letter.E)
        if isinstance(answer, Got) and isinstance(answer.value, NmtState):
            self._note(found=answer.value)

    def _hold(self) -> Step:
        """Switch the node to pre-operational, if it may be disturbed and is not in that state already."""
        if not self._disturb:
            self._skipped("pre-operational: it is left as it was found")
        elif self.outcome.found is not NmtState.PRE_OPERATIONAL:
            yield from self._must(BootNmtCommand(NmtCommand.ENTER_PRE_OPERATIONAL))
            self._did("pre-operational")

    # -- program (see program_download) -----------------------------------------------------------------------------------

    def _renew(self) -> Step:
        """Check the program; after a replacement the node must still have the expected identity.

        Identity comes before the program, as in the standard. A revision that only the new program has would be refused before the
        download. A revision that only the old program had is refused after it, not at the next boot-up.
        """
        if (yield from self._program()):
            self._note(address=(o.DEVICE_TYPE, 0))
            answer = yield from self._must(Read(o.DEVICE_TYPE), Letter.I)
            self._learn((o.DEVICE_TYPE, 0), answer)
            yield from self._identify()

    # -- configuration -----------------------------------------------------------------------------------------------

    def _restore(self) -> Step:
        if not self.plan.restore:
            return
        if not self._disturb:
            self._skipped("restoring its defaults: it is left as it was found")
            return
        yield from self._set(Setting(o.RESTORE_DEFAULTS, 1, LOAD, "restore_defaults"), verify=False)
        yield from self._restart()
        self._did("defaults restored")

    def _restart(self) -> Step:
        """Reset the node to activate its defaults; if the boot-up message was lost, find the node by SDO requests."""
        self._note(address=None)
        answer = yield from self._ask(BootNmtCommand(NmtCommand.RESET_NODE, tries=1))
        if isinstance(answer, NoReply):
            self._note(address=(o.DEVICE_TYPE, 0))
            yield from self._must(Read(o.DEVICE_TYPE, tries=self.plan.find_tries), Letter.B)
        yield from self._must(BootNmtCommand(NmtCommand.ENTER_PRE_OPERATIONAL))

    def _configure(self) -> Step:
        if not self._disturb:
            self._skipped("configuration: it is left as it was found")
            return
        yield from self._must(Local(BootPhase.PREPARE, self.outcome))
        if self.plan.version is not None and (yield from self._is_configured()):
            self._skipped("configuration: date and time in 1020h are the expected ones")
            return
        yield from self._must(Local(BootPhase.CONFIGURE, self.outcome))
        for setting in self.plan.settings:
            yield from self._set(setting)
            self._note(written=self.outcome.written + (not setting.fixed))
        yield from self._seal()
        self._did("configured")

    def _is_configured(self) -> Generator[Request, Answer, bool]:
        date = yield from self._read(o.VERIFY_CONFIGURATION, 1)
        time = yield from self._read(o.VERIFY_CONFIGURATION, 2)
        return (date, time) == self.plan.version

    def _seal(self) -> Step:
        """Store date and time of the configuration in the node (1020h)."""
        for subindex, value in enumerate(self.plan.version or (), 1):
            self._note(address=(o.VERIFY_CONFIGURATION, subindex))
            answer = yield from self._ask(BootWrite(o.VERIFY_CONFIGURATION, subindex, value, checked=False))
            if isinstance(answer, SdoAbortReply):
                self._skipped("1020h: the node does not keep date and time of its configuration")
                return
            if not isinstance(answer, Got):
                self._fail(Letter.J)

    def _set(self, setting: Setting, verify: bool = True) -> Step:
        """Write an object and read it back; with ``verify`` False it is not read back, and a fixed one is only read."""
        index, subindex, wanted = setting.index, setting.subindex, setting.value
        self._note(address=(index, subindex), setting=setting)
        if not setting.fixed:
            yield from self._must(BootWrite(index, subindex, wanted), Letter.J)
        if verify:
            answer = yield from self._must(Read(index, subindex), Letter.J)
            if isinstance(answer, Got) and not same(answer.value, wanted):
                self._fail(Letter.J, expected=wanted, got=answer.value)
        self._note(setting=None)

    # -- error control -----------------------------------------------------------------------------------------------

    def _control(self) -> Step:
        if self.plan.heartbeat is None:
            self._skipped("error control: none is planned")
        elif not self._disturb:
            self._skipped("error control: it is left as it was found")
        elif (yield from self._produces(round(self.plan.heartbeat * 1000))):
            yield from self._await_heartbeat()
        else:
            yield from self._guard()

    def _produces(self, period: int) -> Generator[Request, Answer, int | None]:
        """Configure the node to send heartbeats; return the period in ms that it has then, None if it cannot send any.

        A node that refuses to change its period is monitored with the one that it has. A node that sends no heartbeat, and could
        with another period, would not be monitored: letter J.
        """
        self._note(address=(o.PRODUCER_HEARTBEAT, 0))
        answer = yield from self._ask(BootWrite(o.PRODUCER_HEARTBEAT, 0, period))
        if isinstance(answer, NoReply) and answer.for_this_only:
            return None
        if not isinstance(answer, (Got, SdoAbortReply)):
            self._fail(None)
        got = yield from self._read(o.PRODUCER_HEARTBEAT)
        if got:
            self._note(consumer=max(self.plan.missed * got / 1000, LEAST_CONSUMER))
        if isinstance(answer, SdoAbortReply) and got is not None:
            self._period_refused(answer.code, period, got)
        return got

    def _period_refused(self, code: int, period: int, kept: int) -> None:
        if kept:
            self._skipped(
                f"a heartbeat each {period} ms: it refuses this period (1017h, abort code 0x{code:08X}), and keeps {kept} ms"
            )
        elif code in VALUE_REFUSED:
            setting = Setting(o.PRODUCER_HEARTBEAT, 0, period, "heartbeat in [bus], in ms")
            self._fail(Letter.J, setting=setting, abort=code)
        else:
            self._skipped(f"a heartbeat: it refuses to change 1017h (abort code 0x{code:08X})")

    def _await_heartbeat(self) -> Step:
        consumer = self.outcome.consumer or 0.0
        if consumer > LONGEST_LISTEN:
            self._skipped("the first heartbeat: they are too rare to be awaited")
        else:
            yield from self._must(Listen(max(consumer, _LEAST_LISTEN)), Letter.K)
        self._note(control=ErrorControl.HEARTBEAT)
        self._did("error control by heartbeat")

    def _guard(self) -> Step:
        """Check once whether guarding works, unless the first request would start a life time that is not served yet."""
        guard_time = yield from self._read(o.GUARD_TIME)
        factor = yield from self._read(o.LIFE_TIME_FACTOR)
        if guard_time is None or factor is None:
            self._skipped("error control: it has neither heartbeat nor guarding")
            return
        if not guard_time * factor:
            self._note(address=None)
            yield from self._must(GuardRequest(), Letter.F)
        self._note(control=ErrorControl.GUARDING)
        self._did("error control by guarding")

    # -- the end -----------------------------------------------------------------------------------------------------

    def _complete(self) -> Step:
        yield from self._must(Local(BootPhase.COMPLETE, self.outcome))

    def _start(self) -> Step:
        if not self.plan.start:
            self._skipped("start: not asked for")
            return
        if self._disturb or self.outcome.found is not NmtState.OPERATIONAL:
            yield from self._must(BootNmtCommand(NmtCommand.START))
        self._did("started")


def _fits(expected: Expected, got: int | None) -> bool:
    if not got and expected.lenient:
        return True
    return got is not None and not (got ^ expected.value) & expected.mask
