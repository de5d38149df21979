"""A node's program at boot-up (CiA 302-2 and 302-3) without a bus: the letters G, H and I, and nodes that lose answers.

The loader below has its own numbers, typed from CiA 302-3: 1F51h 0 stop, 1 start, 3 clear; 1F57h bit 0 busy, bits 1 to 7 error.
"""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.sdo import SdoTransferType
from axisbus.cia302 import types as b
from axisbus.cia302.bootup import boot_up
from axisbus.cia302.program import FlashStatus, NodeProgram, ProgramStage, ProgramVersion, Version
from axisbus.cia302.program_download import write_program
from kit.boot_slave import IDENTITY, MISSING, SETTINGS, Slave

# By hand: 2026-03-01 is day 15400 after 1984-01-01, noon is 43200000 ms; 2025-11-20 08:15 is day 15299 and 29700000 ms.
NEW, OLD = (15_400, 43_200_000), (15_299, 29_700_000)
MARK = ProgramVersion(Version(*NEW))
DATA = bytes(range(200)) * 5
REFUSED = 0x0800_0022


class Loader(Slave):
    """A node with a boot loader; holds its program, its memory, the time, and its faults."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0
        self.version: tuple[int, int] | None = OLD
        self.identification: int | None = None  # 1F56h:01
        self.control = 1
        self.flash: int | None = 0  # 1F57h:01 without a running command; None: the node has none
        self.busy_until = 0.0
        self.away_until = 0.0
        self.memory = b""
        self.clear_time = self.flash_time = self.restart_time = self.restart_delay = 0.0
        self.takes: tuple[int, int] | None = NEW  # the date that the transferred program has
        self.after = 0  # 1F57h:01 after a transfer
        self.control_refused: dict[int, int] = {}
        self.data_answers: list[b.Answer] = []  # instead of taking the data
        self.spoils: Callable[[b.Request, b.Answer], b.Answer] = lambda _, answer: answer
        self.restarts_at: float | None = None
        self.foresees = False  # the boot loader says the date of the program that it has not started yet

    def answer(self, request: b.Request) -> b.Answer:
        made = self.spoils(request, self._made(request))
        self.now += made.elapsed
        return made

    def _made(self, request: b.Request) -> b.Answer:
        if isinstance(request, b.Pause):
            return b.Got(None, request.seconds)
        if isinstance(request, b.Local):
            return super().answer(request)
        if self.restarts_at is not None and self.now >= self.restarts_at:
            self.away_until, self.restarts_at = self.restarts_at + self.restart_time, None
            self.version = self.takes
        if self.dead or self.now < self.away_until:
            return b.NoReply(request.deadline)
        if isinstance(request, b.ProgramDownload):
            return self.load(request)
        return super().answer(request)

    def read(self, address: tuple[int, int]) -> b.Answer:
        live = {(0x1F51, 1): self.control}
        if self.identification is not None:
            live[0x1F56, 1] = self.identification
        if self.version is not None:
            live |= {(0x1F52, 1): self.version[0], (0x1F52, 2): self.version[1]}
        if self.flash is not None:
            live[0x1F57, 1] = 1 if self.now < self.busy_until else self.flash
        return b.Got(live[address], 0.002) if address in live else super().read(address)

    def write(self, address: tuple[int, int], value: object) -> b.Answer:
        if address != (0x1F51, 1):
            assert self.restarts_at is None, "configured before it restarts"
            return super().write(address, value)
        assert value in (0, 1, 3)
        if value in self.control_refused:
            return b.SdoAbortReply(self.control_refused[value], 0.002)
        if value == 3:
            assert self.control in (0, 3), "cleared while it runs"
            self.memory, self.version, self.busy_until = b"", (0, 0), self.now + self.clear_time
        if value == 1:
            assert self.now >= self.busy_until, "started while it is written"
            assert self.memory == DATA, "started with half a program"
            self.restarts_at = self.now + self.restart_delay
        self.control = value
        return b.Got(None, 0.002)

    def load(self, request: b.ProgramDownload) -> b.Answer:
        assert (request.index, request.subindex) == (0x1F50, 1)
        assert (self.control, self.memory) == (3, b""), "transferred into memory that was not cleared"
        assert self.now >= self.busy_until, "transferred while it is cleared"
        self.memory = DATA[:100]
        if self.data_answers:
            return self.data_answers.pop(0)
        self.memory, self.flash, self.busy_until = request.data, self.after, self.now + self.flash_time
        if self.foresees:
            self.version = self.takes
        return b.Got(None, 3.0)

    def orders(self) -> list[object]:
        """The orders to its program, in order, repetitions included."""
        return [
            "data" if isinstance(each, b.ProgramDownload) else each.value
            for each in self.asked
            if isinstance(each, b.ProgramDownload) or (isinstance(each, b.BootWrite) and each.index == 0x1F51)
        ]


def boot(loader: Loader, **changes: object) -> b.BootOutcome:
    program = NodeProgram(**{"mark": MARK, "data": DATA, "allowed": True, "deadline": 20.0, **changes})
    return loader.run(b.BootPlan(5, identity=IDENTITY, settings=SETTINGS, heartbeat=0.1, program=program))


def untouched(loader: Loader) -> bool:
    return not loader.wrote() and loader.orders() == []


# -- the date ------------------------------------------------------------------------------------------------------------


def test_days_and_milliseconds_in_words():
    assert str(Version(*NEW)) == "2026-03-01 12:00:00"
    assert str(Version(*OLD)) == "2025-11-20 08:15:00"
    assert str(Version(366, 3_723_004)) == "1985-01-01 01:02:03.004"
    assert str(Version(0, 0)) == "no date (both are 0)"
    assert str(Version(0xFFFF_FFFF, 0xFFFF_FFFF)) == "no date (FFFFFFFFh, FFFFFFFFh)"
    assert str(Version(1, 86_400_000)) == "no date (00000001h, 05265C00h)"


@pytest.mark.parametrize(
    ("value", "busy", "words"),
    [
        (0x00, False, "error 0: no error"),
        (0x01, True, "still at work"),
        (0x02, False, "no valid program"),
        (0x06, False, "faulty"),
        (0x0A, False, "could not be written"),
        (0x7E, False, "does not specify"),
        (0x1234_0050, False, "error 40: not in CiA 302-3"),
    ],
)
def test_the_meaning_of_a_flash_status(value, busy, words):
    assert FlashStatus(value).busy is busy
    assert words in str(FlashStatus(value))


# -- nothing to do, or nothing allowed -----------------------------------------------------------------------------------


def test_without_an_expected_program_its_objects_are_not_read():
    loader = Loader()
    outcome = loader.run(b.BootPlan(5, identity=IDENTITY))
    assert outcome.ok
    assert outcome.program is None
    assert not [each for each in loader.asked if isinstance(each, b.Read) and each.index >= 0x1F00]


def test_the_expected_program_is_left_alone():
    loader = Loader()
    loader.version = NEW
    outcome = boot(loader)
    assert outcome.ok
    assert loader.orders() == []
    assert "program is the expected one" in outcome.done
    assert not outcome.program.replaced


def test_the_program_is_read_after_the_identity_and_before_anything_is_written():
    loader = Loader()
    loader.version = NEW
    boot(loader)
    asked = [(type(each).__name__, getattr(each, "index", None)) for each in loader.asked]
    at = asked.index(("Read", 0x1F52))
    assert ("Read", 0x1018) in asked[:at]
    assert ("BootNmtCommand", None) in asked[:at]  # pre-operational
    assert "BootWrite" not in [name for name, _ in asked[:at]]


@pytest.mark.parametrize("subindex", [1, 2])
def test_letter_g_a_node_that_does_not_report_its_program(subindex):
    loader = Loader()
    loader.spoils = lambda request, answer: (
        b.SdoAbortReply(MISSING, 0.002)
        if isinstance(request, b.Read) and (request.index, request.subindex) == (0x1F52, subindex)
        else answer
    )
    outcome = boot(loader)
    assert (outcome.letter, outcome.step, outcome.address) == (b.Letter.G, "program", (0x1F52, subindex))
    assert (outcome.expected, outcome.got, outcome.abort) == ("2026-03-01 12:00:00", None, MISSING)
    assert untouched(loader)


@pytest.mark.parametrize("data", [None, b""])
def test_letter_g_a_replacement_is_allowed_but_no_file_is_given(data):
    loader = Loader()
    outcome = boot(loader, data=data)
    assert (outcome.letter, outcome.address) == (b.Letter.G, (0x1F52, 1))
    assert (outcome.expected, outcome.got) == ("2026-03-01 12:00:00", "2025-11-20 08:15:00")
    assert untouched(loader)


@pytest.mark.parametrize(
    ("found", "subindex", "words"),
    [
        (OLD, 1, "2025-11-20 08:15:00"),
        ((15_400, 43_199_999), 2, "2026-03-01 11:59:59.999"),
        ((0, 0), 1, "no date"),
    ],
)
def test_letter_h_another_program_is_never_replaced_without_leave(found, subindex, words):
    loader = Loader()
    loader.version = found
    outcome = boot(loader, allowed=False)
    assert (outcome.letter, outcome.step, outcome.address) == (b.Letter.H, "program", (0x1F52, subindex))
    assert outcome.expected == "2026-03-01 12:00:00"
    assert words in outcome.got
    assert untouched(loader)


def test_a_node_that_must_not_be_disturbed_keeps_its_program_and_it_is_reported():
    loader = Loader()
    loader.may_disturb = False
    outcome = boot(loader)
    assert outcome.ok
    assert untouched(loader)
    (told,) = [text for text in outcome.skipped if text.startswith("program")]
    assert "2025-11-20 08:15:00" in told
    assert "2026-03-01 12:00:00" in told
    assert "left as it was found" in told


def test_a_node_that_must_not_be_disturbed_and_does_not_report_its_program():
    loader = Loader()
    loader.may_disturb, loader.version = False, None
    outcome = boot(loader)
    assert (outcome.ok, outcome.abort) == (True, None)
    assert [text for text in outcome.skipped if "which it is cannot be read" in text]


def test_a_node_that_falls_silent_before_anything_was_done_has_no_letter():
    loader = Loader()

    def spoil(request: b.Request, answer: b.Answer) -> b.Answer:
        return b.NoReply(0.5) if isinstance(request, b.Read) and request.index == 0x1F52 else answer

    loader.spoils = spoil
    outcome = boot(loader)
    assert (outcome.letter, outcome.step, outcome.address) == (None, "program", (0x1F52, 1))
    assert untouched(loader)


# -- a replacement -------------------------------------------------------------------------------------------------------


def test_a_program_is_stopped_cleared_transferred_started_and_then_the_node_configured():
    loader = Loader()
    outcome = boot(loader)
    assert outcome.ok
    assert loader.orders() == [0, 3, "data", 1]
    assert loader.memory == DATA
    assert (outcome.program.found, outcome.program.now) == (ProgramVersion(Version(*OLD)), MARK)
    assert outcome.program.loaded == len(DATA)
    assert outcome.program.replaced
    assert "program replaced: 2025-11-20 08:15:00 by 2026-03-01 12:00:00" in outcome.done
    assert (0x6065, 0, 3000) in loader.wrote()[3:]
    assert outcome.written == 2


def test_a_node_that_takes_its_time_for_everything():
    loader = Loader()
    loader.clear_time, loader.flash_time, loader.restart_delay, loader.restart_time = 9.0, 12.0, 3.0, 7.0
    outcome = boot(loader)
    assert outcome.ok
    assert loader.orders() == [0, 3, "data", 1]
    assert outcome.elapsed > 9 + 12 + 3 + 7


@pytest.mark.parametrize(("delay", "away"), [(0.1, 0.05), (0.1, 6.0), (1.9, 0.05), (1.9, 6.0)])
def test_a_new_date_that_a_boot_loader_reports_before_its_restart_is_not_trusted_too_soon(delay, away):
    """A write before the restart would be lost by it."""
    loader = Loader()
    loader.foresees, loader.restart_delay, loader.restart_time = True, delay, away
    outcome = boot(loader)
    assert outcome.ok
    assert outcome.written == 2


def test_a_node_without_1f57_is_not_waited_for():
    loader = Loader()
    loader.flash = loader.after = None
    assert boot(loader).ok


def test_the_program_transfer_has_the_deadline_of_the_plan_and_reports_its_progress_by_size():
    loader = Loader()
    boot(loader, deadline=45.0)
    (transfer,) = [each for each in loader.asked if isinstance(each, b.ProgramDownload)]
    assert (transfer.deadline, transfer.tries, transfer.transfer_type) == (45.0, 1, SdoTransferType.AUTO)


def test_a_transfer_that_broke_down_is_repeated_only_after_stop_and_clear_and_last_without_blocks():
    loader = Loader()
    loader.data_answers = [b.NoReply(20.0), b.NoReply(20.0)]
    outcome = boot(loader)
    assert outcome.ok
    assert loader.orders() == [0, 3, "data"] * 3 + [1]
    ways = [each.transfer_type for each in loader.asked if isinstance(each, b.ProgramDownload)]
    assert ways == [SdoTransferType.AUTO, SdoTransferType.AUTO, SdoTransferType.NORMAL]
    assert outcome.retries == 2


def test_a_new_program_may_change_the_revision_if_none_is_expected():
    loader = Loader()
    outcome = revised(loader, {**IDENTITY, (0x1018, 3): b.Expected(0x20000, mask=0)})
    assert outcome.ok
    assert outcome.identity[0x1018, 3] == 0x20000


def test_letter_n_a_new_program_with_an_unexpected_revision():
    outcome = revised(Loader(), IDENTITY)
    assert (outcome.letter, outcome.step, outcome.got) == (b.Letter.N, "program", 0x20000)
    assert outcome.program.replaced


def revised(loader: Loader, identity: dict) -> b.BootOutcome:
    """Boot it with a program that makes it another revision."""
    take = loader.load

    def load(request: b.ProgramDownload) -> b.Answer:
        loader.objects[0x1018, 3] = 0x20000
        return take(request)

    loader.load = load  # type: ignore[method-assign]
    program = NodeProgram(MARK, DATA, True, 20.0)
    return loader.run(b.BootPlan(5, identity=identity, heartbeat=0.1, program=program))


# -- known by its identification -----------------------------------------------------------------------------------------


def known(
    loader: Loader, identification: int | None, after: int = 0xCAFE, **changes: object
) -> b.BootOutcome:
    """Boot a node that says this identification, and another one after a download."""
    loader.identification = identification
    take = loader.load

    def load(request: b.ProgramDownload) -> b.Answer:
        loader.identification = after
        return take(request)

    loader.load = load  # type: ignore[method-assign]
    return boot(loader, **{"mark": ProgramVersion(identification=0xCAFE), **changes})


def test_a_program_may_be_identified_by_its_identification_alone():
    loader = Loader()
    loader.version = None  # it has no 1F52h, as most devices
    outcome = known(loader, 0xCAFE)
    assert outcome.ok
    assert loader.orders() == []
    assert not [each for each in loader.asked if isinstance(each, b.Read) and each.index == 0x1F52]


def test_a_program_of_another_identification_is_replaced():
    loader = Loader()
    outcome = known(loader, 0xBEEF)
    assert outcome.ok
    assert loader.orders() == [0, 3, "data", 1]
    assert "program replaced: identification 0000BEEFh by identification 0000CAFEh" in outcome.done


def test_letter_h_by_the_identification():
    outcome = known(Loader(), 0xBEEF, allowed=False)
    assert (outcome.letter, outcome.address) == (b.Letter.H, (0x1F56, 1))
    assert (outcome.expected, outcome.got) == ("identification 0000CAFEh", "identification 0000BEEFh")


def test_letter_g_a_node_without_an_identification():
    outcome = known(Loader(), None)
    assert (outcome.letter, outcome.address, outcome.abort) == (b.Letter.G, (0x1F56, 1), MISSING)


def test_letter_i_a_program_of_another_identification_is_started():
    outcome = known(Loader(), 0xBEEF, after=0xF00D)
    assert (outcome.letter, outcome.address) == (b.Letter.I, (0x1F56, 1))
    assert outcome.got == "identification 0000F00Dh"


def test_if_both_are_expected_both_must_be_right():
    both = ProgramVersion(Version(*OLD), 0xCAFE)
    assert known(Loader(), 0xCAFE, mark=both).ok
    outcome = known(Loader(), 0xBEEF, mark=both, allowed=False)
    assert (outcome.letter, outcome.address) == (b.Letter.H, (0x1F56, 1))
    assert outcome.got == "2025-11-20 08:15:00, identification 0000BEEFh"


# -- letter I ------------------------------------------------------------------------------------------------------------


def failed(outcome: b.BootOutcome, stage: ProgramStage, address: tuple[int, int]) -> b.BootOutcome:
    assert (outcome.ok, outcome.letter, outcome.step) == (False, b.Letter.I, "program")
    assert (outcome.program.stage, outcome.address) == (stage, address)
    return outcome


@pytest.mark.parametrize(
    ("order", "stage"),
    [(0, ProgramStage.STOP), (3, ProgramStage.CLEAR), (1, ProgramStage.START)],
    ids=["stop", "clear", "start"],
)
def test_letter_i_an_order_that_is_refused(order, stage):
    loader = Loader()
    loader.control_refused[order] = REFUSED
    outcome = failed(boot(loader), stage, (0x1F51, 1))
    assert outcome.abort == REFUSED
    assert NmtCommand.START not in loader.commands()


def test_a_refused_program_command_is_no_failure_if_there_was_nothing_to_do():
    loader = Loader()  # as after a download that was cut short: no program, and nothing to stop
    loader.control, loader.version = 3, (0, 0)
    loader.control_refused = {0: REFUSED, 3: REFUSED}
    outcome = boot(loader)
    assert outcome.ok
    assert loader.orders() == [0, 3, "data", 1]


def test_letter_i_the_data_are_refused_and_are_not_sent_again():
    loader = Loader()
    loader.data_answers = [b.SdoAbortReply(0x0607_0012, 1.0)]
    assert failed(boot(loader), ProgramStage.TRANSFER, (0x1F50, 1)).abort == 0x0607_0012
    assert loader.orders() == [0, 3, "data"]


def test_letter_i_the_transfer_breaks_down_each_time():
    loader = Loader()
    loader.data_answers = [b.NoReply(20.0)] * 3
    assert failed(boot(loader), ProgramStage.TRANSFER, (0x1F50, 1)).tries == 3


def test_letter_i_a_node_that_dies_in_mid_transfer_is_reported_as_that():
    loader = Loader()

    def spoil(request: b.Request, answer: b.Answer) -> b.Answer:
        loader.dead = loader.dead or isinstance(request, b.ProgramDownload)
        return b.NoReply(20.0) if loader.dead and not isinstance(request, b.Pause) else answer

    loader.spoils = spoil
    outcome = failed(boot(loader), ProgramStage.TRANSFER, (0x1F50, 1))
    assert outcome.abort is None
    assert loader.orders() == [0, 3, "data"]


def test_letter_i_an_adapter_that_fails_in_mid_transfer():
    loader = Loader()
    loader.data_answers = [b.Failed(0.1)]
    failed(boot(loader), ProgramStage.TRANSFER, (0x1F50, 1))
    assert loader.orders() == [0, 3, "data"]


@pytest.mark.parametrize(("value", "words"), [(0x0A, "error 5"), (0x06, "error 3"), (0x02, "error 1")])
def test_letter_i_the_memory_reports_an_error(value, words):
    loader = Loader()
    loader.after = value
    outcome = failed(boot(loader), ProgramStage.FLASH, (0x1F57, 1))
    assert words in outcome.got
    assert outcome.expected == "error 0: no error"
    assert outcome.program.flash == (value,)
    assert 1 not in loader.orders()


def test_a_memory_error_of_the_cleared_program_is_ignored():
    loader = Loader()
    loader.flash = 0x02  # no valid program
    assert boot(loader).ok


@pytest.mark.parametrize(
    ("part", "stage"), [("clear_time", ProgramStage.CLEAR), ("flash_time", ProgramStage.FLASH)]
)
def test_letter_i_a_memory_that_stays_busy(part, stage):
    loader = Loader()
    setattr(loader, part, 1000.0)
    outcome = failed(boot(loader), stage, (0x1F57, 1))
    assert outcome.got == "still at work"
    assert 20.0 < outcome.elapsed < 40.0


def test_letter_i_a_node_that_does_not_return():
    loader = Loader()
    loader.restart_time = 1000.0
    outcome = failed(boot(loader), ProgramStage.START, (0x1F51, 1))
    assert 20.0 < outcome.elapsed < 40.0


def test_letter_i_a_node_that_restarts_late_and_does_not_return():
    loader = Loader()
    loader.restart_delay, loader.restart_time = 1.0, 1000.0
    failed(boot(loader), ProgramStage.RETURN, (0x1F52, 1))


def test_letter_i_a_program_of_another_date():
    loader = Loader()
    loader.takes = (15_401, 43_200_000)
    outcome = failed(boot(loader), ProgramStage.RETURN, (0x1F52, 1))
    assert (outcome.expected, outcome.got) == ("2026-03-01 12:00:00", "2026-03-02 12:00:00")
    assert outcome.program.now.version == (15_401, 43_200_000)
    assert not outcome.program.replaced


def test_letter_i_a_program_of_another_time():
    loader = Loader()
    loader.takes = (15_400, 0)
    assert failed(boot(loader), ProgramStage.RETURN, (0x1F52, 2)).got == "2026-03-01 00:00:00"


def test_letter_i_a_program_that_does_not_report_its_date():
    loader = Loader()
    loader.takes = None
    assert failed(boot(loader), ProgramStage.RETURN, (0x1F52, 1)).abort == MISSING


# -- lost answers --------------------------------------------------------------------------------------------------------


def steps_of_a_replacement() -> list[b.Request]:
    loader = Loader()
    boot(loader)
    return loader.asked


@pytest.mark.parametrize("lost", range(len(steps_of_a_replacement())))
@pytest.mark.parametrize("arrives", [True, False], ids=["the answer", "the request"])
def test_any_single_answer_may_be_lost(lost, arrives):
    """Whatever it is, and whether the node has received the request or not, the new program is loaded in the end."""
    loader = Loader()
    made, number = loader._made, iter(range(10_000))

    def lossy(request: b.Request) -> b.Answer:
        if next(number) != lost or isinstance(request, (b.Local, b.Pause)):
            return made(request)
        if arrives:
            made(request)
        return b.NoReply(request.deadline)

    loader._made = lossy  # type: ignore[method-assign]
    outcome = boot(loader)
    assert outcome.ok, (loader.asked[lost], outcome)
    assert outcome.program.now.version == NEW


def test_with_a_tenth_of_the_answers_lost_two_hundred_nodes_get_their_program():
    for seed in range(200):
        loader = Loader()
        chance = random.Random(seed)

        def spoil(request: b.Request, answer: b.Answer, chance: random.Random = chance) -> b.Answer:
            if isinstance(request, (b.Local, b.Pause, b.Listen)) or chance.random() >= 0.1:
                return answer
            return b.NoReply(request.deadline)

        loader.spoils = spoil
        outcome = boot(loader)
        assert outcome.ok, (seed, outcome)


def spoilt(**facts: object) -> Loader:
    """A node with some of its facts changed: attributes, or objects by ``oINDEX_SUB``."""
    loader = Loader()
    for name, value in facts.items():
        if name[0] == "o":
            index, sub = name[1:].split("_")
            loader.objects[int(index, 16), int(sub)] = value  # type: ignore[assignment]
        else:
            setattr(loader, name, value)
    return loader


def unguarded() -> Loader:
    loader = spoilt(guards=False)
    del loader.objects[0x1017, 0]
    return loader


# Letter -> a node that is wrong in this one way, and its plan.
REPRODUCED = {
    "A": (Loader, {"listed": False}),
    "B": (lambda: spoilt(dead=True), {}),
    "C": (lambda: spoilt(o1000_0=0x191), {}),
    "D": (lambda: spoilt(o1018_1=0x124), {}),
    "E": (lambda: spoilt(o1017_0=200, beats=False), {}),
    "F": (unguarded, {}),
    "G": (lambda: spoilt(version=None), {}),
    "H": (Loader, {"program": NodeProgram(MARK, DATA)}),
    "I": (lambda: spoilt(control_refused={3: REFUSED}), {}),
    "J": (lambda: spoilt(refuses={(0x6065, 0): REFUSED}), {}),
    "K": (lambda: spoilt(beats=False), {}),
    "L": (lambda: spoilt(o1017_0=100, state=NmtState.OPERATIONAL), {}),
    "M": (lambda: spoilt(o1018_2=0x457), {}),
    "N": (lambda: spoilt(o1018_3=0x10003), {}),
    "O": (lambda: spoilt(o1018_4=778), {}),
}


def test_each_letter_of_the_standard_is_reproduced():
    assert set(REPRODUCED) == {letter.name for letter in b.Letter}
    for letter, (node, changes) in REPRODUCED.items():
        facts = {"program": NodeProgram(MARK, DATA, True, 20.0), **changes}
        plan = b.BootPlan(5, identity=IDENTITY, settings=SETTINGS, heartbeat=0.1, **facts)
        if letter == "A":  # such a node is not asked for anything
            with pytest.raises(StopIteration) as end:
                next(boot_up(plan))
            outcome = end.value.value
        else:
            outcome = node().run(plan)
        assert outcome.letter is not None, letter
        assert outcome.letter.name == letter
        assert outcome.ok is (letter == "L")


# -- by command, without a boot-up -----------------------------------------------------------------------------------------


def write(loader: Loader, **changes: object) -> b.BootOutcome:
    """Write DATA by command; the identity of the program is not known unless a ``mark`` is given."""
    program = NodeProgram(
        **{"mark": ProgramVersion(), "data": DATA, "allowed": True, "deadline": 20.0, **changes}
    )
    machine = write_program(5, program)
    request = next(machine)
    while True:
        loader.asked.append(request)
        try:
            request = machine.send(loader.answer(request))
        except StopIteration as end:
            outcome: b.BootOutcome = end.value
            return outcome


def test_a_write_by_command_sends_only_what_the_program_needs():
    loader = Loader()
    outcome = write(loader)
    assert outcome.ok
    assert loader.orders() == [0, 3, "data", 1]
    assert loader.version == NEW
    assert not [each for each in loader.asked if isinstance(each, (b.BootNmtCommand, b.Local))]


@pytest.mark.parametrize("state", [0, 3], ids=["stopped", "cleared"])
def test_a_write_begins_again_for_a_node_in_its_boot_loader(state):
    loader = Loader()
    loader.control, loader.memory, loader.flash = state, DATA[:100], 0x02
    assert write(loader).ok
    assert loader.memory == DATA


def test_a_loader_that_refuses_to_stop_what_does_not_run_is_accepted():
    loader = Loader()
    loader.control, loader.control_refused = 3, {0: REFUSED}
    assert write(loader).ok


def test_a_program_that_does_not_run_after_its_start_is_no_success():
    loader = Loader()
    loader.spoils = lambda request, answer: (
        b.Got(0, 0.002) if isinstance(request, b.Read) and request.index == 0x1F51 else answer
    )
    outcome = write(loader)
    assert (outcome.ok, outcome.program.stage) == (False, ProgramStage.RETURN)
    assert (outcome.address, outcome.expected, outcome.got) == ((0x1F51, 1), 1, 0)


def test_an_application_without_1f51_counts_as_running():
    loader = Loader()
    begun: list[bool] = []

    def spoil(request: b.Request, answer: b.Answer) -> b.Answer:
        if isinstance(request, b.BootWrite) and request.value == 1:
            begun.append(True)
        hidden = bool(begun) and isinstance(request, b.Read) and request.index == 0x1F51
        return b.SdoAbortReply(MISSING, 0.002) if hidden else answer

    loader.spoils = spoil
    assert write(loader).ok


def test_a_write_waits_for_a_restart_that_comes_later_than_the_start():
    loader = Loader()
    loader.restart_delay, loader.restart_time = 1.0, 5.0
    outcome = write(loader)
    assert outcome.ok
    assert loader.now > 8.0
    assert loader.version == NEW


@pytest.mark.parametrize(("value", "ok"), [(0x1234, True), (0x1235, False)])
def test_an_identification_that_is_given_must_be_reported(value, ok):
    loader = Loader()
    loader.identification = 0x1234
    outcome = write(loader, mark=ProgramVersion(identification=value))
    assert outcome.ok is ok
    assert ok or (outcome.letter, outcome.address) == (b.Letter.I, (0x1F56, 1))
