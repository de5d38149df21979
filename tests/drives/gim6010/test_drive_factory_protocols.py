"""The factory protocol of a module is recognised by listening, and plain CANopen traffic is never mistaken for it."""

from __future__ import annotations

import struct

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from axisbus.cia301.frame import CanFrame
from axisbus.drives.foreign_protocols import ForeignProtocols
from axisbus.drives.gim6010.factory_protocols import ENOUGH, Protocol, ProtocolListener


def beats(node, *, count=8, state=1, error=0, period=0.1, life=True, start=0.0, flags=0):
    """Heartbeats of a module as the manual has them (v2.2, 4.1.2)."""
    return [
        CanFrame(
            start + number * period,
            node << 5 | 1,
            struct.pack("<IBBBB", error, state, flags, 0, (250 + number) % 256 if life else 0),
        )
        for number in range(count)
    ]


def positions(node, *, count=40, period=0.01):
    return [
        CanFrame(number * period, node << 5 | 9, struct.pack("<ff", 0.25 + number / 1000, 0.0))
        for number in range(count)
    ]


def merged(*lots):
    return sorted((frame for lot in lots for frame in lot), key=lambda frame: frame.time)


def canopen_heartbeats(node, *, count=10, period=0.1, state=5):
    return [CanFrame(number * period, 0x700 + node, bytes((state,))) for number in range(count)]


def recognise(frames):
    listening = ProtocolListener()
    for frame in frames:
        listening.note(frame)
    return listening.speakers


@pytest.mark.parametrize("node", range(64))
def test_each_node_id_is_recognised_by_its_heartbeats(node):
    (speaker,) = recognise(beats(node))
    assert (speaker.protocol, speaker.node, speaker.can_id) == (Protocol.CAN_SIMPLE, node, node << 5 | 1)
    assert speaker.period == pytest.approx(0.1)
    assert speaker.words == f"node {node} ({node << 5 | 1:03X}h every 100 ms: idle)"


@pytest.mark.parametrize("node", [0, 1, 2, 3])
def test_old_firmware_without_a_life_counter_is_recognised_if_no_canopen_device_may_use_the_identifier(node):
    assert [each.node for each in recognise(beats(node, life=False))] == [node]


@pytest.mark.parametrize("node", [12, 16, 33])
def test_old_firmware_elsewhere_is_recognised_only_with_its_position_frames(node):
    assert recognise(beats(node, life=False)) == []
    assert [each.node for each in recognise(merged(beats(node, life=False), positions(node)))] == [node]
    bus = merged(beats(node, life=False), positions(node), canopen_heartbeats(99))
    assert recognise(bus) == []


def test_a_frame_that_would_be_an_emcy_without_an_error_is_not_counted_as_one():
    assert [each.node for each in recognise(beats(4, life=False))] == [4]
    assert recognise(beats(4, life=False, error=0x1000)) == []


@pytest.mark.parametrize(("node", "other"), [(4, 1), (5, 33), (12, 1), (16, 1), (44, 1), (56, 1)])
def test_a_canopen_heartbeat_of_the_node_that_the_identifier_belongs_to_settles_it(node, other):
    assert recognise(merged(beats(node), canopen_heartbeats(other))) == []
    guarding = [CanFrame(0.05, 0x700 + other, b"", remote=True)]
    assert recognise(merged(beats(node), guarding)) == []
    assert recognise(merged(beats(node), canopen_heartbeats(other + 1)))


def test_a_factory_fresh_module_on_a_running_canopen_bus_is_recognised():
    bus = merged(beats(1), positions(1), canopen_heartbeats(1), canopen_heartbeats(2))
    assert [each.node for each in recognise(bus)] == [1]


@pytest.mark.parametrize("count", range(ENOUGH))
def test_a_few_frames_are_no_proof(count):
    assert recognise(beats(0, count=count)) == []


def test_lost_frames_and_jitter_are_borne():
    kept = [frame for number, frame in enumerate(beats(12, count=16)) if number not in (3, 8, 9)]
    shaken = [frame._replace(time=frame.time + 0.01 * (number % 3 - 1)) for number, frame in enumerate(kept)]
    assert [each.node for each in recognise(shaken)] == [12]


def test_frames_without_times_are_judged_by_their_counter():
    assert [each.period for each in recognise([f._replace(time=0.0) for f in beats(0)])] == [None]
    assert recognise([f._replace(time=0.0) for f in beats(0, life=False)]) == []


@pytest.mark.parametrize(
    "spoil",
    [
        lambda frame: frame._replace(data=frame.data[:7]),
        lambda frame: frame._replace(data=frame.data[:4] + b"\0" + frame.data[5:]),
        lambda frame: frame._replace(data=frame.data[:4] + b"\x11" + frame.data[5:]),
        lambda frame: frame._replace(data=frame.data[:5] + b"\x40" + frame.data[6:]),
        lambda frame: frame._replace(remote=True, data=b""),
        lambda frame: frame._replace(error=True),
        lambda frame: frame._replace(extended=True),
        lambda frame: frame._replace(time=frame.time * 100),
    ],
    ids=["7 bytes", "state 0", "state 17", "flag 6", "remote", "error", "29 bits", "every 10 s"],
)
def test_other_frames_are_not_mistaken_for_such_a_heartbeat(spoil):
    assert recognise([spoil(frame) for frame in beats(12)]) == []


def test_faults_are_named():
    (speaker,) = recognise(beats(1, error=0x4040, state=8, flags=0x85))
    assert speaker.words.endswith("closed loop, axis error 0x00004040 (MOTOR_FAILED, ESTOP_REQUESTED))")


def extended(node, *, count=10, period=0.1, master=1, kind=0x48):
    can_id = 6 << 26 | kind << 18 | master << 10 | node << 2
    return [
        CanFrame(
            number * period, can_id, bytes(((number % 8) << 5, 0x12, 0x4E, 0, 0, 0, 0, 0)), extended=True
        )
        for number in range(count)
    ]


def test_the_29_bit_protocol_is_recognised():
    assert extended(1)[0].can_id == 0x19200404
    (speaker,) = recognise(extended(1))
    assert (speaker.protocol, speaker.node) == (Protocol.EXTENDED, 1)
    assert [each.node for each in recognise(merged(extended(1), extended(3)))] == [1, 3]


def test_other_29_bit_traffic_is_not():
    assert recognise(extended(1, kind=0x49)) == []
    still = [frame._replace(data=bytes(8)) for frame in extended(1)]
    assert recognise(still) == []


def test_the_message_names_both_protocols_and_the_remedy():
    listening = ForeignProtocols()
    assert listening.lines() == []
    for frame in merged(beats(0), beats(1), extended(7)):
        listening.note(frame)
    lines = listening.lines()
    assert lines[0].startswith(
        "2 modules speak CAN Simple, not CANopen: node 0 (001h every 100 ms: idle), node 1"
    )
    assert "axisbus gim6010 to-canopen changes its protocol" in lines[1]
    assert lines[2].startswith(
        "1 module speaks the 29-bit protocol of newer firmware, not CANopen: node 7 (1920041Ch"
    )
    assert "0.6.8" in lines[3]
    assert len(lines) == 4


# -- plain CANopen traffic ---------------------------------------------------------------------------------------------------

node_ids = st.integers(1, 127)
octets = st.binary(min_size=8, max_size=8)
# Frames most similar to a heartbeat of CAN Simple: a state, flags and a counter, all at their positions.
alike = st.builds(
    lambda error, state, flags: [struct.pack("<IBBBB", error, state, flags, 0, n % 256) for n in range(16)],
    st.sampled_from([0, 0x40, 0x1000]),
    st.integers(1, 16),
    st.sampled_from([0, 1, 0x80]),
)
still = st.one_of(octets, st.builds(lambda lot: lot[0], alike)).map(lambda data: [data] * 16)
contents = st.one_of(still, alike, st.lists(octets, min_size=16, max_size=16))
periods = st.sampled_from([0.001, 0.004, 0.01, 0.1, 0.5, 1.0])


@st.composite
def supervised_node(draw):
    """A node with a heartbeat, whatever its PDOs and its SDO server say, as often as they like."""
    node, period = draw(node_ids), draw(periods)
    frames = canopen_heartbeats(node, count=draw(st.integers(1, 16)), period=period)
    bases = (0x80, 0x180, 0x280, 0x380, 0x480, 0x580, 0x200, 0x300, 0x400, 0x500, 0x600)
    for base in draw(st.lists(st.sampled_from(bases), max_size=4, unique=True)):
        every = draw(periods)
        frames += [CanFrame(n * every, base + node, data) for n, data in enumerate(draw(contents))]
    return frames


@st.composite
def silent_node(draw):
    """A node whose heartbeat is off: it sends PDOs once another has started it, an EMCY when something happens."""
    node, every = draw(node_ids), draw(periods)
    data = draw(st.one_of(octets.map(lambda one: [one] * 16), st.lists(octets, min_size=16, max_size=16)))
    base = draw(st.sampled_from([0x180, 0x280, 0x380, 0x480]))
    frames = [CanFrame(n * every, base + node, one) for n, one in enumerate(data)]
    for number, code in enumerate(draw(st.lists(st.integers(1, 0xFFFF), max_size=8))):
        frames.append(CanFrame(2.0 * number, 0x80 + node, struct.pack("<HBHBBB", code, 1, 0, 0, 0, 0)))
        frames.append(CanFrame(2.0 * number + 1, 0x80 + node, bytes(8)))
    return frames


@st.composite
def canopen_bus(draw):
    master = [CanFrame(0.0, 0, bytes((1, 0))), *canopen_heartbeats(draw(node_ids), period=0.1)]
    sync = [CanFrame(n * 0.01, 0x80, b"") for n in range(draw(st.integers(0, 20)))]
    nodes = draw(st.lists(st.one_of(supervised_node(), silent_node()), max_size=4))
    return merged(master, sync, *nodes)


@given(canopen_bus())
@example(merged(beats(4), canopen_heartbeats(1)))
@example(merged(beats(12), canopen_heartbeats(1)))
@example(merged(beats(12, life=False), positions(12), canopen_heartbeats(2)))
def test_plain_canopen_traffic_is_never_called_anything_else(frames):
    assert recognise(frames) == []


@given(canopen_bus(), st.sampled_from([0, 1, 2, 3]), st.integers(1, 16), st.booleans())
def test_a_module_is_found_on_a_bus_with_plain_canopen_traffic(frames, node, state, life):
    found = recognise(merged(frames, beats(node, state=state, life=life)))
    assert [(each.node, each.state) for each in found] == [(node, state)]


@given(
    st.lists(
        st.builds(
            CanFrame,
            st.floats(allow_nan=True, allow_infinity=True),
            st.integers(0, 0x1FFFFFFF),
            st.binary(max_size=8),
            st.booleans(),
            st.booleans(),
            st.booleans(),
        )
    )
)
def test_no_frame_makes_it_raise(frames):
    listening = ProtocolListener()
    for frame in frames:
        listening.note(frame)
        listening.speaker(frame)
    assert isinstance(listening.speakers, list)
