"""The simulated drive under any frames: SDO server, LSS slave, PDOs, NMT; it answers by valid frames, and works afterwards."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.eds import builtin, load
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.slave import Slave
from kit import fuzz_frames as fuzz

EDS = {name: load(builtin.resolve(f"builtin:{name}", Path())) for name in ("gim6010-8", "generic-cia402")}
ID = fuzz.NODE

_CIA301 = "1000 1003 1005 1006 100C 1010 1011 1012 1014 1016 1017 1018 1019 1029 1200 1201 1F50 1F51"
_PDOS = "1400 1401 1600 1601 1800 1801 1A00 1A01"
_CIA402 = "6040 605A 6060 6071 607A 607C 607D 6081 6083 6085 6091 6098 60C2 60FF"
indices = st.sampled_from([int(each, 16) for each in f"{_CIA301} {_PDOS} {_CIA402}".split()])
values = fuzz.numbers32 | st.sampled_from(
    [0x6041_0010, 0x6064_0020, 0x185, 0x8000_0185, 0x6576_6173, 0x6461_6F6C, 6, 7, 15]
)
asked = st.builds(
    lambda command, index, sub, value: (
        bytes([command]) + fuzz.multiplexer(index, sub) + value.to_bytes(4, "little")
    ),
    st.sampled_from([0x23, 0x27, 0x2B, 0x2F, 0x22, 0x21, 0x20, 0x40, 0xA0, 0xA4, 0xC2, 0xC6, 0x80]),
    indices | st.integers(0, 0xFFFF),
    st.integers(0, 6) | st.integers(0, 255),
    values,
)
behind = st.builds(
    lambda command, data: bytes([command]) + data,
    st.sampled_from([0x00, 0x01, 0x10, 0x11, 0x60, 0x70, 0xA1, 0xA2, 0xA3, 0xC1, 0xC5, 0x81, 0x02, 0x7F])
    | st.integers(0, 255),
    st.binary(min_size=7, max_size=7),
)
sdo = fuzz.mutated(asked | behind) | fuzz.any_bytes
lss = fuzz.mutated(
    st.builds(
        lambda command, number, rest: bytes([command]) + number.to_bytes(4, "little") + rest,
        st.sampled_from(
            [0x04, 0x11, 0x13, 0x15, 0x17, *range(0x40, 0x44), *range(0x46, 0x4D), 0x51, *range(0x5A, 0x5F)]
        ),
        fuzz.numbers32,
        st.binary(min_size=3, max_size=3),
    )
)
nmt = fuzz.mutated(
    st.builds(
        lambda command, node: bytes([command, node]),
        st.sampled_from([1, 2, 128, 129, 130, 7]),
        st.sampled_from([0, ID, 9]),
    )
)
frames = st.one_of(
    st.tuples(st.just(0x600 + ID), sdo),
    st.tuples(st.just(0x600 + ID), sdo),
    st.tuples(st.just(0x7E5), lss),
    st.tuples(st.just(0x000), nmt),
    st.tuples(
        st.sampled_from([0x200 + ID, 0x300 + ID, 0x400 + ID, 0x500 + ID, 0x80, 0x100, 0x700 + 127]),
        fuzz.any_bytes,
    ),
)
steps = st.tuples(frames, st.sampled_from([0.0, 0.001, 0.01, 1.5]), st.sampled_from([False] * 9 + [True]))


def check(sent: list[tuple[int, bytes]]) -> None:
    for can_id, data in sent:
        assert 0 <= can_id <= 0x7FF
        assert len(data) <= 8
        assert len(data) == 8 or can_id & 0x780 != 0x580


@pytest.mark.parametrize("name", EDS)
@given(script=st.lists(steps, max_size=30))
@settings(max_examples=60)
def test_any_frame_is_taken_and_the_node_answers_after_a_reset(name, script):
    device = device_from_eds(EDS[name], ID, seed=1)
    slave, now = Slave(device), 0.0
    for _ in range(5):
        slave.step(now)
        now += 0.5
    count = 0
    for (can_id, data), dt, remote in script:
        slave.on_frame(can_id, b"" if remote else data, now, remote=remote)
        now += dt
        slave.step(now)
        sent = slave.take_frames()
        check(sent)
        count += len(sent)
        assert count < 400 * (1 + len(script))
    # Whatever it received, without a node-ID even: a reset of the node restores its stored one.
    device.lss.pending = device.lss.stored = ID
    slave.on_frame(0, b"\x81\0", now)
    device.lss.active = ID
    for _ in range(40):
        now += 0.5
        slave.step(now)
    slave.take_frames()
    slave.on_frame(0x600 + ID, bytes.fromhex("4000100000000000"), now)
    for _ in range(4):
        now += 0.1
        slave.step(now)
    answers = [data for can_id, data in slave.take_frames() if can_id == 0x580 + ID]
    assert [answer[:4].hex() for answer in answers] == ["43001000"]
