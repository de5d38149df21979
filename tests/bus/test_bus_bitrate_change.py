"""A bus changes its bit rate: first the slaves, then the adapter, then every slave is asked; each result is reported."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from types import SimpleNamespace

import pytest

from axisbus.bus.link import bitrate_change
from axisbus.bus.link.bitrate_change import Opening, OwnRate, change_over
from axisbus.bus.link.channel import Channel
from axisbus.bus.lss import LssMaster
from axisbus.cia305.dialogue import LssTiming
from axisbus.cia305.services import LssAddress
from axisbus.errors import AdapterError, LssTimeout
from kit.bus.fake_bus import FakeBus, Frame
from kit.lss_line import HandSlave
from kit.manual_clock import HandClock

ONE, OTHER = LssAddress(0xC0B00, 8, 1, 1), LssAddress(0xC0B00, 8, 1, 2)
DELAY = 0.05
PATIENT = LssTiming(floor=0.05, first=0.5)
PCAN = Opening("pcan", "PCAN_USBBUS1", 1_000_000)


class AtOneRate(HandSlave):
    """A slave that receives on a bus only at its own rate; it changes over with the activation, unless it is ``stubborn``.

    ``restarting``: the number of frames at its new rate that it does not receive.
    """

    def __init__(self, address: LssAddress, *, stubborn: bool = False) -> None:
        super().__init__(*address.parts, 5)
        self.at_rate = 0
        self.stubborn = stubborn
        self.restarting = 0

    def on(self, rate: int) -> Callable[[int, bytes, bool], list[Frame]]:
        """The slave as a peer of a bus of this rate (0: the old one)."""

        def hear(can_id: int, data: bytes, _remote: bool) -> list[Frame]:
            if can_id != 0x7E5 or self.at_rate != rate:
                return []
            if self.at_rate and self.restarting:
                self.restarting -= 1
                return []
            answer = self.hear(data)
            if data[0] == 0x15 and self.activated is not None and not self.stubborn:
                self.at_rate = 250_000
            return [] if answer is None else [(0x7E4, answer)]

        return hear


class Desk:
    """The two buses of a change-over, the old rate's and the new one's, and a record of how the second was opened."""

    def __init__(self, *slaves: AtOneRate) -> None:
        self.before, self.after = FakeBus(), FakeBus()
        for slave in slaves:
            self.before.peers.append(slave.on(0))
            self.after.peers.append(slave.on(250_000))
        self.opened: list[tuple[str, int]] = []
        self.opened_at = 0.0
        self.old_was_open: bool | None = None
        self.trouble: AdapterError | None = None
        self.stack = ExitStack()
        self.channel = self.stack.enter_context(Channel(self.before, "pcan:PCAN_USBBUS1"))
        self.master = LssMaster(self.channel, PATIENT, beside_operation=True)

    def open_again(self, opening: Opening, bitrate: int) -> Channel:
        self.opened.append((opening.interface, bitrate))
        self.opened_at = time.monotonic()
        self.old_was_open = self.before.is_open
        if self.trouble is not None:
            raise self.trouble
        return Channel(self.after, "pcan:PCAN_USBBUS1")

    def change(
        self, addresses: list[LssAddress] | None, opening: Opening = PCAN
    ) -> bitrate_change.ChangedOver:
        self.master.set_bit_rate(addresses, 250_000)
        return change_over(self.master, addresses, 250_000, DELAY, opening, self.stack, self.open_again)


@pytest.fixture
def desk() -> Iterator[Callable[..., Desk]]:
    with ExitStack() as stack:

        def make(*slaves: AtOneRate) -> Desk:
            made = Desk(*slaves)
            stack.callback(made.stack.close)
            return made

        yield make


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bitrate_change, "ANSWER_TIME", 0.0)


def test_the_adapter_changes_while_the_slaves_are_silent_and_each_slave_is_asked_at_the_new_rate(
    desk,
) -> None:
    slaves = AtOneRate(ONE), AtOneRate(OTHER)
    table = desk(*slaves)
    begin = time.monotonic()
    done = table.change([ONE, OTHER])
    assert table.before.frames(0x7E5)[-1].hex() == "1532000000000000"  # 50 ms; nothing more at the old rate
    assert (table.opened, table.old_was_open) == ([("pcan", 250_000)], False)
    assert table.opened_at - begin >= DELAY
    assert time.monotonic() - begin >= 2 * DELAY
    assert (done.adapter, done.answered, done.silent, done.complete) == (
        OwnRate.REOPENED,
        (ONE, OTHER),
        (),
        True,
    )
    assert table.after.frames(0x7E5)[-1].hex() == "0400000000000000"  # all slaves are back in waiting state


def test_no_frame_is_sent_at_the_new_rate_before_the_second_delay_has_passed(desk) -> None:
    table = desk(AtOneRate(ONE))
    sent_at: list[float] = []
    table.after.peers.append(lambda *_: sent_at.append(time.monotonic()) or [])
    activated: list[float] = []
    table.before.peers.append(
        lambda _, data, __: activated.append(time.monotonic()) or [] if data[:1] == b"\x15" else []
    )
    table.change([ONE])
    assert sent_at[0] - activated[0] >= 2 * DELAY


def test_a_slave_that_restarts_for_the_new_rate_is_asked_again(desk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bitrate_change, "ANSWER_TIME", 20.0)
    slave = AtOneRate(ONE)
    slave.at_rate, slave.restarting = 250_000, 19  # a whole question, with its tries
    table = desk(slave)
    channel = table.stack.enter_context(Channel(table.after, "pcan:PCAN_USBBUS1"))
    master = LssMaster(channel, LssTiming(floor=0.05, first=0.05), beside_operation=True)
    assert bitrate_change._answers(master, ONE)
    assert slave.restarting == 0


@pytest.mark.parametrize(("answers_after", "asked"), [(0.0, 1), (2.9, 7), (4.8, 11), (5.1, 11), (9.0, 11)])
def test_a_slave_that_is_silent_is_asked_until_five_seconds_are_over(
    monkeypatch: pytest.MonkeyPatch, answers_after: float, asked: int
) -> None:
    """With a pause between the requests, each of which takes 0.3 s here."""
    monkeypatch.setattr(bitrate_change, "ANSWER_TIME", 5.0)
    clock, questions = HandClock(1000.0), list[LssAddress]()

    def inquire(address: LssAddress) -> None:
        questions.append(address)
        begin, clock.time = clock.time, clock.time + 0.3
        if begin - 1000.0 < answers_after:
            raise LssTimeout("nobody answers", service="inquire")

    master = SimpleNamespace(inquire=inquire, channel=SimpleNamespace(clock=clock))
    assert bitrate_change._answers(master, ONE) is (answers_after < 5.0)
    assert questions == [ONE] * asked
    assert clock.slept == [0.2] * (asked - 1)


def test_a_slave_that_did_not_change_its_rate_is_named(desk) -> None:
    table = desk(AtOneRate(ONE), AtOneRate(OTHER, stubborn=True))
    done = table.change([ONE, OTHER])
    assert (done.answered, done.silent, done.complete) == ((ONE,), (OTHER,), False)


def test_if_a_named_slave_is_silent_nothing_is_activated_and_the_adapter_keeps_its_rate(desk) -> None:
    table = desk(AtOneRate(ONE))
    table.master.set_bit_rate([ONE], 250_000)
    with pytest.raises(LssTimeout):
        change_over(table.master, [ONE, OTHER], 250_000, DELAY, PCAN, table.stack, table.open_again)
    assert table.opened == []
    assert table.before.is_open


def test_if_the_adapter_cannot_be_opened_at_the_new_rate_the_state_of_every_slave_is_reported(desk) -> None:
    table = desk(AtOneRate(ONE))
    table.trouble = AdapterError(
        "the CAN adapter pcan:PCAN_USBBUS1 cannot be opened", observed="PcanError: illegal rate"
    )
    with pytest.raises(AdapterError) as caught:
        table.change([ONE])
    assert caught.value.message == (
        "the slaves were changed over to 250000 bit/s, but the adapter pcan:PCAN_USBBUS1 cannot be used at it"
    )
    assert "illegal rate" in caught.value.observed
    assert "open the bus at 250000 bit/s" in caught.value.remedy


def test_a_bus_on_which_no_node_acknowledges_at_the_new_rate_is_reported_as_half_changed(desk) -> None:
    table = desk(AtOneRate(ONE, stubborn=True))
    table.after.full = True
    with pytest.raises(AdapterError, match="were changed over to 250000 bit/s") as caught:
        table.change([ONE])
    assert "refused frame 7E5h" in caught.value.observed


def test_a_link_of_the_systems_is_left_alone_and_the_lines_are_reported_in_order(desk) -> None:
    table = desk(AtOneRate(ONE))
    done = table.change([ONE], Opening("socketcan", "can0", 1_000_000))
    assert (table.opened, table.before.is_open) == ([], True)
    assert (done.asked, done.complete, done.adapter) == (False, False, OwnRate.SYSTEM)
    assert done.commands == (
        "sudo ip link set can0 down",
        "sudo ip link set can0 up type can bitrate 250000 restart-ms 100",
        "sudo ip link set can0 txqueuelen 1000",
    )


@pytest.mark.parametrize(
    ("opening", "own"),
    [
        (PCAN, OwnRate.REOPENED),
        (Opening("slcan", "/dev/ttyACM0", 500_000), OwnRate.REOPENED),
        (
            Opening("pcan", "PCAN_USBBUS1", None, {"timing": object()}),
            OwnRate.SYSTEM,
        ),  # its writer must change it
        (Opening("socketcand", "can0"), OwnRate.SYSTEM),
        (Opening("virtual", "here"), OwnRate.NONE),
        (Opening("udp_multicast", "239.0.0.1"), OwnRate.NONE),
    ],
)
def test_whether_the_adapter_or_the_system_sets_the_bit_rate(opening: Opening, own: OwnRate) -> None:
    assert opening.own_rate is own
