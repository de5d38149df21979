"""A whole session of ours, recorded on the virtual bus and decoded; and frames that must never be sent."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus import Machine
from axisbus.bus.link.listen import listen
from axisbus.cell import reader
from axisbus.cia301.frame import CanFrame
from axisbus.core.files import load_dictionaries
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork
from axisbus.trace import context, filters
from axisbus.trace.decoded import FrameKind
from axisbus.trace.decoder import Decoder
from axisbus.trace.frame_formats import line, plain

CELL = Path(__file__).parents[2] / "examples" / "cell.toml"


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """The frames of a boot-up, an enabling, a homing, a move and closing, with the known parts of the cell."""
    path = tmp_path_factory.mktemp("trace") / "cell.toml"
    text = CELL.read_text().replace('interface = "sim"', 'interface = "virtual"\nchannel = "trace-session"')
    path.write_text(text)
    loaded = reader.load(path)
    files = load_dictionaries(loaded)
    devices = [device_from_eds(eds, node_id, seed=node_id) for node_id, eds in files.items()]
    with listen("virtual", "trace-session", None, {}) as listener:
        with SimulatedNetwork("trace-session", devices), Machine.open(path) as cell:
            cell["x"].enable().wait()
            cell["x"].home().wait()
            cell["x"].move_absolute(1.0).wait()
        frames = list(listener.frames(1.5))
    return frames, context.of_cell(loaded, files)


def _decode(frames, what):
    decoder = Decoder(what)
    return [decoder.feed(frame) for frame in frames]


def test_every_frame_is_decoded_without_complaint(session):
    frames, cell = session
    decoded = _decode(frames, cell)
    assert [line(one) for one in decoded if one.problem or one.kind is FrameKind.UNKNOWN] == []
    assert {one.kind for one in decoded} >= {
        FrameKind.NMT,
        FrameKind.SYNC,
        FrameKind.SDO,
        FrameKind.RPDO,
        FrameKind.TPDO,
        FrameKind.HEARTBEAT,
        FrameKind.BOOT_UP,
    }


def test_every_pdo_is_decoded_by_the_mapping_in_the_recording(session):
    """Without any file: mappings are learned from the SDO transfers of the recording."""
    frames, cell = session
    with_files = _decode(frames, cell)
    alone = _decode(frames, context.NOTHING)
    for one, other in zip(with_files, alone, strict=True):
        if one.kind in (FrameKind.TPDO, FrameKind.RPDO):
            assert [value.value for value in one.values] == [value.value for value in other.values]
            assert one.values


def test_the_states_of_the_axis_can_be_read(session):
    frames, cell = session
    words = [
        value.words
        for one in _decode(frames, cell)
        if one.node == 1
        for value in one.values
        if value.index == 0x6041
    ]
    states = [word.split(";")[0] for word in words]
    assert states.index("switch on disabled") < states.index("operation enabled")
    assert states[-1] != "operation enabled"
    assert any("homing attained" in word for word in words)
    assert any("set-point acknowledge" in word for word in words)


def test_filters(session):
    frames, cell = session
    decoded = _decode(frames, cell)
    commands = [
        one for one in decoded if filters.parse(["node=x", "object=6040", "kind=rpdo,sdo"], axes=("x",))(one)
    ]
    assert commands
    assert {one.node for one in commands} == {1}
    named = filters.parse(["object=controlword"])
    assert all(named(one) for one in commands)
    assert not any(filters.parse(["node=1,2,3"])(one) for one in decoded if one.kind is FrameKind.SYNC)


identifiers = st.one_of(
    st.integers(0, 0x7FF),
    st.sampled_from([0x000, 0x080, 0x081, 0x100, 0x181, 0x201, 0x581, 0x601, 0x701, 0x7E4, 0x7E5]),
)
# SDO frames that go far: a command, one of a few objects, and anything.
sdo = st.builds(
    lambda command, index, sub, rest: bytes([command]) + index.to_bytes(2, "little") + bytes([sub]) + rest,
    st.integers(0, 255),
    st.sampled_from([0x1005, 0x1014, 0x1200, 0x1400, 0x1600, 0x1800, 0x1A00, 0x6041, 0x6060, 0x1008, 0xFFFF]),
    st.integers(0, 9),
    st.binary(min_size=4, max_size=4),
)
frame = st.builds(
    CanFrame,
    st.floats(-10, 1e9),
    identifiers,
    st.one_of(st.binary(max_size=8), sdo),
    extended=st.booleans(),
    remote=st.booleans(),
    error=st.sampled_from([False, False, False, True]),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(frame, max_size=40))
def test_no_frame_at_all_breaks_the_decoder(frames):
    decoder = Decoder()
    for one in map(decoder.feed, frames):
        assert line(one)
        assert json.loads(json.dumps(plain(one), allow_nan=False))["cob_id"] == one.frame.can_id
