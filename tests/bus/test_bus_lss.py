"""The LSS master on a channel: real frames, boot-ups, and never under a running machine."""

from __future__ import annotations

import threading

import pytest

from axisbus.bus import lss as bus_lss
from axisbus.bus.link.channel import Channel
from axisbus.bus.lss import LssMaster
from axisbus.cia305.dialogue import LssTiming
from axisbus.cia305.scan_result import Check, KnownIdentity
from axisbus.cia305.services import LssAddress
from axisbus.errors import (
    AdapterError,
    ArgumentError,
    LssRefused,
    LssTimeout,
    StateError,
)
from kit.bus.fake_bus import FakeBus, Frame, Slave
from kit.lss_line import AnswersOnSelected, HandSlave
from kit.repeating_thread import again

ADDRESS = LssAddress(0xC0B00, 8, 1, 4711)
PATIENT = LssTiming(floor=0.05, first=0.5)  # the machine may be busy
_waiting = "0400000000000000"


class OnTheBus(HandSlave):
    """A slave as a peer of the fake bus: it boots under its node-ID, and obeys a reset of its communication."""

    def __call__(self, can_id: int, data: bytes, remote: bool) -> list[Frame]:
        booted = len(self.booted_as)
        answer = None
        if can_id == 0x7E5:
            answer = self.hear(data)
        elif can_id == 0 and data[0] == 130 and data[1] == self.active:
            self.active = self.pending
            self.booted_as.append(self.active)
        frames = [(0x7E4, answer)] if answer is not None else []
        return frames + [(0x700 + node_id, b"\0") for node_id in self.booted_as[booted:]]


def slave(serial: int = 4711, node_id: int = 255) -> OnTheBus:
    return OnTheBus(0xC0B00, 8, 1, serial, node_id)


@pytest.fixture
def master(channel: Channel) -> LssMaster:
    return LssMaster(channel, PATIENT, beside_operation=True)


def test_every_slave_without_a_node_id_is_found_and_left_in_waiting_state(
    master: LssMaster, fake: FakeBus
) -> None:
    slaves = [slave(serial) for serial in (4711, 4712)]
    fake.peers += [*slaves, slave(9, node_id=3)]
    known = KnownIdentity(vendor_id=0xC0B00, product_code=8, revision_number=1)
    found = master.find(known)
    assert [each.address.serial_number for each in found.slaves] == [4711, 4712]
    assert all(one.state == "waiting" for one in slaves)


class AnsweringOn(OnTheBus, AnswersOnSelected):
    """The same with the stack that answers fast scan in configuration."""


def test_slaves_that_continue_answering_are_found_and_configured(channel: Channel, fake: FakeBus) -> None:
    master = LssMaster(channel, LssTiming(floor=0.02), beside_operation=True)
    stubborn, good = AnsweringOn(0xC0B00, 8, 1, 4711), slave(4713)
    fake.peers += [stubborn, good]
    found = master.find(KnownIdentity(vendor_id=0xC0B00, product_code=8, revision_number=1))
    assert [(each.address.serial_number, each.answers_on, each.check) for each in found.slaves] == [
        (4711, True, Check.CONFIRMED),
        (4713, False, Check.NOT_NEEDED),
    ]
    assert (stubborn.state, good.state) == ("waiting", "waiting")
    assert master.set_node_id(ADDRESS, 5, store=True).booted
    assert (stubborn.active, good.active) == (5, 255)


def test_progress_is_reported_in_the_callers_thread(channel: Channel, fake: FakeBus) -> None:
    fake.peers.append(slave())
    told: list[tuple[int, int, int]] = []

    def tell(found: int, bits: int) -> None:
        told.append((found, bits, threading.get_ident()))

    LssMaster(channel, PATIENT, on_progress=tell, beside_operation=True).find()
    assert {thread for *_, thread in told} == {threading.get_ident()}
    assert max(bits for _, bits, _ in told) == 128


def test_a_node_id_is_given_and_its_boot_up_is_seen(master: LssMaster, fake: FakeBus) -> None:
    one = slave()
    fake.peers.append(one)
    given = master.set_node_id(ADDRESS, 5, store=True)
    assert (given.booted, given.set.at_once, one.active, one.stored) == (True, True, 5, [5])


def test_a_node_that_has_a_node_id_changes_it_when_it_is_reset(master: LssMaster, fake: FakeBus) -> None:
    one = slave(node_id=3)
    fake.peers.append(one)
    assert master.set_node_id(ADDRESS, 5).booted is None
    assert one.active == 3
    assert master.set_node_id(ADDRESS, 5, reset=True).booted is True
    assert one.active == 5
    assert fake.frames(0) == [bytes((130, 3))]


class BootsWhenReset(OnTheBus):
    """It takes a node-ID with NMT reset communication only, as slaves of lely do."""

    def _global(self, mode: int) -> None:
        self.state = "configuration" if mode else "waiting"

    def __call__(self, can_id: int, data: bytes, remote: bool) -> list[Frame]:
        if can_id == 0 and tuple(data) == (130, self.pending):
            self.active = self.pending
            return [(0x700 + self.active, b"\0")]
        return super().__call__(can_id, data, remote)


def test_a_slave_that_takes_its_first_node_id_with_a_reset_gets_one(
    master: LssMaster, fake: FakeBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bus_lss, "BOOT_WAIT", 0.1)
    one = BootsWhenReset(0xC0B00, 8, 1, 4711)
    fake.peers.append(one)
    assert master.set_node_id(ADDRESS, 5).booted is False
    assert fake.frames(0) == []  # no reset unless asked for
    assert master.set_node_id(ADDRESS, 5, reset=True).booted is True
    assert fake.frames(0) == [bytes((130, 5))]


def test_a_node_that_does_not_boot_is_reported(
    master: LssMaster, fake: FakeBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bus_lss, "BOOT_WAIT", 0.1)
    one = slave()
    fake.peers.append(
        lambda can_id, data, remote: [each for each in one(can_id, data, remote) if each[0] == 0x7E4]
    )
    assert master.set_node_id(ADDRESS, 5).booted is False


@pytest.mark.parametrize(("had", "booted"), [(255, True), (3, None)])
def test_a_node_that_does_not_report_its_node_id(
    master: LssMaster, fake: FakeBus, monkeypatch: pytest.MonkeyPatch, had: int, booted: bool | None
) -> None:
    one = slave(node_id=had)
    one.deaf_for = {0x5E}
    fake.peers.append(one)
    if booted is None:
        monkeypatch.setattr(bus_lss, "BOOT_WAIT", 0.1)
    given = master.set_node_id(ADDRESS, 5, reset=True)
    assert (given.set.old, given.booted) == (None, booted)
    assert fake.frames(0) == []  # no node is reset on a guess


def test_a_node_id_that_is_taken_is_not_given(master: LssMaster, fake: FakeBus) -> None:
    one = slave()
    fake.peers += [one, Slave(5)]
    with pytest.raises(StateError, match="node-ID 5 is in use"):
        master.set_node_id(ADDRESS, 5)
    assert one.pending == 255


def test_the_lss_master_may_set_the_node_id_that_the_slave_already_has(
    master: LssMaster, fake: FakeBus
) -> None:
    one = slave(node_id=5)
    fake.peers += [one, Slave(5)]
    master.set_node_id(ADDRESS, 5, store=True)
    assert one.stored == [5]


def test_after_any_failure_all_slaves_are_switched_back_to_waiting_state(
    master: LssMaster, fake: FakeBus
) -> None:
    one = slave()
    one.errors[0x17] = (255, 3)
    fake.peers.append(one)
    with pytest.raises(LssRefused, match="manufacturer-specific error 3"):
        master.store(ADDRESS)
    assert one.state == "waiting"
    assert fake.frames(0x7E5)[-1].hex() == _waiting


def test_bit_rates_are_activated_and_the_silence_is_kept(master: LssMaster, fake: FakeBus) -> None:
    one = slave()
    fake.peers.append(one)
    master.set_bit_rate([ADDRESS], 250_000, store=True)
    master.activate([ADDRESS], 0.05)
    assert (one.bit_timing, one.activated, len(one.stored)) == ((0, 3), 50, 1)
    assert fake.frames(0x7E5)[-1].hex() == "1532000000000000"  # and nothing after it


def test_naming_no_slave_is_an_error(master: LssMaster, fake: FakeBus) -> None:
    with pytest.raises(ArgumentError, match="no LSS slave is named"):
        master.activate([], 1.0)
    with pytest.raises(ArgumentError, match="no bit rate of 123"):
        master.set_bit_rate([ADDRESS], 123)
    with pytest.raises(ArgumentError, match="node-ID 0"):
        master.set_node_id(ADDRESS, 0)
    assert fake.sent == []


@pytest.mark.parametrize(
    ("frame", "sign"),
    [
        ((0x080, ""), "SYNC is sent"),
        ((0x703, "05"), "node 3 is operational"),
        ((0x183, "3702"), "node 3 sends PDOs"),
    ],
)
def test_a_bus_in_operation_is_left_alone(
    channel: Channel, fake: FakeBus, frame: tuple[int, str], sign: str
) -> None:
    with again(lambda: fake.inject(*frame), 0.02), pytest.raises(StateError, match="in operation") as caught:
        LssMaster(channel).find()
    assert sign in caught.value.observed
    assert fake.sent == []


def test_with_beside_operation_lss_does_not_require_a_quiet_bus(channel: Channel, fake: FakeBus) -> None:
    fake.peers.append(slave())
    with again(lambda: fake.inject(0x080, ""), 0.02):
        assert LssMaster(channel, PATIENT, beside_operation=True).inquire(ADDRESS).address == ADDRESS


def test_a_bus_whose_nodes_are_stopped_is_not_in_operation(channel: Channel, fake: FakeBus) -> None:
    fake.peers.append(slave())
    with again(lambda: fake.inject(0x703, "04"), 0.02):
        assert LssMaster(channel, PATIENT).inquire(ADDRESS).address == ADDRESS


def test_answers_of_other_services_and_rubbish_do_not_count(master: LssMaster, fake: FakeBus) -> None:
    one = slave()

    def noisy(can_id: int, data: bytes, remote: bool) -> list[Frame]:
        return [(0x7E4, b""), (0x7E4, b"\x99"), *one(can_id, data, remote), (0x7E4, bytes(8))]

    fake.peers.append(noisy)
    assert master.inquire(ADDRESS).node_id == 255


def test_late_answers_make_the_wait_longer(channel: Channel, fake: FakeBus) -> None:
    """Each answer comes 80 ms after its request, beyond the wait of 20 ms."""
    one = slave()
    timers: list[threading.Timer] = []

    def slow(can_id: int, data: bytes, remote: bool) -> list[Frame]:
        for answer in one(can_id, data, remote):
            timer = threading.Timer(0.08, fake.inject, answer)
            timers.append(timer)
            timer.start()
        return []

    fake.peers.append(slow)
    master = LssMaster(channel, LssTiming(floor=0.02, first=0.02, tries=20), beside_operation=True)
    assert master.inquire(ADDRESS).address == ADDRESS
    assert master.pace.timeout > 0.08
    for timer in timers:
        timer.join()


def test_a_channel_that_fails_is_reported(master: LssMaster, fake: FakeBus) -> None:
    fake.fail_receiving(OSError("gone"))
    with pytest.raises(AdapterError, match="stopped receiving"):
        master.find()


def test_a_bus_on_which_no_node_acknowledges_is_reported(master: LssMaster, fake: FakeBus) -> None:
    fake.full = True
    with pytest.raises(AdapterError, match="refused frame 7E5h"):
        master.inquire(ADDRESS)


def test_an_lss_service_is_refused_in_the_receive_thread(
    channel: Channel, fake: FakeBus, master: LssMaster
) -> None:
    raised: list[Exception] = []
    done = threading.Event()

    def receive(data: bytes, stamp: float) -> None:
        try:
            master.find()
        except StateError as error:
            raised.append(error)
        done.set()

    channel.subscribe(0x123, receive)
    fake.inject(0x123, "00")
    assert done.wait(10)
    channel.unsubscribe(0x123, receive)
    assert "receive thread" in str(raised[0])


def test_after_lss_there_is_no_subscription(master: LssMaster, channel: Channel, fake: FakeBus) -> None:
    fake.peers.append(slave())
    master.set_node_id(ADDRESS, 5)
    with pytest.raises(LssTimeout):
        master.inquire(LssAddress(1, 2, 3, 4))
    assert channel._receivers == {}
    assert channel.on_failure == []


def test_slaves_are_identified_by_a_range_and_without_a_node_id(master: LssMaster, fake: FakeBus) -> None:
    fake.peers.append(slave(node_id=7))
    assert master.identify(LssAddress(0xC0B00, 8, 0, 0), LssAddress(0xC0B00, 8, 9, 9999))
    assert not master.any_unconfigured()
