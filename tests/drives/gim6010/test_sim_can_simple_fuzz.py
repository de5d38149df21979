"""For any frames, a simulated module raises nothing, is not energised without a request, and never jumps."""

from __future__ import annotations

import struct

from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.drives.gim6010.sim.module import Module
from kit.sim.can_simple_module import CLOSED_LOOP, RX_SDO, SET_MODE, SET_STATE, TX_SDO, Bench

_STEP = 0.002  # s
_lengths = st.binary(max_size=8)
_floats = st.tuples(st.floats(width=32), st.floats(width=32)).map(lambda both: struct.pack("<ff", *both))
_modes = st.tuples(st.integers(0, 10), st.integers(0, 10)).map(lambda both: struct.pack("<II", *both))
_data = st.one_of(_lengths, _floats, _modes)
_frames = st.lists(st.tuples(st.integers(0, 31), _data, st.booleans(), st.booleans()), max_size=25)


@settings(max_examples=40)
@given(frames=_frames)
def test_no_module_is_energised_without_a_request(frames):
    """Endpoints are left out: by one of them a state may be asked for."""
    bench = Bench(Module(5))
    for command, data, remote, ours in frames:
        if (command == SET_STATE and not remote and len(data) >= 4) or command in (RX_SDO, TX_SDO):
            continue
        bench.send((5 if ours else 6) << 5 | command, data, remote=remote)
        bench.run(_STEP, _STEP)
    assert not any(plant.energised for plant in bench.plant)
    assert {plant.position for plant in bench.plant} <= {0.0}


@settings(max_examples=60)
@given(frames=_frames, mode=_modes)
def test_random_frames_in_closed_loop_neither_raise_nor_cause_a_jump(frames, mode):
    bench = Bench(Module(5))
    bench.send(5 << 5 | SET_MODE, mode)
    bench.order(SET_STATE, CLOSED_LOOP)
    for command, data, remote, _ in frames:
        bench.send(bench.node << 5 | command, data, remote=remote)
        bench.run(4 * _STEP, _STEP)
    bench.must_be_smooth(hardest=1100.0)
    for frame in bench.heard:
        assert frame.can_id <= 0x7FF
        assert len(frame.data) in (4, 8)


@settings(max_examples=30)
@given(can_id=st.integers(0, 0x1FFF_FFFF), data=_lengths, remote=st.booleans())
def test_frames_of_others_are_ignored(can_id, data, remote):
    bench = Bench(Module(5))
    if can_id >> 5 != 5:
        assert bench.send(can_id, data, remote=remote) == []
    bench.run(_STEP, _STEP)
    assert not bench.module.energised or can_id >> 5 == 5
