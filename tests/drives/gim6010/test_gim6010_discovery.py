"""Modules are found by listening and by few harmless requests; foreign nodes are reported and left alone."""

from __future__ import annotations

import itertools
import random

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from axisbus.cia301.frame import CanFrame
from axisbus.drives.gim6010.can_simple.heartbeat import count_senders
from axisbus.drives.gim6010.discovery import report_text
from axisbus.drives.gim6010.discovery.finder import Bounds, Finder, ProbeScope
from axisbus.drives.gim6010.discovery.results import findings
from axisbus.drives.gim6010.sim.constants import Firmware
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import ArgumentError
from kit.module_search import Search, search
from kit.sim.can_simple_module import gim_eds

EDS = gim_eds()
QUIET = {"heartbeat_rate_ms": 0, "encoder_rate_ms": 0}


def silent(node, **more):
    return Module(node, eds=EDS, **QUIET, **more)


def canopen(node, **more):
    return Module(node, eds=EDS, protocol=2, **more)


def harmless(frame):
    """The test's own list of frames that command nothing in any of the protocols."""
    command = frame.can_id & 0x1F
    if frame.remote:
        return command in (0x0A, 0x17) and not frame.data
    if 0x600 < frame.can_id < 0x680 and frame.data[0] in (0x40, 0x60, 0x70, 0x80):
        return True
    if command == 0x17:
        return frame.data == bytes(8)
    if command == 0x04:
        return frame.data[0] == 0 and frame.data[1:3] in (b"\x05\0", b"\x09\0", b"\x0a\0", b"\x0b\0")
    return command == 0x03 and frame.data[0] in (0, 1, 3, 4) and not any(frame.data[1:])


def must_be_bounded(found):
    assert all(map(harmless, found.sent))
    times = [each.time for each in found.sent]
    assert all(after - before >= 0.01 - 1e-9 for before, after in itertools.pairwise(times))
    assert all(time >= 1.5 for time in times)
    assert max(found.finder.requests.values(), default=0) <= 24
    assert sum(found.finder.requests.values()) == len(found.sent)
    for plant in found.wire.plants:
        assert not any(each.energised or each.velocity for each in plant)


# -- findings -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("node", [0, 1, 5, 31, 48, 63])
@pytest.mark.parametrize(
    ("firmware", "layout"),
    [
        (Firmware(0, 5, 11), "firmware 0.5.11 and earlier"),
        (Firmware(0, 5, 12), "firmware 0.5.12 or firmware 0.5.13 and later"),
        (Firmware(0, 6, 5), "firmware 0.5.12 or firmware 0.5.13 and later"),
    ],
)
def test_a_module_is_found_in_each_layout_of_its_heartbeat(node, firmware, layout):
    found = search(Module(node, firmware=firmware, serial=0xAA_1234_5678))
    must_be_bounded(found)
    ((key, one),) = found.found.items()
    assert key == ("CAN Simple", node)
    assert (one.heartbeat, one.firmware, one.serial) == (layout, str(firmware), 0x12345678)
    assert (one.state, one.enabled, one.voltage, one.errors) == ("idle", False, 24.0, ())
    assert dict(one.words) == {"axis": 0, "motor": 0, "encoder": 0, "controller": 0, "system": 0}
    assert any("node ID 0 is the factory's" in note for note in one.notes) == (node == 0)


@pytest.mark.parametrize("node", [0, 3, 12, 23, 47, 48, 51, 63])
def test_a_module_that_sends_nothing_unasked_is_found_by_requests(node):
    found = search(silent(node))
    must_be_bounded(found)
    one = found.found["CAN Simple", node]
    assert (one.heartbeat, one.state, one.voltage) == ("none: it was found by its answers", None, 24.0)
    assert list(found.found) == [("CAN Simple", node)]


@pytest.mark.parametrize("node", [1, 16, 127])
def test_a_canopen_module_is_found_that_sends_nothing(node):
    found = search(canopen(node, serial=7) if node < 64 else silent(0))
    must_be_bounded(found)
    if node < 64:
        one = found.found["CANopen", node]
        assert one.ours
        assert (one.state, one.enabled, one.errors) == ("switch on disabled", False, ())


def test_the_modules_of_all_protocols_on_one_bus_are_found():
    found = search(
        Module(16), silent(24), canopen(33), Module(7, firmware=Firmware(0, 6, 8)), ask=ProbeScope.ALL
    )
    must_be_bounded(found)
    assert {*found.found} == {
        ("CAN Simple", 16),
        ("CAN Simple", 24),
        ("CANopen", 33),
        ("29-bit", None),
    }
    wide = found.found["29-bit", None]
    assert 7 in wide.addresses
    assert wide.firmware == "0.6.8 or later"
    assert all(each.can_id <= 0x7FF for each in found.sent)
    told = "\n".join(report_text.following(list(found.found.values()), "-i x -c y"))
    assert "axisbus init -i x -c y" in told
    assert "axisbus gim6010 to-canopen -i x -c y --node 16 --list endpoints_0.5.13.json" in told


def test_silent_nodes_are_found_if_only_a_module_of_the_29_bit_protocol_is_active():
    found = search(Module(7, firmware=Firmware(0, 6, 8)), silent(9))
    assert ("CAN Simple", 9) in found.found
    assert found.finder.picture.foreign() == []


def test_two_modules_that_cannot_share_a_bus_are_reported():
    """0A1h is the heartbeat of CAN Simple's node 5, and the EMCY of CANopen node 33."""
    found = search(Module(5), canopen(33))
    must_be_bounded(found)
    assert list(found.found) == [("CANopen", 33)]
    assert "node 5 of CAN Simple may be there" in "\n".join(report_text.about_the_bus(found.finder))


def test_requests_of_canopen_never_reach_a_module_as_commands():
    """601h to 67Fh are commands of the nodes 48 to 51: an emergency stop, a state, MIT control, CAN off."""
    for module in (Module(48), silent(49), Module(50), silent(51)):
        found = search(module)
        must_be_bounded(found)
        low = module.node_id << 5
        mine = [each for each in found.sent if low <= each.can_id < low + 32]
        assert {each.can_id & 0x1F for each in mine} <= {0x03, 0x04, 0x0A, 0x17}
        assert module.restarts == 0
        assert int(module.axis.error) == 0


def test_errors_and_a_closed_loop_are_reported():
    module = Module(5, dials=ModuleFaults(motor_error=0x8, encoder_error=0x4))
    found = search(module).found["CAN Simple", 5]
    assert any("DRV_FAULT" in each for each in found.errors)
    assert any("NO_RESPONSE" in each for each in found.errors)
    told = "\n".join(report_text.error_lines(found))
    assert "motor: 00000008h" in told
    assert "controller: 00000000h, no error" in told
    enabled = Module(6)
    enabled.on_frame(6 << 5 | 7, (8).to_bytes(8, "little"), 0.0)
    one = search(enabled).found["CAN Simple", 6]
    assert (one.state, one.enabled) == ("closed loop", True)
    assert any("power on the motor" in note for note in one.notes)


def test_a_module_that_answers_no_endpoint_and_no_error_word():
    dials = ModuleFaults(endpoints=False, get_error_answered=False)
    found = search(Module(5, dials=dials))
    must_be_bounded(found)
    one = found.found["CAN Simple", 5]
    assert one.endpoints is False
    assert one.firmware == "0.5.12 or later"
    assert {"it does not answer: endpoints", "it does not answer: error words"} <= set(one.notes)
    assert len([each for each in found.sent if each.can_id == 5 << 5 | 4]) == 1
    told = "\n".join(report_text.error_lines(one))
    assert "motor: not available over CAN; over USB it is odrv0.axis0.motor.error" in told


def test_answers_on_the_other_command_are_taken():
    found = search(Module(5, dials=ModuleFaults(endpoint_answer=0x05)))
    assert found.found["CAN Simple", 5].firmware == "0.5.13"


def test_error_words_sent_unasked_are_not_mistaken_for_answers():
    found = search(Module(5, dials=ModuleFaults(motor_error=8), motor_error_rate_ms=20))
    assert not [each for each in found.sent if each.can_id == 5 << 5 | 3]
    one = found.found["CAN Simple", 5]
    assert any(each.startswith("motor: its heartbeat reports a fault") for each in one.errors)


# -- several of one ID, and modules that go -----------------------------------------------------------------------------------


@pytest.mark.parametrize("firmware", [Firmware(0, 5, 11), Firmware(0, 5, 13)])
def test_two_modules_of_one_id_are_distinguished_from_one(firmware):
    one, other = (Module(5, firmware=firmware, serial=number) for number in (1, 2))
    for step in range(37):
        one.step(step / 1000)  # the other was switched on later
    one.take_frames()
    found = search(one, other)
    must_be_bounded(found)
    assert found.found["CAN Simple", 5].several
    assert not [each for each in found.sent if each.can_id >> 5 == 5]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-0.03, 0.03), min_size=40, max_size=40), st.integers(0, 255), st.booleans())
def test_a_module_with_uneven_heartbeats_does_not_count_as_two(late, life, counts):
    beats = [
        (0.1 * place + each, bytes(7) + bytes([(life + place) % 256 if counts else 0]))
        for place, each in enumerate(late)
    ]
    assert count_senders(beats) == 1


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 255), st.integers(0, 255), st.integers(5, 35), st.booleans())
@example(1, 0, 5, True)  # the second one is a step behind
@example(0, 1, 5, True)
@example(0, 2, 5, True)
def test_two_that_beat_in_turn_are_two(one, other, apart, counts):
    beats = sorted(
        (0.1 * place + shift, bytes(7) + bytes([(life + place) % 256 if counts else 0]))
        for life, shift in ((one, 0.0), (other, apart / 1000))
        for place in range(16)
    )
    assert count_senders(beats) == 2


def test_two_modules_of_one_id_that_beat_as_one_are_reported_by_their_answers():
    quiet = [silent(5, serial=number) for number in (1, 2)]
    assert search(*quiet).found["CAN Simple", 5].several
    assert not search(silent(5)).found["CAN Simple", 5].several
    assert not search(Module(5, bus_vi_rate_ms=10)).found["CAN Simple", 5].several


@pytest.mark.parametrize("when", [0.2, 0.7, 1.2, 1.49, 1.52, 1.6])
@pytest.mark.parametrize("silence", [0.2, 1.5])
def test_a_module_that_restarts_meanwhile(when, silence):
    module = Module(5, dials=ModuleFaults(restart_time=silence))

    def at(now):
        if module.restarts == 0 and now.wire.now > when:
            module.restart()

    found = search(module, at=at)
    must_be_bounded(found)
    one = found.found["CAN Simple", 5]
    assert one.state == "idle"
    assert any("restarted meanwhile" in note or "does not answer" in note for note in one.notes)
    assert not one.several


def test_two_canopen_modules_of_one_id_are_reported_by_their_answers():
    one, other = canopen(5), canopen(5)
    found = search(one, other)
    must_be_bounded(found)
    assert found.found["CANopen", 5].several
    assert any("several modules" in note for note in found.found["CANopen", 5].notes)
    assert not search(canopen(5)).found["CANopen", 5].several


@pytest.mark.parametrize("late", [40, 70, 110])
def test_late_answers_are_not_mistaken_for_those_of_a_second_module(late):
    """A voltage and a count of CAN Simple's node 9 and uploads of CANopen node 5, each so many milliseconds late."""
    coming = []

    def answer(request, now):
        value = {9 << 5 | 0x17: bytes(2) + b"\xc0\x41" + bytes(4), 9 << 5 | 0x0A: bytes(8)}.get(
            request.can_id
        )
        if request.can_id == 0x605:
            value = b"\x43" + request.data[1:4] + b"\0\0\x0c\0"
        if value is not None:
            can_id = 0x585 if request.can_id == 0x605 else request.can_id
            coming.append((now + late / 1000, can_id, value))
        return ()

    def strangers(now):
        due = [each for each in coming if each[0] <= now]
        coming[:] = [each for each in coming if each[0] > now]
        return [(can_id, data) for _, can_id, data in due]

    found = search(strangers=strangers, answer=answer, ask=ProbeScope.ALL)
    must_be_bounded(found)
    assert not any(each.several for each in found.found.values())
    if late < 60:
        assert {*found.found} == {("CAN Simple", 9), ("CANopen", 5)}


def test_identifiers_on_which_unasked_frames_are_received_later_are_not_used():
    """A device sends every other second, on identifiers of node 60 of CAN Simple and on the SDO of CANopen node 100."""

    def strangers(now):
        late = now > 1.6 and round(now * 1000) % 100 == 0
        return [(60 << 5 | 9, bytes(8)), (0x580 + 100, bytes(8))] if late else []

    found = search(strangers=strangers)
    must_be_bounded(found)
    assert {60 << 5 | 0x17, 0x600 + 100}.isdisjoint({each.can_id for each in found.sent})


def test_a_module_that_goes_silent_during_the_search_is_reported_with_what_was_read():
    module = Module(5)

    def at(now):
        module.dials.dead = now.wire.now > 1.5

    found = search(module, at=at)
    must_be_bounded(found)
    one = found.found["CAN Simple", 5]
    assert one.voltage is None
    assert "it does not answer: supply voltage" in one.notes


@pytest.mark.parametrize("length", [0, 1, 4, 7])
def test_answers_of_wrong_lengths_are_reported_and_not_used(length):
    def answer(request, _):
        if request.can_id == 5 << 5 | 0x17:
            return [(request.can_id, bytes(length))]
        return ()

    found = search(Module(5, dials=ModuleFaults(endpoints=False)), answer=answer)
    must_be_bounded(found)
    one = found.found["CAN Simple", 5]
    assert one.voltage in (None, 24.0)
    only = Search([], Finder(ask=ProbeScope.ALL, only=(5,)), answer=answer)
    assert only.found == {}


# -- requests that must not be sent -------------------------------------------------------------------------------------------


def test_foreign_traffic_is_named_and_silent_nodes_are_not_probed():
    found = search(Module(5), silent(9), strangers=lambda _: [(0x3E8, b"\1\2\3")])
    must_be_bounded(found)
    assert [each.can_id for each in found.finder.picture.foreign()] == [0x3E8]
    assert list(found.found) == [("CAN Simple", 5)]
    assert {each.can_id >> 5 for each in found.sent} == {5}
    told = "\n".join(report_text.about_the_bus(found.finder))
    assert "3E8h" in told
    assert "--ask all" in told


def test_nothing_is_sent_on_an_identifier_in_use_even_with_ask_all():
    busy = (0x3F7, 0x601, 0x582, 0x1234567)
    found = search(strangers=lambda _: [(each, bytes(8)) for each in busy], ask=ProbeScope.ALL)
    must_be_bounded(found)
    sent = {each.can_id for each in found.sent}
    assert sent.isdisjoint({0x3F7, 0x601, 0x602})
    assert 0x603 in sent
    assert found.found == {}


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32))
def test_random_traffic_is_never_answered_to(seed):
    """Unknown devices with any identifier and data: the finder ends, and sends nothing on a received identifier, nor a command."""
    chance = random.Random(seed)
    ids = [
        chance.randrange(0x800) if chance.random() < 0.8 else chance.randrange(0x800, 1 << 29)
        for _ in range(12)
    ]

    def strangers(_):
        if chance.random() < 0.8:
            return ()
        return [(chance.choice(ids), chance.randbytes(chance.randrange(9)))]

    found = search(strangers=strangers, ask=chance.choice((None, ProbeScope.HEARD, ProbeScope.ALL)))
    must_be_bounded(found)
    heard = {identifier for identifier, wide in found.finder.picture.heard if not wide}
    supervised = found.finder.picture.states  # CANopen nodes by their heartbeats may be asked
    for each in found.sent:
        assert (
            each.can_id not in heard
            or each.can_id - 0x600 in supervised
            or each.can_id & 0x1F in (3, 4, 10, 23)
        )


def test_without_remote_frames_known_modules_are_probed_by_data_frames_and_silent_ones_not_at_all():
    found = search(Module(16), silent(24), canopen(33), ask=ProbeScope.ALL, remote=False)
    must_be_bounded(found)
    assert {*found.found} == {("CAN Simple", 16), ("CANopen", 33)}
    assert found.found["CAN Simple", 16].voltage == 24.0
    assert not any(frame.remote for frame in found.sent)
    (why,) = (why for why in found.finder.left_out if "no remote frames" in why)
    assert 24 in found.finder.left_out[why]
    assert 16 not in found.finder.left_out[why]


def test_only_listening_sends_nothing():
    found = search(Module(5), ask=ProbeScope.NOBODY)
    assert found.sent == []
    one = found.found["CAN Simple", 5]
    assert (one.state, one.voltage) == ("idle", None)
    assert "it was not asked" in one.notes


def test_the_first_sign_that_no_node_acknowledges_ends_the_asking():
    """The one frame in transmission is repeated by the controller until it is acknowledged: there must be no second."""
    told = []

    def at(now):
        if now.sent and not told:
            told.append(now.wire.now)
            now.finder.trouble("no acknowledge")

    found = search(at=at)
    assert len(found.sent) == 1
    assert "no node acknowledges: no acknowledge" in "\n".join(report_text.about_the_bus(found.finder))


def test_on_a_silent_bus_the_first_request_is_waited_for_longer():
    """Until a controller has reported the missing acknowledge."""
    found = search()
    must_be_bounded(found)
    assert found.sent[1].time - found.sent[0].time >= 0.1 - 1e-9
    assert found.found == {}
    assert len(found.sent) >= 64 + 127


@pytest.mark.parametrize("most", [6, 24])
def test_the_requests_to_one_module_are_bounded(most):
    """A CANopen node whose objects all arrive in segments without a last one."""

    def answer(request, _):
        if request.can_id != 0x605 or request.data[0] == 0x80:
            return ()
        first = request.data[0] == 0x40
        data = (
            b"\x40" + request.data[1:4] + bytes(4) if first else bytes([request.data[0] & 0x10]) + b"segment"
        )
        return [(0x580 + 5, data)]

    found = Search([], Finder(ask=ProbeScope.ALL, only=(5,), bounds=Bounds(most=most)), answer=answer)
    assert len([each for each in found.sent if each.can_id == 0x605]) == most


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(0, (1 << 29) - 1), st.binary(max_size=8), st.booleans(), st.booleans(), st.booleans()
        ),
        max_size=60,
    )
)
def test_no_frame_ends_it_with_an_exception(frames):
    finder = Finder(ask=ProbeScope.ALL, bounds=Bounds(listen=0.05))
    now = 0.0
    for can_id, data, extended, remote, error in frames:
        now += 0.002
        finder.note(CanFrame(now, can_id if extended else can_id & 0x7FF, data, extended, remote, error))
        finder.step(now)
    findings(finder)
    list(report_text.about_the_bus(finder))


# -- words --------------------------------------------------------------------------------------------------------------------


def test_a_word_is_explained_without_a_bus():
    assert report_text.parse("axis=0x100000") == ("axis", 1 << 20)
    told = "\n".join(report_text.of_words([("axis", 1 << 20), ("motor", 1 << 33 | 1 << 2)]))
    assert "CAN_BUS_FAILED" in told
    assert "UNKNOWN_GAINS" in told
    assert "motor bit 0x00000004 is not in the module's fault table" in told


@pytest.mark.parametrize(
    "text", ["axis", "axis=", "axis=x", "axis=-1", "axis=0x100000000", "wheel=1", "motor=0x10000000000000000"]
)
def test_an_invalid_error_word_is_refused(text):
    with pytest.raises(ArgumentError):
        report_text.parse(text)
